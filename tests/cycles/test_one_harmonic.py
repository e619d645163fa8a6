"""One-harmonic cycles in closed form, beside the balance and the describing function."""

from dataclasses import fields

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from shimmy_ros.cycles.one_harmonic import one_harmonic_cycles
from shimmy_ros.gear.matrices import SWIVEL
from shimmy_ros.gear.parameter_file import reference_parameters
from shimmy_ros.gear.parameters import Damper, Gear
from shimmy_ros.gear.system import OperatingPoint, gear_system
from shimmy_ros.ihb.balance import balance
from shimmy_ros.ihb.solve import solve_cold

GEAR, _ = reference_parameters()


def point_at(velocity, quadratic, torque, linear=2.0):
    return OperatingPoint(GEAR, Damper(linear, quadratic, torque), velocity)


@settings(deadline=None, max_examples=15, derandomize=True)
@given(st.lists(st.floats(0.8, 1.2), min_size=16, max_size=16), st.floats(5.0, 50.0),
       st.floats(0.0, 25.0), st.floats(10.0, 100.0))
def test_every_cycle_balances(values, quadratic, torque, velocity):
    gear = Gear(**{item.name: getattr(GEAR, item.name) * value
                   for item, value in zip(fields(Gear), values, strict=True)})
    point = OperatingPoint(gear, Damper(2.0, quadratic, torque), velocity)
    found = one_harmonic_cycles(point)
    for cycle in found:
        full = balance(gear_system(point), cycle.coefficients, cycle.frequency, (0, 1, 2, 3))
        assert full.error < 1e-6
    assert [cycle.swivel for cycle in found] == sorted(cycle.swivel for cycle in found)


@pytest.mark.parametrize("velocity", [10.0, 40.0, 100.0])
def test_the_stable_one_is_what_the_balance_finds(velocity):
    point = point_at(velocity, 10.0, 20.0)
    cold = solve_cold(gear_system(point), 1).limit_cycle
    nearest = min(one_harmonic_cycles(point),
                  key=lambda cycle: abs(cycle.frequency - cold.frequency))
    assert nearest.swivel == pytest.approx(cold.amplitude()[SWIVEL], rel=1e-8)
    assert nearest.frequency == pytest.approx(cold.frequency, rel=1e-8)


@pytest.mark.parametrize(("velocity", "quadratic", "torque", "count"), [
    (10.0, 10.0, 20.0, 2),     # trigger and shimmy
    (40.0, 10.0, 20.0, 3),     # and one with the damper locked
    (40.0, 10.0, 0.0, 2),      # no trigger without friction
    (40.0, 0.0, 20.0, 1),      # only the trigger with a linear damper
    (40.0, 0.0, 0.0, 0),       # nothing in a linear system
    (10.0, 10.0, 106.0, 0),    # beyond the fold
])
def test_how_many_there_are(velocity, quadratic, torque, count):
    assert len(one_harmonic_cycles(point_at(velocity, quadratic, torque))) == count


def test_scaling_the_orbit_scales_damping_and_friction():
    cycles = one_harmonic_cycles(point_at(40.0, 10.0, 20.0))
    scaled = one_harmonic_cycles(point_at(40.0, 5.0, 40.0))
    for one, other in zip(cycles, scaled, strict=True):
        assert other.swivel == pytest.approx(2.0 * one.swivel, rel=1e-9)
        assert other.frequency_hz == pytest.approx(one.frequency_hz, rel=1e-9)
