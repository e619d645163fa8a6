"""Records to messages and back, against rosbags' typestore and mcap-ros2-support."""

from __future__ import annotations

import math
import random

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from mcap.records import Schema

from shimmy_ros.contract.messages import CODECS
from shimmy_ros.contract.records import (
    JOINTS,
    GearResponse,
    Level,
    LimitCycleAmplitude,
    LimitCycleOrbit,
    MessageError,
    Status,
    TaxiVelocity,
)
from shimmy_ros.contract.typestore import definition, new, serialize, typestore

stamps = st.integers(-(2**31) * 10**9, 2**31 * 10**9 - 1)
numbers = st.floats(width=64)
fours = st.tuples(*[numbers] * len(JOINTS))
text = st.text(max_size=12)


@st.composite
def orbits(draw):
    times = draw(st.lists(st.integers(0, 2**31 * 10**9 - 1), max_size=4))
    values = draw(st.lists(st.tuples(fours, fours), min_size=len(times), max_size=len(times)))
    table = np.array(values, float).reshape(len(times), 2, len(JOINTS))
    return LimitCycleOrbit(draw(stamps), np.array(times, np.int64), table[:, 0], table[:, 1])


@st.composite
def status_lists(draw):
    stamp = draw(stamps)
    status = st.builds(Status, st.just(stamp), text, text, st.sampled_from(Level), text,
                       st.dictionaries(text, text, max_size=4))
    return draw(st.lists(status, min_size=1, max_size=3))


RECORDS = {
    "taxi_velocity": st.builds(TaxiVelocity, stamps, numbers),
    "damper/coulomb_torque": numbers,
    "gear_response": st.builds(GearResponse, stamps, fours, fours, fours),
    "limit_cycle/amplitude": st.builds(LimitCycleAmplitude, stamps, fours, fours),
    "limit_cycle/orbit": orbits(),
    "limit_cycle/status": status_lists(),
    "what_if/query": st.text(),
}
KINDS = pytest.mark.parametrize("name", RECORDS)

FOUR = (0.01, -0.2, 3.0, 0.004)
EXAMPLES = {
    "taxi_velocity": TaxiVelocity(1_700_000_000_123_456_789, 42.5),
    "damper/coulomb_torque": 20.0,
    "gear_response": GearResponse(17, FOUR, FOUR[::-1], (0.0, -20.0, 3.5, 0.0)),
    "limit_cycle/amplitude": LimitCycleAmplitude(17, FOUR, FOUR[::-1]),
    "limit_cycle/orbit": LimitCycleOrbit(
        17, np.array([0, 25_000_000, 50_000_001]), np.arange(12.0).reshape(3, 4),
        -np.arange(12.0).reshape(3, 4)),
    "limit_cycle/status": [
        Status(17, "predictor: limit cycle", "shimmy", Level.OK, "limit cycle",
               {"taxi_velocity": "42.5", "outcome": "limit_cycle"}),
        Status(17, "a", "b", Level.STALE, "", {}),
    ],
    "what_if/query": '{"taxi_velocity": 40}',
}


def refusal(codec, data):
    """The sentence with which ``data`` are refused, or none where they decode all the same."""
    try:
        codec.decode(data)
    except MessageError as error:
        return str(error)
    return ""


def plain(record):
    """``record`` in a form in which equal means the same, NaN included."""
    if isinstance(record, LimitCycleOrbit):
        return (record.stamp_ns, record.times_ns.tolist(), repr(record.positions.tolist()),
                repr(record.velocities.tolist()))
    return repr(tuple(record) if isinstance(record, list) else record)


@KINDS
@given(data=st.data())
def test_a_record_returns_and_has_the_typestores_bytes(name, data):
    record = data.draw(RECORDS[name])
    codec = CODECS[name]
    encoded = codec.encode(record)
    assert plain(codec.decode(encoded)) == plain(record)
    assert serialize(typestore().deserialize_cdr(encoded, codec.type)) == encoded


@KINDS
def test_big_endian_bytes_are_read(name):
    codec = CODECS[name]
    message = typestore().deserialize_cdr(codec.encode(EXAMPLES[name]), codec.type)
    swapped = bytes(typestore().serialize_cdr(message, codec.type, little_endian=False))
    assert swapped != codec.encode(EXAMPLES[name])
    assert plain(codec.decode(swapped)) == plain(EXAMPLES[name])


