"""Cycles from a stream are the cycles of the whole."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from shimmy_ros.report import matching
from shimmy_ros.report.comparison import SMALLEST_SWIVEL_RAD
from shimmy_ros.report.matching import LONGEST_CYCLE_S, Matcher, Sample
from shimmy_ros.simulation.measurement import measure_cycles


def matched(time, position, rate, velocity=None):
    """Amplitude, frequency and velocity of the cycles of a stream, at their middles."""
    matcher = Matcher()
    velocity = np.zeros_like(time) if velocity is None else velocity
    found = []
    for row in zip(time, position, rate, velocity, strict=True):
        found += matcher.add(Sample(*row, row[3] + 1.0, row[3] + 2.0, row[3] + 3.0))
    found += matcher.finish()
    columns = ("time", "velocity", "amplitude", "frequency", "predicted_amplitude",
               "predicted_frequency", "kind")
    return {name: np.concatenate([np.zeros(0), *(getattr(part, name) for part in found)])
            for name in columns}, matcher


def sweep(seconds=30.0, rate_hz=400.0):
    """A sine whose amplitude and frequency wander."""
    time = np.arange(0.0, seconds, 1.0 / rate_hz)
    phase = 2.0 * math.pi * (12.0 * time + 3.0 * np.sin(time / 3.0))
    phase_rate = 2.0 * math.pi * (12.0 + np.cos(time / 3.0))
    amplitude, change = 0.05 + 0.03 * np.sin(time), 0.03 * np.cos(time)
    return time, amplitude * np.sin(phase), (
        change * np.sin(phase) + amplitude * phase_rate * np.cos(phase))


@pytest.mark.parametrize("block", [600, 4800, 10**6])
def test_a_stream_has_the_cycles_of_the_whole(monkeypatch, block):
    monkeypatch.setattr(matching, "_BLOCK", block)
    time, position, rate = sweep()
    whole = measure_cycles(time, position, rate, smallest=SMALLEST_SWIVEL_RAD)
    found, matcher = matched(time, position, rate, time)
    assert matcher.skipped == 0
    assert np.array_equal(found["time"], 0.5 * (whole.start + whole.end))
    assert np.array_equal(found["amplitude"], whole.amplitude)
    assert np.array_equal(found["frequency"], whole.frequency)
    # What was in force: the values of the last sample before the middle of the cycle.
    behind = found["time"] - found["velocity"]
    assert ((behind >= 0.0) & (behind <= 1.0 / 400.0 + 1e-9)).all()
    assert np.array_equal(found["predicted_amplitude"], found["velocity"] + 1.0)
    assert np.array_equal(found["predicted_frequency"], found["velocity"] + 2.0)
    assert np.array_equal(found["kind"], found["velocity"] + 3.0)


def test_unknown_rates_are_taken_from_a_spline(monkeypatch):
    monkeypatch.setattr(matching, "_BLOCK", 3000)
    time, position, rate = sweep()
    known, _ = matched(time, position, rate)
    found, _ = matched(time, position, np.full_like(rate, math.nan))
    assert found["time"].size == known["time"].size
    assert np.allclose(found["amplitude"], known["amplitude"], rtol=1e-3)
    assert np.allclose(found["frequency"], known["frequency"], rtol=1e-3)


@settings(max_examples=25, deadline=None)
@given(rests=st.lists(st.floats(1.1, 30.0), max_size=2), block=st.sampled_from([300, 5000]),
       quiet=st.floats(0.0, 0.9 * SMALLEST_SWIVEL_RAD))
def test_rests_are_no_cycles(rests, block, quiet):
    bursts = [sweep(3.0, 200.0)]
    for rest in rests:
        time, position, rate = bursts[-1]
        burst = sweep(3.0, 200.0)
        still = np.arange(time[-1] + 0.005, time[-1] + rest, 0.005)
        bursts.append((still, quiet * np.sin(3.0 * still), 3.0 * quiet * np.cos(3.0 * still)))
        bursts.append((still[-1] + 0.005 + burst[0], *burst[1:]))
    time, position, rate = (np.concatenate(columns) for columns in zip(*bursts, strict=True))
    whole = measure_cycles(time, position, rate, smallest=SMALLEST_SWIVEL_RAD)
    short = whole.end - whole.start <= LONGEST_CYCLE_S
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(matching, "_BLOCK", block)
        found, _ = matched(time, position, rate)
    assert np.array_equal(found["time"], (0.5 * (whole.start + whole.end))[short])
    assert np.array_equal(found["amplitude"], whole.amplitude[short])
    assert (~short).sum() <= len(rests)


def test_memory_does_not_grow(monkeypatch):
    monkeypatch.setattr(matching, "_BLOCK", 6000)
    matcher = Matcher()
    largest = 0
    for number in range(30_000):
        # Never below zero: no cycle is ever complete.
        for _ in matcher.add(Sample(0.01 * number, 0.1, 0.0, 0.0, 0.0, 0.0, 0.0)):
            pass
        largest = max(largest, len(matcher._values))
    assert largest <= 6000 + 7 * (2 * 100 + 1)


def test_time_that_jumps_back_begins_anew():
    time, position, rate = sweep(2.0)
    once, _ = matched(time, position, rate)
    twice, _ = matched(np.tile(time, 2), np.tile(position, 2), np.tile(rate, 2))
    assert np.array_equal(twice["amplitude"], np.tile(once["amplitude"], 2))


def test_useless_samples_are_skipped():
    time, position, rate = sweep(2.0)
    clean, _ = matched(time, position, rate)
    spoilt = [np.insert(column, 100, value) for column, value in
              zip((time, position, rate), (time[99] + 1e-6, math.nan, 0.0), strict=True)]
    spoilt = [np.insert(column, 200, column[199]) for column in spoilt]
    found, matcher = matched(*spoilt)
    assert matcher.skipped == 2
    assert np.array_equal(found["amplitude"], clean["amplitude"])
    assert matched(np.zeros(0), np.zeros(0), np.zeros(0))[0]["time"].size == 0
