"""From a motion to its cycle: the same one whatever the guess, by as little as will do."""

from functools import cache

import numpy as np
import pytest

from shimmy_ros.cycles.budget import Budget, BudgetError
from shimmy_ros.cycles.limit_cycles import Role, all_cycles
from shimmy_ros.cycles.motion import Motion
from shimmy_ros.cycles.orbits import shoot
from shimmy_ros.cycles.refinement import (
    balance_near,
    guess_from_motion,
    guess_from_orbit,
    refined,
    upward_passage,
)
from shimmy_ros.cycles.settings import AUTO, BALANCE, SHOOTING, Settings
from shimmy_ros.cycles.stable_cycle import stable_cycle
from shimmy_ros.gear.matrices import SWIVEL
from shimmy_ros.gear.parameter_file import reference_parameters
from shimmy_ros.gear.parameters import Damper
from shimmy_ros.gear.system import OperatingPoint, gear_system
from shimmy_ros.shooting.flow import advance
from shimmy_ros.shooting.modes import model_of

GEAR, _ = reference_parameters()


def at(velocity, quadratic_damping, coulomb_torque):
    return OperatingPoint(GEAR, Damper(2.0, quadratic_damping, coulomb_torque), velocity)


REFERENCE, HARD, STICKS = at(40.0, 10.0, 20.0), at(10.0, 50.0, 10.0), at(10.0, 50.0, 20.0)


@cache
def exact(point):
    return stable_cycle(point, Settings(method=SHOOTING)).orbit


def refine(point, guess, seconds=10.0, **values):
    return refined(gear_system(point), guess, Settings(**values), Budget.of(seconds))


def motion_near(point, factor, samples=512):
    """A guess from motion through a state that is off the cycle's by a ``factor``."""
    state, period = exact(point).initial_state()
    motion = Motion(point, gear_system(point), period / samples)
    motion.begin(factor * state)
    return guess_from_motion(motion.record(samples), factor * state, period)


def numbers(orbit):
    return np.append(orbit.amplitude, orbit.frequency_hz)


@pytest.mark.parametrize("point", [REFERENCE, HARD, STICKS, at(40.0, 10.0, 160.0),
                                   at(40.0, 10.0, 0.0), at(20.0, 20.0, 15.0)])
def test_the_answer_is_the_same_whatever_the_guess(point):
    answer = refine(point, guess_from_orbit(exact(point)))
    assert answer.stable
    others = [motion_near(point, factor) for factor in (0.96, 1.0, 1.04)]
    others.append(guess_from_orbit(answer))
    neighbour = OperatingPoint(GEAR, point.damper, 1.01 * point.velocity)
    others.append(guess_from_orbit(stable_cycle(neighbour).orbit))
    for guess in others:
        found = refine(point, guess)
        assert (found.method, found.harmonics) == (answer.method, answer.harmonics)
        assert numbers(found) == pytest.approx(numbers(answer), rel=1e-8)


def test_more_harmonics_are_taken_and_shooting_last():
    """The errors estimated are those of the balance with each number of harmonics."""
    point = at(10.0, 20.0, 15.0)
    guess = guess_from_orbit(exact(point))
    errors = {number: refine(point, guess, harmonics=number, method=BALANCE).error
              for number in (4, 8, 16)}
    assert 0.01 > errors[4] / 2.0 > errors[16] > 0.001
    assert errors[4] > errors[8] > errors[16]
    used = {}
    for accuracy in (1.01 * errors[4], 1.01 * errors[8], 1.01 * errors[16], 1e-4):
        found = refine(point, guess, accuracy=accuracy)
        assert found.error <= accuracy
        assert np.abs(numbers(found) / numbers(exact(point)) - 1.0).max() <= found.error + 1e-9
        used[found.method, found.harmonics] = found.error
    assert next(iter(used)) == (BALANCE, 4)
    assert list(used)[-1] == (SHOOTING, 0)
    assert (BALANCE, 8) in used
    assert set(used) <= {(BALANCE, 4), (BALANCE, 8), (BALANCE, 16), (SHOOTING, 0)}
    # More than sixteen are not taken, but begun with.
    assert refine(point, guess, harmonics=24, accuracy=0.01).harmonics == 24


@pytest.mark.parametrize("method", [AUTO, BALANCE, SHOOTING])
def test_one_method_stays_with_it(method):
    found = refine(REFERENCE, motion_near(REFERENCE, 1.02), method=method)
    assert found.method == (SHOOTING if method == SHOOTING else BALANCE)
    # The balance is content whatever its error.
    hard = refine(HARD, motion_near(HARD, 1.02), method=method)
    assert hard.method == (BALANCE if method == BALANCE else SHOOTING)
    assert (hard.error > 0.01) is (method == BALANCE)


