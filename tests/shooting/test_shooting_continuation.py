import itertools

import numpy as np
import pytest

from shimmy_ros.ihb.elements import Coulomb, QuadraticDamping
from shimmy_ros.ihb.system import System
from shimmy_ros.shooting.continuation import ContinuationError, continue_branch
from shimmy_ros.shooting.periodic import Outcome, limit_cycle

GROWTH, TORQUE, DRAG = 0.2, 0.05, 0.1


def with_torque(torque):
    return System([[1.0]], [[-GROWTH]], [[1.0]], (Coulomb(0, torque), QuadraticDamping(0, DRAG)))


def cycle_at(torque, speed):
    return limit_cycle(with_torque(torque), np.array([0.0, speed]), 6.2)


def branch(**options):
    arguments = {"direction": 1, "scale": 0.05, "bounds": (0.01, 1.0)} | options
    return continue_branch(with_torque, cycle_at(TORQUE, 2.0).cycle, TORQUE, **arguments)


def test_a_branch_passes_the_fold_and_ends_on_its_bound():
    points = list(branch())
    assert points[0].parameter == TORQUE
    assert points[-1].parameter == 0.01
    assert [point.fold for point in points].count(True) == 1
    fold = next(place for place, point in enumerate(points) if point.fold)
    assert all(point.cycle.stable for point in points[:fold])
    assert not any(point.cycle.stable for point in points[fold + 1:])
    assert all(point.slope > 0.0 for point in points[:fold])
    assert all(point.slope < 0.0 for point in points[fold + 1:])
    amplitudes = [point.cycle.amplitude[0] for point in points]
    assert all(before > after for before, after in itertools.pairwise(amplitudes))
    assert max(point.residual for point in points) < 1e-10
    unstable = min(points[fold + 1:], key=lambda point: abs(point.parameter - TORQUE))
    again = limit_cycle(with_torque(TORQUE), unstable.cycle.state, unstable.cycle.period)
    assert again.cycle.amplitude == pytest.approx([0.380133057], abs=1e-9)


def test_the_fold_is_exact():
    fold = next(point for point in branch() if point.fold)
    # One harmonic: the fold of -growth A + 4 T / pi + 8 D A^2 / (3 pi) = 0.
    assert fold.parameter == pytest.approx(3.0 * np.pi**2 * GROWTH**2 / (128.0 * DRAG), rel=2e-4)
    assert abs(fold.slope) < 1e-9
    assert fold.cycle.multipliers[0] == pytest.approx(1.0, abs=1e-8)
    speed = fold.cycle.state[1]
    for torque, outcome in ((fold.parameter - 1e-7, Outcome.LIMIT_CYCLE),
                            (fold.parameter + 1e-7, Outcome.FAILED)):
        assert {cycle_at(torque, factor * speed).outcome for factor in (0.997, 1.003)} == {outcome}


def test_the_branch_is_the_same_whatever_the_steps():
    folds = [next(point.parameter for point in branch(largest_step=step, first_step=step)
                  if point.fold) for step in (0.03, 0.4)]
    assert folds[0] == pytest.approx(folds[1], abs=1e-12)


def test_every_point_is_a_cycle_of_its_own_parameter():
    for point in itertools.islice(branch(direction=-1, largest_step=0.3), 6):
        alone = limit_cycle(with_torque(point.parameter), point.cycle.state, point.cycle.period)
        assert alone.iterations == 0
        assert alone.cycle.half_multipliers == pytest.approx(point.cycle.half_multipliers)


def test_a_branch_down_to_no_friction_ends_there():
    points = list(branch(direction=-1, bounds=(0.0, 1.0)))
    assert points[-1].parameter == 0.0
    assert points[-1].cycle.amplitude == pytest.approx([2.358901328], abs=1e-9)
    assert not any(point.fold for point in points)


def test_a_start_that_is_no_cycle_is_refused():
    cycle = cycle_at(0.0925, 1.2).cycle
    with pytest.raises(ContinuationError, match="start"):
        next(continue_branch(with_torque, cycle, 0.2, direction=1, scale=0.05))


def test_a_branch_ends_where_its_cycles_shrink_to_nothing():
    def with_growth(growth):
        return System([[1.0]], [[-growth]], [[1.0]], (QuadraticDamping(0, DRAG),))

    cycle = limit_cycle(with_growth(GROWTH), np.array([0.0, 2.3]), 6.2).cycle
    points = list(continue_branch(with_growth, cycle, GROWTH, direction=-1, scale=0.1,
                                  bounds=(-1.0, 1.0), largest_step=0.4))
    # To the order of its error, one harmonic gives 3 pi growth / (8 drag).
    last = points[-1]
    assert 0.0 < last.cycle.amplitude[0] < 1e-5
    assert last.parameter == pytest.approx(
        8.0 * DRAG * last.cycle.amplitude[0] / (3.0 * np.pi), rel=1e-5)
    assert last.cycle.period == pytest.approx(2.0 * np.pi, abs=1e-9)
