"""Floquet multipliers of a limit cycle, with the jump at every reversal of a Coulomb element.

The system is odd, so that the half-period map decides: its multipliers rho are the eigenvalues of
minus the monodromy matrix of half a period, those of the period are rho^2, and rho = 1 belongs to
a shift in time. Between reversals the variational equation is smooth; at a reversal of velocity
v_i the Coulomb force jumps by 2T, and perturbations are multiplied by the saltation matrix
I + (f+ - f-) n^T / (n^T f-), with n^T f- the acceleration of v_i before the reversal.
"""

from __future__ import annotations

import itertools
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from .elements import Coulomb, OddElement, QuadraticDamping
from .harmonics import Complex, Real, velocity_zeros
from .solution import LimitCycle
from .system import System

_DEFAULT_STEPS = 160
_GAUSS = 0.5 / np.sqrt(3.0)
_STABLE_MARGIN = 1e-9


class StickingError(ArithmeticError):
    """The cycle asks the friction to stick where the balance assumes it to reverse."""


@dataclass(frozen=True)
class Stability:
    """Multipliers of the half-period map without the one of a shift in time, largest first.

    ``multipliers`` has shape (2n - 1,), complex; those of the full period are their squares.
    ``shift_error`` is how far the left-out one is from 1: the accuracy that the rest can have.
    """

    multipliers: Complex
    shift_error: float

    @property
    def stable(self) -> bool:
        """Whether every perturbation dies."""
        return bool(np.max(np.abs(self.multipliers), initial=0.0) < 1.0 - _STABLE_MARGIN)

    @property
    def full_period(self) -> Complex:
        """The multipliers of the full period, shape (2n - 1,)."""
        return np.asarray(self.multipliers**2)


def stability(system: System, cycle: LimitCycle, steps: int = _DEFAULT_STEPS) -> Stability:
    """Floquet multipliers of ``cycle``, by Magnus steps of order four, ``steps`` in half a period.

    Raises StickingError where a Coulomb element cannot reverse as the cycle assumes, because the
    accelerations on both sides of the reversal point towards rest.
    """
    values = np.linalg.eigvals(-half_period_map(system, cycle, steps))
    shift = int(np.argmin(np.abs(values - 1.0)))
    rest = np.delete(values, shift)
    order = np.argsort(-np.abs(rest))
    return Stability(rest[order].astype(np.complex128), float(abs(values[shift] - 1.0)))


def half_period_map(system: System, cycle: LimitCycle, steps: int = _DEFAULT_STEPS) -> Real:
    """The monodromy matrix of half a period, shape (2n, 2n), of (q, dq/dt)."""
    reversals: dict[float, list[Coulomb]] = {}
    kinks = {0.0, np.pi}
    for element in system.elements:
        if isinstance(element, (Coulomb, QuadraticDamping)):
            for zero in velocity_zeros(cycle.coefficients[element.dof]).tolist():
                kinks.add(zero)
                if isinstance(element, Coulomb) and element.torque > 0.0:
                    reversals.setdefault(zero, []).append(element)
    bounds = sorted(kinks)
    monodromy = np.eye(2 * system.dofs)
    for start, end in itertools.pairwise(bounds):
        for element in reversals.get(start, []):
            monodromy = _saltation(system, cycle, element, start) @ monodromy
        count = max(1, int(np.ceil(steps * (end - start) / np.pi)))
        for factor in _propagators(system, cycle, np.linspace(start, end, count + 1)):
            monodromy = factor @ monodromy
    return monodromy


def _propagators(system: System, cycle: LimitCycle, tau: Real) -> NDArray[np.float64]:
    """exp of the fourth-order Magnus exponent of every step, shape (steps, 2n, 2n).

    By its (2, 3) Padé approximant, of order five, which damps what is too fast to be resolved.
    """
    width = (tau[1] - tau[0]) / cycle.frequency
    middle = 0.5 * (tau[:-1] + tau[1:])
    half = tau[1] - tau[0]
    first = _rates(system, cycle, middle - _GAUSS * half)
    second = _rates(system, cycle, middle + _GAUSS * half)
    exponent = 0.5 * width * (first + second)
    exponent += (np.sqrt(3.0) / 12.0) * width**2 * (second @ first - first @ second)
    square = exponent @ exponent
    identity = np.eye(exponent.shape[1])
    upper = identity + 0.4 * exponent + 0.05 * square
    lower = identity - 0.6 * exponent + 0.15 * square - square @ exponent / 60.0
    return np.asarray(np.linalg.solve(lower, upper))


def _rates(system: System, cycle: LimitCycle, tau: Real) -> NDArray[np.float64]:
    """The variational equation's matrix at every tau, shape (P, 2n, 2n)."""
    count = system.dofs
    time = tau / cycle.frequency
    place, velocity = cycle.position(time), cycle.velocity(time)
    damping = np.broadcast_to(system.damping, (tau.size, count, count)).copy()
    stiffness = np.broadcast_to(system.stiffness, (tau.size, count, count)).copy()
    for element in system.elements:
        dofs = list(element.dofs)
        if isinstance(element, QuadraticDamping):
            damping[:, element.dof, element.dof] += (
                2.0 * element.coefficient * np.abs(velocity[element.dof]))
        elif isinstance(element, OddElement):
            block = np.ix_(range(tau.size), dofs, dofs)
            damping[block] += np.moveaxis(element.damping(place[dofs], velocity[dofs]), -1, 0)
            stiffness[block] += np.moveaxis(element.stiffness(place[dofs], velocity[dofs]), -1, 0)
    matrix = np.zeros((tau.size, 2 * count, 2 * count))
    matrix[:, :count, count:] = np.eye(count)
    matrix[:, count:, :count] = -np.linalg.solve(system.mass, stiffness)
    matrix[:, count:, count:] = -np.linalg.solve(system.mass, damping)
    return matrix


def _saltation(system: System, cycle: LimitCycle, element: Coulomb, tau: float) -> Real:
    """The saltation matrix of one reversal, from the equations of motion at the cycle's state."""
    count = system.dofs
    time = np.array([tau / cycle.frequency])
    place, velocity = cycle.position(time)[:, 0], cycle.velocity(time)[:, 0]
    # Whether the velocity falls or rises through zero, from the series itself.
    before = np.sign(cycle.velocity(time - 1e-6 * cycle.period)[element.dof, 0])
    force = -system.damping @ velocity - system.stiffness @ place
    for other in system.elements:
        if other is element:
            continue
        dofs = list(other.dofs)
        if isinstance(other, Coulomb):
            force[other.dof] -= other.torque * np.sign(velocity[other.dof])
        elif isinstance(other, QuadraticDamping):
            speed = velocity[other.dof]
            force[other.dof] -= other.coefficient * abs(speed) * speed
        elif isinstance(other, OddElement):
            force[dofs] -= other.force(place[dofs, None], velocity[dofs, None])[:, 0]
    direction = np.zeros(count)
    direction[element.dof] = element.torque
    jump = np.linalg.solve(system.mass, direction)
    free = np.linalg.solve(system.mass, force)
    incoming = (free - before * jump)[element.dof]
    outgoing = (free + before * jump)[element.dof]
    if incoming * before >= 0.0 or outgoing * before >= 0.0:
        raise StickingError(
            f"the friction on coordinate {element.dof} sticks where the cycle reverses it")
    result = np.eye(2 * count)
    result[count:, count + element.dof] += 2.0 * before * jump / incoming
    return result
