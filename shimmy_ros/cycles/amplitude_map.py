"""What every node over two parameters comes to, and the curves of folds that bound shimmy."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..gear.axes import Axis
from ..gear.system import OperatingPoint, family_between
from ..ihb.solution import Outcome
from .branches import ContinuationError, Line, carry, follow
from .fold_curve import FoldPoint, Window, fold_curve
from .orbits import Orbit
from .settings import Settings
from .stable_cycle import stable_cycle
from .verdict import Verdict, excesses

Real = NDArray[np.float64]

# A fold this near to a curve, as part of the ranges, lies on it.
_NEAR_CURVE = 0.02
# The cycle beside a fold from which the curve is begun is at least this far from it.
_BESIDE = 0.02
# Cycles of neighbours that differ by more than these factors may be of two branches.
_OTHER_AMPLITUDE, _OTHER_FREQUENCY = 1.3, 1.1


@dataclass(frozen=True)
class Node:
    """What is kept of the verdict at a node, which is not the whole cycle.

    ``amplitude`` (4,) is None without a limit cycle or an envelope; the other numbers are those of
    an Orbit, and None without one. ``beyond_limits`` names what passes the model's limits,
    ``further`` counts other stable cycles.
    """

    outcome: Outcome
    amplitude: Real | None
    frequency_hz: float | None
    method: str | None
    harmonics: int | None
    error: float | None
    multiplier: float | None
    sticks: bool | None
    beyond_limits: tuple[str, ...]
    further: int


@dataclass(frozen=True)
class _Border:
    """Two places in the window, 0 to 1, with a stable cycle at the first that may fold before it
    gets to the second; ``far`` is where the window ends in that direction."""

    inside: Real
    outside: Real
    far: Real
    orbit: Orbit


class AmplitudeMap:
    """Nodes over the values ``xs`` and ``ys`` of two parameters, as far as they are computed.

    ``rows`` hold the nodes over x for each y; ``curves`` are the curves of folds; ``losses`` are
    sentences about what did not converge. Memory grows by a few numbers a node, and by one cycle
    for each pair of neighbours between which there may be a fold.
    """

    def __init__(self, point: OperatingPoint, x: Axis, y: Axis, xs: Sequence[float],
                 ys: Sequence[float], settings: Settings) -> None:
        """``xs`` and ``ys`` ascend. Raises ParameterError."""
        self.x, self.y = x, y
        self.xs, self.ys = tuple(xs), tuple(ys)
        self.rows: list[tuple[Node, ...]] = []
        self.curves: list[list[FoldPoint]] = []
        self.losses: list[str] = []
        self._settings = settings
        self._window = Window(point, x, y, (xs[0], ys[0]), (xs[-1], ys[-1]))
        # What is allowed in the corners is allowed in between.
        for first in (xs[0], xs[-1]):
            for second in (ys[0], ys[-1]):
                y.at(x.at(point, first), second)
        self._point = point
        self._borders: list[_Border] = []

    def fill(self) -> Iterator[tuple[Node, ...]]:
        """Compute the rows, from the smallest y on, and yield each when it is finished."""
        before: list[Verdict] = []
        between_rows: list[_Border] = []
        for y in self.ys:
            row: list[Verdict] = []
            for column, x in enumerate(self.xs):
                point = self.y.at(self.x.at(self._point, x), y)
                starts = [*row[-1:], *before[column:column + 1]]
                # One with a cycle saves more.
                start = next((known for known in starts if known.orbit is not None),
                             starts[0] if starts else None)
                verdict = stable_cycle(point, self._settings, start)
                row.append(verdict)
                here = self._window.place(x, y)
                if verdict.failed:
                    self.losses.append(f"{self.y.name} {y:g}, {self.x.name} {x:g}: "
                                       f"{verdict.reason}")
                if column:
                    self._borders += _borders(
                        row[column - 1], verdict, self._window.place(self.xs[column - 1], y), here,
                        0)
                if before:
                    between_rows += _borders(
                        before[column], verdict,
                        self._window.place(x, self.ys[len(self.rows) - 1]), here, 1)
            self.rows.append(tuple(_node(verdict) for verdict in row))
            before = row
            yield self.rows[-1]
        # A curve that passes between two rows is seen in no row.
        self._borders += between_rows

    def trace_folds(self) -> Iterator[FoldPoint]:
        """Track every curve of folds that passes between neighbours."""
        for border in self._borders:
            if any(_crosses(self._places(curve), border.inside, border.outside)
                   for curve in self.curves):
                continue
            try:
                fold, inside, stable = self._fold(border)
            except ContinuationError as error:
                first, second = self._window.values(border.inside)
                self.losses.append(f"{self.x.name} {first:g}, {self.y.name} {second:g}: {error}")
                continue
            if fold is None or self._on_curve(fold):
                continue
            curve: list[FoldPoint] = []
            self.curves.append(curve)
            try:
                for found in fold_curve(self._window, fold, self._window.values(inside), stable,
                                        self._settings):
                    curve.append(found)
                    yield found
            except ContinuationError as error:
                self.losses.append(str(error))

    def beyond_limits(self, fold: FoldPoint) -> tuple[str, ...]:
        """What passes the model's limits in the cycle of a fold."""
        point = self._window.at(self._window.place(fold.first, fold.second))
        return tuple(item.quantity for item in excesses(point, fold.orbit, self._settings.limits))

    def _fold(self, border: _Border) -> tuple[FoldPoint | None, Real, Orbit]:
        """The fold of a border's cycle, if there is one, and a stable cycle beside it.

        Raises ContinuationError.
        """
        span = border.far - border.inside
        line = Line(family_between(self._window.at(border.inside), self._window.at(border.far)))
        passed = [(border.inside, border.orbit)]
        for there in follow(line, border.orbit, 0.0, 1, self._settings):
            place = border.inside + there.position * span
            if there.is_fold:
                return (FoldPoint(*self._window.values(place), there.orbit),
                        *self._beside(place, -span / np.linalg.norm(span), passed))
            if there.orbit.stable:
                passed.append((place, there.orbit))
        return None, border.inside, border.orbit

    def _beside(self, fold: Real, away: Real, passed: Sequence[tuple[Real, Orbit]]
                ) -> tuple[Real, Orbit]:
        """The stable cycle nearest to ``fold``, but not too near."""
        for place, orbit in reversed(passed):
            if np.linalg.norm(place - fold) >= _BESIDE:
                return place, orbit
        place, orbit = passed[0]
        back = np.clip(fold + _BESIDE * away, 0.0, 1.0)
        try:
            carried = carry(orbit, self._window.at(place), self._window.at(back), self._settings)
        except ContinuationError:
            carried = None
        return (place, orbit) if carried is None else (back, carried)

    def _places(self, curve: Sequence[FoldPoint]) -> Real:
        return np.array([self._window.place(fold.first, fold.second)
                         for fold in sorted(curve, key=lambda fold: fold.order)])

    def _on_curve(self, fold: FoldPoint) -> bool:
        here = self._window.place(fold.first, fold.second)
        return any(curve and _distance(here, self._places(curve)) < _NEAR_CURVE
                   for curve in self.curves)


