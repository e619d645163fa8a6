"""Real roots of polynomials on [0, 1], all of them and none twice, by Bernstein coefficients.

By Descartes' rule the sign changes in the Bernstein coefficients bound the number of roots: none
means no root, one means exactly one. With more, the interval is split (de Casteljau).
"""

from __future__ import annotations

from functools import cache
from math import comb

import numpy as np
from numpy.typing import NDArray

from ..compiling import compiled

Real = NDArray[np.float64]

_DEEPEST = 45
# Not one half: roots at round places would lie on an interval's end, where rounding decides.
_SPLIT = 0.4871
_MOST_ITERATIONS = 200
_ROUNDING = 4.0 * 2.220446049250313e-16


def roots(coefficients: Real) -> list[float]:
    """All places in (0, 1] where the polynomial changes sign, ascending.

    ``coefficients`` (p + 1,) are those of 1, x, x^2, ...; leading zeros, a root at 0, are ignored,
    and so is a root in which the sign does not change.
    """
    if abs(coefficients[0]) > np.abs(coefficients[1:]).sum():
        return []
    nonzero = np.flatnonzero(coefficients)
    if nonzero.size == 0:
        return []
    return _roots(coefficients[nonzero[0]:], False)


def first_descent(coefficients: Real) -> float | None:
    """Where in [0, 1] a polynomial that starts out positive first becomes negative, or None.

    A start at zero or, by rounding, below it counts as zero, and the derivatives decide: the
    result is 0 if the polynomial sets out downwards.
    """
    start = coefficients[0]
    if start > 0.0:
        if start > np.abs(coefficients[1:]).sum():
            return None
    else:
        nonzero = np.flatnonzero(coefficients[1:])
        if nonzero.size == 0:
            return None
        coefficients = coefficients[1 + nonzero[0]:]
        if coefficients[0] < 0.0:
            return 0.0
    found = _roots(coefficients, True)
    return found[0] if found else None


def _roots(coefficients: Real, first_only: bool) -> list[float]:
    found: list[float] = _isolated(np.ascontiguousarray(coefficients),
                                   *_matrices(len(coefficients) - 1), first_only).tolist()
    return found


@compiled
def _isolated(coefficients: Real, to_bernstein: Real, left: Real, right: Real, first_only: bool
              ) -> Real:
    """The roots, ascending; those of either part of an interval from its matrix."""
    count = coefficients.shape[0]
    # One interval waits at each depth, and the one in work.
    waiting = np.empty((_DEEPEST + 2, count))
    lows, highs = np.zeros(_DEEPEST + 2), np.ones(_DEEPEST + 2)
    depths = np.zeros(_DEEPEST + 2, np.int64)
    waiting[0] = to_bernstein @ coefficients
    top = 0
    found = np.empty(count)
    number = 0
    while top >= 0 and number < count and not (first_only and number):
        bernstein = waiting[top].copy()
        low, high, depth = lows[top], highs[top], depths[top]
        top -= 1
        changes, last = 0, 0.0
        for value in bernstein:
            if value != 0.0:
                changes += value * last < 0.0
                last = np.sign(value)
        if changes == 0:
            if bernstein[-1] == 0.0 and last != 0.0:
                found[number] = high
                number += 1
        elif changes == 1 and bernstein[0] != 0.0 and bernstein[-1] != 0.0:
            found[number] = _solved(coefficients, low, high, bernstein[0] > 0.0)
            number += 1
        elif depth < _DEEPEST:
            middle = low + _SPLIT * (high - low)
            for part in range(2):
                top += 1
                waiting[top] = (right if part == 0 else left) @ bernstein
                lows[top], highs[top] = (middle, high) if part == 0 else (low, middle)
                depths[top] = depth + 1
    return found[:number]


@compiled
def _solved(coefficients: Real, low: float, high: float, falls: bool) -> float:
    """The only root between two places, by Newton's method where it stays within the bracket."""
    place = 0.5 * (low + high)
    for _ in range(_MOST_ITERATIONS):
        value, slope = 0.0, 0.0
        for k in range(coefficients.shape[0] - 1, -1, -1):
            slope = slope * place + value
            value = value * place + coefficients[k]
        if value == 0.0:
            return place
        # At the ends rounding may give another sign to a value that is nearly zero.
        if (value > 0.0) == falls:
            low = place
        else:
            high = place
        following = place - value / slope if slope != 0.0 else low
        if not low < following < high:
            following = 0.5 * (low + high)
        if abs(following - place) <= _ROUNDING * place or high - low <= _ROUNDING * high:
            return following
        place = following
    return place


@cache
def _matrices(degree: int) -> tuple[Real, Real, Real]:
    """From monomial to Bernstein coefficients, and from those to the ones of either part."""
    to_bernstein = np.array([[comb(row, column) / comb(degree, column) if column <= row else 0.0
                              for column in range(degree + 1)] for row in range(degree + 1)])

    def part(share: float) -> Real:
        return np.array([[
            comb(row, column) * share**column * (1.0 - share)**(row - column)
            if column <= row else 0.0
            for column in range(degree + 1)] for row in range(degree + 1)])

    return to_bernstein, part(_SPLIT), part(1.0 - _SPLIT)[::-1, ::-1].copy()
