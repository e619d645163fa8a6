"""An odd autonomous system M q'' + C q' + K q + elements(q, q') = 0, and families of them."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property, lru_cache
from typing import NamedTuple

import numpy as np

from .elements import Coulomb, Element, QuadraticDamping
from .harmonics import Real

_LARGEST_CONDITION = 1.0 / np.finfo(np.float64).eps


class ClosedForms(NamedTuple):
    """Coordinates and strengths of the elements that have closed forms."""

    coulomb: tuple[int, ...]
    torques: Real
    quadratic: tuple[int, ...]
    coefficients: Real


@dataclass(frozen=True)
class System:
    """One system: matrices of shape (n, n) in any consistent units, and non-linear elements.

    The same type holds the derivative of a system by a parameter, since the balance is linear in
    the matrices and in what an element's strength multiplies: ``check`` refuses what is fit for a
    derivative only.

    Raises ValueError for matrices that do not fit together and elements on missing coordinates.
    """

    mass: Real
    damping: Real
    stiffness: Real
    elements: tuple[Element, ...] = ()

    def __post_init__(self) -> None:
        for name in ("mass", "damping", "stiffness"):
            matrix = np.array(getattr(self, name), dtype=np.float64)
            if matrix.ndim != 2 or matrix.shape[0] != matrix.shape[1]:
                raise ValueError(f"{name} has shape {matrix.shape}, but must be square")
            if matrix.shape[0] != len(self.mass):
                raise ValueError(f"{name} has shape {matrix.shape}, but mass has {len(self.mass)} "
                                 "rows")
            matrix.setflags(write=False)
            object.__setattr__(self, name, matrix)
        acted_on = self.nonlinear_dofs
        if acted_on and not 0 <= acted_on[0] <= acted_on[-1] < self.dofs:
            raise ValueError(f"elements act on the coordinates {acted_on}, but must on some of "
                             f"0..{self.dofs - 1}")

    @property
    def dofs(self) -> int:
        """The number n of degrees of freedom."""
        return len(self.mass)

    @property
    def closed_forms(self) -> ClosedForms:
        """The Coulomb and velocity-squared elements as arrays."""
        return self._kinds.closed

    @property
    def general_elements(self) -> tuple[Element, ...]:
        """The elements without a closed form."""
        return self._kinds.general

    @property
    def nonlinear_dofs(self) -> tuple[int, ...]:
        """The coordinates on which an element acts, ascending."""
        return self._kinds.dofs

    def check(self) -> None:
        """Raises ValueError for a singular mass matrix, and for elements of negative strength."""
        _inverse_before(self.mass.tobytes(), self.dofs)
        if self._kinds.fault is not None:
            raise ValueError(self._kinds.fault)

    @cached_property
    def inverse_mass(self) -> Real:
        """The mass matrix's inverse, shape (n, n). Raises ValueError for a singular one."""
        return _inverse_before(self.mass.tobytes(), self.dofs)

    @cached_property
    def _kinds(self) -> _Kinds:
        try:
            return _sorted_before(self.elements)
        except TypeError:  # an element that has no hash
            return _sorted(self.elements)


class _Kinds(NamedTuple):
    closed: ClosedForms
    general: tuple[Element, ...]
    dofs: tuple[int, ...]
    fault: str | None


def _sorted(elements: tuple[Element, ...]) -> _Kinds:
    coulomb = [e for e in elements if isinstance(e, Coulomb)]
    quadratic = [e for e in elements if isinstance(e, QuadraticDamping)]
    closed = ClosedForms(
        tuple(e.dof for e in coulomb), np.array([e.torque for e in coulomb], dtype=np.float64),
        tuple(e.dof for e in quadratic),
        np.array([e.coefficient for e in quadratic], dtype=np.float64))
    return _Kinds(
        closed, tuple(e for e in elements if not isinstance(e, (Coulomb, QuadraticDamping))),
        tuple(sorted({dof for element in elements for dof in element.dofs})),
        next((e.fault for e in elements if isinstance(e, (Coulomb, QuadraticDamping)) and e.fault),
             None))


# Systems that follow each other mostly have the same elements.
_sorted_before = lru_cache(maxsize=256)(_sorted)


def _inverse(mass: bytes, count: int) -> Real:
    matrix = np.frombuffer(mass).reshape(count, count)
    # Whatever the units of rows and columns.
    with np.errstate(all="ignore"):
        rows = np.abs(matrix).max(axis=1)[:, None]
        columns = np.abs(matrix / rows).max(axis=0)
        even = matrix / rows / columns
        regular = np.all(np.isfinite(even)) and np.linalg.cond(even) < _LARGEST_CONDITION
        inverse = np.asarray(np.linalg.inv(even) / columns[:, None] / rows[:, 0] if regular
                             else np.full(matrix.shape, np.nan))
    if not np.all(np.isfinite(inverse)):
        raise ValueError("mass is singular to rounding, but every coordinate and every combination "
                         "of coordinates must have inertia")
    inverse.setflags(write=False)
    return inverse


# The mass is mostly that of the system before.
_inverse_before = lru_cache(maxsize=64)(_inverse)


@dataclass(frozen=True)
class Family:
    """Systems along one parameter lambda: the system at a value, and its derivative there.

    ``derivative`` returns the matrices' derivatives and elements whose force is the derivative of
    the force by lambda.
    """

    system: Callable[[float], System]
    derivative: Callable[[float], System]
