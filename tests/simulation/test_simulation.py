import math
from contextlib import suppress
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from shimmy_ros.gear.parameter_file import reference_parameters
from shimmy_ros.gear.parameters import Damper, Gear, ParameterError, changed, ranges
from shimmy_ros.resources import resource_directory
from shimmy_ros.simulation.measurement import measure_cycles
from shimmy_ros.simulation.samples import sample_grid
from shimmy_ros.simulation.simulation import ANGLE_LIMIT, Simulation, SimulationError

GEAR, _ = reference_parameters()
DAMPER = Damper(2.0, 10.0, 20.0)
SWIVEL = 1


def kicked(rate, velocity=40.0, damper=DAMPER, **options):
    simulation = Simulation(GEAR, damper, velocity, **options)
    simulation.kick(rate)
    return simulation


def assert_same(samples, others):
    for name in ("time", "state", "velocity", "effort"):
        np.testing.assert_array_equal(getattr(samples, name), getattr(others, name))


def test_a_gear_at_rest_stays_exactly_at_rest():
    simulation = Simulation(GEAR, DAMPER, 40.0)
    assert simulation.at_rest
    assert simulation.sticking
    run = simulation.advance(100.0, sample_grid(0.0, 100.0, 0.1))
    assert len(run.time) == 1000
    assert not run.state.any()
    assert not run.velocity.any()
    assert not run.effort.any()


@pytest.mark.parametrize("rate", [0.05, -0.3, 0.5])
def test_a_small_kick_dies_to_exact_rest(rate):
    simulation = kicked(rate)
    assert not simulation.at_rest
    run = simulation.advance(5.0, sample_grid(0.0, 5.0, 0.002))
    assert simulation.at_rest
    assert simulation.sticking
    moving = np.flatnonzero(run.velocity.any(axis=1))
    assert run.time[moving[-1]] < 2.0
    rest = run.position[moving[-1] + 1:]
    assert not run.velocity[moving[-1] + 1:].any()
    np.testing.assert_array_equal(rest, np.broadcast_to(rest[0], rest.shape))
    assert 0.0 < abs(rest[0, SWIVEL]) < 0.01
    held = run.effort[-1, SWIVEL]
    assert 0.0 < abs(held) <= DAMPER.coulomb_torque
    assert math.copysign(1.0, held) == math.copysign(1.0, rest[0, SWIVEL])


@pytest.mark.parametrize("rate", [2.0, -9.0, 60.0])
def test_a_large_kick_grows_to_the_limit_cycle(rate):
    simulation = kicked(rate)
    simulation.advance(5.0)
    run = simulation.advance(6.0, sample_grid(5.0, 6.0, 0.0005))
    cycles = measure_cycles(run.time, run.position[:, SWIVEL], run.velocity[:, SWIVEL])
    np.testing.assert_allclose(cycles.amplitude, 0.1206895, rtol=1e-3)
    np.testing.assert_allclose(cycles.frequency, 12.02941, rtol=5e-4)


def test_a_stuck_swivel_does_not_move_at_all():
    simulation = kicked(0.3, 10.0, Damper(2.0, 50.0, 10.0))
    run = simulation.advance(1.0, sample_grid(0.0, 1.0, 1e-4))
    held = run.velocity[:, SWIVEL] == 0.0
    starts = np.flatnonzero(held[1:] & ~held[:-1]) + 1
    ends = np.flatnonzero(~held[1:] & held[:-1]) + 1
    assert len(starts) >= 4
    for start, end in zip(starts, [*ends, len(held)], strict=False):
        assert np.ptp(run.position[start:end, SWIVEL]) == 0.0
        assert end - start > 10
        assert abs(run.velocity[start:end, 0]).max() > 0.0  # the strut moves on
    for end in ends:  # released with the whole friction torque, and in its direction
        assert abs(run.effort[end - 1, SWIVEL]) == pytest.approx(10.0, rel=0.05)
        assert run.velocity[end, SWIVEL] * run.effort[end, SWIVEL] < 0.0
    assert (abs(run.effort[:, SWIVEL]) <= 10.0 + 1e-9).all()
    slipping = run.effort[~held, SWIVEL]
    np.testing.assert_array_equal(slipping, -10.0 * np.sign(run.velocity[~held, SWIVEL]))


