import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from shimmy_ros.gear.matrices import damping_matrix, mass_matrix, stiffness_matrix
from shimmy_ros.gear.parameter_file import reference_parameters
from shimmy_ros.gear.parameters import Damper, Gear, changed, ranges
from shimmy_ros.gear.system import OperatingPoint, family_between, gear_system
from shimmy_ros.ihb.balance import balance
from shimmy_ros.ihb.elements import Coulomb, QuadraticDamping
from shimmy_ros.ihb.harmonics import orders

GEAR, DAMPER = reference_parameters()
POINT = OperatingPoint(GEAR, DAMPER, 40.0)
PARAMETERS = ["velocity", *ranges(Gear), *ranges(Damper)]


def moved(point, name, factor):
    """``point`` with one parameter multiplied by ``factor``."""
    if name == "velocity":
        return OperatingPoint(point.gear, point.damper, factor * point.velocity)
    if name in ranges(Gear):
        gear = changed(point.gear, **{name: factor * getattr(point.gear, name)})
        return OperatingPoint(gear, point.damper, point.velocity)
    damper = changed(point.damper, **{name: factor * getattr(point.damper, name)})
    return OperatingPoint(point.gear, damper, point.velocity)


def assert_same(system, other):
    for name in ("mass", "damping", "stiffness"):
        assert np.allclose(getattr(system, name), getattr(other, name), rtol=1e-12, atol=1e-9)
    assert [type(e) for e in system.elements] == [type(e) for e in other.elements]
    for one, two in zip(system.elements, other.elements, strict=True):
        assert one.dof == two.dof
        assert vars(one) == pytest.approx(vars(two))


def test_a_system_is_made_of_the_matrices_friction_on_the_swivel_and_the_damper():
    system = gear_system(POINT)
    assert_same(system, type(system)(
        mass_matrix(GEAR), damping_matrix(GEAR, DAMPER.linear_damping, 40.0),
        stiffness_matrix(GEAR, 40.0), (Coulomb(1, 20.0), QuadraticDamping(2, 10.0))))


@pytest.mark.parametrize(("name", "left"), [
    ("coulomb_torque", QuadraticDamping(2, 10.0)), ("quadratic_damping", Coulomb(1, 20.0))])
def test_elements_of_no_strength_are_left_out(name, left):
    assert gear_system(moved(POINT, name, 0.0)).elements == (left,)


@pytest.mark.parametrize("name", PARAMETERS)
def test_a_family_leads_from_one_point_to_the_other(name):
    end = moved(POINT, name, 1.3)
    family = family_between(POINT, end)
    assert_same(family.system(0.0), gear_system(POINT))
    assert_same(family.system(1.0), gear_system(end))
    assert_same(family.system(0.5), gear_system(moved(POINT, name, 1.15)))


def test_elements_that_vanish_at_one_end_stay_in_the_family():
    family = family_between(POINT, moved(POINT, "coulomb_torque", 0.0))
    assert family.system(1.0).elements == (Coulomb(1, 0.0), QuadraticDamping(2, 10.0))
    assert family.derivative(0.3).elements == (Coulomb(1, -20.0), QuadraticDamping(2, 0.0))
    idle = moved(moved(POINT, "coulomb_torque", 0.0), "quadratic_damping", 0.0)
    assert family_between(idle, idle).system(0.5).elements == ()


@pytest.mark.parametrize("name", PARAMETERS)
@settings(max_examples=20, deadline=None, derandomize=True)
@given(seed=st.integers(0, 2**32 - 1), harmonics=st.integers(1, 8), position=st.floats(0.0, 1.0),
       velocity=st.floats(3.0, 120.0), active=st.sampled_from([(1, 2), (0, 1, 2, 3)]))
def test_the_column_of_every_parameter_is_a_derivative_of_the_residual(
        name, seed, harmonics, position, velocity, active):
    start = OperatingPoint(GEAR, DAMPER, velocity)
    family = family_between(start, moved(start, name, 1.2))
    rng = np.random.default_rng(seed)
    orbit = 0.1 * rng.standard_normal((len(active), 2 * harmonics))
    orbit /= np.tile(orders(harmonics), 2) ** 2

    def residual(parameter):
        return balance(family.system(parameter), orbit, 60.0, active).residual

    found = balance(family.system(position), orbit, 60.0, active,
                    family.derivative(position)).by_parameter
    step = 0.02
    expected = (8.0 * (residual(position + step) - residual(position - step))
                - residual(position + 2.0 * step) + residual(position - 2.0 * step)) / (12.0 * step)
    assert np.max(np.abs(expected)) > 0.0
    assert np.max(np.abs(found - expected)) <= 1e-6 * np.max(np.abs(expected))
