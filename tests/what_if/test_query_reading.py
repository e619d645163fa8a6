"""Queries as values: what they stand for, and a refusal with the place for all that is wrong."""

from __future__ import annotations

import itertools
import math
from dataclasses import replace

import pytest
from hypothesis import given
from hypothesis import strategies as st

from shimmy_ros.cycles.settings import Settings
from shimmy_ros.gear.parameter_file import reference_parameters
from shimmy_ros.gear.parameters import VELOCITY_RANGE, Damper, Gear, Limits, ranges
from shimmy_ros.what_if.query import PARAMETERS, Cancel, Present
from shimmy_ros.what_if.reading import read_query
from shimmy_ros.what_if.text import QueryError, read_mapping

GEAR, DAMPER = reference_parameters()
PRESENT = Present(GEAR, DAMPER, 40.0, Settings())


def read(content, present=PRESENT, maximum_points=10_000):
    return read_query(content, present, maximum_points)


def points(content, **options):
    """Values that vary and operating points, in the order in which they are walked through."""
    return [(number, at, point) for number, at, point in read(content, **options).points()]


def refusal(content, **options):
    with pytest.raises(QueryError) as caught:
        read(content, **options)
    assert len(str(caught.value).splitlines()) == 1
    return caught.value


def test_an_empty_query_is_about_the_present():
    query = read({})
    ((number, at, point),) = query.points()
    assert (number, at, len(query)) == (0, {}, 1)
    assert (point.gear, point.damper, point.velocity) == (GEAR, DAMPER, 40.0)
    assert query.settings == Settings(4, 0.01, minimum_velocity=1.0)
    assert (query.id, query.returns, query.find) == (None, ("limit_cycle",), None)


def test_every_parameter_can_be_named():
    assert list(PARAMETERS) == ["taxi_velocity", *ranges(Damper), *ranges(Gear)]
    assert PARAMETERS["taxi_velocity"] == VELOCITY_RANGE
    for name in PARAMETERS:
        value = 0.07 if name in ("trail", "strut_rake") else 30.0 if name == "taxi_velocity" else (
            1.01 * getattr(GEAR if name in ranges(Gear) else DAMPER, name))
        ((_, at, point),) = points({name: value})
        assert at == {}
        expected = replace(
            GEAR, **{name: value} if name in ranges(Gear) else {}), replace(
            DAMPER, **{name: value} if name in ranges(Damper) else {})
        assert (point.gear, point.damper) == expected
        assert point.velocity == (value if name == "taxi_velocity" else 40.0)


def test_lists_and_grids_make_a_grid_of_all():
    query = {"coulomb_torque": [5, 20.0], "taxi_velocity": {"from": 10, "to": 40, "points": 4},
             "trail": [0.07, 0.08, 0.09], "linear_damping": 3}
    found = points(query)
    assert len(found) == len(read(query)) == 24
    expected = list(itertools.product((5.0, 20.0), (10.0, 20.0, 30.0, 40.0), (0.07, 0.08, 0.09)))
    assert [list(at) for _, at, _ in found] == [["coulomb_torque", "taxi_velocity", "trail"]] * 24
    assert [expected[number] for number, _, _ in found] == [
        tuple(at.values()) for _, at, _ in found]
    assert sorted(number for number, _, _ in found) == list(range(24))
    for _, at, point in found:
        assert (point.damper.coulomb_torque, point.velocity, point.gear.trail) == tuple(at.values())
        assert point.damper.linear_damping == 3.0


@given(st.lists(st.integers(1, 4), min_size=1, max_size=4))
def test_a_walk_goes_to_neighbours_only(counts):
    names = ["linear_damping", "taxi_velocity", "coulomb_torque", "quadratic_damping"]
    query = {name: [1.0 + index for index in range(count)]
             for name, count in zip(names, counts, strict=False)}
    walk = [tuple(at.values()) for _, at, _ in points(query)]
    assert len(set(walk)) == len(walk) == math.prod(counts)
    for before, after in itertools.pairwise(walk):
        assert sum(abs(a - b) for a, b in zip(before, after, strict=True)) == 1.0


@given(st.floats(0.5, 199.0), st.floats(0.5, 199.0), st.integers(2, 50))
def test_a_grid_is_even_and_has_both_ends(start, end, count):
    values = [at["taxi_velocity"] for _, at, _ in points(
        {"taxi_velocity": {"from": start, "to": end, "points": count}})]
    assert (values[0], values[-1], len(values)) == (start, end, count)
    steps = [after - before for before, after in itertools.pairwise(values)]
    assert steps == pytest.approx([(end - start) / (count - 1)] * (count - 1), abs=1e-12)


