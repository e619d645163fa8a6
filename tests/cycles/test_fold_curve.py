"""Curves of folds over two parameters: their symmetry, both methods, and maps bounded by them."""

from itertools import islice

import numpy as np
import pytest

from shimmy_ros.cycles import fold_curve as fold_curve_module
from shimmy_ros.cycles.amplitude_map import AmplitudeMap
from shimmy_ros.cycles.branches import ContinuationError, Line, follow
from shimmy_ros.cycles.fold_curve import FoldPoint, Window, fold_curve
from shimmy_ros.cycles.settings import BALANCE, Settings
from shimmy_ros.cycles.stable_cycle import stable_cycle
from shimmy_ros.gear.axes import VELOCITY, Axis
from shimmy_ros.gear.parameter_file import reference_parameters
from shimmy_ros.gear.parameters import Damper
from shimmy_ros.gear.system import OperatingPoint, family_between
from shimmy_ros.ihb.solution import Outcome

GEAR, _ = reference_parameters()
FRICTION, DAMPING = Axis("damper.coulomb_torque"), Axis("damper.quadratic_damping")


def point_at(velocity, quadratic=10.0, torque=20.0):
    return OperatingPoint(GEAR, Damper(2.0, quadratic, torque), velocity)


def fold_along(axis, point, high, settings):
    """The fold from ``point`` on along ``axis``, and the last stable cycle a bit before it."""
    low = axis.value(point)
    line = Line(family_between(point, axis.at(point, high)))
    start = stable_cycle(point, settings).orbit
    stable = []
    for item in follow(line, start, 0.0, 1, settings):
        value = low + item.position * (high - low)
        if item.is_fold:
            beside = [entry for entry in stable if entry[0] < value - 0.02 * (high - low)][-1]
            return value, item.orbit, beside
        stable.append((value, item.orbit))
    raise AssertionError("no fold")


def curve(axis, low, high, settings, start, count):
    """``count`` folds over ``axis`` and the velocity, from ``start`` on."""
    fold, orbit, (beside, stable) = fold_along(axis, start, high, settings)
    window = Window(start, axis, Axis(VELOCITY), (low, 30.0), (high, 60.0))
    return list(islice(fold_curve(window, FoldPoint(fold, start.velocity, orbit),
                                  (beside, start.velocity), stable, settings), count))


def test_the_product_of_damping_and_friction_is_one_curve_over_the_velocity():
    settings = Settings()
    frictions = curve(FRICTION, 100.0, 250.0, settings, point_at(50.0, torque=120.0), 4)
    dampings = curve(DAMPING, 50.0, 125.0, settings, point_at(50.0, quadratic=60.0), 4)
    assert [fold.order for fold in frictions] == [0, 1, 2, 3]
    # The steps are not the same: compared are values of one smooth curve.
    velocity = np.array([fold.second for fold in frictions])
    product = np.array([10.0 * fold.first for fold in frictions])
    assert np.all(np.abs(np.diff(velocity)) > 0.5)
    other = np.array([fold.second for fold in dampings])
    ordered = np.argsort(velocity)
    smooth = np.polynomial.Polynomial.fit(velocity[ordered], product[ordered], 3)
    inside = (other >= velocity.min()) & (other <= velocity.max())
    assert inside.sum() >= 2
    np.testing.assert_allclose([20.0 * fold.first for fold in np.array(dampings)[inside]],
                               smooth(other[inside]), rtol=2e-4)
    assert dampings[0].first * 20.0 == pytest.approx(frictions[0].first * 10.0, rel=1e-7)


def test_every_fold_has_a_multiplier_of_one():
    for fold in curve(FRICTION, 100.0, 250.0, Settings(), point_at(50.0, torque=120.0), 3):
        assert fold.orbit.multiplier == pytest.approx(1.0, abs=1e-4)
        assert fold.orbit.stable is None


