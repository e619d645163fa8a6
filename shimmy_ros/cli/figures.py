"""``shimmy figures``: the paper's Figs. 3 to 6 on the gear, and what the methods cost."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

from tqdm import tqdm

from ..cycles.branches import ContinuationError
from ..cycles.diagram import DiagramPoint
from ..cycles.method_comparison import MethodRun, triggers
from ..cycles.prediction import Predictor
from ..gear.axes import VELOCITY
from ..gear.parameter_file import REFERENCE_GEAR, load_parameters
from ..gear.parameters import Damper, Gear, ParameterError
from ..gear.system import OperatingPoint
from ..report.branch_table import branch_row, write_csv
from ..report.method_table import difference_row, method_name, summary_text, table_text
from ..resources import resource_directory
from .branch_options import grid
from .options import Commands
from .progress import INTERRUPTED, STOPPED, stoppable

HARMONICS = (1, 4)
_NAME = "figures_3_to_6"


def add_command(commands: Commands) -> None:
    """Declare the subcommand."""
    parser: argparse.ArgumentParser = commands.add_parser(
        "figures", help="the paper's Figs. 3 to 6, with errors and cost of each method",
        description="Follow the limit cycles over the taxi velocity for the paper's four dampers: "
        "harmonic balance with one harmonic and with four, and shooting. Leaves a picture, all "
        "cycles as CSV, and a table of differences and of cost, which is also printed. Exit status "
        "0, 1 where something did not converge, 2 on bad input, 130 when interrupted, with what is "
        "finished in the files.")
    parser.add_argument("--gear", metavar="FILE", type=Path, action="append", default=[],
                        help="parameter file, a ROS 2 params YAML (default: the reference gear, "
                        "which is invented)")
    parser.add_argument("--from", type=float, metavar="V", dest="start", default=10.0,
                        help="first taxi velocity, m/s (default: %(default)g)")
    parser.add_argument("--to", type=float, metavar="V", dest="end", default=100.0,
                        help="last taxi velocity, m/s (default: %(default)g)")
    parser.add_argument("--step", type=float, metavar="D", default=1.0,
                        help="distance of the velocities, m/s (default: %(default)g)")
    parser.add_argument("--out", metavar="DIR", type=Path, default=Path("out"),
                        help="where the files go (default: %(default)s)")
    parser.set_defaults(run=run)


@dataclass(frozen=True)
class _Case:
    """One damper: its runs, the reference last, and what did not converge."""

    gear: Gear
    damper: Damper
    runs: list[MethodRun]
    losses: list[str]


def run(options: argparse.Namespace) -> int:
    """Compare and write; raises ParameterError on bad input."""
    config = resource_directory("config")
    gear_files = options.gear or [config / REFERENCE_GEAR]
    velocities = grid(options.start, options.end, options.step)
    cases = [_case(*load_parameters(*gear_files, file), velocities)
             for file in sorted(config.glob("damper_*.yaml"))]
    try:
        options.out.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise ParameterError(f"--out is {options.out}, but must be a folder: {error}") from error
    # What is compiled at its first use is not a cost of the method.
    Predictor().predict(OperatingPoint(cases[0].gear, cases[0].damper, velocities[0]))
    # Every method has two branches of one point for each velocity, if all goes well.
    total = 2 * len(velocities) * sum(len(case.runs) for case in cases)
    with stoppable() as stop, tqdm(total=total, desc="figures", unit=" points",
                                   disable=not sys.stderr.isatty()) as bar:
        for case in cases:
            for point in _trace(case, velocities):
                bar.update(point.on_grid)
                if stop.requested:
                    break
            if stop.requested:
                break
    _write(cases, velocities, options)
    losses = [loss for case in cases for loss in case.losses]
    for loss in losses:
        print(f"shimmy: did not converge: {loss}", file=sys.stderr)
    if stop.requested:
        print(STOPPED, file=sys.stderr)
        return INTERRUPTED
    return 1 if losses else 0


def _case(gear: Gear, damper: Damper, velocities: list[float]) -> _Case:
    point = OperatingPoint(gear, damper, velocities[0])
    return _Case(gear, damper, [MethodRun(point, velocities, harmonics)
                                for harmonics in (*HARMONICS, None)], [])


def _trace(case: _Case, velocities: list[float]) -> Iterator[DiagramPoint]:
    """Every method's stable cycles, and then its trigger."""
    for run in case.runs:
        yield from run.trace_stable()
        case.losses.extend(f"{method_name(run)}: {loss}" for loss in run.diagram.losses)
    point = OperatingPoint(case.gear, case.damper, velocities[0])
    try:
        found = triggers(point, velocities)
    except ContinuationError as error:
        case.losses.append(f"trigger: {error}")
        return
    for run in case.runs:
        # The balance may lose the trigger, which sticks; only a loss of the reference counts.
        before = len(run.diagram.losses)
        yield from run.trace_trigger(found)
        if run.harmonics is None:
            case.losses.extend(f"trigger: {loss}" for loss in run.diagram.losses[before:])


def _write(cases: list[_Case], velocities: list[float], options: argparse.Namespace) -> None:
    """Picture, cycles and table, of what there is."""
    # matplotlib takes its time to import, and is not needed before.
    from ..report.method_figures import draw_methods

    rows = [{"quadratic_damping": case.damper.quadratic_damping,
             "coulomb_torque": case.damper.coulomb_torque,
             "run": method_name(run), **branch_row(VELOCITY, point)}
            for case in cases for run in case.runs
            for point in sorted(run.diagram.points, key=lambda item: (item.branch, item.order))]
    table = [difference_row(case.damper, run, case.runs[-1]) for case in cases
             for run in case.runs if run.diagram.points]
    files = [options.out / f"{_NAME}{suffix}" for suffix in (".csv", "_table.csv", ".png")]
    for file, lines in zip(files, (rows, table), strict=False):
        with file.open("w", encoding="utf-8", newline="") as stream:
            write_csv(lines, stream)
    source = (", ".join(file.stem for file in options.gear) if options.gear
              else "reference gear (invented)")
    draw_methods([(case.damper, case.runs) for case in cases], (velocities[0], velocities[-1]),
                 f"Shimmy amplitude over taxi velocity: {source}", files[-1])
    print(table_text(table))
    print(summary_text([(case.damper, case.runs) for case in cases]))
    print("\n".join(str(file) for file in files))
