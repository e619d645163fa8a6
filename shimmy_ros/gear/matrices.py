"""Mass, damping and stiffness of the gear on its rolling tyre: eqs. (27)-(30) with Keldysh's tyre.

The degrees of freedom are q = (strut tilt, swivel, damper, tyre lateral); rad, rad, rad, m.
The paper leaves the coefficients K_ij open; they follow from the tyre deflections
lambda = y - h theta_s - t_g theta and phi = -y'/V - psi, rolling without slip,
d(psi + phi)/dt = V (alpha lambda - beta phi + gamma chi), and the work that the tyre does on the
gear. Row four is the rolling law and not a balance of forces, so K is not symmetric.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from .parameters import Gear

STRUT_TILT, SWIVEL, DAMPER, TYRE_LATERAL = range(4)
NAMES = ("strut_tilt", "swivel", "damper", "tyre_lateral")

Matrix = NDArray[np.float64]


@dataclass(frozen=True)
class Geometry:
    """What the tyre sees of the gear.

    ``height`` h = H + r cos k [m] and ``ground_trail`` t_g = t + r sin k [m] give the lateral
    deflection; ``cosine`` and ``sine`` of the rake give heading psi = theta cos k - theta_s sin k
    and wheel tilt chi = theta_s cos k + theta sin k.
    """

    height: float
    ground_trail: float
    cosine: float
    sine: float


def geometry(gear: Gear) -> Geometry:
    """Lever arms and rake of ``gear``."""
    cosine, sine = np.cos(gear.strut_rake), np.sin(gear.strut_rake)
    return Geometry(gear.trunnion_to_axle + gear.wheel_radius * cosine,
                    gear.trail + gear.wheel_radius * sine, cosine, sine)


def deflection_row(gear: Gear) -> Matrix:
    """The lateral deflection lambda [m] of the tyre as a row (4,) over the coordinates."""
    place = geometry(gear)
    return np.array([-place.height, -place.ground_trail, 0.0, 1.0])


def mass_matrix(gear: Gear) -> Matrix:
    """M, shape (4, 4), SI; the row of the rolling law has unit mass, as in eq. (30)."""
    coupling = gear.wheel_mass * gear.trunnion_to_axle * gear.trail
    return np.array([
        [gear.strut_inertia, coupling, 0.0, 0.0],
        [coupling, gear.swivel_inertia, 0.0, 0.0],
        [0.0, 0.0, gear.damper_inertia, 0.0],
        [0.0, 0.0, 0.0, 1.0],
    ])


def damping_matrix(gear: Gear, linear_damping: float, velocity: float) -> Matrix:
    """C(V), shape (4, 4), SI, for a ``linear_damping`` C_t [N m s/rad] and V > 0 [m/s]."""
    return velocity_parts(gear).damping(linear_damping, velocity)


def stiffness_matrix(gear: Gear, velocity: float) -> Matrix:
    """K(V), shape (4, 4), SI, for V > 0 [m/s]."""
    return velocity_parts(gear).stiffness(velocity)


class VelocityParts(NamedTuple):
    """What the matrices are made of, each of shape (4, 4), SI."""

    mass: Matrix
    rolling_damping: Matrix
    torsional_damping: Matrix
    standing_stiffness: Matrix
    rolling_stiffness: Matrix

    def damping(self, linear_damping: float | Matrix, velocity: float | Matrix) -> Matrix:
        """C(V) = V ``rolling_damping`` + ``torsional_damping`` / V, and the damper's C_t.

        For many velocities at once these have shape (m, 1, 1), C_t (m,), and the result (m, 4, 4).
        """
        matrix: Matrix = velocity * self.rolling_damping + self.torsional_damping / velocity
        matrix[..., DAMPER, DAMPER] += linear_damping
        return matrix

    def stiffness(self, velocity: float | Matrix) -> Matrix:
        """K(V) = ``standing_stiffness`` + V^2 ``rolling_stiffness``, shapes as in damping()."""
        matrix: Matrix = self.standing_stiffness + velocity**2 * self.rolling_stiffness
        return matrix


def velocity_parts(gear: Gear) -> VelocityParts:
    """The parts of the gear's matrices that do not depend on the velocity."""
    place = geometry(gear)
    gyroscopic = gear.wheel_polar_inertia / gear.wheel_radius
    torsion = gear.tyre_torsional_stiffness
    deflection = deflection_row(gear)
    heading = np.array([-place.sine, place.cosine, 0.0, 0.0])
    tilt = np.array([place.cosine, place.sine, 0.0, 0.0])
    standing = (gear.tyre_lateral_stiffness * np.outer(deflection, deflection)
                + torsion * np.outer(heading, heading))
    standing[:TYRE_LATERAL, :TYRE_LATERAL] += structural_stiffness(gear)
    # The last row is the rolling law.
    standing[TYRE_LATERAL] = 0.0
    rolling_damping, torsional_damping, rolling_stiffness = np.zeros((3, 4, 4), standing.dtype)
    rolling_damping[STRUT_TILT, SWIVEL] = gyroscopic
    rolling_damping[SWIVEL, STRUT_TILT] = -gyroscopic
    rolling_damping[TYRE_LATERAL, TYRE_LATERAL] = gear.rolling_beta
    torsional_damping[:, TYRE_LATERAL] = torsion * heading
    rolling_stiffness[TYRE_LATERAL] = (
        gear.rolling_alpha * deflection + gear.rolling_beta * heading + gear.rolling_gamma * tilt)
    return VelocityParts(
        mass_matrix(gear), rolling_damping, torsional_damping, standing, rolling_stiffness)


def structural_stiffness(gear: Gear) -> Matrix:
    """Stiffness of strut and damper linkage without the tyre, shape (3, 3), N m/rad."""
    linkage = gear.damper_linkage_stiffness
    return np.array([
        [gear.strut_tilt_stiffness, 0.0, 0.0],
        [0.0, linkage, -linkage],
        [0.0, -linkage, linkage],
    ])
