"""A live node and a replay of what it heard give the same numbers, to the last bit."""

from __future__ import annotations

import math
import time
from pathlib import Path

import pytest

from shimmy_ros.bag.reader import read_messages
from shimmy_ros.bag.writer import BagWriter
from shimmy_ros.cli.main import main
from shimmy_ros.contract.messages import CODECS
from shimmy_ros.contract.records import TaxiVelocity
from shimmy_ros.contract.spec import load_contract

ANSWERS = ("limit_cycle/amplitude", "limit_cycle/frequency", "limit_cycle/orbit",
           "limit_cycle/status")
SECOND = 10**9
RESEND_S = 2.0


def play(bench):
    """Send a run, each message when the one before was answered."""
    def ask(velocity, stamp):
        sent_at = -math.inf

        def answered():
            nonlocal sent_at
            if time.monotonic() > sent_at + RESEND_S:  # a best-effort sample may be lost
                bench.send_velocity(velocity, stamp)
                sent_at = time.monotonic()
            answer = bench.answer(stamp)
            return answer is not None and float(answer.values["taxi_velocity"]) == velocity

        bench.wait_until(answered, f"an answer to {velocity} m/s")

    def change(name, value):
        bench.send_damper(name, value)
        bench.await_answer(lambda answer: float(answer.values[name]) == value,
                           f"an answer to {name}")

    for stamp, velocity in enumerate((70.0, 69.3, 68.1, 40.0, 40.5, 0.4, 12.5, 95.0), 1000):
        ask(velocity, stamp)
    change("quadratic_damping", 20.0)
    change("coulomb_torque", 15.0)
    ask(94.0, 1010)
    bench.send_velocity(math.nan)
    bench.send_velocity(-3.0)
    ask(93.1, 1020)
    change("coulomb_torque", 900.0)
    ask(92.0, 1030)
    change("coulomb_torque", 10.0)
    for stamp, velocity in ((1040, 60.0), (500, 59.0), (501, 58.0), (90_000, 56.0)):
        ask(velocity, stamp)


def heard(bench):
    """What the node heard and answered, from its statuses: topic, stamp [s], value."""
    settings = {"linear_damping": 2.0, "quadratic_damping": 10.0, "coulomb_torque": 20.0}
    messages = []
    for array in bench.received["limit_cycle/status"]:
        values = {item.key: item.value for item in array.status[0].values}
        stamp = array.header.stamp.sec
        changed = [name for name, value in settings.items() if float(values[name]) != value]
        for name in changed:
            settings[name] = float(values[name])
            messages.append((f"damper/{name}", stamp, settings[name]))
        if not changed:
            messages.append(("taxi_velocity", stamp, float(values["taxi_velocity"])))
    return messages


