"""What the tests of what-if questions share."""

from __future__ import annotations

import importlib.util
import json
from pathlib import Path

import pytest

from shimmy_ros.cycles.settings import Settings
from shimmy_ros.gear.parameter_file import reference_parameters
from shimmy_ros.resources import resource_directory
from shimmy_ros.what_if.desk import Desk
from shimmy_ros.what_if.query import Present


@pytest.fixture(scope="session")
def random_queries():
    """The module of that name beside this one."""
    path = Path(__file__).with_name("random_queries.py")
    spec = importlib.util.spec_from_file_location("random_queries", path)
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


@pytest.fixture(scope="session")
def present():
    """The reference gear at 40 m/s."""
    gear, damper = reference_parameters()
    return Present(gear, damper, 40.0, Settings())


@pytest.fixture(scope="session")
def schema():
    """A validator by the name of a schema in msgs_spec."""
    jsonschema = pytest.importorskip("jsonschema")

    def validator(name):
        path = resource_directory("msgs_spec") / f"{name}.schema.json"
        content = json.loads(path.read_text(encoding="utf-8"))
        jsonschema.Draft202012Validator.check_schema(content)
        return jsonschema.Draft202012Validator(content)

    return validator


@pytest.fixture
def ask(present, schema):
    """Answer one query at a desk; all parts of the answer, each as its schema has it."""
    valid = schema("what_if_answer")

    def answer(query, at=present, maximum_points=10_000):
        desk = Desk()
        desk.take(7, query if isinstance(query, str) else json.dumps(query), at, maximum_points)
        replies = list(desk.replies())
        while desk.busy:
            desk.step()
            replies += desk.replies()
        assert {reply.ticket for reply in replies} == {7}
        assert [reply.final for reply in replies] == [False] * (len(replies) - 1) + [True]
        parts = [json.loads(json.dumps(reply.answer, allow_nan=False)) for reply in replies]
        for part in parts:
            assert [error.message for error in valid.iter_errors(part)] == []
        return parts

    return answer


@pytest.fixture
def points(ask):
    """The points of the complete answer to a query, by their index."""
    def answer(query, **options):
        parts = ask(query, **options)
        assert parts[-1]["state"] == "complete", parts[-1]
        found = sorted((point for part in parts for point in part["points"]),
                       key=lambda point: point["index"])
        assert [point["index"] for point in found] == list(range(parts[-1]["of"]))
        return found

    return answer
