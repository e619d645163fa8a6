import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from shimmy_ros.gear.matrices import (
    damping_matrix,
    mass_matrix,
    stiffness_matrix,
    structural_stiffness,
)
from shimmy_ros.gear.parameter_file import reference_parameters
from shimmy_ros.gear.parameters import changed

GEAR, _ = reference_parameters()
TILTED = changed(GEAR, strut_rake=0.35, rolling_gamma=-2.5, trail=-0.04)


@given(st.sampled_from([GEAR, TILTED]), st.floats(1.0, 200.0),
       st.lists(st.floats(-1.0, 1.0), min_size=12, max_size=12))
def test_rows_are_the_virtual_work_of_springs_and_tyre_and_the_rolling_law(gear, velocity, numbers):
    position, rate, acceleration = np.reshape(numbers, (3, 4))
    linear_damping = 3.0
    tilt, swivel, damper, lateral = position
    cosine, sine = math.cos(gear.strut_rake), math.sin(gear.strut_rake)
    height = gear.trunnion_to_axle + gear.wheel_radius * cosine
    trail = gear.trail + gear.wheel_radius * sine
    deflection = lateral - height * tilt - trail * swivel
    heading = swivel * cosine - tilt * sine
    wheel_tilt = tilt * cosine + swivel * sine
    torsion = -rate[3] / velocity - heading

    side = gear.tyre_lateral_stiffness * deflection
    twist = gear.tyre_torsional_stiffness * torsion
    spin = gear.wheel_polar_inertia * velocity / gear.wheel_radius
    linkage = gear.damper_linkage_stiffness * (swivel - damper)
    coupling = gear.wheel_mass * gear.trunnion_to_axle * gear.trail
    expected = np.array([
        gear.strut_inertia * acceleration[0] + coupling * acceleration[1] + spin * rate[1]
        + gear.strut_tilt_stiffness * tilt - height * side + sine * twist,
        coupling * acceleration[0] + gear.swivel_inertia * acceleration[1] - spin * rate[0]
        + linkage - trail * side - cosine * twist,
        gear.damper_inertia * acceleration[2] + linear_damping * rate[2] - linkage,
        acceleration[3] + velocity**2 * (gear.rolling_alpha * deflection
                                         - gear.rolling_beta * torsion
                                         + gear.rolling_gamma * wheel_tilt),
    ])
    balance = (mass_matrix(gear) @ acceleration
               + damping_matrix(gear, linear_damping, velocity) @ rate
               + stiffness_matrix(gear, velocity) @ position)
    scale = (abs(mass_matrix(gear)).sum(1) + abs(damping_matrix(gear, 3.0, velocity)).sum(1)
             + abs(stiffness_matrix(gear, velocity)).sum(1))
    assert balance == pytest.approx(expected, abs=1e-13 * scale.max())
    assert abs(balance - expected)[3] <= 1e-13 * scale[3]


def test_the_printed_coefficients_stand_where_eqs_27_to_30_have_them():
    velocity, linear_damping = 40.0, 2.0
    damping = damping_matrix(GEAR, linear_damping, velocity)
    torsional = GEAR.tyre_torsional_stiffness / velocity
    expected = np.zeros((4, 4))
    expected[0, 1] = GEAR.wheel_polar_inertia * velocity / GEAR.wheel_radius
    expected[1, 0] = -expected[0, 1]
    expected[0, 3] = -torsional * math.sin(GEAR.strut_rake)
    expected[1, 3] = torsional * math.cos(GEAR.strut_rake)
    expected[2, 2] = linear_damping
    expected[3, 3] = GEAR.rolling_beta * velocity
    np.testing.assert_allclose(damping, expected, rtol=1e-15)
    stiffness = stiffness_matrix(GEAR, velocity)
    assert stiffness[3, 3] == pytest.approx(GEAR.rolling_alpha * velocity**2, rel=1e-15)
    assert stiffness[0, 3] == pytest.approx(
        -GEAR.tyre_lateral_stiffness * (1.1 + 0.3 * math.cos(0.1)), rel=1e-15)


def test_the_gear_on_a_standing_tyre_is_conservative_and_the_rolling_law_is_not():
    stiffness = stiffness_matrix(GEAR, 40.0)
    np.testing.assert_allclose(stiffness[:3, :3], stiffness[:3, :3].T)
    assert abs(stiffness[3, 0] - stiffness[0, 3]) > 1e3
    np.testing.assert_array_equal(mass_matrix(GEAR), mass_matrix(GEAR).T)
    assert np.linalg.eigvalsh(mass_matrix(GEAR)).min() > 0.0
    assert np.linalg.eigvalsh(structural_stiffness(GEAR)).min() > -1e-9
