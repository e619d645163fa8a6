"""A sweep as a rig would run it: one stable cycle after the other, with the jumps at folds."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import groupby

from ..ihb.solution import Outcome
from .diagram import Diagram, DiagramPoint
from .orbits import Orbit


@dataclass(frozen=True)
class SweepPoint:
    """The answer at one ``value``, passed ``upwards`` or not; ``orbit`` is its cycle, if any."""

    value: float
    upwards: bool
    outcome: Outcome
    orbit: Orbit | None


def sweep_points(diagram: Diagram, upwards: bool) -> Iterator[SweepPoint]:
    """The answers of a diagram whose stable branches are traced, in the order of the sweep.

    The motion stays on its branch up to the fold in which that ends, and then jumps to the stable
    cycle nearest in size. From rest it grows to the smallest one.
    """
    sheets = _sheets(diagram.points)
    before: DiagramPoint | None = None
    count = len(diagram.values)
    for index in range(count) if upwards else reversed(range(count)):
        found = diagram.stable(index)
        if found:
            before = _next(found, before, sheets)
            yield SweepPoint(before.value, upwards, Outcome.LIMIT_CYCLE, before.orbit)
        else:
            outcome = Outcome.FAILED if index in diagram.undecided else Outcome.NO_LIMIT_CYCLE
            yield SweepPoint(diagram.values[index], upwards, outcome, None)
            before = None


def _next(found: list[DiagramPoint], before: DiagramPoint | None, sheets: dict[int, int]
          ) -> DiagramPoint:
    if before is None:
        return min(found, key=lambda point: point.orbit.swivel)
    sheet, size = sheets[id(before)], math.log(before.orbit.swivel)
    return min(found, key=lambda point: (
        sheets[id(point)] != sheet, abs(math.log(point.orbit.swivel) - size)))


def _sheets(points: Sequence[DiagramPoint]) -> dict[int, int]:
    """A number for each point, by its id, which changes at every fold and from branch to branch."""
    numbers: dict[int, int] = {}
    sheet = 0
    for _, branch in groupby(sorted(points, key=lambda point: (point.branch, point.order)),
                             key=lambda point: point.branch):
        sheet += 1
        for point in branch:
            sheet += point.is_fold
            numbers[id(point)] = sheet
    return numbers
