"""Non-linear elements of an odd system, balanced against the odd harmonics.

Each element turns the coefficients of the coordinates on which it acts into those of its force,
(1/pi) integral of f cos(2k-1)tau and f sin(2k-1)tau over a period, with the derivatives that
Newton's method needs. The velocity is piecewise of one sign between its zeros, so that Coulomb
and velocity-squared elements have closed forms: eqs. (36)-(41) and (45)-(65), here summed in
complex form. A general element is integrated by quadrature.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import NamedTuple, Protocol

import numpy as np

from .harmonics import Complex, Real, evaluate, orders, to_complex, velocity_zeros


class ElementForce(NamedTuple):
    """An element's harmonic force and its derivatives, for m coordinates and N harmonics.

    ``force`` and ``by_frequency`` have shape (m, 2N), ``by_coefficients`` (m, 2N, m, 2N).
    """

    force: Real
    by_coefficients: Real
    by_frequency: Real


class Element(Protocol):
    """What the balance needs of an element."""

    @property
    def dofs(self) -> tuple[int, ...]:
        """The coordinates on which the element acts."""

    def balance(self, coefficients: Real, frequency: float) -> ElementForce:
        """The force for ``coefficients`` (m, 2N) of those coordinates, at ``frequency`` [rad/s]."""


@dataclass(frozen=True)
class Coulomb:
    """The force torque * sign(velocity) on one coordinate, velocity = frequency * dq/dtau."""

    dof: int
    torque: float

    @property
    def dofs(self) -> tuple[int, ...]:
        """The coordinate on which the element acts."""
        return (self.dof,)

    def balance(self, coefficients: Real, frequency: float) -> ElementForce:
        """Eqs. (40), (41) and (36)-(39) with -|Phi| for Phi; homogeneous of degree zero.

        Raises ValueError for a coordinate that does not move: sign(0) is not a number.
        """
        row = coefficients[0]
        harmonics = row.shape[0] // 2
        crossings = _crossings(row)
        order = orders(harmonics)
        waves = np.exp(1j * np.multiply.outer(order, crossings.tau))
        force = np.conj((-4.0 / np.pi) * (waves @ crossings.sign_after) / (1j * order))
        # d sign(v) is a pulse 2 dv / |dv/dtau| at every zero of v; the two halves of the period
        # contribute alike.
        acceleration = np.abs(evaluate(row, crossings.tau, 2))
        basis = np.concatenate([waves.real, waves.imag])
        rates = np.concatenate([-order[:, None] * waves.imag, order[:, None] * waves.real])
        jacobian = (4.0 / np.pi) * (basis / acceleration) @ rates.T
        return ElementForce(
            self.torque * np.concatenate([force.real, -force.imag])[None],
            self.torque * jacobian[None, :, None],
            np.zeros((1, 2 * harmonics)),
        )


@dataclass(frozen=True)
class QuadraticDamping:
    """The force coefficient * |velocity| * velocity on one coordinate."""

    dof: int
    coefficient: float

    @property
    def dofs(self) -> tuple[int, ...]:
        """The coordinate on which the element acts."""
        return (self.dof,)

    def balance(self, coefficients: Real, frequency: float) -> ElementForce:
        """Eqs. (45)-(54) and (60)-(65); homogeneous of degree two, so that f = J A / 2."""
        row = coefficients[0]
        harmonics = row.shape[0] // 2
        if not np.any(row):
            zero = np.zeros((1, 2 * harmonics))
            return ElementForce(zero, np.zeros((1, 2 * harmonics, 1, 2 * harmonics)), zero)
        order = orders(harmonics)
        spectrum = _speed_spectrum(row)
        position = np.arange(harmonics)
        difference = spectrum[position[:, None] - position[None, :]]
        total = spectrum[position[:, None] + position[None, :] + 1]
        # |v| dv/dtau, with d(dq/dtau) = Re sum_l i (2l-1) dx_l e^{i(2l-1)tau} and dx = da - i db,
        # meets order k through the spectrum of |v| at k - l and at k + l.
        by_cosine = 0.5 * (1j * order) * (difference - total)
        by_sine = 0.5 * order * (difference + total)
        jacobian = 2.0 * frequency**2 * self.coefficient * np.block([
            [by_cosine.real, by_sine.real],
            [-by_cosine.imag, -by_sine.imag],
        ])
        force = 0.5 * jacobian @ row
        return ElementForce(force[None], jacobian[None, :, None], (2.0 / frequency) * force[None])


@dataclass(frozen=True)
class OddElement:
    """A general odd force f(q, v) on any coordinates, by quadrature.

    ``force(q, v)`` takes and returns arrays of shape (m, P): coordinates and velocities at P
    instants; it has to be odd, f(-q, -v) = -f(q, v). ``stiffness`` and ``damping`` return its
    derivatives by q and by v, shape (m, m, P). ``points`` P instants are spread evenly over half
    a period; a smooth force is integrated to rounding error once P well exceeds 2N.
    """

    dofs: tuple[int, ...]
    force: Callable[[Real, Real], Real]
    stiffness: Callable[[Real, Real], Real]
    damping: Callable[[Real, Real], Real]
    points: int = 256

    def balance(self, coefficients: Real, frequency: float) -> ElementForce:
        """Trapezoidal quadrature, which is spectrally accurate over a period."""
        harmonics = coefficients.shape[1] // 2
        order = orders(harmonics)
        phase = np.multiply.outer(order, np.pi * np.arange(self.points) / self.points)
        basis = np.concatenate([np.cos(phase), np.sin(phase)])
        rates = np.concatenate([-order[:, None] * np.sin(phase), order[:, None] * np.cos(phase)])
        place = coefficients @ basis
        velocity = frequency * (coefficients @ rates)
        weights = (2.0 / self.points) * basis
        damping = self.damping(place, velocity)
        by_coefficients = (
            np.einsum("kp,ijp,lp->ikjl", weights, self.stiffness(place, velocity), basis)
            + frequency * np.einsum("kp,ijp,lp->ikjl", weights, damping, rates)
        )
        by_frequency = np.einsum("kp,ijp,jp->ik", weights, damping, velocity / frequency)
        return ElementForce(
            self.force(place, velocity) @ weights.T, by_coefficients, by_frequency)


class _Crossings(NamedTuple):
    tau: Real
    sign_after: Real


def _crossings(row: Real) -> _Crossings:
    tau = velocity_zeros(row)
    # The sign is taken in the widest interval: in a narrow one it may be that of rounding.
    width = np.diff(tau, append=tau[0] + np.pi)
    widest = int(np.argmax(width))
    sign = np.sign(evaluate(row, tau[widest] + 0.5 * width[widest], 1))
    return _Crossings(tau, sign * (-1.0) ** (np.arange(tau.size) - widest))


def _speed_spectrum(row: Real) -> Complex:
    """W_p = (1/pi) integral of |dq/dtau| e^{-2ip tau}, p = 0..2N-1 and (by index) -1..1-2N.

    The array is laid out for negative indices as numpy understands them, W_{-p} = conj W_p.
    """
    harmonics = row.shape[0] // 2
    order = orders(harmonics)
    crossings = _crossings(row)
    # (2/pi) integral of sign(dq/dtau) e^{i m tau} over half a period, for every odd m that
    # occurs. Signs alternate and e^{i m (tau + pi)} = -e^{i m tau}: each zero counts twice.
    odd = orders(3 * harmonics)
    positive = (-4.0 / np.pi) * (
        np.exp(1j * np.multiply.outer(odd, crossings.tau)) @ crossings.sign_after) / (1j * odd)
    sign_spectrum = np.concatenate([positive, np.conj(positive[::-1])])
    even = np.arange(2 * harmonics)
    index = np.arange(harmonics)
    rate = 1j * order * to_complex(row)
    upper = sign_spectrum[index[None, :] - even[:, None]]
    lower = sign_spectrum[-1 - index[None, :] - even[:, None]]
    half = 0.5 * (upper @ rate + lower @ np.conj(rate))
    return np.concatenate([half, np.conj(half[:0:-1])])
