"""How far a parameter has to go until one operating point's cycle no longer exceeds a limit."""

from __future__ import annotations

from collections.abc import Generator
from dataclasses import dataclass, replace

from ..cycles.branches import ContinuationError, Line, Settings, carry, follow
from ..cycles.orbits import Orbit
from ..gear.system import OperatingPoint, family_between
from .query import VELOCITY, value_of, with_values

AMPLITUDE, FOLD = "amplitude", "fold"
# Of an amplitude relative to the limit, and of a value relative to those that enclose it.
_PRECISION = 1e-9
_MOST_STEPS = 50
_FEW_STEPS = 8
_FIRST_STEP = 1e-3


class NotExceededError(ValueError):
    """The limit is not exceeded where a release is to begin."""


@dataclass(frozen=True)
class Release:
    """The ``value`` from which on the limit holds at ``velocity`` [m/s], and the cycle there.

    ``by`` is AMPLITUDE where the cycle's amplitude is the limit, FOLD where the cycle ends.
    """

    value: float
    velocity: float
    by: str
    orbit: Orbit


@dataclass(frozen=True)
class Course:
    """The way of ``parameter`` from ``begin`` to ``end``, and what is asked of the cycles on it:

    whether the amplitude of ``coordinate`` is ``below`` a limit. All but the parameter is that of
    a point of the way.
    """

    parameter: str
    begin: float
    end: float
    coordinate: int
    below: float

    def at(self, point: OperatingPoint, value: float) -> OperatingPoint:
        """``point`` with the parameter at ``value``."""
        return with_values(point, {self.parameter: value})

    def excess(self, orbit: Orbit) -> float:
        """How far the amplitude is above the limit."""
        return float(orbit.amplitude[self.coordinate]) - self.below

    def released(self, point: OperatingPoint, value: float, by: str, orbit: Orbit) -> Release:
        """A release on the way of ``point``."""
        velocity = value if self.parameter == VELOCITY else point.velocity
        return Release(value, velocity, by, orbit)


def release(point: OperatingPoint, start: Orbit | None, course: Course, settings: Settings
            ) -> Generator[None, None, Release | None]:
    """Follow the cycle ``start`` of ``point`` until it comes below the limit, or ends.

    None where it exceeds the limit on all the way. Raises NotExceededError where there is no cycle
    at ``point``, or one below the limit, and ContinuationError.
    """
    if start is None or course.excess(start) <= 0.0:
        raise NotExceededError(f"the limit is not exceeded at {point.velocity:g} m/s")
    begin = value_of(point, course.parameter)
    line = Line(family_between(point, course.at(point, course.end)))
    position, orbit = 0.0, start

    def value(place: float) -> float:
        return begin + min(max(place, 0.0), 1.0) * (course.end - begin)

    while position < 1.0:
        at_first = position
        for here in follow(line, orbit, position, 1, settings):
            yield
            excess = course.excess(here.orbit)
            if here.is_fold and excess >= 0.0:
                return course.released(point, value(here.position), FOLD, here.orbit)
            if excess < 0.0:
                return (yield from _crossing(point, course, settings, value(position), orbit,
                                             value(here.position), excess))
            position, orbit = here.position, here.orbit
        # A branch is taken to end where its cycles are small compared with its largest; these
        # still exceed the limit.
        if position == at_first:
            raise ContinuationError(f"the branch ends at {course.parameter} {value(position):g}")
    return None


def release_near(point: OperatingPoint, near: Release, course: Course, settings: Settings
                 ) -> Generator[None, None, Release | None]:
    """As release(), by the secant method from ``near`` at another velocity.

    None where that fails. Raises ContinuationError.
    """
    origin = course.at(replace(point, velocity=near.velocity), near.value)
    low, high = sorted((course.begin, course.end))
    before = excess_before = 0.0
    value = near.value
    for step in range(_FEW_STEPS):
        orbit = carry(near.orbit, origin, course.at(point, value), settings)
        yield
        if orbit is None:
            return None
        excess = course.excess(orbit)
        if abs(excess) <= _PRECISION * course.below:
            return course.released(point, value, AMPLITUDE, orbit)
        if step == 0:
            following = value + _FIRST_STEP * (course.end - value)
        elif excess == excess_before:
            return None
        else:
            following = value - excess * (value - before) / (excess - excess_before)
        if not low <= following <= high:
            return None
        before, excess_before, value = value, excess, following
    return None


def _crossing(point: OperatingPoint, course: Course, settings: Settings, above: float,
              orbit: Orbit, under: float, excess_under: float
              ) -> Generator[None, None, Release]:
    """Where the amplitude is the limit between two values, by the Illinois method.

    ``orbit`` is the cycle at ``above``, where the limit is exceeded; at ``under`` it is not.
    """
    excess_above = course.excess(orbit)
    for _ in range(_MOST_STEPS):
        value = under - excess_under * (under - above) / (excess_under - excess_above)
        found = carry(orbit, course.at(point, above), course.at(point, value), settings)
        yield
        excess = -course.below if found is None else course.excess(found)
        if found is not None and excess >= 0.0:
            excess_under *= 0.5 if above != value else 1.0
            above, excess_above, orbit = value, excess, found
        else:
            under, excess_under = value, excess
            excess_above *= 0.5
        if abs(excess) <= _PRECISION * course.below or (
                abs(under - above) <= _PRECISION * abs(value)):
            return course.released(point, value, AMPLITUDE, found or orbit)
    return course.released(point, above, AMPLITUDE, orbit)
