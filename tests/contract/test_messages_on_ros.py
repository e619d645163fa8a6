"""The codecs against an installed ROS 2 Jazzy: its deserialiser and its type hashes."""

from __future__ import annotations

import importlib
import json
import os
import sys
from pathlib import Path

import numpy as np
import pytest

from shimmy_ros.contract.messages import CODECS
from shimmy_ros.contract.records import (
    JOINTS,
    GearResponse,
    Level,
    LimitCycleAmplitude,
    LimitCycleOrbit,
    Status,
    TaxiVelocity,
)
from shimmy_ros.contract.spec import load_contract
from shimmy_ros.contract.typestore import type_hash

serialization = pytest.importorskip("rclpy.serialization")

# ROS 2 Jazzy's own message packages import a lark that is older than Python 3.11.
pytestmark = pytest.mark.filterwarnings("ignore:module 'sre_.*' is deprecated:DeprecationWarning")

FOUR = (0.01, -0.2, 3.0, 0.004)


def deserialized(name, record):
    package, _, message = CODECS[name].type.split("/")
    message_class = getattr(importlib.import_module(f"{package}.msg"), message)
    return serialization.deserialize_message(CODECS[name].encode(record), message_class)


def test_rclpy_reads_a_velocity():
    message = deserialized("taxi_velocity", TaxiVelocity(3_000_000_004, 42.5))
    assert (message.header.stamp.sec, message.header.stamp.nanosec) == (3, 4)
    assert message.header.frame_id == "base_link"
    assert message.twist.linear.x == 42.5
    assert message.twist.linear.y == message.twist.angular.z == 0.0


def test_rclpy_reads_a_number():
    assert deserialized("limit_cycle/frequency", 21.5).data == 21.5


def test_rclpy_reads_a_text():
    assert deserialized("what_if/answer", '{"id": "über"}').data == '{"id": "über"}'


def test_rclpy_reads_joint_states():
    effort = (0.0, -20.0, 3.5, 0.0)
    message = deserialized("gear_response", GearResponse(17, FOUR, FOUR[::-1], effort))
    assert tuple(message.name) == JOINTS
    assert tuple(message.position) == FOUR
    assert tuple(message.velocity) == FOUR[::-1]
    assert tuple(message.effort) == effort
    message = deserialized("limit_cycle/amplitude", LimitCycleAmplitude(17, FOUR, FOUR[::-1]))
    assert tuple(message.velocity) == FOUR[::-1]
    assert len(message.effort) == 0


@pytest.mark.parametrize("count", [0, 1, 2, 33])
def test_rclpy_reads_an_orbit(count):
    times = np.arange(count) * 700_000_000
    values = np.arange(8.0 * count).reshape(count, 8)
    message = deserialized("limit_cycle/orbit",
                           LimitCycleOrbit(17, times, values[:, :4], values[:, 4:]))
    assert tuple(message.joint_names) == JOINTS
    assert [point.time_from_start.sec * 10**9 + point.time_from_start.nanosec
            for point in message.points] == times.tolist()
    assert [[*point.positions, *point.velocities] for point in message.points] == values.tolist()
    assert all(len(point.accelerations) == len(point.effort) == 0 for point in message.points)


def test_rclpy_reads_statuses():
    first = Status(17, "predictor: limit cycle", "shimmy", Level.WARN, "über", {"V": "42.5"})
    second = Status(17, "x", "yz", Level.OK, "", {"a": "", "": "b"})
    message = deserialized("/diagnostics", [first, second])
    for status, record in zip(message.status, (first, second), strict=True):
        assert (status.name, status.hardware_id, status.message) == (
            record.name, record.hardware_id, record.message)
        assert status.level == bytes([record.level])
        assert [(item.key, item.value) for item in status.values] == list(record.values.items())


@pytest.mark.parametrize("type_name", sorted({topic.type for topic in load_contract().topics}))
def test_type_hashes_are_those_of_the_installed_types(type_name):
    prefixes = [*os.environ.get("AMENT_PREFIX_PATH", "").split(os.pathsep), sys.prefix]
    files = [Path(prefix) / "share" / f"{type_name}.json" for prefix in prefixes if prefix]
    file = next((file for file in files if file.is_file()), None)
    if file is None:
        pytest.skip("type descriptions are not installed")
    hashes = {entry["type_name"]: entry["hash_string"]
              for entry in json.loads(file.read_text("utf-8"))["type_hashes"]}
    assert type_hash(type_name) == hashes[type_name]
