"""A measured motion beside the answers."""

from __future__ import annotations

import csv
import io
import math
from types import SimpleNamespace

import numpy as np
import pytest

from shimmy_ros.bag.errors import BagError
from shimmy_ros.bag.message import BagMessage, Channel
from shimmy_ros.contract.messages import CODECS
from shimmy_ros.contract.records import GearResponse, MessageError
from shimmy_ros.contract.typestore import JOINT_STATE, new, serialize
from shimmy_ros.replay.measured import Motion, MotionComparison, motion_reader
from shimmy_ros.replay.replay import Inputs

CHANNEL = Channel("/rig/joints", JOINT_STATE)
INPUTS = Inputs("/rig/taxi_velocity", "", "/rig")
SECOND = 10**9


def joint_state(names, position, rate=(), stamp=5):
    time = new("builtin_interfaces/msg/Time", stamp, 0)
    message = new(JOINT_STATE, new("std_msgs/msg/Header", time, ""), list(names),
                  np.array(position), np.array(rate), np.zeros(0))
    return BagMessage(CHANNEL, 9 * SECOND, 9 * SECOND, serialize(message))


def reader(*messages, joint="wheel", topic="/rig/joints", channel=CHANNEL):
    bag = SimpleNamespace(messages=lambda topics: iter(
        [message for message in messages if message.topic in topics]))
    return motion_reader(bag, [channel], topic, joint)


def test_a_joint_is_found_by_its_name():
    message = joint_state(("a", "wheel"), (1.0, 2.0), (3.0, 4.0))
    assert reader(message)(message) == Motion(5 * SECOND, 2.0, 4.0)
    turned = joint_state(("wheel", "a"), (2.0, 1.0), stamp=0)
    read = reader(message)(turned)
    assert read[:2] == (9 * SECOND, 2.0)
    assert math.isnan(read.rate)


def test_a_message_without_the_joint_is_refused():
    message = joint_state(("a", "wheel"), (1.0, 2.0))
    for other in (joint_state(("a", "b"), (1.0, 2.0)), joint_state(("a", "wheel"), (1.0,))):
        with pytest.raises(MessageError, match="no position of a joint wheel, but of a, "):
            reader(message)(other)
        with pytest.raises(BagError, match="first message on topic /rig/joints does not fit"):
            reader(other)


def test_what_is_no_motion_is_refused():
    with pytest.raises(BagError, match=r"no topic /x to compare with; .* it has /rig/joints"):
        reader(topic="/x")
    with pytest.raises(BagError, match="no message on topic /rig/joints"):
        reader()
    with pytest.raises(BagError, match="is of type x/msg/Y, but must be sensor_msgs/msg/JointSta"):
        reader(channel=Channel("/rig/joints", "x/msg/Y"))


def compare(samples, answers, in_order=True):
    """The rows for samples (log time [s], stamp [s], angle) and answers (log time, amplitude)."""
    stream = io.StringIO()
    comparison = MotionComparison(stream, INPUTS, CHANNEL.topic, lambda message: message.data)
    session = SimpleNamespace(sample=SimpleNamespace(velocity=40.0), damper=None)
    events = [(log, Motion(round(stamp * SECOND), angle, math.nan), None)
              for log, stamp, angle in samples]
    events += [(log, None, {
        "limit_cycle/amplitude": SimpleNamespace(position=(0.0, value)),
        "limit_cycle/frequency": 10.0,
        "limit_cycle/status": (SimpleNamespace(values={
            "outcome": "unbounded" if math.isinf(value) else "limit_cycle",
            "beyond_limits": "far" if value > 0.25 else ""}),)}) for log, value in answers]
    if in_order:
        events.sort(key=lambda event: event[0])
    for log, motion, records in events:
        topic = Channel("/rig/taxi_velocity", "") if motion is None else CHANNEL
        log_ns = round(log * SECOND)
        comparison.take(BagMessage(topic, log_ns, log_ns, motion), session, records)
    return stream, comparison


def shimmy(seconds, log=100.0, stamp=0.0, rate_hz=500):
    return [(log + index / rate_hz, stamp + index / rate_hz,
             0.1 * math.sin(2.0 * math.pi * 10.0 * index / rate_hz + 0.3))
            for index in range(int(seconds * rate_hz))]


