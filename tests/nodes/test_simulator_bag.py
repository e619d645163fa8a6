"""The simulator's bag: complete, closed properly, readable by others and after a kill."""

from __future__ import annotations

import resource
import signal
from itertools import pairwise
from pathlib import Path

import pytest
import yaml
from mcap.reader import make_reader
from mcap_ros2.decoder import DecoderFactory
from rosbags.highlevel import AnyReader
from rosbags.rosbag2 import Reader

from shimmy_ros.bag.reader import read_messages
from shimmy_ros.contract.messages import CODECS

CONTRACT = yaml.safe_load(
    (Path(__file__).parents[2] / "msgs_spec" / "topics.yaml").read_text(encoding="utf-8"))
RECORDED = {f"/test/{topic['name']}": topic for topic in CONTRACT["topics"] if topic["recorded"]}
ANSWERS = ("limit_cycle/amplitude", "limit_cycle/frequency", "limit_cycle/orbit",
           "limit_cycle/status")
RESPONSE = "/test/gear_response"
STEP_NS = 2_000_000
QUARTER_NS = 250_000_000


def stamp_ns(message):
    return message.header.stamp.sec * 10**9 + message.header.stamp.nanosec


def with_rosbags(bag):
    """Topic -> messages, by rosbags' reader of any bag."""
    found = {topic: [] for topic in RECORDED}
    with AnyReader([bag]) as reader:
        for connection, _, data in reader.messages():
            found[connection.topic].append(reader.deserialize(data, connection.msgtype))
    return found


def with_mcap_ros2(file):
    """Topic -> messages, by mcap-ros2-support."""
    found = {topic: [] for topic in RECORDED}
    with file.open("rb") as stream:
        reader = make_reader(stream, decoder_factories=[DecoderFactory()])
        for _, channel, _, message in reader.iter_decoded_messages():
            found[channel.topic].append(message)
    return found


def response_stamps(bag):
    """Stamps of the recorded responses, as far as a bag can be read."""
    return [CODECS["gear_response"].decode(message.data).stamp_ns
            for message in read_messages(bag, [RESPONSE])]


@pytest.fixture
def bench(stage):
    """A bench that hears everything."""
    stage.bench.listen(*ANSWERS, "gear_response", "/diagnostics")
    return stage.bench


def start_run(stage, **settings):
    """Start a simulator, and wait for its first responses."""
    node = stage.start("simulator", **settings)
    bench = stage.bench
    bench.wait_until(lambda: len(bench.received["gear_response"]) > 100, "responses")
    return node


