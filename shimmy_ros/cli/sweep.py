"""``shimmy sweep``: limit cycles over one parameter."""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

from tqdm import tqdm

from ..cycles.diagram import Diagram
from ..cycles.sweep import sweep_points
from ..gear.axes import VELOCITY, Axis
from ..gear.parameters import ParameterError
from ..gear.system import OperatingPoint
from ..report.branch_table import Row, branch_row, head_of, sweep_row
from .branch_options import (
    add_branch_options,
    add_output_options,
    axis_named,
    branch_settings,
    deliver,
    grid,
    setting_of,
    writable,
)
from .options import Commands, add_gear_options, gear_and_damper
from .progress import stoppable

_DIRECTIONS = {"up": (True,), "down": (False,), "both": (True, False)}


def add_command(commands: Commands) -> None:
    """Declare the subcommand."""
    parser: argparse.ArgumentParser = commands.add_parser(
        "sweep", help="limit cycles over one parameter",
        description="What every value of one parameter comes to, up and down: the motion stays on "
        "its stable limit cycle up to the fold in which that ends, and then goes where a kick "
        "leads; or all branches of limit cycles. Prints CSV unless it goes to a file. Exit status "
        "0 with answers everywhere, unbounded being one, 1 where some did not converge, 2 on bad "
        "input, 130 when interrupted, with what is finished in the files.")
    parser.add_argument("parameter", nargs="?", default=VELOCITY, metavar="PARAMETER",
                        help=f"{VELOCITY}, or a name from the parameter file, such as "
                        "damper.coulomb_torque or gear.trail (default: %(default)s)")
    parser.add_argument("--from", type=float, required=True, metavar="A", dest="start",
                        help="first value, SI")
    parser.add_argument("--to", type=float, required=True, metavar="B", dest="end",
                        help="last value, SI")
    parser.add_argument("--step", type=float, metavar="D",
                        help="distance of the values (default: a fiftieth of the range)")
    parser.add_argument("--velocity", type=float, metavar="V",
                        help="taxi velocity, m/s, unless it is what is swept")
    parser.add_argument("--direction", choices=sorted(_DIRECTIONS), default="both",
                        help="of the stable cycles' sweep (default: %(default)s)")
    parser.add_argument("--all", action="store_true", dest="everything",
                        help="every branch through its folds, unstable cycles included")
    add_gear_options(parser)
    add_branch_options(parser)
    add_output_options(parser)
    parser.set_defaults(run=run)


def run(options: argparse.Namespace) -> int:
    """Sweep and write; raises ParameterError on bad input."""
    axis = axis_named(options.parameter)
    values = grid(options.start, options.end, options.step)
    gear, damper = gear_and_damper(options)
    if axis.name == VELOCITY:
        velocity = values[0]
    elif options.velocity is None:
        raise ParameterError("--velocity is missing; it must be a taxi velocity in "
                             f"{Axis(VELOCITY).range.describe()}")
    else:
        velocity = Axis(VELOCITY).range.check("--velocity", options.velocity)
    point = OperatingPoint(gear, damper, velocity)
    for file in (options.csv, options.json, options.plot):
        writable(file)
    diagram = Diagram(point, axis, values, branch_settings(options))
    finished = _trace(diagram, options.everything)

    def draw(file: Path) -> None:
        # matplotlib takes its time to import, and is not needed otherwise.
        from ..report.branch_picture import draw_diagram

        draw_diagram(diagram, axis.label, f"Limit cycles over {axis.name}\n"
                     f"{setting_of(point, options, {axis.name})}", file)

    return deliver(options, _rows(diagram, options, finished),
                   head_of(point, [axis.name], diagram.losses), draw, diagram.losses, finished)


def _trace(diagram: Diagram, everything: bool) -> bool:
    """Find answers and branches; False when the user asked to stop."""
    hidden = not sys.stderr.isatty()
    with stoppable() as stop:
        if not everything:
            for _ in tqdm(diagram.judge(), total=len(diagram.values), desc="answering",
                          unit=" values", disable=hidden):
                if stop.requested:
                    return False
        points = diagram.trace_all() if everything else diagram.trace_stable()
        for _ in tqdm(points, desc="following branches", unit=" points", disable=hidden):
            if stop.requested:
                return False
    return True


def _rows(diagram: Diagram, options: argparse.Namespace, finished: bool) -> list[Row]:
    name = diagram.axis.name
    if options.everything:
        ordered = sorted(diagram.points, key=lambda point: (point.branch, point.order))
        return [branch_row(name, point) for point in ordered]
    answers = [answer for upwards in _DIRECTIONS[options.direction]
               for answer in sweep_points(diagram, upwards)]
    # An unfinished search has not shown that motion is on no branch.
    return [sweep_row(name, answer) for answer in answers
            if finished or answer.orbit is not None]
