"""What the predictor answers, and to what."""

from __future__ import annotations

import json
import math
from pathlib import Path

import pytest
import yaml

from shimmy_ros.cli.main import main

CONTRACT = yaml.safe_load(
    (Path(__file__).parents[2] / "msgs_spec" / "topics.yaml").read_text(encoding="utf-8"))
ANSWERS = [topic for topic in CONTRACT["topics"] if topic["publishers"] == ["predictor"]]
REFERENCE_DAMPER = {"linear_damping": 2.0, "quadratic_damping": 10.0, "coulomb_torque": 20.0}
FLOOD_S = 1.0
FLOOD_HZ = 1000


@pytest.fixture(scope="module")
def bench(module_stage):
    """A bench with a predictor, whose answers it hears."""
    module_stage.start("predictor")
    bench = module_stage.bench
    bench.listen(*(topic["name"] for topic in ANSWERS), "/diagnostics")
    bench.join("predictor")
    return bench


@pytest.fixture(autouse=True)
def reference_damper(bench):
    """Each test begins with the reference damper."""
    names = {f"damper__{name}": value for name, value in REFERENCE_DAMPER.items()}
    assert all(success for success, _ in bench.set_parameters("predictor", **names))


def predicted(capsys, velocity, **damper):
    """What ``shimmy predict --json`` says."""
    options = [f"--{name.replace('_', '-')}={value}" for name, value in damper.items()]
    assert main(["predict", f"--velocity={velocity}", "--json", *options]) == 0
    return json.loads(capsys.readouterr().out)


@pytest.mark.parametrize("velocity", [12.0, 40.0, 65.5, 100.0])
def test_an_answer_is_that_of_the_command(bench, capsys, velocity):
    answer = bench.ask(velocity)
    expected = predicted(capsys, velocity)
    assert list(answer.amplitude.name) == CONTRACT["joints"]
    for field, key in (("position", "amplitude"), ("velocity", "peak_velocity")):
        sent = dict(zip(answer.amplitude.name, getattr(answer.amplitude, field), strict=True))
        assert sent == pytest.approx(expected[key], rel=1e-9)
    assert len(answer.amplitude.effort) == 0
    assert answer.frequency.data == pytest.approx(expected["frequency"], rel=1e-9)
    values = answer.values
    assert values["outcome"] == expected["outcome"] == "limit_cycle"
    assert values["start"] in ("warm", "cold")
    assert values["method"] == expected["method"]
    assert int(values["harmonics"]) == expected["harmonics"] >= 4
    assert int(values["work"]) >= 0
    assert int(values["further_stable_cycles"]) == len(expected["further_stable_cycles"])
    assert values["beyond_limits"] == ""
    assert values["rest"] == {True: "stable", False: "unstable", None: ""}[
        expected["rest_is_stable"]]
    assert 0.0 <= float(values["residual"]) < 1e-9
    assert float(values["solve_time"]) > 0.0
    assert float(values["taxi_velocity"]) == velocity
    for name, value in REFERENCE_DAMPER.items():
        assert float(values[name]) == value
    status = answer.status.status[0]
    assert (len(answer.status.status), status.level) == (1, b"\x00")
    assert status.name == "predictor: limit cycle"
    assert status.hardware_id


def test_the_status_has_the_keys_of_the_contract(bench):
    topic = next(topic for topic in ANSWERS if topic["name"] == "limit_cycle/status")
    keys = [key for field in topic["fields"] for key in field.get("of", ())]
    assert sorted(bench.ask(40.0).values) == sorted(keys)


def test_an_orbit_is_one_period_and_reaches_the_amplitude(bench):
    answer = bench.ask(40.0)
    points = answer.orbit.points
    assert list(answer.orbit.joint_names) == CONTRACT["joints"]
    times = [point.time_from_start.sec + 1e-9 * point.time_from_start.nanosec for point in points]
    assert times[0] == 0.0
    assert times == sorted(set(times))
    assert times[-1] == pytest.approx(1.0 / answer.frequency.data, abs=1e-9)
    for index in range(4):
        for field, peaks in (("positions", answer.amplitude.position),
                             ("velocities", answer.amplitude.velocity)):
            course = [getattr(point, field)[index] for point in points]
            assert course[-1] == pytest.approx(course[0], abs=1e-12 * peaks[index])
            highest = max(map(abs, course))
            # The peak lies between two of the samples.
            assert 0.99 * peaks[index] < highest <= peaks[index] * (1.0 + 1e-12)
    assert all(len(point.accelerations) == len(point.effort) == 0 for point in points)


