"""Verdicts as the records of the predictor's topics."""

from __future__ import annotations

import math
import pickle
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from shimmy_ros.contract.answers import ANSWER_TOPICS, ORBIT_INTERVALS, answer, findings
from shimmy_ros.contract.messages import CODECS
from shimmy_ros.contract.records import JOINTS, Level
from shimmy_ros.contract.spec import load_contract
from shimmy_ros.cycles.orbits import Orbit, balance_near, shoot
from shimmy_ros.cycles.prediction import Predictor
from shimmy_ros.cycles.settings import BALANCE, SHOOTING, Settings
from shimmy_ros.cycles.verdict import Kick, Verdict
from shimmy_ros.gear.parameter_file import reference_parameters
from shimmy_ros.gear.parameters import Limits, changed
from shimmy_ros.gear.system import OperatingPoint, gear_system
from shimmy_ros.ihb.solution import LimitCycle, Outcome

STAMP_NS = 1_700_000_000_123_456_789
GEAR, DAMPER = reference_parameters()
POINT = OperatingPoint(GEAR, DAMPER, 40.0)


SETTINGS = Settings()


def predicted(velocity=40.0, **damper):
    return Predictor().predict(OperatingPoint(GEAR, changed(DAMPER, **damper), velocity))


def with_orbit(orbit, point=POINT, **values):
    """A limit cycle as a verdict."""
    values = {"settings": SETTINGS} | values
    return Verdict(point, outcome=Outcome.LIMIT_CYCLE, orbit=orbit, **values)


def without_orbit(outcome, **values):
    """Any other verdict."""
    return Verdict(POINT, SETTINGS, outcome, reason="the reason", **values)


def by_balance(velocity, harmonics):
    """The limit cycle of the balance with so many harmonics, or, with 0, that of shooting."""
    point = replace(POINT, velocity=velocity)
    orbit, system = Predictor().predict(point).orbit, gear_system(point)
    found = (balance_near(system, orbit, harmonics) if harmonics
             else shoot(system, *orbit.initial_state()))
    return with_orbit(found, point, work=3)


def of(verdict, **settings):
    """Amplitude, frequency, orbit and the one status of an answer."""
    records = answer(findings(verdict), STAMP_NS, "a gear", **settings)
    assert tuple(records) == ANSWER_TOPICS
    assert {topic.name for topic in load_contract().published_by("predictor")} - set(records) == {
        "what_if/answer", "/diagnostics"}
    (status,) = records["limit_cycle/status"]
    for record in (records["limit_cycle/amplitude"], records["limit_cycle/orbit"], status):
        assert record.stamp_ns == STAMP_NS
    return (records["limit_cycle/amplitude"], records["limit_cycle/frequency"],
            records["limit_cycle/orbit"], status)


def assert_orbit_of(cycle, orbit):
    """The orbit is one period of the cycle."""
    assert len(orbit.times_ns) == ORBIT_INTERVALS + 1
    assert orbit.times_ns[0] == 0
    assert orbit.times_ns[-1] == round(1e9 * cycle.period)
    assert np.ptp(np.diff(orbit.times_ns)) <= 1
    time_s = np.linspace(0.0, cycle.period, ORBIT_INTERVALS + 1)
    for sampled, exact, peaks in (
            (orbit.positions, cycle.position(time_s), cycle.amplitude()),
            (orbit.velocities, cycle.velocity(time_s), cycle.peak_velocity())):
        np.testing.assert_allclose(sampled / peaks, exact.T / peaks, rtol=0.0, atol=1e-11)
        assert (np.abs(sampled) <= peaks * (1.0 + 1e-12)).all()


@pytest.mark.parametrize("harmonics", [1, 4, 9, 0])
@pytest.mark.parametrize("velocity", [12.0, 60.0])
def test_a_limit_cycle(velocity, harmonics):
    verdict = by_balance(velocity, harmonics)
    amplitude, frequency, orbit, status = of(verdict, solve_time_s=0.0125)
    cycle = verdict.orbit
    assert amplitude.position == tuple(cycle.amplitude)
    assert amplitude.velocity == tuple(cycle.peak_velocity())
    assert frequency == pytest.approx(cycle.frequency_hz, rel=1e-15)
    assert_orbit_of(cycle.series, orbit)
    assert (status.name, status.hardware_id) == ("predictor: limit cycle", "a gear")
    assert (status.level, status.message) == (Level.OK, verdict.message)
    assert status.message.startswith("limit cycle: a growing oscillation would reach it")
    assert status.values == {
        "outcome": "limit_cycle", "taxi_velocity": repr(velocity), "linear_damping": "2.0",
        "quadratic_damping": "10.0", "coulomb_torque": "20.0",
        "method": BALANCE if harmonics else SHOOTING, "harmonics": str(harmonics or 4),
        "work": "3", "residual": repr(cycle.residual), "start": "cold", "beyond_limits": "",
        "further_stable_cycles": "0", "rest": "", "solve_time": "0.0125"}