def test_a_bag_holds_what_was_sent(stage, bench, tmp_path, values):
    bag = tmp_path / "runs" / "first"
    stage.start("predictor")
    simulator = start_run(stage, bag_directory=bag, kick_swivel_rate="5.0")
    bench.join("predictor", "simulator")
    velocities = [40.0 + 0.5 * index for index in range(40)]
    dampings = [("linear_damping", 2.5), ("quadratic_damping", 15.0), ("coulomb_torque", 15.0),
                ("coulomb_torque", -1.0), ("coulomb_torque", 20.0)]
    # Until the recorder hears every answer.
    bench.ask(39.0)
    bench.await_diagnostic(
        "simulator: bag", lambda status: all(
            int(values(status)[topic]) >= 1 for topic in (*ANSWERS, "taxi_velocity")),
        "the recorder to hear the predictor", lambda: bench.send_velocity(39.0))
    bench.drain("limit_cycle/status")
    heard_before = {topic: len(bench.received[topic]) for topic in ANSWERS}
    bench.call("simulator/kick", "std_srvs/srv/Trigger")
    for index, velocity in enumerate(velocities):
        stamp = bench.send_velocity(velocity)
        if index % 8 == 0:
            bench.send_damper(*dampings[index // 8])
        bench.await_answer(lambda answer, stamp=stamp: answer.status.header.stamp.sec == stamp,
                           f"an answer to {velocity} m/s")
    bench.drain("limit_cycle/status")
    heard = {topic: bench.received[topic][count:] for topic, count in heard_before.items()}
    responses = list(bench.received["gear_response"])
    assert simulator.stop(signal.SIGTERM) == 0, simulator.log()

    by_rosbags, by_mcap = with_rosbags(bag), with_mcap_ros2(bag / "first_0.mcap")
    for found in (by_rosbags, by_mcap):
        sent = [message.twist.linear.x for message in found["/test/taxi_velocity"]]
        assert [velocity for velocity in sent if velocity != 39.0] == velocities
        for name in ("linear_damping", "quadratic_damping", "coulomb_torque"):
            assert [message.data for message in found[f"/test/damper/{name}"]] == [
                value for other, value in dampings if other == name]
        for topic in ANSWERS:
            assert len(found[f"/test/{topic}"]) >= len(heard[topic]) >= len(velocities) + 4
        stamps = [stamp_ns(message) for message in found[RESPONSE]]
        assert {late - early for early, late in pairwise(stamps)} == {STEP_NS}
    amplitudes = heard["limit_cycle/amplitude"]
    for recorded, answer in zip(by_rosbags["/test/limit_cycle/amplitude"][-len(amplitudes):],
                                amplitudes, strict=True):
        assert stamp_ns(recorded) == stamp_ns(answer)
        assert recorded.position.tolist() == list(answer.position)
    recorded = {stamp_ns(message): message for message in by_rosbags[RESPONSE]}
    assert len(responses) > 100
    for message in responses:
        assert recorded[stamp_ns(message)].position.tolist() == list(message.position)

    with Reader(bag) as reader:
        connections = {connection.topic: connection for connection in reader.connections}
        assert set(connections) == set(RECORDED)
        for topic, connection in connections.items():
            assert connection.msgtype == RECORDED[topic]["type"]
            assert connection.msgcount == len(by_rosbags[topic])
    with (bag / "first_0.mcap").open("rb") as stream:
        reader = make_reader(stream)
        assert reader.get_header().profile == "ros2"
        settings = {record.name: record.metadata for record in reader.iter_metadata()}
    assert settings["shimmy_ros"]["gear.trail"] == "0.08"
    assert settings["shimmy_ros"]["kick_swivel_rate"] == "5.0"


def test_a_killed_simulator_leaves_all_but_the_last_quarter_second(stage, bench, tmp_path):
    simulator = start_run(stage, bag_directory=tmp_path / "bag")
    responses = bench.received["gear_response"]
    begin_ns = stamp_ns(responses[-1])
    bench.wait_until(lambda: stamp_ns(responses[-1]) > begin_ns + 1_130_000_000,
                     "the run to go on")
    simulator.kill()
    bench.drain("gear_response")
    published = [stamp_ns(message) for message in responses]
    recorded = response_stamps(tmp_path / "bag")
    assert {late - early for early, late in pairwise(recorded)} == {STEP_NS}
    assert recorded[-1] >= published[-1] - QUARTER_NS
    assert not (tmp_path / "bag" / "metadata.yaml").exists()


def test_what_is_recorded_reaches_the_disk_while_the_clock_stands(stage, bench, tmp_path):
    stage.start("simulator", bag_directory=tmp_path / "bag", use_sim_time="true")
    clock = bench.create_clock_publisher()
    bench.wait_until(lambda: clock.get_subscription_count() == 1, "the simulator")
    message = clock.msg_type()
    responses = bench.received["gear_response"]

    def tick():
        message.clock.sec, message.clock.nanosec = divmod(
            message.clock.sec * 10**9 + message.clock.nanosec + 5 * STEP_NS, 10**9)
        clock.publish(message)
        return len(responses) > 200

    message.clock.sec = 50
    bench.wait_until(tick, "responses")
    bench.drain("gear_response")
    # Some may have been recorded before the bench was heard of.
    bench.wait_until(lambda: {stamp_ns(message) for message in responses} <= set(
        response_stamps(tmp_path / "bag")), "all of them on the disk")


def test_each_run_has_its_own_bag(stage, bench, tmp_path):
    bag = tmp_path / "bag"
    simulator = start_run(stage, bag_directory=bag)
    bags = [bag, tmp_path / "bag+2", tmp_path / "bag+3"]
    for number in (2, 3):
        assert bench.change_state("simulator", "deactivate")
        assert (bags[number - 2] / "metadata.yaml").is_file()
        bench.drain("gear_response")
        assert bench.change_state("simulator", "activate")
        count = len(bench.received["gear_response"])
        bench.wait_until(lambda count=count: len(bench.received["gear_response"]) > count + 50,
                         "responses")
    assert simulator.stop() == 0
    bench.drain("gear_response")
    runs = [response_stamps(directory) for directory in bags]
    for run in runs:
        assert {late - early for early, late in pairwise(run)} == {STEP_NS}
    heard = {stamp_ns(message) for message in bench.received["gear_response"]}
    assert heard <= {stamp for run in runs for stamp in run}


def test_a_disk_that_fails_ends_the_recording_and_not_the_run(stage, bench, tmp_path):
    bag = tmp_path / "bag"
    simulator = start_run(stage, bag_directory=bag, publish_rate="1000.0")
    bench.wait_until(lambda: len(response_stamps(bag)) > 50, "a part of the bag")
    # From here on no file may grow beyond what the bag has now, and a little.
    limit = (bag / "bag_0.mcap").stat().st_size + 2000
    resource.prlimit(simulator.number, resource.RLIMIT_FSIZE, (limit, limit))
    status = bench.await_diagnostic("simulator: bag", lambda status: status.level == b"\x02",
                                    "the simulator to say that the bag is incomplete")
    assert f"{bag} is incomplete" in status.message
    count = len(bench.received["gear_response"])
    bench.wait_until(lambda: len(bench.received["gear_response"]) > count + 100, "the run to go on")
    assert simulator.stop() == 1
    assert f"{bag} is incomplete" in simulator.log()
    assert len(response_stamps(bag)) > 50
