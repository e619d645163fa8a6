"""The gear's equations of motion in first-order form, written anew, with the swivel free and held.

The state (9,) is strut tilt theta_s, swivel theta, damper angle theta_1 [rad], tyre lateral y [m],
the rates of the first three [rad/s], the tyre's torsion phi [rad], and the friction torque F [N m],
which is constant between events. With lambda = y - h theta_s - t_g theta, psi = theta cos k -
theta_s sin k, chi = theta_s cos k + theta sin k:

    I_LG theta_s'' + m H t theta'' = -K_s theta_s + h a lambda - b phi sin k - (I_wp V/r) theta'
    m H t theta_s'' + I theta''    = t_g a lambda + b phi cos k + (I_wp V/r) theta_s'
                                     - K_t (theta - theta_1) - F
    I_beta theta_1'' = K_t (theta - theta_1) - C_t theta_1' - C_d |theta_1'| theta_1'
    y'   = -V (phi + psi)
    phi' = V (alpha lambda - beta phi + gamma chi) - psi'
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from shimmy_ros.gear.parameters import Damper, Gear

Real = NDArray[np.float64]
Complex = NDArray[np.complex128]

SIZE = 9
TILT, SWIVEL, DAMPER, LATERAL, TILT_RATE, SWIVEL_RATE, DAMPER_RATE, TORSION, FRICTION = range(SIZE)
INNER = (TILT, LATERAL, TILT_RATE, TORSION)
"""The variables of strut and tyre, which are on their own while the swivel is held."""


@dataclass(frozen=True)
class Equations:
    """x' = A x + B C_d |theta_1'| theta_1', once for each mode of the swivel.

    Parameters
    ----------
    matrices : A with the swivel free and held, shape (2, 9, 9)
    load : B, shape (9,)
    holding : torque that holds the swivel, in N m, as a row over the state, shape (9,)
    weights : twice the energy in each variable alone, over its square, shape (9,); a measure of
        size, and no more
    quadratic, friction : C_d [N m s^2/rad^2], T_CF [N m]
    velocity : V [m/s]
    """

    matrices: Real
    load: Real
    holding: Real
    weights: Real
    quadratic: float
    friction: float
    velocity: float


@dataclass(frozen=True)
class HeldRest:
    """Bounds on the torque that holds the swivel from now on, as long as it is held.

    With the swivel held at theta the damper is on its own, and strut and tyre are linear: their
    deviation from ``equilibrium`` theta has modal coordinates ``modes`` z, and contributes at most
    sum |gains| |modes z| to the torque. Of no use unless ``stable``.
    """

    stable: bool
    equilibrium: Real
    torque_per_angle: float
    modes: Complex
    gains: Real


def equations(gear: Gear, damper: Damper, velocity: float) -> Equations:
    """The equations at V = ``velocity`` > 0 [m/s]."""
    cosine, sine = math.cos(gear.strut_rake), math.sin(gear.strut_rake)
    height = gear.trunnion_to_axle + gear.wheel_radius * cosine
    ground_trail = gear.trail + gear.wheel_radius * sine
    lateral, torsional = gear.tyre_lateral_stiffness, gear.tyre_torsional_stiffness
    gyroscopic = gear.wheel_polar_inertia * velocity / gear.wheel_radius
    coupling = gear.wheel_mass * gear.trunnion_to_axle * gear.trail
    x = np.eye(SIZE)
    deflection = x[LATERAL] - height * x[TILT] - ground_trail * x[SWIVEL]
    heading = cosine * x[SWIVEL] - sine * x[TILT]
    turning = cosine * x[SWIVEL_RATE] - sine * x[TILT_RATE]
    tilt = cosine * x[TILT] + sine * x[SWIVEL]
    linkage = gear.damper_linkage_stiffness * (x[SWIVEL] - x[DAMPER])

    on_strut = (-gear.strut_tilt_stiffness * x[TILT] + height * lateral * deflection
                - torsional * sine * x[TORSION] - gyroscopic * x[SWIVEL_RATE])
    on_swivel = (ground_trail * lateral * deflection + torsional * cosine * x[TORSION]
                 + gyroscopic * x[TILT_RATE] - linkage)
    free = np.zeros((SIZE, SIZE))
    free[[TILT, SWIVEL, DAMPER]] = x[[TILT_RATE, SWIVEL_RATE, DAMPER_RATE]]
    free[DAMPER_RATE] = (linkage - damper.linear_damping * x[DAMPER_RATE]) / gear.damper_inertia
    free[LATERAL] = -velocity * (x[TORSION] + heading)
    free[TORSION] = velocity * (gear.rolling_alpha * deflection - gear.rolling_beta * x[TORSION]
                                + gear.rolling_gamma * tilt) - turning
    held = free.copy()
    determinant = gear.strut_inertia * gear.swivel_inertia - coupling**2
    braked = on_swivel - x[FRICTION]
    free[TILT_RATE] = (gear.swivel_inertia * on_strut - coupling * braked) / determinant
    free[SWIVEL_RATE] = (gear.strut_inertia * braked - coupling * on_strut) / determinant
    held[TILT_RATE] = on_strut / gear.strut_inertia
    held[SWIVEL_RATE] = 0.0

    weights = np.array([
        gear.strut_tilt_stiffness + lateral * height**2 + torsional * sine**2,
        gear.damper_linkage_stiffness + lateral * ground_trail**2 + torsional * cosine**2,
        gear.damper_linkage_stiffness, lateral,
        gear.strut_inertia, gear.swivel_inertia, gear.damper_inertia, torsional, 0.0])
    return Equations(
        np.stack([free, held]), -x[DAMPER_RATE] / gear.damper_inertia,
        on_swivel - coupling / gear.strut_inertia * on_strut, weights,
        damper.quadratic_damping, damper.coulomb_torque, velocity)


def held_rest(system: Equations) -> HeldRest:
    """What strut and tyre do with the swivel held."""
    held = system.matrices[1]
    places = list(INNER)
    inner = held[np.ix_(places, places)]
    equilibrium = np.linalg.solve(inner, -held[places, SWIVEL])
    # The damper rests at the swivel's angle.
    per_angle = (system.holding[SWIVEL] + system.holding[DAMPER]
                 + system.holding[places] @ equilibrium)
    rates, vectors = np.linalg.eig(inner)
    return HeldRest(
        bool(rates.real.max() < 0.0), equilibrium, float(per_angle),
        np.linalg.inv(vectors).astype(np.complex128),
        np.abs(system.holding[places] @ vectors))


def energy_matrix(gear: Gear) -> Real:
    """Twice the energy, kinetic and of strut, linkage and tyre, as a form (9, 9) of the state."""
    cosine, sine = math.cos(gear.strut_rake), math.sin(gear.strut_rake)
    x = np.eye(SIZE)
    deflection = (x[LATERAL] - (gear.trunnion_to_axle + gear.wheel_radius * cosine) * x[TILT]
                  - (gear.trail + gear.wheel_radius * sine) * x[SWIVEL])
    form = (gear.strut_tilt_stiffness * np.outer(x[TILT], x[TILT])
            + gear.damper_linkage_stiffness * np.outer(x[SWIVEL] - x[DAMPER],
                                                       x[SWIVEL] - x[DAMPER])
            + gear.tyre_lateral_stiffness * np.outer(deflection, deflection)
            + gear.tyre_torsional_stiffness * np.outer(x[TORSION], x[TORSION]))
    coupling = gear.wheel_mass * gear.trunnion_to_axle * gear.trail
    form[TILT_RATE, TILT_RATE] = gear.strut_inertia
    form[SWIVEL_RATE, SWIVEL_RATE] = gear.swivel_inertia
    form[DAMPER_RATE, DAMPER_RATE] = gear.damper_inertia
    form[TILT_RATE, SWIVEL_RATE] = form[SWIVEL_RATE, TILT_RATE] = coupling
    return np.asarray(form)