def test_what_was_used_reads_as_a_query():
    for query in ({"coulomb_torque": [1.0, 2.0], "harmonics": 7, "return": ["margin", "trigger"]},
                  {"taxi_velocity": {"from": 10.0, "to": 30.0, "points": 5}, "accuracy": 0.01,
                   "limits": {"swivel": 0.2}},
                  {"taxi_velocity": {"from": 10, "to": 30}, "trail": [0.06, 0.07],
                   "find": {"smallest": "linear_damping", "below": "2 deg"}}):
        first = read(query)
        inputs = first.inputs()
        assert inputs.pop("minimum_velocity") == 1.0
        # What was found by default is named now.
        other = Present(replace(GEAR, trail=0.05), DAMPER, None,
                        Settings(1, 0.2, limits=Limits(0.1, 0.1, 0.1)))
        assert read(inputs, present=other).inputs() == first.inputs()


def test_velocity_is_needed_once():
    silent = replace(PRESENT, velocity=None)
    assert refusal({}, present=silent).where == "taxi_velocity"
    assert len(points({"taxi_velocity": [10.0, 20.0]}, present=silent)) == 2
    assert read({"find": {"largest": "taxi_velocity", "below": 0.1}}, present=silent).find
    assert refusal({"find": {"largest_rise": "taxi_velocity", "below": 0.1}},
                   present=silent).where == "taxi_velocity"


def test_cancellation():
    assert read({"cancel": "a"}) == Cancel(None, "a")
    assert read({"id": "b", "cancel": "a"}) == Cancel("b", "a")
    assert refusal({"cancel": "a", "taxi_velocity": 40.0}).where == "taxi_velocity"
    assert refusal({"cancel": 3}).where == "cancel"


def test_the_number_of_points_is_bounded():
    grid = {"taxi_velocity": {"from": 10, "to": 20, "points": 10}, "coulomb_torque": [1, 2, 3]}
    assert len(read(grid, maximum_points=30)) == 30
    assert "30 points, but may have at most 29" in str(refusal(grid, maximum_points=29))
    assert refusal({"taxi_velocity": [1.0] * 30}, maximum_points=29).where == "taxi_velocity"
    assert refusal({"taxi_velocity": {"from": 1, "to": 2, "points": 30}},
                   maximum_points=29).where == "taxi_velocity.points"


@pytest.mark.parametrize(("content", "where", "words"), [
    ({"velocity": 40}, "velocity", "did you mean taxi_velocity?"),
    ({"damper.coulomb_torque": 3}, "damper.coulomb_torque", "did you mean coulomb_torque?"),
    ({"bananas": 3}, "bananas", "a query has id, cancel"),
    ({"taxi_velocity": 300}, "taxi_velocity", "is 300, but must be in [0, 200] m/s"),
    ({"taxi_velocity": -1}, "taxi_velocity", "[0, 200] m/s"),
    ({"taxi_velocity": math.nan}, "taxi_velocity", "is nan"),
    ({"taxi_velocity": 10**400}, "taxi_velocity", "is inf"),
    ({"taxi_velocity": "40"}, "taxi_velocity", "is '40', but must be a number in [0, 200] m/s, a"),
    ({"taxi_velocity": True}, "taxi_velocity", "is True"),
    ({"taxi_velocity": None}, "taxi_velocity", "is null"),
    ({"coulomb_torque": [1, "x"]}, "coulomb_torque[1]", "is 'x', but must be a number in"),
    ({"coulomb_torque": [1, [2]]}, "coulomb_torque[1]", "is [2]"),
    ({"coulomb_torque": []}, "coulomb_torque", "has 0 values"),
    ({"coulomb_torque": {}}, "coulomb_torque", "coulomb_torque.from is missing"),
    ({"coulomb_torque": {"from": 1, "to": 2}}, "coulomb_torque", "points is missing"),
    ({"coulomb_torque": {"from": 1, "to": 2, "points": 1}}, "coulomb_torque.points",
     "is 1, but must be a whole number in [2, 10000]"),
    ({"coulomb_torque": {"from": 1, "to": 2, "points": 2.5}}, "coulomb_torque.points", "2.5"),
    ({"coulomb_torque": {"from": 1, "to": "b", "points": 3}}, "coulomb_torque.to", "'b'"),
    ({"coulomb_torque": {"from": 1, "until": 2, "points": 3}}, "coulomb_torque.until",
     "it has from, to and points"),
    ({"taxi_velocity": {"from": 1, "to": 2}}, "taxi_velocity", "points is missing"),
    ({"harmonics": 0}, "harmonics", "[1, 64]"), ({"harmonics": 4.5}, "harmonics", "whole number"),
    ({"harmonics": True}, "harmonics", "True"), ({"accuracy": 0.9}, "accuracy", "[1e-09, 0.5]"),
    ({"limits": [0.1]}, "limits", "a mapping of some of swivel, strut_tilt, tyre_deflection"),
    ({"limits": {"damper": 0.1}}, "limits.damper", "it has swivel, strut_tilt, tyre_deflection"),
    ({"limits": {"swivel": 4.0}}, "limits.swivel", "[1e-06, 3.14159] rad"),
    ({"limits": {"swivel": "190 deg"}}, "limits.swivel", "[1e-06, 3.14159] rad"),
    ({"limits": {"strut_tilt": True}}, "limits.strut_tilt", "True"),
    ({"limits": {"tyre_deflection": "2 deg"}}, "limits.tyre_deflection", "'2 deg'"),
    ({"return": "amplitude"}, "return", "must be one of limit_cycle, all_cycles, trigger, margin"),
    ({"return": ["margin", 3]}, "return[1]", "is 3"), ({"return": []}, "return", "one or more"),
    ({"return": ["margin"] * 2}, "return", "each once"), ({"return": {}}, "return", "is {}"),
    ({"id": 3}, "id", "text of 1 to 100"), ({"id": "x" * 101}, "id", "1 to 100 characters"),
    ({"wheel_mass": 1000}, "", "positive definite"),
    ({"wheel_mass": [25, 1000]}, "", "positive definite"),
    ({"trail": {"from": -0.5, "to": 0.08, "points": 9}}, "", "positive definite"),
])
def test_what_is_wrong_is_named(content, where, words):
    error = refusal(content)
    assert error.where == where
    assert words in str(error)


