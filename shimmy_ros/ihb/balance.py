"""The harmonic balance equations (14)-(17) and their derivatives, linear coordinates eliminated.

In complex form, harmonic k of the balance is Z_k x_k + F_k = 0 with the dynamic stiffness
Z_k = -((2k-1) omega)^2 M + i (2k-1) omega C + K, which holds eqs. (22)-(24). A coordinate without
a non-linear element enters linearly, and is eliminated exactly, harmonic by harmonic; what stays
are the ``active`` coordinates. With every coordinate active it is the paper's system over pi.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from .harmonics import Complex, Real, orders, to_complex, to_real
from .system import System


class Balance(NamedTuple):
    """Residual of the active coordinates and its derivatives, for m active and N harmonics.

    ``residual``, ``by_frequency`` and ``by_parameter`` have shape (2N m,), ``by_coefficients``
    (2N m, 2N m), ordered coordinate by coordinate as eq. (12). ``error`` is the residual's largest
    size in one coordinate relative to that of the terms of which it is the sum.
    """

    residual: Real
    by_coefficients: Real
    by_frequency: Real
    by_parameter: Real | None
    error: float


class Condensed(NamedTuple):
    """Dynamic stiffness (N, m, m) of the active coordinates, and what gives the others.

    ``recover`` has shape (N, n, m): x of all coordinates from x of the active ones;
    ``recover_left`` (N, m, n) is its counterpart for the rows.
    """

    stiffness: Complex
    recover: Complex
    recover_left: Complex


def dynamic_stiffness(system: System, frequency: float, harmonics: int) -> Complex:
    """Z, shape (N, n, n), at ``frequency`` omega [rad/s]."""
    rate = 1j * frequency * orders(harmonics)[:, None, None]
    return np.asarray(rate**2 * system.mass + rate * system.damping + system.stiffness)


def condense(
    system: System, frequency: float, harmonics: int, active: tuple[int, ...]
) -> Condensed:
    """Eliminate every coordinate but the ``active`` ones.

    Raises numpy.linalg.LinAlgError where the others alone resonate undamped at a harmonic.
    """
    full = dynamic_stiffness(system, frequency, harmonics)
    kept = list(active)
    dropped = [dof for dof in range(system.dofs) if dof not in active]
    recover = np.zeros((harmonics, system.dofs, len(kept)), dtype=np.complex128)
    recover_left = np.zeros((harmonics, len(kept), system.dofs), dtype=np.complex128)
    recover[:, kept, range(len(kept))] = 1.0
    recover_left[:, range(len(kept)), kept] = 1.0
    if dropped:
        inner = np.linalg.inv(full[:, dropped][:, :, dropped])
        recover[:, dropped] = -inner @ full[:, dropped][:, :, kept]
        recover_left[:, :, dropped] = -full[:, kept][:, :, dropped] @ inner
    return Condensed(full[:, kept] @ recover, recover, recover_left)


def balance(
    system: System,
    coefficients: Real,
    frequency: float,
    active: tuple[int, ...],
    derivative: System | None = None,
) -> Balance:
    """The balance at ``coefficients`` (m, 2N) of the active coordinates and ``frequency`` [rad/s].

    ``derivative``, the derivative of the system by a parameter, adds ``by_parameter``, eq. (5)'s
    P with that of the matrices. Raises as condense, and ValueError for a Coulomb element at rest.
    """
    count, width = coefficients.shape
    harmonics = width // 2
    condensed = condense(system, frequency, harmonics, active)
    x = to_complex(coefficients)
    order = orders(harmonics)[:, None, None]
    turning = -2.0 * order**2 * frequency * system.mass + 1j * order * system.damping
    by_frequency = _apply(condensed.recover_left @ turning @ condensed.recover, x)
    residual = _apply(condensed.stiffness, x)
    terms = np.linalg.norm(
        np.einsum("kij,jk->ik", np.abs(condensed.stiffness), np.abs(x)), axis=1)
    jacobian = np.zeros((count, width, count, width))
    index = np.arange(harmonics)
    jacobian[:, index, :, index] = condensed.stiffness.real
    jacobian[:, index, :, index + harmonics] = condensed.stiffness.imag
    jacobian[:, index + harmonics, :, index] = -condensed.stiffness.imag
    jacobian[:, index + harmonics, :, index + harmonics] = condensed.stiffness.real
    for element in system.elements:
        place = [active.index(dof) for dof in element.dofs]
        force = element.balance(coefficients[place], frequency)
        residual[place] += force.force
        by_frequency[place] += force.by_frequency
        jacobian[np.ix_(place, range(width), place, range(width))] += force.by_coefficients
        terms[place] += np.linalg.norm(force.force, axis=1)
    by_parameter = None
    if derivative is not None:
        by_parameter = _by_parameter(derivative, condensed, coefficients, frequency, active)
    terms = np.maximum(terms, np.finfo(np.float64).tiny)
    error = float(np.max(np.linalg.norm(residual, axis=1) / terms))
    return Balance(residual.ravel(), jacobian.reshape(count * width, count * width),
                   by_frequency.ravel(), by_parameter, error)


def recovered(
    system: System, coefficients: Real, frequency: float, active: tuple[int, ...]
) -> Real:
    """Coefficients (n, 2N) of all coordinates from those (m, 2N) of the active ones."""
    condensed = condense(system, frequency, coefficients.shape[1] // 2, active)
    return to_real(np.einsum("kij,jk->ik", condensed.recover, to_complex(coefficients)))


def _by_parameter(derivative: System, condensed: Condensed, coefficients: Real, frequency: float,
                  active: tuple[int, ...]) -> Real:
    x = to_complex(coefficients)
    changing = dynamic_stiffness(derivative, frequency, x.shape[1])
    result = _apply(condensed.recover_left @ changing @ condensed.recover, x)
    for element in derivative.elements:
        place = [active.index(dof) for dof in element.dofs]
        result[place] += element.balance(coefficients[place], frequency).force
    return np.asarray(result.ravel())


def _apply(stiffness: Complex, x: Complex) -> Real:
    return to_real(np.einsum("kij,jk->ik", stiffness, x))
