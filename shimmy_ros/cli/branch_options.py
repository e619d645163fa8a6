"""What the subcommands share that follow branches over a range: options, ranges, titles."""

from __future__ import annotations

import argparse
import math
import sys
from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

from ..cycles.settings import AUTO, BALANCE, METHODS, SHOOTING, Settings
from ..gear.axes import VELOCITY, Axis, axis_names
from ..gear.parameters import ParameterError
from ..gear.system import OperatingPoint
from ..report.branch_table import Row, write_csv, write_json
from .options import add_settings_options, settings_of
from .progress import INTERRUPTED, STOPPED

DEFAULT_STEPS = 50
MOST_STEPS = 10_000


def add_branch_options(parser: argparse.ArgumentParser) -> None:
    """How limit cycles are computed."""
    add_settings_options(parser)
    parser.add_argument("--method", choices=METHODS, default=AUTO,
                        help=f"{AUTO} changes from {BALANCE} to {SHOOTING} where the swivel sticks "
                        "and where the balance is not accurate enough (default: %(default)s)")


def add_output_options(parser: argparse.ArgumentParser) -> None:
    """Where tables and pictures go."""
    parser.add_argument("--csv", metavar="FILE", type=Path, help="write the table there")
    parser.add_argument("--json", metavar="FILE", type=Path, help="the same as JSON")
    parser.add_argument("--plot", metavar="FILE", type=Path, help="write a picture, PNG")


def branch_settings(options: argparse.Namespace) -> Settings:
    """What add_branch_options' options name. Raises ParameterError."""
    return replace(settings_of(options), method=options.method)


def axis_named(name: str) -> Axis:
    """The parameter ``name``; its group may be left out. Raises ParameterError."""
    full = [known for known in axis_names() if known.rpartition(".")[2] == name]
    return Axis(full[0] if len(full) == 1 else name)


def grid(start: float, end: float, step: float | None) -> list[float]:
    """Values from the smaller to the larger of two, a ``step`` apart. Raises ParameterError."""
    low, high = sorted((start, end))
    if not (math.isfinite(low) and math.isfinite(high) and high > low):
        raise ParameterError(f"--from {start:g} --to {end:g} is no range: both must be finite and "
                             "differ")
    if step is None:
        step = (high - low) / DEFAULT_STEPS
    if not (step > 0.0 and (high - low) / step <= MOST_STEPS):
        raise ParameterError(f"--step is {step:g}, but must be positive and leave at most "
                             f"{MOST_STEPS} steps from {low:g} to {high:g}")
    count = round((high - low) / step, 9)
    values = [low + number * step for number in range(int(count) + 1)]
    # The end is met exactly, with a shorter last step if need be.
    return [*values[:-1], high] if count == int(count) else [*values, high]


def number(option: str, text: str) -> float:
    """``text`` as a finite number. Raises ParameterError."""
    try:
        value = float(text)
    except ValueError:
        value = math.nan
    if not math.isfinite(value):
        raise ParameterError(f"{option} has {text!r} in a number's place, but must have a finite "
                             "number there")
    return value


def writable(file: Path | None) -> None:
    """Refuse a ``file`` whose folder is missing before long work. Raises ParameterError."""
    if file is not None and (not file.parent.is_dir() or file.is_dir()):
        raise ParameterError(f"{file} cannot be written: it must be a file in an existing folder")


def setting_of(point: OperatingPoint, options: argparse.Namespace, varied: Collection[str]) -> str:
    """One line about ``point`` for a picture's title, without what is ``varied``."""
    damper = point.damper
    values = {VELOCITY: f"V = {point.velocity:g} m/s",
              "damper.linear_damping": f"$C_t$ = {damper.linear_damping:g} N m s/rad",
              "damper.quadratic_damping":
                  f"$C_d$ = {damper.quadratic_damping:g} N m s\u00b2/rad\u00b2",
              "damper.coulomb_torque": f"$T_{{CF}}$ = {damper.coulomb_torque:g} N m"}
    gear = (", ".join(file.stem for file in options.gear) if options.gear
            else "reference gear (invented)")
    return ", ".join([gear, *(text for name, text in values.items() if name not in varied)])


def deliver(options: argparse.Namespace, rows: Sequence[Row], head: Mapping[str, Any],
            draw: Callable[[Path], None], losses: Sequence[str], finished: bool) -> int:
    """Write what add_output_options' options name, say what was lost; the exit status."""
    if options.csv is not None:
        with options.csv.open("w", encoding="utf-8", newline="") as stream:
            write_csv(rows, stream)
    elif options.json is None and options.plot is None:
        write_csv(rows, sys.stdout)
    if options.json is not None:
        write_json(head, rows, options.json)
    if options.plot is not None:
        draw(options.plot)
    for loss in losses:
        print(f"shimmy: did not converge: {loss}", file=sys.stderr)
    if not finished:
        print(STOPPED, file=sys.stderr)
        return INTERRUPTED
    return 1 if losses else 0
