"""Shooting on the landing gear: stiff, of eight states, with folds and with cycles that stick."""

import functools

import numpy as np
import pytest

from shimmy_ros.gear.matrices import SWIVEL
from shimmy_ros.gear.parameter_file import reference_parameters
from shimmy_ros.gear.parameters import changed
from shimmy_ros.gear.system import OperatingPoint, gear_system
from shimmy_ros.shooting.continuation import continue_branch
from shimmy_ros.shooting.flow import advance
from shimmy_ros.shooting.modes import model_of
from shimmy_ros.shooting.periodic import limit_cycle
from shimmy_ros.shooting.settling import settle


def system_at(quadratic_damping, coulomb_torque, velocity):
    gear, damper = reference_parameters()
    return gear_system(OperatingPoint(gear, changed(
        damper, quadratic_damping=quadratic_damping, coulomb_torque=coulomb_torque), velocity))


# Peaks of strut tilt, swivel, damper [rad] and tyre lateral [m], and frequency [Hz], by
# event-driven integration of 40 periods with another integrator (Radau, tolerance 1e-9).
INTEGRATED = {
    (5, 5): [
        (100, [0.1299163, 0.2618327, 0.2622141, 0.1479851], 16.42237),
        (60, [0.08624137, 0.227013, 0.2272346, 0.1333702], 14.13626),
        (30, [0.0520963, 0.27724, 0.2773834, 0.104596], 10.6846),
        (10, [0.02459344, 0.2931488, 0.2932077, 0.05616629], 6.858469),
    ],
    (10, 20): [
        (90, [0.06294911, 0.1245191, 0.1246973, 0.07642454], 16.02579),
        (50, [0.03483294, 0.1129955, 0.1130883, 0.05895414], 13.15811),
        (20, [0.02077091, 0.1525572, 0.152613, 0.0455689], 9.005654),
        (10, [0.0108701, 0.1311123, 0.1311388, 0.02511244], 6.892302),
    ],
    (20, 15): [
        (80, [0.02881208, 0.05865564, 0.05873348, 0.0375927], 15.54188),
        (40, [0.01445737, 0.05920098, 0.05924087, 0.02664855], 12.0268),
        (15, [0.008370454, 0.0766933, 0.07671509, 0.01935859], 7.989456),
        (10, [0.004979794, 0.06064778, 0.06066015, 0.01163239], 6.908175),
    ],
    (50, 10): [
        (70, [0.009700919, 0.02169229, 0.02171784, 0.01376461], 14.90474),
        (30, [0.004732285, 0.02507724, 0.02509056, 0.009473318], 10.68675),
        (15, [0.003135027, 0.02855375, 0.02856201, 0.007223182], 7.998326),
        (10, [0.001611749, 0.01991545, 0.01991965, 0.003865373], 6.904849),
    ],
}


@functools.cache
def stable_cycle(quadratic_damping, coulomb_torque, velocity):
    kicked = np.zeros(8)
    kicked[4 + SWIVEL] = 40.0
    system = system_at(quadratic_damping, coulomb_torque, velocity)
    settled = settle(system, kicked, 0.6)
    return limit_cycle(system, settled.state, settled.period).cycle


@pytest.mark.parametrize("damper", INTEGRATED)
def test_the_stable_cycles_agree_with_long_integration(damper):
    for velocity, amplitude, frequency in INTEGRATED[damper]:
        cycle = stable_cycle(*damper, velocity)
        assert cycle.amplitude == pytest.approx(amplitude, rel=5e-5)
        assert cycle.frequency / (2.0 * np.pi) == pytest.approx(frequency, rel=1e-5)
        assert cycle.stable
        assert not cycle.sticks
        assert cycle.section == SWIVEL


@functools.cache
def branch_in_torque():
    """From the stable cycle at (20, 15), 30 m/s, through the fold down to the trigger there."""
    return list(continue_branch(
        lambda torque: system_at(20.0, torque, 30.0), stable_cycle(20, 15, 30), 15.0,
        direction=1, scale=60.0, bounds=(15.0, 500.0), largest_step=0.15))


def test_the_branch_of_the_gear_folds_and_leads_to_a_trigger_that_sticks():
    points = branch_in_torque()
    fold = next(point for point in points if point.fold)
    assert fold.cycle.multipliers[0] == pytest.approx(1.0, abs=1e-7)
    assert sum(point.fold for point in points) == 1
    after = points[points.index(fold) + 1:]
    assert not any(point.cycle.stable for point in after)
    assert {point.cycle.sticks for point in after} == {False, True}
    trigger = points[-1].cycle
    assert points[-1].parameter == 15.0
    assert trigger.sticks
    assert trigger.amplitude[SWIVEL] < 0.1 * stable_cycle(20, 15, 30).amplitude[SWIVEL]
    assert np.count_nonzero(np.abs(trigger.multipliers) > 1.0) == 1


@pytest.mark.parametrize("sticks", [True, False])
def test_a_motion_above_the_trigger_grows_and_one_below_dies(sticks):
    point = next(point for point in reversed(branch_in_torque()) if point.cycle.sticks is sticks)
    assert not point.cycle.stable
    model = model_of(system_at(20.0, point.parameter, 30.0))
    for factor, grows in ((1.01, True), (0.99, False)):
        start = point.cycle.state * factor
        later = advance(model, start, 20.0 * point.cycle.period)
        swing = later.sample(np.linspace(19.0, 20.0, 200) * point.cycle.period)[SWIVEL].max()
        assert bool(swing > point.cycle.amplitude[SWIVEL]) is grows


@pytest.mark.parametrize("sticks", [True, False])
def test_the_multipliers_of_the_gear_agree_with_differences(sticks):
    point = next(point for point in reversed(branch_in_torque()) if point.cycle.sticks is sticks)
    model, cycle = model_of(system_at(20.0, point.parameter, 30.0)), point.cycle
    scale = cycle.trajectory.magnitude()
    step = 1e-6
    half = np.column_stack([
        -(advance(model, cycle.state + step * scale * unit, 0.5 * cycle.period).end
          - advance(model, cycle.state - step * scale * unit, 0.5 * cycle.period).end)
        / (2.0 * step * scale) for unit in np.eye(8)])
    expected = np.linalg.eigvals(half)
    expected = np.delete(expected, np.argmin(np.abs(expected - 1.0)))
    expected = expected[np.argsort(-np.abs(expected))]
    assert np.abs(cycle.half_multipliers[:4]) == pytest.approx(np.abs(expected[:4]), abs=1e-6)
    assert cycle.multipliers == pytest.approx(cycle.half_multipliers**2)


def test_cycles_scale_with_the_torque_if_quadratic_damping_goes_with_its_inverse():
    for point in branch_in_torque()[3::6]:
        scaled = limit_cycle(system_at(20.0 / 3.0, 3.0 * point.parameter, 30.0),
                             3.0 * point.cycle.state, point.cycle.period)
        assert scaled.iterations == 0
        assert scaled.cycle.half_multipliers == pytest.approx(point.cycle.half_multipliers)


def test_the_outer_cycle_near_forty_hertz_is_found_in_spite_of_its_stiffness():
    kicked = np.zeros(8)
    kicked[4 + SWIVEL] = 8665.0
    cycle = limit_cycle(system_at(10.0, 20.0, 60.0), kicked, 0.0241).cycle
    assert 40.0 < 1.0 / cycle.period < 43.0
    assert not cycle.stable
    assert cycle.amplitude[SWIVEL] > 10.0 * cycle.amplitude[2]
