"""An odd autonomous system M q'' + C q' + K q + elements(q, q') = 0, and families of them."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property, lru_cache
from typing import NamedTuple

import numpy as np

from .elements import Coulomb, Element, QuadraticDamping
from .harmonics import Real


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
    the matrices and in what an element's strength multiplies.

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


def _sorted(elements: tuple[Element, ...]) -> _Kinds:
    coulomb = [e for e in elements if isinstance(e, Coulomb)]
    quadratic = [e for e in elements if isinstance(e, QuadraticDamping)]
    closed = ClosedForms(
        tuple(e.dof for e in coulomb), np.array([e.torque for e in coulomb], dtype=np.float64),
        tuple(e.dof for e in quadratic),
        np.array([e.coefficient for e in quadratic], dtype=np.float64))
    return _Kinds(
        closed, tuple(e for e in elements if not isinstance(e, (Coulomb, QuadraticDamping))),
        tuple(sorted({dof for element in elements for dof in element.dofs})))


# Systems that follow each other mostly have the same elements.
_sorted_before = lru_cache(maxsize=256)(_sorted)


@dataclass(frozen=True)
class Family:
    """Systems along one parameter lambda: the system at a value, and its derivative there.

    ``derivative`` returns the matrices' derivatives and elements whose force is the derivative of
    the force by lambda.
    """

    system: Callable[[float], System]
    derivative: Callable[[float], System]
