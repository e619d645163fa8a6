"""``shimmy predict``: what an oscillation of the gear grows to at one operating point."""

from __future__ import annotations

import argparse
import json
import math
from collections.abc import Sequence
from typing import Any

from ..cycles.orbits import Orbit
from ..cycles.prediction import Predictor
from ..cycles.settings import SHOOTING
from ..cycles.verdict import Verdict
from ..gear.matrices import NAMES
from ..gear.parameters import ParameterError
from ..gear.system import OperatingPoint
from ..ihb.solution import Outcome
from .options import Commands, add_gear_options, add_settings_options, gear_and_damper, settings_of

NOT_CONVERGED = 1
UNBOUNDED = 3
"""Exit statuses of what is no ordinary answer."""

_STATUSES = {Outcome.NOT_CONVERGED: NOT_CONVERGED, Outcome.UNBOUNDED: UNBOUNDED}


def add_command(commands: Commands) -> None:
    """Declare the subcommand."""
    parser: argparse.ArgumentParser = commands.add_parser(
        "predict", help="the limit cycle at one taxi velocity",
        description="Predict the stable limit cycle that a growing shimmy oscillation reaches. "
        "Exit status 0 with an answer: a limit cycle, none, or motion that stays bounded and "
        "settles on none; 1 when the solve did not converge, 2 on bad input, 3 where motion grows "
        "without bound.")
    parser.add_argument("--velocity", type=float, required=True, metavar="V",
                        help="taxi velocity, m/s")
    add_gear_options(parser)
    add_settings_options(parser)
    parser.add_argument("--json", action="store_true", help="print JSON")
    parser.set_defaults(run=run)


def run(options: argparse.Namespace) -> int:
    """Predict and print; raises ParameterError on bad input."""
    gear, damper = gear_and_damper(options)
    predictor = Predictor(settings_of(options))
    verdict = predictor.predict(OperatingPoint(gear, damper, options.velocity))
    if verdict.outcome is Outcome.NOT_ROLLING:
        raise ParameterError(
            f"--velocity is {options.velocity:g}, but must be at least the minimum velocity of "
            f"{options.minimum_velocity:g} m/s, below which the tyre does not roll")
    if options.json:
        print(json.dumps(as_json(verdict), allow_nan=False))
    else:
        print("\n".join(sentences(verdict)))
    return _STATUSES.get(verdict.outcome, 0)


def as_json(verdict: Verdict) -> dict[str, Any]:
    """The verdict for JSON; what is not there (amplitudes without a cycle) is null."""
    orbit, envelope, kick = verdict.orbit, verdict.envelope, verdict.kick
    damper = verdict.point.damper
    return {
        "outcome": verdict.outcome.value,
        "amplitude": None if orbit is None else _by_name(orbit.amplitude),
        "peak_velocity": None if orbit is None else _by_name(orbit.peak_velocity()),
        "frequency": None if orbit is None else orbit.frequency_hz,
        "envelope": None if envelope is None else _by_name(envelope),
        "beyond_limits": [{"quantity": excess.quantity, "value": excess.value,
                           "limit": excess.limit} for excess in verdict.excesses],
        "rest_is_stable": verdict.rest_is_stable,
        "kick": None if kick is None else {
            "dies": kick.dies, "grows": kick.grows, "unbounded": kick.unbounded},
        "further_stable_cycles": [
            {"amplitude": _by_name(other.amplitude), "frequency": other.frequency_hz,
             "error": _finite(other.error)} for other in verdict.further],
        "method": None if orbit is None else orbit.method,
        "harmonics": _harmonics(verdict),
        "work": verdict.work,
        "residual": _finite(verdict.residual),
        "estimated_error": _finite(verdict.error),
        "multiplier": None if orbit is None else _finite(orbit.multiplier),
        "taxi_velocity": verdict.point.velocity,
        "linear_damping": damper.linear_damping,
        "quadratic_damping": damper.quadratic_damping,
        "coulomb_torque": damper.coulomb_torque,
        "message": verdict.message,
    }


def sentences(verdict: Verdict) -> list[str]:
    """The verdict for people, in lines; the first one says how it ended."""
    orbit, envelope = verdict.orbit, verdict.envelope
    beyond = verdict.beyond_limits
    marked = f" BEYOND THE MODEL'S LIMITS ({beyond})" if beyond else ""
    if orbit is not None:
        lines = [f"Limit cycle at {orbit.frequency_hz:.4f} Hz{marked}: "
                 f"{_motion(orbit.amplitude)}.",
                 f"A growing oscillation would reach it{_disturbances(verdict)}.",
                 _how(verdict, orbit)]
        lines += [f"Another stable limit cycle, which other disturbances reach, at "
                  f"{other.frequency_hz:.4f} Hz: {_motion(other.amplitude)}."
                  for other in verdict.further]
        return lines
    if envelope is not None:
        return [f"Not periodic{marked}: motion that grows settles on no cycle; it stays below "
                f"{_motion(envelope)}.", *_known_disturbances(verdict)]
    message = verdict.message
    return [f"{message[0].upper()}{message[1:]}."]


def _motion(amplitude: Sequence[float] | Any) -> str:
    tilt, swivel, damper, lateral = map(float, amplitude)
    return (f"swivel {swivel:.5f} rad ({math.degrees(swivel):.3f} deg), damper {damper:.5f} rad, "
            f"strut tilt {tilt:.5f} rad, tyre lateral {lateral:.5f} m")


def _disturbances(verdict: Verdict) -> str:
    """Which disturbances grow, as the end of a sentence; empty where that is not known."""
    kick = verdict.kick
    if verdict.rest_is_stable is False:
        return ": rest is unstable, any disturbance grows"
    if kick is not None:
        dies = f"a kick of the swivel of {kick.dies:.4g} rad/s dies, one" if kick.dies else "a kick"
        unbounded = ("" if kick.unbounded is None else
                     f", and one of {kick.unbounded:.4g} rad/s grows without bound")
        return f": {dies} of {kick.grows:.4g} rad/s grows{unbounded}"
    return ": rest is stable, small disturbances die" if verdict.rest_is_stable else ""


def _known_disturbances(verdict: Verdict) -> list[str]:
    known = _disturbances(verdict).removeprefix(": ")
    return [f"{known[0].upper()}{known[1:]}."] if known else []


def _how(verdict: Verdict, orbit: Orbit) -> str:
    accuracy = f"relative residual {verdict.residual:.1e}, estimated error {orbit.error:.1e}."
    if orbit.method == SHOOTING:
        return f"By shooting: {accuracy}"
    return f"{orbit.harmonics} harmonics, {accuracy}"


def _harmonics(verdict: Verdict) -> int:
    """Of the balance that was the answer; else what was asked for."""
    found = 0 if verdict.orbit is None else verdict.orbit.harmonics
    return found or verdict.settings.harmonics


def _by_name(values: Any) -> dict[str, float]:
    return {name: float(value) for name, value in zip(NAMES, values, strict=True)}


def _finite(value: float) -> float | None:
    return value if math.isfinite(value) else None
