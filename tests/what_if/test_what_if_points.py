"""What is answered for each point: the verdict, accuracy, all cycles, triggers, limits."""

from __future__ import annotations

import itertools
import math

import numpy as np
import pytest

from shimmy_ros.cycles import prediction
from shimmy_ros.cycles.limit_cycles import all_cycles
from shimmy_ros.cycles.settings import Settings
from shimmy_ros.cycles.stable_cycle import stable_cycle
from shimmy_ros.cycles.trigger import trigger
from shimmy_ros.cycles.verdict import Kick, Verdict
from shimmy_ros.gear.parameters import Damper, Gear, Limits, changed, ranges
from shimmy_ros.gear.system import OperatingPoint
from shimmy_ros.ihb.solution import Outcome
from shimmy_ros.what_if.tables import tables


def at(present, velocity=40.0, **values):
    of = {kind: {name: value for name, value in values.items() if name in ranges(kind)}
          for kind in (Gear, Damper)}
    return OperatingPoint(changed(present.gear, **of[Gear]), changed(present.damper, **of[Damper]),
                          velocity)


@pytest.mark.parametrize("seed", range(60))
def test_random_queries_are_answered_with_the_verdicts(present, points, random_queries, seed):
    query = random_queries.good(seed)
    names = [name for name in query
             if name in ranges(Gear) or name in ranges(Damper) or name == "taxi_velocity"]
    grid = list(itertools.product(*(random_queries.values(query[name]) for name in names)))
    found = points(random_queries.text(query, seed))
    assert len(found) == len(grid)
    for point, values in zip(found, grid, strict=True):
        named = dict(zip(names, values, strict=True))
        velocity = named.pop("taxi_velocity", 40.0)
        settings = Settings(query.get("harmonics", 4),
                            limits=changed(Limits(), **query.get("limits", {})))
        expected = stable_cycle(at(present, velocity, **named), settings)
        answer = point["limit_cycle"]
        assert answer["outcome"] == expected.outcome.value
        assert [excess["quantity"] for excess in answer["beyond_limits"]] == [
            excess.quantity for excess in expected.excesses]
        orbit = expected.orbit
        if orbit is None:
            assert answer["amplitude"] is answer["frequency"] is answer["error"] is None
            assert answer["method"] is answer["harmonics"] is answer["multiplier"] is None
            continue
        assert list(answer["amplitude"].values()) == pytest.approx(
            orbit.amplitude.tolist(), rel=1e-7)
        assert list(answer["peak_velocity"].values()) == pytest.approx(
            expected.peak_velocity.tolist(), rel=1e-7)
        assert answer["frequency"] == pytest.approx(orbit.frequency_hz, rel=1e-7)
        assert answer["method"] == orbit.method
        assert answer["error"] <= settings.accuracy


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
    assert [cycle["amplitude"]["swivel"] for cycle in cycles] == pytest.approx([
        cycle.orbit.swivel for cycle in expected], rel=1e-9)
    assert [cycle["stable"] for cycle in cycles] == [cycle.orbit.stable for cycle in expected]
    assert "stable" in {cycle["role"] for cycle in cycles}
    start = trigger(at(present), expected)
    answer = point["trigger"]
    assert answer["outcome"] == "disturbance"
    assert answer["kick"] == {"starts": start.kick.starts, "dies": start.kick.dies,
                              "leads_to": "limit_cycle"}
    assert answer["release_angle"]["starts"] == start.release_angle.starts
    assert answer["cycle"]["role"] == "trigger"


def test_a_point_that_does_not_converge_says_so_and_others_are_answered(points, monkeypatch):
    from shimmy_ros.what_if import evaluate

    def failing(point, stable):
        if point.velocity == 40.0:
            raise ArithmeticError("lost the way")
        return []

    monkeypatch.setattr(evaluate, "all_cycles", failing)
    found = points({"taxi_velocity": [30.0, 40.0, 50.0], "return": ["all_cycles"]})
    assert [point["all_cycles"]["outcome"] for point in found] == [
        "limit_cycle", "not_converged", "limit_cycle"]
    assert found[1]["all_cycles"]["message"] == "did not converge: lost the way"


