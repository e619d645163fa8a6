"""The inverse question: the value found is at the limit, and is the first; folds are respected."""

from __future__ import annotations

import itertools
import math
from dataclasses import replace

import numpy as np
import pytest

from shimmy_ros.cycles.prediction import Predictor
from shimmy_ros.cycles.verdict import Verdict
from shimmy_ros.gear.linear import linear_modes
from shimmy_ros.gear.parameter_file import reference_parameters
from shimmy_ros.gear.parameters import changed
from shimmy_ros.gear.system import OperatingPoint
from shimmy_ros.ihb.solution import Outcome
from shimmy_ros.what_if import scan
from shimmy_ros.what_if.query import with_values

TWO_DEGREES = math.radians(2.0)
VELOCITIES = {"from": 10, "to": 100}


@pytest.fixture
def find(points):
    """The one result of a find."""
    def answer(content, **query):
        (point,) = points({**query, "find": content})
        return point["find"]

    return answer


@pytest.fixture
def swivel(present):
    """Swivel amplitudes, as a Verdict has them, over velocities, with values changed."""
    def amplitudes(velocities, **values):
        predictor = Predictor()
        base = with_values(OperatingPoint(present.gear, present.damper, 0.0), values)
        found = []
        for velocity in velocities:
            verdict = predictor.predict(replace(base, velocity=float(velocity)))
            assert not verdict.failed
            found.append(float(verdict.amplitude[1]))
        return np.array(found)

    return amplitudes


@pytest.mark.parametrize(("parameter", "below"), [
    ("quadratic_damping", 0.08), ("coulomb_torque", 0.1), ("linear_damping", 0.1)])
def test_at_one_velocity_the_amplitude_is_the_limit(find, swivel, parameter, below):
    found = find({"smallest": parameter, "below": below})
    assert found["outcome"] == "found"
    assert found["decided_by"]["by"] == "amplitude"
    assert found["decided_by"]["taxi_velocity"] == 40.0
    assert found["decided_by"]["cycle"]["amplitude"]["swivel"] == pytest.approx(below, rel=1e-8)
    assert swivel([40.0], **{parameter: found["value"]})[0] == pytest.approx(below, rel=2e-3)


def test_what_is_found_scales_as_orbits_do(find):
    """An orbit times s belongs to C_d / s and s T_CF."""
    first = find({"smallest": "quadratic_damping", "below": 0.08})
    scaled = find({"smallest": "quadratic_damping", "below": 0.04}, coulomb_torque=10.0)
    assert scaled["value"] == pytest.approx(2.0 * first["value"], rel=1e-9)
    fold = find({"smallest": "quadratic_damping", "below": 0})
    other = find({"smallest": "coulomb_torque", "below": 0})
    assert fold["decided_by"]["by"] == other["decided_by"]["by"] == "fold"
    assert fold["value"] * 20.0 == pytest.approx(other["value"] * 10.0, rel=1e-6)


def test_over_an_interval_no_velocity_exceeds_the_limit_and_one_meets_it(find, swivel):
    found = find({"smallest": "quadratic_damping", "below": "4 deg"}, taxi_velocity=VELOCITIES)
    limit = math.radians(4.0)
    assert found["outcome"] == "found"
    assert found["change"] == found["value"] - 10.0
    worst = found["decided_by"]["taxi_velocity"]
    assert 10.0 < worst < 100.0
    velocities = np.linspace(10.0, 100.0, 181)
    amplitudes = swivel(velocities, quadratic_damping=found["value"])
    assert amplitudes.max() <= limit * (1.0 + 1e-3)
    assert abs(velocities[amplitudes.argmax()] - worst) < 1.0
    near = worst + np.linspace(-1.0, 1.0, 41)
    assert swivel(near, quadratic_damping=1.002 * found["value"]).max() < limit
    assert swivel(near, quadratic_damping=0.998 * found["value"]).max() > limit


def test_the_largest_loss_that_can_be_tolerated(find, swivel):
    limit = math.radians(9.4)
    content = {"largest_loss": "coulomb_torque", "below": limit}
    found = find(content, taxi_velocity=VELOCITIES)
    assert found["outcome"] == "found"
    assert 0.0 < found["value"] < 20.0
    assert found["change"] == found["value"] - 20.0 < 0.0
    near = found["decided_by"]["taxi_velocity"] + np.linspace(-1.0, 1.0, 41)
    assert swivel(near, coulomb_torque=found["value"] + 0.05).max() < limit
    assert swivel(near, coulomb_torque=found["value"] - 0.05).max() > limit
    # Where the limit is exceeded already, nothing can be lost; where it is far, everything.
    assert find({**content, "below": 0.1}, taxi_velocity=VELOCITIES)["outcome"] == "exceeded_now"
    everything = find({**content, "below": 0.3}, taxi_velocity=VELOCITIES)
    assert (everything["outcome"], everything["value"]) == ("everywhere", 0.0)
    assert everything["change"] == -20.0


