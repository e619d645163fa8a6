import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from shimmy_ros.simulation.measurement import measure_cycles


def shimmy(time, frequency, amplitude=0.1, third=0.02, phase=0.0):
    """A fundamental with some third harmonic, its rate, and its exact peak."""
    angular = 2.0 * np.pi * frequency
    angle = angular * time + phase
    position = amplitude * (np.sin(angle) + third * np.sin(3.0 * angle))
    rate = amplitude * angular * (np.cos(angle) + 3.0 * third * np.cos(3.0 * angle))
    turn = np.linspace(0.0, np.pi, 200001)
    return position, rate, amplitude * np.max(np.sin(turn) + third * np.sin(3.0 * turn))


@given(st.floats(7.0, 20.0), st.floats(0.0, 6.0), st.floats(-0.03, 0.03), st.booleans())
def test_amplitude_and_frequency_at_500_hz(frequency, phase, third, with_rate):
    time = np.arange(500) * 0.002
    position, rate, peak = shimmy(time, frequency, 0.1, third, phase)
    cycles = measure_cycles(time, position, rate if with_rate else None)
    assert len(cycles.amplitude) >= int(frequency) - 2
    np.testing.assert_allclose(cycles.frequency, frequency, rtol=2e-4)
    np.testing.assert_allclose(cycles.amplitude, peak, rtol=2e-4)
    np.testing.assert_array_equal(cycles.end[:-1], cycles.start[1:])


def test_more_samples_locate_crossings_and_peaks_with_the_order_of_the_cubic():
    errors = []
    for count in (250, 500, 1000):
        time = np.arange(count) / count
        position, rate, peak = shimmy(time, 11.3, phase=0.4)
        cycles = measure_cycles(time, position, rate)
        errors.append([abs(cycles.frequency / 11.3 - 1.0).max(),
                       abs(cycles.amplitude / peak - 1.0).max()])
    assert (np.log2(np.array(errors[:-1]) / errors[1:]) > 3.0).all()


@pytest.mark.parametrize("with_rate", [True, False])
def test_a_zero_on_a_sample_is_where_it_is(with_rate):
    time = np.arange(9) / 4.0
    position = np.tile([-1.0, 0.0, 1.0, 0.0], 3)[:9]
    rate = 0.5 * np.pi * 4.0 * np.tile([0.0, 1.0, 0.0, -1.0], 3)[:9]
    cycles = measure_cycles(time, position, rate if with_rate else None)
    np.testing.assert_array_equal(cycles.start, [0.25])
    np.testing.assert_array_equal(cycles.end, [1.25])


def test_a_growing_oscillation_is_measured_cycle_by_cycle():
    time = np.arange(1000) * 0.002
    growth = np.exp(1.5 * time)
    position = 0.01 * growth * np.sin(2.0 * np.pi * 12.0 * time)
    cycles = measure_cycles(time, position)
    middle = 0.5 * (cycles.start + cycles.end)
    np.testing.assert_allclose(cycles.amplitude, 0.01 * np.exp(1.5 * middle), rtol=2e-3)
    np.testing.assert_allclose(cycles.frequency, 12.0, rtol=1e-3)


def test_rest_and_noise_below_the_smallest_amplitude_are_no_cycles():
    time = np.arange(1000) * 0.002
    assert len(measure_cycles(time, np.zeros(1000)).amplitude) == 0
    assert len(measure_cycles(time, np.full(1000, 0.3)).amplitude) == 0
    ripple = 1e-4 * np.sin(300.0 * time)
    assert len(measure_cycles(time, ripple, smallest=2e-4).amplitude) == 0
    assert len(measure_cycles(time, ripple, smallest=5e-5).amplitude) > 10
    noisy = 0.1 * np.sin(2.0 * np.pi * 10.0 * time + 0.3) + ripple
    assert len(measure_cycles(time, noisy, smallest=1e-3).amplitude) == 19


def test_a_motion_that_sticks_at_its_ends_keeps_its_amplitude():
    time = np.arange(1000) * 0.002
    flat = np.clip(0.12 * np.sin(2.0 * np.pi * 10.0 * time + 0.3), -0.1, 0.1)
    rate = np.where(abs(flat) < 0.1, 0.12 * 20.0 * np.pi * np.cos(20.0 * np.pi * time + 0.3), 0.0)
    cycles = measure_cycles(time, flat, rate)
    np.testing.assert_allclose(cycles.amplitude, 0.1, rtol=5e-3)
    np.testing.assert_allclose(cycles.frequency, 10.0, rtol=1e-6)


@pytest.mark.parametrize("count", [0, 1, 2, 3])
def test_few_samples_are_no_cycle(count):
    assert len(measure_cycles(np.arange(count), (-1.0) ** np.arange(count)).amplitude) == 0


@pytest.mark.parametrize(("time", "position", "rate", "reason"), [
    ([0.0, 1.0], [0.0], None, "lists of one length"),
    ([0.0, 1.0], [0.0, 1.0], [0.0], "lists of one length"),
    ([[0.0, 1.0]], [[0.0, 1.0]], None, "lists of one length"),
    ([0.0, np.nan], [0.0, 1.0], None, "must be finite"),
    ([0.0, 1.0], [0.0, np.inf], None, "must be finite"),
    ([0.0, 0.0], [0.0, 1.0], None, "must increase"),
    ([1.0, 0.0], [0.0, 1.0], [0.0, 0.0], "must increase"),
])
def test_what_is_no_sampled_motion_is_refused(time, position, rate, reason):
    with pytest.raises(ValueError, match=reason):
        measure_cycles(time, position, rate)
