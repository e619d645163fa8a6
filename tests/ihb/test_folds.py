"""Folds tracked in two parameters, against closed forms, located folds and exact scaling."""

from itertools import islice

import numpy as np
import pytest

from shimmy_ros.gear.parameter_file import reference_parameters
from shimmy_ros.gear.parameters import changed
from shimmy_ros.gear.system import OperatingPoint, family_between, gear_system
from shimmy_ros.ihb.continuation import branch
from shimmy_ros.ihb.elements import Coulomb, QuadraticDamping
from shimmy_ros.ihb.folds import Plane, track_fold
from shimmy_ros.ihb.newton import Point, phase_of
from shimmy_ros.ihb.solve import placed, solve_cold
from shimmy_ros.ihb.stability import stability
from shimmy_ros.ihb.system import Family, System
from shimmy_ros.shooting.continuation import continue_branch
from shimmy_ros.shooting.periodic import limit_cycle

GROWTH, DAMPING = 0.2, 0.1
NOTHING = [[0.0]]
BY_TORQUE = System(NOTHING, NOTHING, NOTHING, (Coulomb(0, 1.0),))
BY_GROWTH = System(NOTHING, [[-1.0]], NOTHING)
BY_DAMPING = System(NOTHING, NOTHING, NOTHING, (QuadraticDamping(0, 1.0),))


def one_harmonic_fold(growth, damping=DAMPING):
    """Where the discriminant of 8 D/(3 pi) A^2 - mu A + 4 T/pi = 0 vanishes."""
    return 3.0 * np.pi**2 * growth**2 / (128.0 * damping)


def located(rubbing, growth, damping, harmonics):
    """The fold along the torque, and the phase condition."""
    family = Family(lambda torque: rubbing(growth, torque, damping), lambda torque: BY_TORQUE)
    scale = one_harmonic_fold(growth, damping)
    cycle = solve_cold(family.system(0.5 * scale), harmonics).limit_cycle
    phase = phase_of((0,), harmonics, 0)
    points = branch(family, Point(cycle.coefficients, cycle.frequency), 0.5 * scale, scale, 1,
                    (0,), phase)
    return next(point for point in points if point.is_fold), phase


@pytest.mark.parametrize("direction", [1, -1])
def test_with_one_harmonic_the_curve_is_known(rubbing, direction):
    start, phase = located(rubbing, GROWTH, DAMPING, 1)
    plane = Plane(lambda torque, growth: rubbing(growth, torque, DAMPING),
                  lambda torque, growth: BY_TORQUE, lambda torque, growth: BY_GROWTH)
    folds = list(islice(
        track_fold(plane, start, GROWTH, (0.1, 0.2), direction, (0,), phase), 12))
    growths = np.array([fold.second for fold in folds])
    assert growths[0] == pytest.approx(GROWTH)
    assert np.all(np.diff(growths) * direction > 0.0)
    assert max(growths) / min(growths) > 1.5
    for fold in folds:
        assert fold.first == pytest.approx(one_harmonic_fold(fold.second), rel=1e-10)
        amplitude = 3.0 * np.pi * fold.second / (16.0 * DAMPING)
        assert fold.point.coefficients[0, 0] == pytest.approx(amplitude, rel=1e-5)
        assert fold.point.frequency == pytest.approx(1.0, rel=1e-9)


@pytest.mark.parametrize("harmonics", [3, 8])
def test_every_tracked_fold_is_met_by_a_branch_as_well(rubbing, harmonics):
    start, phase = located(rubbing, GROWTH, DAMPING, harmonics)
    plane = Plane(lambda torque, growth: rubbing(growth, torque, DAMPING),
                  lambda torque, growth: BY_TORQUE, lambda torque, growth: BY_GROWTH)
    folds = list(islice(track_fold(plane, start, GROWTH, (0.1, 0.2), 1, (0,), phase), 10))
    for fold in folds[2::3]:
        alone, _ = located(rubbing, fold.second, DAMPING, harmonics)
        assert fold.first == pytest.approx(alone.parameter, rel=1e-9)
        assert np.allclose(fold.point.coefficients, alone.point.coefficients, atol=1e-5)


@pytest.mark.parametrize("harmonics", [1, 6])
@pytest.mark.parametrize("direction", [1, -1])
def test_a_fold_depends_on_the_product_of_friction_and_damping(rubbing, harmonics, direction):
    start, phase = located(rubbing, GROWTH, DAMPING, harmonics)
    plane = Plane(lambda torque, damping: rubbing(GROWTH, torque, damping),
                  lambda torque, damping: BY_TORQUE, lambda torque, damping: BY_DAMPING)
    folds = list(islice(
        track_fold(plane, start, DAMPING, (0.1, 0.1), direction, (0,), phase), 14))
    dampings = np.array([fold.second for fold in folds])
    assert max(dampings) / min(dampings) > 2.0
    for fold in folds:
        assert fold.first * fold.second == pytest.approx(start.parameter * DAMPING, rel=1e-9)
        scaled = start.point.coefficients * (fold.first / start.parameter)
        assert np.allclose(fold.point.coefficients, scaled, rtol=1e-5, atol=1e-7)