def test_up_to_which_velocity_the_limit_holds(find, swivel):
    limit = math.radians(7.0)
    found = find({"largest_rise": "taxi_velocity", "below": limit}, taxi_velocity=40.0)
    assert found["outcome"] == "found"
    assert found["decided_by"]["taxi_velocity"] == found["value"] > 40.0
    assert found["change"] == found["value"] - 40.0
    assert swivel(np.linspace(40.0, found["value"] - 0.1, 30)).max() < limit
    assert swivel([found["value"] + 0.1])[0] > limit


@pytest.mark.parametrize("parameter", ["strut_tilt", "tyre_lateral"])
def test_another_coordinate_may_be_limited(find, parameter):
    found = find({"smallest": "quadratic_damping", "amplitude": parameter, "below": 0.02})
    assert found["decided_by"]["cycle"]["amplitude"][parameter] == pytest.approx(0.02, rel=1e-8)


def test_without_quadratic_damping_growth_has_no_bound_and_meets_no_limit(find, swivel):
    """At C_d = 0 there is no stable cycle, which must not pass for an amplitude of zero."""
    found = find({"smallest": "quadratic_damping", "below": 3.0, "between": [0, 10]})
    assert found["outcome"] == "found"
    assert 0.3 < found["value"] < 0.5
    cycle = found["decided_by"]["cycle"]
    assert cycle["amplitude"]["swivel"] == pytest.approx(3.0, rel=1e-8)
    assert [excess["quantity"] for excess in cycle["beyond_limits"]] == [
        "strut_tilt", "swivel", "tyre_deflection"]
    # A cycle beyond half a turn is none.
    beyond = find({"smallest": "quadratic_damping", "below": 50.0, "between": [0, 10]})
    assert (beyond["outcome"], beyond["decided_by"]["by"]) == ("found", "growth")
    assert 0.9 * found["value"] < beyond["value"] < found["value"]
    assert swivel([40.0], quadratic_damping=1.01 * beyond["value"])[0] == pytest.approx(
        math.pi, rel=0.03)


def test_a_limit_may_hold_at_the_end_of_the_range_or_nowhere(find, swivel):
    smallest = find({"smallest": "quadratic_damping", "below": 0.5, "between": [5, 20]})
    assert (smallest["outcome"], smallest["value"]) == ("at_range_end", 5.0)
    nowhere = find({"smallest": "quadratic_damping", "below": 0.01, "between": [5, 20]})
    assert (nowhere["outcome"], nowhere["value"]) == ("nowhere", None)
    largest = find({"largest": "quadratic_damping", "below": 0.5, "between": [5, 20]})
    assert (largest["outcome"], largest["value"]) == ("at_range_end", 20.0)
    # That is no word about what lies between.
    limit = math.radians(8.0)
    fastest = find({"largest": "taxi_velocity", "below": limit, "between": [10, 100]})
    assert (fastest["outcome"], fastest["value"]) == ("at_range_end", 100.0)
    assert swivel([100.0])[0] < limit < swivel([20.0])[0]


def test_smallest_and_largest_are_the_first_from_their_side(find):
    """The amplitude falls with the velocity up to about 65 m/s and rises again."""
    limit = math.radians(7.0)
    rise = find({"largest_rise": "taxi_velocity", "below": limit}, taxi_velocity=50.0)
    loss = find({"largest_loss": "taxi_velocity", "below": limit}, taxi_velocity=50.0)
    assert loss["value"] < 50.0 < rise["value"]
    smallest = find({"smallest": "taxi_velocity", "below": limit, "between": [20, 100]})
    largest = find({"largest": "taxi_velocity", "below": limit, "between": [20, 100]})
    assert smallest["value"] == pytest.approx(loss["value"], rel=1e-8)
    assert largest["value"] == pytest.approx(rise["value"], rel=1e-8)


def test_lists_give_one_answer_each(points):
    found = points({"coulomb_torque": [10.0, 20.0], "find": {
        "smallest": "quadratic_damping", "below": 0.08}})
    assert [point["at"] for point in found] == [{"coulomb_torque": 10.0}, {"coulomb_torque": 20.0}]
    first, second = (point["find"]["value"] for point in found)
    assert first > second


