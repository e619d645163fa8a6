"""The stable limit cycle over two parameters, and the curves of folds that bound it."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np
from numpy.typing import NDArray

from ..gear.axes import Axis
from ..gear.system import OperatingPoint
from .branches import ContinuationError, Settings, carry
from .diagram import Diagram, DiagramPoint
from .fold_curve import FoldPoint, Window, fold_curve
from .orbits import Orbit

Real = NDArray[np.float64]

# A fold this near to a curve, as part of the ranges, lies on it.
_NEAR_CURVE = 0.02
# The cycle beside a fold from which the curve is begun is at least this far from it.
_BESIDE = 0.02


class AmplitudeMap:
    """Cycles over the values ``xs`` and ``ys`` of two parameters, as far as they are computed.

    ``rows`` hold a diagram over x for each y; ``curves`` are the curves of folds; ``losses`` are
    sentences about what did not converge.
    """

    def __init__(self, point: OperatingPoint, x: Axis, y: Axis, xs: Sequence[float],
                 ys: Sequence[float], settings: Settings) -> None:
        """``xs`` and ``ys`` ascend. Raises ParameterError."""
        self.x, self.y = x, y
        self.xs, self.ys = tuple(xs), tuple(ys)
        self.rows: list[Diagram] = []
        self.curves: list[list[FoldPoint]] = []
        self.losses: list[str] = []
        self._settings = settings
        self._window = Window(point, x, y, (xs[0], ys[0]), (xs[-1], ys[-1]))
        # What is allowed in the corners is allowed in between.
        for first in (xs[0], xs[-1]):
            for second in (ys[0], ys[-1]):
                y.at(x.at(point, first), second)
        self._point = point

    def fill(self) -> Iterator[Diagram]:
        """Compute the rows, from the smallest y on, and yield each when it is finished."""
        before: Diagram | None = None
        for value in self.ys:
            row = Diagram(self.y.at(self._point, value), self.x, self.xs, self._settings)
            if before is not None:
                self._carry_all(before, row)
            for _ in row.trace_stable():
                pass
            self.losses += [f"{self.y.name} {value:g}, {loss}" for loss in row.losses]
            self.rows.append(row)
            before = row
            yield row

    def stable(self, row: int, column: int) -> Orbit | None:
        """The smallest stable cycle at a node, to which a motion grows; None without any."""
        found = [point.orbit for point in self.rows[row].stable(column)]
        return min(found, key=lambda orbit: orbit.swivel, default=None)

    def trace_folds(self) -> Iterator[FoldPoint]:
        """Track every curve of folds that the rows pass."""
        for row, value in zip(self.rows, self.ys, strict=False):
            for fold in [point for point in row.points if point.is_fold]:
                inside = self._beside(row, fold)
                if inside is None or self._on_curve(fold.value, value):
                    continue
                curve: list[FoldPoint] = []
                self.curves.append(curve)
                try:
                    for found in fold_curve(self._window, FoldPoint(fold.value, value, fold.orbit),
                                            (inside.value, value), inside.orbit, self._settings):
                        curve.append(found)
                        yield found
                except ContinuationError as error:
                    self.losses.append(str(error))

    def _carry_all(self, before: Diagram, row: Diagram) -> None:
        """Begin branches of ``row`` from the row before: amid each, and where one is missing."""
        members: dict[int, list[int]] = {}
        for index in range(len(self.xs)):
            for point in before.stable(index):
                members.setdefault(point.branch, []).append(index)
        middles = [found[len(found) // 2] for found in members.values()]
        for index in (*middles, *range(len(self.xs))):
            for point in [] if row.stable(index) else before.stable(index):
                self._carry(before, row, index, point.orbit)

    def _carry(self, before: Diagram, row: Diagram, index: int, orbit: Orbit) -> None:
        try:
            start = carry(orbit, before.at(index), row.at(index), self._settings)
        except ContinuationError:
            # The search in the row itself decides.
            return
        if start is not None and start.stable:
            for _ in row.trace(index, start, only_to_fold=True):
                pass

    def _beside(self, row: Diagram, fold: DiagramPoint) -> DiagramPoint | None:
        """The stable cycle of the fold's branch that is nearest to it, but not too near."""
        apart = _BESIDE * (self.xs[-1] - self.xs[0])
        candidates = [point for point in row.points
                      if point.branch == fold.branch and point.orbit.stable
                      and abs(point.value - fold.value) >= apart]
        return min(candidates, key=lambda point: abs(point.order - fold.order), default=None)

    def _on_curve(self, first: float, second: float) -> bool:
        here = self._window.place(first, second)
        for curve in self.curves:
            places = np.array([self._window.place(fold.first, fold.second)
                               for fold in sorted(curve, key=lambda fold: fold.order)])
            if len(places) and _distance(here, places) < _NEAR_CURVE:
                return True
        return False


def _distance(place: Real, line: Real) -> float:
    """How far ``place`` (2,) is from the polyline ``line`` (m, 2)."""
    if len(line) == 1:
        return float(np.linalg.norm(place - line[0]))
    start, step = line[:-1], np.diff(line, axis=0)
    share = np.einsum("ij,ij->i", place - start, step) / np.einsum("ij,ij->i", step, step)
    nearest = start + np.clip(share, 0.0, 1.0)[:, None] * step
    return float(np.linalg.norm(place - nearest, axis=1).min())
