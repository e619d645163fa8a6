"""Verdicts as values: their words, their numbers, and what they tell about points nearby."""

import math
from dataclasses import replace

import numpy as np
import pytest

from benchmarks.verdicts.random_gears import random_gear
from shimmy_ros.cycles.limit_cycles import Role, all_cycles
from shimmy_ros.cycles.settings import Settings
from shimmy_ros.cycles.stable_cycle import stable_cycle
from shimmy_ros.cycles.verdict import Excess, Kick, Ladder, Verdict, excesses
from shimmy_ros.gear.matrices import deflection_row
from shimmy_ros.gear.parameter_file import reference_parameters
from shimmy_ros.gear.parameters import Damper, Limits, changed
from shimmy_ros.gear.system import OperatingPoint
from shimmy_ros.ihb.solution import Outcome

GEAR, _ = reference_parameters()
ENVELOPE = np.array([0.01, 0.3, 0.31, 0.02])


def at(velocity, quadratic_damping=10.0, coulomb_torque=20.0, linear_damping=2.0):
    return OperatingPoint(GEAR, Damper(linear_damping, quadratic_damping, coulomb_torque), velocity)


POINT = at(40.0)


def told(outcome, **values):
    if outcome is Outcome.LIMIT_CYCLE:
        values.setdefault("orbit", stable_cycle(POINT).orbit)
    if outcome is Outcome.NOT_PERIODIC:
        values.setdefault("envelope", ENVELOPE)
    return Verdict(POINT, Settings(), outcome, **values)


WORDS = {Outcome.LIMIT_CYCLE: "limit cycle", Outcome.NO_LIMIT_CYCLE: "no limit cycle",
         Outcome.UNBOUNDED: "unbounded", Outcome.NOT_PERIODIC: "not periodic",
         Outcome.NOT_ROLLING: "not rolling", Outcome.NOT_CONVERGED: "did not converge"}


@pytest.mark.parametrize("outcome", Outcome)
def test_the_message_begins_with_the_outcome(outcome):
    verdict = told(outcome, reason="as told")
    assert verdict.message.startswith(WORDS[outcome])
    assert verdict.message.endswith("; as told")
    assert verdict.failed is (outcome is Outcome.NOT_CONVERGED)
    assert verdict.stands is (outcome is Outcome.NOT_ROLLING)


def test_amplitudes_compare_with_limits():
    orbit = stable_cycle(POINT).orbit
    np.testing.assert_array_equal(told(Outcome.LIMIT_CYCLE).amplitude, orbit.amplitude)
    np.testing.assert_array_equal(told(Outcome.LIMIT_CYCLE).peak_velocity, orbit.peak_velocity())
    assert np.all(told(Outcome.NO_LIMIT_CYCLE).amplitude == 0.0)
    assert np.all(told(Outcome.NO_LIMIT_CYCLE).peak_velocity == 0.0)
    assert np.all(np.isposinf(told(Outcome.UNBOUNDED).amplitude))
    assert np.all(np.isposinf(told(Outcome.UNBOUNDED).peak_velocity))
    np.testing.assert_array_equal(told(Outcome.NOT_PERIODIC).amplitude, ENVELOPE)
    assert np.all(np.isnan(told(Outcome.NOT_PERIODIC).peak_velocity))
    for outcome in (Outcome.NOT_ROLLING, Outcome.NOT_CONVERGED):
        assert np.all(np.isnan(told(outcome).amplitude))
        assert told(outcome).amplitude.shape == (4,)


@pytest.mark.parametrize("outcome", Outcome)
def test_only_a_limit_cycle_has_a_frequency_an_error_and_a_residual(outcome):
    verdict = told(outcome)
    values = (verdict.frequency_hz, verdict.error, verdict.residual)
    assert all(math.isnan(value) for value in values) is (outcome is not Outcome.LIMIT_CYCLE)
    assert (len(verdict.stable_cycles) == 1) is (outcome is Outcome.LIMIT_CYCLE)
    if outcome is Outcome.LIMIT_CYCLE:
        assert values == (verdict.orbit.frequency_hz, verdict.orbit.error, verdict.orbit.residual)


