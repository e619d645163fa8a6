"""Shared by the tests of the solver: finite differences, and oscillators with known cycles."""

import numpy as np
import pytest
from hypothesis import settings

from shimmy_ros.ihb.elements import Coulomb, OddElement, QuadraticDamping
from shimmy_ros.ihb.newton import Point, newton, phase_of
from shimmy_ros.ihb.solution import LimitCycle
from shimmy_ros.ihb.system import System

settings.register_profile("repeatable", deadline=None, derandomize=True)
settings.load_profile("repeatable")


def _differences(function, at, step=1e-5):
    """The derivative of ``function`` by every entry of ``at``, one column each, of order four."""
    at = np.asarray(at, dtype=float)
    columns = []
    for index in range(at.size):
        def value(count, index=index):
            moved = at.copy()
            moved.flat[index] += count * step
            return np.ravel(function(moved))

        columns.append((8.0 * (value(1) - value(-1)) - (value(2) - value(-2))) / (12.0 * step))
    return np.stack(columns, axis=-1)


def _van_der_pol(mu, scale=1.0):
    """x'' - mu (1 - (x / scale)^2) x' + x = 0."""
    element = OddElement(
        (0,), lambda q, v: mu * (q / scale) ** 2 * v,
        lambda q, v: (2.0 * mu * q * v / scale**2)[None],
        lambda q, v: (mu * (q / scale) ** 2)[None])
    return System([[1.0]], [[-mu]], [[1.0]], (element,))


def _rubbing(growth, torque, damping):
    """x'' - growth x' + torque sign(x') + damping |x'| x' + x = 0."""
    elements = [Coulomb(0, torque)] if torque else []
    if damping:
        elements.append(QuadraticDamping(0, damping))
    return System([[1.0]], [[-growth]], [[1.0]], tuple(elements))


def _balanced(system, amplitude, harmonics):
    """The cycle of a system of one coordinate next to an amplitude."""
    coefficients = np.zeros((1, 2 * harmonics))
    coefficients[0, 0] = amplitude
    found = newton(system, Point(coefficients, 1.0), (0,), phase_of((0,), harmonics, 0))
    assert found.converged
    return LimitCycle(found.point.coefficients, found.point.frequency, found.orientation)


@pytest.fixture(scope="session")
def differences():
    return _differences


@pytest.fixture(scope="session")
def van_der_pol():
    return _van_der_pol


@pytest.fixture(scope="session")
def rubbing():
    return _rubbing


@pytest.fixture(scope="session")
def balanced():
    return _balanced
