"""Cycles of a sampled oscillation: when each begins and ends, its amplitude and its frequency."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import ArrayLike, NDArray

from .interpolation import Cubic

Values = NDArray[np.float64]


@dataclass(frozen=True)
class Cycles:
    """Successive cycles, from one upward zero crossing to the next; every array has shape (n,).

    ``start`` and ``end`` [s]; ``amplitude`` is half the difference between the highest and the
    lowest value, in the unit of the oscillation; ``frequency`` [Hz].
    """

    start: Values
    end: Values
    amplitude: Values

    @property
    def frequency(self) -> Values:
        """One over the duration of each cycle [Hz]."""
        return 1.0 / (self.end - self.start)


def measure_cycles(time: ArrayLike, position: ArrayLike, rate: ArrayLike | None = None, *,
                   smallest: float = 1e-5) -> Cycles:
    """The cycles of ``position`` (m,), sampled at ``time`` (m,) [s], with its ``rate`` if known.

    Crossings and peaks are located between the samples, on the cubic that matches position and
    rate; an unknown rate is that of a cubic spline. A crossing counts when the motion has gone
    below -``smallest`` before it and goes above ``smallest`` after it, so no cycle is found in what
    stays within ``smallest``, and one that a rest interrupts lasts as long as that.

    Raises ValueError for arrays of different lengths, non-finite values and times that do not
    increase.
    """
    t, x = np.asarray(time, dtype=float), np.asarray(position, dtype=float)
    v = np.zeros_like(x) if rate is None else np.asarray(rate, dtype=float)
    if t.ndim != 1 or t.shape != x.shape or t.shape != v.shape:
        raise ValueError("time, position and rate must be lists of one length, but have shapes "
                         f"{t.shape}, {x.shape} and {v.shape}")
    if not (np.isfinite(t).all() and np.isfinite(x).all() and np.isfinite(v).all()):
        raise ValueError("time, position and rate must be finite")
    if not (np.diff(t) > 0.0).all():
        raise ValueError("time must increase from sample to sample")
    if rate is None and len(t) > 1:
        # It takes long to import, and rates are known as a rule.
        from scipy.interpolate import CubicSpline

        v = CubicSpline(t, x)(t, 1)
    crossings = [_zero(t, x, v, before) for before in _upward_crossings(x, smallest)]
    bounds = np.searchsorted(t, crossings)
    amplitude = [
        0.5 * (_peak(t, x, v, first, last) + _peak(t, -x, -v, first, last))
        for first, last in pairwise(bounds)
    ]
    return Cycles(np.array(crossings[:-1]), np.array(crossings[1:]), np.array(amplitude))


def _upward_crossings(x: Values, smallest: float) -> list[int]:
    """Indices before the last sign change on each way from below -smallest to above smallest."""
    outside = np.flatnonzero(np.abs(x) > smallest)
    above = x[outside] > 0.0
    rises = np.flatnonzero(~above[:-1] & above[1:])
    return [int(low + np.flatnonzero(x[low:high] < 0.0)[-1])
            for low, high in zip(outside[rises], outside[rises + 1], strict=True)]


def _zero(t: Values, x: Values, v: Values, before: int) -> float:
    return float(t[before] + (t[before + 1] - t[before]) * _cubic(t, x, v, before).crossing(0.0))


def _peak(t: Values, x: Values, v: Values, first: int, last: int) -> float:
    """The highest value of the samples first to last - 1 and of the cubics beside the highest."""
    top = first + int(np.argmax(x[first:last]))
    highest = float(x[top])
    for left in (top - 1, top):
        if 0 <= left < len(x) - 1:
            cubic = _cubic(t, x, v, left)
            highest = max([highest, *(cubic.value(at) for at in cubic.turning_points())])
    return highest


def _cubic(t: Values, x: Values, v: Values, left: int) -> Cubic:
    length = float(t[left + 1] - t[left])
    return Cubic(float(x[left]), length * float(v[left]),
                 float(x[left + 1]), length * float(v[left + 1]))
