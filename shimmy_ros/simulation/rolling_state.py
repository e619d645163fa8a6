"""First-order form of eqs. (27)-(30), regular at every velocity and at standstill.

The state is x = (theta_s, theta, theta_1, y, theta_s', theta', theta_1', phi); rad, rad, rad, m,
rad/s, rad/s, rad/s, rad. The torsion phi of the tyre takes the place of y', so that the rolling
law reads y' = -V (phi + psi), phi' = V (alpha lambda - beta phi + gamma chi) - psi'. At a constant
V > 0 this is row (30) with phi = -y'/V - psi; y and phi are what stays continuous when V changes,
and at V = 0 the tyre stands on the ground: y' = 0, phi' = -psi'. Everything is affine in V.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..gear.matrices import (
    DAMPER,
    STRUT_TILT,
    SWIVEL,
    TYRE_LATERAL,
    Matrix,
    geometry,
    mass_matrix,
    structural_stiffness,
)
from ..gear.parameters import Gear

STRUT_TILT_RATE, SWIVEL_RATE, DAMPER_RATE, TYRE_TORSION = range(4, 8)
STATES = 8

Vector = NDArray[np.float64]

_STRUCTURE = slice(STRUT_TILT, DAMPER + 1)
_RATES = slice(STRUT_TILT_RATE, DAMPER_RATE + 1)


@dataclass(frozen=True)
class TyreKinematics:
    """Rows (8,) that give, times the state: lambda [m], psi, chi, phi [rad] and psi' [rad/s]."""

    deflection: Vector
    heading: Vector
    tilt: Vector
    torsion: Vector
    heading_rate: Vector


@dataclass(frozen=True)
class LinearModel:
    """x' = A x + friction_input * friction torque + damper_input * damper torque.

    ``slipping`` is A (8, 8) of the moving swivel. ``sticking`` is A (8, 8) of the swivel held at
    rest, where the friction torque [N m] is what it has to be: ``holding_torque`` (8,) times x.
    """

    slipping: Matrix
    sticking: Matrix
    holding_torque: Vector
    friction_input: Vector
    damper_input: Vector


@dataclass(frozen=True)
class RollingModel:
    """The linear models of one gear: at standstill, and their derivative by V [m/s]."""

    standing: LinearModel
    per_velocity: LinearModel

    def at(self, velocity: float) -> LinearModel:
        """The gear without dampers and friction at V = ``velocity`` >= 0 [m/s]; V = 0 stands."""
        start, slope = self.standing, self.per_velocity
        return LinearModel(
            slipping=start.slipping + velocity * slope.slipping,
            sticking=start.sticking + velocity * slope.sticking,
            holding_torque=start.holding_torque + velocity * slope.holding_torque,
            friction_input=start.friction_input,
            damper_input=start.damper_input,
        )


def tyre_kinematics(gear: Gear) -> TyreKinematics:
    """The tyre's deflections as rows over the state."""
    place = geometry(gear)
    return TyreKinematics(
        deflection=np.array([-place.height, -place.ground_trail, 0, 1, 0, 0, 0, 0]),
        heading=np.array([-place.sine, place.cosine, 0, 0, 0, 0, 0, 0]),
        tilt=np.array([place.cosine, place.sine, 0, 0, 0, 0, 0, 0]),
        torsion=np.eye(STATES)[TYRE_TORSION],
        heading_rate=np.array([0, 0, 0, 0, -place.sine, place.cosine, 0, 0]),
    )


def rolling_rates(gear: Gear) -> Matrix:
    """Rows (2, 8): y'/V, and (psi + phi)'/V of rolling without slip [rad/m]."""
    tyre = tyre_kinematics(gear)
    return np.array([
        -(tyre.torsion + tyre.heading),
        gear.rolling_alpha * tyre.deflection - gear.rolling_beta * tyre.torsion
        + gear.rolling_gamma * tyre.tilt,
    ])


def rolling_model(gear: Gear) -> RollingModel:
    """The gear's linear models."""
    standing_tyre = np.zeros((2, STATES))
    standing_tyre[1] = -tyre_kinematics(gear).heading_rate
    return RollingModel(
        _linear_model(gear, _elastic_torques(gear), standing_tyre, moving=1.0),
        _linear_model(gear, _gyroscopic_torques(gear), rolling_rates(gear), moving=0.0),
    )


