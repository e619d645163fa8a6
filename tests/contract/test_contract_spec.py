"""The contract file: complete, of stock types, and what the code is made from."""

from __future__ import annotations

import copy
import json

import pytest
import yaml
from rosbags.interfaces import Nodetype

from shimmy_ros.contract.messages import CODECS
from shimmy_ros.contract.records import JOINTS
from shimmy_ros.contract.spec import Durability, Reliability, load_contract, topics_table
from shimmy_ros.contract.typestore import typestore
from shimmy_ros.gear.matrices import NAMES
from shimmy_ros.resources import resource_directory

CONTRACT = load_contract()
TOPICS = pytest.mark.parametrize("topic", CONTRACT.topics, ids=lambda topic: topic.name)


def load_yaml():
    return yaml.safe_load((resource_directory("msgs_spec") / "topics.yaml").read_text("utf-8"))


def load_validator():
    jsonschema = pytest.importorskip("jsonschema")
    schema = json.loads((resource_directory("msgs_spec") / "topics.schema.json").read_text("utf-8"))
    jsonschema.Draft202012Validator.check_schema(schema)
    return jsonschema.Draft202012Validator(schema)


def test_the_file_obeys_its_grammar():
    assert [error.message for error in load_validator().iter_errors(load_yaml())] == []


@pytest.mark.parametrize("spoil", [
    lambda content: content.pop("joints"),
    lambda content: content["topics"][0].pop("qos"),
    lambda content: content["topics"][0].update(type="TwistStamped"),
    lambda content: content["topics"][0].update(rate=3),
    lambda content: content["topics"][0]["qos"].update(reliability="sometimes"),
    lambda content: content["topics"][0]["qos"].update(depth=0),
    lambda content: content["topics"][0]["publishers"].append("pilot"),
    lambda content: content["topics"][0]["fields"][0].pop("unit"),
    lambda content: content["services"][0].update(type="std_srvs/msg/Trigger"),
])
def test_the_grammar_refuses_a_spoiled_file(spoil):
    content = copy.deepcopy(load_yaml())
    spoil(content)
    assert not load_validator().is_valid(content)


def test_topics_and_services_are_those_agreed():
    assert {topic.name: topic.type for topic in CONTRACT.topics} == {
        "taxi_velocity": "geometry_msgs/msg/TwistStamped",
        "damper/linear_damping": "std_msgs/msg/Float64",
        "damper/quadratic_damping": "std_msgs/msg/Float64",
        "damper/coulomb_torque": "std_msgs/msg/Float64",
        "gear_response": "sensor_msgs/msg/JointState",
        "limit_cycle/amplitude": "sensor_msgs/msg/JointState",
        "limit_cycle/frequency": "std_msgs/msg/Float64",
        "limit_cycle/orbit": "trajectory_msgs/msg/JointTrajectory",
        "limit_cycle/status": "diagnostic_msgs/msg/DiagnosticArray",
        "what_if/query": "std_msgs/msg/String",
        "what_if/answer": "std_msgs/msg/String",
        "/diagnostics": "diagnostic_msgs/msg/DiagnosticArray",
    }
    assert [(kick.name, kick.type, kick.server) for kick in CONTRACT.services] == [
        ("~/kick", "std_srvs/srv/Trigger", "simulator")]


def test_directions():
    inputs = [topic.name for topic in CONTRACT.published_by("rig")]
    assert inputs == ["taxi_velocity", "damper/linear_damping", "damper/quadratic_damping",
                      "damper/coulomb_torque"]
    assert [topic.name for topic in CONTRACT.subscribed_by("predictor")] == [
        *inputs, "what_if/query"]
    assert [topic.name for topic in CONTRACT.published_by("anyone")] == ["what_if/query"]
    assert [topic.name for topic in CONTRACT.subscribed_by("simulator")] == inputs
    assert [topic.name for topic in CONTRACT.published_by("simulator")] == [
        "gear_response", "/diagnostics"]
    assert {topic.name for topic in CONTRACT.topics} - {t.name for t in CONTRACT.recorded} == {
        "/diagnostics"}


@TOPICS
def test_quality_of_service_follows_the_kind_of_topic(topic):
    state = topic.name.startswith("limit_cycle/")
    streaming = topic.name == "taxi_velocity"
    assert (topic.qos.durability is Durability.TRANSIENT_LOCAL) == state
    assert (topic.qos.reliability is Reliability.BEST_EFFORT) == streaming
    assert topic.qos.depth == 1 or not state
    # So that a moment's delay loses no sample, and a flood does not delay for long.
    assert topic.qos.depth == 10 or not streaming


@TOPICS
def test_every_field_exists_in_the_stock_message(topic):
    for field in topic.fields:
        type_name = topic.type
        for part in field.path.split("."):
            assert type_name is not None, field.path
            kind, inner = dict(typestore().fielddefs[type_name][1])[part]
            if kind in (Nodetype.ARRAY, Nodetype.SEQUENCE):
                kind, inner = inner[0]
            type_name = inner if kind == Nodetype.NAME else None
        if "Joint" in topic.type:
            assert set(field.of) <= set(CONTRACT.joints)


@pytest.mark.parametrize("name", [t.name for t in CONTRACT.topics if "Joint" in t.type])
def test_every_joint_has_one_unit_in_each_field(name):
    topic = CONTRACT.topic(name)
    for path in {field.path for field in topic.fields if field.of}:
        joints = [joint for field in topic.fields if field.path == path for joint in field.of]
        assert sorted(joints) == sorted(CONTRACT.joints)


def test_joints_are_the_gears():
    assert CONTRACT.joints == JOINTS == NAMES


def test_every_topic_has_a_codec_of_its_type():
    assert {name: codec.type for name, codec in CODECS.items()} == {
        topic.name: topic.type for topic in CONTRACT.topics}


@pytest.mark.parametrize(("name", "namespace", "resolved"), [
    ("taxi_velocity", "/shimmy", "/shimmy/taxi_velocity"),
    ("taxi_velocity", "shimmy/", "/shimmy/taxi_velocity"),
    ("taxi_velocity", "/", "/taxi_velocity"),
    ("taxi_velocity", "", "/taxi_velocity"),
    ("limit_cycle/orbit", "/left/nose", "/left/nose/limit_cycle/orbit"),
    ("/diagnostics", "/shimmy", "/diagnostics"),
])
def test_names_resolve_in_a_namespace(name, namespace, resolved):
    assert CONTRACT.topic(name).resolved(namespace) == resolved


def test_lookups_name_what_is_known():
    assert CONTRACT.service("~/kick").server == "simulator"
    with pytest.raises(KeyError, match=r"'velocity' is not in the contract.*taxi_velocity"):
        CONTRACT.topic("velocity")
    with pytest.raises(KeyError, match=r"'kick' is not in the contract.*~/kick"):
        CONTRACT.service("kick")


def test_the_table_has_a_row_for_everything():
    head, rule, *rows = topics_table().splitlines()
    names = [*(topic.name for topic in CONTRACT.topics), *(s.name for s in CONTRACT.services)]
    assert [row.split("`")[1] for row in rows] == names
    assert {row.count("|") for row in (head, rule, *rows)} == {7}
    velocity = rows[0]
    for part in ("geometry_msgs/TwistStamped", "rig → predictor and simulator",
                 "`twist.linear.x` in m/s", "best effort, volatile, 1"):
        assert part in velocity
