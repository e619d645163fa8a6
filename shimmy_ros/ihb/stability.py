"""Floquet multipliers of a limit cycle, with the jump at every reversal of a Coulomb element.

The system is odd, so that the half-period map decides: its multipliers rho are the eigenvalues of
minus the monodromy matrix of half a period, those of the period are rho^2, and rho = 1 belongs to
a shift in time. Between reversals the variational equation is smooth; at a reversal of velocity
v_i the Coulomb force jumps by 2T, and perturbations are multiplied by the saltation matrix
I + (f+ - f-) n^T / (n^T f-), with n^T f- the acceleration of v_i before the reversal.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from . import loops
from .elements import Coulomb, OddElement, QuadraticDamping
from .harmonics import Complex, Real, evaluate, velocity_zeros
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
    accelerations on both sides of the reversal point towards rest, and ValueError for an element
    of another kind than those of ``elements``.
    """
    values = np.linalg.eigvals(-half_period_map(system, cycle, steps))
    shift = int(np.argmin(np.abs(values - 1.0)))
    rest = np.delete(values, shift)
    order = np.argsort(-np.abs(rest))
    return Stability(rest[order].astype(np.complex128), float(abs(values[shift] - 1.0)))


def half_period_map(system: System, cycle: LimitCycle, steps: int = _DEFAULT_STEPS) -> Real:
    """The monodromy matrix of half a period, shape (2n, 2n), of (q, dq/dt)."""
    torques: dict[int, float] = {}
    for element in system.elements:
        if isinstance(element, (Coulomb, QuadraticDamping)):
            torque = element.torque if isinstance(element, Coulomb) else 0.0
            torques[element.dof] = torques.get(element.dof, 0.0) + torque
    reversals: dict[float, list[int]] = {}
    kinks = {0.0, np.pi}
    for dof, torque in torques.items():
        for zero in velocity_zeros(cycle.coefficients[dof]).tolist():
            kinks.add(zero)
            if torque != 0.0:
                reversals.setdefault(zero, []).append(dof)
    bounds = np.array(sorted(kinks))
    counts = np.ceil(steps * np.diff(bounds) / np.pi).astype(np.int64)
    widths = np.repeat(np.diff(bounds) / counts, counts)
    ends = np.cumsum(counts)
    numbers = np.arange(len(widths)) - np.repeat(ends - counts, counts)
    middles = np.repeat(bounds[:-1], counts) + (numbers + 0.5) * widths
    nodes = middles[:, None] + _GAUSS * np.outer(widths, (-1.0, 1.0))
    rates = _rates(system, cycle, nodes.ravel()).reshape(
        *nodes.shape, 2 * system.dofs, 2 * system.dofs)
    monodromy = np.eye(2 * system.dofs)
    for start, count, end in zip(bounds.tolist(), counts, ends, strict=False):
        for dof in reversals.get(start, []):
            monodromy = _saltation(system, cycle, dof, torques[dof], start) @ monodromy
        piece = slice(end - count, end)
        loops.propagate(rates[piece], widths[piece] / cycle.frequency, monodromy)
    return monodromy


def _rates(system: System, cycle: LimitCycle, tau: Real) -> NDArray[np.float64]:
    """The variational equation's matrix at every tau, shape (P, 2n, 2n)."""
    count = system.dofs
    inverse = np.linalg.inv(system.mass)
    matrix = np.zeros((tau.size, 2 * count, 2 * count))
    matrix[:, :count, count:] = np.eye(count)
    matrix[:, count:, :count] = -inverse @ system.stiffness
    matrix[:, count:, count:] = -inverse @ system.damping
    for element in system.elements:
        dofs = list(element.dofs)
        if isinstance(element, QuadraticDamping):
            speed = np.abs(cycle.frequency * evaluate(cycle.coefficients[element.dof], tau, 1))
            matrix[:, count:, count + element.dof] -= (
                2.0 * element.coefficient * np.outer(speed, inverse[:, element.dof]))
        elif isinstance(element, OddElement):
            time = tau / cycle.frequency
            place, velocity = cycle.position(time)[dofs], cycle.velocity(time)[dofs]
            for first, part in ((0, element.stiffness), (count, element.damping)):
                block = np.moveaxis(part(place, velocity), -1, 0)
                matrix[:, count:, [first + dof for dof in dofs]] -= inverse[:, dofs] @ block
        elif not isinstance(element, Coulomb):
            raise ValueError(f"an element is {type(element).__name__}, but stability knows "
                             "Coulomb, QuadraticDamping and OddElement only")
    return matrix


def _saltation(system: System, cycle: LimitCycle, dof: int, torque: float, tau: float) -> Real:
    """The saltation matrix of a reversal of coordinate ``dof`` with friction ``torque``.

    From the equations of motion at the cycle's state.
    """
    count = system.dofs
    time = np.array([tau / cycle.frequency])
    place, velocity = cycle.position(time)[:, 0], cycle.velocity(time)[:, 0]
    # Whether the velocity falls or rises through zero, from the series itself.
    before = np.sign(cycle.velocity(time - 1e-6 * cycle.period)[dof, 0])
    force = -system.damping @ velocity - system.stiffness @ place
    for other in system.elements:
        dofs = list(other.dofs)
        if isinstance(other, Coulomb):
            if other.dof == dof:
                continue
            force[other.dof] -= other.torque * np.sign(velocity[other.dof])
        elif isinstance(other, QuadraticDamping):
            speed = velocity[other.dof]
            force[other.dof] -= other.coefficient * abs(speed) * speed
        elif isinstance(other, OddElement):
            force[dofs] -= other.force(place[dofs, None], velocity[dofs, None])[:, 0]
    direction = np.zeros(count)
    direction[dof] = torque
    jump = np.linalg.solve(system.mass, direction)
    free = np.linalg.solve(system.mass, force)
    incoming = (free - before * jump)[dof]
    outgoing = (free + before * jump)[dof]
    if incoming * before >= 0.0 or outgoing * before >= 0.0:
        raise StickingError(
            f"the friction on coordinate {dof} sticks where the cycle reverses it")
    result = np.eye(2 * count)
    result[count:, count + dof] += 2.0 * before * jump / incoming
    return result
