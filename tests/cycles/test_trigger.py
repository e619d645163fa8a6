"""The smallest disturbances that start shimmy, against simulation by other means."""

import functools
import math

import numpy as np
import pytest

from shimmy_ros.cycles.limit_cycles import Role
from shimmy_ros.cycles.settings import Settings
from shimmy_ros.cycles.stable_cycle import stable_cycle
from shimmy_ros.cycles.trigger import (
    Leads,
    Start,
    TriggerError,
    _Fate,
    _Held,
    _Motion,
    _smallest,
    held_shape,
    trigger,
)
from shimmy_ros.cycles.verdict import Kick, Verdict
from shimmy_ros.gear.matrices import SWIVEL, stiffness_matrix
from shimmy_ros.gear.parameter_file import reference_parameters
from shimmy_ros.gear.parameters import changed
from shimmy_ros.gear.system import OperatingPoint, gear_system
from shimmy_ros.ihb.solution import Outcome
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
    dies, starts, leads_to = found.kick
    assert leads_to is found.release_angle.leads_to is Leads.CYCLE
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


def verdict(point, outcome, **values):
    return Verdict(point, Settings(), outcome, **values)


def test_what_is_known_is_not_sought_again():
    assert trigger(REFERENCE, [], verdict(REFERENCE, Outcome.NO_LIMIT_CYCLE)).start is (
        Start.NOTHING)
    with pytest.raises(TriggerError, match="as told"):
        trigger(REFERENCE, [], verdict(REFERENCE, Outcome.NOT_CONVERGED, reason="as told"))


def test_without_the_trigger_cycle_the_kick_is_the_verdicts():
    orbit = stable_cycle(REFERENCE).orbit
    known = verdict(REFERENCE, Outcome.LIMIT_CYCLE, orbit=orbit, kick=Kick(0.5, 0.51, 90.0))
    found = trigger(REFERENCE, [], known)
    assert found.start is Start.DISTURBANCE
    assert found.kick == (0.5, 0.51, Leads.CYCLE)
    assert found.cycle is found.release_angle is None
    assert "the cycle between rest and shimmy was not found" in found.message
    assert found.message.endswith("a kick of 90 rad/s grows without bound")
    with pytest.raises(TriggerError, match="the cycle between rest and shimmy was not found"):
        trigger(REFERENCE, [], verdict(REFERENCE, Outcome.LIMIT_CYCLE, orbit=orbit))


def test_growth_without_bound_is_started_by_a_disturbance_as_well():
    """Without quadratic damping nothing shimmies, and kicks that do not die grow for ever."""
    point = at(40.0, 0.0, 20.0)
    unbounded = verdict(point, Outcome.UNBOUNDED)
    found = trigger(point, None, unbounded)
    assert found.start is Start.DISTURBANCE
    assert found.cycle.role is Role.TRIGGER
    assert found.kick.leads_to is found.release_angle.leads_to is Leads.GROWTH
    assert found.message.startswith(
        "nothing shimmies, but growth without bound is started by a kick of 0.4815 rad/s")
    assert "leaves the range of the model" in found.message
    # The same without a cycle to tell from.
    known = verdict(point, Outcome.UNBOUNDED, kick=Kick(0.4, 0.6))
    again = trigger(point, [], known)
    assert again.cycle is None
    assert again.kick.starts == pytest.approx(found.kick.starts, rel=2e-4)
    assert again.kick.leads_to is Leads.GROWTH
    grows = verdict(at(40.0, 0.0, 0.0), Outcome.UNBOUNDED)
    assert trigger(grows.point, None, grows).message.endswith(
        "rest is unstable, and any disturbance grows without bound")


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


def test_a_disturbance_that_leaves_the_range_does_not_die():
    def follow(size):
        return (_Motion(_Fate.LEAVES, math.inf, Leads.GROWTH) if size > 5.0
                else _Motion(_Fate.DIES, 0.0))

    found = _smallest(follow, 0.0, 1.0, 100.0, 1.0)
    assert found.dies <= 5.0 < found.starts < 5.0006
    assert found.leads_to is Leads.GROWTH
    # Smaller ones that start shimmy come first.
    found = _smallest(lambda size: _Motion(_Fate.STARTS, math.inf) if 2.0 < size < 3.0
                      else follow(size), 0.0, 1.0, 100.0, 1.0)
    assert found.starts == pytest.approx(2.0, rel=2e-4)
    assert found.leads_to is Leads.CYCLE
