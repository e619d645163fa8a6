"""``shimmy map``: the stable limit cycle over two parameters, and its boundary."""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

from tqdm import tqdm

from ..cycles.amplitude_map import AmplitudeMap
from ..gear.axes import VELOCITY, Axis
from ..gear.parameters import ParameterError
from ..gear.system import OperatingPoint
from ..report.branch_table import Row, fold_row, head_of, node_row
from .branch_options import (
    add_branch_options,
    add_output_options,
    axis_named,
    branch_settings,
    deliver,
    grid,
    number,
    setting_of,
    writable,
)
from .options import Commands, add_gear_options, gear_and_damper
from .progress import stoppable

_LEAST_POINTS, _MOST_POINTS = 2, 1000


def add_command(commands: Commands) -> None:
    """Declare the subcommand."""
    parser: argparse.ArgumentParser = commands.add_parser(
        "map", help="swivel amplitude over two parameters, with the boundary of shimmy",
        description="What every node over two parameters comes to: the stable limit cycle, or why "
        "there is none; and the folds in which the cycle vanishes, the boundary of shimmy. Prints "
        "CSV unless it goes to a file. Exit status 0 with answers everywhere, unbounded being one, "
        "1 where some did not converge, 2 on bad input, 130 when interrupted, with what is "
        "finished in the files.")
    for name, default in (("x", [VELOCITY, "10", "100"]),
                          ("y", ["damper.coulomb_torque", "0", "300"])):
        parser.add_argument(
            f"--{name}", nargs=3, metavar=("PARAMETER", "A", "B"), default=default,
            help=f"{VELOCITY} or a name from the parameter file, and its range, SI (default: "
            f"{' '.join(default)})")
    parser.add_argument("--points", type=int, metavar="N", default=31,
                        help="values of each parameter (default: %(default)s)")
    parser.add_argument("--velocity", type=float, metavar="V",
                        help="taxi velocity, m/s, unless it is varied")
    parser.add_argument("--no-folds", action="store_true", help="leave out the curve of folds")
    add_gear_options(parser)
    add_branch_options(parser)
    add_output_options(parser)
    parser.set_defaults(run=run)


def run(options: argparse.Namespace) -> int:
    """Compute and write; raises ParameterError on bad input."""
    if not _LEAST_POINTS <= options.points <= _MOST_POINTS:
        raise ParameterError(f"--points is {options.points}, but must be in [{_LEAST_POINTS}, "
                             f"{_MOST_POINTS}]")
    (x, xs), (y, ys) = (_axis(f"--{name}", getattr(options, name), options.points)
                        for name in ("x", "y"))
    if x == y:
        raise ParameterError(f"--x and --y are both {x.name}, but must differ")
    gear, damper = gear_and_damper(options)
    velocity = options.velocity
    if VELOCITY in (x.name, y.name):
        velocity = (xs if x.name == VELOCITY else ys)[0]
    elif velocity is None:
        raise ParameterError("--velocity is missing; it must be a taxi velocity in "
                             f"{Axis(VELOCITY).range.describe()}")
    point = OperatingPoint(gear, damper, Axis(VELOCITY).range.check("--velocity", velocity))
    for file in (options.csv, options.json, options.plot):
        writable(file)
    shimmy = AmplitudeMap(point, x, y, xs, ys, branch_settings(options))
    finished = _compute(shimmy, options)

    def draw(file: Path) -> None:
        # matplotlib takes its time to import, and is not needed otherwise.
        from ..report.map_picture import draw_map

        draw_map(shimmy, f"Shimmy over {x.name} and {y.name}\n"
                 f"{setting_of(point, options, {x.name, y.name})}", file)

    return deliver(options, _rows(shimmy), head_of(point, [x.name, y.name], shimmy.losses), draw,
                   shimmy.losses, finished)


def _axis(option: str, words: list[str], points: int) -> tuple[Axis, list[float]]:
    name, start, end = words
    low, high = number(option, start), number(option, end)
    return axis_named(name), grid(low, high, abs(high - low) / (points - 1))


def _compute(shimmy: AmplitudeMap, options: argparse.Namespace) -> bool:
    """Fill the map and track the folds; False when the user asked to stop."""
    hidden = not sys.stderr.isatty()
    with stoppable() as stop:
        for _ in tqdm(shimmy.fill(), total=len(shimmy.ys), desc="rows", unit=" rows",
                      disable=hidden):
            if stop.requested:
                return False
        if not options.no_folds:
            for _ in tqdm(shimmy.trace_folds(), desc="folds", unit=" points", disable=hidden):
                if stop.requested:
                    return False
    return True


def _rows(shimmy: AmplitudeMap) -> list[Row]:
    names = (shimmy.x.name, shimmy.y.name)
    rows = [node_row(names, (x, y), node)
            for y, row in zip(shimmy.ys, shimmy.rows, strict=False)
            for x, node in zip(shimmy.xs, row, strict=True)]
    return rows + [fold_row(names, fold, shimmy.beyond_limits(fold)) for curve in shimmy.curves
                   for fold in sorted(curve, key=lambda fold: fold.order)]
