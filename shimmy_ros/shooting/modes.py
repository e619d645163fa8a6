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
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..compiling import compiled
from ..ihb.elements import Coulomb, QuadraticDamping
from ..ihb.system import System

Real = NDArray[np.float64]
Signs = NDArray[np.int64]

MOST_ACTIVE = 8


class Modes(NamedTuple):
    """The 3^m modes of n coordinates, m of them active, as far as they were needed so far.

    A mode's number has its signs plus one as digits to base 3, the last one lowest. In a mode
    q'' = matrix (x, w) + constant, with w_i = sign_i (q'_i)^2 of the active coordinates, and
    hold (x, w) + hold_constant is the force that friction has to apply to each active coordinate
    that sticks, zero for the others. ``force`` (n, 2n + m) is that on each coordinate without
    friction, ``mobility`` (n, n) the inverse mass, ``velocities`` (m,) are the active ones' places
    in x, and ``known`` (3^m,) tells which modes are filled in.
    """

    matrix: Real
    constant: Real
    hold: Real
    hold_constant: Real
    known: NDArray[np.bool_]
    mobility: Real
    force: Real
    friction: Real
    drag: Real
    velocities: NDArray[np.int64]


@dataclass(frozen=True)
class Model:
    """The matrices (n, n) of a system, and of its m active coordinates indices and strengths.

    ``friction`` T and ``drag`` D have shape (m,). Raises ValueError for friction that is negative,
    for more than MOST_ACTIVE active coordinates, and for a mass that friction cannot hold: the part
    of its inverse that belongs to the active coordinates has to have positive principal minors,
    which makes the mode at rest unique.
    """

    mass: Real
    damping: Real
    stiffness: Real
    active: tuple[int, ...]
    friction: Real
    drag: Real

    def __post_init__(self) -> None:
        if len(self.active) > MOST_ACTIVE:
            raise ValueError(f"{len(self.active)} coordinates have friction or velocity-squared "
                             f"damping, but shooting takes at most {MOST_ACTIVE}")
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
        return np.ascontiguousarray(np.linalg.inv(self.mass), dtype=np.float64)

    @cached_property
    def modes(self) -> Modes:
        """The table of modes, still empty."""
        dofs, count = self.dofs, len(self.active)
        force = np.zeros((dofs, 2 * dofs + count))
        force[:, :dofs], force[:, dofs:2 * dofs] = -self.stiffness, -self.damping
        force[self.active, 2 * dofs + np.arange(count)] = -self.drag
        return Modes(np.empty((3**count, dofs, 2 * dofs + count)), np.empty((3**count, dofs)),
                     np.empty((3**count, count, 2 * dofs + count)), np.empty((3**count, count)),
                     np.zeros(3**count, dtype=np.bool_), self.mobility, force,
                     np.array(self.friction, dtype=np.float64),
                     np.array(self.drag, dtype=np.float64),
                     np.array(self.active, dtype=np.int64) + dofs)

    @property
    def frictional(self) -> tuple[int, ...]:
        """The positions within ``active`` of the coordinates that can stick."""
        return tuple(int(item) for item in np.flatnonzero(self.friction > 0.0))


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


@compiled
def _product(left: Real, right: Real, stride: int) -> float:
    """The scalar product of ``left`` and every ``stride``-th of ``right``."""
    total = 0.0
    for item in range(left.shape[0]):
        total += left[item] * right[item * stride]
    return total


@compiled
def mode_number(modes: Modes, signs: Signs) -> int:
    """The number of the mode ``signs`` (m,), which it fills in where that is still to be done."""
    number = 0
    for sign in signs:
        number = 3 * number + sign + 1
    if modes.known[number]:
        return number
    dofs, width = modes.force.shape
    forces = modes.force.reshape(dofs * width)
    mobility = modes.mobility.copy()
    # The share of the force on each coordinate that holds those that stick, one after the other.
    count = signs.shape[0]
    needed, fixed = np.zeros((count, dofs)), np.zeros(dofs)
    for index in range(count):
        place = modes.velocities[index] - dofs
        fixed[place] = -modes.friction[index] * signs[index]
        if signs[index] != 0:
            continue
        for dof in range(dofs):
            needed[index, dof] = mobility[place, dof] / mobility[place, place]
        for other in range(index):
            moved = needed[other, place]
            for dof in range(dofs):
                needed[other, dof] -= moved * needed[index, dof]
        for row in range(dofs):
            moved = mobility[row, place]
            for dof in range(dofs):
                mobility[row, dof] -= moved * needed[index, dof]
        for dof in range(dofs):
            mobility[place, dof] = mobility[dof, place] = 0.0
    for row in range(dofs):
        modes.constant[number, row] = _product(mobility[row], fixed, 1)
        for item in range(width):
            modes.matrix[number, row, item] = _product(mobility[row], forces[item:], width)
    for row in range(count):
        modes.hold_constant[number, row] = _product(needed[row], fixed, 1)
        for item in range(width):
            modes.hold[number, row, item] = _product(needed[row], forces[item:], width)
    modes.known[number] = True
    return number