def test_a_cycle_that_sticks_is_shootings():
    assert refine(STICKS, motion_near(STICKS, 1.0)).method == SHOOTING
    assert refine(STICKS, motion_near(STICKS, 1.0)).sticks
    assert refine(STICKS, motion_near(STICKS, 1.0), method=BALANCE) is None


@pytest.mark.parametrize("point", [REFERENCE, at(40.0, 10.0, 163.0), at(7.0, 10.0, 20.0)])
def test_an_unstable_cycle_is_said_to_be_unstable(point):
    trigger = next(item.orbit for item in all_cycles(point) if item.role is Role.TRIGGER)
    for method in (AUTO, SHOOTING):
        found = refine(point, guess_from_orbit(trigger), method=method)
        assert found.stable is False
        assert found.method == SHOOTING
        assert found.multiplier > 1.0
        assert numbers(found) == pytest.approx(numbers(trigger), rel=1e-6)
    assert refine(point, guess_from_orbit(trigger), method=BALANCE) is None


def test_a_cycle_far_from_the_guess_is_none():
    state, period = exact(REFERENCE).initial_state()
    for factor in (0.4, 2.5):
        motion = Motion(REFERENCE, gear_system(REFERENCE), period / 512)
        motion.begin(factor * state)
        guess = guess_from_motion(motion.record(512), factor * state, period)
        found = refine(REFERENCE, guess)
        assert found is None or guess.near(found)
        assert found is None or not found.stable
    near = guess_from_orbit(exact(REFERENCE))
    assert near.near(exact(REFERENCE))
    assert not near.near(exact(at(10.0, 10.0, 20.0)))


def test_what_a_guess_from_motion_says_is_that_of_the_motion():
    orbit = exact(REFERENCE)
    guess = motion_near(REFERENCE, 1.0, 2048)
    same = guess_from_orbit(orbit)
    assert guess.frequency == pytest.approx(2.0 * np.pi * orbit.frequency_hz, rel=1e-9)
    assert guess.swivel == pytest.approx(orbit.swivel, rel=1e-3)
    size = np.abs(same.series(4)).max(axis=1, keepdims=True)
    assert guess.series(4) / size == pytest.approx(same.series(4) / size, abs=2e-3)
    np.testing.assert_array_equal(guess.start()[0], orbit.initial_state()[0])


def test_a_motion_over_several_periods_is_that_over_one():
    state, period = exact(REFERENCE).initial_state()
    for times in (3, 5):
        motion = Motion(REFERENCE, gear_system(REFERENCE), period * times / 2048)
        motion.begin(state)
        guess = guess_from_motion(motion.record(2048), state, times * period)
        found = refine(REFERENCE, guess)
        assert found is not None
        assert found.frequency_hz == pytest.approx(1.0 / period, rel=1e-3)


@pytest.mark.parametrize("point", [REFERENCE, HARD, STICKS, at(60.0, 5.0, 5.0),
                                   at(7.0, 10.0, 20.0)])
def test_the_upward_passage_is_on_the_orbit(point):
    model = model_of(gear_system(point))
    for settings in (Settings(), Settings(8), Settings(method=SHOOTING)):
        orbit = stable_cycle(point, settings).orbit
        state = upward_passage(orbit)
        size = np.append(orbit.amplitude, orbit.peak_velocity())
        assert abs(state[SWIVEL]) < 1e-9 * orbit.swivel
        assert state[4 + SWIVEL] > 0.0
        # Half a period later all is of the other sign.
        end = advance(model, state, 0.5 / orbit.frequency_hz).end
        assert np.abs((end + state) / size).max() < 10.0 * orbit.error + 1e-6
        assert shoot(gear_system(point), state, 1.0 / orbit.frequency_hz).same_as(orbit)


def test_the_balance_near_a_guess_is_stable_or_none():
    guess = guess_from_orbit(exact(HARD))
    found = balance_near(gear_system(HARD), guess, Settings(), Budget.of(1.0))
    assert found.harmonics == 4
    assert found.error > 0.01
    trigger = next(item.orbit for item in all_cycles(REFERENCE) if item.role is Role.TRIGGER)
    for asked in (guess_from_orbit(trigger), guess_from_orbit(exact(at(10.0, 5.0, 5.0)))):
        none = balance_near(gear_system(REFERENCE), asked, Settings(), Budget.of(1.0))
        assert none is None


@pytest.mark.parametrize("point", [REFERENCE, STICKS])
def test_refining_spends_and_ends_with_the_budget(point):
    budget = Budget.of(10.0)
    refined(gear_system(point), motion_near(point, 1.0), Settings(), budget)
    assert budget.spent > 0
    for left in (0, budget.spent - 1):
        with pytest.raises(BudgetError):
            refined(gear_system(point), motion_near(point, 1.0), Settings(), Budget(left))