def test_the_orbit_of_shooting_reaches_its_peaks():
    verdict = by_balance(12.0, 0)
    amplitude, _, orbit, _ = of(verdict)
    for sampled, peaks in ((orbit.positions, amplitude.position),
                           (orbit.velocities, amplitude.velocity)):
        highest = np.abs(sampled).max(axis=0)
        assert (0.98 * np.array(peaks) < highest).all()
        assert (highest < 1.02 * np.array(peaks)).all()


@settings(deadline=None)
@given(arrays(float, (4, 6), elements=st.floats(-1.0, 1.0)), st.floats(1.0, 1e3))
def test_any_cycle_gives_its_orbit(coefficients, frequency):
    # Far below the others, an amplitude is rounding and the relative comparison has no meaning.
    coefficients = coefficients + np.eye(4, 6)
    cycle = LimitCycle(coefficients, frequency, 1)
    if cycle.amplitude().min() < 1e-3 or cycle.peak_velocity().min() < 1e-3 * frequency:
        return
    orbit = Orbit(BALANCE, cycle.amplitude(), cycle.frequency_hz, True, 0.5, False, lambda: 0.0,
                  3, cycle)
    assert_orbit_of(cycle, of(with_orbit(orbit))[2])


def test_beyond_the_limits_of_the_model_an_answer_is_marked():
    cycle = predicted().orbit
    limits = Limits(swivel=0.1, strut_tilt=0.01, tyre_deflection=0.05)
    verdict = with_orbit(cycle, settings=Settings(limits=limits))
    swivel, tilt = cycle.amplitude[1], cycle.amplitude[0]
    amplitude, frequency, orbit, status = of(verdict)
    assert status.level == Level.WARN
    assert status.values["outcome"] == "limit_cycle"
    beyond = status.values["beyond_limits"]
    assert f"swivel {swivel:.4g} rad > 0.1 rad" in beyond.split(", ")
    assert f"strut tilt {tilt:.4g} rad > 0.01 rad" in beyond.split(", ")
    assert beyond.split(", ")[2].startswith("tyre deflection 0.")
    assert beyond.endswith(" > 0.05 wheel radii")
    assert status.message.endswith(f"; beyond the model's limits: {beyond}")
    # The numbers are those of the limit cycle all the same.
    assert amplitude.position == tuple(cycle.amplitude)
    assert frequency == pytest.approx(cycle.frequency_hz, rel=1e-15)
    assert len(orbit.times_ns) == ORBIT_INTERVALS + 1


def test_a_limit_cycle_at_its_limits_is_within_them():
    cycle = predicted().orbit
    limits = Limits(swivel=float(cycle.amplitude[1]), strut_tilt=float(cycle.amplitude[0]))
    *_, status = of(with_orbit(cycle, settings=Settings(limits=limits)))
    assert (status.level, status.values["beyond_limits"]) == (Level.OK, "")


@pytest.mark.parametrize(("stable", "word"), [(True, "stable"), (False, "unstable"), (None, "")])
def test_further_cycles_and_the_stability_of_rest_are_told(stable, word):
    cycle = predicted().orbit
    *_, status = of(with_orbit(cycle, further=(cycle, cycle), rest_is_stable=stable,
                               kick=Kick(0.5, 0.6)))
    assert (status.values["further_stable_cycles"], status.values["rest"]) == ("2", word)


def test_a_warm_start_is_told():
    predictor = Predictor()
    predictor.predict(POINT)
    *_, status = of(predictor.predict(replace(POINT, velocity=41.0)))
    assert status.values["start"] == "warm"


def test_no_limit_cycle():
    amplitude, frequency, orbit, status = of(predicted(coulomb_torque=900.0))
    assert amplitude.position == amplitude.velocity == (0.0,) * 4
    assert math.isnan(frequency)
    assert orbit.positions.shape == orbit.velocities.shape == (0, len(JOINTS))
    assert (status.level, status.values["outcome"]) == (Level.OK, "no_limit_cycle")
    assert status.values["coulomb_torque"] == "900.0"


