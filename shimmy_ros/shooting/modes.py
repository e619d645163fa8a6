"""The modes of motion of a system with Coulomb friction: which coordinates slip, which way.

The equation is M q'' + C q' + K q + sum_i (T_i sgn(q'_i) + D_i |q'_i| q'_i) e_i = 0 with the
set-valued sgn(0) = [-1, 1]. Coordinates with friction or velocity-squared damping are called
active. A mode gives each of them a sign: +1 or -1 while it slips that way, 0 while it sticks.
Within a mode the equation is smooth: affine in the state x = (q, q') and in the squares of the
active velocities.
"""

from __future__ import annotations

import itertools
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from ..ihb.elements import Coulomb, QuadraticDamping
from ..ihb.system import System

Real = NDArray[np.float64]
Signs = tuple[int, ...]


@dataclass(frozen=True)
class Model:
    """The matrices (n, n) of a system, and of its m active coordinates indices and strengths.

    ``friction`` T and ``drag`` D have shape (m,). Raises ValueError for friction that is negative
    and for a mass that friction cannot hold: the part of its inverse that belongs to the active
    coordinates has to have positive principal minors, which makes the mode at rest unique.
    """

    mass: Real
    damping: Real
    stiffness: Real
    active: tuple[int, ...]
    friction: Real
    drag: Real

    def __post_init__(self) -> None:
        for dof, torque in zip(self.active, self.friction, strict=True):
            if not torque >= 0.0:
                raise ValueError(f"the Coulomb torque on coordinate {dof} is {torque:g}, but must "
                                 "not be negative")
        for size in range(1, len(self.active) + 1):
            for chosen in itertools.combinations(self.active, size):
                if not np.linalg.det(self.mobility[np.ix_(chosen, chosen)]) > 0.0:
                    raise ValueError(f"the inverse mass of the coordinates {chosen} has to be "
                                     "positive definite, but is not")

    @property
    def dofs(self) -> int:
        """The number n of degrees of freedom."""
        return len(self.mass)

    @cached_property
    def mobility(self) -> Real:
        """The inverse of the mass matrix, shape (n, n)."""
        return np.asarray(np.linalg.inv(self.mass), dtype=np.float64)

    @cached_property
    def modes(self) -> dict[Signs, Mode]:
        """The modes asked for so far, which `mode_of` keeps here."""
        return {}

    @property
    def frictional(self) -> tuple[int, ...]:
        """The positions within ``active`` of the coordinates that can stick."""
        return tuple(int(item) for item in np.flatnonzero(self.friction > 0.0))


@dataclass(frozen=True)
class Mode:
    """x' = matrix.T @ (x, w) + constant, with w_i = sign_i (q'_i)^2 of the active coordinates.

    ``matrix`` has shape (2n + m, 2n), ``constant`` (2n,). The force that friction has to apply
    to each active coordinate that sticks (columns of zeros for the others) is
    hold.T @ (x, w) + hold_constant, shapes (2n + m, m) and (m,).
    """

    signs: Signs
    matrix: Real
    constant: Real
    hold: Real
    hold_constant: Real


def model_of(system: System) -> Model:
    """The same system for shooting. Raises ValueError for elements other than friction and drag."""
    friction: dict[int, float] = {}
    drag: dict[int, float] = {}
    for element in system.elements:
        if isinstance(element, Coulomb):
            friction[element.dof] = friction.get(element.dof, 0.0) + element.torque
        elif isinstance(element, QuadraticDamping):
            drag[element.dof] = drag.get(element.dof, 0.0) + element.coefficient
        else:
            raise ValueError(f"an element is {type(element).__name__}, but shooting knows Coulomb "
                             "and QuadraticDamping only")
    active = tuple(sorted({*friction, *drag}))
    return Model(system.mass, system.damping, system.stiffness, active,
                 np.array([friction.get(dof, 0.0) for dof in active]),
                 np.array([drag.get(dof, 0.0) for dof in active]))


