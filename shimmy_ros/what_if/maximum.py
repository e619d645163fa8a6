"""The maximum of a function over an interval, in slices."""

from __future__ import annotations

import math
from collections.abc import Callable, Generator

_GOLDEN = 0.5 * (3.0 - math.sqrt(5.0))
_MOST_STEPS = 60


def maximum(function: Callable[[float], Generator[None, None, float]], low: float, high: float,
            tolerance: float) -> Generator[None, None, float]:
    """Where from ``low`` to ``high``, ends included, ``function`` is largest, to ``tolerance``.

    By Brent's method: parabolas through the three best places, golden sections where these do not
    help. Of several local maxima one is found.
    """
    left, right = low, high
    best = second = third = low + _GOLDEN * (high - low)
    values = {best: (yield from function(best))}
    step = before = right - left
    for _ in range(_MOST_STEPS):
        middle = 0.5 * (left + right)
        if max(right - best, best - left) <= 2.0 * tolerance:
            break
        vertex = _vertex(values, best, second, third)
        # A parabola has to halve the step before last, or the interval would not shrink.
        if vertex is not None and left < vertex < right and abs(vertex - best) < 0.5 * before:
            before, step = step, vertex - best
            if min(vertex - left, right - vertex) < 2.0 * tolerance:
                step = math.copysign(tolerance, middle - best)
        else:
            before = (right if best < middle else left) - best
            step = _GOLDEN * before
        place = best + (step if abs(step) >= tolerance else math.copysign(tolerance, step))
        if place not in values:
            values[place] = yield from function(place)
        if values[place] >= values[best]:
            left, right = (best, right) if place >= best else (left, best)
            best, second, third = place, best, second
        else:
            left, right = (place, right) if place < best else (left, place)
            if values[place] >= values[second] or second == best:
                second, third = place, second
            elif values[place] >= values[third] or third in (best, second):
                third = place
    for end in (low, high):
        if abs(best - end) <= 3.0 * tolerance:
            values[end] = yield from function(end)
    return max(values, key=lambda place: values[place])


def _vertex(values: dict[float, float], first: float, second: float, third: float
            ) -> float | None:
    """Where the parabola through three places is largest, if it has a maximum."""
    if len({first, second, third}) < 3:
        return None
    a, b = second - first, third - first
    rise_a, rise_b = values[second] - values[first], values[third] - values[first]
    determinant = a * rise_b - b * rise_a
    if not determinant / (a * b * (b - a)) < 0.0:
        return None
    return first - 0.5 * (b * b * rise_a - a * a * rise_b) / determinant
