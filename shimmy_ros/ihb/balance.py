"""The harmonic balance equations (14)-(17) and their derivatives, linear coordinates eliminated.

In complex form, harmonic k of the balance is Z_k x_k + F_k = 0 with the dynamic stiffness
Z_k = -((2k-1) omega)^2 M + i (2k-1) omega C + K, which holds eqs. (22)-(24). A coordinate without
a non-linear element enters linearly, and is eliminated exactly, harmonic by harmonic; what stays
are the ``active`` coordinates. With every coordinate active it is the paper's system over pi.
"""

from __future__ import annotations

from functools import lru_cache
from typing import NamedTuple

import numpy as np

from . import loops
from .elements import Element
from .loops import Index, Real
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


class Packed(NamedTuple):
    """A system as ``loops`` takes it: matrices, the coordinates kept and dropped, and for the
    Coulomb and quadratic elements their positions among the kept ones and their strengths."""

    mass: Real
    damping: Real
    stiffness: Real
    kept: Index
    dropped: Index
    coulomb: Index
    torques: Real
    quadratic: Index
    coefficients: Real


def packed(system: System, active: tuple[int, ...]) -> Packed:
    """``system`` with all coordinates but the ``active`` ones to be eliminated."""
    forms = system.closed_forms
    kept, dropped = split_coordinates(system.dofs, active)
    return Packed(
        system.mass, system.damping, system.stiffness, kept, dropped,
        _positions(active, forms.coulomb), forms.torques,
        _positions(active, forms.quadratic), forms.coefficients)


def balance(
    system: System,
    coefficients: Real,
    frequency: float,
    active: tuple[int, ...],
    derivative: System | None = None,
) -> Balance:
    """The balance at ``coefficients`` (m, 2N) of the active coordinates and ``frequency`` [rad/s].

    ``derivative``, the derivative of the system by a parameter, adds ``by_parameter``, eq. (5)'s
    P with that of the matrices. Where a Coulomb element is at rest, or the eliminated coordinates
    resonate undamped, the residual is NaN and the error infinite.
    """
    point = np.ascontiguousarray(coefficients)
    count, width = point.shape
    parts = packed(system, active)
    residual, by_frequency = np.empty((count, width)), np.empty((count, width))
    jacobian = np.empty((count, width, count, width))
    terms = np.empty(count)
    loops.assemble(*parts, point, frequency, residual, jacobian, by_frequency, terms)
    for element in system.general_elements:
        add_general(element, active, point, frequency, residual, jacobian, by_frequency, terms)
    by_parameter: Real | None = None
    if derivative is not None:
        by_parameter = np.zeros((count, width))
        loops.parameter_force(
            *parts[:5], derivative.mass, derivative.damping, derivative.stiffness, point,
            frequency, by_parameter)
        for element in derivative.elements:
            place = [active.index(dof) for dof in element.dofs]
            by_parameter[place] += element.balance(point[place], frequency).force
        by_parameter = by_parameter.ravel()
    return Balance(residual.ravel(), jacobian.reshape(count * width, count * width),
                   by_frequency.ravel(), by_parameter, loops.relative_error(residual, terms))


def add_general(element: Element, active: tuple[int, ...], point: Real, frequency: float,
                residual: Real, jacobian: Real, by_frequency: Real, terms: Real) -> None:
    """Add an element without a closed form to what loops.assemble fills."""
    place = [active.index(dof) for dof in element.dofs]
    width = range(point.shape[1])
    force = element.balance(point[place], frequency)
    residual[place] += force.force
    by_frequency[place] += force.by_frequency
    jacobian[np.ix_(place, width, place, width)] += force.by_coefficients
    terms[place] += np.linalg.norm(force.force, axis=1)


def recovered(
    system: System, coefficients: Real, frequency: float, active: tuple[int, ...]
) -> Real:
    """Coefficients (n, 2N) of all coordinates from those (m, 2N) of the active ones."""
    return loops.recover(*packed(system, active)[:5], np.ascontiguousarray(coefficients), frequency)


@lru_cache(maxsize=256)
def split_coordinates(dofs: int, active: tuple[int, ...]) -> tuple[Index, Index]:
    """The coordinates that are kept and those that are eliminated, as ``loops`` takes them."""
    dropped = [dof for dof in range(dofs) if dof not in active]
    return np.array(active, dtype=np.int64), np.array(dropped, dtype=np.int64)


@lru_cache(maxsize=256)
def _positions(active: tuple[int, ...], dofs: tuple[int, ...]) -> Index:
    return np.array([active.index(dof) for dof in dofs], dtype=np.int64)
