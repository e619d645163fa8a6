"""Branches of limit cycles: both methods, folds, ends, guards, and diagrams made of them."""

import json
from dataclasses import replace
from functools import cache
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest

from shimmy_ros.cycles.branches import (
    LARGEST_SWIVEL,
    ContinuationError,
    Line,
    carry,
    follow,
)
from shimmy_ros.cycles.diagram import Diagram
from shimmy_ros.cycles.orbits import balance_near, balance_orbit, shoot
from shimmy_ros.cycles.settings import AUTO, BALANCE, SHOOTING, Settings
from shimmy_ros.cycles.stable_cycle import stable_cycle
from shimmy_ros.gear.axes import VELOCITY, Axis
from shimmy_ros.gear.parameter_file import reference_parameters
from shimmy_ros.gear.parameters import Damper, ParameterError
from shimmy_ros.gear.system import OperatingPoint, family_between, gear_system
from shimmy_ros.ihb.solution import Outcome
from shimmy_ros.ihb.solve import solve_cold

GEAR, _ = reference_parameters()
REFERENCE = json.loads(
    (Path(__file__).parents[1] / "data" / "limit_cycles.json").read_text())["cases"]
FRICTION, DAMPING, TRAIL = "damper.coulomb_torque", "damper.quadratic_damping", "gear.trail"


def point_at(velocity, quadratic=10.0, torque=20.0):
    return OperatingPoint(GEAR, Damper(2.0, quadratic, torque), velocity)


@cache
def branch(name, low, high, direction, method=AUTO, velocity=40.0, torque=20.0, stops=()):
    """The branch of the stable cycle at the point, as (values, points)."""
    point, axis = point_at(velocity, torque=torque), Axis(name)
    start = balance_orbit(gear_system(point), solve_cold(gear_system(point), 4).limit_cycle)
    line = Line(family_between(axis.at(point, low), axis.at(point, high)))
    position = (axis.value(point) - low) / (high - low)
    places = tuple((stop - low) / (high - low) for stop in stops)
    points = list(follow(line, start, position, direction, Settings(method=method), places))
    return [low + item.position * (high - low) for item in points], points


def fold_of(values, points):
    (fold,) = [(value, item) for value, item in zip(values, points, strict=True) if item.is_fold]
    return fold


def check_every_point(line, points):
    """Each is a cycle: shooting from it comes back to it, and says the same of its stability."""
    for item in points:
        orbit = item.orbit
        if not item.is_fold and orbit.method == BALANCE:
            found = shoot(line.system(item.position), *orbit.initial_state())
            assert found.same_as(orbit)
            assert found.stable == orbit.stable
            assert not found.sticks
        elif orbit.method == SHOOTING:
            state = orbit.source.state
            end = orbit.source.trajectory.end
            assert np.abs(end + state).max() <= 1e-7 * np.abs(end).max()


def test_velocities_on_the_way_are_met_exactly_and_answer_as_a_cold_start():
    stops = (45.0, 60.0, 80.0, 100.0)
    values, points = branch(VELOCITY, 10.0, 100.0, 1, stops=stops)
    for stop in stops:
        (index,) = np.flatnonzero(np.isclose(values, stop, rtol=1e-14))
        system = gear_system(point_at(stop))
        cold = balance_orbit(system, solve_cold(system, 4).limit_cycle)
        assert points[index].orbit.same_as(cold, 1e-8)
    assert values[-1] == 100.0
    assert all(item.orbit.stable for item in points)
    assert {item.orbit.method for item in points} == {BALANCE}


def test_the_estimated_error_covers_the_reference():
    cases = [case for case in REFERENCE if (
        case["quadratic_damping"], case["coulomb_torque"]) == (10, 20)]
    velocities = tuple(float(case["taxi_velocity"]) for case in cases)
    values, points = branch(VELOCITY, 10.0, 100.0, 1, velocity=11.0,
                            stops=tuple(v for v in velocities if v > 11.0))
    compared = 0
    for case in cases:
        for value, item in zip(values, points, strict=True):
            if abs(value - case["taxi_velocity"]) < 1e-9:
                off = np.abs(item.orbit.amplitude / case["amplitude"] - 1.0).max()
                assert off <= max(item.orbit.error, 1e-5)
                off = abs(item.orbit.frequency_hz / case["frequency"] - 1.0)
                assert off <= max(item.orbit.error, 1e-6)
                compared += 1
    assert compared >= 5


