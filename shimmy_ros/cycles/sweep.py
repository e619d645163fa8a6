"""A sweep as a rig would run it: one stable cycle after the other, with the jumps at folds."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import groupby

import numpy as np
from numpy.typing import NDArray

from ..ihb.solution import Outcome
from .diagram import Diagram, DiagramPoint
from .orbits import Orbit
from .verdict import Verdict, excesses

_SAME = 1e-3


@dataclass(frozen=True)
class SweepPoint:
    """The answer at one ``value``, passed ``upwards`` or not.

    outcome : as in a Verdict; LIMIT_CYCLE as well where the motion has stayed on a branch
    orbit : the stable cycle, if it is one
    envelope : of motion that is not periodic
    kick_leads_here : whether this is the verdict, what the smallest disturbance of rest leads to
        that does not die; None where that is not known
    further : other stable cycles known at the value
    beyond_limits : what passes the model's limits
    """

    value: float
    upwards: bool
    outcome: Outcome
    orbit: Orbit | None
    envelope: NDArray[np.float64] | None
    kick_leads_here: bool | None
    further: int
    beyond_limits: tuple[str, ...]


def sweep_points(diagram: Diagram, upwards: bool) -> Iterator[SweepPoint]:
    """The answers of a diagram as far as it is judged and traced, in the order of the sweep.

    The motion stays on its branch up to the fold in which that ends. At the start and behind a
    fold the answer is the verdict.
    """
    sheets = _sheets(diagram.points)
    before: DiagramPoint | None = None
    count = len(diagram.values)
    for index in range(count) if upwards else reversed(range(count)):
        verdict = diagram.verdicts.get(index)
        if verdict is None:
            before = None
            continue
        on_branches = diagram.stable(index)
        before = _followed(on_branches, before, sheets)
        if before is None and verdict.orbit is not None:
            before = _nearest([point for point in on_branches
                               if point.orbit.same_as(verdict.orbit, _SAME)], verdict.orbit)
        yield _answer(diagram, index, upwards, verdict, before)


def _answer(diagram: Diagram, index: int, upwards: bool, verdict: Verdict,
            followed: DiagramPoint | None) -> SweepPoint:
    known = diagram.stable_orbits(index)
    value = diagram.values[index]
    if followed is None or (
            verdict.orbit is not None and followed.orbit.same_as(verdict.orbit, _SAME)):
        further = len(known) - (verdict.orbit is not None)
        answered = None if verdict.failed or verdict.stands else True
        return SweepPoint(value, upwards, verdict.outcome, verdict.orbit, verdict.envelope,
                          answered, further, tuple(item.quantity for item in verdict.excesses))
    beyond = excesses(diagram.at(index), followed.orbit, diagram.settings.limits)
    return SweepPoint(value, upwards, Outcome.LIMIT_CYCLE, followed.orbit, None,
                      None if verdict.failed else False, len(known) - 1,
                      tuple(item.quantity for item in beyond))


def _followed(found: list[DiagramPoint], before: DiagramPoint | None, sheets: dict[int, int]
              ) -> DiagramPoint | None:
    """The point that continues the piece of a branch on which ``before`` is."""
    if before is None:
        return None
    sheet = sheets[id(before)]
    return _nearest([point for point in found if sheets[id(point)] == sheet], before.orbit)


def _nearest(found: Sequence[DiagramPoint], orbit: Orbit) -> DiagramPoint | None:
    """The point nearest in size to ``orbit``."""
    size = math.log(orbit.swivel)
    return min(found, key=lambda point: abs(math.log(point.orbit.swivel) - size), default=None)


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