def test_friction_holds_what_it_can_hold():
    held, released = Simulation(GEAR, DAMPER, 0.0), Simulation(GEAR, DAMPER, 0.0)
    # Swivel and damper turned together are driven back by the tyre, and by the inertia of the strut
    # that the tyre moves.
    trail, height = 0.08 + 0.3 * math.sin(0.1), 1.1 + 0.3 * math.cos(0.1)
    inertial = 25.0 * 1.1 * 0.08 * height / 60.0
    limit = DAMPER.coulomb_torque / (2.5e5 * trail * (trail - inertial))
    for simulation, angle in ((held, 0.999 * limit), (released, 1.001 * limit)):
        state = np.zeros(8)
        state[1] = state[2] = angle
        simulation.set_state(state)
    assert held.sticking
    assert held.advance(0.0, [0.0]).effort[0, SWIVEL] == pytest.approx(0.999 * 20.0, rel=1e-12)
    assert not released.sticking
    assert held.advance(1e-4, [1e-4]).state[0, 1] == 0.999 * limit
    released.advance(1e-3)
    assert released.state[1] < 1.001 * limit


@settings(deadline=None, max_examples=20)
@given(st.lists(st.floats(0.0, 0.02), max_size=60), st.sampled_from([0.4, 9.0]))
def test_a_run_in_pieces_is_the_run_at_once(pieces, rate):
    at_once, in_pieces = kicked(rate), kicked(rate)
    ends = np.cumsum([0.0, *pieces, 0.3])
    whole = at_once.advance(ends[-1], sample_grid(0.0, ends[-1], 0.001))
    parts = [in_pieces.advance(end, sample_grid(start, end, 0.001))
             for start, end in pairwise(ends)]
    for name in ("time", "state", "velocity", "effort"):
        np.testing.assert_array_equal(np.concatenate([getattr(part, name) for part in parts]),
                                      getattr(whole, name))
    np.testing.assert_array_equal(at_once.state, in_pieces.state)
    assert at_once.time == in_pieces.time == ends[-1]


def test_left_and_right_are_alike():
    left, right = kicked(5.0), kicked(-5.0)
    times = sample_grid(0.0, 0.5, 0.001)
    run, mirrored = left.advance(0.5, times), right.advance(0.5, times)
    np.testing.assert_array_equal(run.state, -mirrored.state)
    np.testing.assert_array_equal(run.effort, -mirrored.effort)


def test_time_may_begin_anywhere():
    here, there = kicked(9.0), kicked(9.0, start_time=1.7e9)
    times = sample_grid(0.0, 0.5, 0.002)
    run, later = here.advance(0.5, times), there.advance(1.7e9 + 0.5, 1.7e9 + times)
    np.testing.assert_allclose(later.state, run.state, atol=1e-3 * abs(run.state).max())


def test_changes_take_effect_at_the_current_time_and_leave_the_state():
    simulation = kicked(9.0)
    before = simulation.advance(0.3, [0.3])
    state = simulation.state
    np.testing.assert_array_equal(before.state[0], state)
    stiffer = changed(GEAR, damper_linkage_stiffness=7e4)
    weak = Damper(1.0, 3.0, 4.0)
    simulation.set_velocity(55.0)
    simulation.set_damper(weak)
    simulation.set_gear(stiffer)
    np.testing.assert_array_equal(simulation.state, state)
    assert (simulation.taxi_velocity, simulation.damper, simulation.gear) == (55.0, weak, stiffer)
    fresh = Simulation(stiffer, weak, 55.0, start_time=0.3)
    fresh.set_state(state)
    times = np.linspace(0.3, 0.5, 101)
    np.testing.assert_allclose(simulation.advance(0.5, times).state,
                               fresh.advance(0.5, times).state,
                               atol=1e-3 * abs(state).max())
    assert simulation.kick(1.5) is None
    assert simulation.state[5] == pytest.approx(simulation.advance(0.5, [0.5]).velocity[0, SWIVEL])