def test_the_fold_in_the_friction_is_met_and_leads_to_the_trigger():
    values, points = branch(FRICTION, 15.0, 300.0, 1, stops=(20.0,))
    value, fold = fold_of(values, points)
    assert value == pytest.approx(163.8147, abs=1e-3)
    assert fold.orbit.multiplier == pytest.approx(1.0, abs=1e-5)
    assert fold.orbit.stable is None
    before = points.index(fold)
    assert all(item.orbit.stable for item in points[:before])
    assert all(item.orbit.stable is False for item in points[before + 1:])
    assert values[-1] == 15.0
    (index,) = np.flatnonzero(np.isclose(values[before:], 20.0))
    inner = points[before + index].orbit
    assert inner.method == SHOOTING
    assert inner.sticks
    assert inner.swivel == pytest.approx(0.00343784, rel=1e-5)
    line = Line(family_between(point_at(40.0, torque=15.0), point_at(40.0, torque=300.0)))
    check_every_point(line, points)


def test_shooting_alone_finds_the_same_fold():
    values, points = branch(FRICTION, 120.0, 200.0, 1, SHOOTING, torque=130.0)
    assert fold_of(values, points)[0] == pytest.approx(163.81471, abs=1e-4)
    assert {item.orbit.method for item in points[1:]} == {SHOOTING}


def test_folds_depend_on_the_product_of_damping_and_friction():
    friction, _ = fold_of(*branch(FRICTION, 15.0, 300.0, 1, stops=(20.0,)))
    damping, _ = fold_of(*branch(DAMPING, 9.0, 200.0, 1))
    assert damping * 20.0 == pytest.approx(friction * 10.0, rel=1e-7)


def test_where_the_swivel_sticks_shooting_takes_over():
    with pytest.raises(ContinuationError, match="could not be followed"):
        branch(FRICTION, 70.0, 140.0, 1, BALANCE, velocity=10.0, torque=80.0)
    values, points = branch(FRICTION, 70.0, 140.0, 1, AUTO, velocity=10.0, torque=80.0)
    value, fold = fold_of(values, points)
    assert value == pytest.approx(105.6482, abs=1e-3)
    assert fold.orbit.sticks
    sticking = [item for item in points[1:] if item.orbit.sticks]
    assert len(sticking) > 5
    assert {item.orbit.method for item in sticking} == {SHOOTING}
    assert any(item.orbit.stable for item in sticking)


def test_a_closed_branch_ends_where_it_began_and_both_methods_share_it():
    values, points = branch(TRAIL, -0.05, 0.25, 1, stops=(0.08,))
    assert values[-1] == pytest.approx(0.08, abs=1e-12)
    assert points[-1].orbit.same_as(points[0].orbit)
    folds = [value for value, item in zip(values, points, strict=True) if item.is_fold]
    np.testing.assert_allclose(folds, [0.211095, -0.011523], atol=2e-5)
    methods = [item.orbit.method for item in points]
    handed_over = [(a, b) for a, b in pairwise(methods) if a != b]
    assert (BALANCE, SHOOTING) in handed_over
    assert (SHOOTING, BALANCE) in handed_over
    back = branch(TRAIL, -0.05, 0.25, -1)
    again = [value for value, item in zip(*back, strict=True) if item.is_fold]
    np.testing.assert_allclose(again[::-1], folds, atol=1e-6)


@pytest.mark.parametrize("arguments", [
    (TRAIL, -0.05, 0.25, 1), (FRICTION, 15.0, 300.0, 1), (VELOCITY, 10.0, 100.0, 1)])
def test_no_step_jumps_to_rest_or_to_another_cycle(arguments):
    stops = {TRAIL: (0.08,), FRICTION: (20.0,), VELOCITY: (45.0, 60.0, 80.0, 100.0)}
    _, points = branch(*arguments, stops=stops[arguments[0]])
    for before, after in pairwise(points):
        assert abs(np.log(after.orbit.swivel / before.orbit.swivel)) < 0.5
        assert abs(np.log(after.orbit.frequency_hz / before.orbit.frequency_hz)) < 0.2
        # Between folds the branch goes one way: it does not turn back onto itself.
        if not (before.is_fold or after.is_fold):
            assert (after.position - before.position) * before.slope > 0.0