@KINDS
@given(data=st.data())
def test_damaged_bytes_are_refused_with_one_error(name, data):
    codec = CODECS[name]
    encoded = bytearray(codec.encode(EXAMPLES[name]))
    for _ in range(data.draw(st.integers(1, 3))):
        encoded[data.draw(st.integers(0, len(encoded) - 1))] = data.draw(st.integers(0, 255))
    end = data.draw(st.integers(0, len(encoded)))
    for damaged in (bytes(encoded), bytes(encoded[:end]), data.draw(st.binary(max_size=64))):
        assert "\n" not in refusal(codec, damaged)


@KINDS
def test_every_shortened_message_is_refused(name):
    codec = CODECS[name]
    encoded = codec.encode(EXAMPLES[name])
    for end in range(len(encoded)):
        with pytest.raises(MessageError):
            codec.decode(encoded[:end])
    with pytest.raises(MessageError, match=f"bytes are no {codec.type}"):
        codec.decode(encoded + bytes(4))


@KINDS
def test_an_independent_decoder_reads_the_same(name):
    decoder_module = pytest.importorskip("mcap_ros2.decoder")
    codec = CODECS[name]
    schema = Schema(id=1, name=codec.type, encoding="ros2msg",
                    data=definition(codec.type).encode())
    message = decoder_module.DecoderFactory().decoder_for("cdr", schema)(
        codec.encode(EXAMPLES[name]))
    record = EXAMPLES[name]
    if name in ("damper/coulomb_torque", "what_if/query"):
        assert message.data == record
        return
    stamp_ns = 17 if isinstance(record, list) else record.stamp_ns
    assert message.header.stamp.sec * 10**9 + message.header.stamp.nanosec == stamp_ns
    if name == "taxi_velocity":
        assert message.twist.linear.x == record.velocity
        assert message.header.frame_id == "base_link"
    elif name == "limit_cycle/orbit":
        assert tuple(message.joint_names) == JOINTS
        np.testing.assert_array_equal([p.positions for p in message.points], record.positions)
        np.testing.assert_array_equal([p.velocities for p in message.points], record.velocities)
        times = [p.time_from_start.sec * 10**9 + p.time_from_start.nanosec for p in message.points]
        assert times == record.times_ns.tolist()
    elif name == "limit_cycle/status":
        first, second = message.status
        assert (first.name, first.hardware_id, first.message) == (
            "predictor: limit cycle", "shimmy", "limit cycle")
        assert {item.key: item.value for item in first.values} == record[0].values
        assert [int(status.level) for status in (first, second)] == [Level.OK, Level.STALE]
    else:
        assert tuple(message.name) == JOINTS
        assert tuple(message.position) == record.position
        assert tuple(message.velocity) == record.velocity
        assert tuple(message.effort) == getattr(record, "effort", ())


def header(sec=0, nanosec=17, frame="gear"):
    return new("std_msgs/msg/Header", new("builtin_interfaces/msg/Time", sec, nanosec), frame)


def joint_state(names, position, velocity, effort, **stamp):
    return serialize(new("sensor_msgs/msg/JointState", header(**stamp), list(names),
                         np.array(position), np.array(velocity), np.array(effort)))


def trajectory(names, points):
    duration = new("builtin_interfaces/msg/Duration", 0, 5)
    none = np.zeros(0)
    return serialize(new("trajectory_msgs/msg/JointTrajectory", header(), list(names), [
        new("trajectory_msgs/msg/JointTrajectoryPoint", np.array(position), np.array(velocity),
            none, none, duration) for position, velocity in points]))


def test_joints_are_found_by_name():
    values = dict(zip(JOINTS, FOUR, strict=True), brake=9.0)
    names = list(values)
    random.Random(1).shuffle(names)
    assert names[:4] != list(JOINTS)
    sent = [values[name] for name in names]
    negative = [-value for value in sent]
    response = CODECS["gear_response"].decode(joint_state(names, sent, negative, sent))
    assert response == GearResponse(17, FOUR, tuple(-value for value in FOUR), FOUR)
    amplitude = CODECS["limit_cycle/amplitude"].decode(joint_state(names, sent, negative, []))
    assert amplitude == LimitCycleAmplitude(17, FOUR, response.velocity)
    orbit = CODECS["limit_cycle/orbit"].decode(trajectory(names, [(sent, negative)] * 2))
    np.testing.assert_array_equal(orbit.positions, [FOUR, FOUR])
    np.testing.assert_array_equal(orbit.velocities, -orbit.positions)
    assert orbit.times_ns.tolist() == [5, 5]