def test_setting_what_is_already_set_changes_nothing():
    plain, fussy = kicked(9.0), kicked(9.0)
    times = sample_grid(0.0, 0.2, 0.001)
    expected = plain.advance(0.2, times)
    start = fussy.advance(0.1, times[:100])
    fussy.set_velocity(40.0)
    fussy.set_damper(Damper(2.0, 10.0, 20.0))
    fussy.set_gear(changed(GEAR, trail=0.08))
    np.testing.assert_array_equal(start.state, expected.state[:100])
    np.testing.assert_array_equal(fussy.advance(0.2, times[100:]).state, expected.state[100:])


def test_more_friction_at_rest_keeps_the_rest_and_less_ends_it():
    simulation = kicked(0.5)
    simulation.advance(5.0)
    assert simulation.at_rest
    held = abs(simulation.advance(5.0, [5.0]).effort[0, SWIVEL])
    simulation.set_damper(changed(DAMPER, coulomb_torque=1.01 * held))
    assert simulation.at_rest
    simulation.set_damper(changed(DAMPER, coulomb_torque=0.5 * held))
    assert not simulation.sticking
    simulation.advance(5.01)
    assert simulation.state[5] != 0.0


def test_without_friction_nothing_sticks():
    simulation = kicked(1.0, damper=Damper(2.0, 10.0, 0.0))
    run = simulation.advance(3.0, sample_grid(0.0, 3.0, 0.001))
    assert not run.effort[:, SWIVEL].any()
    assert run.velocity[:, SWIVEL].all()
    still = Simulation(GEAR, Damper(2.0, 10.0, 0.0), 40.0)
    assert still.at_rest
    assert not still.sticking


def test_a_linear_gear_follows_its_eigenvalues():
    stable = kicked(1.0, 5.0, Damper(2.0, 0.0, 0.0))
    run = stable.advance(3.0, sample_grid(0.0, 3.0, 0.001))
    later = abs(run.position[2000:, SWIVEL]).max()
    assert later < 0.8 * abs(run.position[:1000, SWIVEL]).max()
    growing = kicked(1e-3, 40.0, Damper(2.0, 0.0, 0.0))
    run = growing.advance(0.25, sample_grid(0.0, 0.25, 0.0005))
    peaks = measure_cycles(run.time, run.position[:, SWIVEL]).amplitude
    # 24.73 +- 79.92 i is the unstable pair of eigenvalues at 40 m/s.
    assert peaks[-1] / peaks[-2] == pytest.approx(math.exp(24.73 * 2.0 * math.pi / 79.92), rel=0.02)


def test_below_the_minimum_velocity_the_tyre_stands():
    simulation = kicked(9.0, 0.9, minimum_velocity=1.0)
    assert not simulation.rolling
    run = simulation.advance(0.5, sample_grid(0.0, 0.5, 0.001))
    assert not run.position[:, 3].any()
    assert not run.velocity[:, 3].any()
    simulation.set_velocity(0.1)
    assert simulation.advance(0.6, [0.6]).position[0, 3] == 0.0
    simulation.set_velocity(1.0)
    assert simulation.rolling
    assert simulation.advance(0.7, [0.7]).velocity[0, 3] != 0.0


@pytest.mark.parametrize("name", ["landing_EDW229", "takeoff_SWR137H"])
def test_a_real_run_through_standstill_or_creep(name):
    table = np.loadtxt(resource_directory("config") / "runs" / f"{name}.csv", delimiter=",",
                       skiprows=1, comments="#")
    simulation = Simulation(GEAR, DAMPER, table[0, 1])
    simulation.kick(9.0)
    largest = []
    for start, row, following in zip(table[:-1, 0], table[:-1, 1], table[1:, 0], strict=True):
        simulation.set_velocity(row)
        run = simulation.advance(following, sample_grid(start, following, 0.01))
        assert np.isfinite(run.state).all()
        largest.append(abs(run.position[:, SWIVEL]).max())
    assert max(largest) < 0.25
    assert simulation.sticking
    assert simulation.at_rest


