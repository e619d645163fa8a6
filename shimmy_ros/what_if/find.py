"""The inverse question: at which value of a parameter an amplitude comes below a limit.

From a value at which the limit is exceeded, the cycle that exceeds it is followed along its branch
until its amplitude reaches the limit or it ends in a fold; every value on the way exceeds the
limit. Growth without bound exceeds every limit, and motion that is not periodic has its envelope:
where no cycle can be followed, the value is enclosed at which these end. Where the limit has to
hold over an interval of taxi velocities, this is done at the velocity of the largest amplitude, and
again at the value that results, until no velocity exceeds it. Cycles near a fold show in no scan
once they are few: therefore the value that releases a velocity is maximised over the velocity,
beginning before the last ones vanished.
"""

from __future__ import annotations

import math
from collections.abc import Generator, Sequence
from dataclasses import replace

from ..cycles.branches import carry
from ..cycles.orbits import Orbit
from ..cycles.settings import Settings
from ..gear.system import OperatingPoint
from .answer import number, of_orbit
from .maximum import maximum
from .query import LARGEST, SMALLEST, Find, value_of, with_values
from .release import (
    AMPLITUDE,
    Course,
    NotExceededError,
    Release,
    can_be_followed,
    release,
    release_from,
    release_near,
)
from .reply import Json
from .scan import Sample, Scan

FOUND, EVERYWHERE, NOWHERE, EXCEEDED_NOW = "found", "everywhere", "nowhere", "exceeded_now"
# The limit may be exceeded further inside the range.
AT_RANGE_END = "at_range_end"

_ROUNDS = 30
_LITTLE_PROGRESS = 0.02
# How far to go back from a value at which no velocity exceeds the limit, in parts of the way to
# it, for a cycle whose amplitude decides and for one that ends in a fold.
_BACK = {True: (0.05, 0.15, 0.3, 0.6, 0.9), False: (0.15, 0.3, 0.6, 0.9)}
_EDGE_STEPS = 6
_PRECISION = 5e-4
# Steps from a value at which the limit holds: relative to it, and to the way to go.
_STEP, _LEAST_STEP = 0.1, 1e-3
# Two values nearer than this are the same, relative to them.
_SAME = 1e-7


def find(wanted: Find, point: OperatingPoint, settings: Settings) -> Generator[None, None, Json]:
    """Answer ``wanted`` at ``point``. Raises ArithmeticError where a solve did not converge."""
    search = _Search(wanted, point, settings)
    if wanted.sense in (SMALLEST, LARGEST):
        found = yield from search.first(wanted.begin, wanted.end)
        if found is None:
            return _answer(wanted, point, settings, NOWHERE, None)
        if found is True:
            return _answer(wanted, point, settings, AT_RANGE_END, wanted.begin)
        return _answer(wanted, point, settings, FOUND, found)
    value = wanted.begin
    if (yield from search.exceeded(value)):
        return _answer(wanted, point, settings, EXCEEDED_NOW, None)
    while value != wanted.end:
        before, way = value, wanted.end - value
        step = max(_STEP * abs(value), _LEAST_STEP * abs(wanted.end - wanted.begin))
        value = wanted.end if step >= abs(way) else value + math.copysign(step, way)
        found = yield from search.first(value, before)
        if found is None:
            raise ArithmeticError(f"the limit holds at {wanted.parameter} {before:g}, but was not "
                                  f"met again on the way back from {value:g}")
        if found is not True:
            return _answer(wanted, point, settings, FOUND, found)
    return _answer(wanted, point, settings, EVERYWHERE, wanted.end)