def test_the_stamp_is_taken_from_the_sample(bench):
    velocity = bench.publisher("taxi_velocity").msg_type()
    velocity.header.stamp.sec, velocity.header.stamp.nanosec = 2_000_000_000, 999_999_999
    velocity.header.frame_id = "somebody's frame"
    velocity.twist.linear.x = 41.0
    velocity.twist.linear.y = velocity.twist.angular.z = math.nan  # not evaluated
    bench.publisher("taxi_velocity").publish(velocity)
    answer = bench.await_answer(lambda answer: float(answer.values["taxi_velocity"]) == 41.0,
                                "an answer to the sample")
    for message in (answer.amplitude, answer.orbit, answer.status):
        assert message.header.stamp == velocity.header.stamp


def test_a_sample_without_a_stamp_gets_the_time_of_its_receipt(bench):
    before_ns = bench.node.get_clock().now().nanoseconds
    bench.send_velocity(42.0, stamp=0)
    answer = bench.await_answer(lambda answer: answer.values["taxi_velocity"] == "42.0",
                                "an answer to the sample")
    after_ns = bench.node.get_clock().now().nanoseconds
    stamp = answer.amplitude.header.stamp
    assert before_ns <= stamp.sec * 10**9 + stamp.nanosec <= after_ns


def test_after_a_jump_back_in_time_the_answer_starts_cold(bench):
    bench.ask(40.0)
    assert bench.ask(40.5).values["start"] == "warm"
    jumps = int(solver_values(bench)["time jumps"])
    bench.send_velocity(41.0, stamp=5)
    answer = bench.await_answer(lambda answer: answer.values["taxi_velocity"] == "41.0",
                                "an answer to the sample")
    assert answer.status.header.stamp.sec == 5
    assert answer.values["start"] == "cold"
    assert int(solver_values(bench)["time jumps"]) == jumps + 1


def solver_values(bench):
    """What the predictor reports of its solver, from now on."""
    status = bench.await_diagnostic("predictor: solver", lambda status: True, "a report")
    return {item.key: item.value for item in status.values}


def test_an_answer_beyond_the_limits_is_marked_from_now_on(bench):
    def marked(answer):
        return answer.values["beyond_limits"] != ""

    asked = bench.ask(40.0)
    swivel = asked.amplitude.position[1]
    assert not marked(asked)
    try:
        assert bench.set_parameters("predictor", limits__swivel=0.1) == [(True, "")]
        answer = bench.await_answer(marked, "an answer that is marked")
        text = f"swivel {swivel:.4g} rad > 0.1 rad"
        assert answer.values["beyond_limits"] == text
        assert answer.values["outcome"] == "limit_cycle"
        assert answer.status.status[0].level == b"\x01"
        assert text in answer.status.status[0].message
        assert answer.amplitude.position[1] == pytest.approx(swivel, rel=1e-9)
        report = bench.await_diagnostic(
            "predictor: solver", lambda status: text in status.message, "a report that is marked")
        assert report.level == b"\x01"
    finally:
        assert bench.set_parameters("predictor", limits__swivel=0.5) == [(True, "")]
    bench.await_answer(lambda answer: not marked(answer), "an answer that is none such")
    bench.await_diagnostic("predictor: solver", lambda status: status.level == b"\x00",
                           "a report of an ordinary answer")


def test_no_limit_cycle_is_an_answer(bench, capsys):
    bench.send_damper("coulomb_torque", 900.0)
    bench.await_answer(lambda answer: float(answer.values["coulomb_torque"]) == 900.0,
                       "an answer to the change")
    answer = bench.ask(30.0)
    assert predicted(capsys, 30.0, coulomb_torque=900.0)["outcome"] == "no_limit_cycle"
    assert answer.values["outcome"] == "no_limit_cycle"
    assert answer.status.status[0].level == b"\x00"
    assert list(answer.amplitude.position) == list(answer.amplitude.velocity) == [0.0] * 4
    assert math.isnan(answer.frequency.data)
    assert len(answer.orbit.points) == 0
    assert list(answer.orbit.joint_names) == CONTRACT["joints"]


