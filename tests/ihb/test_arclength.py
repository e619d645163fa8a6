import itertools

import numpy as np
import pytest

from shimmy_ros.ihb.arclength import ContinuationError, Evaluation, locate_turn, trace


class Ellipse:
    """x^2 + (p / 1000)^2 = 1, of very different sizes in its two unknowns."""

    def evaluate(self, y):
        x, p = y[0], y[1] / 1000.0
        return Evaluation(np.array([x**2 + p**2 - 1.0]), np.array([[2.0 * x, 2.0 * p / 1000.0]]),
                          abs(x**2 + p**2 - 1.0))

    def sizes(self, y):
        return np.array([1.0, 1000.0])


class HalfLine(Ellipse):
    """x = p, which is not defined beyond p = 1."""

    def evaluate(self, y):
        if y[1] > 1.0:
            raise ValueError("beyond the end")
        return Evaluation(y[:1] - y[1:], np.array([[1.0, -1.0]]), abs(float(y[0] - y[1])))

    def sizes(self, y):
        return np.ones(2)


@pytest.mark.parametrize("direction", [1, -1])
def test_a_closed_curve_is_followed_all_the_way_round(direction):
    points = list(itertools.islice(trace(Ellipse(), np.array([1.01, 1.0]), direction), 80))
    angle = np.unwrap([np.arctan2(point.y[1] / 1000.0, point.y[0]) for point in points])
    assert all(point.evaluation.error < 1e-11 for point in points)
    assert np.all(np.diff(angle) * direction > 0.0)
    assert abs(angle[-1] - angle[0]) > 2.0 * np.pi
    assert max(np.abs(np.diff(angle))) < 0.25


def test_a_turn_is_located():
    curve = Ellipse()
    before = None
    turns = []
    for here in itertools.islice(trace(curve, np.array([1.0, 0.0]), 1), 80):
        if before is not None and before.slope * here.slope < 0.0:
            turns.append(locate_turn(curve, before, here).y)
        before = here
    assert len(turns) >= 2
    assert turns[0] == pytest.approx([0.0, 1000.0], abs=1e-8)
    assert turns[1] == pytest.approx([0.0, -1000.0], abs=1e-8)


def test_the_end_of_a_curve_is_reported_where_it_is():
    points = []
    with pytest.raises(ContinuationError, match="could not be followed beyond parameter 1"):
        points.extend(trace(HalfLine(), np.zeros(2), 1))
    assert points[-1].y == pytest.approx([1.0, 1.0], abs=1e-5)


def test_a_start_far_from_the_curve_is_refused():
    with pytest.raises(ContinuationError, match="start at parameter 3000 does not converge"):
        next(trace(Ellipse(), np.array([0.5, 3000.0]), 1))
