"""``shimmy predict``: the limit cycle at one operating point."""

from __future__ import annotations

import argparse
import json
import math
from typing import Any

from ..cycles.prediction import NOT_ROLLING, Prediction, Predictor
from ..gear.matrices import NAMES
from ..gear.parameters import DEFAULT_MINIMUM_VELOCITY, ParameterError
from ..gear.system import OperatingPoint
from .options import Commands, add_gear_options, add_harmonics_option, gear_and_damper


def add_command(commands: Commands) -> None:
    """Declare the subcommand."""
    parser: argparse.ArgumentParser = commands.add_parser(
        "predict", help="the limit cycle at one taxi velocity",
        description="Predict the limit cycle that a growing shimmy oscillation reaches. Exit "
        "status 0 with an answer, 1 when the solve did not converge, 2 on bad input.")
    parser.add_argument("--velocity", type=float, required=True, metavar="V",
                        help="taxi velocity, m/s")
    add_gear_options(parser)
    add_harmonics_option(parser)
    parser.add_argument("--minimum-velocity", type=float, metavar="V",
                        default=DEFAULT_MINIMUM_VELOCITY,
                        help="refuse velocities at which the tyre does not roll (default: "
                        "%(default)s m/s)")
    parser.add_argument("--json", action="store_true", help="print JSON")
    parser.set_defaults(run=run)


def run(options: argparse.Namespace) -> int:
    """Predict and print; raises ParameterError on bad input."""
    gear, damper = gear_and_damper(options)
    predictor = Predictor(options.harmonics, options.minimum_velocity)
    prediction = predictor.predict(OperatingPoint(gear, damper, options.velocity))
    if prediction.outcome == NOT_ROLLING:
        raise ParameterError(
            f"--velocity is {options.velocity:g}, but must be at least the minimum velocity of "
            f"{options.minimum_velocity:g} m/s, below which the tyre does not roll")
    if options.json:
        print(json.dumps(as_json(prediction), allow_nan=False))
    else:
        print(_sentences(prediction))
    return 1 if prediction.failed else 0


def as_json(prediction: Prediction) -> dict[str, Any]:
    """The prediction for JSON; what is not there (amplitudes without a cycle) is null."""
    cycle = prediction.limit_cycle
    damper = prediction.point.damper
    return {
        "outcome": prediction.outcome,
        "amplitude": None if cycle is None else _by_name(cycle.amplitude()),
        "peak_velocity": None if cycle is None else _by_name(cycle.peak_velocity()),
        "frequency": None if cycle is None else cycle.frequency_hz,
        "harmonics": prediction.harmonics,
        "iterations": prediction.iterations,
        "residual": prediction.residual if math.isfinite(prediction.residual) else None,
        "taxi_velocity": prediction.point.velocity,
        "linear_damping": damper.linear_damping,
        "quadratic_damping": damper.quadratic_damping,
        "coulomb_torque": damper.coulomb_torque,
        "message": prediction.message,
    }


def _by_name(values: Any) -> dict[str, float]:
    return {name: float(value) for name, value in zip(NAMES, values, strict=True)}


def _sentences(prediction: Prediction) -> str:
    cycle = prediction.limit_cycle
    if cycle is None:
        return prediction.message[0].upper() + prediction.message[1:] + "."
    tilt, swivel, damper, lateral = cycle.amplitude()
    how = (f"{prediction.harmonics} harmonics, {prediction.iterations} iterations, relative "
           f"residual {prediction.residual:.1e}.")
    if cycle.harmonics != prediction.harmonics:
        how = (f"By shooting, as {prediction.harmonics} harmonics do not tell; relative residual "
               f"{prediction.residual:.1e}.")
    return (
        f"Limit cycle at {cycle.frequency_hz:.4f} Hz: swivel {swivel:.5f} rad "
        f"({math.degrees(swivel):.3f} deg), damper {damper:.5f} rad, strut tilt {tilt:.5f} rad, "
        f"tyre lateral {lateral:.5f} m.\n{how}")