def test_values_that_fit_only_together_are_judged_together():
    assert len(points({"wheel_mass": [100.0, 110.0], "swivel_inertia": [5.0, 6.0]})) == 4
    assert "positive definite" in str(refusal(
        {"wheel_mass": [100.0, 110.0], "swivel_inertia": [0.5, 6.0]}))


def find(**content):
    return read({"find": content}).find


def test_a_find_has_begin_and_end():
    wanted = find(smallest="quadratic_damping", below=0.05)
    assert (wanted.begin, wanted.end) == (0.0, 1000.0)
    assert (wanted.coordinate, wanted.below, wanted.velocities) == (1, 0.05, None)
    wanted = find(largest="quadratic_damping", below=0.05, between=[1, 30])
    assert (wanted.begin, wanted.end) == (30.0, 1.0)
    wanted = find(largest_loss="coulomb_torque", below=0.05)
    assert (wanted.begin, wanted.end) == (20.0, 0.0)
    wanted = find(largest_rise="taxi_velocity", below=0.05)
    assert (wanted.begin, wanted.end) == (40.0, 200.0)
    wanted = find(smallest="taxi_velocity", below=0.05)
    assert (wanted.begin, wanted.end) == (1.0, 200.0)
    wanted = find(largest="trail", below=0.05)
    assert (wanted.begin, wanted.end) == (0.16, 0.04)
    wanted = read({"coulomb_torque": 30, "find": {"largest_loss": "coulomb_torque", "below": 1}}
                  ).find
    assert (wanted.begin, wanted.end) == (30.0, 0.0)


@pytest.mark.parametrize(("below", "value"), [
    (0.05, 0.05), (0, 0.0), ("2 deg", math.radians(2)), ("2deg", math.radians(2)),
    ("1.5e1 deg", math.radians(15.0))])
def test_an_angle_may_be_in_degrees(below, value):
    assert find(smallest="linear_damping", below=below).below == pytest.approx(value, rel=1e-15)


def test_a_find_may_hold_over_an_interval_of_velocities():
    query = read({"taxi_velocity": {"from": 10, "to": 100}, "trail": [0.07, 0.08],
                  "find": {"smallest": "linear_damping", "below": 0.05}})
    assert query.find.velocities == (10.0, 100.0)
    assert len(query) == 2
    assert query.inputs()["taxi_velocity"] == {"from": 10.0, "to": 100.0}


GOOD = {"smallest": "coulomb_torque", "below": 0.05}


