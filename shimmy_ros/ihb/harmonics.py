"""Odd Fourier sums: q(tau) = sum_k a_k cos((2k-1) tau) + b_k sin((2k-1) tau), eq. (7).

Coefficients of one coordinate are a real array [a_1..a_N, b_1..b_N], eq. (10), of several a
``(n, 2N)`` array. Inside this package the same sum is often written Re sum_k x_k e^{i(2k-1) tau}
with the complex ``x = a - i b``.
"""

from __future__ import annotations

from functools import lru_cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

Real = NDArray[np.float64]
Complex = NDArray[np.complex128]

# The error of a sum relative to that of its terms' slopes, rounding of the angle included.
_ROUNDING = 4.0 * float(np.finfo(np.float64).eps)
_MAXIMUM_BISECTIONS = 48


@lru_cache(maxsize=128)
def orders(harmonics: int) -> Real:
    """The odd harmonic orders 1, 3, ..., 2N-1, shape (N,)."""
    if harmonics < 1:
        raise ValueError(f"harmonics is {harmonics}, but must be at least 1")
    result = np.arange(1.0, 2.0 * harmonics, 2.0)
    result.setflags(write=False)
    return result


def to_complex(coefficients: Real) -> Complex:
    """Real coefficients (..., 2N) as complex ones (..., N), x = a - i b."""
    harmonics = coefficients.shape[-1] // 2
    return np.asarray(coefficients[..., :harmonics] - 1j * coefficients[..., harmonics:])


def to_real(x: Complex) -> Real:
    """Complex coefficients (..., N) as real ones (..., 2N); the inverse of to_complex."""
    return np.concatenate([x.real, -x.imag], axis=-1)


def with_harmonics(coefficients: Real, harmonics: int) -> Real:
    """The same sum with more harmonics (zeros) or fewer (cut off), shape (..., 2 harmonics)."""
    old = coefficients.shape[-1] // 2
    kept = min(old, harmonics)
    result = np.zeros((*coefficients.shape[:-1], 2 * harmonics))
    result[..., :kept] = coefficients[..., :kept]
    result[..., harmonics:harmonics + kept] = coefficients[..., old:old + kept]
    return result