def test_a_cycle_beyond_the_limits_is_marked_as_such(points):
    wanted = ["limit_cycle", "all_cycles"]
    wide, narrow = (points({"limits": {"swivel": limit}, "return": wanted})[0]
                    for limit in (0.2, "2 deg"))
    assert wide["limit_cycle"]["beyond_limits"] == []
    (excess,) = narrow["limit_cycle"]["beyond_limits"]
    assert excess == {"quantity": "swivel", "limit": math.radians(2.0),
                      "value": narrow["limit_cycle"]["amplitude"]["swivel"]}
    stable = next(cycle for cycle in narrow["all_cycles"]["cycles"] if cycle["role"] == "stable")
    assert [excess["quantity"] for excess in stable["beyond_limits"]] == ["swivel"]
    # The cycle on which the damper locks passes every limit.
    assert len(wide["all_cycles"]["cycles"][-1]["beyond_limits"]) == 3
    assert "beyond limits" not in table({"limit_cycle": wide["limit_cycle"]})
    assert table({"limit_cycle": narrow["limit_cycle"]}).splitlines()[1].endswith("  swivel")


def table(point):
    (text,) = tables({"points": [{"index": 0, "at": {}, **point}], "inputs": {}})
    return text


@pytest.fixture
def verdict_of(monkeypatch):
    """Points come to what this is told."""
    told = {}
    monkeypatch.setattr(prediction, "stable_cycle", lambda point, settings, start: Verdict(
        point, settings, **told))

    def tell(outcome, **values):
        told.clear()
        told.update(outcome=outcome, **values)

    return tell


def test_growth_without_bound_is_no_limit_cycle_and_says_so(points, verdict_of, present):
    values = {"rest_is_stable": True, "kick": Kick(0.4, 0.5)}
    verdict_of(Outcome.UNBOUNDED, **values)
    message = Verdict(at(present), present.settings, Outcome.UNBOUNDED, **values).message
    assert message.startswith("unbounded: motion grows")
    assert message.endswith("a kick of the swivel of 0.5 rad/s leads there, one of 0.4 rad/s dies")
    (point,) = points({"return": ["limit_cycle", "margin"]})
    answer = point["limit_cycle"]
    assert (answer["outcome"], answer["message"]) == ("unbounded", message)
    assert answer["amplitude"] is answer["envelope"] is answer["method"] is None
    assert answer["kick"] == {"dies": 0.4, "grows": 0.5, "unbounded": None}
    assert answer["rest_is_stable"] is True
    assert (answer["beyond_limits"], answer["further_stable_cycles"]) == ([], [])
    assert point["margin"]["outcome"] == "unbounded"
    assert point["margin"]["message"] == (
        f"{message}; there is no limit cycle that could end in a fold")
    for folds in point["margin"]["folds"].values():
        assert folds["below"] is folds["above"] is folds["distance"] is None
    shown = table({"limit_cycle": answer}).splitlines()
    assert shown[1].split()[0] == "unbounded"
    assert shown[2] == f"U{message[1:]}."


def test_motion_that_is_not_periodic_has_its_envelope(points, verdict_of):
    envelope = np.array([0.01, 0.7, 0.7, 0.002])
    verdict_of(Outcome.NOT_PERIODIC, envelope=envelope)
    (point,) = points({})
    answer = point["limit_cycle"]
    assert answer["outcome"] == "not_periodic"
    assert list(answer["envelope"].values()) == envelope.tolist()
    assert answer["amplitude"] is answer["peak_velocity"] is answer["frequency"] is None
    assert answer["beyond_limits"] == [{"quantity": "swivel", "value": 0.7, "limit": 0.5}]
    assert f"{math.degrees(0.7):.5g}" in table({"limit_cycle": answer})


def test_other_stable_cycles_are_counted_in(points, verdict_of, present):
    found, other = (stable_cycle(at(present, velocity)).orbit for velocity in (40.0, 60.0))
    verdict_of(Outcome.LIMIT_CYCLE, orbit=found, further=(other,), rest_is_stable=True,
               kick=Kick(0.4, 0.5, 8.0))
    (point,) = points({})
    assert point["limit_cycle"]["kick"] == {"dies": 0.4, "grows": 0.5, "unbounded": 8.0}
    (further,) = point["limit_cycle"]["further_stable_cycles"]
    assert further["frequency"] == other.frequency_hz
    assert further["amplitude"]["swivel"] == other.swivel
    assert f"{math.degrees(other.swivel):.5g} deg" in table({"limit_cycle": point["limit_cycle"]})
