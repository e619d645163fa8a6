"""Folds of the gear's limit cycles over two parameters: the boundary of shimmy.

Each step along the curve goes ahead by its last direction, and from there across it: a stable cycle
is carried alongside the curve, and from it a branch is followed on a straight line across, which
ends in the fold. So the folds are as good as branches are, with sticking and all, and the curve may
turn in either parameter. With the balance alone the fold is a solution of its own, tracked at once.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..gear.axes import Axis
from ..gear.parameters import ParameterError
from ..gear.system import OperatingPoint, family_between, gear_system
from ..ihb.balance import recovered
from ..ihb.continuation import BranchPoint as BalanceBranchPoint
from ..ihb.folds import Plane, track_fold
from ..ihb.newton import Point
from ..ihb.solution import LimitCycle
from ..ihb.solve import placed
from .branches import ContinuationError, Line, carry, follow
from .orbits import Orbit, balance_orbit
from .settings import BALANCE, Settings

Real = NDArray[np.float64]

# Lengths are parts of the ranges of both parameters.
# The first direction is only that across the line on which the fold was found.
_PROBE, _FIRST_STEP = 0.004, 0.03
_LARGEST_STEP = 0.06
_SMALLEST_STEP = 1e-3
# How far from the curve the stable cycle is kept, as part of the step.
_OFFSET = 0.4
# A step may turn the curve by this cosine, one that is short by more.
_STEEPEST_TURN = 0.9
_SHORT_STEP = 0.012
_LONGEST_CHORD = 3.0
_MOST_POINTS = 400


@dataclass(frozen=True)
class FoldPoint:
    """A fold: the values of both parameters, and the cycle there.

    ``order`` counts along the curve, to one side of where it was found and to the other.
    """

    first: float
    second: float
    orbit: Orbit
    order: int = 0


@dataclass(frozen=True)
class Window:
    """The rectangle of two parameters over which folds are tracked, around ``point``.

    ``low`` and ``high`` hold the bounds of (first, second).
    """

    point: OperatingPoint
    first: Axis
    second: Axis
    low: tuple[float, float]
    high: tuple[float, float]

    def at(self, place: Real) -> OperatingPoint:
        """The operating point at ``place`` (2,), 0 to 1 in the window. Raises ParameterError."""
        first, second = self.values(place)
        return self.second.at(self.first.at(self.point, first), second)

    def values(self, place: Real) -> tuple[float, float]:
        """Both parameters at ``place``."""
        first, second = self.low + place * (np.array(self.high) - self.low)
        return float(first), float(second)

    def place(self, first: float, second: float) -> Real:
        """The inverse of `values`."""
        return np.asarray((np.array([first, second]) - self.low)
                          / (np.array(self.high) - self.low))


def fold_curve(window: Window, fold: FoldPoint, inside: tuple[float, float], stable: Orbit,
               settings: Settings) -> Iterator[FoldPoint]:
    """The curve through ``fold``, first to one side and then to the other, within the window.

    A side ends at the window, and in a cusp, where two curves of folds meet and vanish. ``stable``
    is the cycle at the parameters ``inside``, near the fold and on the side on which cycles are.
    Raises ContinuationError, after the other side, where the curve is lost.
    """
    if settings.method == BALANCE:
        yield from _tracked(window, fold, settings)
        return
    yield fold
    start, here = window.place(fold.first, fold.second), window.place(*inside)
    across = (here - start) / np.linalg.norm(here - start)
    lost: ContinuationError | None = None
    for sense in (1, -1):
        along = sense * np.array([-across[1], across[0]])
        try:
            for count, (place, orbit) in enumerate(
                    _walk(window, start, along, across, (here, stable), settings), 1):
                yield FoldPoint(*window.values(place), orbit, sense * count)
        except ContinuationError as error:
            lost = error
    if lost is not None:
        raise lost


def _walk(window: Window, start: Real, along: Real, across: Real, beside: tuple[Real, Orbit],
          settings: Settings) -> Iterator[tuple[Real, Orbit]]:
    """The folds from ``start`` in the direction ``along``; ``across`` points to the cycles."""
    here, step, offset = start, _PROBE, _OFFSET * _FIRST_STEP
    probing = True
    for _ in range(_MOST_POINTS):
        vanished = False
        try:
            found = _fold_ahead(window, here + step * along, offset * across, beside, settings)
            vanished = found is None
        except ParameterError:
            # Beyond what the parameters may be.
            return
        except ContinuationError:
            found = None
        if found is not None:
            chord = found.place - here
            length = float(np.linalg.norm(chord))
            forward = float(chord @ along) / length
            turned = forward < (_STEEPEST_TURN if step > _SHORT_STEP else 0.0)
            if turned or (length > _LONGEST_CHORD * step and not probing):
                found = None
        if found is None:
            # The offset stays, so that a direction that was wrong does not matter in the end.
            step *= 0.5
            if step < _SMALLEST_STEP:
                if vanished and not probing:
                    return
                first, second = window.values(here)
                raise ContinuationError(
                    f"the curve of folds could not be followed beyond {window.first.name} "
                    f"{first:g}, {window.second.name} {second:g}")
            continue
        if not probing:
            yield found.place, found.orbit
        if np.any((found.place < 0.0) | (found.place > 1.0)) or (
                not probing and np.linalg.norm(found.place - start) < 0.5 * step):
            return
        along = chord / length
        normal = np.array([-along[1], along[0]])
        across = normal if float(normal @ across) > 0.0 else -normal
        here, beside = found.place, (found.inside, found.stable)
        step = _FIRST_STEP if probing else min(1.5 * step, _LARGEST_STEP)
        offset = _OFFSET * step
        probing = False


class _Found(NamedTuple):
    """A fold at ``place`` with its ``orbit``, and the ``stable`` cycle ``inside``."""

    place: Real
    orbit: Orbit
    inside: Real
    stable: Orbit


def _fold_ahead(window: Window, predicted: Real, offset: Real, beside: tuple[Real, Orbit],
                settings: Settings) -> _Found | None:
    """The fold on the line across the curve at ``predicted``, and a stable cycle beside it.

    None where the branch passes without a fold. Raises ContinuationError.
    """
    inside, outside = predicted + offset, predicted - 2.0 * offset
    stable = carry(beside[1], window.at(beside[0]), window.at(inside), settings)
    if stable is None:
        raise ContinuationError("the cycle beside the curve folds away")
    line = Line(family_between(window.at(inside), window.at(outside)), 1.0)
    for point in follow(line, stable, 0.0, 1, settings):
        if point.is_fold:
            return _Found(inside + point.position * (outside - inside), point.orbit, inside,
                          stable)
    return None


def _tracked(window: Window, fold: FoldPoint, settings: Settings) -> Iterator[FoldPoint]:
    """The curve of the balance's folds, by arc length in both parameters at once."""
    def point_at(first: float, second: float) -> OperatingPoint:
        return window.second.at(window.first.at(window.point, first), second)

    plane = Plane(lambda first, second: gear_system(point_at(first, second)),
                  lambda first, second: window.first.rate(point_at(first, second)),
                  lambda first, second: window.second.rate(point_at(first, second)))
    cycle = fold.orbit.source
    if not isinstance(cycle, LimitCycle):
        raise ContinuationError("the balance cannot track a fold that shooting found")
    system = plane.system(fold.first, fold.second)
    active = system.nonlinear_dofs
    phase, place = placed(system, cycle, active)
    start = BalanceBranchPoint(place, fold.first, 0.0, 0, 0, 0.0, True)
    span = np.array(window.high) - window.low
    for direction in (1, -1):
        try:
            for count, found in enumerate(track_fold(
                    plane, start, fold.second, (span[0] / 3.0, span[1] / 3.0), direction, active,
                    phase)):
                if count or direction > 0:
                    orbit = _orbit(plane, found.point, found.first, found.second, active)
                    yield FoldPoint(found.first, found.second, orbit, direction * count)
                inside = window.place(found.first, found.second)
                if np.any((inside < 0.0) | (inside > 1.0)):
                    break
        except ParameterError:
            continue


def _orbit(plane: Plane, point: Point, first: float, second: float, active: tuple[int, ...]
           ) -> Orbit:
    system = plane.system(first, second)
    coefficients = recovered(system, point.coefficients, point.frequency, active)
    return replace(balance_orbit(system, LimitCycle(coefficients, point.frequency, 0)),
                   stable=None)
