"""Options that several subcommands share."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import Any

from ..cycles.settings import DEFAULT_ACCURACY, DEFAULT_BUDGET, DEFAULT_HARMONICS, Settings
from ..gear.parameter_file import load_limits, load_parameters, reference_parameters
from ..gear.parameters import DEFAULT_MINIMUM_VELOCITY, Damper, Gear, changed

Commands = Any  # argparse's subparsers object, whose class is not public


def add_gear_options(parser: argparse.ArgumentParser) -> None:
    """The gear's file and the damper's parameters."""
    parser.add_argument("--gear", metavar="FILE", type=Path, action="append", default=[],
                        help="parameter file, a ROS 2 params YAML; again to override parts of it "
                        "(default: the reference gear, which is invented)")
    parser.add_argument("--linear-damping", type=float, metavar="C_t", help="N m s/rad")
    parser.add_argument("--quadratic-damping", type=float, metavar="C_d", help="N m s^2/rad^2")
    parser.add_argument("--coulomb-torque", type=float, metavar="T_CF", help="N m")


def add_harmonics_option(parser: argparse.ArgumentParser) -> None:
    """The number of odd harmonics."""
    parser.add_argument("--harmonics", type=int, metavar="N", default=DEFAULT_HARMONICS,
                        help="number of odd harmonics of the balance to begin with (default: "
                        "%(default)s)")


def add_settings_options(parser: argparse.ArgumentParser) -> None:
    """What answers depend on besides gear, damper and velocity."""
    add_harmonics_option(parser)
    parser.add_argument("--accuracy", type=float, metavar="E", default=DEFAULT_ACCURACY,
                        help="estimated relative error allowed of amplitudes and frequency "
                        "(default: %(default)s)")
    parser.add_argument("--budget", type=float, metavar="S", default=DEFAULT_BUDGET,
                        help="work that an answer may take, in seconds of an ordinary core; "
                        "counted and not timed (default: %(default)s)")
    parser.add_argument("--minimum-velocity", type=float, metavar="V",
                        default=DEFAULT_MINIMUM_VELOCITY,
                        help="below it the tyre does not roll (default: %(default)s m/s)")


def settings_of(options: argparse.Namespace) -> Settings:
    """What add_settings_options' options name, and the limits of --gear. Raises ParameterError."""
    return Settings(harmonics=options.harmonics, accuracy=options.accuracy, budget=options.budget,
                    minimum_velocity=options.minimum_velocity, limits=load_limits(*options.gear))


def gear_and_damper(options: argparse.Namespace) -> tuple[Gear, Damper]:
    """What add_gear_options' options name. Raises ParameterError."""
    gear, damper = load_parameters(*options.gear) if options.gear else reference_parameters()
    given = {name: getattr(options, name)
             for name in ("linear_damping", "quadratic_damping", "coulomb_torque")
             if getattr(options, name) is not None}
    return gear, changed(damper, **given)
