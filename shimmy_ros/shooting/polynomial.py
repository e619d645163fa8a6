"""Real roots of polynomials on [0, 1], all of them and none twice, by Bernstein coefficients.

By Descartes' rule the sign changes in the Bernstein coefficients bound the number of roots: none
means no root, one means exactly one. With more, the interval is split (de Casteljau).
"""

from __future__ import annotations

from functools import cache
from math import comb

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import brentq

Real = NDArray[np.float64]

_DEEPEST = 45
# Not one half: roots at round places would lie on an interval's end, where rounding decides.
_SPLIT = 0.4871


def roots(coefficients: Real) -> list[float]:
    """All places in (0, 1] where the polynomial changes sign, ascending.

    ``coefficients`` (p + 1,) are those of 1, x, x^2, ...; leading zeros, a root at 0, are ignored,
    and so is a root in which the sign does not change.
    """
    nonzero = np.flatnonzero(coefficients)
    if nonzero.size == 0:
        return []
    return _roots(coefficients[nonzero[0]:], first_only=False)


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
    found = _roots(coefficients, first_only=True)
    return found[0] if found else None


def _roots(coefficients: Real, first_only: bool) -> list[float]:
    degree = len(coefficients) - 1
    to_bernstein, left, right = _matrices(degree)
    falling = coefficients[::-1].tolist()
    stack = [(0.0, 1.0, to_bernstein @ coefficients, 0)]
    found: list[float] = []
    while stack:
        low, high, bernstein, depth = stack.pop()
        sign = np.sign(bernstein)
        nonzero = sign[sign != 0.0]
        changes = int(np.count_nonzero(nonzero[1:] != nonzero[:-1]))
        if changes == 0:
            if sign[-1] == 0.0 and nonzero.size:
                found.append(high)
        elif changes == 1 and sign[0] != 0.0 and sign[-1] != 0.0:
            found.append(_solve(falling, low, high, bernstein[0], bernstein[-1]))
        elif depth < _DEEPEST:
            middle = low + _SPLIT * (high - low)
            stack.append((middle, high, right @ bernstein, depth + 1))
            stack.append((low, middle, left @ bernstein, depth + 1))
        if first_only and found:
            break
    return found


def _solve(falling: list[float], low: float, high: float, at_low: float, at_high: float) -> float:
    """The root between two places with values of opposite sign there."""

    def value(place: float) -> float:
        # At the ends rounding may give another sign to a value that is nearly zero.
        if place in (low, high):
            return at_low if place == low else at_high
        total = 0.0
        for coefficient in falling:
            total = total * place + coefficient
        return total

    return float(brentq(value, low, high, xtol=1e-30, rtol=4.0 * np.finfo(float).eps,
                        maxiter=1000))


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
