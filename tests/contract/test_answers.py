"""Predictions as the records of the predictor's topics."""

from __future__ import annotations

import math
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
from shimmy_ros.cycles.prediction import Prediction, Predictor
from shimmy_ros.gear.parameter_file import reference_parameters
from shimmy_ros.gear.parameters import changed
from shimmy_ros.gear.system import OperatingPoint
from shimmy_ros.ihb.solution import LimitCycle, Outcome

STAMP_NS = 1_700_000_000_123_456_789
GEAR, DAMPER = reference_parameters()
POINT = OperatingPoint(GEAR, DAMPER, 40.0)


def predicted(velocity=40.0, harmonics=4, **damper):
    return Predictor(harmonics).predict(
        OperatingPoint(GEAR, changed(DAMPER, **damper), velocity))


def of(prediction, **settings):
    """Amplitude, frequency, orbit and the one status of an answer."""
    records = answer(findings(prediction), STAMP_NS, "a gear", **settings)
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


@pytest.mark.parametrize("harmonics", [1, 4, 9])
@pytest.mark.parametrize("velocity", [12.0, 60.0])
def test_a_limit_cycle(velocity, harmonics):
    prediction = predicted(velocity, harmonics)
    amplitude, frequency, orbit, status = of(prediction, solve_time_s=0.0125)
    cycle = prediction.limit_cycle
    assert amplitude.position == tuple(cycle.amplitude())
    assert amplitude.velocity == tuple(cycle.peak_velocity())
    assert frequency == cycle.frequency_hz
    assert_orbit_of(cycle, orbit)
    assert (status.name, status.hardware_id) == ("predictor: limit cycle", "a gear")
    assert (status.level, status.message) == (Level.OK, prediction.message)
    assert status.values == {
        "outcome": "limit_cycle", "taxi_velocity": repr(velocity), "linear_damping": "2.0",
        "quadratic_damping": "10.0", "coulomb_torque": "20.0", "harmonics": str(harmonics),
        "iterations": str(prediction.iterations), "residual": repr(prediction.residual),
        "start": "cold", "solve_time": "0.0125"}


@settings(deadline=None)
@given(arrays(float, (4, 6), elements=st.floats(-1.0, 1.0)), st.floats(1.0, 1e3))
def test_any_cycle_gives_its_orbit(coefficients, frequency):
    # Far below the others, an amplitude is rounding and the relative comparison has no meaning.
    coefficients = coefficients + np.eye(4, 6)
    cycle = LimitCycle(coefficients, frequency, 1)
    prediction = Prediction(POINT, 3, "limit_cycle", cycle, 4, 1e-14, False, "found")
    if cycle.amplitude().min() < 1e-3 or cycle.peak_velocity().min() < 1e-3 * frequency:
        return
    assert_orbit_of(cycle, of(prediction)[2])


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


def test_a_failure_is_no_answer():
    failed = Prediction(POINT, 4, Outcome.FAILED.value, None, 50, 0.01, False, "the residual stays")
    amplitude, frequency, orbit, status = of(failed)
    assert all(math.isnan(value) for value in (*amplitude.position, *amplitude.velocity, frequency))
    assert len(orbit.times_ns) == 0
    assert (status.level, status.message) == (Level.ERROR, "the residual stays")
    assert status.values["outcome"] == "not_converged"
    assert (status.values["iterations"], status.values["residual"]) == ("50", "0.01")


@pytest.mark.parametrize(("velocity", "torque"), [(40.0, 20.0), (0.5, 20.0), (40.0, 900.0)],
                         ids=["limit cycle", "not rolling", "no limit cycle"])
def test_every_answer_can_be_sent_and_its_numbers_parse(velocity, torque):
    prediction = predicted(velocity, coulomb_torque=torque)
    for name, record in answer(findings(prediction), STAMP_NS, "a gear").items():
        back = CODECS[name].decode(CODECS[name].encode(record))
        if name == "limit_cycle/status":
            assert back == record
            for key in set(record[0].values) - {"outcome", "start"}:
                float(back[0].values[key])
        elif name == "limit_cycle/amplitude":
            np.testing.assert_array_equal(back.position, record.position)
            np.testing.assert_array_equal(back.velocity, record.velocity)