def evaluate(coefficients: Real, tau: Any, derivative: int = 0) -> Real:
    """The sum's ``derivative``-th derivative by tau, shape coefficients.shape[:-1] + tau.shape."""
    order = orders(coefficients.shape[-1] // 2)
    x = to_complex(coefficients) * (1j * order) ** derivative
    waves = np.exp(1j * np.multiply.outer(order, np.asarray(tau, dtype=np.float64)))
    return np.asarray(np.tensordot(x, waves, axes=1).real)


def shifted(coefficients: Real, tau: float) -> Real:
    """Coefficients of q(tau + shift) for a shift of ``tau`` [rad of the fundamental]."""
    order = orders(coefficients.shape[-1] // 2)
    return to_real(to_complex(coefficients) * np.exp(1j * order * tau))


def velocity_zeros(coefficients: Real) -> Real:
    """Every zero in [0, pi) of the first derivative of one sum, ascending; shape (M,), M odd.

    ``coefficients`` has shape (2N,). Exact in the sense that no zero can be missed: an interval
    is passed over only where a bound on the curvature excludes a zero, and taken to hold one only
    where the same bound shows the function to be monotone. Zeros between which the sum does not
    rise above its rounding error merge: two drop out together, three are one. Raises ValueError for a sum that is zero or not finite.
    """
    return zeros(1j * orders(coefficients.shape[-1] // 2) * to_complex(coefficients))


def zeros(x: Complex) -> Real:
    """Every zero in [0, pi) of u = Re sum_k x_k e^{i(2k-1) tau}, ascending; as velocity_zeros."""
    harmonics = x.shape[0]
    order = orders(harmonics)
    bound = float(order**2 @ np.abs(x))
    if not 0.0 < bound < np.inf:
        raise ValueError("the zeros of a sum that vanishes or is not finite are not defined")
    grid, waves = _grid(harmonics)
    values = (x @ waves).real
    slopes = ((1j * order * x) @ waves).real
    # Signs are sign bits: a value of exactly zero has one too, and it is the opposite one at the
    # last point, which is the first half a period on, so that such a zero counts once.
    values[-1] = -values[0]
    low, high = grid[:-1], grid[1:]
    at_low, at_high, slope_low, slope_high = values[:-1], values[1:], slopes[:-1], slopes[1:]
    width = float(grid[1] - grid[0])
    # In a narrower interval than this the bound on the curvature is below the rounding error.
    narrowest = np.sqrt(8.0 * _ROUNDING * float(order @ np.abs(x)) / bound)
    found: list[Real] = []
    while True:
        change = np.signbit(at_low) != np.signbit(at_high)
        nearest = np.minimum(np.abs(at_low), np.abs(at_high))
        excluded = ~change & (nearest > bound * width**2 / 8.0)
        same_slope = (slope_low < 0.0) == (slope_high < 0.0)
        steepness = np.minimum(np.abs(slope_low), np.abs(slope_high))
        monotone = same_slope & (steepness > bound * width / 2.0)
        single = monotone & change
        if single.any():
            found.append(_polish(x, order, low[single], high[single],
                                 at_low[single], at_high[single]))
        open_ = ~(excluded | monotone)
        low, high, at_low, at_high, slope_low, slope_high = (
            part[open_] for part in (low, high, at_low, at_high, slope_low, slope_high))
        if width <= narrowest or not low.size:
            break
        middle = 0.5 * (low + high)
        wave = np.exp(1j * np.multiply.outer(order, middle))
        at_middle = (x @ wave).real
        slope_middle = ((1j * order * x) @ wave).real
        low, high = np.append(low, middle), np.append(middle, high)
        at_low, at_high = np.append(at_low, at_middle), np.append(at_middle, at_high)
        slope_low = np.append(slope_low, slope_middle)
        slope_high = np.append(slope_middle, slope_high)
        width *= 0.5
    if low.size:
        found.append(_merged(low, high, at_low, at_high))
    result = np.concatenate(found) % np.pi
    # The remainder of a tiny negative number rounds up to pi itself.
    return np.sort(np.where(result < np.pi, result, 0.0))


def peaks(coefficients: Real) -> Real:
    """The largest magnitude of each sum over the period, shape coefficients.shape[:-1]."""
    flat = coefficients.reshape(-1, coefficients.shape[-1])
    largest = np.array([
        np.max(np.abs(evaluate(row, velocity_zeros(row)))) if np.any(row) else 0.0 for row in flat
    ])
    return largest.reshape(coefficients.shape[:-1])


def _merged(low: Real, high: Real, at_low: Real, at_high: Real) -> Real:
    """The middle of each run of adjoining intervals over which the sign changes.

    Inside a run u is zero but for rounding: a double zero is none, a triple one is one.
    """
    order = np.argsort(low)
    low, high, at_low, at_high = low[order], high[order], at_low[order], at_high[order]
    apart = low[1:] > 0.5 * (high[:-1] + high[1:])
    first, last = np.append(True, apart), np.append(apart, True)
    change = np.signbit(at_low[first]) != np.signbit(at_high[last])
    return np.asarray(0.5 * (low[first] + high[last])[change])


def _polish(x: Complex, order: Real, low: Real, high: Real, at_low: Real, at_high: Real) -> Real:
    """Newton's method from the chord, kept inside brackets in which u is monotone."""
    low, high = low.copy(), high.copy()
    rising = at_high > at_low
    root = low - at_low * (high - low) / (at_high - at_low)
    for _ in range(_MAXIMUM_BISECTIONS):
        wave = np.exp(1j * np.multiply.outer(order, root))
        value = (x @ wave).real
        slope = ((1j * order * x) @ wave).real
        right_of_root = (value > 0.0) == rising
        high = np.where(right_of_root, root, high)
        low = np.where(right_of_root, low, root)
        step = np.divide(value, slope, out=np.zeros_like(value), where=slope != 0.0)
        proposed = root - step
        inside = (proposed >= low) & (proposed <= high) & (slope != 0.0)
        new = np.where(inside, proposed, 0.5 * (low + high))
        done = np.abs(new - root) <= _ROUNDING * np.pi
        root = new
        if done.all():
            break
    return root


@lru_cache(maxsize=64)
def _grid(harmonics: int) -> tuple[Real, Complex]:
    # Not aligned with multiples of pi/2, where the zeros of a sum in cosines alone lie.
    grid = np.linspace(0.0, np.pi, 8 * harmonics + 5) - 0.1
    waves = np.exp(1j * np.multiply.outer(orders(harmonics), grid))
    waves[:, -1] = -waves[:, 0]
    grid.setflags(write=False)
    waves.setflags(write=False)
    return grid, waves
