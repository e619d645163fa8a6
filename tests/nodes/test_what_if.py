"""What-if queries to a running predictor, which goes on answering velocity samples meanwhile.

SHIMMY_WHAT_IF_QUERIES=1000 asks a thousand valid queries and ten thousand damaged ones instead of
a few; with -s the latencies of the live answers are printed:

    SHIMMY_WHAT_IF_QUERIES=1000 pytest -s tests/nodes/test_what_if.py -k random
"""

from __future__ import annotations

import importlib.util
import itertools
import json
import os
import random
import signal
import subprocess
import sys
import time
from collections import defaultdict
from contextlib import contextmanager
from pathlib import Path
from types import SimpleNamespace

import jsonschema
import numpy as np
import pytest

from shimmy_ros.cli.main import main
from shimmy_ros.cycles.prediction import Predictor
from shimmy_ros.cycles.settings import Settings
from shimmy_ros.gear.parameter_file import reference_parameters
from shimmy_ros.gear.parameters import Damper, Gear, changed, ranges
from shimmy_ros.gear.system import OperatingPoint

ROOT = Path(__file__).parents[2]
SCHEMA = jsonschema.Draft202012Validator(
    json.loads((ROOT / "msgs_spec" / "what_if_answer.schema.json").read_text("utf-8")))
PATIENCE_S = 60.0
GOOD = int(os.environ.get("SHIMMY_WHAT_IF_QUERIES", "30"))
BAD = GARBLED = 5 * GOOD
# A longer comparison where there are more queries.
ALONE_S = 1.0 if GOOD < 1000 else 30.0
LIVE_VELOCITY = 40.0
AT_A_TIME = 40
LONG = {"id": "long", "taxi_velocity": {"from": 10, "to": 100, "points": 5000},
        "return": "all_cycles"}
ANSWERS = ("limit_cycle/amplitude", "limit_cycle/frequency", "limit_cycle/orbit",
           "limit_cycle/status")


@pytest.fixture(scope="module")
def random_queries():
    path = ROOT / "tests" / "what_if" / "random_queries.py"
    spec = importlib.util.spec_from_file_location("random_queries", path)
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


class Asker:
    """Sends queries from a bench and collects the answers by id."""

    def __init__(self, bench):
        self._bench = bench
        bench.listen("what_if/answer")
        self._publisher = bench.node.create_publisher(
            importlib.import_module("std_msgs.msg").String, "what_if/query",
            bench.profile("what_if/query"))
        self._seen = 0
        self.answers = []

    def join(self, subscribers=1):
        self._bench.wait_until(
            lambda: self._publisher.get_subscription_count() == subscribers
            and self._bench.node.count_publishers("what_if/answer") == 1,
            "the predictor's what-if topics")

    def send(self, query):
        text = query if isinstance(query, str) else json.dumps(query)
        self._publisher.publish(self._publisher.msg_type(data=text))

    def collect(self):
        """Add what has come in to ``answers``."""
        received = self._bench.received["what_if/answer"]
        for message in received[self._seen:]:
            answer = json.loads(message.data)
            assert [error.message for error in SCHEMA.iter_errors(answer)] == []
            self.answers.append(answer)
        self._seen = len(received)

    def final(self, count, meanwhile=lambda: None):
        """Wait for this many more final answers and return them."""
        begin = len(self.answers)

        def found():
            meanwhile()
            self.collect()
            ends = [answer for answer in self.answers[begin:] if answer["state"] != "under_way"]
            return ends if len(ends) >= count else None

        return self._bench.wait_until(found, f"{count} answers", PATIENCE_S)

    def ask(self, query):
        """Send a query and return all parts of its answer."""
        begin = len(self.answers)
        self.send(query)
        self.final(1)
        return self.answers[begin:]


def start(stage, **parameters):
    node = stage.start("predictor", **parameters)
    bench = stage.bench
    asker = Asker(bench)
    bench.listen(*ANSWERS, "/diagnostics")
    bench.join("predictor")
    asker.join()
    return SimpleNamespace(node=node, bench=bench, asker=asker)


@pytest.fixture(scope="module")
def running(module_stage):
    """A predictor, active, with an asker."""
    return start(module_stage)


def expected(query, values):
    """What a predictor that has heard nothing before says at ``values``."""
    gear, damper = reference_parameters()
    of = {kind: {name: value for name, value in values.items() if name in ranges(kind)}
          for kind in (Gear, Damper)}
    return Predictor(Settings(harmonics=query.get("harmonics", 4))).predict(OperatingPoint(
        changed(gear, **of[Gear]), changed(damper, **of[Damper]),
        values.get("taxi_velocity", 40.0)))


