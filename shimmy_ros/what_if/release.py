"""How far a parameter has to go until one operating point's cycle no longer exceeds a limit."""

from __future__ import annotations

from collections.abc import Generator
from dataclasses import dataclass, replace

from ..cycles.branches import LARGEST_SWIVEL, ContinuationError, Line, carry, follow
from ..cycles.orbits import Orbit
from ..cycles.settings import Settings
from ..cycles.verdict import Verdict
from ..gear.matrices import SWIVEL
from ..gear.system import OperatingPoint, family_between
from ..ihb.solution import Outcome
from .query import VELOCITY, value_of, with_values
from .scan import Scan

AMPLITUDE, FOLD, GROWTH, ENVELOPE = "amplitude", "fold", "growth", "envelope"
# Of an amplitude relative to the limit, and of a value relative to those that enclose it.
_PRECISION = 1e-10
_MOST_STEPS = 50
_FEW_STEPS = 8
_FIRST_STEP = 1e-3
# Steps from a value at which there is no cycle to follow, in parts of the way to go.
_NUDGES = (0.0, 1e-6, 1e-5, 1e-4, 1e-3, 1e-2, 0.1, 0.2, 0.4, 0.6, 0.8, 1.0)
# A larger cycle is not followed: the branch is about to end there.
_LARGEST = 0.5 * LARGEST_SWIVEL
# Of a value at which growth or an envelope ends, relative to it and to the way.
_EDGE, _LEAST_EDGE = 1e-7, 1e-11


class NotExceededError(ValueError):
    """The limit is not exceeded where a release is to begin."""


@dataclass(frozen=True)
class Release:
    """The ``value`` from which on the limit holds at ``velocity`` [m/s], and the cycle there.

    ``by`` is AMPLITUDE where the cycle's amplitude is the limit, FOLD where the cycle ends. Without
    a cycle it is GROWTH where growth without bound ends, ENVELOPE where other motion comes below
    the limit.
    """

    value: float
    velocity: float
    by: str
    orbit: Orbit | None


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

    def released(self, point: OperatingPoint, value: float, by: str, orbit: Orbit | None
                 ) -> Release:
        """A release on the way of ``point``."""
        velocity = value if self.parameter == VELOCITY else point.velocity
        return Release(value, velocity, by, orbit)


def release_from(point: OperatingPoint, scan: Scan, course: Course, settings: Settings
                 ) -> Generator[None, None, Release | None]:
    """As release(), from what ``point`` comes to: a cycle, or motion that grows or is not periodic.

    Where there is no cycle to follow, some are looked for on the way; without any, the value is
    enclosed at which the limit begins to hold.
    """
    begin = value_of(point, course.parameter)
    way = course.end - begin
    exceeding: tuple[float, Verdict] | None = None
    for part in _NUDGES:
        value = begin + part * way
        verdict = scan.verdict(course.at(point, value))
        yield
        if not _exceeds(course, verdict):
            if exceeding is None:
                raise NotExceededError(f"the limit is not exceeded at {point.velocity:g} m/s")
            return (yield from _edge(point, scan, course, settings, exceeding, value))
        if can_be_followed(verdict):
            return (yield from release(verdict.point, verdict.orbit, course, settings))
        exceeding = value, verdict
    return None


def _exceeds(course: Course, verdict: Verdict) -> bool:
    return float(verdict.amplitude[course.coordinate]) > course.below


def can_be_followed(verdict: Verdict) -> bool:
    """Whether there is a cycle, and its branch does not end right there."""
    return verdict.orbit is not None and verdict.orbit.amplitude[SWIVEL] < _LARGEST


def _edge(point: OperatingPoint, scan: Scan, course: Course, settings: Settings,
          exceeding: tuple[float, Verdict], holding: float
          ) -> Generator[None, None, Release | None]:
    """Where the limit begins to hold between two values, or the release of a cycle met between."""
    value, last = exceeding
    least = _LEAST_EDGE * abs(course.end - course.begin)
    while abs(holding - value) > max(_EDGE * max(abs(holding), abs(value)), least):
        middle = 0.5 * (value + holding)
        verdict = scan.verdict(course.at(point, middle))
        yield
        if not _exceeds(course, verdict):
            holding = middle
        elif can_be_followed(verdict):
            return (yield from release(verdict.point, verdict.orbit, course, settings))
        else:
            value, last = middle, verdict
    by = ENVELOPE if last.outcome is Outcome.NOT_PERIODIC else GROWTH
    return course.released(point, holding, by, None)


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
            if here.position == 0.0 and excess <= 0.0:
                # The branch's method has it at the limit already, to within the accuracy.
                return course.released(point, begin, AMPLITUDE, here.orbit)
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
    if near.orbit is None:
        return None
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
