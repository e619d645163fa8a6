import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from scipy.integrate import trapezoid

from shimmy_ros.gear.matrices import mass_matrix
from shimmy_ros.gear.parameter_file import reference_parameters
from shimmy_ros.gear.parameters import Damper, changed
from shimmy_ros.simulation.energy import energy, powers
from shimmy_ros.simulation.rolling_state import (
    STATES,
    energy_factor,
    rolling_model,
    tyre_kinematics,
)
from shimmy_ros.simulation.samples import sample_grid
from shimmy_ros.simulation.simulation import Simulation

GEAR, _ = reference_parameters()
TILTED = changed(GEAR, strut_rake=0.35, rolling_gamma=-2.5, trail=-0.04)
STATE = arrays(float, STATES, elements=st.floats(-1.0, 1.0))


@given(st.sampled_from([GEAR, TILTED]), STATE)
def test_energy_is_that_of_masses_springs_and_tyre(gear, state):
    tyre, rate = tyre_kinematics(gear), np.append(state[4:7], 0.0)
    expected = 0.5 * (
        rate @ mass_matrix(gear) @ rate
        + gear.strut_tilt_stiffness * state[0]**2
        + gear.damper_linkage_stiffness * (state[1] - state[2])**2
        + gear.tyre_lateral_stiffness * (tyre.deflection @ state)**2
        + gear.tyre_torsional_stiffness * state[7]**2)
    assert energy(gear, state[np.newaxis])[0] == pytest.approx(expected, rel=1e-9, abs=1e-9)


@given(st.sampled_from([GEAR, TILTED]), st.floats(0.0, 200.0), STATE)
def test_the_equations_of_motion_obey_the_energy_law(gear, velocity, state):
    damper = Damper(2.0, 10.0, 20.0)
    model, factor = rolling_model(gear).at(velocity), energy_factor(gear)
    derivative = (model.slipping @ state
                  - model.friction_input * damper.coulomb_torque * np.sign(state[5])
                  - model.damper_input * (2.0 + 10.0 * abs(state[6])) * state[6])
    terms = (factor @ state) * (factor @ derivative)
    balance = powers(gear, damper, velocity, state[np.newaxis])
    scale = np.abs(factor).max() * np.abs(factor @ derivative).max() + np.abs(balance).max()
    assert balance.total[0] == pytest.approx(terms.sum(), abs=1e-10 * scale + 1e-12)


@pytest.mark.parametrize(("velocity", "damper", "kick"), [
    (40.0, Damper(2.0, 10.0, 20.0), 9.0),   # grows to the cycle
    (40.0, Damper(2.0, 10.0, 20.0), 0.3),   # dies
    (10.0, Damper(2.0, 50.0, 10.0), 0.3),   # sticks and slips in turn
    (80.0, Damper(2.0, 10.0, 25.0), 0.6),   # likewise
    (0.0, Damper(2.0, 5.0, 25.0), 8.0),     # stands
    (60.0, Damper(2.0, 20.0, 0.0), 3.0),    # without friction
])
def test_a_simulation_closes_the_energy_law(velocity, damper, kick):
    simulation = Simulation(GEAR, damper, velocity)
    simulation.kick(kick)
    start = simulation.state[np.newaxis]
    run = simulation.advance(1.0, sample_grid(0.0, 1.0, 2e-5))
    state = np.concatenate([start, run.state])
    balance = powers(GEAR, damper, velocity, state)
    time = np.append(0.0, run.time)
    exchanged = sum(trapezoid(np.abs(power), time) for power in balance)
    change = np.diff(energy(GEAR, state[[0, -1]]))[0]
    assert trapezoid(balance.total, time) == pytest.approx(change, abs=1e-3 * exchanged)
    # The torques of the samples are those that do this work.
    np.testing.assert_allclose(run.effort[:, 1] * run.velocity[:, 1], balance.friction[1:],
                               atol=1e-9)
    np.testing.assert_allclose(run.effort[:, 2] * run.velocity[:, 2], balance.damper[1:],
                               rtol=1e-12, atol=1e-12)


@pytest.mark.parametrize(("velocity", "damper", "kick"), [
    (10.0, Damper(2.0, 50.0, 10.0), 0.3), (80.0, Damper(2.0, 10.0, 25.0), 0.6)])
def test_the_runs_that_are_said_to_stick_and_slip_in_turn_do_so(velocity, damper, kick):
    simulation = Simulation(GEAR, damper, velocity)
    simulation.kick(kick)
    held = simulation.advance(1.0, sample_grid(0.0, 1.0, 1e-4)).velocity[:, 1] == 0.0
    assert 0.1 < held.mean() < 0.9
    assert np.count_nonzero(np.diff(held)) >= 8