def check(query, parts, random_queries):
    """That an answer is complete and equal to the predictor's own."""
    assert parts[-1]["state"] == "complete", (query, parts[-1])
    points = {point["index"]: point for part in parts for point in part["points"]}
    names = [name for name in query
             if name in ranges(Gear) or name in ranges(Damper) or name == "taxi_velocity"]
    columns = [random_queries.values(query[name]) for name in names]
    assert sorted(points) == list(range(len(list(itertools.product(*columns)))))
    for index, values in enumerate(itertools.product(*columns)):
        verdict = expected(query, dict(zip(names, values, strict=True)))
        answer = points[index]["limit_cycle"]
        assert answer["outcome"] == verdict.outcome.value, (query, values)
        cycle = verdict.orbit
        if cycle is None:
            assert answer["amplitude"] is answer["frequency"] is None
        else:
            assert list(answer["amplitude"].values()) == pytest.approx(
                cycle.amplitude.tolist(), rel=1e-7)
            assert answer["frequency"] == pytest.approx(cycle.frequency_hz, rel=1e-7)


def test_an_answer_is_that_of_the_command(running, capsys):
    query = {"id": "same", "taxi_velocity": 55.0, "coulomb_torque": 12.0, "harmonics": 6}
    (answer,) = running.asker.ask(query)
    assert main(["predict", "--velocity=55", "--coulomb-torque=12", "--harmonics=6", "--json"]) == 0
    predicted = json.loads(capsys.readouterr().out)
    ((point),) = answer["points"]
    for key in ("outcome", "amplitude", "peak_velocity", "frequency", "harmonics", "kick",
                "residual", "message"):
        assert point["limit_cycle"][key] == predicted[key]


def test_what_is_not_named_is_as_the_node_has_it(running):
    bench, asker = running.bench, running.asker
    live = bench.ask(63.0)
    (answer,) = asker.ask({"id": "now"})
    assert answer["inputs"]["taxi_velocity"] == 63.0
    (point,) = answer["points"]
    assert point["limit_cycle"]["amplitude"]["swivel"] == pytest.approx(
        live.amplitude.position[1], rel=1e-9)
    bench.send_damper("coulomb_torque", 11.0)
    assert bench.set_parameters("predictor", harmonics=2, gear__trail=0.07) == [(True, "")] * 2
    bench.await_answer(lambda live: live.values["coulomb_torque"] == "11.0"
                       and live.values["harmonics"] == "2", "the change")
    (answer,) = asker.ask({"id": "changed", "linear_damping": 3})
    inputs = answer["inputs"]
    assert (inputs["coulomb_torque"], inputs["linear_damping"]) == (11.0, 3.0)
    assert (inputs["harmonics"], inputs["trail"]) == (2, 0.07)
    # Asking changes nothing.
    assert bench.get_parameters("predictor", "damper.linear_damping") == [2.0]
    bench.send_damper("coulomb_torque", 20.0)
    assert all(success for success, _ in bench.set_parameters(
        "predictor", harmonics=4, gear__trail=0.08))
    bench.await_answer(lambda live: live.values["coulomb_torque"] == "20.0", "the change")


def test_a_long_grid_comes_in_parts_and_is_cancelled(running):
    asker = running.asker
    parts = asker.ask({"id": "grid", "taxi_velocity": {"from": 10, "to": 100, "points": 500}})
    assert len(parts) >= 5
    assert [part["done"] for part in parts] == list(
        itertools.accumulate(len(part["points"]) for part in parts))
    assert {(part["id"], part["of"]) for part in parts} == {("grid", 500)}
    begin = len(asker.answers)
    asker.send(LONG)
    asker.send({"id": "end", "cancel": "long"})
    asker.final(2)
    states = [(answer["id"], answer["state"]) for answer in asker.answers[begin:]]
    assert states == [("long", "cancelled"), ("end", "complete")]


def test_the_size_of_a_query_is_bounded_by_a_parameter(running):
    query = {"id": "size", "taxi_velocity": [30.0, 40.0, 50.0]}
    bench = running.bench
    assert bench.set_parameters("predictor", what_if_maximum_points=2) == [(True, "")]
    (answer,) = running.asker.ask(query)
    assert (answer["state"], answer["where"]) == ("refused", "taxi_velocity")
    assert not bench.set_parameters("predictor", what_if_maximum_points=0)[0][0]
    assert bench.set_parameters("predictor", what_if_maximum_points=10_000) == [(True, "")]
    assert running.asker.ask(query)[-1]["state"] == "complete"


