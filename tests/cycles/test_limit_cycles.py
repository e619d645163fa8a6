"""Every limit cycle at one operating point."""

import functools
import json
from dataclasses import fields
from pathlib import Path

import numpy as np
import pytest

from shimmy_ros.cycles.limit_cycles import Role, all_cycles, rest_is_stable
from shimmy_ros.cycles.one_harmonic import fold_torques, one_harmonic_cycles
from shimmy_ros.cycles.orbits import BALANCE, SHOOTING
from shimmy_ros.gear.matrices import SWIVEL
from shimmy_ros.gear.parameter_file import reference_parameters
from shimmy_ros.gear.parameters import Damper, Gear, changed
from shimmy_ros.gear.system import OperatingPoint, gear_system
from shimmy_ros.shooting.flow import advance
from shimmy_ros.shooting.modes import model_of

GEAR, DAMPER = reference_parameters()
INTEGRATED = next(
    case for case in json.loads((Path(__file__).parents[1] / "data" / "limit_cycles.json")
                                .read_text(encoding="utf-8"))["cases"]
    if (case["quadratic_damping"], case["coulomb_torque"], case["taxi_velocity"]) == (10, 20, 40))


def at(velocity, quadratic_damping, coulomb_torque):
    return OperatingPoint(GEAR, changed(DAMPER, quadratic_damping=quadratic_damping,
                                        coulomb_torque=coulomb_torque), velocity)


def three_folds(coulomb_torque):
    """A gear whose cycles stick near their fold, and fold three times there."""
    rng = np.random.default_rng(5)
    for _ in range(25):
        gear = changed(GEAR, **{item.name: getattr(GEAR, item.name) * rng.uniform(0.8, 1.2)
                                for item in fields(GEAR)})
        quadratic, _, velocity = rng.uniform(5, 50), rng.uniform(0.5, 25), rng.uniform(10, 100)
    return OperatingPoint(gear, changed(
        DAMPER, quadratic_damping=quadratic, coulomb_torque=coulomb_torque), velocity)


@functools.cache
def found(point):
    return all_cycles(point)


def roles(point):
    return [cycle.role for cycle in found(point)]


def test_the_reference_gear_has_a_trigger_a_stable_cycle_and_one_beyond_any_gear():
    trigger, stable, outer = found(at(40.0, 10.0, 20.0))
    assert (trigger.role, stable.role, outer.role) == (Role.TRIGGER, Role.STABLE, Role.UNSTABLE)
    assert stable.orbit.amplitude == pytest.approx(INTEGRATED["amplitude"], rel=5e-5)
    assert stable.orbit.frequency_hz == pytest.approx(INTEGRATED["frequency"], rel=1e-5)
    assert stable.orbit.method == trigger.orbit.method == SHOOTING
    assert trigger.orbit.sticks
    assert not stable.orbit.sticks
    assert trigger.orbit.swivel == pytest.approx(0.0034378, rel=1e-4)
    assert not trigger.beyond_gear
    # The damper locks, and the swivel oscillates against its linkage.
    assert outer.beyond_gear
    assert outer.orbit.method == BALANCE
    assert outer.orbit.frequency_hz == pytest.approx(41.18, rel=1e-3)
    for cycle in (trigger, outer):
        assert np.count_nonzero(np.abs(cycle.multipliers) > 1.0) == 1
    for cycle in (trigger, stable, outer):
        assert cycle.multipliers.shape == (7,)
        assert cycle.orbit.multiplier == np.abs(cycle.multipliers).max()


def test_four_cycles_between_three_folds_are_all_found():
    cycles = found(three_folds(207.5))
    assert [cycle.role for cycle in cycles] == [
        Role.TRIGGER, Role.STABLE, Role.UNSTABLE, Role.STABLE]
    assert [cycle.orbit.swivel for cycle in cycles] == pytest.approx(
        [0.040547, 0.043698, 0.049844, 0.065527], rel=1e-4)
    assert all(cycle.orbit.sticks for cycle in cycles)