@pytest.mark.parametrize(("data", "reason"), [
    (joint_state(JOINTS[:3], FOUR[:3], FOUR[:3], FOUR[:3]), "joint tyre_lateral appears 0 times"),
    (joint_state((*JOINTS, "swivel"), FOUR, FOUR, FOUR), "joint swivel appears 2 times"),
    (joint_state((), (), (), ()), "joint strut_tilt appears 0 times among no names"),
    (joint_state(JOINTS, FOUR[:3], FOUR, FOUR), "position of a JointState has 3 values"),
    (joint_state(JOINTS, FOUR, (), FOUR), "velocity of a JointState has 0 values"),
    (joint_state(JOINTS, FOUR, FOUR, (*FOUR, 1.0)), "effort of a JointState has 5 values"),
    (joint_state(JOINTS, FOUR, FOUR, FOUR, nanosec=10**9), "nanosec of a stamp is 1000000000"),
])
def test_a_joint_state_of_another_shape_is_refused(data, reason):
    with pytest.raises(MessageError, match=reason):
        CODECS["gear_response"].decode(data)


@pytest.mark.parametrize(("data", "reason"), [
    (trajectory(JOINTS, [(FOUR, FOUR), (FOUR[:3], FOUR)]), "positions of point 1 .* has 3 values"),
    (trajectory(JOINTS, [(FOUR, ())]), "velocities of point 0 .* has 0 values"),
    (trajectory(JOINTS[1:], []), "joint strut_tilt appears 0 times"),
])
def test_a_trajectory_of_another_shape_is_refused(data, reason):
    with pytest.raises(MessageError, match=reason):
        CODECS["limit_cycle/orbit"].decode(data)


def test_a_status_of_unknown_level_is_refused():
    encoded = bytearray(CODECS["limit_cycle/status"].encode(EXAMPLES["limit_cycle/status"][1:]))
    encoded[encoded.index(Level.STALE, 20)] = 7
    with pytest.raises(MessageError, match="level of a status is 7"):
        CODECS["limit_cycle/status"].decode(bytes(encoded))


@pytest.mark.parametrize("build", [
    lambda: GearResponse(0, FOUR[:3], FOUR, FOUR),
    lambda: GearResponse(0, FOUR, FOUR, ()),
    lambda: LimitCycleAmplitude(0, FOUR, (*FOUR, 1.0)),
    lambda: LimitCycleOrbit(0, np.zeros(3, np.int64), np.zeros((3, 4)), np.zeros((2, 4))),
    lambda: LimitCycleOrbit(0, np.zeros(3, np.int64), np.zeros((4, 3)), np.zeros((3, 4))),
])
def test_records_of_another_shape_are_refused(build):
    with pytest.raises(MessageError, match="must have"):
        build()


@pytest.mark.parametrize(("name", "record"), [
    ("taxi_velocity", TaxiVelocity(2**31 * 10**9, 1.0)),
    ("taxi_velocity", TaxiVelocity(-(2**31) * 10**9 - 1, 1.0)),
    ("taxi_velocity", TaxiVelocity(0, "fast")),
    ("damper/coulomb_torque", "much"),
    ("limit_cycle/orbit", LimitCycleOrbit(0, np.array([-1]), np.zeros((1, 4)), np.zeros((1, 4)))),
    ("limit_cycle/orbit",
     LimitCycleOrbit(0, np.array([2**31 * 10**9]), np.zeros((1, 4)), np.zeros((1, 4)))),
    ("limit_cycle/status", []),
    ("limit_cycle/status", [Status(1, "a", "b", Level.OK, "", {}),
                            Status(2, "a", "b", Level.OK, "", {})]),
    ("limit_cycle/status", [Status(1, "a", "b", Level.OK, "\ud800", {})]),
    ("what_if/answer", "\ud800"),
])
def test_what_no_message_can_hold_is_refused(name, record):
    with pytest.raises(MessageError):
        CODECS[name].encode(record)


def test_numpy_values_are_sent_as_they_are():
    position = tuple(np.array(FOUR))
    assert CODECS["gear_response"].encode(
        GearResponse(np.int64(17), position, position, position)
    ) == CODECS["gear_response"].encode(GearResponse(17, FOUR, FOUR, FOUR))


def test_nan_passes():
    assert math.isnan(CODECS["limit_cycle/frequency"].decode(
        CODECS["limit_cycle/frequency"].encode(math.nan)))


def test_an_array_without_statuses_is_read_as_none():
    empty = serialize(new("diagnostic_msgs/msg/DiagnosticArray", header(), []))
    assert CODECS["/diagnostics"].decode(empty) == ()