def record(messages, directory):
    """The bag of ``messages``, one a tenth of a second."""
    with BagWriter(directory) as bag:
        names = {name: bag.add_topic(load_contract().topic(name), "/test")
                 for name in dict.fromkeys(name for name, *_ in messages)}
        for number, (name, stamp, value) in enumerate(messages):
            content = TaxiVelocity(stamp * SECOND, value) if name == "taxi_velocity" else value
            bag.write(names[name], CODECS[name].encode(content), (1000 + number) * SECOND // 10)


def numbers(name, message):
    """What an rclpy message says, as CODECS would decode it."""
    if name == "limit_cycle/frequency":
        return message.data
    stamp = message.header.stamp.sec * SECOND + message.header.stamp.nanosec
    if name == "limit_cycle/amplitude":
        return stamp, message.position.tolist(), message.velocity.tolist()
    if name == "limit_cycle/orbit":
        return stamp, [(point.time_from_start.sec * SECOND + point.time_from_start.nanosec,
                        point.positions.tolist(), point.velocities.tolist())
                       for point in message.points]
    (status,) = message.status
    return (stamp, status.name, status.hardware_id, status.level[0], status.message,
            [(item.key, item.value) for item in status.values if item.key != "solve_time"])


def recorded_numbers(name, data):
    """The same of a message in a bag."""
    content = CODECS[name].decode(data)
    if name == "limit_cycle/frequency":
        return content
    if name == "limit_cycle/amplitude":
        return content.stamp_ns, list(content.position), list(content.velocity)
    if name == "limit_cycle/orbit":
        return content.stamp_ns, list(zip(
            content.times_ns.tolist(), content.positions.tolist(), content.velocities.tolist(),
            strict=True))
    (status,) = content
    return (status.stamp_ns, status.name, status.hardware_id, int(status.level), status.message,
            [(key, value) for key, value in status.values.items() if key != "solve_time"])


REFERENCE = Path(__file__).parents[2] / "config" / "reference_gear.yaml"
LIMITS = "{predictor: {ros__parameters: {limits: {swivel: 0.1}}}}"


@pytest.mark.parametrize(("parameters", "options"), [
    ({"use_sim_time": "false"}, []),
    ({"use_sim_time": "true"}, []),
    ({"accuracy": 0.001, "budget": 2.0, "limits__swivel": 0.1},
     ["--accuracy=0.001", "--budget=2", f"--gear={REFERENCE}", "--gear=limits.yaml"])],
    ids=["system's time", "simulated time", "other settings"])
def test_a_replay_is_the_live_node_to_the_last_bit(
        stage, tmp_path, monkeypatch, parameters, options):
    monkeypatch.chdir(tmp_path)
    Path("limits.yaml").write_text(LIMITS)
    bench = stage.bench
    stage.start("predictor", **parameters)
    bench.listen(*ANSWERS)
    bench.join("predictor")
    play(bench)
    messages = heard(bench)
    assert len(messages) >= 19
    record(messages, tmp_path / "heard")
    assert main(["replay", str(tmp_path / "heard"), "-o", str(tmp_path / "out"),
                 *options]) == 0
    for name in ANSWERS:
        live = [numbers(name, message) for message in bench.received[name]]
        replayed = [recorded_numbers(name, message.data) for message in
                    read_messages(tmp_path / "out", {f"/test/{name}"})]
        assert len(live) == len(messages)
        # repr tells every bit of a float, and NaN is NaN.
        assert list(map(repr, live)) == list(map(repr, replayed)), name
    outcomes = {dict(numbers("limit_cycle/status", message)[-1])["outcome"]
                for message in bench.received["limit_cycle/status"]}
    assert outcomes == {"limit_cycle", "no_limit_cycle", "not_rolling"}
    marked = [dict(numbers("limit_cycle/status", message)[-1])["beyond_limits"]
              for message in bench.received["limit_cycle/status"]]
    assert any(marked) == bool(options)


def test_time_that_jumps_back_drops_the_warm_start_and_is_reported_once(stage):
    bench = stage.bench
    node = stage.start("predictor")
    bench.listen(*ANSWERS, "/diagnostics")
    bench.join("predictor")
    bench.ask(40.0)
    starts = []
    for stamp in (2000, 2001, 40, 41, 2002, 90_000):
        bench.send_velocity(40.0 + stamp % 7, stamp)
        answer = bench.await_answer(
            lambda answer, stamp=stamp: answer.status.header.stamp.sec == stamp, "an answer")
        starts.append(answer.values["start"])
    assert starts == ["warm", "warm", "cold", "warm", "warm", "warm"]
    assert node.log().count("jumped back") == 1
    assert "time jumped back by 1961 s; the next answer starts cold" in node.log()
    bench.await_diagnostic(
        "predictor: solver",
        lambda status: {item.key: item.value for item in status.values}["time jumps"] == "1",
        "the jump to be counted")


def test_a_stamp_of_zero_is_the_time_of_receipt(stage):
    bench = stage.bench
    node = stage.start("predictor", use_sim_time="true")
    bench.listen(*ANSWERS)
    bench.join("predictor")
    clock = bench.create_clock_publisher()
    bench.wait_until(clock.get_subscription_count, "the node to hear the clock")
    message = clock.msg_type()
    message.clock.sec = 700

    def answered():
        clock.publish(message)
        bench.send_velocity(44.0, 0)
        bench.spin_for(0.05)
        return any(status.header.stamp.sec == 700
                   for status in bench.received["limit_cycle/status"])

    bench.wait_until(answered, "an answer that has the clock's time")
    assert node.log().count("has a stamp of zero") == 1
    assert "jumped back" not in node.log()
