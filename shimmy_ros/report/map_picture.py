"""The picture of a map: swivel amplitude over two parameters, with the curves of folds."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.colors import LogNorm
from matplotlib.figure import Figure

from ..cycles.amplitude_map import AmplitudeMap

# Amplitudes that differ by more are coloured by their logarithm.
_WIDE = 10.0


def draw_map(shimmy: AmplitudeMap, title: str, file: Path) -> None:
    """Write the picture as PNG. Raises OSError."""
    figure = Figure(figsize=(9.0, 7.0), layout="constrained")
    FigureCanvasAgg(figure)
    figure.suptitle(title)
    axis = figure.subplots()
    swing = np.full((len(shimmy.ys), len(shimmy.xs)), np.nan)
    for row in range(len(shimmy.rows)):
        for column in range(len(shimmy.xs)):
            orbit = shimmy.stable(row, column)
            if orbit is not None:
                swing[row, column] = np.degrees(orbit.swivel)
    axis.set_facecolor("0.9")
    low, high = np.nanmin(swing, initial=np.inf), np.nanmax(swing, initial=0.0)
    norm = LogNorm(low, high) if _WIDE * low < high else None
    colors = axis.pcolormesh(shimmy.xs, shimmy.ys, swing, shading="nearest", cmap="viridis",
                             norm=norm)
    figure.colorbar(colors, ax=axis, label="swivel amplitude [deg]; grey: no limit cycle")
    for number, curve in enumerate(shimmy.curves):
        ordered = sorted(curve, key=lambda fold: fold.order)
        axis.plot([fold.first for fold in ordered], [fold.second for fold in ordered],
                  color="tab:red", linewidth=2.0,
                  label=None if number else "folds: the boundary of shimmy")
    undecided = [(row.values[index], y) for row, y in zip(shimmy.rows, shimmy.ys, strict=False)
                 for index in row.undecided]
    if undecided:
        axis.plot(*zip(*undecided, strict=True), linestyle="none", marker="x", color="black",
                  label="did not converge")
    if shimmy.curves or undecided:
        axis.legend(loc="best")
    axis.set_xlim(shimmy.xs[0], shimmy.xs[-1])
    axis.set_ylim(shimmy.ys[0], shimmy.ys[-1])
    axis.set_xlabel(shimmy.x.label)
    axis.set_ylabel(shimmy.y.label)
    figure.savefig(file, dpi=110)
