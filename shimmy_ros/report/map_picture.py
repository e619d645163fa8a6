"""The picture of a map: swivel amplitude over two parameters, with the curves of folds."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.collections import PatchCollection
from matplotlib.colors import ListedColormap, LogNorm
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch, Rectangle
from numpy.typing import NDArray

from ..cycles.amplitude_map import AmplitudeMap
from ..gear.matrices import SWIVEL
from ..ihb.solution import Outcome

# Amplitudes that differ by more are coloured by their logarithm.
_WIDE = 10.0
_COLORS = {
    Outcome.NO_LIMIT_CYCLE: ("0.88", "no limit cycle"),
    Outcome.UNBOUNDED: ("tab:red", "unbounded"),
    Outcome.NOT_PERIODIC: ("tab:pink", "not periodic"),
    Outcome.NOT_ROLLING: ("lightsteelblue", "not rolling"),
    Outcome.NOT_CONVERGED: ("black", "did not converge"),
}
_HATCH = "////"


def draw_map(shimmy: AmplitudeMap, title: str, file: Path) -> None:
    """Write the picture as PNG. Raises OSError."""
    figure = Figure(figsize=(9.0, 7.6), layout="constrained")
    FigureCanvasAgg(figure)
    figure.suptitle(title)
    axis = figure.subplots()
    key: list[Artist] = []
    shape = len(shimmy.ys), len(shimmy.xs)
    swing = np.full(shape, np.nan)
    beyond = np.zeros(shape, dtype=np.bool_)
    for row, nodes in enumerate(shimmy.rows):
        for column, node in enumerate(nodes):
            if node.outcome is Outcome.LIMIT_CYCLE and node.amplitude is not None:
                swing[row, column] = np.degrees(node.amplitude[SWIVEL])
            beyond[row, column] = bool(node.beyond_limits)
    if np.isfinite(swing).any():
        low, high = float(np.nanmin(swing)), float(np.nanmax(swing))
        norm = LogNorm(low, high) if _WIDE * low < high else None
        colors = axis.pcolormesh(shimmy.xs, shimmy.ys, swing, shading="nearest", cmap="viridis",
                                 norm=norm)
        figure.colorbar(colors, ax=axis, label="swivel amplitude [deg]")
    for outcome, (color, words) in _COLORS.items():
        mask = np.zeros(shape, dtype=np.bool_)
        for row, nodes in enumerate(shimmy.rows):
            mask[row] = [node.outcome is outcome for node in nodes]
        if mask.any():
            axis.pcolormesh(shimmy.xs, shimmy.ys, np.where(mask, 0.0, np.nan), shading="nearest",
                            cmap=ListedColormap([color]))
            key.append(Patch(facecolor=color, edgecolor="0.5", label=words))
    if beyond.any():
        _hatch(axis, shimmy, beyond)
        key.append(Patch(facecolor="none", edgecolor="0.3", hatch=_HATCH,
                         label="beyond the model's limits"))
    for curve in shimmy.curves:
        ordered = sorted(curve, key=lambda fold: fold.order)
        axis.plot([fold.first for fold in ordered], [fold.second for fold in ordered],
                  color="white", linewidth=4.0)
        axis.plot([fold.first for fold in ordered], [fold.second for fold in ordered],
                  color="tab:orange", linewidth=2.0)
    if shimmy.curves:
        key.append(Line2D([], [], color="tab:orange", linewidth=2.0,
                          label="folds: the boundary of shimmy"))
    if key:
        figure.legend(handles=key, loc="outside lower center", ncols=4)
    axis.set_xlim(shimmy.xs[0], shimmy.xs[-1])
    axis.set_ylim(shimmy.ys[0], shimmy.ys[-1])
    axis.set_xlabel(shimmy.x.label)
    axis.set_ylabel(shimmy.y.label)
    figure.savefig(file, dpi=110)


def _hatch(axis: Axes, shimmy: AmplitudeMap, beyond: NDArray[np.bool_]) -> None:
    """Lines across the cells of the nodes that are ``beyond`` the limits."""
    x, y = _edges(shimmy.xs), _edges(shimmy.ys)
    cells = [Rectangle((x[column], y[row]), x[column + 1] - x[column], y[row + 1] - y[row])
             for row, column in zip(*np.nonzero(beyond), strict=True)]
    axis.add_collection(PatchCollection(cells, facecolor="none", edgecolor="white", hatch=_HATCH,
                                        linewidth=0.0))


def _edges(values: tuple[float, ...]) -> NDArray[np.float64]:
    """The borders of cells around ``values``."""
    middles = 0.5 * (np.array(values[:-1]) + np.array(values[1:]))
    return np.concatenate([[2.0 * values[0] - middles[0]], middles,
                           [2.0 * values[-1] - middles[-1]]])
