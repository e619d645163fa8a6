import numpy as np
import pytest

from shimmy_ros.ihb.solution import LimitCycle, Outcome, Result

CYCLE = LimitCycle(np.array([[3.0, 0.0, 4.0, 0.0], [0.0, 0.5, 0.0, 0.0]]), 4.0 * np.pi, -1)


def test_a_cycle_knows_its_frequency_and_its_peaks():
    assert CYCLE.harmonics == 2
    assert CYCLE.frequency_hz == pytest.approx(2.0)
    assert CYCLE.period == pytest.approx(0.5)
    assert CYCLE.amplitude() == pytest.approx([5.0, 0.5])
    assert CYCLE.peak_velocity() == pytest.approx([20.0 * np.pi, 6.0 * np.pi])


def test_its_motion_repeats_and_its_velocity_is_the_derivative_of_its_position():
    time = np.linspace(0.0, 0.5, 2001)
    position, velocity = CYCLE.position(time), CYCLE.velocity(time)
    assert position.shape == velocity.shape == (2, 2001)
    assert position[:, 0] == pytest.approx([3.0, 0.5])
    assert position[:, -1] == pytest.approx(position[:, 0])
    assert position[:, 1000] == pytest.approx(-position[:, 0])
    slope = np.gradient(position, time, axis=1, edge_order=2)
    assert slope == pytest.approx(velocity, abs=1e-3)
    assert np.max(np.abs(position), axis=1) == pytest.approx(CYCLE.amplitude(), rel=1e-5)
    assert np.max(np.abs(velocity), axis=1) == pytest.approx(CYCLE.peak_velocity(), rel=1e-5)


@pytest.mark.parametrize(("outcome", "cycle"), [
    (Outcome.LIMIT_CYCLE, None), (Outcome.NO_LIMIT_CYCLE, CYCLE), (Outcome.NOT_CONVERGED, CYCLE)])
def test_a_cycle_belongs_to_one_outcome_alone(outcome, cycle):
    with pytest.raises(ValueError, match="belongs to the outcome LIMIT_CYCLE and to no other"):
        Result(outcome, cycle, 0, 0.0, False, "")
