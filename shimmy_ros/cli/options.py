"""Options that several subcommands share."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import Any

from ..cycles.prediction import DEFAULT_HARMONICS
from ..gear.parameter_file import load_parameters, reference_parameters
from ..gear.parameters import Damper, Gear, changed

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
                        help="number of odd harmonics (default: %(default)s)")


def gear_and_damper(options: argparse.Namespace) -> tuple[Gear, Damper]:
    """What add_gear_options' options name. Raises ParameterError."""
    gear, damper = load_parameters(*options.gear) if options.gear else reference_parameters()
    given = {name: getattr(options, name)
             for name in ("linear_damping", "quadratic_damping", "coulomb_torque")
             if getattr(options, name) is not None}
    return gear, changed(damper, **given)
