"""Bad input changes nothing, is named in the log and in /diagnostics, and the nodes go on."""

from __future__ import annotations

import math
import re
import statistics
from itertools import pairwise

import pytest

PARTIES = ("predictor", "simulator")
SETTINGS = {"linear_damping": 2.0, "quadratic_damping": 10.0, "coulomb_torque": 20.0}
UNITS = {"linear_damping": "N m s/rad", "quadratic_damping": "N m s^2/rad^2",
         "coulomb_torque": "N m"}
BAD = {"nan": math.nan, "inf": math.inf, "-inf": -math.inf, "-3": -3.0, "1e+09": 1e9}


def test_bad_values_change_nothing_and_are_named(both, values):
    bench = both.bench
    asked = bench.ask(40.0)
    for name, value in SETTINGS.items():
        bench.send_damper(name, value)
    before = bench.await_diagnostics(
        {f"{party}: inputs": lambda status: status.level == b"\x00"
         and values(status)["taxi_velocity"] == "40.0" for party in PARTIES},
        "both nodes to be contented", lambda: bench.send_velocity(40.0))
    bench.ask(40.0)
    answers = len(bench.received["limit_cycle/status"])
    for rounds, (text, value) in enumerate(BAD.items(), start=1):
        for name in SETTINGS:
            bench.send_damper(name, value)
        number = re.escape(text)
        patterns = [rf"taxi_velocity is {number}, but .*\[0, 200\] m/s"]
        patterns += [rf"damper/{name}: .*{name} is {number}, but .*\[0, 1e\+06\] {re.escape(unit)}"
                     for name, unit in UNITS.items()]
        found = bench.await_diagnostics(
            {f"{party}: inputs": lambda status, patterns=patterns: all(
                re.search(pattern, status.message) for pattern in patterns) for party in PARTIES},
            f"both nodes to name {text}", lambda value=value: bench.send_velocity(value))
        for part, status in found.items():
            assert status.level == b"\x01"
            now, then = values(status), values(before[part])
            for name in ("taxi_velocity", *SETTINGS):
                assert now[name] == then[name]
            for name in SETTINGS:
                assert int(now[f"damper/{name} refused"]) == rounds
            assert int(now["taxi_velocity refused"]) >= rounds
    for node in both.nodes.values():
        for topic in ("taxi_velocity", *(f"damper/{name}" for name in SETTINGS)):
            assert f"refused a message on {topic}: " in node.log()
    assert len(bench.received["limit_cycle/status"]) == answers
    again = bench.ask(40.0)
    assert again.frequency.data == pytest.approx(asked.frequency.data, rel=1e-9)
    responses = len(bench.received["gear_response"])
    bench.wait_until(lambda: len(bench.received["gear_response"]) > responses,
                     "the simulator to go on")


def test_one_bad_value_among_good_ones_is_named(both, values):
    bench = both.bench
    reports = len(bench.received["/diagnostics"])
    for value in (19.0, -7.0, 19.5):
        bench.send_damper("coulomb_torque", value)

    def named():
        return {status.name for report in bench.received["/diagnostics"][reports:]
                for status in report.status if "coulomb_torque is -7," in status.message}

    bench.wait_until(lambda: named() == {f"{party}: inputs" for party in PARTIES},
                     "both nodes to name the bad value")
    found = bench.await_diagnostics(
        {f"{party}: inputs": lambda status: "coulomb_torque is" not in status.message
         for party in PARTIES}, "both nodes to be contented again")
    assert {values(status)["coulomb_torque"] for status in found.values()} == {"19.5"}


def test_a_stamp_that_is_none_is_refused(both):
    bench = both.bench
    bench.ask(40.0)
    sample = bench.publisher("taxi_velocity").msg_type()
    sample.header.stamp.nanosec = 2_000_000_000
    sample.twist.linear.x = 50.0
    answers = len(bench.received["limit_cycle/status"])
    found = bench.await_diagnostics(
        {f"{party}: inputs": lambda status: "nanosec" in status.message for party in PARTIES},
        "both nodes to name the stamp", lambda: bench.publisher("taxi_velocity").publish(sample))
    for status in found.values():
        assert "nanosec of a stamp is 2000000000" in status.message
        assert status.level == b"\x01"
    assert len(bench.received["limit_cycle/status"]) == answers


def test_a_flood_of_bad_samples_does_not_flood_the_log(both):
    bench = both.bench
    before = {party: node.log().count("refused a message") for party, node in both.nodes.items()}
    reports = len(bench.received["/diagnostics"])
    bench.wait_until(lambda: bench.send_velocity(-8.0)
                     and len(bench.received["/diagnostics"]) >= reports + 4, "a few reports")
    for party, node in both.nodes.items():
        assert node.log().count("refused a message") - before[party] <= 4


def test_the_health_is_reported_once_a_second(both):
    bench = both.bench
    begin = len(bench.received["/diagnostics"])
    bench.wait_until(lambda: len(bench.received["/diagnostics"]) >= begin + 8, "eight reports")
    reports = {party: [report for report in bench.received["/diagnostics"][begin:]
                      if report.status[0].name.startswith(party)] for party in PARTIES}
    for party, own in reports.items():
        stamps = [report.header.stamp.sec + 1e-9 * report.header.stamp.nanosec for report in own]
        periods = [late - early for early, late in pairwise(stamps)]
        assert statistics.median(periods) == pytest.approx(1.0, abs=0.3)
        for status in (status for report in own for status in report.status):
            assert re.fullmatch(rf"{party}: [a-z ]+", status.name)
            assert status.hardware_id
            assert status.message
            assert status.level in (b"\x00", b"\x01", b"\x02", b"\x03")
    names = {party: {status.name for report in own for status in report.status}
             for party, own in reports.items()}
    assert names["predictor"] >= {"predictor: inputs", "predictor: solver"}
    assert names["simulator"] >= {"simulator: inputs", "simulator: motion", "simulator: bag"}


def test_silence_is_reported_beside_the_last_refusal(both):
    bench = both.bench
    bench.ask(40.0)
    bench.send_velocity(-9.0)
    found = bench.await_diagnostics(
        {f"{party}: inputs": lambda status: status.level == b"\x03" for party in PARTIES},
        "both nodes to miss their input")
    for status in found.values():
        assert "refused taxi_velocity: taxi_velocity is -9" in status.message
        assert "no taxi velocity for" in status.message


def test_a_publisher_that_cannot_be_heard_is_named(both):
    bench = both.bench
    profile = bench.profile("taxi_velocity")  # best effort, where reliable is asked for
    publisher = bench.node.create_publisher(
        bench.publisher("damper/coulomb_torque").msg_type, "damper/coulomb_torque", profile)
    for node in both.nodes.values():
        bench.wait_until(lambda node=node: "incompatible QoS" in node.log(),
                         "a warning of the incompatible QoS")
        assert "damper/coulomb_torque" in node.log().split("incompatible QoS")[0].splitlines()[-1]
    bench.node.destroy_publisher(publisher)
