"""A verdict of the package against the truth: right, another cycle, wrong, or no answer."""

from __future__ import annotations

import math
from dataclasses import dataclass
from enum import Enum
from typing import TYPE_CHECKING

import numpy as np

from .integrator import Cycle
from .truths import LIMIT_CYCLE, NO_LIMIT_CYCLE, UNBOUNDED, UNDECIDED, Truth

if TYPE_CHECKING:
    from shimmy_ros.cycles.verdict import Verdict

ALLOWED = 1e-3
"""Relative difference of a verdict's numbers that is allowed whatever its error says."""
# Numbers that are off by less are still of the cycle they mean.
_MEANT = 0.05
NOT_CONVERGED = "not_converged"


class Grade(Enum):
    """How a verdict does."""

    RIGHT = "right"
    OTHER_CYCLE = "another of the cycles that kicks lead to"
    INACCURATE = "numbers outside the error"
    WRONG = "wrong"
    NO_ANSWER = "not converged"
    OPEN = "truth undecided"


@dataclass(frozen=True)
class Graded:
    """A graded verdict.

    dangerous : whether the gear does more than the verdict says
    off : relative difference of the verdict's numbers to the cycle that they mean; NaN without one
    said : what the verdict says, in short
    seconds : what it took
    """

    truth: Truth
    grade: Grade
    dangerous: bool
    off: float
    said: str
    seconds: float

    @property
    def bad(self) -> bool:
        """Whether a user would have been told something false."""
        return self.grade in (Grade.WRONG, Grade.INACCURATE)


def graded(truth: Truth, verdict: Verdict, seconds: float) -> Graded:
    """``verdict`` against ``truth``."""
    outcome = verdict.outcome.value
    said, off = outcome, math.nan
    if outcome == LIMIT_CYCLE:
        said += f" (swivel {verdict.amplitude[1]:.4g} rad, {verdict.frequency_hz:.4g} Hz)"
    grade, dangerous = Grade.WRONG, False
    if truth.outcome == UNDECIDED:
        grade = Grade.OPEN
    elif outcome == NOT_CONVERGED:
        grade = Grade.NO_ANSWER
        said += f": {verdict.message}"
    elif outcome != truth.outcome:
        dangerous = (outcome == NO_LIMIT_CYCLE
                     or (outcome == LIMIT_CYCLE and truth.outcome != NO_LIMIT_CYCLE)
                     or truth.outcome == UNBOUNDED)
    elif truth.cycle is None:
        grade = Grade.RIGHT
    else:
        offs = [_off(verdict, cycle) for cycle in truth.cycles]
        nearest = int(np.argmin(offs))
        off = offs[nearest]
        if off <= max(ALLOWED, verdict.error if math.isfinite(verdict.error) else 0.0):
            grade = Grade.RIGHT if truth.cycles[nearest] is truth.cycle else Grade.OTHER_CYCLE
        elif off <= _MEANT:
            grade = Grade.INACCURATE
        dangerous = (grade in (Grade.WRONG, Grade.OTHER_CYCLE)
                     and verdict.amplitude[1] < truth.cycle.amplitude[1])
    return Graded(truth, grade, dangerous, off, said, seconds)


def _off(verdict: Verdict, cycle: Cycle) -> float:
    theirs = np.append(cycle.amplitude, cycle.frequency_hz)
    values = np.append(verdict.amplitude, verdict.frequency_hz)
    return float(np.max(np.abs(values / theirs - 1.0)))