def energy_factor(gear: Gear) -> Matrix:
    """F, shape (7, 8), with E = 1/2 |F x|^2 [J]: kinetic and of strut, linkage and tyre."""
    mass = mass_matrix(gear)
    tyre = tyre_kinematics(gear)
    coupling = mass[SWIVEL, STRUT_TILT] / np.sqrt(mass[STRUT_TILT, STRUT_TILT])
    unit = np.eye(STATES)
    return np.array([
        np.sqrt(gear.strut_inertia) * unit[STRUT_TILT_RATE] + coupling * unit[SWIVEL_RATE],
        np.sqrt(max(gear.swivel_inertia - coupling**2, 0.0)) * unit[SWIVEL_RATE],
        np.sqrt(gear.damper_inertia) * unit[DAMPER_RATE],
        np.sqrt(gear.strut_tilt_stiffness) * unit[STRUT_TILT],
        np.sqrt(gear.damper_linkage_stiffness) * (unit[SWIVEL] - unit[DAMPER]),
        np.sqrt(gear.tyre_lateral_stiffness) * tyre.deflection,
        np.sqrt(gear.tyre_torsional_stiffness) * tyre.torsion,
    ])


def _elastic_torques(gear: Gear) -> Matrix:
    """Torques (3, 8) of springs and tyre on theta_s, theta, theta_1 [N m].

    The tyre's do work on lambda and on -psi.
    """
    tyre = tyre_kinematics(gear)
    torque = np.zeros((3, STATES))
    torque[:, _STRUCTURE] = -structural_stiffness(gear)
    torque -= gear.tyre_lateral_stiffness * np.outer(tyre.deflection[_STRUCTURE], tyre.deflection)
    torque += gear.tyre_torsional_stiffness * np.outer(tyre.heading[_STRUCTURE], tyre.torsion)
    return torque


def _gyroscopic_torques(gear: Gear) -> Matrix:
    """Torques (3, 8) of the spinning wheel, by V [N m / (m/s)]."""
    torque = np.zeros((3, STATES))
    torque[STRUT_TILT, SWIVEL_RATE] = -gear.wheel_polar_inertia / gear.wheel_radius
    torque[SWIVEL, STRUT_TILT_RATE] = gear.wheel_polar_inertia / gear.wheel_radius
    return torque


def _linear_model(gear: Gear, torque: Matrix, rolling: Matrix, moving: float) -> LinearModel:
    """Assemble what the torques and the rows of y' and phi' give.

    ``moving`` is the entry that makes rates the derivatives of angles.
    """
    mass = mass_matrix(gear)[_STRUCTURE, _STRUCTURE]
    inverse = _inverse_mass(mass)
    # Held, the swivel does not accelerate the strut, and friction takes up what torque is left.
    held = torque / np.diag(mass)[:, np.newaxis]
    held[SWIVEL] = 0.0
    sticking = _assemble(held, rolling, moving)
    sticking[:, SWIVEL_RATE] = 0.0
    holding = mass[SWIVEL, STRUT_TILT] * held[STRUT_TILT] - torque[SWIVEL]
    holding[SWIVEL_RATE] = 0.0
    friction, damper = np.zeros(STATES), np.zeros(STATES)
    friction[_RATES], damper[_RATES] = inverse[:, SWIVEL], inverse[:, DAMPER]
    return LinearModel(_assemble(inverse @ torque, rolling, moving), sticking, holding, friction,
                       damper)


def _assemble(acceleration: Matrix, rolling: Matrix, moving: float) -> Matrix:
    matrix = np.zeros((STATES, STATES))
    matrix[_STRUCTURE, _RATES] = moving * np.eye(3)
    matrix[_RATES] = acceleration
    matrix[TYRE_LATERAL], matrix[TYRE_TORSION] = rolling
    return matrix


def _inverse_mass(mass: Matrix) -> Matrix:
    inverse = np.zeros((3, 3))
    inverse[:2, :2] = [[mass[1, 1], -mass[0, 1]], [-mass[1, 0], mass[0, 0]]]
    inverse[:2, :2] /= mass[0, 0] * mass[1, 1] - mass[0, 1] * mass[1, 0]
    inverse[2, 2] = 1.0 / mass[2, 2]
    return inverse
