"""``shimmy replay``: every kind of bag in, the predictor's answers out."""

from __future__ import annotations

import csv
import fcntl
import math
import os
import signal
import struct
import subprocess
import sys
import termios
import time
from pathlib import Path

import numpy as np
import pytest
from rosbags.highlevel import AnyReader

from shimmy_ros.bag.reader import read_messages
from shimmy_ros.bag.writer import BagWriter
from shimmy_ros.cli.main import main
from shimmy_ros.contract.answers import answer, findings
from shimmy_ros.contract.messages import CODECS
from shimmy_ros.contract.records import GearResponse, TaxiVelocity
from shimmy_ros.contract.session import REFERENCE_HARDWARE, Session
from shimmy_ros.contract.spec import load_contract
from shimmy_ros.cycles.prediction import Predictor
from shimmy_ros.gear.parameter_file import reference_parameters
from shimmy_ros.gear.parameters import changed

ANSWERS = ("limit_cycle/amplitude", "limit_cycle/frequency", "limit_cycle/orbit",
           "limit_cycle/status")
SECOND = 10**9


@pytest.fixture
def replay(tmp_path, monkeypatch, capsys):
    """Runs the command in an empty directory: exit status, stdout, stderr."""
    monkeypatch.chdir(tmp_path)

    def run(*arguments):
        status = main(["replay", *map(str, arguments)])
        return status, *capsys.readouterr()

    return run


def write_bag(directory, messages, namespace="/shimmy"):
    """A bag of (topic of the contract, log time [s], record)."""
    with BagWriter(directory, chunk_seconds=None) as bag:
        names = {}
        for topic, seconds, record in messages:
            if topic not in names:
                names[topic] = bag.add_topic(load_contract().topic(topic), namespace)
            bag.write(names[topic], CODECS[topic].encode(record), round(seconds * SECOND))
    return directory


def velocity(stamp, value, logged=None):
    return ("taxi_velocity", stamp if logged is None else logged,
            TaxiVelocity(round(stamp * SECOND), value))


def statuses(bag, namespace="/shimmy"):
    """The statuses of the answers, with their log times [s]."""
    return [(message.log_time_ns / SECOND, *CODECS["limit_cycle/status"].decode(message.data))
            for message in read_messages(bag, {f"{namespace}/limit_cycle/status"})]


def files(bag):
    return {file.name: file.read_bytes() for file in bag.iterdir()}


# --- what is answered ---------------------------------------------------------------------------


def test_every_kind_of_bag_gives_the_same_answers(replay, bags, kind, tmp_path):
    written = bags.example()
    session = Session(*reference_parameters(), Predictor())
    expected = []
    for topic, _, log_time, value in written:
        if topic == bags.torque:
            session.damper = changed(session.damper, coulomb_torque=value)
        else:
            session.take(TaxiVelocity(log_time - 500_000, value), log_time)
        if session.sample is not None:
            records = answer(findings(session.predict()), session.sample.stamp_ns,
                             REFERENCE_HARDWARE)
            expected += [(f"/shimmy/{name}", log_time, CODECS[name].encode(record))
                         for name, record in records.items()]
    path = bags.kinds[kind](tmp_path / "bags" / "run", written)
    status, printed, complaints = replay(path, "-o", "out")
    assert (status, complaints) == (0, "")
    assert f"answers  {len(expected) // 4} (limit_cycle {len(expected) // 4})" in printed
    messages = read_messages("out")
    assert [(message.topic, message.log_time_ns, message.data)
            for message in messages] == expected
    assert messages.damage == []


def test_other_tools_read_the_answers(replay, bags, tmp_path):
    path = bags.kinds["mcap"](tmp_path / "run", bags.example(10))
    replay(path)
    with AnyReader([Path("run_replay")]) as reader:
        read = [(connection.topic, reader.deserialize(data, connection.msgtype))
                for connection, _, data in reader.messages()]
    assert [topic for topic, _ in read] == [f"/shimmy/{name}" for name in ANSWERS] * 11
    assert read[0][1].header.stamp.sec * SECOND + read[0][1].header.stamp.nanosec == (
        bags.start_ns - 500_000)
    assert read[0][1].position[1] > 0.01


