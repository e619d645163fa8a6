"""A sweep as a rig would run it: one stable cycle after the other, with the jumps at folds."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass

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

    The motion stays on its branch as long as that is there, and then jumps to the stable cycle
    nearest in size. From rest it grows to the smallest one.
    """
    before: DiagramPoint | None = None
    count = len(diagram.values)
    for index in range(count) if upwards else reversed(range(count)):
        found = diagram.stable(index)
        if found:
            here = next((point for point in found
                         if before is not None and point.branch == before.branch), None)
            if here is None:
                size = math.log(before.orbit.swivel) if before is not None else -math.inf
                here = min(found, key=lambda point: (
                    abs(math.log(point.orbit.swivel) - size)
                    if math.isfinite(size) else point.orbit.swivel))
            yield SweepPoint(here.value, upwards, Outcome.LIMIT_CYCLE, here.orbit)
            before = here
        else:
            outcome = Outcome.FAILED if index in diagram.undecided else Outcome.NO_LIMIT_CYCLE
            yield SweepPoint(diagram.values[index], upwards, outcome, None)
            before = None
