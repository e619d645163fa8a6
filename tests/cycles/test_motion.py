"""Motion by the midpoint rule against exact motion: its order, its cycles, and why it ends."""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from shimmy_ros.cycles.limit_cycles import Role, all_cycles
from shimmy_ros.cycles.motion import STATES, End, Motion
from shimmy_ros.cycles.refinement import upward_passage
from shimmy_ros.cycles.settings import SHOOTING, Settings
from shimmy_ros.cycles.stable_cycle import stable_cycle
from shimmy_ros.cycles.trigger import held_shape
from shimmy_ros.gear.matrices import DAMPER, SWIVEL
from shimmy_ros.gear.parameter_file import reference_parameters
from shimmy_ros.gear.parameters import HALF_TURN, Damper, changed
from shimmy_ros.gear.system import OperatingPoint, gear_system
from shimmy_ros.shooting.flow import advance
from shimmy_ros.shooting.modes import model_of
from shimmy_ros.simulation.rolling_state import TYRE_TORSION, tyre_kinematics
from shimmy_ros.simulation.simulation import Simulation

GEAR, _ = reference_parameters()
NONE = np.empty((0, STATES))


def at(velocity, quadratic_damping, coulomb_torque, linear_damping=2.0, **values):
    return OperatingPoint(changed(GEAR, **values),
                          Damper(linear_damping, quadratic_damping, coulomb_torque), velocity)


REFERENCE = at(40.0, 10.0, 20.0)


@cache
def shot(point):
    """The stable cycle of a point by shooting, the state where the swivel passes, its period."""
    orbit = stable_cycle(point, Settings(method=SHOOTING)).orbit
    return (orbit, *orbit.initial_state())


