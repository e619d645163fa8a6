"""Queries that were checked: what they ask, about which points."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from dataclasses import asdict, dataclass, replace
from typing import Any

from ..cycles.settings import Settings
from ..gear.matrices import NAMES
from ..gear.parameters import VELOCITY_RANGE, Damper, Gear, Limits, Range, from_mapping, ranges
from ..gear.system import OperatingPoint

VELOCITY = "taxi_velocity"
PARAMETERS: Mapping[str, Range] = {VELOCITY: VELOCITY_RANGE, **ranges(Damper), **ranges(Gear)}
"""All that a query may vary, with the allowed ranges."""

LIMIT_CYCLE, ALL_CYCLES, TRIGGER, MARGIN = RETURNS = (
    "limit_cycle", "all_cycles", "trigger", "margin")
SMALLEST, LARGEST, LARGEST_LOSS, LARGEST_RISE = SENSES = (
    "smallest", "largest", "largest_loss", "largest_rise")


@dataclass(frozen=True)
class Present:
    """What a query is about where it says nothing else; ``velocity`` is None before the first."""

    gear: Gear
    damper: Damper
    velocity: float | None
    settings: Settings

    def to_json(self) -> dict[str, Any]:
        """As a mapping for from_json."""
        return asdict(self)

    @classmethod
    def from_json(cls, content: Mapping[str, Any]) -> Present:
        """The inverse of to_json. Raises ParameterError."""
        settings = content["settings"]
        return cls(from_mapping(Gear, content["gear"]), from_mapping(Damper, content["damper"]),
                   content["velocity"],
                   Settings(**{**settings, "limits": from_mapping(Limits, settings["limits"])}))


@dataclass(frozen=True)
class Grid:
    """Evenly spaced values, both ends included."""

    start: float
    end: float
    points: int

    def __len__(self) -> int:
        return self.points

    def values(self) -> tuple[float, ...]:
        """All of them."""
        width = self.end - self.start
        inner = (self.start + width * index / (self.points - 1)
                 for index in range(self.points - 1))
        return (*inner, self.end)

    def to_json(self) -> Any:
        """As in a query."""
        return {"from": self.start, "to": self.end, "points": self.points}


@dataclass(frozen=True)
class Listed:
    """Values one by one."""

    numbers: tuple[float, ...]

    def __len__(self) -> int:
        return len(self.numbers)

    def values(self) -> tuple[float, ...]:
        """All of them."""
        return self.numbers

    def to_json(self) -> Any:
        """As in a query."""
        return list(self.numbers)


@dataclass(frozen=True)
class Find:
    """The inverse question: how far ``parameter`` may go while an amplitude stays below a limit.

    ``begin`` is the end of the search that is asked about first, ``end`` the other one: for the
    smallest value the lowest and the highest; for a loss the present value and the lowest.
    ``coordinate`` counts in the order of the joints; ``below`` is in rad, or in m for the tyre,
    and 0 asks for no limit cycle at all. ``velocities`` is the interval of taxi velocities over
    which the limit holds, or None where each point has one velocity.
    """

    sense: str
    parameter: str
    begin: float
    end: float
    coordinate: int
    below: float
    velocities: tuple[float, float] | None


@dataclass(frozen=True)
class Query:
    """A query that was checked in full.

    ``base`` is the operating point apart from what varies (its velocity is NaN where that is an
    interval); ``varied`` has values by parameter, in the order of the query, of which the last one
    varies fastest. ``settings`` are how the cycles are computed, and the limits.
    """

    id: str | None
    base: OperatingPoint
    varied: Mapping[str, Grid | Listed]
    settings: Settings
    returns: tuple[str, ...]
    find: Find | None

    def __len__(self) -> int:
        """The number of points."""
        return math.prod(len(values) for values in self.varied.values())

    def points(self) -> Iterator[tuple[int, dict[str, float], OperatingPoint]]:
        """Every point with its number and the values that vary, so that neighbours follow.

        Each parameter runs to and fro: numbers are those of a walk in which it always runs to.
        """
        columns = [values.values() for values in self.varied.values()]
        position = [0] * len(columns)
        step = [1] * len(columns)
        while True:
            number = 0
            for column, index in zip(columns, position, strict=True):
                number = number * len(column) + index
            at = {name: column[index]
                  for name, column, index in zip(self.varied, columns, position, strict=True)}
            yield number, at, with_values(self.base, at)
            for axis in reversed(range(len(columns))):
                if 0 <= position[axis] + step[axis] < len(columns[axis]):
                    position[axis] += step[axis]
                    break
                step[axis] = -step[axis]
            else:
                return

    def inputs(self) -> dict[str, Any]:
        """All that the answer depends on, as in a query."""
        point = self.base
        values: dict[str, Any] = {
            VELOCITY: point.velocity, **asdict(point.damper), **asdict(point.gear)}
        values |= {name: value.to_json() for name, value in self.varied.items()}
        settings = self.settings
        values |= {"harmonics": settings.harmonics, "accuracy": settings.accuracy,
                   "minimum_velocity": settings.minimum_velocity,
                   "limits": asdict(settings.limits)}
        if self.find is None:
            return {**values, "return": list(self.returns)}
        find = self.find
        if find.velocities is not None:
            values[VELOCITY] = {"from": find.velocities[0], "to": find.velocities[1]}
        if find.sense in (SMALLEST, LARGEST):
            del values[find.parameter]
        return {**values, "find": {
            find.sense: find.parameter, "amplitude": NAMES[find.coordinate], "below": find.below,
            "between": sorted((find.begin, find.end))}}


@dataclass(frozen=True)
class Cancel:
    """A wish to end the query with the id ``target``."""

    id: str | None
    target: str


def with_values(point: OperatingPoint, values: Mapping[str, float]) -> OperatingPoint:
    """``point`` with some parameters changed. Raises ParameterError."""
    gear = {name: value for name, value in values.items() if name in ranges(Gear)}
    damper = {name: value for name, value in values.items() if name in ranges(Damper)}
    return OperatingPoint(
        replace(point.gear, **gear) if gear else point.gear,
        replace(point.damper, **damper) if damper else point.damper,
        values.get(VELOCITY, point.velocity))


def value_of(point: OperatingPoint, name: str) -> float:
    """A parameter's value at ``point``."""
    if name == VELOCITY:
        return point.velocity
    return float(getattr(point.damper if name in ranges(Damper) else point.gear, name))
