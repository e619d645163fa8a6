"""The picture of a run: measured and predicted swivel motion over time and against velocity."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from .comparison import Comparison
from .recording import Recording

_MEASURED: dict[str, Any] = {
    "linestyle": "none", "marker": "o", "markersize": 4.0, "color": "tab:orange"}
_PREDICTED: dict[str, Any] = {"color": "tab:blue", "linewidth": 1.0}


def draw_run(recording: Recording, comparison: Comparison, title: str, file: Path) -> None:
    """Write the picture as PNG to ``file``. Raises OSError."""
    figure = Figure(figsize=(11.0, 7.5), layout="constrained")
    FigureCanvasAgg(figure)
    axes = figure.subplots(3, 2, gridspec_kw={"height_ratios": [1.0, 2.0, 2.0]})
    figure.suptitle(title)
    time, amplitude, frequency = recording.predictions
    cycle = np.where(amplitude > 0.0, amplitude, np.nan)
    shown = comparison
    _line(axes[0, 0], *recording.velocity, "taxi velocity [m/s]")
    _pair(axes[1, 0], time, np.degrees(amplitude), shown.time, np.degrees(shown.amplitude),
          "swivel amplitude [deg]")
    _pair(axes[2, 0], time, frequency, shown.time, shown.frequency, "frequency [Hz]")
    velocity = np.interp(time, *recording.velocity) if time.size else time
    _pair(axes[1, 1], velocity, np.degrees(cycle), shown.velocity, np.degrees(shown.amplitude),
          "swivel amplitude [deg]")
    _pair(axes[2, 1], velocity, frequency, shown.velocity, shown.frequency, "frequency [Hz]")
    for row in (1, 2):
        axes[row, 1].lines[0].set(linestyle="none", marker="o", markersize=1.5)
    for row, axis in enumerate(axes[:, 0]):
        _mark_changes(axis, recording, with_text=row == 0)
        axis.set_xlabel("time [s]" if row == 2 else "")
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
    axis.plot(x, y, label="predicted (harmonic balance)", zorder=3, **_PREDICTED)
    axis.plot(measured_x, measured_y, label="measured, cycle by cycle", **_MEASURED)
    axis.set_ylabel(label)


def _swivel(axis: Axes, recording: Recording) -> None:
    time, position, _ = recording.response
    if time.size:
        axis.plot(time, np.degrees(position[:, 1]), color="tab:orange", linewidth=0.3)
    axis.set_ylabel("swivel [deg]")
    axis.set_xlabel("time [s]")


def _mark_changes(axis: Axes, recording: Recording, with_text: bool) -> None:
    for time, *_ in recording.damper_changes:
        axis.axvline(time, color="0.4", linestyle=":", linewidth=1.0)
    if with_text:
        for time, text in _changes(recording):
            axis.annotate(text, (time, 0.97), xycoords=("data", "axes fraction"), va="top",
                          fontsize="x-small", xytext=(4, 0), textcoords="offset points")


def _changes(recording: Recording) -> list[tuple[float, str]]:
    """When the damper changed and to what; changes within half a second are one."""
    found: list[tuple[float, str]] = []
    for time, name, value in recording.damper_changes:
        text = f"{name.split('/')[1].replace('_', ' ')} {value:g}"
        if found and time - found[-1][0] < 0.5:
            found[-1] = found[-1][0], f"{found[-1][1]}\n{text}"
        else:
            found.append((time, text))
    return found