@compiled
def extended(modes: Modes, signs: Signs, state: Real) -> Real:
    """The vector (x, w) that a mode's matrices multiply, shape (2n + m,)."""
    size = state.shape[0]
    values = np.empty(size + signs.shape[0])
    for item in range(size):
        values[item] = state[item]
    for index, sign in enumerate(signs):
        values[size + index] = sign * state[modes.velocities[index]]**2
    return values


@compiled
def derivative(modes: Modes, signs: Signs, state: Real) -> Real:
    """x' at ``state`` (2n,) in the mode ``signs``, shape (2n,)."""
    dofs = state.shape[0] // 2
    number = mode_number(modes, signs)
    values = extended(modes, signs, state)
    rate = np.empty(2 * dofs)
    for dof in range(dofs):
        rate[dof] = state[dofs + dof]
        total = modes.constant[number, dof]
        for item in range(values.shape[0]):
            total += modes.matrix[number, dof, item] * values[item]
        rate[dofs + dof] = total
    return rate


@compiled
def holding(modes: Modes, signs: Signs, state: Real) -> Real:
    """The force that friction has to apply to the coordinates that stick, shape (m,)."""
    number = mode_number(modes, signs)
    values = extended(modes, signs, state)
    force: Real = modes.hold_constant[number].copy()
    for index in range(signs.shape[0]):
        for item in range(values.shape[0]):
            force[index] += modes.hold[number, index, item] * values[item]
    return force


@compiled
def _violation(modes: Modes, signs: Signs, state: Real) -> float:
    """By how much, as a share of the friction, ``signs`` breaks the law at zero velocities."""
    dofs = state.shape[0] // 2
    rates, forces = derivative(modes, signs, state), holding(modes, signs, state)
    worst = 0.0
    for index, sign in enumerate(signs):
        velocity, force = modes.velocities[index], abs(forces[index])
        if sign == 0:
            worst = max(worst, force / modes.friction[index] - 1.0)
        elif state[velocity] == 0.0:
            scale = max(modes.friction[index], force)
            against = -sign * rates[velocity] / modes.mobility[velocity - dofs, velocity - dofs]
            worst = max(worst, against / scale if scale > 0.0 else against)
    return worst


@compiled
def signs_at(modes: Modes, state: Real, before: Signs) -> Signs:
    """The mode into which ``state`` (2n,) moves, after the mode ``before``.

    An active coordinate slips in the direction of its velocity. Those without velocity stick
    wherever friction suffices to hold them, and else set off against it; of all their
    combinations the one is chosen that obeys the law. Without friction and without acceleration
    either sign is right: the one ``before`` is kept, or +1 if it stuck.
    """
    count = before.shape[0]
    # The choices of each coordinate, the preferred one first, and which one it is at.
    choices = np.zeros((count, 3), np.int64)
    many, at = np.ones(count, np.int64), np.zeros(count, np.int64)
    best, signs, unsure = np.zeros(count, np.int64), np.zeros(count, np.int64), False
    for index in range(count):
        speed = state[modes.velocities[index]]
        if speed != 0.0:
            choices[index, 0] = best[index] = 1 if speed > 0.0 else -1
            continue
        unsure = True
        can_stick = 1 if modes.friction[index] > 0.0 else 0
        last = before[index] if before[index] != 0 else 1
        choices[index, can_stick], choices[index, can_stick + 1] = last, -last
        many[index] = can_stick + 2
    if not unsure:
        return best
    least = np.inf
    while True:
        for index in range(count):
            signs[index] = choices[index, at[index]]
        violation = _violation(modes, signs, state)
        if violation < least:
            least = violation
            for index in range(count):
                best[index] = signs[index]
        # The next combination, the last coordinate changing first.
        index = count - 1
        while index >= 0 and at[index] + 1 == many[index]:
            at[index] = 0
            index -= 1
        if index < 0:
            return best
        at[index] += 1
