"""What kind of answer a prediction was, as a number for arrays and as words for people.

An answer is of one outcome of the contract; a limit cycle, or the bounds of motion that is not
periodic, may be beyond the model's limits besides.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping

import numpy as np
from numpy.typing import NDArray

from ..ihb.solution import Outcome

Array = NDArray[np.float64]

_OUTCOMES = tuple(outcome.value for outcome in Outcome)
_BEYOND = 0.5
UNKNOWN = math.nan
"""The kind where there is no answer."""


def kind_of_status(values: Mapping[str, str]) -> float:
    """The kind of the answer whose status has these ``values``; UNKNOWN for no known outcome."""
    outcome = values.get("outcome", "")
    if outcome not in _OUTCOMES:
        return UNKNOWN
    return _OUTCOMES.index(outcome) + _BEYOND * bool(values.get("beyond_limits"))


def outcome_of(kind: float) -> str:
    """The outcome's name; empty for UNKNOWN."""
    return "" if math.isnan(kind) else _OUTCOMES[int(kind)]


def of_outcome(kinds: Array, outcome: Outcome) -> NDArray[np.bool_]:
    """Which of ``kinds`` are of an outcome, within the limits or not."""
    return np.asarray(np.floor(kinds) == _OUTCOMES.index(outcome.value))


def beyond_of(kind: float) -> str:
    """Whether an answer of this kind is beyond the model's limits: yes or no; empty for UNKNOWN."""
    return "" if math.isnan(kind) else "yes" if kind % 1.0 == _BEYOND else "no"


def beyond_limits(kinds: Array) -> NDArray[np.bool_]:
    """Which of ``kinds`` are beyond the model's limits."""
    return np.asarray(kinds % 1.0 == _BEYOND)


MARKED: Mapping[str, Callable[[Array], NDArray[np.bool_]]] = {
    "unbounded": lambda kinds: of_outcome(kinds, Outcome.UNBOUNDED),
    "beyond the model's limits": beyond_limits,
    "not periodic": lambda kinds: of_outcome(kinds, Outcome.NOT_PERIODIC),
    "not converged": lambda kinds: of_outcome(kinds, Outcome.NOT_CONVERGED),
}
"""Answers that need a mark beside the numbers, by what they are called."""


def stretches(marked: NDArray[np.bool_], time: Array, end: float) -> list[tuple[float, float]]:
    """From when to when the answers at ``time`` [s] are ``marked``.

    Each one is in force until the next, and the last one until ``end``.
    """
    edges = np.flatnonzero(np.diff(np.concatenate([[False], marked, [False]])))
    until = np.append(time, max(end, float(time[-1]))) if time.size else time
    return [(float(until[first]), float(until[last]))
            for first, last in zip(edges[::2], edges[1::2], strict=True)]