def kicked(kick):
    state = np.zeros(STATES)
    state[STATES // 2 + SWIVEL] = kick
    return state


def motion_from(point, state, step=None):
    motion = Motion(point, gear_system(point), step)
    motion.begin(state)
    return motion


def followed(motion, steps, change=0.0, known=NONE, near=0.0, floor=0.0):
    return motion.follow(steps, change, known, near, floor)


def exact(point, state, duration):
    return advance(model_of(gear_system(point)), state, duration)


def stays_stuck(point, state, duration):
    """Whether friction holds the swivel in exact motion from ``state`` all the time."""
    phases = exact(point, state, duration).phases((0,))
    return [phase.directions for phase in phases] == [(0,)]


# One of them sticks.
@pytest.mark.parametrize("point", [REFERENCE, at(40.0, 10.0, 160.0), at(10.0, 50.0, 10.0),
                                   at(7.0, 10.0, 20.0)])
def test_a_cycle_is_kept_with_an_error_that_falls_as_the_square_of_the_step(point):
    orbit, state, period = shot(point)
    errors = []
    for steps in (100, 400, 1600):
        motion = motion_from(point, state, period / steps)
        assert followed(motion, 60 * steps) == (End.STEPS, 60 * steps)
        # The motion begins and ends next to a passage of zero, which counts or not by rounding.
        assert motion.passages in (59, 60, 61)
        passed = np.diff(motion.memory.time[:motion.passages])
        assert passed[1:] == pytest.approx(period, rel=2e-3)
        assert motion.period(motion.passages - 1) == pytest.approx(period, rel=2e-3)
        peaks = motion.memory.largest[motion.passages - 10:motion.passages, SWIVEL]
        errors.append(abs(peaks.mean() / orbit.swivel - 1.0))
    assert errors[0] < 2e-2
    # Each is to be a sixteenth of the one before; where a reversal falls within a step, it differs.
    assert errors[1] < errors[0] / 6.0
    assert errors[2] < errors[0] / 36.0


def test_passages_are_those_of_exact_motion():
    point = at(30.0, 20.0, 15.0)
    motion = motion_from(point, kicked(3.0), 2e-5)
    followed(motion, 20000)
    true = exact(point, kicked(3.0), 0.4)
    # From rest the start itself is none.
    upwards = np.array([time for time in true.zeros(SWIVEL)[1:]
                        if true.sample(np.array([time]))[4 + SWIVEL, 0] > 0.0])
    assert motion.passages == len(upwards) >= 2
    memory = motion.memory
    assert memory.time[:motion.passages] == pytest.approx(upwards, rel=2e-5)
    size = np.abs(true.sample(np.linspace(0.0, 0.4, 500))).max(axis=1)
    assert np.abs((memory.state[:motion.passages].T - true.sample(upwards))
                  / size[:, None]).max() < 5e-3
    assert np.abs(memory.state[:motion.passages, SWIVEL]).max() < 1e-15
    edges = [0.0, *upwards]
    for index in range(motion.passages):
        between = true.sample(np.linspace(edges[index], edges[index + 1], 4000))
        assert memory.largest[index, :4] == pytest.approx(np.abs(between[:4]).max(axis=1), rel=2e-3)


@pytest.mark.parametrize(("point", "kick"), [
    (REFERENCE, 0.2), (REFERENCE, 0.45), (REFERENCE, 0.48), (at(4.0, 10.0, 20.0), 8.0),
    (at(40.0, 10.0, 400.0), 8.0), (at(60.0, 50.0, 90.0), 1.0), (at(10.0, 50.0, 10.0), 0.1)])
def test_held_is_only_what_exact_motion_leaves_stuck(point, kick):
    motion = motion_from(point, kicked(kick))
    end, steps = followed(motion, 200_000)
    assert end is End.HELD
    assert motion.state[4 + SWIVEL] == 0.0
    assert stays_stuck(point, motion.state, 5.0)
    # The motion itself, in exact integration, is stuck by then or soon, and at the same angle.
    true = exact(point, kicked(kick), 2.0 * steps * motion.law.step + 1.0)
    assert true.phases((0,))[-1].directions == (0,)
    assert true.end[SWIVEL] == pytest.approx(
        motion.state[SWIVEL], abs=0.03 * np.abs(motion.memory.largest[:, SWIVEL]).max())


@pytest.mark.parametrize(("point", "state"), [
    (REFERENCE, kicked(0.506)), (at(7.0, 10.0, 20.0), None), (at(10.0, 50.0, 20.0), None)])
def test_a_motion_that_sticks_and_goes_on_is_not_held(point, state):
    if state is None:
        orbit, state, _ = shot(point)
        assert orbit.sticks
    motion = motion_from(point, state)
    assert followed(motion, 50_000)[0] is End.STEPS
    assert np.ptp(motion.record(2000)[:, SWIVEL]) > 0.0


def test_beyond_the_angle_at_which_friction_can_hold_the_gear_it_is_not_held():
    shape, stiffness = held_shape(REFERENCE)
    for share, held in ((0.5, True), (0.99, True), (1.01, False), (2.0, False)):
        state = np.append(share * 20.0 / stiffness * shape[:4], np.zeros(4))
        motion = motion_from(REFERENCE, state)
        assert followed(motion, 16)[0] is (End.HELD if held else End.STEPS)
        assert bool(motion.state[4 + SWIVEL] == 0.0) is held
        assert stays_stuck(REFERENCE, state, 1.0) is held


def test_where_strut_and_tyre_do_not_settle_nothing_is_held():
    """The locked gear has a mode that grows: stuck as the swivel is, the gear is not at rest."""
    for velocity, settles in ((1.0, False), (5.0, True)):
        motion = motion_from(at(velocity, 10.0, 20.0, trail=-0.08, strut_rake=-0.5), kicked(0.01))
        assert motion.law.rest_is_stable is settles
        assert followed(motion, 50_000)[0] is (End.HELD if settles else End.STEPS)
        assert motion.state[4 + SWIVEL] == 0.0


@pytest.mark.parametrize(("point", "kick"), [
    (at(40.0, 0.0, 0.0), 0.5), (at(40.0, 0.0, 20.0), 0.5), (at(40.0, 10.0, 20.0), 4e3)])
def test_grown_is_beyond_half_a_turn_and_grows_on(point, kick):
    motion = motion_from(point, kicked(kick))
    assert followed(motion, 200_000)[0] is End.GROWN
    size = np.abs(motion.state[:3]).max()
    assert size > HALF_TURN
    # Not for the last step alone, which is short.
    assert size < 1.5 * HALF_TURN
    assert np.abs(exact(point, motion.state, 0.5).peaks()[:3]).max() > 1.2 * HALF_TURN


def test_a_motion_near_a_known_passage_is_captured():
    orbit, passage, _ = shot(REFERENCE)
    trigger = next(item.orbit for item in all_cycles(REFERENCE) if item.role is Role.TRIGGER)
    known = np.array([upward_passage(trigger), passage])
    for near in (0.3, 0.05, 0.005):
        motion = motion_from(REFERENCE, kicked(3.0))
        end, _ = followed(motion, 100_000, 0.0, known, near)
        assert end is End.CAPTURED
        last = motion.passages - 1
        size = motion.memory.largest[last]
        off = np.abs(motion.memory.state[:last + 1] - passage) / size
        # The damper's rate is not compared.
        compared = np.delete(off, 6, axis=1).max(axis=1)
        assert compared[-1] < near
        assert np.all(compared[:-1] >= near)
        # What is captured leads there.
        assert np.abs(exact(REFERENCE, motion.memory.state[last], 3.0).peaks()[SWIVEL]
                      ) == pytest.approx(orbit.swivel, rel=near + 0.02)
    motion = motion_from(REFERENCE, kicked(3.0))
    assert followed(motion, 100_000, 0.0, known[:1], 0.05)[0] is End.STEPS


def test_kicks_end_with_the_first_that_is_neither_held_nor_captured():
    _, passage, _ = shot(REFERENCE)
    motion = Motion(REFERENCE, gear_system(REFERENCE))
    kicks = np.array([0.2, 0.5, 0.51, 2.0, 8.0])
    ends, cycles, taken = motion.try_kicks(kicks, 10**6, 0.0, passage[None], 0.05, 0.0)
    assert ends.tolist() == [End.HELD, End.HELD, End.CAPTURED, End.CAPTURED, End.CAPTURED]
    assert cycles.tolist() == [-1, -1, 0, 0, 0]
    alone = [followed(motion_from(REFERENCE, kicked(kick)), 10**6, 0.0, passage[None], 0.05)[1]
             for kick in kicks]
    assert taken == sum(alone)
    ends, cycles, taken = motion.try_kicks(kicks, 10**6, 3e-3, NONE, 0.0, 0.0)
    assert ends.tolist() == [End.HELD, End.HELD, End.SETTLED]
    assert cycles.tolist() == [-1, -1, -1]
    ends, _, taken = motion.try_kicks(kicks, 100, 3e-3, NONE, 0.0, 0.0)
    assert ends.tolist()[-1] == End.STEPS
    assert taken == 100


def test_a_motion_without_friction_fades_below_its_floor():
    point = at(4.0, 10.0, 0.0)
    motion = motion_from(point, kicked(2.0))
    end, _ = followed(motion, 500_000, floor=1e-4)
    assert end is End.FADED
    peaks = motion.memory.largest[:motion.passages, SWIVEL]
    assert peaks[-1] < 1e-4
    assert np.all(peaks[:-1] >= 1e-4)
    # It would not have ended otherwise.
    assert followed(motion_from(point, kicked(2.0)), 20_000)[0] is End.STEPS


@pytest.mark.parametrize("point", [REFERENCE, at(10.0, 5.0, 5.0), at(40.0, 10.0, 0.0)])
def test_a_settled_motion_is_on_its_cycle(point):
    orbit, _, period = shot(point)
    off = []
    for change in (1e-2, 1e-4, 1e-6):
        motion = motion_from(point, kicked(8.0), period / 2000)
        assert followed(motion, 10**6, change)[0] is End.SETTLED
        last = motion.passages - 1
        assert motion.period(last) == pytest.approx(period, rel=max(1e-4, 3.0 * change))
        off.append(abs(motion.memory.largest[last, SWIVEL] / orbit.swivel - 1.0))
    assert off[0] < 0.05
    assert off[1] < 2e-3
    assert off[2] < 2e-4


def test_a_motion_can_be_continued():
    whole, parts = (motion_from(REFERENCE, kicked(3.0), 1e-4) for _ in range(2))
    assert followed(whole, 9000) == (End.STEPS, 9000)
    for count in (1, 4321, 4678):
        assert followed(parts, count) == (End.STEPS, count)
    np.testing.assert_array_equal(parts.state, whole.state)
    assert parts.passages == whole.passages > 5
    for name in ("time", "state", "largest"):
        np.testing.assert_array_equal(getattr(parts.memory, name)[:whole.passages],
                                      getattr(whole.memory, name)[:whole.passages])


def test_to_begin_anew_forgets():
    motion = motion_from(REFERENCE, kicked(3.0), 1e-4)
    followed(motion, 5000)
    motion.begin(kicked(3.0))
    assert motion.passages == 0
    followed(motion, 9000)
    fresh = motion_from(REFERENCE, kicked(3.0), 1e-4)
    followed(fresh, 9000)
    assert motion.passages == fresh.passages
    np.testing.assert_array_equal(motion.memory.time[:fresh.passages],
                                  fresh.memory.time[:fresh.passages])


def test_a_motion_of_too_many_passages_is_full_and_can_go_on():
    motion = motion_from(REFERENCE, shot(REFERENCE)[1], 2e-3)
    end, steps = followed(motion, 10**6)
    assert end is End.FULL
    assert steps < 10**6
    motion.begin(motion.state)
    assert motion.passages == 0
    assert followed(motion, 1000)[0] is End.STEPS


def test_positions_of_a_record_are_those_of_exact_motion():
    _, state, period = shot(REFERENCE)
    motion = motion_from(REFERENCE, state, period / 4000)
    positions = motion.record(4000)
    true = exact(REFERENCE, state, period).sample(np.arange(4000) * (period / 4000))
    for index in range(4):
        assert positions[:, index] == pytest.approx(
            true[index], abs=1e-4 * np.abs(true[index]).max())


@pytest.mark.parametrize("linear_damping", [3e3, 1e4])
def test_a_swivel_that_creeps_to_where_friction_balances_it_has_come_to_rest(linear_damping):
    """Against a stiff damper the swivel slides ever slower, and never stops."""
    point = at(40.0, 0.0, 20.0, linear_damping)
    state = np.zeros(STATES)
    state[SWIVEL] = state[DAMPER] = 0.1
    motion = motion_from(point, state)
    assert followed(motion, 10**6)[0] is End.HELD
    assert motion.state[4 + SWIVEL] < 0.0
    balanced = 20.0 / motion.law.held
    assert balanced < motion.state[SWIVEL] < 0.05
    # Simulated on, it goes all the way to there, and nowhere else.
    simulation = Simulation(point.gear, point.damper, point.velocity)
    start = motion.state.copy()
    heading = tyre_kinematics(point.gear).heading
    start[TYRE_TORSION] = -start[7] / point.velocity - heading[:4] @ start[:4]
    simulation.set_state(start)
    later = simulation.advance(30.0, np.linspace(0.0, 30.0, 300)).position[:, SWIVEL]
    assert np.all(np.diff(later) < 1e-7)
    assert later[-1] == pytest.approx(balanced, rel=0.01)


# So stiff a strut or linkage makes the steps short: thousands of them pass in half a period.
@pytest.mark.parametrize(("name", "value"), [
    ("damper_linkage_stiffness", 1e8), ("damper_linkage_stiffness", 2.15e8),
    ("damper_linkage_stiffness", 1e9), ("strut_tilt_stiffness", 1e9),
    ("strut_tilt_stiffness", 2.15e10)])
def test_slow_motion_of_a_stiff_gear_does_not_creep(name, value):
    point = at(40.0, 10.0, 20.0, **{name: value})
    motion = motion_from(point, kicked(2.0))
    assert followed(motion, 200_000)[0] is not End.HELD
    simulation = Simulation(point.gear, point.damper, point.velocity)
    simulation.kick(2.0)
    assert np.ptp(simulation.advance(3.0, np.linspace(2.5, 3.0, 100)).position[:, SWIVEL]) > 0.1


def test_numbers_beyond_floating_point_are_an_error():
    system = gear_system(REFERENCE)
    for name, matrix in (("mass", np.zeros((4, 4))), ("stiffness", np.full((4, 4), np.inf)),
                         ("damping", np.full((4, 4), np.nan))):
        with pytest.raises((ArithmeticError, np.linalg.LinAlgError)), np.errstate(all="ignore"):
            Motion(REFERENCE, replace(system, **{name: matrix}))


@pytest.mark.parametrize(("velocity", "quadratic", "torque"), [
    (10.0, 10.0, 20.0), (30.0, 20.0, 15.0), (20.0, 5.0, 5.0)])
def test_slow_motion_in_short_steps_does_not_creep(velocity, quadratic, torque):
    """Sixty-four times as short as usual: thousands of steps pass in half a period."""
    point = at(velocity, quadratic, torque)
    usual = motion_from(point, kicked(3.0))
    motion = motion_from(point, kicked(3.0), usual.law.step / 64.0)
    assert followed(usual, 5000)[0] is End.STEPS
    assert followed(motion, 5000 * 64)[0] is End.STEPS
    assert motion.passages == pytest.approx(usual.passages, abs=1)