def test_a_branch_ends_at_no_damping_at_all():
    point = point_at(40.0)
    inner = shoot(gear_system(point),
                  *shoot(gear_system(point), np.array(
                      [6.5e-4, 0.0, -1.2e-6, 1.2e-3, -2.7e-3, 0.24, 0.24, 5e-2]), 0.0987
                  ).initial_state())
    assert inner.stable is False
    line = Line(family_between(point_at(40.0, quadratic=0.0), point_at(40.0, quadratic=20.0)))
    points = list(follow(line, inner, 0.5, -1, Settings()))
    assert points[-1].position == 0.0
    assert points[-1].orbit.swivel == pytest.approx(0.0033242, rel=1e-4)


def test_a_branch_that_grows_without_bound_ends():
    point = point_at(40.0)
    start = stable_cycle(point).orbit
    line = Line(family_between(point_at(40.0, quadratic=0.0), point))
    points = list(follow(line, start, 1.0, -1, Settings()))
    assert points[-1].orbit.swivel > LARGEST_SWIVEL
    assert points[-1].position > 0.0


def test_setting_out_across_an_end_of_the_line_gives_the_start_alone():
    point = point_at(40.0)
    start = stable_cycle(point).orbit
    line = Line(family_between(point, point_at(50.0)))
    assert len(list(follow(line, start, 0.0, -1, Settings()))) == 1


def test_carrying_ends_in_none_where_the_cycle_folds_away():
    start = stable_cycle(point_at(40.0)).orbit
    near = carry(start, point_at(40.0), point_at(41.0), Settings())
    assert near.same_as(stable_cycle(point_at(41.0)).orbit)
    far = carry(start, point_at(40.0), point_at(60.0, torque=100.0), Settings())
    assert far.same_as(stable_cycle(point_at(60.0, torque=100.0)).orbit, 1e-4)
    assert carry(start, point_at(40.0), point_at(40.0, torque=170.0), Settings()) is None


def test_a_cycle_that_the_balance_does_not_see_is_found_from_weaker_friction():
    """At 7 m/s four harmonics see cycles up to 7 N m, and there are some up to 22 N m."""
    point = point_at(7.0, torque=20.0)
    assert solve_cold(gear_system(point), 4).outcome is Outcome.NO_LIMIT_CYCLE
    found = stable_cycle(point).orbit
    assert found.stable
    assert found.sticks
    assert stable_cycle(replace(point, velocity=6.8)).orbit is None


def test_both_methods_have_the_same_counterparts():
    point = point_at(30.0)
    balanced = stable_cycle(point).orbit
    shot = stable_cycle(point, Settings(method=SHOOTING)).orbit
    assert shot.method == SHOOTING
    assert shot.same_as(balanced)
    again = balance_near(gear_system(point), shot, 4)
    np.testing.assert_allclose(again.amplitude, balanced.amplitude, rtol=1e-9)


def test_a_diagram_over_the_friction_has_stable_cycles_up_to_the_fold():
    values = [130.0, 140.0, 150.0, 160.0, 170.0, 180.0]
    diagram = Diagram(point_at(40.0), Axis(FRICTION), values, Settings())
    traced = list(diagram.trace_stable())
    assert traced == diagram.points
    assert [len(diagram.stable(index)) for index in range(6)] == [1, 1, 1, 1, 0, 0]
    assert [point.value for point in traced if point.is_fold] == [pytest.approx(163.8147, abs=1e-3)]
    assert diagram.losses == []


def test_a_diagram_of_everything_has_the_trigger_and_the_locked_cycle_too():
    diagram = Diagram(point_at(40.0), Axis(FRICTION), [140.0, 155.0, 170.0], Settings())
    for _ in diagram.trace_all():
        pass
    assert [len(diagram.cycles(index)) for index in range(3)] == [3, 3, 1]
    assert [len(diagram.stable(index)) for index in range(3)] == [1, 1, 0]
    sizes = sorted(point.orbit.swivel for point in diagram.cycles(0))
    assert sizes[0] < sizes[1] < 0.1 < 100.0 < sizes[2]
    assert diagram.losses == []


def test_values_have_to_ascend_and_settings_to_make_sense():
    with pytest.raises(ParameterError, match="must be at least two and ascend"):
        Diagram(point_at(40.0), Axis(VELOCITY), [40.0, 30.0], Settings())
    with pytest.raises(ParameterError, match="method is 'guess', but must be one of"):
        Settings(method="guess")
    with pytest.raises(ParameterError, match=r"accuracy is 0, but must be in \[1e-09, 0\.5\]"):
        Settings(accuracy=0.0)
