import numpy as np
import pytest

from shimmy_ros.ihb.describing_function import (
    growing_cycles,
    linear_modes,
    reference_coordinate,
    with_coulomb_factor,
)
from shimmy_ros.ihb.elements import Coulomb, OddElement, QuadraticDamping
from shimmy_ros.ihb.system import System

GROWTH, DAMPING = 0.2, 0.1
BRAKE = 8.0 * DAMPING / (3.0 * np.pi)
FOLD_TORQUE = np.pi * GROWTH**2 / (16.0 * BRAKE)


def outer_amplitude(torque):
    """Where growth a = 4 torque / pi + BRAKE a^2 for the second time."""
    return (GROWTH + np.sqrt(GROWTH**2 - 16.0 * BRAKE * torque / np.pi)) / (2.0 * BRAKE)


def test_linear_modes_come_fastest_growing_first():
    system = System(np.eye(2), np.diag([0.3, -0.2]), np.diag([1.0, 4.0]))
    first, second = linear_modes(system)
    assert first.rate == pytest.approx(0.1 + 1j * np.sqrt(4.0 - 0.01))
    assert second.rate == pytest.approx(-0.15 + 1j * np.sqrt(1.0 - 0.15**2))
    assert abs(first.shape[0]) < 1e-12 < abs(first.shape[1])


@pytest.mark.parametrize("torque", [0.0, 0.3 * FOLD_TORQUE, 0.9 * FOLD_TORQUE])
def test_growth_stops_where_the_work_balances(rubbing, torque):
    growth = growing_cycles(rubbing(GROWTH, torque, DAMPING))
    (cycle,) = growth.cycles
    assert not growth.undecided
    assert cycle.coefficients == pytest.approx(np.array([[outer_amplitude(torque), 0.0]]), rel=0.05)
    assert cycle.frequency == pytest.approx(1.0, abs=0.01)


@pytest.mark.parametrize("growth", [1e-2, 1e-4, 1e-7])
def test_slow_growth_stops_at_a_small_amplitude(rubbing, growth):
    (cycle,) = growing_cycles(rubbing(growth, 0.0, DAMPING)).cycles
    assert cycle.coefficients[0, 0] == pytest.approx(growth / BRAKE, rel=0.01)


@pytest.mark.parametrize("torque", [1.1 * FOLD_TORQUE, 10.0 * FOLD_TORQUE])
def test_too_much_friction_leaves_no_cycle(rubbing, torque):
    assert growing_cycles(rubbing(GROWTH, torque, DAMPING)) == ([], False)
    (cycle,) = growing_cycles(rubbing(GROWTH, torque, DAMPING), 0.5 * FOLD_TORQUE / torque).cycles
    assert cycle.coefficients[0, 0] == pytest.approx(outer_amplitude(0.5 * FOLD_TORQUE), rel=0.05)


@pytest.mark.parametrize(("growth", "torque", "damping"), [
    (-0.2, 0.0, 0.1), (-0.2, 0.1, 0.1),  # nothing grows
    (0.2, 0.1, 0.0),  # nothing stops the growth
])
def test_no_cycle_without_growth_or_without_a_brake(rubbing, growth, torque, damping):
    assert growing_cycles(rubbing(growth, torque, damping)) == ([], False)


def test_a_general_element_may_grow_beyond_a_threshold():
    # x'' + (0.1 - x^2 + 0.5 x^4) x' + x = 0 balances where 0.1 - a^2/4 + a^4/16 = 0, twice.
    system = System([[1.0]], [[0.1]], [[1.0]], (OddElement(
        (0,), lambda q, v: (0.5 * q**4 - q**2) * v,
        lambda q, v: ((2.0 * q**3 - 2.0 * q) * v)[None],
        lambda q, v: (0.5 * q**4 - q**2)[None]),))
    (cycle,) = growing_cycles(system).cycles
    outer = np.sqrt((0.25 + np.sqrt(0.25**2 - 0.4 * 0.0625)) / 0.125)
    assert cycle.coefficients[0, 0] == pytest.approx(outer, rel=0.01)


def test_a_linear_part_may_be_in_the_element_or_in_the_matrices(van_der_pol):
    """All of (x^2 - 1) x' + 0.3 x as one element, beside what is left of the matrices."""
    whole = OddElement(
        (0,), lambda q, v: (q**2 - 1.0) * v + 0.3 * q, lambda q, v: (2.0 * q * v + 0.3)[None],
        lambda q, v: (q**2 - 1.0)[None])
    apart = van_der_pol(1.0)
    (expected,) = growing_cycles(apart).cycles
    found = growing_cycles(System([[1.0]], [[0.0]], [[0.7]], (whole,)))
    assert not found.undecided
    (cycle,) = found.cycles
    assert cycle.frequency == pytest.approx(expected.frequency, rel=1e-3)
    assert cycle.coefficients == pytest.approx(expected.coefficients, rel=1e-2)


def test_each_growing_mode_has_a_cycle_of_its_own():
    coupling = np.array([[1.05, -0.05], [-0.05, 4.05]])
    system = System(np.eye(2), np.diag([-0.1, -0.3]), coupling,
                    (QuadraticDamping(0, 1.0), QuadraticDamping(1, 1.0)))
    fast, slow = growing_cycles(system).cycles
    assert fast.frequency == pytest.approx(2.0, rel=0.05)
    assert slow.frequency == pytest.approx(1.0, rel=0.05)


def test_growth_that_cannot_be_followed_is_undecided(van_der_pol):
    assert growing_cycles(van_der_pol(3.0)) == ([], True)  # it grows without oscillating
    apart = System(np.eye(2), np.diag([1.0, -0.3]), np.diag([1.0, 4.0]),
                   (QuadraticDamping(0, 1.0), QuadraticDamping(1, 1.0)))
    assert growing_cycles(apart) == ([], True)  # it does not move coordinate 0


def test_the_friction_is_scaled_alone_and_left_out_at_zero():
    elements = (QuadraticDamping(0, 3.0), Coulomb(1, 2.0))
    system = System(np.eye(2), np.eye(2), np.eye(2), elements)
    assert with_coulomb_factor(system, 0.25).elements == (elements[0], Coulomb(1, 0.5))
    assert with_coulomb_factor(system, 0.0).elements == elements[:1]
    assert reference_coordinate(system) == 1
    assert reference_coordinate(with_coulomb_factor(system, 0.0)) == 0
