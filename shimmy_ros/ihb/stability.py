"""Floquet multipliers of a limit cycle, with the jump at every reversal of a Coulomb element.

The system is odd, so that the half-period map decides: its multipliers rho are the eigenvalues of
minus the monodromy matrix of half a period, those of the period are rho^2, and rho = 1 belongs to
a shift in time. Between reversals the variational equation is smooth; at a reversal of velocity
v_i the Coulomb force jumps by 2T, and perturbations are multiplied by the saltation matrix
I + (f+ - f-) n^T / (n^T f-), with n^T f- the acceleration of v_i before the reversal. The loops
are in ``variation``.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, NamedTuple, cast

import numpy as np
from numpy.typing import NDArray

from . import variation
from .elements import OddElement
from .harmonics import Complex, Real
from .loops import Index, with_replacement
from .solution import LimitCycle
from .system import System

FEWEST_STEPS = 20
TOLERANCE = 1e-4
_MOST_STEPS = 20_000
# A step's error matters less than the map's, of which the better half of the steps is taken.
_FIRST_DEMAND, _LAST_DEMAND = 1000.0, 1e-4
_STABLE_MARGIN = 1e-9
# A cycle whose shift in time is multiplied by less or more is not one of the equations.
_LARGEST_SHIFT_ERROR = 0.1
# Beside the shift's, a multiplier below this need not be known relative to itself.
_NEGLIGIBLE = 0.1
# The error of other multipliers, in that of the largest.
_OTHERS = 3.0
_SMALLEST_SIZE = 1e-6
_GROWTH_SAMPLES = 64


class StickingError(ArithmeticError):
    """The cycle asks the friction to stick where the balance assumes it to reverse."""


@dataclass(frozen=True)
class Stability:
    """Multipliers of the half-period map without the one of a shift in time, largest first.

    ``multipliers`` has shape (2n - 1,), complex, and is NaN where the map overflows.
    ``shift_error`` is how far the left-out one is from 1: the accuracy that the rest can have.
    ``reliable`` tells whether the integration has settled, and the shift's multiplier is near 1.
    """

    multipliers: Complex
    shift_error: float
    reliable: bool

    @property
    def stable(self) -> bool:
        """Whether every perturbation is known to die: never where the result is not reliable."""
        return self.reliable and self._largest < 1.0 - _STABLE_MARGIN

    @property
    def full_period(self) -> Complex:
        """The multipliers of the full period, shape (2n - 1,)."""
        return np.asarray(self.multipliers**2)

    @property
    def _largest(self) -> float:
        return float(np.max(np.abs(self.multipliers), initial=0.0))


class HalfPeriod(NamedTuple):
    """The map over half a period in two approximations (2, 2n, 2n), the better one first.

    ``complete`` tells whether the integration reaches the end.
    """

    maps: Real
    complete: bool


def stability(system: System, cycle: LimitCycle, steps: int = FEWEST_STEPS,
              tolerance: float = TOLERANCE) -> Stability:
    """Floquet multipliers of ``cycle``, settled to ``tolerance``.

    Half a period is integrated in no fewer than ``steps`` steps, and in more where it takes them.
    The largest multiplier has settled when one integration and another, of half as many steps,
    agree in it to ``tolerance``, relative to itself or to 0.1, and to thrice that in the others,
    that of the shift included.

    Raises StickingError where a Coulomb element cannot reverse as the cycle assumes, because the
    accelerations on both sides of the reversal point towards rest, and ValueError for an element
    of another kind than those of ``elements``, for friction on a coordinate at rest, and for a
    system that cannot be, as solve_cold.
    """
    system.check()
    integrate = _integration(system, cycle, steps, True)
    demand = _FIRST_DEMAND * tolerance
    while True:
        half = integrate(demand)
        if not half.complete:
            unknown = np.full(2 * system.dofs - 1, np.nan, dtype=np.complex128)
            return Stability(unknown, float("inf"), False)
        values = np.linalg.eigvals(-half.maps)
        fine, coarse = _without_shift(values[0]), _without_shift(values[1])
        sizes = np.abs(fine)
        apart = np.abs(np.abs(coarse) - sizes)
        allowed = tolerance * max(sizes.item(0), _NEGLIGIBLE)
        shift_error, other = np.abs(values - 1.0).min(axis=1).tolist()
        settled = (apart.item(0) <= allowed and apart.max().item() <= _OTHERS * allowed
                   and abs(other - shift_error) <= _OTHERS * tolerance)
        if settled or demand <= _LAST_DEMAND * tolerance:
            return Stability(fine, shift_error, settled and shift_error <= _LARGEST_SHIFT_ERROR)
        demand *= 0.1


def _without_shift(values: NDArray[Any]) -> Complex:
    """The multipliers, largest first, without the one nearest to 1."""
    order = np.abs(values).argsort()[::-1]
    rest: Complex = values[order[order != np.abs(values - 1.0).argmin()]]
    return rest.astype(np.complex128, copy=False)


def half_period_map(system: System, cycle: LimitCycle, steps: int = FEWEST_STEPS,
                    tolerance: float = TOLERANCE) -> Real:
    """The monodromy matrix of half a period, shape (2n, 2n), of (q, dq/dt) from tau = 0.

    ``tolerance`` bounds the error of each step, relative to the largest entry of the map of
    (q, dq/dtau) in units of the coordinates' amplitudes. Raises as stability does.
    """
    half = _integration(system, cycle, steps, False)(tolerance)
    sizes = _sizes(cycle)
    units = np.concatenate([sizes, cycle.frequency * sizes])
    return np.asarray(units[:, None] * half.maps[0] / units)


def _integration(system: System, cycle: LimitCycle, steps: int, from_kink: bool
                 ) -> Callable[[float], HalfPeriod]:
    """The integration over half a period as a function of the tolerance of a step."""
    forms, dofs = system.closed_forms, system.dofs
    torques = np.bincount(forms.coulomb, forms.torques, dofs) if forms.coulomb else np.zeros(dofs)
    coefficients = (np.bincount(forms.quadratic, forms.coefficients, dofs) if forms.quadratic
                    else np.zeros(dofs))
    sizes = _sizes(cycle)
    general = system.general_elements
    solve: Callable[..., tuple[Real, int, int]] = variation.half_map
    varying = sorted({*forms.quadratic, *(dof for element in general for dof in element.dofs)})
    growth = 0.0
    if general:
        growth = _growth(system, cycle)
        solve = _with_general(system, cycle, varying, sizes)
    arguments = (system.inverse_mass, system.damping, system.stiffness, torques,
                 coefficients, np.array(varying, dtype=np.int64),
                 np.ascontiguousarray(cycle.coefficients), cycle.frequency, sizes, 0.0,
                 from_kink, bool(general), growth, steps, max(_MOST_STEPS, 8 * steps))

    def integrate(tolerance: float) -> HalfPeriod:
        maps, dof, ending = solve(*arguments, tolerance)
        if ending == variation.AT_REST:
            raise ValueError("the zeros of a sum that vanishes or is not finite are not defined")
        if ending == variation.STICKING:
            raise StickingError(
                f"the friction on coordinate {dof} sticks where the cycle reverses it")
        return HalfPeriod(maps, ending == variation.COMPLETE)

    return integrate


def _sizes(cycle: LimitCycle) -> Real:
    sizes = np.sqrt((cycle.coefficients**2).sum(axis=1))
    return np.asarray(np.maximum(sizes, _SMALLEST_SIZE * sizes.max()))


def _growth(system: System, cycle: LimitCycle) -> float:
    """The quickest growth of a coordinate alone that general elements make [1/rad of tau]."""
    time = np.linspace(0.0, 0.5 * cycle.period, _GROWTH_SAMPLES, endpoint=False)
    place, velocity = cycle.position(time), cycle.velocity(time)
    rates = np.broadcast_to(system.inverse_mass @ system.damping,
                            (time.size, system.dofs, system.dofs)).copy()
    for element, dofs in _odd_elements(system):
        block = np.moveaxis(element.damping(place[dofs], velocity[dofs]), -1, 0)
        rates[:, :, dofs] += system.inverse_mass[:, dofs] @ block
    return float(-np.diagonal(rates, axis1=1, axis2=2).min() / cycle.frequency)


def _odd_elements(system: System) -> list[tuple[OddElement, list[int]]]:
    """The general elements with their coordinates. Raises ValueError for one of another kind."""
    elements: list[tuple[OddElement, list[int]]] = []
    for element in system.general_elements:
        if not isinstance(element, OddElement):
            raise ValueError(f"an element is {type(element).__name__}, but stability knows "
                             "Coulomb, QuadraticDamping and OddElement only")
        elements.append((element, list(element.dofs)))
    return elements


def _with_general(system: System, cycle: LimitCycle, varying: list[int], sizes: Real
                  ) -> Callable[..., tuple[Real, int, int]]:
    """variation.half_map, not compiled, with the elements added that cannot be."""
    elements = _odd_elements(system)
    ratio = sizes[varying] / sizes[varying][:, None]

    def state(tau: float, dofs: list[int]) -> tuple[Real, Real]:
        time = np.array([tau / cycle.frequency])
        return cycle.position(time)[dofs], cycle.velocity(time)[dofs]

    def sample(coefficients: Real, chosen: Index, rate: Complex, tau: float, damping: Real,
               stiffness: Real) -> None:
        variation.sample(coefficients, chosen, rate, tau, damping, stiffness)
        for element, dofs in elements:
            place, velocity = state(tau, dofs)
            block = np.ix_(*2 * [[varying.index(dof) for dof in dofs]])
            stiffness[block] += ratio[block] * element.stiffness(place, velocity)[..., 0]
            damping[block] += ratio[block] * cycle.frequency * element.damping(
                place, velocity)[..., 0]

    def general_forces(tau: float, forces: Real) -> None:
        for element, dofs in elements:
            forces[dofs] += element.force(*state(tau, dofs))[:, 0]

    replaced = with_replacement(variation.half_map, sample=sample, general_forces=general_forces)

    def solve(*arguments: Any) -> tuple[Real, int, int]:
        # What overflows is found out, as in the compiled loops.
        with np.errstate(all="ignore"):
            return cast(tuple[Real, int, int], replaced(*arguments))

    return solve