def test_not_rolling():
    amplitude, frequency, orbit, status = of(predicted(0.25))
    assert all(math.isnan(value) for value in (*amplitude.position, *amplitude.velocity, frequency))
    assert len(orbit.times_ns) == 0
    assert (status.level, status.values["outcome"]) == (Level.WARN, "not_rolling")
    assert status.values["taxi_velocity"] == "0.25"
    assert "0.25 m/s" in status.message


def test_motion_without_bound_trips_every_threshold():
    amplitude, frequency, orbit, status = of(without_orbit(Outcome.UNBOUNDED))
    assert amplitude.position == amplitude.velocity == (math.inf,) * 4
    assert math.isnan(frequency)
    assert len(orbit.times_ns) == 0
    assert status.level == Level.ERROR
    assert status.message.startswith("unbounded: ")
    assert (status.values["outcome"], status.values["method"]) == ("unbounded", "")


@pytest.mark.parametrize(("swivel", "level", "beyond"), [
    (0.2, Level.WARN, ""), (0.75, Level.WARN, "swivel 0.75 rad > 0.5 rad")])
def test_motion_that_is_not_periodic_has_bounds(swivel, level, beyond):
    envelope = np.array([0.05, swivel, 0.3, 0.04])
    amplitude, frequency, orbit, status = of(
        without_orbit(Outcome.NOT_PERIODIC, envelope=envelope))
    assert amplitude.position == (0.05, swivel, 0.3, 0.04)
    assert all(math.isnan(value) for value in (*amplitude.velocity, frequency))
    assert len(orbit.times_ns) == 0
    assert (status.level, status.values["outcome"]) == (level, "not_periodic")
    assert status.values["beyond_limits"] == beyond


def test_a_failure_is_no_answer():
    amplitude, frequency, orbit, status = of(
        without_orbit(Outcome.NOT_CONVERGED, work=50))
    assert all(math.isnan(value) for value in (*amplitude.position, *amplitude.velocity, frequency))
    assert len(orbit.times_ns) == 0
    assert (status.level, status.message) == (Level.ERROR, "did not converge; the reason")
    assert status.values["outcome"] == "not_converged"
    assert (status.values["work"], status.values["residual"]) == ("50", "nan")


def test_amplitudes_are_zero_for_no_limit_cycle_alone():
    for outcome in set(Outcome) - {Outcome.LIMIT_CYCLE, Outcome.NO_LIMIT_CYCLE}:
        envelope = np.full(4, 0.1) if outcome is Outcome.NOT_PERIODIC else None
        amplitude, *_ = of(without_orbit(outcome, envelope=envelope))
        assert all(value != 0.0 for value in (*amplitude.position, *amplitude.velocity)), outcome


def test_findings_are_plain_values_for_another_process():
    verdicts = [with_orbit(predicted(7.2).orbit, further=(predicted().orbit,)),
                without_orbit(Outcome.UNBOUNDED), predicted(0.25)]
    for found in map(findings, verdicts):
        data = pickle.dumps(found)
        assert b"shimmy_ros.cycles" not in data
        assert b"shimmy_ros.ihb" not in data
        back = pickle.loads(data)
        assert (back.outcome, back.values, back.level) == (found.outcome, found.values, found.level)
        assert repr(back.amplitude) == repr(found.amplitude)
        assert all(type(value) is float for value in (*found.amplitude, *found.peak_velocity))


def test_the_estimated_error_is_not_computed():
    def fail():
        pytest.fail("the error was asked for")

    cycle = replace(predicted().orbit, estimate=fail)
    of(with_orbit(cycle))


TEXTS = {"outcome", "method", "start", "beyond_limits", "rest"}


@pytest.mark.parametrize("verdict", [
    predicted(), predicted(0.5), predicted(coulomb_torque=900.0), predicted(7.2),
    without_orbit(Outcome.UNBOUNDED), without_orbit(Outcome.NOT_CONVERGED),
    without_orbit(Outcome.NOT_PERIODIC, envelope=np.full(4, 0.1))],
    ids=lambda verdict: verdict.outcome.value)
def test_every_answer_can_be_sent_and_its_numbers_parse(verdict):
    for name, record in answer(findings(verdict), STAMP_NS, "a gear").items():
        back = CODECS[name].decode(CODECS[name].encode(record))
        if name == "limit_cycle/status":
            assert back == record
            for key in set(record[0].values) - TEXTS:
                float(back[0].values[key])
        elif name == "limit_cycle/amplitude":
            np.testing.assert_array_equal(back.position, record.position)
            np.testing.assert_array_equal(back.velocity, record.velocity)
