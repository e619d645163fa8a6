"""Branches of the gear's limit cycles between two operating points.

Harmonic balance follows a branch as long as the friction law that it assumes holds and its
estimated error is small enough; where the swivel begins to stick, and near folds that would need
more harmonics, shooting takes over, and hands back behind. A branch goes on through its folds until
it leaves the line, closes, shrinks to nothing, or grows without bound.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from ..gear.system import OperatingPoint, family_between
from ..ihb import continuation as balance_continuation
from ..ihb.arclength import ContinuationError
from ..ihb.balance import recovered
from ..ihb.solution import LimitCycle
from ..ihb.solve import placed
from ..ihb.system import Family, System
from ..shooting import continuation as shooting_continuation
from ..shooting.cycle import Cycle
from .orbits import (
    Orbit,
    accepted,
    aligned,
    balance_near,
    balance_orbit,
    converge,
    shoot,
    shooting_orbit,
)
from .settings import AUTO, BALANCE, SHOOTING, Settings

__all__ = ["LARGEST_SWIVEL", "BranchPoint", "ContinuationError", "Line", "carry", "follow"]

Real = NDArray[np.float64]

# A branch ends where the swivel is smaller than this part of its largest amplitude on the branch,
# and where it is larger than this many radians.
SMALLEST_PART = 1e-3
LARGEST_SWIVEL = 1e3

_FIRST_STEP = 0.05
_LARGEST_SHOOTING_STEP = 0.15
_MOST_POINTS = 2000
# Steps go on to here, so that the ends of a line are passed and then met like any other stop.
_BEYOND = 1e-9
# How far outside its neighbours a cycle between them may be and still be of their branch.
_NEAR = 0.05


@dataclass(frozen=True)
class BranchPoint:
    """A limit cycle of a branch, at ``position`` on its line: 0 at the start, 1 at the end.

    ``slope`` is the position's share of the direction of travel; it changes sign at a fold,
    and ``is_fold`` marks the point where it is zero. ``iterations`` are Newton's.
    """

    position: float
    orbit: Orbit
    slope: float
    is_fold: bool = False
    iterations: int = 0


@dataclass(frozen=True)
class Line:
    """Systems over a position from 0 to 1.

    ``scale`` is the change of position that weighs as much as a change of a cycle by its size.
    """

    family: Family
    scale: float = 1.0 / 3.0

    @cached_property
    def active(self) -> tuple[int, ...]:
        """The coordinates with an element anywhere on the line."""
        return self.family.system(0.5).nonlinear_dofs

    def system(self, position: float) -> System:
        """The system at ``position``."""
        return self.family.system(position)


def follow(line: Line, start: Orbit, position: float, direction: int, settings: Settings,
           stops: tuple[float, ...] = ()) -> Iterator[BranchPoint]:
    """The branch through ``start``, which is at ``position``, setting out in ``direction``, +-1.

    Yields the start, by a method that the settings accept, then the points in order, with one at
    every position of ``stops`` that is passed, the folds, and the ends of the line. Ends where the
    branch leaves the line, where it has shrunk to nothing or grown without bound, and with the
    start again where it is closed.

    Raises ContinuationError where the branch cannot be followed any further.
    """
    start = _accepted(line.system(position), start, settings)
    here = BranchPoint(position, start, float(direction))
    yield here
    if _leaves(here):
        return
    wanted = sorted({0.0, 1.0, position, *stops})
    largest = start.swivel
    for count, there in enumerate(_steps(line, here, settings)):
        for between in _stops_between(line, here, there, wanted, settings):
            closes = between.position == position and between.orbit.same_as(start)
            if closes and between.slope * direction < 0.0:
                raise ContinuationError("the branch turned back onto itself")
            yield between
            if closes:
                return
            if _leaves(between):
                return
        yield there
        largest = max(largest, there.orbit.swivel)
        if _leaves(there) or not SMALLEST_PART * largest < there.orbit.swivel < LARGEST_SWIVEL:
            return
        if count >= _MOST_POINTS:
            raise ContinuationError(f"the branch is longer than {_MOST_POINTS} points")
        here = there


def carry(start: Orbit, origin: OperatingPoint, target: OperatingPoint, settings: Settings
          ) -> Orbit | None:
    """The cycle at ``target`` on the branch of ``start`` at ``origin``; None if it folds before.

    In one step where that is safe. Raises ContinuationError.
    """
    line = Line(family_between(origin, target), 1.0)
    direct = _at(line, 1.0, start, start, settings)
    if direct is not None:
        return direct
    for point in follow(line, start, 0.0, 1, settings):
        if point.is_fold or point.slope < 0.0:
            return None
        if point.position == 1.0:
            return point.orbit
    return None


def _accepted(system: System, orbit: Orbit, settings: Settings) -> Orbit:
    """``orbit``, or its counterpart by a method that the settings accept."""
    if accepted(orbit, settings):
        return orbit
    if settings.method != SHOOTING:
        balanced = balance_near(system, orbit, settings.harmonics)
        if balanced is not None and accepted(balanced, settings):
            return balanced
    shot = None if settings.method == BALANCE else shoot(system, *orbit.initial_state())
    if shot is None or not shot.same_as(orbit, 1e-3):
        raise ContinuationError("the start of the branch could not be confirmed")
    return shot


def _leaves(point: BranchPoint) -> bool:
    return (point.position == 1.0 and point.slope > 0.0) or (
        point.position == 0.0 and point.slope < 0.0)


def _steps(line: Line, here: BranchPoint, settings: Settings) -> Iterator[BranchPoint]:
    """The points after ``here``, by one method or the other, without end."""
    while True:
        if settings.method == BALANCE or (settings.method == AUTO and not here.orbit.sticks):
            balanced = balance_near(line.system(here.position), here.orbit, settings.harmonics)
            if balanced is not None and accepted(balanced, settings):
                for there in _balance_steps(line, here, balanced, settings):
                    yield there
                    here = there
        if settings.method == BALANCE:
            raise ContinuationError(
                f"the balance with {settings.harmonics} harmonics has no cycle to start from")
        for there in _shooting_steps(line, here, settings):
            yield there
            here = there


def _balance_steps(line: Line, here: BranchPoint, start: Orbit, settings: Settings
                   ) -> Iterator[BranchPoint]:
    """Points of the balance after ``start``, as long as the settings accept them."""
    orbit, cycle = start, start.source
    assert isinstance(cycle, LimitCycle)
    phase, point = placed(line.system(here.position), cycle, line.active)
    try:
        points = balance_continuation.branch(
            line.family, point, here.position, line.scale, 1 if here.slope > 0.0 else -1,
            line.active, phase, _FIRST_STEP)
        next(points)
        for found in points:
            system = line.system(found.parameter)
            coefficients = recovered(system, found.point.coefficients, found.point.frequency,
                                     line.active)
            cycle = LimitCycle(coefficients, found.point.frequency, found.orientation)
            if 0.0 <= found.parameter <= 1.0:
                orbit = balance_orbit(system, cycle)
                if not accepted(orbit, settings):
                    return
            else:
                # Beyond the line no gear is meant: this only encloses the end, which is next.
                orbit = replace(orbit, amplitude=cycle.amplitude(),
                                frequency_hz=cycle.frequency_hz, source=cycle)
            yield _branch_point(found.parameter, orbit, found.slope, found.is_fold,
                                found.iterations)
    except ContinuationError:
        if settings.method == BALANCE:
            raise


def _shooting_steps(line: Line, here: BranchPoint, settings: Settings) -> Iterator[BranchPoint]:
    """Points of shooting after ``here``, until the balance is likely to be trusted again."""
    cycle = _shot(line, here)
    if cycle is None:
        raise ContinuationError(f"shooting finds no cycle near that at {here.position:g}")
    points = shooting_continuation.continue_branch(
        lambda position: line.system(min(max(position, 0.0), 1.0)), cycle, here.position,
        direction=1 if here.slope > 0.0 else -1, scale=line.scale,
        bounds=(-_BEYOND, 1.0 + _BEYOND), first_step=_FIRST_STEP,
        largest_step=_LARGEST_SHOOTING_STEP)
    try:
        next(points)
        for found in points:
            position = found.parameter
            orbit = shooting_orbit(found.cycle, found.residual)
            yield _branch_point(position, orbit, found.slope, found.fold, found.iterations)
            if settings.method == AUTO and not orbit.sticks and not found.fold:
                balanced = balance_near(line.system(position), orbit, settings.harmonics)
                # Half the accuracy, so that the methods do not change at every point.
                if balanced is not None and not balanced.sticks and (
                        balanced.error <= 0.5 * settings.accuracy):
                    return
    except shooting_continuation.ContinuationError as error:
        raise ContinuationError(str(error)) from error


def _branch_point(position: float, orbit: Orbit, slope: float, is_fold: bool, iterations: int
                  ) -> BranchPoint:
    # At a fold one multiplier is 1: neither stable nor unstable.
    return BranchPoint(position, replace(orbit, stable=None) if is_fold else orbit, slope,
                       is_fold, iterations)


def _shot(line: Line, point: BranchPoint) -> Cycle | None:
    if isinstance(point.orbit.source, Cycle):
        return point.orbit.source
    found = shoot(line.system(point.position), *point.orbit.initial_state())
    if found is None or not found.same_as(point.orbit, 1e-3):
        return None
    assert isinstance(found.source, Cycle)
    return found.source


def _stops_between(line: Line, here: BranchPoint, there: BranchPoint, stops: list[float],
                   settings: Settings) -> Iterator[BranchPoint]:
    """The points at the ``stops`` strictly between two successive points, in order of travel."""
    low, high = sorted((here.position, there.position))
    passed = [stop for stop in stops if low < stop < high]
    for stop in passed if here.position < there.position else reversed(passed):
        share = _share(here, there, stop)
        slope = here.slope + share * (there.slope - here.slope)
        orbit = _at(line, stop, here.orbit, there.orbit, settings, share)
        if orbit is None:
            raise ContinuationError(f"the branch could not be met at {stop:g}")
        yield BranchPoint(stop, orbit, slope)


def _share(here: BranchPoint, there: BranchPoint, position: float) -> float:
    """The share of the arc between two points at which it passes ``position``.

    The slope is taken to change linearly, which holds up to a fold at either end.
    """
    part = (position - here.position) / (there.position - here.position)
    total, change = here.slope + there.slope, there.slope - here.slope
    root = np.sqrt(max(here.slope**2 + change * part * total, 0.0))
    return float(part * total / (here.slope + np.copysign(root, total)))


def _at(line: Line, position: float, here: Orbit, there: Orbit, settings: Settings,
        share: float = 0.0) -> Orbit | None:
    """The cycle at ``position`` near the ``share`` of the way from one orbit to another."""
    system = line.system(position)
    first, last = here.source, there.source
    if isinstance(first, LimitCycle) and isinstance(last, LimitCycle) and (
            settings.method != SHOOTING and first.harmonics == last.harmonics):
        begin, finish = aligned(first), aligned(last)
        guess = begin + share * (finish - begin)
        frequency = first.frequency + share * (last.frequency - first.frequency)
        cycle = converge(system, guess, frequency)
        if cycle is not None and cycle.orientation in (first.orientation, last.orientation):
            orbit = balance_orbit(system, cycle)
            if accepted(orbit, settings) and _between(orbit, here, there):
                return orbit
    if settings.method == BALANCE:
        return None
    start, end = here.initial_state(), there.initial_state()
    found = shoot(system, start[0] + share * (end[0] - start[0]),
                  start[1] + share * (end[1] - start[1]))
    return found if found is not None and _between(found, here, there) else None


def _between(orbit: Orbit, here: Orbit, there: Orbit) -> bool:
    """Whether ``orbit`` can be of the piece of a branch between two others."""
    if orbit.stable not in {here.stable, there.stable} and None not in {here.stable, there.stable}:
        return False
    for value, first, last in ((orbit.swivel, here.swivel, there.swivel),
                               (orbit.frequency_hz, here.frequency_hz, there.frequency_hz)):
        if abs(value - 0.5 * (first + last)) > abs(first - last) + _NEAR * max(first, last):
            return False
    return True