def _node(verdict: Verdict) -> Node:
    orbit = verdict.orbit
    beyond = tuple(excess.quantity for excess in verdict.excesses)
    further = len(verdict.further)
    if orbit is None:
        return Node(verdict.outcome, verdict.envelope, None, None, None, None, None, None, beyond,
                    further)
    return Node(verdict.outcome, orbit.amplitude, float(orbit.frequency_hz), orbit.method,
                orbit.harmonics or None, orbit.error, orbit.multiplier, bool(orbit.sticks), beyond,
                further)


def _borders(first: Verdict, second: Verdict, here: Real, there: Real, axis: int
             ) -> list[_Border]:
    """From which of two neighbours' cycles a fold between them is to be looked for."""
    if not _may_fold_between(first, second):
        return []
    found = []
    for verdict, inside, outside, end in ((first, here, there, 1.0), (second, there, here, 0.0)):
        if verdict.orbit is not None:
            far = outside.copy()
            far[axis] = end
            found.append(_Border(inside, outside, far, verdict.orbit))
    return found


def _may_fold_between(first: Verdict, second: Verdict) -> bool:
    one, other = first.orbit, second.orbit
    if one is None or other is None:
        ends = {first.outcome, second.outcome}
        return (one is not None or other is not None) and not ends & {
            Outcome.NOT_ROLLING, Outcome.NOT_CONVERGED}
    return (abs(math.log(one.swivel / other.swivel)) > math.log(_OTHER_AMPLITUDE)
            or abs(math.log(one.frequency_hz / other.frequency_hz)) > math.log(_OTHER_FREQUENCY))


def _crosses(curve: Real, start: Real, end: Real) -> bool:
    """Whether the polyline ``curve`` (m, 2) crosses the straight piece between two places."""
    along = end - start
    sides = _turn(along, curve - start)
    for index in np.flatnonzero(sides[:-1] * sides[1:] <= 0.0):
        piece = curve[index + 1] - curve[index]
        if _turn(piece, start - curve[index]) * _turn(piece, end - curve[index]) <= 0.0:
            return True
    return False


def _turn(one: Real, other: Real) -> Real:
    """The cross product in the plane, of (2,) with (2,) or with (m, 2)."""
    return np.asarray(one[0] * other[..., 1] - one[1] * other[..., 0])


def _distance(place: Real, line: Real) -> float:
    """How far ``place`` (2,) is from the polyline ``line`` (m, 2)."""
    if len(line) == 1:
        return float(np.linalg.norm(place - line[0]))
    start, step = line[:-1], np.diff(line, axis=0)
    share = np.einsum("ij,ij->i", place - start, step) / np.einsum("ij,ij->i", step, step)
    nearest = start + np.clip(share, 0.0, 1.0)[:, None] * step
    return float(np.linalg.norm(place - nearest, axis=1).min())