def test_what_does_not_go_with_the_outcome_is_refused():
    orbit = stable_cycle(POINT).orbit
    for outcome in Outcome:
        if outcome is not Outcome.LIMIT_CYCLE:
            with pytest.raises(ValueError, match="a limit cycle belongs to"):
                told(outcome, orbit=orbit)
        if outcome is not Outcome.NOT_PERIODIC:
            with pytest.raises(ValueError, match="an envelope belongs to"):
                told(outcome, envelope=ENVELOPE)
    with pytest.raises(ValueError, match="a limit cycle belongs to"):
        told(Outcome.LIMIT_CYCLE, orbit=None)
    with pytest.raises(ValueError, match="an envelope belongs to"):
        told(Outcome.NOT_PERIODIC, envelope=None)


@pytest.mark.parametrize(("values", "words"), [
    ({"rest_is_stable": False}, ["rest is unstable, and any disturbance leads there"]),
    ({"rest_is_stable": False, "kick": Kick(0.0, 0.5)},
     ["rest is unstable, and any disturbance leads there"]),
    ({"rest_is_stable": True, "kick": Kick(0.5, 2.0)},
     ["a kick of the swivel of 2 rad/s leads there, one of 0.5 rad/s dies"]),
    ({"rest_is_stable": True, "kick": Kick(0.0, 0.5)},
     ["a kick of the swivel of 0.5 rad/s leads there"]),
    ({"rest_is_stable": True, "kick": Kick(0.5, 2.0, 30.0)},
     ["a kick of the swivel of 2 rad/s leads there, one of 0.5 rad/s dies",
      "a kick of 30 rad/s grows without bound"])])
def test_the_message_says_which_disturbance_leads_where(values, words):
    verdict = told(Outcome.LIMIT_CYCLE, **values)
    assert verdict.message == "; ".join(
        ["limit cycle: a growing oscillation would reach it", *words])


def test_what_was_not_asked_is_not_said():
    """Whether rest is stable is None where that is not known."""
    assert "rest is unstable" not in told(Outcome.LIMIT_CYCLE).message
    assert "rest is unstable" not in told(Outcome.UNBOUNDED, kick=Kick(0.0, 0.5)).message


def test_the_message_counts_further_cycles():
    orbit = stable_cycle(POINT).orbit
    for further, words in (((), None), ((orbit,), "1 further stable cycle"),
                           ((orbit, orbit), "2 further stable cycles")):
        verdict = told(Outcome.LIMIT_CYCLE, rest_is_stable=False, further=further)
        assert len(verdict.stable_cycles) == 1 + len(further)
        assert (verdict.message.split("; ")[-1] == words) is (words is not None)


def test_excesses_are_measured_against_the_limits():
    orbit = stable_cycle(POINT).orbit
    strut, swivel = orbit.amplitude[:2]
    states = orbit.series.position(np.linspace(0.0, orbit.series.period, 20001))
    tyre = np.abs(deflection_row(GEAR) @ states).max() / GEAR.wheel_radius
    assert excesses(POINT, orbit, Limits()) == ()
    for limits, names in (
            (Limits(swivel=0.999 * swivel), ["swivel"]),
            (Limits(swivel=1.001 * swivel), []),
            (Limits(strut_tilt=0.999 * strut), ["strut_tilt"]),
            (Limits(strut_tilt=1.001 * strut), []),
            (Limits(tyre_deflection=0.999 * tyre), ["tyre_deflection"]),
            (Limits(tyre_deflection=1.001 * tyre), []),
            (Limits(0.5 * swivel, 0.5 * strut, 0.5 * tyre),
             ["strut_tilt", "swivel", "tyre_deflection"])):
        found = excesses(POINT, orbit, limits)
        assert [item.quantity for item in found] == names
        true = {"strut_tilt": strut, "swivel": swivel, "tyre_deflection": tyre}
        for item in found:
            assert item.value == pytest.approx(true[item.quantity], rel=1e-6)
            assert item.limit == getattr(limits, item.quantity)
            assert item.value > item.limit


def test_a_verdict_beyond_the_limits_says_so():
    verdict = stable_cycle(POINT, Settings(limits=Limits(swivel=0.1, tyre_deflection=0.001)))
    assert verdict.outcome is Outcome.LIMIT_CYCLE
    first, second = verdict.excesses
    assert str(first) == f"swivel {verdict.amplitude[1]:.4g} rad > 0.1 rad"
    assert str(second).startswith("tyre deflection ")
    assert str(second).endswith(" > 0.001 wheel radii")
    assert verdict.beyond_limits == f"{first}, {second}"
    assert f"beyond the model's limits: {verdict.beyond_limits}" in verdict.message
    assert stable_cycle(POINT).beyond_limits == ""


