"""Pictures of limit cycles over a parameter: stable ones solid, unstable ones dashed."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from ..cycles.branches import BEYOND_GEAR
from ..cycles.diagram import DiagramPoint

_LINES = {True: "-", False: "--", None: ":"}


def draw_diagram(points: Sequence[DiagramPoint], label: str, span: tuple[float, float],
                 title: str, file: Path) -> None:
    """Swivel amplitude and frequency of ``points`` over a parameter, as PNG. Raises OSError.

    ``span`` is the parameter's range. Cycles beyond what any gear can do are left out, and a note
    says so.
    """
    shown = [point for point in points if point.orbit.swivel <= BEYOND_GEAR]
    figure = Figure(figsize=(9.0, 8.0), layout="constrained")
    FigureCanvasAgg(figure)
    figure.suptitle(title)
    amplitude, frequency = figure.subplots(2, 1, sharex=True)
    draw_branches(amplitude, shown, frequency=False, color="tab:blue")
    draw_branches(frequency, shown, frequency=True, color="tab:blue")
    amplitude.set_ylabel("swivel amplitude [deg]")
    amplitude.set_ylim(bottom=0.0)
    frequency.set_ylabel("frequency [Hz]")
    frequency.set_xlabel(label)
    for axis in (amplitude, frequency):
        axis.grid(True, alpha=0.3)
    frequency.set_xlim(*span)
    _key(amplitude, shown)
    if len(shown) < len(points):
        # Above the axes, where no curve can run into it.
        amplitude.annotate(
            f"unstable cycles beyond {np.degrees(BEYOND_GEAR):.0f} deg are not shown", (1.0, 1.005),
            xycoords="axes fraction", ha="right", va="bottom", fontsize="small", color="0.4")
    figure.savefig(file, dpi=110)


def draw_branches(axis: Axes, points: Sequence[DiagramPoint], *, frequency: bool,
                  **style: Any) -> None:
    """Each branch as lines: solid where stable, dashed where not, dotted where that is unknown.

    Folds are dots.
    """
    for number in sorted({point.branch for point in points}):
        branch = sorted((point for point in points if point.branch == number),
                        key=lambda point: point.order)
        for stable, piece in _pieces(branch):
            axis.plot([point.value for point in piece],
                      [_height(point, frequency) for point in piece],
                      linestyle=_LINES[stable], **style)
        folds = [point for point in branch if point.is_fold]
        axis.plot([point.value for point in folds],
                  [_height(point, frequency) for point in folds],
                  linestyle="none", marker="o", markersize=4.0, **style)


def _height(point: DiagramPoint, frequency: bool) -> float:
    return point.orbit.frequency_hz if frequency else float(np.degrees(point.orbit.swivel))


def _pieces(branch: Sequence[DiagramPoint]) -> list[tuple[bool | None, list[DiagramPoint]]]:
    """Runs of one stability, each beginning where the one before ends; a fold joins two."""
    pieces: list[tuple[bool | None, list[DiagramPoint]]] = []
    for before, after in pairwise(branch):
        stable = before.orbit.stable if after.is_fold else after.orbit.stable
        if not pieces or pieces[-1][0] != stable:
            pieces.append((stable, [before]))
        pieces[-1][1].append(after)
    return pieces


def _key(axis: Axes, points: Sequence[DiagramPoint]) -> None:
    for kind, style in (("stable", {"linestyle": "-"}), ("unstable", {"linestyle": "--"}),
                        ("fold", {"linestyle": "none", "marker": "o", "markersize": 4.0})):
        if any(_kind(point) == kind for point in points):
            axis.plot([], [], color="tab:blue", label=kind, **style)
    if points:
        axis.legend(loc="best")


def _kind(point: DiagramPoint) -> str:
    if point.is_fold:
        return "fold"
    return "stable" if point.orbit.stable else "unstable"
