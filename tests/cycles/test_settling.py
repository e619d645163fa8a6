"""Where the balance finds no cycle: what a simulation and shooting make of it."""

import math

import numpy as np
import pytest

from shimmy_ros.cycles.prediction import Predictor
from shimmy_ros.cycles.settling import SettlingError, confirmed, settled_orbit
from shimmy_ros.gear.matrices import DAMPER as DAMPER_ANGLE
from shimmy_ros.gear.matrices import SWIVEL
from shimmy_ros.gear.parameter_file import reference_parameters
from shimmy_ros.gear.parameters import Damper, Gear, changed
from shimmy_ros.gear.system import OperatingPoint, gear_system
from shimmy_ros.ihb.solution import Outcome
from shimmy_ros.ihb.solve import solve_cold
from shimmy_ros.shooting.continuation import continue_branch
from shimmy_ros.simulation.rolling_state import STATES, TYRE_TORSION, tyre_kinematics
from shimmy_ros.simulation.simulation import Simulation

GEAR, DAMPER = reference_parameters()


def rolling_state_of(point, state):
    """The state of the simulation for (q, q') at the velocity of ``point``."""
    result = np.array(state)
    heading = tyre_kinematics(point.gear).heading
    result[TYRE_TORSION] = (-state[STATES - 1] / point.velocity
                            - heading[:DAMPER_ANGLE + 2] @ state[:4])
    return result


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


# Where friction holds the swivel, strut and tyre have another mode of shimmy: with little friction
# the one near 18 Hz is left, with more that near 14 Hz, and in between neither or both at once.
TWO_MODES = Gear(
    strut_inertia=71.6, wheel_mass=23.35, trunnion_to_axle=0.9154, trail=0.0907,
    swivel_inertia=0.8634, wheel_polar_inertia=0.6583, wheel_radius=0.3457, damper_inertia=0.00443,
    strut_tilt_stiffness=463500.0, damper_linkage_stiffness=61540.0, strut_rake=0.1148,
    tyre_lateral_stiffness=285500.0, tyre_torsional_stiffness=2984.0, rolling_alpha=28.75,
    rolling_beta=11.21, rolling_gamma=0.862)


def two_modes(torque):
    return OperatingPoint(TWO_MODES, Damper(2.345, 43.87, torque), 66.6)


@pytest.mark.parametrize(("torque", "frequency"), [
    (2.0, 18.21), (3.0, 18.15), (3.5, None), (5.85, 14.79), (19.0, 13.32), (21.0, None)])
def test_shimmy_in_another_mode_than_without_friction_is_found(torque, frequency):
    point = two_modes(torque)
    orbit = settled_orbit(point)
    prediction = Predictor().predict(point)
    if frequency is None:
        assert orbit is None
        assert prediction.outcome == "no_limit_cycle"
    else:
        assert orbit.frequency_hz == pytest.approx(frequency, abs=0.01)
        assert prediction.limit_cycle.frequency_hz == pytest.approx(orbit.frequency_hz, rel=1e-3)


def test_what_cannot_be_told_is_a_failure():
    # Both modes at once: the motion goes on, and has no period.
    point = two_modes(3.75)
    with pytest.raises(SettlingError, match="neither settled nor died"):
        settled_orbit(point)
    result = confirmed(point, solve_cold(gear_system(point), 4))
    assert result.outcome is Outcome.FAILED
    assert result.limit_cycle is None
    assert result.message.startswith("did not converge")


def test_states_of_the_simulation_and_of_the_equations_of_motion_agree():
    point = at(30.0, 20.0, 15.0)
    simulation = Simulation(point.gear, point.damper, point.velocity)
    simulation.kick(3.0)
    motion = simulation.advance(0.2, [0.05, 0.2])
    for index in range(2):
        state = np.concatenate([motion.position[index], motion.velocity[index]])
        assert rolling_state_of(point, state) == pytest.approx(motion.state[index], abs=1e-12)
    assert math.isclose(simulation.time, 0.2)