def test_two_replays_are_the_same_to_the_byte(replay, bags, tmp_path):
    path = bags.kinds["mcap"](tmp_path / "run", bags.example())
    Path("a").mkdir()
    Path("b").mkdir()
    for place in ("a", "b"):
        assert replay(path, "-o", f"{place}/out", "--with-input")[0] == 0
    assert files(Path("a/out")) == files(Path("b/out"))
    assert sorted(files(Path("a/out"))) == ["metadata.yaml", "out_0.mcap"]
    assert sorted(os.listdir("a")) == ["out"]


def test_bad_samples_are_refused_and_named(replay):
    write_bag(Path("in"), [
        velocity(100, 40.0), velocity(101, math.nan), velocity(102, -3.0),
        ("damper/coulomb_torque", 103, -1.0), ("damper/quadratic_damping", 104, 12.0),
        velocity(105, 0.5), velocity(106, 40.0)])
    status, printed, complaints = replay("in", "-o", "out")
    assert status == 0
    assert "answers  4 (limit_cycle 3, not_rolling 1)" in printed
    assert ("refused 2 messages on /shimmy/taxi_velocity, the first because taxi_velocity is nan, "
            "but must be in [0, 200] m/s") in complaints
    assert "refused 1 messages on /shimmy/damper/coulomb_torque, the first because" in complaints
    assert [(log, status.stamp_ns // SECOND, status.values["quadratic_damping"])
            for log, status in statuses("out")] == [
        (100, 100, "10.0"), (104, 100, "12.0"), (105, 105, "12.0"), (106, 106, "12.0")]


def test_time_that_jumps_back_is_said_once(replay):
    stamps = [100, 101, 102, 90, 91, 91, 50, 5000]
    write_bag(Path("in"), [velocity(stamp, 40.0 + index / 10, 1000 + index)
                           for index, stamp in enumerate(stamps)])
    status, _, complaints = replay("in", "-o", "out")
    assert status == 0
    assert complaints.count("jumped back") == 1
    assert "time jumped back by 12 s; the next answer starts cold (the first of 2" in complaints
    answers = statuses("out")
    assert [status.stamp_ns // SECOND for _, status in answers] == stamps
    assert [log for log, _ in answers] == [1000 + index for index in range(len(stamps))]
    cold = [index for index, (_, status) in enumerate(answers) if status.values["start"] == "cold"]
    assert cold == [0, 3, 6]


def test_a_single_jump_is_not_counted(replay):
    write_bag(Path("in"), [velocity(100, 40.0, 1000), velocity(90, 41.0, 1001)])
    _, _, complaints = replay("in", "-o", "out")
    assert complaints == "shimmy: time jumped back by 10 s; the next answer starts cold\n"


def test_a_stamp_of_zero_is_the_log_time(replay):
    write_bag(Path("in"), [velocity(0, 40.0, 1000), velocity(0, 41.0, 1001),
                           velocity(50, 42.0, 1002)])
    status, _, complaints = replay("in", "-o", "out")
    assert status == 0
    assert complaints.count("stamp of zero") == 1
    assert "(2 of them)" in complaints
    assert [status.stamp_ns // SECOND for _, status in statuses("out")] == [1000, 1001, 50]


def test_the_solve_time_is_left_out(replay):
    write_bag(Path("in"), [velocity(100, 40.0)])
    replay("in", "-o", "out")
    ((_, status),) = statuses("out")
    assert status.values["solve_time"] == "nan"
    assert status.hardware_id == REFERENCE_HARDWARE


def test_options_are_the_predictors(replay, tmp_path):
    write_bag(Path("in"), [velocity(100, 3.0), velocity(101, 40.0)])
    status, printed, _ = replay(
        "in", "-o", "out", "--harmonics", 2, "--minimum-velocity", 5.0, "--quadratic-damping", 7.5,
        "--hardware-id", "rig 3")
    assert (status, "not_rolling 1" in printed) == (0, True)
    (_, first), (_, second) = statuses("out")
    assert first.values["outcome"] == "not_rolling"
    assert (second.values["harmonics"], second.values["quadratic_damping"]) == ("2", "7.5")
    assert second.hardware_id == "rig 3"
    messages = read_messages("out")
    list(messages)
    settings = messages.metadata["shimmy_ros"]
    assert (settings["harmonics"], settings["damper.quadratic_damping"]) == ("2", "7.5")
    assert settings["velocity_topic"] == "'/shimmy/taxi_velocity'"


# --- what is read -------------------------------------------------------------------------------


def test_a_velocity_in_a_field_of_another_type(replay, bags):
    write_bag(Path("in"), [
        ("gear_response", 100 + index, GearResponse(
            round((100 + index) * SECOND), (0.0, 40.0 + index, 0.0, 0.0), (0.0,) * 4, (0.0,) * 4))
        for index in range(3)], "/other")
    status, _, complaints = replay(
        "in", "-o", "out", "--velocity-topic", "/other/gear_response:position[1]")
    assert (status, complaints) == (0, "")
    assert [status.values["taxi_velocity"] for _, status in statuses("out")] == [
        "40.0", "41.0", "42.0"]
    replay("in", "-o", "out2", "--velocity-topic", "/other/gear_response:position[1]",
           "--namespace", "/other")
    assert len(statuses("out2", "/other")) == 3


def test_the_namespace_is_that_of_the_velocity(replay):
    write_bag(Path("in"), [velocity(100, 40.0), ("damper/coulomb_torque", 101, 15.0)], "/a/b")
    assert replay("in", "-o", "out")[0] == 0
    assert [status.values["coulomb_torque"] for _, status in statuses("out", "/a/b")] == [
        "20.0", "15.0"]


def test_the_input_is_copied(replay, bags, tmp_path):
    written = bags.example(10)
    path = bags.kinds["ros 1"](tmp_path / "run", written)
    assert replay(path, "-o", "once", "--with-input")[0] == 0
    copied = [(message.topic, message.type, message.log_time_ns, message.data)
              for message in read_messages("once")
              if "limit_cycle" not in message.topic]
    assert copied == [(*message[:3], bags.cdr(message)) for message in written]
    # Older answers give way to new ones, and the same answers come out.
    assert replay("once", "-o", "twice", "--with-input")[0] == 0
    assert [message[1:] for message in read_messages("twice")] == [
        message[1:] for message in read_messages("once")]


def test_a_cut_bag_is_replayed_as_far_as_it_goes(replay, bags, tmp_path):
    path = bags.kinds["mcap, zstd chunks"](tmp_path / "run", bags.example(200))
    replay(path, "-o", "whole")
    whole = [message[1:] for message in read_messages("whole")]
    content = path.read_bytes()
    for number, part in enumerate((0.3, 0.7, 0.95)):
        path.write_bytes(content[:int(part * len(content))])
        status, _, complaints = replay(path, "-o", f"cut{number}")
        assert status == 0
        assert f"{path} is cut off after" in complaints
        read = [message[1:] for message in read_messages(f"cut{number}")]
        assert read == whole[:len(read)]
        assert len(read) > 4 * 200 * (part - 0.2)


# --- what is wrong ------------------------------------------------------------------------------


@pytest.mark.parametrize(("arguments", "sentence"), [
    (["nothing"], "bag nothing does not exist"),
    (["text.txt"], "text.txt is no bag: it is neither an MCAP nor an SQLite file nor a ROS 1 bag"),
    (["empty"], "bag empty holds neither metadata.yaml nor an MCAP or SQLite file"),
    (["other"], "the bag has no topic taxi_velocity; name one with --velocity-topic: /a/damper"),
    (["in", "--velocity-topic", "/x"], "the bag has no topic /x; it has /shimmy/taxi_velocity"),
    (["in", "--namespace", "/x"], "the bag has no topic /x/taxi_velocity"),
    (["in", "--velocity-topic", "/shimmy/taxi_velocity:twist.linear.w"], "has no field twist.line"),
    (["in", "--velocity-topic", "/shimmy/taxi_velocity:twist.linear"], "is no number"),
    (["wrong"], "/shimmy/damper/coulomb_torque is of type std_msgs/msg/String, but must be std_ms"),
    (["both"], "the bag has 2 topics taxi_velocity; name one with --velocity-topic: /a/taxi_veloc"),
    (["none"], "the bag has no message on topic /shimmy/taxi_velocity"),
    (["in", "-o", "empty"], "empty exists already and is not overwritten"),
    (["in", "-o", "text.txt/out"], "text.txt/out cannot be made: "),
    (["in", "--harmonics", "0"], "harmonics is 0, but must be in [1, 64] harmonics"),
    (["in", "--compare"], "the bag has no topic /shimmy/gear_response to compare with"),
    (["in", "--compare", "--response-topic", "/shimmy/taxi_velocity"], "but must be sensor_msgs/"),
    (["moved", "--compare", "--response-topic", "/shimmy/gear_response:wheel"],
     "the first message on topic /shimmy/gear_response does not fit: it has no position of a "
     "joint wheel, but of strut_tilt, swivel, damper, tyre_lateral"),
])
def test_what_is_wrong_is_said_in_one_sentence(replay, bags, arguments, sentence):
    Path("text.txt").write_text("This is no bag.\n" * 10)
    Path("empty").mkdir()
    write_bag(Path("in"), [velocity(100, 40.0)])
    write_bag(Path("other"), [("damper/coulomb_torque", 100, 1.0)], "/a")
    write_bag(Path("moved"), [velocity(100, 40.0), ("gear_response", 100, GearResponse(
        1, (0.0,) * 4, (0.0,) * 4, (0.0,) * 4))])
    with BagWriter(Path("none")) as bag:
        bag.add_topic(load_contract().topic("taxi_velocity"), "/shimmy")
    with BagWriter(Path("both")) as bag:
        for namespace in ("/a", "/b"):
            bag.write(bag.add_topic(load_contract().topic("taxi_velocity"), namespace), b"", 0)
    store, _ = bags.stores()
    text = store.types["std_msgs/msg/String"]("10")
    with AnyWriter(Path("wrong"), store) as wrong:
        wrong.write("/shimmy/taxi_velocity", bags.twist_stamped(store, 1, 40.0))
        wrong.write("/shimmy/damper/coulomb_torque", text)
    before = sorted(os.listdir())
    status, printed, complaints = replay(*arguments)
    assert (status, printed) == (2, "")
    assert complaints.startswith("shimmy: ")
    assert sentence in complaints
    assert complaints.count("\n") == 1
    assert sorted(os.listdir()) == before


class AnyWriter:
    """A bag of any messages, by rosbags."""

    def __init__(self, directory, store):
        from rosbags.rosbag2 import StoragePlugin, Writer

        self._writer = Writer(directory, version=9, storage_plugin=StoragePlugin.MCAP)
        self._store = store

    def __enter__(self):
        self._writer.open()
        return self

    def __exit__(self, *_):
        self._writer.close()

    def write(self, topic, message):
        kind = message.__msgtype__
        connection = self._writer.add_connection(topic, kind, typestore=self._store)
        self._writer.write(connection, SECOND, self._store.serialize_cdr(message, kind))


def test_without_any_answer_the_status_is_that_of_a_failure(replay):
    write_bag(Path("in"), [velocity(100, 400.0)])
    status, printed, complaints = replay("in", "-o", "out")
    assert status == 1
    assert "answers  0" in printed
    assert "refused 1 messages" in complaints
    assert list(read_messages("out")) == []


def test_a_failing_disk_leaves_nothing(replay, monkeypatch):
    write_bag(Path("in"), [velocity(100 + index, 40.0) for index in range(30)])

    def fail(self):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(BagWriter, "flush", fail)
    status, printed, complaints = replay("in", "-o", "out")
    assert (status, printed) == (1, "")
    assert "No space left on device" in complaints
    assert os.listdir() == ["in"]


# --- stopping -----------------------------------------------------------------------------------


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_a_signal_keeps_what_is_finished(replay, tmp_path, number):
    write_bag(tmp_path / "in", [velocity(100 + index / 50, 40.0 + index / 1000)
                                for index in range(20_000)])
    child = subprocess.Popen(
        [sys.executable, "-m", "shimmy_ros.cli.main", "replay", "in", "-o", "out"],
        stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, cwd=tmp_path,
        env=os.environ | {"PYTHONPATH": str(Path(__file__).parents[2])})
    try:
        while not [file for file in tmp_path.glob(".out.*/out/out_0.mcap")
                   if file.stat().st_size > 100_000]:
            assert child.poll() is None
            time.sleep(0.005)
        assert not (tmp_path / "out").exists()
        child.send_signal(number)
        printed, complaints = child.communicate(timeout=60)
    finally:
        child.kill()
        child.wait()
    assert child.returncode == 130
    assert complaints == "shimmy: stopped; what was finished until then is there\n"
    messages = read_messages(tmp_path / "out")
    count = len(list(messages))
    assert messages.damage == []
    assert 0 < count < 80_000
    assert f"answers  {count // 4} " in printed
    assert sorted(os.listdir(tmp_path)) == ["in", "out"]


def test_a_terminal_shows_the_progress(tmp_path):
    write_bag(tmp_path / "in", [velocity(100 + index / 50, 40.0) for index in range(1000)])
    ours, theirs = os.openpty()
    fcntl.ioctl(theirs, termios.TIOCSWINSZ, struct.pack("HHHH", 24, 80, 0, 0))
    child = subprocess.Popen(
        [sys.executable, "-m", "shimmy_ros.cli.main", "replay", "in", "-o", "out"],
        stdout=subprocess.DEVNULL, stderr=theirs, cwd=tmp_path,
        env=os.environ | {"PYTHONPATH": str(Path(__file__).parents[2])})
    os.close(theirs)
    shown = b""
    try:
        while block := os.read(ours, 4096):
            shown += block
    except OSError:  # how Linux says that the other end was closed
        pass
    finally:
        os.close(ours)
        child.wait()
    assert child.returncode == 0
    assert b"replaying:   0 %|" in shown
    assert b"replaying: 100 %|" in shown


# --- comparison ---------------------------------------------------------------------------------


def shimmy(seconds=12.0, rate_hz=200, amplitude=0.05, frequency_hz=15.0):
    """Velocities and a response that is a sine of known amplitude and frequency."""
    messages = []
    for index in range(int(seconds * rate_hz)):
        at = 100 + index / rate_hz
        if index % 10 == 0:
            messages.append(velocity(at, 40.0 + index / rate_hz))
        angle = 2.0 * math.pi * frequency_hz * index / rate_hz
        messages.append(("gear_response", at, GearResponse(
            round(at * SECOND), (0.0, amplitude * math.sin(angle), 0.0, 0.0),
            (0.0, amplitude * 2.0 * math.pi * frequency_hz * math.cos(angle), 0.0, 0.0),
            (0.0,) * 4)))
    return messages


def test_measured_cycles_beside_the_predictions(replay):
    write_bag(Path("in"), [*shimmy(), ("damper/coulomb_torque", 106.0, 10.0)])
    status, printed, complaints = replay("in", "-o", "out", "--compare")
    assert (status, complaints) == (0, "")
    assert "cycles the median difference is" in printed
    with Path("out.csv").open() as file:
        texts = list(csv.DictReader(file))
    assert list(texts[0]) == [
        "time_s", "taxi_velocity_m_per_s", "measured_amplitude_rad", "measured_frequency_hz",
        "predicted_amplitude_rad", "predicted_frequency_hz", "predicted_outcome", "beyond_limits"]
    assert {(row.pop("predicted_outcome"), row.pop("beyond_limits")) for row in texts} == {
        ("limit_cycle", "no")}
    rows = [{name: float(value) for name, value in row.items()} for row in texts]
    assert len(rows) in (178, 179)
    assert np.allclose([row["measured_amplitude_rad"] for row in rows], 0.05, rtol=1e-3)
    assert np.allclose([row["measured_frequency_hz"] for row in rows], 15.0, rtol=1e-4)
    answers = [(message.log_time_ns / SECOND, CODECS["limit_cycle/amplitude"].decode(message.data))
               for message in read_messages("out", {"/shimmy/limit_cycle/amplitude"})]
    for row in rows:
        at = 100.0 + row["time_s"]
        expected = [record.position[1] for log, record in answers if log <= at + 1e-6][-1]
        assert row["predicted_amplitude_rad"] == expected
        assert row["taxi_velocity_m_per_s"] == pytest.approx(40.0 + row["time_s"], abs=0.06)
    assert Path("out.png").read_bytes().startswith(b"\x89PNG")
    assert sorted(os.listdir()) == ["in", "out", "out.csv", "out.png"]


def test_the_answers_are_the_same_with_and_without_comparison(replay):
    write_bag(Path("in"), shimmy(2.0))
    Path("other").mkdir()
    replay("in", "-o", "out", "--compare")
    replay("in", "-o", "other/out")
    assert files(Path("out")) == files(Path("other/out"))


def test_nothing_is_overwritten_by_a_comparison(replay):
    write_bag(Path("in"), shimmy(1.0))
    Path("out.csv").write_text("mine")
    status, _, complaints = replay("in", "-o", "out", "--compare")
    assert status == 2
    assert "out.csv exists already and is not overwritten" in complaints
    assert Path("out.csv").read_text() == "mine"
    assert sorted(os.listdir()) == ["in", "out.csv"]