@pytest.mark.parametrize("velocity", [0.0, 0.999])
def test_below_the_minimum_velocity_there_is_no_answer_to_give(bench, velocity):
    answer = bench.ask(velocity)
    assert answer.values["outcome"] == "not_rolling"
    assert answer.status.status[0].level == b"\x01"
    assert "minimum" in answer.status.status[0].message
    assert all(math.isnan(value)
               for value in (*answer.amplitude.position, *answer.amplitude.velocity))
    assert math.isnan(answer.frequency.data)
    assert len(answer.orbit.points) == 0
    assert bench.ask(1.0).values["outcome"] in ("limit_cycle", "no_limit_cycle")


def test_a_change_of_the_damper_is_answered_for_the_last_velocity(bench, capsys):
    asked = bench.ask(50.0)
    changed = dict(REFERENCE_DAMPER)
    for name, value in (("quadratic_damping", 20.0), ("coulomb_torque", 15.0),
                        ("linear_damping", 3.0)):
        changed[name] = value
        bench.send_damper(name, value)
        answer = bench.await_answer(
            lambda answer, name=name, value=value: float(answer.values[name]) == value,
            f"an answer to the change of {name}")
        assert answer.status.header.stamp == asked.status.header.stamp
        expected = predicted(capsys, 50.0, **changed)
        assert answer.frequency.data == pytest.approx(expected["frequency"], rel=1e-9)
        assert answer.amplitude.position[1] == pytest.approx(
            expected["amplitude"]["swivel"], rel=1e-9)


def test_a_warm_answer_is_the_cold_one(bench, capsys):
    for velocity in (60.0, 61.0, 20.0, 95.0):
        answer = bench.ask(velocity)
        expected = predicted(capsys, velocity)
        assert answer.amplitude.position[1] == pytest.approx(
            expected["amplitude"]["swivel"], rel=1e-9)
    bench.ask(60.0)
    assert bench.ask(61.0).values["start"] == "warm"


def test_the_newest_sample_of_a_flood_is_answered(bench):
    bench.ask(30.0)
    count = int(FLOOD_S * FLOOD_HZ)
    begin = len(bench.received["limit_cycle/status"])
    first = bench.send_velocity(30.0)
    begun = bench.node.get_clock().now().nanoseconds
    for index in range(1, count):
        while bench.node.get_clock().now().nanoseconds < begun + index * 1_000_000_000 // FLOOD_HZ:
            bench.spin_for(0.0)
        last = bench.send_velocity(30.0 + 40.0 * index / count)
    bench.await_answer(lambda answer: answer.status.header.stamp.sec == last,
                       "an answer to the last sample")
    stamps = [status.header.stamp.sec
              for status in bench.received["limit_cycle/status"][begin:]]
    assert stamps == sorted(set(stamps))
    assert first <= stamps[0] <= stamps[-1] == last


def test_a_late_joiner_gets_the_last_answer(bench, module_stage):
    asked = bench.ask(44.0)
    late = type(bench)(module_stage.domain)
    try:
        late.listen(*(topic["name"] for topic in ANSWERS))
        answer = late.await_answer(lambda answer: True, "the last answer")
    finally:
        late.close()
    assert answer.amplitude == asked.amplitude
    assert answer.frequency == asked.frequency
    assert answer.orbit == asked.orbit
    assert answer.status == asked.status


@pytest.mark.parametrize("topic", [topic for topic in CONTRACT["topics"]
                                   if "predictor" in topic["publishers"]],
                         ids=lambda topic: topic["name"])
def test_the_qos_is_that_of_the_contract(bench, topic):
    name = topic["name"] if topic["name"].startswith("/") else f"/test/{topic['name']}"
    (info,) = bench.node.get_publishers_info_by_topic(name)
    offered, qos = info.qos_profile, topic["qos"]
    assert info.topic_type == topic["type"]
    assert offered.reliability.name == qos["reliability"].upper()
    assert offered.durability.name == qos["durability"].upper()
    # Depth and history are not part of what DDS tells others.


@pytest.mark.parametrize("topic", [topic for topic in CONTRACT["topics"]
                                   if "predictor" in topic["subscribers"]],
                         ids=lambda topic: topic["name"])
def test_the_inputs_ask_for_no_more_than_the_contract(bench, topic):
    (info,) = bench.node.get_subscriptions_info_by_topic(f"/test/{topic['name']}")
    assert info.topic_type == topic["type"]
    assert info.qos_profile.reliability.name == topic["qos"]["reliability"].upper()
    assert info.qos_profile.durability.name == topic["qos"]["durability"].upper()
