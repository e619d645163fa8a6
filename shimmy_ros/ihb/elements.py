"""Non-linear elements of an odd system, balanced against the odd harmonics.

Each element turns the coefficients of the coordinates on which it acts into those of its force,
(1/pi) integral of f cos(2k-1)tau and f sin(2k-1)tau over a period, with the derivatives that
Newton's method needs. The velocity is piecewise of one sign between its zeros, so that Coulomb
and velocity-squared elements have closed forms: eqs. (36)-(41) and (45)-(65), here summed in
complex form (see ``loops``). A general element is integrated by quadrature.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import NamedTuple, Protocol

import numpy as np

from . import loops
from .harmonics import Real, orders


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
    """The force torque * sign(velocity) on one coordinate, velocity = frequency * dq/dtau.

    A negative torque is that of a derivative; a system that is to be solved has none. Raises
    ValueError for one that is not finite.
    """

    dof: int
    torque: float

    def __post_init__(self) -> None:
        _check_finite("torque", self.torque, self.dof)

    @property
    def fault(self) -> str | None:
        """What keeps the element out of a system that is to be solved, in a sentence."""
        return _fault_of("torque", self.torque, self.dof)

    @property
    def dofs(self) -> tuple[int, ...]:
        """The coordinate on which the element acts."""
        return (self.dof,)

    def balance(self, coefficients: Real, frequency: float) -> ElementForce:
        """Eqs. (40), (41) and (36)-(39) with -|Phi| for Phi; homogeneous of degree zero.

        Raises ValueError for a coordinate that does not move: sign(0) is not a number.
        """
        row = _moving(coefficients[0])
        width = row.shape[0]
        force, jacobian = np.zeros(width), np.zeros((width, width))
        loops.add_coulomb(row, self.torque, np.empty(width + 2), force, jacobian)
        return ElementForce(force[None], jacobian[None, :, None], np.zeros((1, width)))


@dataclass(frozen=True)
class QuadraticDamping:
    """The force coefficient * |velocity| * velocity on one coordinate.

    As with Coulomb, a negative coefficient is that of a derivative. Raises ValueError for one that
    is not finite.
    """

    dof: int
    coefficient: float

    def __post_init__(self) -> None:
        _check_finite("coefficient", self.coefficient, self.dof)

    @property
    def fault(self) -> str | None:
        """What keeps the element out of a system that is to be solved, in a sentence."""
        return _fault_of("coefficient", self.coefficient, self.dof)

    @property
    def dofs(self) -> tuple[int, ...]:
        """The coordinate on which the element acts."""
        return (self.dof,)

    def balance(self, coefficients: Real, frequency: float) -> ElementForce:
        """Eqs. (45)-(54) and (60)-(65); homogeneous of degree two, so that f = J A / 2."""
        row = np.ascontiguousarray(coefficients[0])
        width = row.shape[0]
        force, jacobian, by_frequency = np.zeros(width), np.zeros((width, width)), np.zeros(width)
        if np.any(row):
            loops.add_quadratic(row, self.coefficient, frequency, np.empty(width + 2), force,
                                jacobian, by_frequency)
        return ElementForce(force[None], jacobian[None, :, None], by_frequency[None])


@dataclass(frozen=True)
class OddElement:
    """A general odd force f(q, v) on any coordinates, by quadrature.

    ``force(q, v)`` takes and returns arrays of shape (m, P): coordinates and velocities at P
    instants; it has to be odd, f(-q, -v) = -f(q, v). ``stiffness`` and ``damping`` return its
    derivatives by q and by v, shape (m, m, P). ``points`` P instants are spread evenly over half
    a period, the first of them ``offset`` of their distance from its beginning; a smooth force is
    integrated to rounding error once P well exceeds 2N.
    """

    dofs: tuple[int, ...]
    force: Callable[[Real, Real], Real]
    stiffness: Callable[[Real, Real], Real]
    damping: Callable[[Real, Real], Real]
    points: int = 256
    offset: float = 0.0

    def balance(self, coefficients: Real, frequency: float) -> ElementForce:
        """Trapezoidal quadrature, which is spectrally accurate over a period."""
        harmonics = coefficients.shape[1] // 2
        order = orders(harmonics)
        phase = np.multiply.outer(
            order, np.pi * (np.arange(self.points) + self.offset) / self.points)
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


def _check_finite(name: str, value: float, dof: int) -> None:
    if not math.isfinite(value):
        raise ValueError(f"{name} on coordinate {dof} is {value}, but must be a finite number")


def _fault_of(name: str, value: float, dof: int) -> str | None:
    return (f"{name} on coordinate {dof} is {value:g}, but must be at least 0" if value < 0.0
            else None)


def _moving(row: Real) -> Real:
    if not (np.all(np.isfinite(row)) and np.any(row)):
        raise ValueError("the Coulomb force on a coordinate at rest is not defined")
    return np.ascontiguousarray(row)
