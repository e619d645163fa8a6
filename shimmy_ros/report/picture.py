"""The picture of a run: measured and predicted swivel motion over time and against velocity."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from ..ihb.solution import Outcome
from .comparison import Comparison
from .kinds import MARKED, of_outcome, stretches
from .recording import Recording

_MEASURED: dict[str, Any] = {
    "linestyle": "none", "marker": "o", "markersize": 4.0, "color": "tab:orange"}
_PREDICTED: dict[str, Any] = {"color": "tab:blue", "linewidth": 1.0}
_SYMBOLS = {"damper/linear_damping": "$C_t$", "damper/quadratic_damping": "$C_d$",
            "damper/coulomb_torque": "$T_{CF}$"}
_BOUNDS: dict[str, Any] = {**_PREDICTED, "linestyle": "--"}
_COLOURS = {"unbounded": "tab:red", "beyond the model's limits": "gold",
            "not periodic": "tab:purple", "not converged": "tab:brown"}
_AT_ONE_TIME_S = 0.5
_MOST_LABELS = 6


def draw_run(recording: Recording, comparison: Comparison, title: str, file: Path) -> None:
    """Write the picture as PNG to ``file``. Raises OSError."""
    figure = Figure(figsize=(11.0, 7.5), layout="constrained")
    FigureCanvasAgg(figure)
    axes = figure.subplots(3, 2, gridspec_kw={"height_ratios": [1.0, 2.0, 2.0]})
    figure.suptitle(title)
    time, amplitude, frequency, kinds = recording.predictions
    # What is infinite or unknown is marked below, and no number.
    cycle = np.where(of_outcome(kinds, Outcome.LIMIT_CYCLE), amplitude, np.nan)
    answered = np.where(of_outcome(kinds, Outcome.NO_LIMIT_CYCLE), 0.0, cycle)
    bounds = np.where(of_outcome(kinds, Outcome.NOT_PERIODIC), amplitude, np.nan)
    shown = comparison
    _line(axes[0, 0], *recording.velocity, "taxi velocity [m/s]")
    _pair(axes[1, 0], time, np.degrees(answered), shown.time, np.degrees(shown.amplitude),
          "swivel amplitude [deg]")
    _pair(axes[2, 0], time, frequency, shown.time, shown.frequency, "frequency [Hz]")
    velocity = np.interp(time, *recording.velocity) if time.size else time
    _pair(axes[1, 1], velocity, np.degrees(cycle), shown.velocity, np.degrees(shown.amplitude),
          "swivel amplitude [deg]")
    _pair(axes[2, 1], velocity, frequency, shown.velocity, shown.frequency, "frequency [Hz]")
    for row in (1, 2):
        axes[row, 1].lines[0].set(linestyle="none", marker="o", markersize=1.5)
    if np.isfinite(bounds).any():
        axes[1, 0].plot(time, np.degrees(bounds), **_BOUNDS)
        axes[1, 1].plot(velocity, np.degrees(bounds), label="predicted bounds, not periodic",
                        **_BOUNDS)
    _mark_kinds(axes, recording, velocity)
    changes = _changes(recording)
    _mark_changes(axes[:, 0], changes)
    if recording.velocity[0].size:
        # The first values are no change.
        _mark_changes(axes[1:, 1], [(np.interp(at, *recording.velocity), "")
                                    for at, _ in changes if at > _AT_ONE_TIME_S])
    axes[2, 0].set_xlabel("time [s]")
    axes[2, 1].set_xlabel("taxi velocity [m/s]")
    axes[1, 1].legend(loc="best")
    _swivel(axes[0, 1], recording)
    for axis in axes.flat:
        axis.grid(True, alpha=0.3)
    for row in (1, 2):
        bottom = 0.0 if row == 1 else None
        for axis in axes[row]:
            axis.set_ylim(bottom=bottom)
    figure.savefig(file, dpi=110)


def _line(axis: Axes, x: np.ndarray, y: np.ndarray, label: str) -> None:
    axis.plot(x, y, color="tab:green")
    axis.set_ylabel(label)


def _pair(axis: Axes, x: np.ndarray, y: np.ndarray, measured_x: np.ndarray,
          measured_y: np.ndarray, label: str) -> None:
    axis.plot(x, y, label="predicted", zorder=3, **_PREDICTED)
    axis.plot(measured_x, measured_y, label="measured, cycle by cycle", **_MEASURED)
    axis.set_ylabel(label)


def _swivel(axis: Axes, recording: Recording) -> None:
    time, position, _ = recording.response
    if time.size:
        axis.plot(time, np.degrees(position[:, 1]), color="tab:orange", linewidth=0.3)
    axis.set_ylabel("swivel [deg]")
    axis.set_xlabel("time [s]")


def _mark_kinds(axes: Any, recording: Recording, velocity: np.ndarray) -> None:
    """Shade when answers were no ordinary ones; dash the velocities at the lower edge."""
    time, _, _, kinds = recording.predictions
    for name, which in MARKED.items():
        marked = which(kinds)
        if not marked.any():
            continue
        for axis in axes[:, 0]:
            for begin, end in stretches(marked, time, recording.end):
                axis.axvspan(begin, end, color=_COLOURS[name], alpha=0.25, linewidth=0.0)
        for axis in axes[1:, 1]:
            axis.plot(velocity[marked], np.full(marked.sum(), 0.015), linestyle="none", marker="|",
                      markersize=8.0, color=_COLOURS[name], transform=axis.get_xaxis_transform(),
                      label=name)


def _mark_changes(axes: Sequence[Axes], changes: Sequence[tuple[float, str]]) -> None:
    """A line at each change in all the axes, and what changed above the first."""
    for axis in axes:
        for at, _ in changes:
            axis.axvline(at, color="0.4", linestyle=":", linewidth=1.0)
    if len(changes) <= _MOST_LABELS:
        for at, text in changes:
            axes[0].annotate(text, (at, 1.02), xycoords=("data", "axes fraction"),
                             va="bottom", fontsize="small", annotation_clip=False)


def _changes(recording: Recording) -> list[tuple[float, str]]:
    """Time [s] and text of the changes of the damper; those at one time are one."""
    changes: list[tuple[float, list[str]]] = []
    for time, name, value in recording.damper_changes:
        if not changes or time > changes[-1][0] + _AT_ONE_TIME_S:
            changes.append((time, []))
        changes[-1][1].append(f"{_SYMBOLS[name]} {value:g}")
    return [(time, ", ".join(texts)) for time, texts in changes]
