"""The paper's Figs. 3 to 6: one and four harmonics beside the numerical reference."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from ..cycles.diagram import DiagramPoint
from ..cycles.method_comparison import MethodRun
from ..gear.parameters import HALF_TURN, Damper
from .branch_picture import draw_branches
from .method_table import method_name

# The reference is drawn below the others, broad and pale.
_STYLES: dict[int | None, dict[str, Any]] = {
    None: {"color": "0.0", "linewidth": 4.0, "alpha": 0.3, "zorder": 1.0},
    1: {"color": "tab:blue", "linewidth": 1.3, "alpha": 1.0, "zorder": 2.0},
    4: {"color": "tab:orange", "linewidth": 1.3, "alpha": 1.0, "zorder": 3.0},
}

_BEYOND = {"linewidth": 0.5}


def draw_methods(cases: Sequence[tuple[Damper, Sequence[MethodRun]]], span: tuple[float, float],
                 title: str, file: Path) -> None:
    """A column for each damper, as PNG: its shimmy above, its trigger below. Raises OSError."""
    figure = Figure(figsize=(4.6 * len(cases), 9.0), layout="constrained")
    FigureCanvasAgg(figure)
    figure.suptitle(title)
    axes = figure.subplots(2, len(cases), squeeze=False, sharex=True)
    for (damper, runs), (shimmy, trigger) in zip(cases, axes.T, strict=True):
        for run in runs:
            style = _STYLES[run.harmonics]
            for axis, points in zip((shimmy, trigger), _split(run.diagram.points), strict=True):
                draw_branches(axis, points, frequency=False, beyond=_BEYOND, **style)
            shimmy.plot([], [], **style, label=method_name(run))
        shimmy.set_title(f"$C_d$ = {damper.quadratic_damping:g} N m s\u00b2/rad\u00b2, "
                         f"$T_{{CF}}$ = {damper.coulomb_torque:g} N m")
        trigger.set_xlabel("taxi velocity [m/s]")
        trigger.set_xlim(*span)
        trigger.set_ylim(bottom=0.0)
        for axis in (shimmy, trigger):
            axis.grid(True, alpha=0.3)
    axes[0, 0].set_ylabel("swivel amplitude of shimmy [deg]")
    axes[1, 0].set_ylabel("swivel amplitude of the trigger [deg]")
    _explain_lines(axes[0, 0])
    if any(point.beyond_limits for _, runs in cases for run in runs
           for point in run.diagram.points if point.orbit.swivel <= HALF_TURN):
        axes[0, 0].plot([], [], color="0.4", label="beyond the model's limits", **_BEYOND)
    figure.legend(*axes[0, 0].get_legend_handles_labels(), loc="outside lower center", ncols=6)
    figure.savefig(file, dpi=110)


def _split(points: Sequence[DiagramPoint]) -> tuple[list[DiagramPoint], list[DiagramPoint]]:
    """The branches with stable cycles, and the others, as far as a gear can go."""
    with_stable = {point.branch for point in points if point.orbit.stable}
    shown = [point for point in points if point.orbit.swivel <= HALF_TURN]
    return ([point for point in shown if point.branch in with_stable],
            [point for point in shown if point.branch not in with_stable])


def _explain_lines(axis: Axes) -> None:
    for line, kind in (("-", "stable"), ("--", "unstable"), (":", "unknown: the swivel sticks")):
        axis.plot([], [], color="0.4", linestyle=line, linewidth=1.3, label=kind)
