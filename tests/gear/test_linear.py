"""Linear stability: eigenvalues, damping ratios, and every onset and end of the instability."""

from dataclasses import fields
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from shimmy_ros.gear.linear import crossings, linear_modes
from shimmy_ros.gear.matrices import damping_matrix, mass_matrix, stiffness_matrix
from shimmy_ros.gear.parameter_file import reference_parameters
from shimmy_ros.gear.parameters import Gear, ParameterError, changed
from shimmy_ros.gear.system import OperatingPoint, gear_system
from shimmy_ros.ihb.describing_function import linear_modes as undamped_free_modes
from shimmy_ros.shooting.flow import advance
from shimmy_ros.shooting.modes import model_of

GEAR, DAMPER = reference_parameters()


def largest_growths(gear, damper, velocities):
    """The largest growth rate at each velocity, from another linearization than the module's."""
    mass = mass_matrix(gear)
    zero, one = np.zeros_like(mass), np.eye(len(mass))
    pencils = np.array([
        np.block([[-damping_matrix(gear, damper.linear_damping, v), -stiffness_matrix(gear, v)],
                  [one, zero]]) for v in velocities])
    left = np.block([[mass, zero], [zero, one]])
    return np.linalg.eigvals(np.linalg.solve(left, pencils)).real.max(axis=-1)


def largest_growth(gear, damper, velocity):
    return largest_growths(gear, damper, [velocity])[0]


def scattered_gear(values):
    return Gear(**{item.name: getattr(GEAR, item.name) * value
                   for item, value in zip(fields(Gear), values, strict=True)})


@pytest.mark.parametrize("velocity", [1.0, 10.0, 40.0, 100.0])
def test_every_eigenvalue_solves_the_quadratic_problem(velocity):
    modes = linear_modes(GEAR, DAMPER, velocity)
    mass, stiffness = mass_matrix(GEAR), stiffness_matrix(GEAR, velocity)
    damping = damping_matrix(GEAR, DAMPER.linear_damping, velocity)
    for value in modes.eigenvalues:
        matrix = value**2 * mass + value * damping + stiffness
        scale = np.abs(value**2 * mass) + np.abs(value * damping) + np.abs(stiffness)
        # Rows differ by orders of magnitude.
        smallest = np.linalg.svd(matrix / np.linalg.norm(scale, axis=1)[:, None])[1][-1]
        assert smallest < 1e-10
    assert np.count_nonzero(modes.eigenvalues.imag > 0.0) * 2 + np.count_nonzero(
        modes.eigenvalues.imag == 0.0) == 8
    assert np.all(np.diff(modes.growth_rate) <= 0.0)


def test_frequency_and_damping_ratio_are_those_of_the_decaying_motion():
    modes = linear_modes(GEAR, DAMPER, 40.0)
    natural = np.abs(modes.eigenvalues)
    np.testing.assert_allclose(-modes.damping_ratio * natural, modes.growth_rate, rtol=1e-12)
    turning = natural * np.sqrt(1.0 - modes.damping_ratio**2)
    np.testing.assert_allclose(turning / (2.0 * np.pi), modes.frequency_hz, rtol=1e-9)
    assert modes.damping_ratio[0] < 0.0 < modes.damping_ratio[1]


def test_growth_is_that_of_a_small_motion_with_the_friction_released():
    free = changed(DAMPER, coulomb_torque=0.0)
    modes = linear_modes(GEAR, free, 40.0)
    system = gear_system(OperatingPoint(GEAR, free, 40.0))
    state = np.zeros(8)
    state[5] = 1e-9
    start, duration = 0.3, 0.2
    trajectory = advance(model_of(system), state, start + duration)
    crossing = trajectory.zeros(1)
    peaks = [np.abs(trajectory.sample(np.linspace(a, b, 200))[1]).max()
             for a, b in zip(crossing[-4:-1], crossing[-3:], strict=True)]
    rate = np.log(peaks[-1] / peaks[0]) / (crossing[-2] - crossing[-4])
    assert rate == pytest.approx(modes.growth_rate[0], rel=1e-3)
    assert 0.5 / np.diff(crossing)[-1] == pytest.approx(modes.frequency_hz[0], rel=1e-3)


