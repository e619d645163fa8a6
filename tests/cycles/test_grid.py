import numpy as np
import pytest

from shimmy_ros.cycles import prediction
from shimmy_ros.cycles.grid import GridPoints, predict_grid
from shimmy_ros.cycles.settings import Settings
from shimmy_ros.cycles.stable_cycle import stable_cycle
from shimmy_ros.cycles.verdict import Verdict
from shimmy_ros.gear.parameter_file import reference_parameters
from shimmy_ros.gear.parameters import Limits, ParameterError
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
def test_each_answer_is_the_verdict_from_a_cold_start(threads):
    points = grid(np.linspace(0.4, 100.0, 24), np.array([5.0, 20.0, 0.0, 50.0]),
                  np.array([5.0, 0.0, 20.0, 15.0]))
    settings = Settings(limits=Limits(0.1, 0.1, 0.3))
    found = predict_grid(points, settings, threads=threads)
    outcomes = set()
    for index in range(len(points)):
        alone = stable_cycle(points.point(index), settings)
        outcomes.add(alone.outcome)
        assert found.outcome[index] == alone.outcome.value
        assert found.within_limits[index] == (not alone.excesses)
        if alone.orbit is None:
            assert np.isnan(found.frequency[index])
            np.testing.assert_array_equal(found.amplitude[index], alone.amplitude)
        else:
            assert found.frequency[index] == pytest.approx(alone.frequency_hz, rel=1e-8)
            assert found.amplitude[index] == pytest.approx(alone.amplitude, rel=1e-7)
    assert {Outcome.LIMIT_CYCLE, Outcome.NO_LIMIT_CYCLE, Outcome.NOT_ROLLING} <= outcomes
    assert not found.within_limits.all()


def test_every_outcome_has_its_name_and_its_amplitude(monkeypatch):
    points = grid(np.array([30.0, 31.0, 32.0]), np.array([5.0]), np.array([5.0]))
    told = {30.0: Outcome.UNBOUNDED, 31.0: Outcome.NOT_PERIODIC, 32.0: Outcome.NOT_CONVERGED}

    def verdict(point, settings, start):
        outcome = told[point.velocity]
        return Verdict(point, settings, outcome, envelope=(
            np.full(4, 0.3) if outcome is Outcome.NOT_PERIODIC else None))

    monkeypatch.setattr(prediction, "stable_cycle", verdict)
    found = predict_grid(points, threads=1)
    assert found.outcome.tolist() == [outcome.value for outcome in told.values()]
    np.testing.assert_array_equal(found.amplitude[:, 1], [np.inf, 0.3, np.nan])
    assert np.isnan(found.frequency).all()
    # The envelope's strut tilt passes its limit of 0.2 rad.
    assert found.within_limits.tolist() == [True, False, True]


def test_a_bad_point_is_refused_by_name():
    points = grid(np.array([30.0, 31.0]), np.array([5.0]), np.array([np.nan]))
    with pytest.raises(ParameterError, match=r"damper\.coulomb_torque is nan"):
        predict_grid(points, threads=1)
