"""Odd Fourier sums: q(tau) = sum_k a_k cos((2k-1) tau) + b_k sin((2k-1) tau), eq. (7).

Coefficients of one coordinate are a real array [a_1..a_N, b_1..b_N], eq. (10), of several a
``(n, 2N)`` array. Inside this package the same sum is often written Re sum_k x_k e^{i(2k-1) tau}
with the complex ``x = a - i b``.
"""

from __future__ import annotations

from functools import lru_cache
from typing import Any

import numpy as np

from . import loops
from .loops import Complex, Real

__all__ = ["Complex", "Real", "evaluate", "orders", "peaks", "shifted", "to_complex", "to_real",
           "velocity_zeros", "with_harmonics", "zeros"]


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
    # Not by BLAS, which may divide so small a product among threads.
    return np.asarray(np.einsum("...k,kp->...p", x, waves.reshape(len(order), -1)).real.reshape(
        x.shape[:-1] + waves.shape[1:]))


def shifted(coefficients: Real, tau: float) -> Real:
    """Coefficients of q(tau + shift) for a shift of ``tau`` [rad of the fundamental]."""
    order = orders(coefficients.shape[-1] // 2)
    return to_real(to_complex(coefficients) * np.exp(1j * order * tau))


def velocity_zeros(coefficients: Real) -> Real:
    """Every zero in [0, pi) of the first derivative of one sum, ascending; shape (M,), M odd.

    ``coefficients`` has shape (2N,). Exact in the sense that no zero can be missed: an interval
    is passed over only where a bound on the curvature excludes a zero, and taken to hold one only
    where the same bound shows the function to be monotone. Zeros between which the sum does not
    rise above its rounding error merge: two drop out together, three are one. Raises ValueError
    for a sum that is zero or not finite.
    """
    return zeros(1j * orders(coefficients.shape[-1] // 2) * to_complex(coefficients))


def zeros(x: Complex) -> Real:
    """Every zero in [0, pi) of u = Re sum_k x_k e^{i(2k-1) tau}, ascending; as velocity_zeros."""
    bound = float(orders(x.shape[0]) ** 2 @ np.abs(x))
    if not 0.0 < bound < np.inf:
        raise ValueError("the zeros of a sum that vanishes or is not finite are not defined")
    found = np.empty(2 * x.shape[0] + 2)
    result = found[:loops.zeros(x, found)] % np.pi
    # The remainder of a tiny negative number rounds up to pi itself.
    return np.sort(np.where(result < np.pi, result, 0.0))


def peaks(coefficients: Real) -> Real:
    """The largest magnitude of each sum over the period, shape coefficients.shape[:-1]."""
    flat = np.ascontiguousarray(coefficients.reshape(-1, coefficients.shape[-1]))
    largest = np.empty(len(flat))
    loops.peaks(flat, largest)
    return largest.reshape(coefficients.shape[:-1])
