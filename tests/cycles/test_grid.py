import numpy as np
import pytest

from shimmy_ros.cycles.grid import GridPoints, predict_grid
from shimmy_ros.cycles.prediction import NOT_ROLLING, Predictor
from shimmy_ros.gear.parameter_file import reference_parameters
from shimmy_ros.gear.parameters import ParameterError
from shimmy_ros.ihb.solution import Outcome


def grid(velocities, quadratic, coulomb):
    """Rows over the velocities, alternating in direction, for each pair of damper values."""
    gear, _ = reference_parameters()
    rows = [velocities if number % 2 == 0 else velocities[::-1] for number in range(len(quadratic))]
    repeat = len(velocities)
    count = repeat * len(quadratic)
    return GridPoints(gear, np.concatenate(rows), np.full(count, 2.0),
                      np.repeat(quadratic, repeat), np.repeat(coulomb, repeat))


@pytest.mark.parametrize("threads", [1, 3])
def test_each_answer_is_that_of_a_cold_predictor(threads):
    points = grid(np.linspace(0.4, 100.0, 24), np.array([5.0, 20.0, 0.0, 50.0]),
                  np.array([5.0, 0.0, 20.0, 15.0]))
    found = predict_grid(points, threads=threads)
    outcomes = set()
    for index in range(len(points)):
        alone = Predictor().predict(points.point(index))
        outcomes.add(alone.outcome)
        assert found.outcome[index] == alone.outcome
        if alone.limit_cycle is None:
            assert np.isnan(found.frequency[index])
            assert np.isnan(found.amplitude[index]).all()
        else:
            assert found.frequency[index] == pytest.approx(alone.limit_cycle.frequency_hz, rel=1e-8)
            assert found.amplitude[index] == pytest.approx(alone.limit_cycle.amplitude(), rel=1e-7)
            assert found.residual[index] <= 1e-9
    assert {Outcome.LIMIT_CYCLE.value, Outcome.NO_LIMIT_CYCLE.value, NOT_ROLLING} <= outcomes


def test_a_bad_point_is_refused_by_name():
    points = grid(np.array([30.0, 31.0]), np.array([5.0]), np.array([np.nan]))
    with pytest.raises(ParameterError, match=r"damper\.coulomb_torque is nan"):
        predict_grid(points, threads=1)