def test_of_an_envelope_only_angles_are_compared():
    limits = Limits(swivel=0.2, strut_tilt=0.005, tyre_deflection=1e-6)
    verdict = Verdict(POINT, Settings(limits=limits), Outcome.NOT_PERIODIC, envelope=ENVELOPE)
    assert verdict.excesses == (Excess("strut_tilt", 0.01, 0.005), Excess("swivel", 0.3, 0.2))
    for outcome in (Outcome.NO_LIMIT_CYCLE, Outcome.UNBOUNDED, Outcome.NOT_CONVERGED):
        assert Verdict(POINT, Settings(limits=limits), outcome).excesses == ()


def test_the_numbers_of_an_unstable_cycle_can_be_beyond_the_limits_too():
    outer = next(item.orbit for item in all_cycles(POINT) if item.role is Role.UNSTABLE)
    assert {item.quantity for item in excesses(POINT, outer, Limits())} >= {"swivel"}


# --- ladders ------------------------------------------------------------------------------------

def ladder(point, **values):
    return Ladder(**{"point": point, "estimated": point, "error": 1e-3} | values)


def moved(part):
    """Points at which one parameter differs by a ``part``."""
    damper = POINT.damper
    yield replace(POINT, velocity=(1.0 + part) * POINT.velocity)
    for name in ("linear_damping", "quadratic_damping", "coulomb_torque"):
        yield replace(POINT, damper=changed(
            damper, **{name: (1.0 + part) * getattr(damper, name)}))


def test_a_ladder_tells_about_points_nearby_alone():
    known = ladder(POINT)
    assert known.error_holds_at(POINT)
    assert known.holds_at(POINT)
    for near in (*moved(0.001), *moved(-0.001)):
        assert known.error_holds_at(near)
    for far in (*moved(0.3), *moved(-0.3), replace(POINT, gear=changed(GEAR, trail=0.0801))):
        assert not known.error_holds_at(far)
        assert not known.holds_at(far)


def test_where_kicks_hold_errors_do_and_either_counts_from_where_it_was_found():
    parts = np.linspace(-0.15, 0.15, 61)
    for part in parts:
        for near in moved(part):
            known = ladder(POINT)
            assert known.error_holds_at(near) or not known.holds_at(near)
    here = replace(POINT, velocity=1.06 * POINT.velocity)
    known = ladder(here, estimated=POINT)
    assert known.holds_at(here)
    assert known.error_holds_at(here)
    assert not known.holds_at(POINT)


def test_a_gear_of_equal_numbers_is_the_same_gear():
    assert ladder(POINT).holds_at(replace(POINT, gear=changed(GEAR)))


def test_from_none_of_a_damping_to_some_is_far():
    for name in ("linear_damping", "quadratic_damping"):
        nothing = replace(POINT, damper=changed(POINT.damper, **{name: 0.0}))
        some = replace(POINT, damper=changed(POINT.damper, **{name: 1.0}))
        assert not ladder(nothing).error_holds_at(some)
        assert ladder(nothing).holds_at(nothing)


def test_of_little_friction_a_little_more_is_near():
    bare = replace(POINT, damper=changed(POINT.damper, coulomb_torque=0.0))
    barely = replace(POINT, damper=changed(POINT.damper, coulomb_torque=1e-6))
    much = replace(POINT, damper=changed(POINT.damper, coulomb_torque=5.0))
    assert ladder(bare).holds_at(barely)
    assert not ladder(bare).error_holds_at(much)


def test_a_ladder_is_kept_where_kicks_agree():
    verdict = stable_cycle(POINT)
    known = verdict.ladder
    assert (known.point, known.estimated, known.error) == (POINT, POINT, verdict.error)
    assert stable_cycle(at(40.0, 0.0)).ladder is None
    assert stable_cycle(at(0.5)).ladder is None


def test_two_kicks_that_lead_to_two_cycles_tell_nothing_of_points_nearby():
    verdict = stable_cycle(OperatingPoint(*random_gear("b", 11, 543)))
    assert len(verdict.further) == 1
    assert verdict.ladder is None
