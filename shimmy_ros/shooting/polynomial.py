"""Real roots of polynomials on [0, 1], all of them and none twice, by Bernstein coefficients.

By Descartes' rule the sign changes in the Bernstein coefficients bound the number of roots: none
means no root, one means exactly one. With more, the interval is split (de Casteljau).
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ..compiling import compiled

Real = NDArray[np.float64]

_DEEPEST = 45
# Not one half: roots at round places would lie on an interval's end, where rounding decides.
_SPLIT = 0.4871
_MOST_ITERATIONS = 200
_ROUNDING = 4.0 * 2.220446049250313e-16


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


@compiled
def _to_bernstein(coefficients: Real, bernstein: Real) -> None:
    """Puts a polynomial's Bernstein coefficients on [0, 1] into ``bernstein``."""
    degree = coefficients.shape[0] - 1
    binomial = 1.0
    for k in range(degree + 1):
        bernstein[k] = coefficients[k] / binomial
        binomial = binomial * (degree - k) / (k + 1)
    # Row by row of Pascal's triangle.
    for level in range(1, degree + 1):
        for k in range(degree, level - 1, -1):
            bernstein[k] += bernstein[k - 1]


@compiled
def _isolated(coefficients: Real, first_only: bool) -> Real:
    """The roots, ascending."""
    count = coefficients.shape[0]
    # One interval waits at each depth, and the one in work.
    waiting = np.empty((_DEEPEST + 2, count))
    lows, highs = np.zeros(_DEEPEST + 2), np.ones(_DEEPEST + 2)
    depths = np.zeros(_DEEPEST + 2, np.int64)
    _to_bernstein(coefficients, waiting[0])
    top = 0
    found = np.empty(count)
    number = 0
    while top >= 0 and number < count and not (first_only and number > 0):
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
            right, left = top + 1, top + 2
            for k in range(count):
                waiting[left, k] = bernstein[0]
                waiting[right, count - 1 - k] = bernstein[count - 1 - k]
                for item in range(count - 1 - k):
                    # In this form rounding keeps a sign that both have.
                    bernstein[item] = ((1.0 - _SPLIT) * bernstein[item]
                                       + _SPLIT * bernstein[item + 1])
            lows[right], highs[right], lows[left], highs[left] = middle, high, low, middle
            depths[right] = depths[left] = depth + 1
            top += 2
    return found[:number]


@compiled
def roots(coefficients: Real) -> Real:
    """All places in (0, 1] where the polynomial changes sign, ascending.

    ``coefficients`` (p + 1,) are those of 1, x, x^2, ...; leading zeros, a root at 0, are ignored,
    and so is a root in which the sign does not change, as far as rounding lets that be told.
    """
    rest = 0.0
    for k in range(1, coefficients.shape[0]):
        rest += abs(coefficients[k])
    if abs(coefficients[0]) > rest:
        return np.empty(0)
    for first in range(coefficients.shape[0]):
        if coefficients[first] != 0.0:
            return _isolated(coefficients[first:], False)
    return np.empty(0)


@compiled
def first_descent(coefficients: Real) -> float:
    """Where in [0, 1] a polynomial that starts out positive first becomes negative, or infinity.

    A start at zero or, by rounding, below it counts as zero, and the derivatives decide: the
    result is 0 if the polynomial sets out downwards.
    """
    count = coefficients.shape[0]
    first = 0
    if coefficients[0] > 0.0:
        rest = 0.0
        for k in range(1, count):
            rest += abs(coefficients[k])
        if coefficients[0] > rest:
            return np.inf
    else:
        first = 1
        while first < count and coefficients[first] == 0.0:
            first += 1
        if first == count:
            return np.inf
        if coefficients[first] < 0.0:
            return 0.0
    found = _isolated(coefficients[first:], True)
    return found[0] if found.shape[0] > 0 else np.inf