@pytest.mark.parametrize("number", range(4))
def test_motion_near_a_cycle_that_sticks_returns_or_leaves_as_its_multipliers_say(number):
    point = three_folds(207.5)
    cycle = found(point)[number]
    state, period = cycle.orbit.initial_state()
    model = model_of(gear_system(point))
    later = advance(model, 1.001 * state, 24.0 * period)
    after = later.sample(later.zeros(SWIVEL)[-2:])
    # Where the swivel passes zero, its rate is off by a thousandth at first.
    off = abs(np.abs(after[4 + SWIVEL]).mean() / state[4 + SWIVEL] - 1.0)
    if cycle.role is Role.STABLE:
        assert off < 3e-4
    else:
        assert off > 1.5e-3


def test_two_cycles_close_to_their_fold_are_told_apart():
    trigger, stable, _ = found(at(40.0, 10.0, 163.8))
    assert (trigger.role, stable.role) == (Role.TRIGGER, Role.STABLE)
    assert 1.01 < stable.orbit.swivel / trigger.orbit.swivel < 1.03
    assert trigger.multipliers[0].real > 1.0 > stable.multipliers[0].real > 0.98


def test_scaling_friction_up_and_damping_down_scales_every_cycle():
    scaled = found(at(40.0, 16.38, 100.0))
    plain = found(at(40.0, 10.0, 163.8))
    for one, other in zip(scaled, plain, strict=True):
        assert one.role is other.role
        assert one.orbit.amplitude == pytest.approx(other.orbit.amplitude / 1.638, rel=1e-6)


def test_without_friction_rest_is_unstable_and_there_is_no_trigger():
    point = at(40.0, 10.0, 0.0)
    assert not rest_is_stable(point)
    assert roles(point) == [Role.STABLE, Role.UNSTABLE]


def test_without_quadratic_damping_there_is_the_trigger_alone():
    (trigger,) = found(at(40.0, 0.0, 20.0))
    assert trigger.role is Role.TRIGGER
    assert trigger.orbit.sticks
    # As the damping goes to zero, the trigger goes there.
    near = next(cycle for cycle in found(at(40.0, 0.1, 20.0)) if cycle.role is Role.TRIGGER)
    assert near.orbit.swivel == pytest.approx(trigger.orbit.swivel, rel=1e-3)


@pytest.mark.parametrize("point", [
    at(4.0, 10.0, 10.0), at(4.0, 10.0, 0.0),  # nothing grows
    at(40.0, 0.0, 0.0),  # nothing limits what grows
    three_folds(209.4),  # just beyond the folds
])
def test_no_cycle_is_an_answer(point):
    assert found(point) == []


def test_cycles_that_one_harmonic_does_not_know_are_found():
    point = three_folds(200.0)
    assert one_harmonic_cycles(point) == []
    assert roles(point) == [Role.TRIGGER, Role.STABLE]


def test_one_harmonic_folds_where_its_cycles_meet():
    (fold,) = fold_torques(at(40.0, 10.0, 0.0))
    low, high = (one_harmonic_cycles(at(40.0, 10.0, factor * fold)) for factor in (0.999, 1.001))
    assert len(low) == len(high) + 2
    assert low[1].swivel / low[0].swivel < 1.2
    assert fold_torques(at(40.0, 20.0, 5.0)) == pytest.approx([fold / 2.0], rel=1e-9)
    assert fold_torques(at(4.0, 10.0, 0.0)) == []


def test_a_cycle_in_another_mode_than_with_less_friction_is_found_with_its_trigger():
    """Where friction holds the swivel, strut and tyre have a mode of shimmy of their own."""
    gear = Gear(
        strut_inertia=71.6, wheel_mass=23.35, trunnion_to_axle=0.9154, trail=0.0907,
        swivel_inertia=0.8634, wheel_polar_inertia=0.6583, wheel_radius=0.3457,
        damper_inertia=0.00443, strut_tilt_stiffness=463500.0, damper_linkage_stiffness=61540.0,
        strut_rake=0.1148, tyre_lateral_stiffness=285500.0, tyre_torsional_stiffness=2984.0,
        rolling_alpha=28.75, rolling_beta=11.21, rolling_gamma=0.862)
    cycles = all_cycles(OperatingPoint(gear, Damper(2.345, 43.87, 10.0), 66.6))
    assert [cycle.role for cycle in cycles] == [Role.TRIGGER, Role.STABLE, Role.UNSTABLE]
    assert [cycle.orbit.frequency_hz for cycle in cycles[:2]] == pytest.approx(
        [12.46, 14.40], abs=0.01)
    assert cycles[0].orbit.sticks