@pytest.mark.parametrize("trough", [0.0, 0.5, 1.0, 3.0])
def test_a_ramp_through_standstill_and_back(trough):
    simulation = kicked(9.0, 73.0)
    times = np.arange(0.0, 8.0, 0.02)
    for now in times:
        half = abs(now - 4.0) / 4.0
        simulation.set_velocity(trough + (73.0 if now < 4.0 else 85.0) * half)
        run = simulation.advance(now + 0.02, sample_grid(now, now + 0.02, 0.002))
        assert abs(run.position[:, :3]).max() < 0.3
        assert np.isfinite(run.velocity).all()
    simulation.kick(9.0)
    simulation.advance(10.0)
    assert not simulation.at_rest


def test_what_leaves_the_range_of_the_model_is_an_error_and_not_a_number():
    simulation = kicked(2.0, 40.0, Damper(0.0, 0.0, 0.0))
    with pytest.raises(SimulationError, match=r"leaves the range of the model, 3\.142 rad, at "):
        simulation.advance(5.0, sample_grid(0.0, 5.0, 0.002))
    stopped = simulation.time
    assert 0.0 < stopped < 1.0
    assert abs(simulation.state[:3]).max() <= ANGLE_LIMIT
    with pytest.raises(SimulationError):
        simulation.advance(stopped + 0.1)
    assert simulation.time == stopped
    simulation.set_state(np.zeros(8))
    simulation.set_damper(DAMPER)
    assert not simulation.advance(stopped + 1.0, [stopped + 1.0]).state.any()


@pytest.mark.parametrize("rate", [1e160, -1e200, 1e308])
def test_a_state_too_fast_to_be_integrated_is_an_error(rate):
    simulation = Simulation(GEAR, DAMPER, 40.0)
    simulation.set_state([0.0, 0.0, 0.0, 0.0, 0.0, 0.0, rate, 0.0])
    with pytest.raises(SimulationError, match=r"moves too fast to be integrated at 0\.000 s"):
        simulation.advance(1e-6, [1e-7])


@given(st.lists(st.floats(-1e308, 1e308), min_size=8, max_size=8))
def test_a_state_beyond_the_range_of_the_model_is_an_error(state):
    simulation = Simulation(GEAR, DAMPER, 40.0)
    simulation.set_state([4.0, *state[1:]])
    with pytest.raises(SimulationError):
        simulation.advance(1e-6, [1e-7])


@pytest.mark.parametrize(("arguments", "reason"), [
    ({"taxi_velocity": -1.0}, r"taxi_velocity is -1, but must be in \[0, 200\] m/s"),
    ({"taxi_velocity": math.nan}, "taxi_velocity is nan"),
    ({"minimum_velocity": 0.0}, r"minimum_velocity is 0, but must be in \[0.01, 50\] m/s"),
    ({"tolerance": 1.0}, "tolerance is 1, but must be in"),
    ({"tolerance": 0.0}, "tolerance is 0, but must be in"),
    ({"start_time": math.inf}, "start_time is inf, but must be in"),
    ({"start_time": "now"}, "start_time is 'now', but must be a number in"),
])
def test_bad_settings_are_refused_by_name(arguments, reason):
    with pytest.raises(ParameterError, match=reason):
        Simulation(GEAR, DAMPER, **arguments)


@pytest.mark.parametrize(("call", "reason"), [
    (lambda s: s.set_velocity(201.0), r"taxi_velocity is 201, but must be in \[0, 200\] m/s"),
    (lambda s: s.set_velocity(None), "taxi_velocity is None"),
    (lambda s: s.kick(math.nan), "swivel_rate is nan, but must be in"),
    (lambda s: s.kick(1e4), r"swivel_rate is 10000, but must be in \[-1000, 1000\] rad/s"),
    (lambda s: s.set_state([0.0] * 7), "must be 8 finite numbers"),
    (lambda s: s.set_state([math.inf] * 8), "must be 8 finite numbers"),
    (lambda s: s.advance(0.1), r"until is 0\.1, but must be in \[0\.2, "),
    (lambda s: s.advance(math.inf), "until is inf"),
    (lambda s: s.advance(0.3, [0.1]), r"run from 0\.1 to 0\.1 s, but .*\[0\.2, 0\.3\]"),
    (lambda s: s.advance(0.3, [0.25, 0.31]), "sample_times run from 0.25 to 0.31 s"),
    (lambda s: s.advance(0.3, [0.26, 0.25]), "must not decrease"),
    (lambda s: s.advance(0.3, [math.nan]), "sample_times run from nan"),
    (lambda s: s.advance(0.3, [[0.25]]), "sample_times has shape"),
])
def test_a_bad_call_is_refused_and_changes_nothing(call, reason):
    spoiled, other = kicked(9.0), kicked(9.0)
    spoiled.advance(0.2)
    other.advance(0.2)
    with pytest.raises(ParameterError, match=reason):
        call(spoiled)
    times = sample_grid(0.2, 0.4, 0.001)
    assert_same(spoiled.advance(0.4, times), other.advance(0.4, times))