def test_a_curve_that_turns_back_in_its_second_parameter_is_followed_round():
    """Growth mu (1 - s^2): the fold over s lies at +-s, up to the torque at which both meet."""
    def system(offset, torque):
        return System([[1.0]], [[-GROWTH * (1.0 - offset**2)]], [[1.0]],
                      (Coulomb(0, torque), QuadraticDamping(0, DAMPING)))

    plane = Plane(
        system, lambda offset, torque: System(NOTHING, [[2.0 * GROWTH * offset]], NOTHING),
        lambda offset, torque: BY_TORQUE)
    torque = 0.8 * one_harmonic_fold(GROWTH)
    cycle = solve_cold(system(0.0, torque), 4).limit_cycle
    family = Family(lambda offset: system(offset, torque),
                    lambda offset: plane.by_first(offset, torque))
    phase = phase_of((0,), 4, 0)
    start = next(point for point in branch(
        family, Point(cycle.coefficients, cycle.frequency), 0.0, 0.3, 1, (0,), phase)
        if point.is_fold)
    assert start.parameter == pytest.approx(np.sqrt(1.0 - np.sqrt(0.8)), rel=1e-3)
    offsets, torques = [], []
    for fold in islice(track_fold(plane, start, torque, (0.3, torque), 1, (0,), phase), 60):
        offsets.append(fold.first)
        torques.append(fold.second)
        if fold.first < -start.parameter:
            break
    assert np.all(np.diff(offsets) < 0.0)
    assert offsets[-1] < -start.parameter
    top = int(np.argmax(torques))
    assert 0 < top < len(torques) - 1
    assert abs(offsets[top]) < 0.1
    assert torques[top] == pytest.approx(one_harmonic_fold(GROWTH), rel=1e-2)
    # Left and right are alike.
    right = [pair for pair in zip(offsets, torques, strict=True) if pair[0] > 0.0]
    left = [(-offset, value) for offset, value in zip(offsets, torques, strict=True) if offset < 0]
    smooth = np.polynomial.Polynomial.fit(*np.array(right).T, 4)
    for offset, value in left[1:-1]:
        assert value == pytest.approx(smooth(offset), rel=1e-4)


GEAR, DAMPER = reference_parameters()
ACTIVE = (1, 2)


def gear_point(quadratic=10.0, torque=20.0, velocity=40.0):
    return OperatingPoint(GEAR, changed(DAMPER, quadratic_damping=quadratic,
                                        coulomb_torque=torque), velocity)


def gear_fold(velocity, harmonics):
    """The balance's fold over the friction, with C_d = 10: the point, [N m], and the phase."""
    family = family_between(gear_point(torque=0.0, velocity=velocity),
                            gear_point(torque=1.0, velocity=velocity))
    system = family.system(100.0)
    phase, point = placed(system, solve_cold(system, harmonics).limit_cycle, ACTIVE)
    points = branch(family, point, 100.0, 30.0, 1, ACTIVE, phase)
    return next(found for found in points if found.is_fold), phase


def test_the_folds_of_the_gear_converge_to_that_of_shooting():
    start = limit_cycle(gear_system(gear_point(torque=155.0)), np.zeros(8) + 3.0 * np.eye(8)[5],
                        0.083)
    exact = next(
        point.parameter for point in continue_branch(
            lambda torque: gear_system(gear_point(torque=torque)), start.cycle, 155.0, direction=1,
            scale=60.0) if point.fold)
    found = np.array([gear_fold(40.0, harmonics)[0].parameter for harmonics in (8, 16, 32)])
    errors = np.abs(found - exact)
    assert errors[0] < 0.02 * exact
    assert np.all(errors[1:] < 0.6 * errors[:-1])
    # The error falls as 1/N, so that two folds give a third.
    assert 2.0 * found[2] - found[1] == pytest.approx(exact, rel=5e-4)


def test_over_friction_and_damping_the_gears_fold_is_a_hyperbola():
    start, phase = gear_fold(40.0, 4)
    rates = (family_between(gear_point(torque=0.0), gear_point(torque=1.0)).derivative(0.0),
             family_between(gear_point(quadratic=0.0), gear_point(quadratic=1.0)).derivative(0.0))
    plane = Plane(lambda torque, quadratic: gear_system(gear_point(quadratic, torque)),
                  lambda torque, quadratic: rates[0], lambda torque, quadratic: rates[1])
    folds = list(islice(
        track_fold(plane, start, 10.0, (60.0, 5.0), 1, ACTIVE, phase), 10))
    assert folds[-1].second > 15.0
    for fold in folds:
        assert fold.first * fold.second == pytest.approx(10.0 * start.parameter, rel=1e-9)


def test_over_friction_and_velocity_every_fold_is_met_by_a_branch_with_a_multiplier_near_one():
    start, phase = gear_fold(40.0, 8)

    def rate(torque, velocity):
        here = gear_point(torque=torque, velocity=velocity)
        return family_between(here, gear_point(torque=torque, velocity=velocity + 1.0)
                              ).derivative(0.0)

    by_torque = family_between(gear_point(torque=0.0), gear_point(torque=1.0)).derivative(0.0)
    plane = Plane(lambda torque, velocity: gear_system(gear_point(torque=torque,
                                                                  velocity=velocity)),
                  lambda torque, velocity: by_torque, rate)
    folds = list(islice(track_fold(plane, start, 40.0, (60.0, 30.0), 1, ACTIVE, phase), 9))
    assert folds[-1].second > 55.0
    for fold in folds[4::4]:
        alone, _ = gear_fold(fold.second, 8)
        assert fold.first == pytest.approx(alone.parameter, rel=1e-8)
        system = gear_system(gear_point(torque=0.999 * fold.first, velocity=fold.second))
        assert stability(system, solve_cold(system, 8).limit_cycle).multipliers[0].real > 0.9
