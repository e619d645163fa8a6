"""Where the balance finds no cycle: what a simulation and shooting make of it."""

import math

import numpy as np
import pytest

from shimmy_ros.gear.matrices import SWIVEL
from shimmy_ros.gear.parameter_file import reference_parameters
from shimmy_ros.gear.parameters import changed
from shimmy_ros.gear.prediction import Predictor
from shimmy_ros.gear.settling import confirmed, rolling_state_of, settled_orbit
from shimmy_ros.gear.simulation import Simulation
from shimmy_ros.gear.system import OperatingPoint, gear_system
from shimmy_ros.ihb.solution import Outcome
from shimmy_ros.ihb.solve import solve_cold
from shimmy_ros.shooting.continuation import continue_branch

GEAR, DAMPER = reference_parameters()


def at(velocity, quadratic_damping, coulomb_torque):
    return OperatingPoint(GEAR, changed(DAMPER, quadratic_damping=quadratic_damping,
                                        coulomb_torque=coulomb_torque), velocity)


# So few harmonics put the first one's fold too early, and more lose the second, which sticks.
MISSED = [(at(90.0, 50.0, 60.0), 4, Outcome.NO_LIMIT_CYCLE, False),
          (at(10.0, 50.0, 21.0), 8, Outcome.FAILED, True)]


@pytest.mark.parametrize(("point", "harmonics", "without", "sticks"), MISSED)
def test_a_cycle_that_the_balance_does_not_find_is_predicted_all_the_same(
        point, harmonics, without, sticks):
    assert solve_cold(gear_system(point), harmonics).outcome is without
    prediction = Predictor(harmonics).predict(point)
    assert prediction.outcome == "limit_cycle"
    assert "simulation and shooting" in prediction.message
    orbit = settled_orbit(point)
    assert orbit.stable
    assert orbit.sticks is sticks
    cycle = prediction.limit_cycle
    assert cycle.amplitude() == pytest.approx(orbit.amplitude, rel=1e-4)
    assert cycle.frequency_hz == pytest.approx(orbit.frequency_hz, rel=1e-12)
    # The series begins at the peak of the swivel's first harmonic, as the balance has it.
    assert cycle.coefficients[SWIVEL, 0] > 0.0
    assert cycle.coefficients[SWIVEL, cycle.harmonics] == pytest.approx(0.0, abs=1e-15)
    # Its positions and rates are those of a simulation that has settled.
    simulation = Simulation(point.gear, point.damper, point.velocity, tolerance=1e-6)
    simulation.set_state(rolling_state_of(point, np.concatenate(
        [cycle.position(np.zeros(1))[:, 0], cycle.velocity(np.zeros(1))[:, 0]])))
    times = np.linspace(0.0, 3.0 * cycle.period, 100)
    motion = simulation.advance(float(times[-1]), times)
    assert motion.position[:, SWIVEL] == pytest.approx(
        cycle.position(times)[SWIVEL], abs=2e-3 * orbit.swivel)


def test_the_cycle_is_found_up_to_the_very_fold():
    start = settled_orbit(at(90.0, 50.0, 60.0)).source
    fold = next(item.parameter for item in continue_branch(
        lambda torque: gear_system(at(90.0, 50.0, torque)), start, 60.0, direction=1, scale=60.0,
        largest_step=0.5) if item.fold)
    below, above = settled_orbit(at(90.0, 50.0, 0.999 * fold)), at(90.0, 50.0, 1.001 * fold)
    assert below.stable
    assert below.multiplier > 0.9
    assert settled_orbit(above) is None
    prediction = Predictor().predict(above)
    assert prediction.outcome == "no_limit_cycle"
    assert prediction.message.startswith("no limit cycle: ")


def test_where_nothing_grows_there_is_nothing_to_settle():
    assert settled_orbit(at(4.0, 10.0, 20.0)) is None


def test_what_cannot_be_told_is_a_failure():
    # The friction is so weak that the motion leaves the range of the model.
    point = at(40.0, 1e-3, 20.0)
    nothing = solve_cold(gear_system(at(4.0, 10.0, 20.0)), 4)
    result = confirmed(point, nothing)
    assert result.outcome is Outcome.FAILED
    assert result.limit_cycle is None
    assert result.message.startswith("did not converge")
    assert "range of the model" in result.message


def test_states_of_the_simulation_and_of_the_equations_of_motion_agree():
    point = at(30.0, 20.0, 15.0)
    simulation = Simulation(point.gear, point.damper, point.velocity)
    simulation.kick(3.0)
    motion = simulation.advance(0.2, [0.05, 0.2])
    for index in range(2):
        state = np.concatenate([motion.position[index], motion.velocity[index]])
        assert rolling_state_of(point, state) == pytest.approx(motion.state[index], abs=1e-12)
    assert math.isclose(simulation.time, 0.2)