def test_velocities_at_which_the_tyre_does_not_roll_say_so(points):
    found = points({"taxi_velocity": [0.5, 40.0], "find": {
        "smallest": "quadratic_damping", "below": 0.08}})
    assert [point["find"]["outcome"] for point in found] == ["not_rolling", "found"]


def test_a_fold_decides_where_the_cycle_ends_above_the_limit(find, swivel):
    found = find({"smallest": "coulomb_torque", "below": 0.05})
    assert found["decided_by"]["by"] == "fold"
    assert found["decided_by"]["cycle"]["amplitude"]["swivel"] > 0.05
    assert found["decided_by"]["cycle"]["multiplier"] == pytest.approx(1.0, abs=1e-3)
    assert swivel([40.0], coulomb_torque=1.02 * found["value"])[0] == 0.0
    assert swivel([40.0], coulomb_torque=0.98 * found["value"])[0] > 0.05


def test_a_search_goes_on_in_slices(present):
    from shimmy_ros.what_if.evaluate import evaluate
    from shimmy_ros.what_if.reading import read_query

    query = read_query({"taxi_velocity": VELOCITIES, "find": {
        "smallest": "quadratic_damping", "below": 0.07}}, present, 10)
    assert list(itertools.islice(evaluate(query), 100)) == [None] * 100


def test_growth_without_bound_meets_no_limit_and_its_end_is_found(find, swivel):
    """Without quadratic damping no cycle is stable: what a kick starts grows for ever."""
    for query in ({"taxi_velocity": 40}, {"taxi_velocity": {"from": 30, "to": 40}}):
        found = find({"smallest": "linear_damping", "below": "2 deg"}, quadratic_damping=0, **query)
        assert found["outcome"] == "found"
        assert found["decided_by"]["by"] == "growth"
        assert found["decided_by"]["cycle"] is None
        assert found["value"] > 50.0
    # The linear modes that grow without friction are what grows; near the end of their growth it
    # takes larger kicks than any that are tried.
    gear, damper = reference_parameters()
    rate = [linear_modes(gear, changed(damper, linear_damping=factor * found["value"]),
                         found["decided_by"]["taxi_velocity"]).growth_rate[0]
            for factor in (1.0, 1.05)]
    assert rate[0] > 0.0 > rate[1]
    velocity = found["decided_by"]["taxi_velocity"]
    assert swivel([velocity], quadratic_damping=0.0,
                  linear_damping=0.99 * found["value"])[0] == math.inf
    exceeded = find({"largest_loss": "linear_damping", "below": 1.0}, quadratic_damping=0)
    assert exceeded["outcome"] == "exceeded_now"


def told(monkeypatch, outcome_of):
    """Scans get the outcomes, and for motion that is not periodic the swivel's envelope, that
    ``outcome_of`` has for a quadratic damping."""

    def stable_cycle(point, settings, start):
        outcome, swivel = outcome_of(point.damper.quadratic_damping)
        envelope = np.array([0.0, swivel, 0.0, 0.0]) if outcome is Outcome.NOT_PERIODIC else None
        return Verdict(point, settings, outcome, envelope=envelope, reason="as told")

    monkeypatch.setattr(scan, "stable_cycle", stable_cycle)


def test_an_envelope_counts_as_an_amplitude(find, monkeypatch):
    told(monkeypatch, lambda damping: (Outcome.NOT_PERIODIC, 1.0 / (1.0 + damping)))
    found = find({"smallest": "quadratic_damping", "below": 0.1})
    assert found["decided_by"]["by"] == "envelope"
    assert found["value"] == pytest.approx(9.0, rel=1e-6)


def test_growth_that_ends_at_once_is_found(find, monkeypatch):
    told(monkeypatch, lambda damping: (
        Outcome.UNBOUNDED if damping == 0.0 else Outcome.NO_LIMIT_CYCLE, 0.0))
    found = find({"smallest": "quadratic_damping", "below": 0.1})
    assert found["decided_by"]["by"] == "growth"
    assert 0.0 < found["value"] < 1e-7


def test_an_answer_that_did_not_converge_is_none(find, monkeypatch):
    told(monkeypatch, lambda damping: (Outcome.NOT_CONVERGED, 0.0))
    found = find({"smallest": "quadratic_damping", "below": 0.1})
    assert found["outcome"] == "not_converged"
    assert found["message"] == "did not converge: as told"


def test_where_growth_has_no_end_no_value_is_found(find, monkeypatch):
    told(monkeypatch, lambda damping: (Outcome.UNBOUNDED, 0.0))
    found = find({"smallest": "quadratic_damping", "below": 50.0})
    assert (found["outcome"], found["value"]) == ("nowhere", None)