def test_modes_are_those_of_the_system_without_its_elements():
    system = gear_system(OperatingPoint(GEAR, DAMPER, 60.0))
    expected = [mode.rate for mode in undamped_free_modes(system)]
    found = linear_modes(GEAR, DAMPER, 60.0).eigenvalues
    np.testing.assert_allclose(np.sort_complex(found), np.sort_complex(expected), rtol=1e-9)


@pytest.mark.parametrize("linear_damping", [0.0, 2.0, 50.0, 100.0, 1e4])
def test_growth_changes_sign_at_every_crossing_and_nowhere_else(linear_damping):
    damper = changed(DAMPER, linear_damping=linear_damping)
    found = crossings(GEAR, damper, 0.02, 120.0)
    bounds = [0.02, *(crossing.velocity for crossing in found), 120.0]
    for crossing in found:
        assert largest_growth(GEAR, damper, crossing.velocity) == pytest.approx(0.0, abs=1e-7)
        before, after = (largest_growth(GEAR, damper, crossing.velocity * (1.0 + part))
                         for part in (-1e-6, 1e-6))
        assert crossing.onset == (after > before)
    for low, high in pairwise(bounds):
        inside = np.linspace(low, high, 203)[1:-1]
        assert len(set(largest_growths(GEAR, damper, inside) > 0.0)) == 1


def test_reference_gear_begins_to_shimmy_at_six_metres_per_second():
    (onset,) = crossings(GEAR, DAMPER, 1.0, 200.0)
    assert onset.onset
    assert onset.velocity == pytest.approx(6.1582124, rel=1e-7)
    assert onset.frequency_hz == pytest.approx(7.3089182, rel=1e-7)


def test_strong_damping_leaves_no_instability():
    assert crossings(GEAR, changed(DAMPER, linear_damping=200.0), 0.5, 200.0) == []


def test_an_instability_narrower_than_the_first_steps_is_found():
    damper = changed(DAMPER, linear_damping=5.55)
    onset, end = crossings(GEAR, damper, 0.3, 6.0)
    assert onset.onset
    assert not end.onset
    assert end.velocity - onset.velocity < 0.06
    assert largest_growth(GEAR, damper, 0.5 * (onset.velocity + end.velocity)) > 0.0


@settings(deadline=None, max_examples=8, derandomize=True)
@given(st.lists(st.floats(0.8, 1.2), min_size=16, max_size=16), st.floats(0.0, 120.0))
def test_no_crossing_is_missed_on_other_gears(values, linear_damping):
    gear = scattered_gear(values)
    damper = changed(DAMPER, linear_damping=linear_damping)
    found = crossings(gear, damper, 2.0, 120.0)
    grid = np.linspace(2.0, 120.0, 400)
    signs = largest_growths(gear, damper, grid) > 0.0
    seen = np.flatnonzero(signs[:-1] != signs[1:])
    for index in seen:
        assert any(grid[index] <= crossing.velocity <= grid[index + 1] for crossing in found)
    assert [crossing.onset for crossing in found] == [
        bool(signs[0]) == (number % 2 == 1) for number in range(len(found))]


@pytest.mark.parametrize(("low", "high", "message"), [
    (0.0, 50.0, "low is 0, but must be in"), (60.0, 50.0, "high is 50, but must be in"),
    (1.0, float("nan"), "high is nan, but must be in")])
def test_bad_ranges_are_refused(low, high, message):
    with pytest.raises(ParameterError, match=message):
        crossings(GEAR, DAMPER, low, high)


def test_standing_gear_has_no_rolling_modes():
    with pytest.raises(ParameterError, match="taxi_velocity is 0"):
        linear_modes(GEAR, DAMPER, 0.0)
