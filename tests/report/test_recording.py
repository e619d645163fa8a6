"""Bags read as arrays."""

from __future__ import annotations

import math

import numpy as np
import pytest

from shimmy_ros.bag.errors import BagError
from shimmy_ros.report.kinds import beyond_of, outcome_of
from shimmy_ros.report.recording import read_recording


def test_a_run_is_read_from_its_first_velocity(made_up, tmp_path):
    recording = read_recording(made_up.landing().write(tmp_path / "bag"), made_up.namespace)
    times, velocities = recording.velocity
    np.testing.assert_allclose(times, 0.1 * np.arange(50), atol=1e-9)
    assert velocities[0] == 0.0
    assert velocities[10] == 50.0
    times, positions, rates = recording.response
    np.testing.assert_allclose(times, np.arange(1.0, 4.0, 0.002), atol=1e-9)
    assert positions.shape == rates.shape == (len(times), 4)
    assert np.abs(positions[:, 1]).max() == pytest.approx(0.098, rel=1e-3)
    assert (positions[:, 3] == 0.03).all()
    times, amplitudes, frequencies, kinds = recording.predictions
    np.testing.assert_allclose(times, 0.1 * np.arange(50) + 0.003, atol=1e-9)
    assert list(map(outcome_of, kinds)) == (
        10 * ["not_rolling"] + 30 * ["limit_cycle"] + 10 * ["no_limit_cycle"])
    assert np.isnan(amplitudes[:10]).all()
    assert (amplitudes[10:40] == 0.1).all()
    assert (amplitudes[40:] == 0.0).all()
    np.testing.assert_allclose(frequencies[10:40], 10.0, rtol=1e-6)
    assert np.isnan(frequencies[:10]).all()
    assert np.isnan(frequencies[40:]).all()
    assert recording.damper_changes == (
        (pytest.approx(2.0), "damper/coulomb_torque", 15.0),
        (pytest.approx(2.001), "damper/quadratic_damping", 20.0))
    assert recording.outcomes == {"not_rolling": 10, "limit_cycle": 30, "no_limit_cycle": 10}
    assert recording.damage == ()


def test_an_answer_to_a_change_of_the_damper_is_placed_at_its_own_time(made_up, tmp_path):
    run = made_up.Run()
    run.velocity(0.0, 40.0)
    run.answer(0.01, 0.1, 10.0, sample_s=0.0)
    run.answer(0.50, 0.2, 9.0, sample_s=0.0)
    run.answer(0.51, 0.3, 8.0, sample_s=0.0)
    recording = read_recording(run.write(tmp_path / "bag"), made_up.namespace)
    times, amplitudes, frequencies, _ = recording.predictions
    np.testing.assert_allclose(times, [0.01, 0.5, 0.51], atol=1e-9)
    assert amplitudes.tolist() == [0.1, 0.2, 0.3]
    np.testing.assert_allclose(frequencies, [10.0, 9.0, 8.0], rtol=1e-6)


@pytest.mark.parametrize("missed", ["limit_cycle/amplitude", "limit_cycle/orbit",
                                    "limit_cycle/status"])
def test_what_was_missed_of_one_topic_does_not_shift_another(made_up, tmp_path, missed):
    run = made_up.Run()
    run.velocity(0.0, 40.0)
    run.answer(0.01, 0.1, 10.0, missed=[missed])
    run.answer(0.02, 0.2, 9.0, sample_s=0.02, missed=[missed])
    run.answer(0.03, 0.3, 8.0, sample_s=0.02)
    run.answer(0.04, 0.4, 7.0)
    recording = read_recording(run.write(tmp_path / "bag"), made_up.namespace)
    _, amplitudes, frequencies, _ = recording.predictions
    assert amplitudes.tolist() == [0.3, 0.4]
    np.testing.assert_allclose(frequencies, [8.0, 7.0], rtol=1e-6)


def test_every_kind_of_answer_is_told_from_the_others(made_up, tmp_path):
    recording = read_recording(made_up.perilous().write(tmp_path / "bag"), made_up.namespace)
    _, amplitudes, frequencies, kinds = recording.predictions
    assert list(map(outcome_of, kinds[::10])) == [
        "limit_cycle", "limit_cycle", "unbounded", "not_periodic", "not_converged",
        "not_converged"]
    assert list(map(beyond_of, kinds[::10])) == ["no", "yes", "no", "no", "no", "no"]
    assert repr(amplitudes[::10].tolist()) == "[0.1, 0.8, inf, 0.3, nan, nan]"
    assert np.isfinite(frequencies).sum() == 20
    assert recording.outcomes == {"limit_cycle": 20, "unbounded": 10, "not_periodic": 10,
                                  "not_converged": 11}


def test_an_outcome_that_is_not_known_is_none(made_up, tmp_path):
    run = made_up.Run()
    run.velocity(0.0, 40.0)
    run.answer(0.1, 0.0, outcome="something_new")
    recording = read_recording(run.write(tmp_path / "bag"), made_up.namespace)
    (kind,) = recording.predictions[3]
    assert (outcome_of(kind), beyond_of(kind)) == ("", "")
    assert recording.outcomes == {"something_new": 1}


def test_another_namespace_is_another_run(made_up, tmp_path):
    recording = read_recording(made_up.landing().write(tmp_path / "bag"), "/elsewhere")
    assert recording.velocity[0].size == recording.response[0].size == 0
    assert recording.response[1].shape == (0, 4)
    assert recording.predictions[0].size == 0
    assert recording.outcomes == {}


def test_a_cut_bag_is_read_as_far_as_it_goes(made_up, tmp_path):
    bag = made_up.landing().write(tmp_path / "bag", close=True)
    (file,) = bag.glob("*.mcap")
    data = file.read_bytes()
    file.write_bytes(data[:len(data) // 2])
    (bag / "metadata.yaml").unlink()
    recording = read_recording(bag, made_up.namespace)
    assert 0 < len(recording.response[0]) < 1500
    assert len(recording.damage) == 1
    assert all(math.isfinite(time) for time in recording.response[0])


def test_no_bag(tmp_path):
    with pytest.raises(BagError, match="does not exist"):
        read_recording(tmp_path / "nothing", "/shimmy")