def mode_of(model: Model, signs: Signs) -> Mode:
    """The smooth equation of motion of ``model`` in the mode ``signs``, of length m."""
    if signs not in model.modes:
        model.modes[signs] = _mode(model, signs)
    return model.modes[signs]


def _mode(model: Model, signs: Signs) -> Mode:
    dofs, count = model.dofs, len(model.active)
    direction = np.array(signs, dtype=np.float64)
    sticking = [dof for dof, sign in zip(model.active, signs, strict=True) if sign == 0]
    # Force on every coordinate apart from what holds those that stick.
    force = np.zeros((dofs, 2 * dofs + count))
    force[:, :dofs], force[:, dofs:2 * dofs] = -model.stiffness, -model.damping
    force[model.active, 2 * dofs + np.arange(count)] = -model.drag
    fixed = np.zeros(dofs)
    fixed[list(model.active)] = -model.friction * direction
    mobility = model.mobility
    needed = np.zeros((count, dofs))
    if sticking:
        solved = np.linalg.solve(mobility[np.ix_(sticking, sticking)], mobility[sticking])
        mobility = mobility - mobility[:, sticking] @ solved
        mobility[sticking] = 0.0
        needed[[sign == 0 for sign in signs]] = solved
    matrix = np.zeros((2 * dofs + count, 2 * dofs))
    matrix[dofs:2 * dofs, :dofs] = np.eye(dofs)
    matrix[:, dofs:] = (mobility @ force).T
    constant = np.concatenate([np.zeros(dofs), mobility @ fixed])
    return Mode(signs, matrix, constant, (needed @ force).T, needed @ fixed)


def extended(model: Model, signs: Signs, state: Real) -> Real:
    """The vector (x, w) that a mode's matrices multiply, shape (2n + m,)."""
    speed = state[model.dofs + np.array(model.active, dtype=int)]
    return np.concatenate([state, np.array(signs, dtype=np.float64) * speed**2])


def derivative(model: Model, mode: Mode, state: Real) -> Real:
    """x' at ``state`` (2n,) in ``mode``, shape (2n,)."""
    return extended(model, mode.signs, state) @ mode.matrix + mode.constant


def signs_at(model: Model, state: Real, before: Signs | None = None) -> Signs:
    """The mode into which ``state`` (2n,) moves.

    An active coordinate slips in the direction of its velocity. Those without velocity stick
    wherever friction suffices to hold them, and else set off against it; of all their
    combinations the one is chosen that obeys the law. Without friction and without acceleration
    either sign is right: the one ``before`` is kept.
    """
    speed = state[model.dofs + np.array(model.active, dtype=int)]
    choices: list[tuple[int, ...]] = []
    for index, value in enumerate(speed):
        if value != 0.0:
            choices.append((1 if value > 0.0 else -1,))
        else:
            last = before[index] if before is not None and before[index] != 0 else 1
            can_stick = model.friction[index] > 0.0
            choices.append((0, last, -last) if can_stick else (last, -last))
    candidates = list(itertools.product(*choices))
    if len(candidates) == 1:
        return candidates[0]
    return min(candidates, key=lambda signs: _violation(model, signs, state))


def _violation(model: Model, signs: Signs, state: Real) -> float:
    """By how much, as a share of the friction, ``signs`` breaks the law at zero velocities."""
    mode = mode_of(model, signs)
    rates = derivative(model, mode, state)
    holding = extended(model, signs, state) @ mode.hold + mode.hold_constant
    worst = 0.0
    for index, (dof, sign) in enumerate(zip(model.active, signs, strict=True)):
        if sign == 0:
            excess = abs(holding[index]) / model.friction[index] - 1.0
        elif state[model.dofs + dof] == 0.0:
            scale = max(model.friction[index], abs(holding[index]))
            against = -sign * rates[model.dofs + dof] / model.mobility[dof, dof]
            excess = against / scale if scale > 0.0 else against
        else:
            continue
        worst = max(worst, float(excess))
    return worst
