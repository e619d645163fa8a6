"""The schemas in msgs_spec: of the same mind as the code, and complete."""

from __future__ import annotations

import json

import pytest

from shimmy_ros.cycles.settings import ACCURACY_RANGE, HARMONICS_RANGE, Settings
from shimmy_ros.cycles.trigger import Leads
from shimmy_ros.gear.matrices import NAMES
from shimmy_ros.gear.parameter_file import reference_parameters
from shimmy_ros.gear.parameters import Limits, ranges
from shimmy_ros.ihb.solution import Outcome
from shimmy_ros.resources import resource_directory
from shimmy_ros.what_if.query import PARAMETERS, RETURNS, SENSES, Present
from shimmy_ros.what_if.reading import LARGEST_AMPLITUDE, LONGEST_ID, read_query
from shimmy_ros.what_if.text import QueryError, read_mapping

PRESENT = Present(*reference_parameters(), 40.0, Settings())
# What a schema cannot say: values that have to fit together, and a bound that is a parameter's.
BEYOND_A_SCHEMA = ("mass matrix", "the second must be the greater", "find.between[", "is nan",
                   "points is 1000000000", "must not be given")


@pytest.fixture(scope="module")
def content():
    path = resource_directory("msgs_spec") / "what_if_query.schema.json"
    return json.loads(path.read_text(encoding="utf-8"))


def test_parameters_have_the_ranges_of_the_code(content):
    parts = content["$defs"]
    assert set(content["properties"]) == {
        "id", "cancel", "harmonics", "accuracy", "limits", "return", "find", *PARAMETERS}
    assert parts["parameter"]["enum"] == list(PARAMETERS)
    for name, range_ in PARAMETERS.items():
        number = parts[f"{name}_number"]
        assert (number["minimum"], number["maximum"]) == (range_.low, range_.high)
        assert number["description"] == f"{range_.meaning}, {range_.unit}."


def test_words_and_bounds_are_those_of_the_code(content):
    parts, properties = content["$defs"], content["properties"]
    assert parts["result"]["enum"] == list(RETURNS)
    assert [choice["required"][0] for choice in parts["find"]["oneOf"]] == list(SENSES)
    assert parts["find"]["properties"]["amplitude"]["enum"] == list(NAMES)
    assert parts["find"]["properties"]["below"]["anyOf"][0]["maximum"] == LARGEST_AMPLITUDE
    assert parts["id"]["maxLength"] == LONGEST_ID
    for name, range_ in (("harmonics", HARMONICS_RANGE), ("accuracy", ACCURACY_RANGE)):
        assert (properties[name]["minimum"], properties[name]["maximum"]) == (
            range_.low, range_.high)
    limits = properties["limits"]["properties"]
    assert list(limits) == list(ranges(Limits))
    for name, range_ in ranges(Limits).items():
        number = limits[name] if range_.unit == "1" else parts["angle_limit"]["anyOf"][0]
        assert (number["minimum"], number["maximum"]) == (range_.low, range_.high)


def test_outcomes_are_those_of_the_code(schema):
    path = resource_directory("msgs_spec") / "what_if_answer.schema.json"
    parts = json.loads(path.read_text(encoding="utf-8"))["$defs"]
    assert set(parts["outcome"]["enum"]) == {outcome.value for outcome in Outcome}
    for name in ("limit_cycle", "all_cycles", "margin"):
        assert parts[name]["properties"]["outcome"] == {"$ref": "#/$defs/outcome"}
    leads = parts["threshold"]["anyOf"][0]["properties"]["leads_to"]["enum"]
    assert leads == [leads_to.value for leads_to in Leads]


def accepted(query):
    try:
        read_query(query, PRESENT, 10_000)
    except QueryError as error:
        return str(error)
    return ""


def test_schema_and_code_agree_on_good_and_bad_queries(random_queries, schema):
    valid = schema("what_if_query")
    for seed in range(1000):
        query = random_queries.good(seed)
        assert valid.is_valid(query), seed
        assert accepted(query) == ""
        query, _ = random_queries.bad(seed)
        reason = accepted(query)
        assert reason
        assert not valid.is_valid(query) or any(words in reason for words in BEYOND_A_SCHEMA), (
            query, reason)


def test_schema_and_code_agree_on_garbled_queries(random_queries, schema):
    valid = schema("what_if_query")
    outcomes = set()
    for seed in range(1000):
        try:
            query = read_mapping(random_queries.garbled(seed))
        except QueryError:
            outcomes.add("unreadable")
            continue
        reason = accepted(query)
        outcomes.add(bool(reason))
        if not any(words in reason for words in BEYOND_A_SCHEMA):
            assert valid.is_valid(query) == (not reason), (query, reason)
    assert outcomes == {"unreadable", True, False}


@pytest.mark.parametrize("query", [
    {}, {"cancel": "a"}, {"id": "b", "cancel": "a"}, {"return": ["margin", "trigger"]},
    {"taxi_velocity": {"from": 1, "to": 2}, "find": {"smallest": "trail", "below": "2 deg"}},
    {"find": {"largest_loss": "coulomb_torque", "below": 0, "amplitude": "tyre_lateral"}},
    {"harmonics": 4, "accuracy": 0.1, "limits": {"swivel": "30 deg", "tyre_deflection": 0.2}},
    {"accuracy": 0.01, "taxi_velocity": [1, 2], "trail": {"from": 0.05, "to": 0.06, "points": 3}},
])
def test_the_kinds_of_queries_are_valid(schema, query):
    assert schema("what_if_query").is_valid(query)
    assert accepted(query) == ""


@pytest.mark.parametrize("query", [
    {"cancel": "a", "harmonics": 4}, {"limits": {"tyre_deflection": "2 deg"}},
    {"limits": {"damper": 1}}, {"limits": {"swivel": 0}}, {"limits": 3},
    {"taxi_velocity": {"from": 1, "to": 2}}, {"return": "margin", "find": {"below": 1}},
    {"find": {"smallest": "trail"}},
    {"find": {"smallest": "trail", "largest": "trail", "below": 1}},
    {"find": {"largest_loss": "coulomb_torque", "below": 1, "between": [0, 1]}},
])
def test_what_excludes_each_other_is_invalid(schema, query):
    assert not schema("what_if_query").is_valid(query)
    assert accepted(query)
