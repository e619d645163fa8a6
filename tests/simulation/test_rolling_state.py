import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from shimmy_ros.gear.matrices import damping_matrix, mass_matrix, stiffness_matrix
from shimmy_ros.gear.parameter_file import reference_parameters
from shimmy_ros.gear.parameters import changed
from shimmy_ros.simulation.rolling_state import STATES, rolling_model, tyre_kinematics

GEAR, _ = reference_parameters()
GEARS = st.sampled_from([GEAR, changed(GEAR, strut_rake=0.35, rolling_gamma=-2.5, trail=-0.04)])
STATE = arrays(float, STATES, elements=st.floats(-1.0, 1.0))


@given(GEARS, st.floats(0.5, 200.0), STATE, st.floats(-50.0, 50.0), st.floats(-50.0, 50.0))
def test_at_a_constant_velocity_it_is_the_system_of_second_order(gear, velocity, state, friction,
                                                                  torque):
    model, tyre = rolling_model(gear).at(velocity), tyre_kinematics(gear)
    derivative = (model.slipping @ state + model.friction_input * friction
                  + model.damper_input * torque)
    lateral_rate = -velocity * (state @ tyre.torsion + state @ tyre.heading)
    lateral_acceleration = -velocity * (derivative @ tyre.torsion + derivative @ tyre.heading)
    rate = np.append(state[4:7], lateral_rate)
    terms = np.array([
        mass_matrix(gear) @ np.append(derivative[4:7], lateral_acceleration),
        damping_matrix(gear, 0.0, velocity) @ rate,
        stiffness_matrix(gear, velocity) @ state[:4],
        [0.0, -friction, -torque, 0.0],
    ])
    assert abs(derivative[3] - lateral_rate) <= 1e-12 * velocity
    np.testing.assert_array_equal(derivative[:3], state[4:7])
    np.testing.assert_array_less(abs(terms.sum(0)), 1e-9 + 1e-11 * abs(terms).max(0)
                                 + 1e-11 * abs(stiffness_matrix(gear, velocity)).max(1))


@given(GEARS, STATE, st.floats(-50.0, 50.0))
def test_a_standing_tyre_stays_where_it_touches_the_ground(gear, state, friction):
    model, tyre = rolling_model(gear).at(0.0), tyre_kinematics(gear)
    derivative = model.slipping @ state + model.friction_input * friction
    assert derivative[3] == 0.0
    assert derivative @ tyre.torsion == pytest.approx(-(state @ tyre.heading_rate), abs=1e-15)


@given(GEARS, st.floats(0.0, 200.0), STATE, st.floats(-50.0, 50.0))
def test_a_held_swivel_is_one_to_which_friction_applies_the_holding_torque(gear, velocity, state,
                                                                            torque):
    model = rolling_model(gear).at(velocity)
    state[5] = 0.0
    held = model.sticking @ state + model.damper_input * torque
    slipping = (model.slipping @ state + model.damper_input * torque
                + model.friction_input * (model.holding_torque @ state))
    assert held[1] == held[5] == 0.0
    scale = abs(model.slipping).sum(1) + abs(model.friction_input) * abs(
        model.holding_torque).sum()
    np.testing.assert_array_less(abs(held - slipping), 1e-13 * scale + 1e-300)


def test_the_tyre_comes_to_rest_only_when_its_forces_do_not_turn_it():
    model = rolling_model(GEAR).at(40.0)
    equilibria = STATES - np.linalg.matrix_rank(model.sticking)
    assert equilibria == 2  # any angle of the swivel; and its rate, which no longer counts
    swivel = 0.01
    rest = np.zeros(STATES)
    rest[1] = rest[2] = swivel
    others = [0, 3, 7]
    rest[others] = np.linalg.lstsq(model.sticking[:, others], -model.sticking @ rest, rcond=None)[0]
    assert model.sticking @ rest == pytest.approx(0.0, abs=1e-9)
    np.testing.assert_allclose(rolling_model(GEAR).at(80.0).sticking @ rest, 0.0, atol=1e-9)