class _Search:
    """Values of the parameter at which no velocity exceeds the limit."""

    def __init__(self, wanted: Find, point: OperatingPoint, settings: Settings) -> None:
        self._wanted = wanted
        self._point = point
        self._settings = settings
        self._scan = Scan(wanted.coordinate, wanted.below, wanted.velocities, settings)

    def exceeded(self, value: float) -> Generator[None, None, bool]:
        """Whether any velocity exceeds the limit at ``value``."""
        return bool((yield from self._scan.peaks(self._at(value))))

    def first(self, begin: float, end: float) -> Generator[None, None, Release | bool | None]:
        """The first value on the way from ``begin`` to ``end`` at which the limit holds.

        True where it holds at ``begin``, None where it holds nowhere on the way.
        """
        best: Release | None = None
        final = False
        for _ in range(_ROUNDS):
            value = begin if best is None else best.value
            following = yield from self._worst_released(value, end)
            if following is None:
                return None
            if following is True and (best is None or final):
                return True if best is None else best
            little = False
            if isinstance(following, Release):
                if best is not None and abs(following.value - value) <= _SAME * abs(value):
                    # At the limit to within the accuracy: no further way to go.
                    return following
                little = abs(following.value - value) < _LITTLE_PROGRESS * abs(value - begin)
                best = following
            if self._wanted.velocities is None:
                final = True
            elif following is True or little:
                assert best is not None
                best = yield from self._furthest(begin, end, best)
                if best is None:
                    return None
                final = True
        raise ArithmeticError(f"the limit is met by no {self._wanted.parameter} near {value:g} "
                              "at all velocities at once")

    def _worst_released(self, value: float, end: float
                        ) -> Generator[None, None, Release | bool | None]:
        """Where the velocity of the largest amplitude is released; True if none exceeds."""
        for peak in (yield from self._scan.peaks(self._at(value))):
            try:
                return (yield from self._released(value, end, peak))
            except NotExceededError:
                # At the limit to within the tolerance.
                continue
        return True

    def _released(self, value: float, end: float, peak: Sample
                  ) -> Generator[None, None, Release | None]:
        """Where ``peak``, a cycle at ``value``, is released on the way to ``end``."""
        return (yield from release_from(self._at(value, peak.velocity), self._scan,
                                        self._course(value, end), self._settings))

    def _furthest(self, begin: float, end: float, best: Release
                  ) -> Generator[None, None, Release | None]:
        """The last release of all velocities; ``best`` is the last, or nearly so."""
        back, groups = best.value, []
        for part in _BACK[best.by == AMPLITUDE]:
            back = best.value + part * (begin - best.value)
            samples = yield from self._scan.samples(self._at(back))
            groups = self._groups(samples)
            if groups:
                break
        sign = math.copysign(1.0, end - begin)
        releases = _Releases(self._at(back), self._course(back, end), self._scan, self._settings,
                             best)
        for group in groups:
            low, high = (self._edge(back, *end) for end in group)
            yield
            velocity = yield from maximum(
                lambda place: releases.progress(place, sign), low, high, _PRECISION * (high - low))
            if math.isinf((yield from releases.progress(velocity, sign))):
                return None
        return max(releases.found, key=lambda item: sign * item.value)

    def _groups(self, samples: Sequence[Sample]
                ) -> list[tuple[tuple[float, float], tuple[float, float]]]:
        """Neighbouring samples that exceed the limit, by their ends; an end is a velocity that
        exceeds the limit and the next one outside, which are the same at the interval's end."""
        exceeding = [self._scan.exceeds(sample.amplitude) for sample in samples]
        places = [sample.velocity for sample in samples]
        groups = []
        last = len(samples) - 1
        for index, inside in enumerate(exceeding):
            if inside and (index == 0 or not exceeding[index - 1]):
                first = index
            if inside and (index == last or not exceeding[index + 1]):
                groups.append(((places[first], places[max(first - 1, 0)]),
                               (places[index], places[min(index + 1, last)])))
        return groups

    def _edge(self, value: float, inside: float, outside: float) -> float:
        """The outermost velocity near ``inside`` that exceeds the limit, by bisection."""
        for _ in range(_EDGE_STEPS if inside != outside else 0):
            middle = 0.5 * (inside + outside)
            if self._scan.exceeds(self._scan.amplitude(self._at(value, middle))):
                inside = middle
            else:
                outside = middle
        return inside

    def _course(self, begin: float, end: float) -> Course:
        return Course(self._wanted.parameter, begin, end, self._wanted.coordinate,
                      self._wanted.below)

    def _at(self, value: float, velocity: float | None = None) -> OperatingPoint:
        point = self._point if velocity is None else replace(self._point, velocity=velocity)
        return with_values(point, {self._wanted.parameter: value})


class _Releases:
    """Releases on the way from ``back``, each found from those at neighbouring velocities."""

    def __init__(self, back: OperatingPoint, course: Course, scan: Scan, settings: Settings,
                 first: Release) -> None:
        self._back = back
        self._course = course
        self._scan = scan
        self._settings = settings
        self._starts: dict[float, Orbit] = {}
        self.found = [first]

    def progress(self, velocity: float, sign: float) -> Generator[None, None, float]:
        """How far the way goes at ``velocity``: the value times ``sign``, infinite without end."""
        for item in self.found:
            if item.velocity == velocity:
                return sign * item.value
        point = replace(self._back, velocity=velocity)
        near = min(self.found, key=lambda item: abs(item.velocity - velocity))
        found = None
        if near.by == AMPLITUDE and self._course.below > 0.0:
            found = yield from release_near(point, near, self._course, self._settings)
        if found is None:
            orbit = self._start(velocity)
            yield
            try:
                if orbit is None:
                    found = yield from release_from(point, self._scan, self._course,
                                                    self._settings)
                else:
                    found = yield from release(point, orbit, self._course, self._settings)
            except NotExceededError:
                return sign * self._course.begin
            if found is None:
                return math.inf
        self.found.append(found)
        return sign * found.value

    def _start(self, velocity: float) -> Orbit | None:
        """The cycle at the begin of the way; None without one that can be followed."""
        orbit = None
        if self._starts:
            near = min(self._starts, key=lambda item: abs(item - velocity))
            orbit = carry(self._starts[near], replace(self._back, velocity=near),
                          replace(self._back, velocity=velocity), self._settings)
        if orbit is None:
            verdict = self._scan.verdict(replace(self._back, velocity=velocity))
            orbit = verdict.orbit if can_be_followed(verdict) else None
        if orbit is not None:
            self._starts[velocity] = orbit
        return orbit


def _answer(wanted: Find, point: OperatingPoint, settings: Settings, outcome: str,
            found: Release | float | None) -> Json:
    value = found.value if isinstance(found, Release) else found
    present = value_of(point, wanted.parameter)
    answer: Json = {
        "outcome": outcome, "value": value,
        "change": None if value is None else number(value - present),
        "decided_by": None,
    }
    if isinstance(found, Release):
        there = with_values(replace(point, velocity=found.velocity),
                            {wanted.parameter: found.value})
        answer["decided_by"] = {
            "by": found.by, "taxi_velocity": found.velocity,
            "cycle": None if found.orbit is None else of_orbit(there, found.orbit, settings)}
    return answer
