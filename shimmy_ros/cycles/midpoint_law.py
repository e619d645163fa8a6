"""What the midpoint rule needs of a gear's equations, and when friction holds a swivel for good.

The rule takes (2 M / h + C + h K / 2) u = 2 M v / h - K q - forces for the mean velocity u.
Friction holds a swivel that is stuck for good if the torque that it has to take up stays below T:
strut and tyre then move linearly, in four modes, and the damper by itself against the linkage,
losing energy, so that the torque is bounded by the sum over the modes.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..compiling import compiled
from ..gear.matrices import STRUT_TILT, SWIVEL, TYRE_LATERAL

Real = NDArray[np.float64]
Complex = NDArray[np.complex128]


class Law(NamedTuple):
    """The equations for one step length, as the loops take them.

    ``inverse`` (4, 4) of 2 M / h + C + h K / 2, ``mass`` 2 M / h, ``stiffness`` K; the
    ``shortest`` period [s] of strut, swivel and tyre; and what tells that a stuck swivel stays so:
    ``rest_is_stable``, whether the modes of strut and tyre decay; ``torques`` (4, 4), which gives
    each mode's share of the torque from (tilt, lateral, their rates) less ``equilibrium`` (2,)
    times the swivel's angle; the ``held`` stiffness against which that is turned [N m/rad], the
    ``linkage`` K_t, and ``impedance`` sqrt(K_t I_beta).
    """

    inverse: Real
    mass: Real
    stiffness: Real
    torque: float
    quadratic: float
    step: float
    shortest: float
    rest_is_stable: bool
    torques: Complex
    equilibrium: Real
    held: float
    linkage: float
    impedance: float


@compiled
def law_of(mass: Real, damping: Real, stiffness: Real, torque: float, quadratic: float,
         linkage: float, inertia: float, step: float, fineness: float) -> Law:
    """The law for the matrices (4, 4) of a gear, with a ``step`` [s].

    A step of 0 is replaced by one of which ``fineness`` go into a period of the fastest mode of
    strut, swivel and tyre.

    Raises LinAlgError.
    """
    shortest = _shortest_period(mass, damping, stiffness)
    if step == 0.0:
        step = shortest / fineness
    scaled = mass * (2.0 / step)
    inverse = np.linalg.inv(scaled + damping + 0.5 * step * stiffness).astype(np.float64)
    # Strut and tyre, the swivel held: x' = A x, x = (tilt, lateral, their rates).
    matrix = np.zeros((4, 4), np.complex128)
    needed = np.zeros(4, np.complex128)
    lines = (STRUT_TILT, TYRE_LATERAL)
    for i in range(2):
        matrix[i, 2 + i] = 1.0
        row = lines[i]
        for j in range(2):
            # The two are not coupled by their inertia.
            matrix[2 + i, j] = -stiffness[row, lines[j]] / mass[row, row]
            matrix[2 + i, 2 + j] = -damping[row, lines[j]] / mass[row, row]
        needed[i] = stiffness[SWIVEL, row]
        needed[2 + i] = damping[SWIVEL, row]
    for i in range(2):
        for j in range(4):
            needed[j] += mass[SWIVEL, lines[i]] * matrix[2 + i, j]
    rates, modes = np.linalg.eig(matrix)
    torques = np.linalg.inv(modes)
    for mode in range(4):
        share = 0.0 + 0.0j
        for j in range(4):
            share += needed[j] * modes[j, mode]
        torques[mode] *= share
    a, b = stiffness[STRUT_TILT, STRUT_TILT], stiffness[STRUT_TILT, TYRE_LATERAL]
    c, d = stiffness[TYRE_LATERAL, STRUT_TILT], stiffness[TYRE_LATERAL, TYRE_LATERAL]
    right = (-stiffness[STRUT_TILT, SWIVEL], -stiffness[TYRE_LATERAL, SWIVEL])
    determinant = a * d - b * c
    equilibrium = np.array([(d * right[0] - b * right[1]) / determinant,
                            (a * right[1] - c * right[0]) / determinant])
    held = (stiffness[SWIVEL, SWIVEL] - linkage + stiffness[SWIVEL, STRUT_TILT] * equilibrium[0]
            + stiffness[SWIVEL, TYRE_LATERAL] * equilibrium[1])
    return Law(inverse, scaled, np.ascontiguousarray(stiffness), torque, quadratic, step, shortest,
               bool(np.max(rates.real) < 0.0), torques, equilibrium, held, linkage,
               np.sqrt(linkage * inertia))


@compiled
def _shortest_period(mass: Real, damping: Real, stiffness: Real) -> float:
    """That [s] of the modes of strut and swivel, damper and contact fixed, and of the tyre's
    rolling."""
    inertia, coupling = mass[STRUT_TILT, STRUT_TILT], mass[STRUT_TILT, SWIVEL]
    other = mass[SWIVEL, SWIVEL]
    first, both = stiffness[STRUT_TILT, STRUT_TILT], stiffness[STRUT_TILT, SWIVEL]
    second = stiffness[SWIVEL, SWIVEL]
    # det(K - w^2 M) = 0.
    leading = inertia * other - coupling * coupling
    middle = inertia * second + other * first - 2.0 * coupling * both
    last = first * second - both * both
    fastest = 0.5 * (middle + np.sqrt(max(middle * middle - 4.0 * leading * last, 0.0))) / leading
    rolling = (stiffness[TYRE_LATERAL, TYRE_LATERAL] / mass[TYRE_LATERAL, TYRE_LATERAL]
               - 0.25 * (damping[TYRE_LATERAL, TYRE_LATERAL]
                         / mass[TYRE_LATERAL, TYRE_LATERAL]) ** 2)
    return float(2.0 * np.pi / np.sqrt(max(fastest, rolling)))