@contextmanager
def live_samples(stage, directory, name):
    """Velocity samples at 50 Hz; gives a mapping that holds the latencies in ms afterwards."""
    out = directory / f"{name}.json"
    process = subprocess.Popen(
        [sys.executable, Path(__file__).parent / "live_latency.py", f"{stage.domain.number}",
         "/test", f"{LIVE_VELOCITY}", out], stdin=subprocess.PIPE, stdout=subprocess.PIPE)
    found = {}
    try:
        assert process.stdout.readline() == b"joined\n"
        yield found
        process.communicate(timeout=PATIENCE_S)
        found.update(json.loads(out.read_text()))
    finally:
        process.kill()
        process.wait()
    latencies = np.array(found["milliseconds"])
    print(f"\n{name}: {latencies.size} of {found['sent']} samples answered; ms to the answer:"
          + "".join(f" {label} {value:.2f}" for label, value in zip(
              ("median", "95 %", "99 %", "99.9 %", "largest"),
              np.percentile(latencies, (50.0, 95.0, 99.0, 99.9, 100.0)), strict=True)))


def test_random_queries_while_samples_are_answered(running, module_stage, random_queries, tmp_path):
    bench, asker = running.bench, running.asker
    bench.ask(LIVE_VELOCITY)
    good = {seed: random_queries.good(seed) for seed in range(GOOD)}
    bad = [random_queries.text(random_queries.bad(seed)[0], seed) for seed in range(BAD)]
    garbled = [random_queries.garbled(seed) for seed in range(GARBLED)]
    texts = [random_queries.text(query, seed) for seed, query in good.items()]
    shuffled = [*texts, *bad, *garbled]
    random.Random(0).shuffle(shuffled)
    with live_samples(module_stage, tmp_path, "without questions") as alone:
        bench.spin_for(ALONE_S)
    begin = len(asker.answers)
    with live_samples(module_stage, tmp_path, "with questions") as live:
        # No more at a time than the queues of the topics hold.
        for first in range(0, len(shuffled), AT_A_TIME):
            batch = shuffled[first:first + AT_A_TIME]
            for text in batch:
                asker.send(text)
            asker.final(len(batch))
    answers = asker.answers[begin:]
    assert sum(answer["state"] != "under_way" for answer in answers) == len(shuffled)
    of = defaultdict(list)
    for answer in answers:
        of[answer["id"]].append(answer)
    for seed, query in good.items():
        check(query, of[f"good-{seed}"], random_queries)
    refused = [answer for answer in answers if answer["state"] == "refused"]
    assert all(answer["message"] for answer in refused)
    known = [of[f"bad-{seed}"] for seed in range(BAD) if f"bad-{seed}" in of]
    assert len(known) > BAD // 2
    assert all(answer["state"] == "refused" for parts in known for answer in parts)
    assert {answer["state"] for answer in answers} <= {"under_way", "complete", "refused"}
    assert len(refused) >= BAD
    # A sample may be overtaken by a newer one, and a best-effort message lost.
    for found in (alone, live):
        assert len(found["milliseconds"]) > 0.5 * found["sent"] > 0.0


def test_a_process_that_dies_is_told_of_and_replaced(running):
    asker, bench = running.asker, running.bench
    assert asker.ask({"id": "first"})[-1]["state"] == "complete"
    asker.send({**LONG, "id": "lost"})
    bench.spin_for(0.2)
    (worker,) = children(running.node)
    os.kill(worker, signal.SIGKILL)
    (answer,) = asker.final(1)
    assert (answer["id"], answer["state"]) == ("lost", "failed")
    assert asker.ask({"id": "next"})[-1]["state"] == "complete"
    status = bench.await_diagnostic("predictor: what if", lambda status: status.level == b"\x01",
                                    "the loss in the diagnostics")
    assert {item.key: item.value for item in status.values}["processes lost"] == "1"


def children(node):
    """The process ids of the children of a node's process."""
    return [int(child) for task in Path(f"/proc/{node._process.pid}/task").iterdir()
            for child in (task / "children").read_text().split()]


def test_before_the_first_sample_a_query_names_the_velocity(stage):
    fresh = start(stage)
    (answer,) = fresh.asker.ask({"id": "early"})
    assert (answer["state"], answer["where"]) == ("refused", "taxi_velocity")
    (answer,) = fresh.asker.ask({"id": "named", "taxi_velocity": 30})
    assert answer["state"] == "complete"


def test_a_node_that_is_not_active_says_so_and_one_that_ends_leaves_nothing(stage):
    node = start(stage)
    bench, asker = node.bench, node.asker
    assert asker.ask({"id": "a", "taxi_velocity": 30})[-1]["state"] == "complete"
    assert bench.change_state("predictor", "deactivate")
    (answer,) = asker.ask({"id": "b", "taxi_velocity": 30})
    assert (answer["id"], answer["state"]) == ("b", "refused")
    assert "not active" in answer["message"]
    assert bench.change_state("predictor", "activate")
    assert asker.ask({"id": "c", "taxi_velocity": 30})[-1]["state"] == "complete"
    assert bench.change_state("predictor", "deactivate")
    assert bench.change_state("predictor", "cleanup")
    assert children(node.node) == []
    assert bench.change_state("predictor", "configure")
    assert bench.change_state("predictor", "activate")
    asker.join()
    asker.send(LONG)
    bench.wait_until(lambda: children(node.node), "a worker")
    (worker,) = children(node.node)
    begun = time.monotonic()
    assert node.node.stop() == 0, node.node.log()
    assert time.monotonic() - begun < 2.0
    end = time.monotonic() + PATIENCE_S
    while Path(f"/proc/{worker}").exists() and time.monotonic() < end:
        time.sleep(0.05)
    assert not Path(f"/proc/{worker}").exists()


