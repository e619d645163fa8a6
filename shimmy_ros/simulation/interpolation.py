"""Cubic Hermite interpolation over one interval, its extremes, and where it leaves a range."""

from __future__ import annotations

from math import sqrt
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import brentq

Values = NDArray[np.float64]


def hermite(fraction: float | Values, length: float | Values, start: Values, start_rate: Values,
            end: Values, end_rate: Values) -> Values:
    """Values at a ``fraction`` of an interval of ``length``, from values and rates at its ends.

    Where the ends are equal and the rates zero the result is that value, without rounding.
    """
    rest = 1.0 - fraction
    return (start + (end - start) * (fraction * fraction * (3.0 - 2.0 * fraction))
            + length * fraction * rest * (rest * start_rate - fraction * end_rate))


class Cubic(NamedTuple):
    """The cubic over the fractions 0 to 1; slopes are per whole interval."""

    start: float
    start_slope: float
    end: float
    end_slope: float

    def value(self, at: float) -> float:
        """The value at the fraction ``at``."""
        rest = 1.0 - at
        return (self.start + (self.end - self.start) * (at * at * (3.0 - 2.0 * at))
                + at * rest * (rest * self.start_slope - at * self.end_slope))

    def turning_points(self) -> list[float]:
        """The fractions in (0, 1), in order, at which the slope is zero."""
        rise = self.end - self.start
        square = 3.0 * (self.start_slope + self.end_slope - 2.0 * rise)
        linear = 2.0 * (3.0 * rise - 2.0 * self.start_slope - self.end_slope)
        discriminant = linear * linear - 4.0 * square * self.start_slope
        if not discriminant > 0.0:
            return []
        half = -0.5 * (linear + (sqrt(discriminant) if linear >= 0.0 else -sqrt(discriminant)))
        roots = [self.start_slope / half] if half else []
        if square:
            roots.append(half / square)
        return sorted(root for root in roots if 0.0 < root < 1.0)

    def crossing(self, level: float, left: float = 0.0, right: float = 1.0) -> float:
        """Where the cubic passes ``level`` between ``left`` and ``right``, on whose sides it lies.

        Either end may lie on the level and is where it passes then. Where both lie on the same
        side, which only rounding can bring about, it is ``left``.
        """
        before, after = self.value(left) - level, self.value(right) - level
        if before * after >= 0.0:
            return right if after == 0.0 != before else left
        return float(brentq(lambda at: self.value(at) - level, left, right, xtol=1e-14))


def first_exit(cubic: Cubic, low: float, high: float) -> float | None:
    """The first fraction at which ``cubic`` leaves [low, high], or None.

    It starts inside or, within rounding, on a bound.
    """
    start, start_slope, end, end_slope = cubic
    # Within the range of its Bezier points: the usual case, and quickly seen.
    if (low <= end <= high and low <= start + start_slope / 3.0 <= high
            and low <= end - end_slope / 3.0 <= high):
        return None
    if (start <= low and start_slope < 0.0) or (start >= high and start_slope > 0.0):
        return 0.0
    left = 0.0
    for right in (*cubic.turning_points(), 1.0):
        value = cubic.value(right)
        if not low <= value <= high:
            return cubic.crossing(low if value < low else high, left, right)
        left = right
    return None