@pytest.mark.parametrize(("content", "where", "words"), [
    ({"find": {"smallest": "speed", "below": 1}}, "find.smallest", "there are taxi_velocity"),
    ({"find": {"smallest": "trial", "below": 1}}, "find.smallest", "did you mean trail?"),
    ({"find": {"smallest": "trail", "below": "2 degrees"}}, "find.below", "or an angle as"),
    ({"find": 3}, "find", "must be a mapping"), ({"find": {}}, "find", "has nothing to look for"),
    ({"find": {"below": 1}}, "find", "smallest, largest, largest_loss, largest_rise"),
    ({"find": {**GOOD, "largest": "trail"}}, "find", "has smallest and largest"),
    ({"find": {"smallest": "torque", "below": 1}}, "find.smallest", "did you mean coulomb_torque?"),
    ({"find": {"smallest": 3, "below": 1}}, "find.smallest", "is 3"),
    ({"find": {"smallest": "trail"}}, "find", "find.below is missing"),
    ({"find": {**GOOD, "below": -1}}, "find.below", "[0, 100] rad"),
    ({"find": {**GOOD, "below": "two deg"}}, "find.below", "'two deg'"),
    ({"find": {**GOOD, "amplitude": "tyre_lateral", "below": "2 deg"}}, "find.below", "'2 deg'"),
    ({"find": {**GOOD, "below": "1e9 deg"}}, "find.below", "[0, 100] rad"),
    ({"find": {**GOOD, "amplitude": "wing"}}, "find.amplitude", "one of strut_tilt, swivel"),
    ({"find": {**GOOD, "above": 1}}, "find.above", "'above' is not known in find"),
    ({"find": {**GOOD, "between": 3}}, "find.between", "two numbers"),
    ({"find": {**GOOD, "between": [3, 3]}}, "find.between", "the second must be the greater"),
    ({"find": {**GOOD, "between": [0, "a"]}}, "find.between[1]", "'a'"),
    ({"find": {"largest_loss": "coulomb_torque", "below": 1, "between": [0, 1]}}, "find.between",
     "belongs to smallest and largest"),
    ({"find": GOOD, "coulomb_torque": 3}, "coulomb_torque", "must not be given"),
    ({"find": {"largest_loss": "coulomb_torque", "below": 1}, "coulomb_torque": [3, 4]},
     "coulomb_torque", "but as one number"),
    ({"find": {"smallest": "taxi_velocity", "below": 1}, "taxi_velocity": {"from": 1, "to": 2}},
     "taxi_velocity", "must not be given"),
    ({"find": GOOD, "taxi_velocity": {"from": 0.5, "to": 20}}, "taxi_velocity.from",
     "at least the minimum velocity of 1 m/s"),
    ({"find": GOOD, "taxi_velocity": {"from": 20, "to": 10}}, "taxi_velocity.to", "greater than"),
    ({"find": GOOD, "trail": {"from": 0.05, "to": 0.08}}, "trail", "only find's taxi_velocity"),
    ({"find": GOOD, "return": "margin"}, "return", "exclude each other"),
    ({"find": {"smallest": "wheel_mass", "below": 1, "between": [20, 5000]}}, "", "mass matrix"),
    ({"find": {"smallest": "taxi_velocity", "below": 1, "between": [0.5, 9]}}, "find.between[0]",
     "[1, 200] m/s"),
    ({"find": {"largest_rise": "taxi_velocity", "below": 1}, "taxi_velocity": 0.5},
     "taxi_velocity", "at least 1"),
])
def test_what_is_wrong_with_a_find_is_named(content, where, words):
    error = refusal(content)
    assert error.where == where
    assert words in str(error)


def test_a_search_from_nothing_needs_its_bounds():
    without = replace(PRESENT, damper=replace(DAMPER, linear_damping=0.0))
    content = {"find": {"smallest": "linear_damping", "below": 1}}
    assert "find.between is missing" in str(refusal(content, present=without))
    content["find"]["between"] = [0, 5]
    assert read(content, present=without).find.end == 5.0


@pytest.mark.parametrize("seed", range(300))
def test_random_bad_queries_are_refused_at_their_place(random_queries, seed):
    content, where = random_queries.bad(seed)
    text = random_queries.text(content, seed)
    error = refusal(read_mapping(text))
    assert where is None or error.where == where


@pytest.mark.parametrize("seed", range(300))
def test_random_good_queries_are_accepted(random_queries, seed):
    content = random_queries.good(seed)
    query = read(read_mapping(random_queries.text(content, seed)))
    assert query.id == f"good-{seed}"
    for name, values in query.varied.items():
        assert list(values.values()) == pytest.approx(random_queries.values(content[name]))
