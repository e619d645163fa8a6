"""What is answered for each point: the predictor's own, accuracy, all cycles, triggers."""

from __future__ import annotations

import itertools
import math

import pytest

from shimmy_ros.cycles.limit_cycles import all_cycles
from shimmy_ros.cycles.prediction import Predictor
from shimmy_ros.cycles.trigger import trigger
from shimmy_ros.gear.parameters import Damper, Gear, changed, ranges
from shimmy_ros.gear.system import OperatingPoint


def at(present, velocity=40.0, **values):
    of = {kind: {name: value for name, value in values.items() if name in ranges(kind)}
          for kind in (Gear, Damper)}
    return OperatingPoint(changed(present.gear, **of[Gear]), changed(present.damper, **of[Damper]),
                          velocity)


@pytest.mark.parametrize("seed", range(60))
def test_random_queries_are_answered_as_the_predictor_does(present, points, random_queries, seed):
    query = random_queries.good(seed)
    names = [name for name in query
             if name in ranges(Gear) or name in ranges(Damper) or name == "taxi_velocity"]
    grid = list(itertools.product(*(random_queries.values(query[name]) for name in names)))
    found = points(random_queries.text(query, seed))
    assert len(found) == len(grid)
    for point, values in zip(found, grid, strict=True):
        named = dict(zip(names, values, strict=True))
        velocity = named.pop("taxi_velocity", 40.0)
        expected = Predictor(query.get("harmonics", 4)).predict(at(present, velocity, **named))
        answer = point["limit_cycle"]
        assert answer["outcome"] == expected.outcome
        cycle = expected.limit_cycle
        if cycle is None:
            assert answer["amplitude"] is answer["frequency"] is answer["error"] is None
            continue
        assert list(answer["amplitude"].values()) == pytest.approx(
            cycle.amplitude().tolist(), rel=1e-7)
        assert list(answer["peak_velocity"].values()) == pytest.approx(
            cycle.peak_velocity().tolist(), rel=1e-7)
        assert answer["frequency"] == pytest.approx(cycle.frequency_hz, rel=1e-7)


def test_the_estimated_error_covers_the_true_one(points):
    coarse = points({"taxi_velocity": {"from": 20, "to": 100, "points": 9}, "harmonics": 2})
    fine = points({"taxi_velocity": {"from": 20, "to": 100, "points": 9}, "accuracy": 1e-5})
    for rough, exact in zip(coarse, fine, strict=True):
        for name, value in exact["limit_cycle"]["amplitude"].items():
            assert abs(rough["limit_cycle"]["amplitude"][name] / value - 1.0) <= (
                rough["limit_cycle"]["error"] + 1e-5)
        assert exact["limit_cycle"]["error"] <= 1e-5


def test_accuracy_is_reached_where_friction_dominates(points):
    (point,) = points({"taxi_velocity": 10, "quadratic_damping": 50, "coulomb_torque": 10,
                       "accuracy": 1e-3})
    answer = point["limit_cycle"]
    # The independent reference of this corner.
    assert answer["amplitude"]["swivel"] == pytest.approx(0.0199154, rel=1e-3)
    assert answer["error"] <= 1e-3
    assert answer["peak_velocity"]["swivel"] > 2.0 * math.pi * answer["frequency"] * 0.019


def test_no_limit_cycle_and_standing_are_answers(points):
    found = points({"taxi_velocity": [0.5, 40.0], "coulomb_torque": 900.0})
    assert [point["limit_cycle"]["outcome"] for point in found] == ["not_rolling", "no_limit_cycle"]
    found = points({"taxi_velocity": [0.5, 40.0], "coulomb_torque": 900.0, "accuracy": 0.01})
    assert [point["limit_cycle"]["outcome"] for point in found] == ["not_rolling", "no_limit_cycle"]


def test_all_cycles_and_trigger_are_the_gears(present, points):
    (point,) = points({"return": ["all_cycles", "trigger", "limit_cycle"]})
    assert list(point) == ["index", "at", "all_cycles", "trigger", "limit_cycle"]
    expected = all_cycles(at(present))
    cycles = point["all_cycles"]["cycles"]
    assert [cycle["role"] for cycle in cycles] == [cycle.role.value for cycle in expected]
    assert [cycle["amplitude"]["swivel"] for cycle in cycles] == [
        cycle.orbit.swivel for cycle in expected]
    assert [cycle["stable"] for cycle in cycles] == [cycle.orbit.stable for cycle in expected]
    assert "stable" in {cycle["role"] for cycle in cycles}
    start = trigger(at(present), expected)
    answer = point["trigger"]
    assert answer["outcome"] == "disturbance"
    assert answer["kick"] == {"starts": start.kick.starts, "dies": start.kick.dies}
    assert answer["release_angle"]["starts"] == start.release_angle.starts
    assert answer["cycle"]["role"] == "trigger"


def test_a_point_that_does_not_converge_says_so_and_others_are_answered(points, monkeypatch):
    from shimmy_ros.what_if import evaluate

    def failing(point):
        if point.velocity == 40.0:
            raise ArithmeticError("lost the way")
        return []

    monkeypatch.setattr(evaluate, "all_cycles", failing)
    found = points({"taxi_velocity": [30.0, 40.0, 50.0], "return": ["all_cycles"]})
    assert [point["all_cycles"]["outcome"] for point in found] == [
        "no_limit_cycle", "not_converged", "no_limit_cycle"]
    assert found[1]["all_cycles"]["message"] == "did not converge: lost the way"