def test_bytes_that_are_no_text_are_refused(running):
    asker = running.asker
    begin = len(asker.answers)
    for data in (b"\x00\x01\x00\x00\x03\x00\x00\x00\xff\xfe\x00", b"\x00\x01\x00\x00\xff\x00\x00"):
        asker._publisher.publish(data)
    answers = asker.final(2)
    assert len(asker.answers) == begin + 2
    assert {answer["state"] for answer in answers} == {"refused"}
    assert all("no std_msgs/msg/String" in answer["message"] for answer in answers)


def test_shimmy_ask_asks_a_running_node(running, module_stage, monkeypatch, capsys):
    monkeypatch.setenv("ROS_DOMAIN_ID", str(module_stage.domain.number))
    running.bench.ask(47.0)
    query = "{coulomb_torque: [10, 20]}"
    assert main(["ask", query, "--node", "/test", "--json"]) == 0
    answer = json.loads(capsys.readouterr().out)
    assert (answer["inputs"]["taxi_velocity"], answer["state"]) == (47.0, "complete")
    for point, torque in zip(answer["points"], (10.0, 20.0), strict=True):
        verdict = expected({}, {"taxi_velocity": 47.0, "coulomb_torque": torque})
        assert point["limit_cycle"]["amplitude"]["swivel"] == pytest.approx(
            verdict.orbit.amplitude[1], rel=1e-9)
    for query in ("{taxi_velocity: 300}", "{taxi_velocity: [", "{id: 3}"):
        assert main(["ask", query, "--node", "/test"]) == 2
        assert "the query is refused" in capsys.readouterr().err


def test_shimmy_ask_says_where_nobody_answers(module_stage, monkeypatch, capsys):
    monkeypatch.setenv("ROS_DOMAIN_ID", str(module_stage.domain.number))
    monkeypatch.setattr("shimmy_ros.nodes.asking._JOIN_TIMEOUT_S", 1.0)
    assert main(["ask", "{taxi_velocity: 40}", "--node", "/nowhere"]) == 1
    assert "no predictor listens to /nowhere/what_if/query" in capsys.readouterr().err


def test_shimmy_ask_cancels_when_it_is_interrupted(running, module_stage):
    environment = os.environ | {"ROS_DOMAIN_ID": str(module_stage.domain.number)}
    command = subprocess.Popen(
        [sys.executable, "-m", "shimmy_ros.cli.main", "ask",
         json.dumps(LONG | {"id": "asked"}), "--node", "/test"],
        env=environment, stdout=subprocess.DEVNULL)
    asker, bench = running.asker, running.bench
    begin = len(asker.answers)

    def states():
        asker.collect()
        return [answer["state"] for answer in asker.answers[begin:] if answer["id"] == "asked"]

    try:
        bench.wait_until(states, "a part of the answer", PATIENCE_S)
        command.send_signal(signal.SIGINT)
        assert command.wait(PATIENCE_S) == 130
    finally:
        command.kill()
        command.wait()
    bench.wait_until(lambda: states()[-1] != "under_way", "the end of its answer", PATIENCE_S)
    assert states()[-1] == "cancelled"


def test_the_conversation_is_in_the_simulators_bag(stage, tmp_path):
    from shimmy_ros.bag.reader import read_messages
    from shimmy_ros.contract.messages import CODECS

    bag = tmp_path / "bag"
    stage.start("simulator", bag_directory=f'"{bag}"')
    fresh = SimpleNamespace(node=stage.start("predictor"), bench=stage.bench,
                            asker=Asker(stage.bench))
    fresh.bench.join("predictor", "simulator")
    fresh.asker.join(subscribers=2)
    query = {"id": "kept", "taxi_velocity": 30}
    parts = fresh.asker.ask(query)
    fresh.bench.spin_for(1.0)
    for node in stage._nodes:
        assert node.stop() == 0, node.log()
    texts = {topic: [CODECS[topic].decode(message.data)
                     for message in read_messages(bag, (f"/test/{topic}",))]
             for topic in ("what_if/query", "what_if/answer")}
    assert [json.loads(text) for text in texts["what_if/query"]] == [query]
    assert [json.loads(text) for text in texts["what_if/answer"]] == parts
