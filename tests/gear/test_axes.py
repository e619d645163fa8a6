"""Parameters by name: values, changed points, and the derivatives of the system."""

import numpy as np
import pytest

from shimmy_ros.gear.axes import VELOCITY, Axis, axis_names
from shimmy_ros.gear.parameter_file import reference_parameters
from shimmy_ros.gear.parameters import ParameterError
from shimmy_ros.gear.system import OperatingPoint, gear_system
from shimmy_ros.ihb.elements import Coulomb

POINT = OperatingPoint(*reference_parameters(), 40.0)


def parts(system):
    strengths = [element.torque if isinstance(element, Coulomb) else element.coefficient
                 for element in system.elements]
    return np.concatenate([system.mass.ravel(), system.damping.ravel(), system.stiffness.ravel(),
                           strengths])


@pytest.mark.parametrize("name", axis_names())
def test_a_point_moved_along_an_axis_differs_there_alone(name):
    axis = Axis(name)
    value = 1.01 * axis.value(POINT)
    moved = axis.at(POINT, value)
    assert axis.value(moved) == value
    for other in axis_names():
        if other != name:
            assert Axis(other).value(moved) == Axis(other).value(POINT)
    assert axis.at(moved, axis.value(POINT)) == POINT


@pytest.mark.parametrize("name", axis_names())
def test_rate_is_the_derivative_of_the_system(name):
    axis = Axis(name)
    value = axis.value(POINT)
    step = 1e-4 * value
    ends = [parts(gear_system(axis.at(POINT, value + sign * step))) for sign in (1.0, -1.0)]
    difference = (ends[0] - ends[1]) / (2.0 * step)
    rate = parts(axis.rate(POINT))
    assert np.any(rate)
    np.testing.assert_allclose(rate, difference, rtol=1e-5, atol=1e-7 * np.abs(rate).max())


def test_rate_at_the_upper_bound_looks_downwards():
    axis = Axis(VELOCITY)
    top = axis.at(POINT, axis.range.high)
    below = axis.at(POINT, axis.range.high * (1.0 - 1e-6))
    np.testing.assert_allclose(axis.rate(top).stiffness, axis.rate(below).stiffness, rtol=1e-4,
                               atol=1e-3)


def test_unknown_names_and_values_out_of_range_are_refused():
    with pytest.raises(ParameterError, match=r"'gear\.trial' is not a parameter; the known ones"):
        Axis("gear.trial")
    with pytest.raises(ParameterError, match="taxi_velocity is 0, but must be in"):
        Axis(VELOCITY).at(POINT, 0.0)
    with pytest.raises(ParameterError, match="coulomb_torque is -1, but must be in"):
        Axis("damper.coulomb_torque").at(POINT, -1.0)


def test_labels_hold_name_and_unit():
    assert Axis(VELOCITY).label == "taxi velocity [m/s]"
    assert Axis("damper.coulomb_torque").label == "coulomb torque [N m]"