def test_the_balance_tracks_its_own_folds_at_once():
    settings = Settings(8, method=BALANCE)
    folds = curve(FRICTION, 100.0, 250.0, settings, point_at(50.0, torque=120.0), 6)
    for fold in folds[1:3]:
        point = point_at(fold.second, torque=120.0)
        value, _, _ = fold_along(FRICTION, point, 250.0, settings)
        assert fold.first == pytest.approx(value, rel=1e-6)
    exact = curve(FRICTION, 100.0, 250.0, Settings(), point_at(50.0, torque=120.0), 1)
    assert folds[0].first == pytest.approx(exact[0].first, rel=0.02)


def test_a_lost_curve_is_an_error():
    settings = Settings()
    _, orbit, (beside, stable) = fold_along(FRICTION, point_at(50.0, torque=120.0), 250.0, settings)
    window = Window(point_at(50.0), FRICTION, Axis(VELOCITY), (100.0, 30.0), (250.0, 60.0))
    far = FoldPoint(110.0, 50.0, orbit)
    with pytest.raises(ContinuationError, match="could not be followed beyond"):
        list(fold_curve(window, far, (beside, 50.0), stable, settings))


@pytest.fixture
def long_steps(monkeypatch):
    """Fewer folds than a picture asks for."""
    monkeypatch.setattr(fold_curve_module, "_FIRST_STEP", 0.2)
    monkeypatch.setattr(fold_curve_module, "_LARGEST_STEP", 0.3)


def test_a_map_has_cycles_inside_its_folds_alone(long_steps):
    velocities, frictions = [44.0, 50.0, 56.0], [150.0, 168.0, 186.0]
    shimmy = AmplitudeMap(point_at(40.0), Axis(VELOCITY), FRICTION, velocities, frictions,
                          Settings())
    assert len(list(shimmy.fill())) == 3
    found = [[node.outcome is Outcome.LIMIT_CYCLE for node in row] for row in shimmy.rows]
    assert found == [[True, True, True], [False, False, True], [False, False, False]]
    folds = list(shimmy.trace_folds())
    (line,) = shimmy.curves
    assert folds == line
    assert shimmy.losses == []
    ordered = sorted(line, key=lambda fold: fold.order)
    velocity = [fold.first for fold in ordered]
    friction = [fold.second for fold in ordered]
    assert velocity == sorted(velocity) or velocity == sorted(velocity, reverse=True)
    assert min(velocity) < 44.5
    assert max(velocity) > 55.5
    ascending = np.argsort(velocity)
    for row, torque in enumerate(frictions):
        for column, speed in enumerate(velocities):
            if min(velocity) <= speed <= max(velocity):
                # The nodes are far enough from the curve for its straight pieces.
                limit = np.interp(speed, np.array(velocity)[ascending],
                                  np.array(friction)[ascending])
                assert found[row][column] == (torque < limit)


def test_a_curve_ends_in_a_cusp_where_it_meets_another():
    """At 7 m/s there are three folds in the friction; the two with least meet near 7.3 m/s."""
    start = point_at(7.26, torque=9.0)
    fold, orbit, (beside, stable) = fold_along(FRICTION, start, 14.0, Settings())
    window = Window(start, FRICTION, Axis(VELOCITY), (6.0, 7.25), (20.0, 7.4))
    folds = list(fold_curve(window, FoldPoint(fold, 7.26, orbit), (beside, 7.26), stable,
                            Settings()))
    last = max(folds, key=lambda item: item.second)
    assert last.second == pytest.approx(7.293, abs=2e-3)
    assert last.first == pytest.approx(12.3, abs=0.1)
    first = min(folds, key=lambda item: item.second)
    assert first.second < 7.25
    # Beyond it the branch passes without a fold.
    beyond = point_at(last.second + 0.01, torque=9.0)
    line = Line(family_between(beyond, FRICTION.at(beyond, 16.0)))
    points = list(follow(line, stable_cycle(beyond).orbit, 0.0, 1, Settings()))
    assert points[-1].position == 1.0
    assert not any(point.is_fold for point in points)
