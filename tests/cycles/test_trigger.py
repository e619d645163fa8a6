"""The smallest disturbances that start shimmy, against simulation by other means."""

import functools
import math

import numpy as np
import pytest

from shimmy_ros.cycles.limit_cycles import Role
from shimmy_ros.cycles.trigger import Start, _Fate, _Held, _Motion, _smallest, held_shape, trigger
from shimmy_ros.gear.matrices import SWIVEL, stiffness_matrix
from shimmy_ros.gear.parameter_file import reference_parameters
from shimmy_ros.gear.parameters import changed
from shimmy_ros.gear.system import OperatingPoint, gear_system
from shimmy_ros.shooting.flow import advance
from shimmy_ros.shooting.modes import model_of
from shimmy_ros.simulation.rolling_state import SWIVEL_RATE, rolling_model
from shimmy_ros.simulation.simulation import Simulation

GEAR, DAMPER = reference_parameters()


def at(velocity, quadratic_damping, coulomb_torque):
    return OperatingPoint(GEAR, changed(DAMPER, quadratic_damping=quadratic_damping,
                                        coulomb_torque=coulomb_torque), velocity)


REFERENCE = at(40.0, 10.0, 20.0)


@functools.cache
def trigger_of(point):
    return trigger(point)


def still_moves(point, state, period):
    """Whether the motion from (q, q') still turns after twelve periods, in exact integration."""
    motion = advance(model_of(gear_system(point)), state, 12.0 * period)
    return bool(np.any(motion.zeros(4 + SWIVEL) > 10.0 * period))


def test_the_smallest_kick_of_the_reference_gear():
    found = trigger_of(REFERENCE)
    assert found.start is Start.DISTURBANCE
    assert found.cycle.role is Role.TRIGGER
    dies, starts = found.kick
    # By bisection with exact integration.
    assert dies < 0.504818 * (1.0 + 1e-4)
    assert starts > 0.504818 * (1.0 - 1e-4)
    assert dies < starts <= dies * 1.00011
    assert "0.504" in found.message or "0.505" in found.message


@pytest.mark.parametrize("point", [REFERENCE, at(10.0, 50.0, 10.0), at(40.0, 0.0, 20.0)])
def test_kick_and_release_are_thresholds_in_exact_integration(point):
    found = trigger_of(point)
    shape, _ = held_shape(point)
    period = 1.0 / found.cycle.orbit.frequency_hz
    for threshold, unit in ((found.kick, np.eye(8)[SWIVEL_RATE]),
                            (found.release_angle, np.append(shape[:4], np.zeros(4)))):
        assert not still_moves(point, 0.995 * threshold.dies * unit, period)
        assert still_moves(point, 1.005 * threshold.starts * unit, period)


def test_the_held_gear_is_in_equilibrium_and_friction_holds_it_below_a_certain_angle():
    point = at(30.0, 20.0, 15.0)
    state, stiffness = held_shape(point)
    model = rolling_model(point.gear).at(point.velocity)
    assert state[SWIVEL] == 1.0
    assert model.sticking @ state == pytest.approx(np.zeros(8), abs=1e-9)
    assert model.holding_torque @ state == pytest.approx(stiffness, rel=1e-12)
    matrix = stiffness_matrix(point.gear, point.velocity)
    assert matrix @ state[:4] == pytest.approx([0.0, stiffness, 0.0, 0.0], abs=1e-8)
    assert trigger_of(point).release_angle.dies > 15.0 / stiffness


def test_thresholds_scale_with_the_friction():
    plain, scaled = trigger_of(REFERENCE), trigger_of(at(40.0, 5.0, 40.0))
    assert scaled.kick.starts == pytest.approx(2.0 * plain.kick.starts, rel=3e-4)
    assert scaled.release_angle.starts == pytest.approx(2.0 * plain.release_angle.starts, rel=3e-4)


@pytest.mark.parametrize(("point", "start", "word"), [
    (at(40.0, 10.0, 0.0), Start.ANYTHING, "rest is unstable"),
    (at(40.0, 0.0, 0.0), Start.ANYTHING, "rest is unstable"),
    (at(4.0, 10.0, 20.0), Start.NOTHING, "no shimmy"),
    (at(4.0, 10.0, 0.0), Start.NOTHING, "no shimmy"),
    (at(40.0, 10.0, 165.0), Start.NOTHING, "no shimmy"),  # beyond the fold
])
def test_no_trigger_is_an_answer(point, start, word):
    found = trigger(point)
    assert found.start is start
    assert found.cycle is found.kick is found.release_angle is None
    assert found.message.startswith("no trigger: ")
    assert word in found.message


def test_cycles_that_are_known_are_not_sought_again():
    assert trigger(REFERENCE, []).start is Start.NOTHING


def test_friction_that_is_said_to_hold_the_swivel_does():
    held = _Held(REFERENCE)
    promised = 0
    for kick in np.linspace(0.05, 0.5, 10):
        simulation = Simulation(GEAR, REFERENCE.damper, 40.0, tolerance=1e-5)
        simulation.kick(kick)
        angle = None
        for step in range(150):
            simulation.advance(0.02 * (step + 1))
            if angle is None and simulation.sticking and held.for_good(simulation.state):
                angle = simulation.state[SWIVEL]
        assert simulation.at_rest
        promised += angle is not None
        assert angle is None or simulation.state[SWIVEL] == angle
    assert promised == 10
    # Held at more than friction can hold, or moving far, it is not said to stay.
    state, stiffness = held_shape(REFERENCE)
    assert held.for_good(0.999 * 20.0 / stiffness * state)
    assert not held.for_good(1.001 * 20.0 / stiffness * state)
    assert not held.for_good(0.01 * np.eye(8)[0])


def with_starting(*intervals):
    """A motion's fate where only sizes in ``intervals`` start shimmy, and its life beside them."""

    def follow(size):
        away = min(max(low - size, size - high) for low, high in intervals)
        if away <= 0.0:
            return _Motion(_Fate.STARTS, math.inf)
        return _Motion(_Fate.DIES, max(0.0, -math.log(away)))

    return follow


@pytest.mark.parametrize("low", [0.37, 0.371, 0.38, 0.39])
def test_a_narrow_set_of_disturbances_between_two_of_the_scan_is_found(low):
    follow = with_starting((low, low + 0.002), (2.0, 10.0))
    found = _smallest(follow, 0.0, 0.01, 100.0, 0.1)
    assert found.dies < low <= found.starts < low * 1.001
    assert _smallest(with_starting((2.0, 10.0)), 0.0, 0.01, 100.0, 0.1).starts == pytest.approx(
        2.0, rel=2e-4)


def test_a_first_disturbance_that_starts_shimmy_is_not_the_smallest():
    found = _smallest(with_starting((0.3, 10.0)), 0.1, 1.0, 100.0, 0.1)
    assert found.dies < 0.3 <= found.starts < 0.3 * 1.0002


def test_nothing_within_the_range_is_an_answer():
    assert _smallest(with_starting((200.0, 300.0)), 0.0, 1.0, 100.0, 10.0) is None
    assert _smallest(with_starting((200.0, 300.0)), 0.0, 101.0, 100.0, 10.0) is None
    assert _smallest(lambda size: _Motion(_Fate.LEAVES if size > 5.0 else _Fate.DIES, 0.0),
                     0.0, 1.0, 100.0, 1.0) is None