def test_each_cycle_has_the_answer_that_was_in_force(tmp_path):
    stream, comparison = compare(shimmy(3.0), [(100.5, 0.2), (101.5, 0.3)])
    summary = comparison.finish({"limit_cycle": 2}, "title", tmp_path / "picture.png")
    assert "(2 predictions)" in summary
    assert (tmp_path / "picture.png").read_bytes().startswith(b"\x89PNG")
    rows = list(csv.DictReader(io.StringIO(stream.getvalue())))
    assert len(rows) >= 27
    for texts in rows:
        named = texts.pop("predicted_outcome"), texts.pop("beyond_limits")
        row = {name: float(value) for name, value in texts.items()}
        assert named == (("", "") if row["time_s"] < 0.5 else (
            "limit_cycle", "yes" if row["time_s"] >= 1.5 else "no"))
        expected = 0.3 if row["time_s"] >= 1.5 else 0.2
        if row["time_s"] < 0.5:
            assert math.isnan(row["predicted_amplitude_rad"])
        else:
            assert row["predicted_amplitude_rad"] == expected
        assert row["measured_amplitude_rad"] == pytest.approx(0.1, rel=1e-3)
        assert row["measured_frequency_hz"] == pytest.approx(10.0, rel=1e-4)


def test_motion_without_bound_is_named_in_the_table(tmp_path):
    stream, comparison = compare(shimmy(2.0), [(100.0, math.inf), (101.0, 0.2)])
    summary = comparison.finish({"unbounded": 1, "limit_cycle": 1}, "", tmp_path / "picture.png")
    assert "; unbounded for 1.0 s, from 40.0 to 40.0 m/s" in summary
    rows = list(csv.DictReader(io.StringIO(stream.getvalue())))
    early = [row for row in rows if float(row["time_s"]) < 0.95]
    assert len(early) >= 8
    assert {row["predicted_outcome"] for row in early} == {"unbounded"}
    assert {row["predicted_outcome"] for row in rows if float(row["time_s"]) > 1.0} == {
        "limit_cycle"}


def test_stamps_of_another_clock_and_a_loop(tmp_path):
    stream, comparison = compare(
        [*shimmy(1.0, log=100.0, stamp=7000.0), *shimmy(1.0, log=102.0, stamp=7000.0)],
        [(99.0, 0.2)])
    comparison.finish({}, "title", tmp_path / "picture.png")
    times = [float(row["time_s"]) for row in csv.DictReader(io.StringIO(stream.getvalue()))]
    assert times == sorted(times)
    assert 1.0 < times[0] < 1.3
    assert 3.7 < times[-1] < 4.0
    assert len(times) == 2 * len([time for time in times if time < 2.5])


@pytest.mark.parametrize("second_stamp", [7000.0, 7001.0])
def test_log_times_that_begin_again_go_on(tmp_path, second_stamp):
    """Stamps may begin again with them, or not."""
    stream, comparison = compare(
        [*shimmy(1.0, log=100.0, stamp=7000.0), *shimmy(1.0, log=100.0, stamp=second_stamp)], [],
        in_order=False)
    comparison.finish({}, "title", tmp_path / "picture.png")
    times = [float(row["time_s"]) for row in csv.DictReader(io.StringIO(stream.getvalue()))]
    assert times == sorted(times)
    assert len(times) == pytest.approx(18, abs=1)
    assert 1.8 < times[-1] < 2.0


def test_messages_that_do_not_fit_are_counted():
    stream = io.StringIO()
    codec = CODECS["gear_response"]
    good = codec.encode(GearResponse(1, (0.1,) * 4, (0.0,) * 4, (0.0,) * 4))
    bag = SimpleNamespace(messages=lambda topics: iter([BagMessage(CHANNEL, 0, 0, good)]))
    read = motion_reader(bag, [CHANNEL], CHANNEL.topic, "swivel")
    comparison = MotionComparison(stream, INPUTS, CHANNEL.topic, read)
    session = SimpleNamespace(sample=None)
    for data in (good, b"\0\1\0\0", good):
        comparison.take(BagMessage(CHANNEL, 0, 0, data), session, None)
    assert comparison.refused == 1
