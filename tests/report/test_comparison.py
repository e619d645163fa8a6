"""Measured cycles beside the predictions in force."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from shimmy_ros.report.comparison import compare, summary
from shimmy_ros.report.recording import read_recording


@pytest.fixture
def landing(made_up, tmp_path):
    """The recording of a made-up landing."""
    return read_recording(made_up.landing().write(tmp_path / "bag"), made_up.namespace)


def test_cycles_are_measured_and_placed(landing):
    found = compare(landing)
    assert len(found.time) == pytest.approx(3.0 * 10.1, abs=2)
    assert (np.diff(found.time) > 0.0).all()
    np.testing.assert_allclose(found.amplitude, 0.098, rtol=1e-4)
    np.testing.assert_allclose(found.frequency, 10.1, rtol=1e-4)
    np.testing.assert_array_equal(found.predicted_amplitude, 0.1)
    np.testing.assert_allclose(found.predicted_frequency, 10.0, rtol=1e-6)
    # The velocity held since its last sample, at 10 Hz.
    np.testing.assert_array_equal(found.velocity, 60.0 - np.floor(10.0 * found.time + 1e-9))


def test_the_summary_names_range_and_differences(landing):
    found = compare(landing)
    line = summary(found, landing)
    assert "\n" not in line
    assert f"shimmy from {found.velocity.max():.1f} to {found.velocity.min():.1f} m/s" in line
    assert f"{np.degrees(0.098):.1f} deg measured and {np.degrees(0.1):.1f} deg predicted" in line
    assert "2.00 % in amplitude and 1.00 % in frequency" in line
    assert "(50 predictions)" in line


def test_before_the_first_answer_there_is_no_prediction(made_up, tmp_path):
    run = made_up.Run()
    run.velocity(0.0, 40.0)
    run.swivel(np.arange(0.0, 2.0, 0.002), 0.1, 10.0)
    run.answer(1.0, 0.1, 10.0)
    found = compare(read_recording(run.write(tmp_path / "bag"), made_up.namespace))
    before = found.time < 1.0
    assert before.any()
    assert np.isnan(found.predicted_amplitude[before]).all()
    assert (found.predicted_amplitude[~before] == 0.1).all()


def test_a_motion_whose_time_jumps_back_or_stands(made_up, tmp_path):
    run = made_up.Run()
    run.velocity(0.0, 40.0)
    run.answer(0.001, 0.1, 10.0)
    run.swivel(np.arange(0.0, 2.0, 0.002), 0.1, 10.0)
    recording = read_recording(run.write(tmp_path / "bag"), made_up.namespace)
    time, position, rate = recording.response
    whole = compare(recording)
    order = np.r_[500:1000, 0:600, 599, 600:700]
    jumping = replace(recording, response=(time[order], position[order], rate[order]))
    found = compare(jumping)
    assert found.time.size == pytest.approx(9 + 11 + 1, abs=2)
    np.testing.assert_allclose(found.frequency, 10.0, rtol=1e-4)
    np.testing.assert_allclose(found.amplitude, 0.1, rtol=1e-4)
    np.testing.assert_array_equal(found.predicted_amplitude, 0.1)
    # Those before the jump, then those behind it.
    assert (np.diff(found.time) < 0.0).sum() == 1
    assert np.isin(found.time.round(4), whole.time.round(4)).all()


def test_a_run_without_shimmy(made_up, tmp_path):
    run = made_up.Run()
    run.velocity(0.0, 40.0)
    run.answer(0.1, 0.0, np.nan)
    run.swivel(np.arange(0.0, 1.0, 0.002), 1e-4, 10.0)  # too small to be one
    recording = read_recording(run.write(tmp_path / "bag"), made_up.namespace)
    found = compare(recording)
    assert found.time.size == 0
    assert summary(found, recording) == (
        "1 predictions, 0 measured cycles, none of them where a limit cycle was predicted")


def test_answers_that_are_no_ordinary_ones_are_named_and_no_numbers(made_up, tmp_path):
    recording = read_recording(made_up.perilous().write(tmp_path / "bag"), made_up.namespace)
    found = compare(recording)
    line = summary(found, recording)
    assert line.startswith("shimmy from 49.0 to 31.0 m/s, swivel up to 11.5 deg measured and 45.8 ")
    assert "nan" not in line
    assert "inf" not in line
    assert line.endswith(
        "(51 predictions); unbounded for 1.0 s, from 30.0 to 21.0 m/s; beyond the model's limits "
        "for 1.0 s, from 40.0 to 31.0 m/s; not periodic for 1.0 s, from 20.0 to 11.0 m/s; not "
        "converged for 1.0 s, from 10.0 to 0.0 m/s")


def test_a_run_of_nothing_but_unbounded_answers(made_up, tmp_path):
    run = made_up.Run()
    for index in range(11):
        run.velocity(0.1 * index, 40.0)
        run.answer(0.1 * index, np.inf)
    run.swivel(np.arange(0.0, 1.0, 0.002), 0.1, 10.0)
    recording = read_recording(run.write(tmp_path / "bag"), made_up.namespace)
    assert summary(compare(recording), recording) == (
        "11 predictions, 8 measured cycles, none of them where a limit cycle was predicted; "
        "unbounded for 1.0 s, from 40.0 to 40.0 m/s")


def test_an_empty_run(made_up, tmp_path):
    recording = read_recording(made_up.Run().write(tmp_path / "bag"), made_up.namespace)
    found = compare(recording)
    assert all(getattr(found, name).size == 0 for name in ("time", "amplitude", "velocity"))
    assert summary(found, recording).startswith("0 predictions, 0 measured cycles")
