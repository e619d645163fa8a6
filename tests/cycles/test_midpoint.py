"""The midpoint rule against exact motion: its order, its cycles, and sticking."""

import numpy as np
import pytest

from shimmy_ros.cycles.branches import SHOOTING, Settings
from shimmy_ros.cycles.growing import growing_cycle
from shimmy_ros.cycles.midpoint import Motion
from shimmy_ros.gear.matrices import SWIVEL
from shimmy_ros.gear.parameter_file import reference_parameters
from shimmy_ros.gear.parameters import Damper
from shimmy_ros.gear.system import OperatingPoint, gear_system
from shimmy_ros.shooting.flow import advance
from shimmy_ros.shooting.modes import model_of

GEAR, _ = reference_parameters()


def at(velocity, quadratic_damping, coulomb_torque):
    return OperatingPoint(GEAR, Damper(2.0, quadratic_damping, coulomb_torque), velocity)


# One of them sticks.
@pytest.mark.parametrize("point", [at(40.0, 10.0, 20.0), at(40.0, 10.0, 160.0),
                                   at(10.0, 50.0, 10.0), at(7.0, 10.0, 20.0)])
def test_a_cycle_is_kept_with_an_error_that_falls_as_the_square_of_the_step(point):
    orbit = growing_cycle(point, Settings(method=SHOOTING))
    state, period = orbit.initial_state()
    errors = []
    for steps in (100, 400, 1600):
        cycles = Motion(point, state, period / steps).advance(60 * steps)
        # The motion begins and ends next to a passage of zero, which counts or not by rounding.
        assert len(cycles.peak) in (58, 59, 60)
        assert cycles.period == pytest.approx(period, rel=2e-3)
        errors.append(abs(cycles.peak[-10:].mean() / orbit.swivel - 1.0))
    assert errors[0] < 2e-2
    # Each is to be a sixteenth of the one before; where a reversal falls within a step, it differs.
    assert errors[1] < errors[0] / 6.0
    assert errors[2] < errors[0] / 36.0


def test_states_at_the_ends_of_cycles_are_those_of_exact_motion():
    point = at(30.0, 20.0, 15.0)
    start = np.zeros(8)
    start[4 + SWIVEL] = 3.0
    cycles = Motion(point, start, 1e-5).advance(40000)
    exact = advance(model_of(gear_system(point)), start, 0.4)
    upwards = [time for time in exact.zeros(SWIVEL) if exact.sample(
        np.array([time]))[4 + SWIVEL, 0] > 0.0]
    assert len(cycles.peak) >= 2
    # The first passage of zero is that of the start itself, from rest: it is not upwards.
    assert cycles.period == pytest.approx(np.diff(upwards)[:len(cycles.period)], rel=1e-5)
    size = np.abs(exact.sample(np.linspace(0.0, 0.4, 500))).max(axis=1)
    for state, time in zip(cycles.state, upwards[1:], strict=False):
        assert np.abs((state - exact.sample(np.array([time]))[:, 0]) / size).max() < 5e-3


def test_a_motion_below_the_trigger_ends_stuck_where_exact_motion_does():
    point = at(40.0, 10.0, 20.0)
    start = np.zeros(8)
    start[4 + SWIVEL] = 0.45
    motion = Motion(point, start, 2e-5)
    motion.advance(50000)
    exact = advance(model_of(gear_system(point)), start, 1.0)
    assert exact.end[4 + SWIVEL] == 0.0
    stuck = exact.phases((0,))[-1]
    assert stuck.directions == (0,)
    assert motion.stuck == pytest.approx(1.0 - stuck.start, abs=1e-3)


def test_a_motion_can_be_continued():
    point = at(40.0, 10.0, 20.0)
    start = np.zeros(8)
    start[4 + SWIVEL] = 3.0
    whole, parts = Motion(point, start, 1e-4), Motion(point, start, 1e-4)
    expected = whole.advance(9000)
    found = [parts.advance(count) for count in (1, 4321, 4678)]
    for index in range(3):
        np.testing.assert_array_equal(np.concatenate([part[index] for part in found]),
                                      expected[index])
