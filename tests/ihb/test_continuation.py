import itertools

import numpy as np
import pytest

from shimmy_ros.ihb.continuation import ContinuationError, branch
from shimmy_ros.ihb.elements import Coulomb
from shimmy_ros.ihb.newton import STABLE_ORIENTATION, Point, phase_of
from shimmy_ros.ihb.solve import solve_cold
from shimmy_ros.ihb.system import Family, System

# With one harmonic the cycle balances growth a = 4 torque / pi + BRAKE a^2, at frequency one.
GROWTH, DAMPING = 0.2, 0.1
BRAKE = 8.0 * DAMPING / (3.0 * np.pi)
FOLD_TORQUE = np.pi * GROWTH**2 / (16.0 * BRAKE)


def friction_family(rubbing):
    change = System([[0.0]], [[0.0]], [[0.0]], (Coulomb(0, 1.0),))
    return Family(lambda torque: rubbing(GROWTH, torque, DAMPING), lambda torque: change)


def follow(rubbing, count, harmonics=1, torque=0.2 * FOLD_TORQUE, direction=1):
    family = friction_family(rubbing)
    cycle = solve_cold(family.system(torque), harmonics).limit_cycle
    points = branch(family, Point(cycle.coefficients, cycle.frequency), torque, FOLD_TORQUE,
                    direction, (0,), phase_of((0,), harmonics, 0))
    return list(itertools.islice(points, count))


def test_the_branch_passes_its_fold_and_comes_back_unstable(rubbing):
    points = follow(rubbing, 25)
    for here in points:
        amplitude = here.point.coefficients[0, 0]
        assert GROWTH * amplitude == pytest.approx(
            4.0 * here.parameter / np.pi + BRAKE * amplitude**2, rel=1e-8)
        assert here.point.frequency == pytest.approx(1.0, rel=1e-8)
    fold = [point.is_fold for point in points].index(True)
    assert points[fold].parameter == pytest.approx(FOLD_TORQUE, rel=1e-9)
    assert points[fold].point.coefficients[0, 0] == pytest.approx(0.5 * GROWTH / BRAKE, rel=1e-5)
    before, after = points[:fold], points[fold + 1:]
    assert not any(point.is_fold for point in before + after)
    assert {(point.slope > 0.0, point.orientation) for point in before} == {
        (True, STABLE_ORIENTATION)}
    assert {(point.slope > 0.0, point.orientation) for point in after} == {
        (False, -STABLE_ORIENTATION)}
    assert len(after) >= 5


def test_it_begins_in_the_direction_asked_for(rubbing):
    forward, backward = (follow(rubbing, 3, direction=direction) for direction in (1, -1))
    assert forward[0].parameter == backward[0].parameter
    assert backward[1].parameter < forward[0].parameter < forward[1].parameter
    assert backward[0].slope == -forward[0].slope


@pytest.mark.parametrize("harmonics", [2, 8])
def test_points_of_the_branch_are_cycles_of_their_system(rubbing, harmonics):
    for here in follow(rubbing, 4, harmonics):
        result = solve_cold(rubbing(GROWTH, here.parameter, DAMPING), harmonics)
        assert np.allclose(here.point.coefficients, result.limit_cycle.coefficients, atol=1e-8)
        assert here.residual <= 1e-11


def test_a_start_that_is_no_cycle_is_refused(rubbing):
    points = branch(friction_family(rubbing), Point(np.array([[1e-3, 0.0]]), 5.0),
                    2.0 * FOLD_TORQUE, FOLD_TORQUE, 1, (0,), phase_of((0,), 1, 0))
    with pytest.raises(ContinuationError, match="does not converge"):
        next(points)
