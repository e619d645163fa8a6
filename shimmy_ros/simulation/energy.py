"""Energy of the gear and the powers that change it, as a check on any simulation.

dE/dt = V (b phi (alpha lambda - beta phi + gamma chi) - a lambda (psi + phi))
        - C_t theta_1'^2 - C_d |theta_1'|^3 - T_CF |theta'|:
the rolling tyre feeds the motion, damper and friction dissipate it, and the gyroscopic torques do
no work.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..gear.parameters import Damper, Gear
from .rolling_state import (
    DAMPER_RATE,
    SWIVEL_RATE,
    energy_factor,
    rolling_rates,
    tyre_kinematics,
)

Values = NDArray[np.float64]


class Powers(NamedTuple):
    """Rates of change of the energy [W], each of shape (m,)."""

    tyre: Values
    damper: Values
    friction: Values

    @property
    def total(self) -> Values:
        """Their sum, dE/dt."""
        return self.tyre + self.damper + self.friction


def energy(gear: Gear, state: Values) -> Values:
    """Kinetic and strain energy [J], shape (m,), of states (m, 8)."""
    return np.asarray(0.5 * np.square(state @ energy_factor(gear).T).sum(axis=-1))


def powers(gear: Gear, damper: Damper, velocity: float, state: Values) -> Powers:
    """What changes the energy in states (m, 8) at V = ``velocity`` >= 0 [m/s]; V = 0 stands."""
    tyre = tyre_kinematics(gear)
    lateral, turn = rolling_rates(gear)
    fed = (gear.tyre_torsional_stiffness * (state @ tyre.torsion) * (state @ turn)
           + gear.tyre_lateral_stiffness * (state @ tyre.deflection) * (state @ lateral))
    rate = np.abs(state[:, DAMPER_RATE])
    return Powers(
        tyre=velocity * fed,
        damper=-(damper.linear_damping + damper.quadratic_damping * rate) * rate**2,
        friction=-damper.coulomb_torque * np.abs(state[:, SWIVEL_RATE]),
    )