def logarithmic(low, high):
    return st.floats(math.log(low), math.log(high)).map(math.exp)


@st.composite
def gears_about_the_reference(draw):
    values = {name: getattr(GEAR, name) * draw(logarithmic(0.3, 3.0)) for name in ranges(Gear)}
    for name in ("trail", "strut_rake", "rolling_gamma"):
        values[name] *= draw(st.sampled_from([-1.0, 0.0, 1.0]))
    values["trail"] *= min(1.0, 0.95 * math.sqrt(values["strut_inertia"] * values["swivel_inertia"])
                           / max(1e-9, abs(values["wheel_mass"] * values["trunnion_to_axle"]
                                           * values["trail"])))
    return Gear(**values)


@st.composite
def gears_of_any_size(draw):
    values = {}
    for name, allowed in ranges(Gear).items():
        size = draw(logarithmic(max(allowed.low, 1e-6), allowed.high))
        values[name] = min(size, allowed.high)
    values["trail"] = draw(st.sampled_from([-1.0, 0.0, 1.0])) * min(
        values["trail"], 0.99 * math.sqrt(values["strut_inertia"] * values["swivel_inertia"])
        / (values["wheel_mass"] * values["trunnion_to_axle"]))
    return Gear(**values)


def dampers(largest):
    strength = st.one_of(st.just(0.0), logarithmic(1e-3, largest))
    return st.builds(Damper, strength, strength, strength)


def histories(largest):
    return st.lists(st.one_of(
        st.tuples(st.just("set_velocity"), st.floats(0.0, 200.0)),
        st.tuples(st.just("set_damper"), dampers(largest)),
        st.tuples(st.just("kick"), st.floats(-30.0, 30.0)),
    ), min_size=1, max_size=5)


def play(simulation, history, duration):
    """Advance by ``duration`` after every change, as far as the model reaches."""
    runs = []
    with suppress(SimulationError):
        for action, value in history:
            getattr(simulation, action)(value)
            end = simulation.time + duration
            runs.append((simulation.damper, simulation.advance(
                end, sample_grid(simulation.time, end, duration / 50))))
    for _, run in runs:
        assert np.isfinite(run.state).all()
        assert np.isfinite(run.velocity).all()
        assert np.isfinite(run.effort).all()
    return runs


@settings(deadline=None, max_examples=40)
@given(gears_about_the_reference(), dampers(100.0), st.floats(0.0, 200.0), histories(100.0))
def test_no_history_of_a_likely_gear_breaks_the_friction_law(gear, damper, velocity, history):
    for used, run in play(Simulation(gear, damper, velocity), [("kick", 3.0), *history], 0.1):
        friction, rate = run.effort[:, SWIVEL], run.velocity[:, SWIVEL]
        assert (abs(friction) <= used.coulomb_torque * (1.0 + 1e-6)).all()
        slipping = rate != 0.0
        if used.coulomb_torque:
            np.testing.assert_array_equal(
                friction[slipping], -np.copysign(used.coulomb_torque, rate[slipping]))


@settings(deadline=None, max_examples=25)
@given(gears_of_any_size(), dampers(1e6), st.floats(0.0, 200.0), histories(1e6))
def test_no_valid_gear_yields_anything_but_numbers(gear, damper, velocity, history):
    play(Simulation(gear, damper, velocity), [("kick", 3.0), *history], 4e-4)
