"""SIGINT and SIGTERM end both nodes with status 0, whenever they come."""

from __future__ import annotations

import signal
import time
from pathlib import Path

import pytest

from shimmy_ros.bag.reader import read_messages

PARTIES = ("predictor", "simulator")
SIGNALS = (signal.SIGINT, signal.SIGTERM)
# From a signal to the end of a node.
LONGEST_S = 2.0


def wait_until_caught(node):
    """Wait until the process has its own handlers of both signals, which is before its imports."""
    end = time.monotonic() + 60.0
    while time.monotonic() < end:
        status = Path(f"/proc/{node.number}/status").read_text()
        caught = int(status.split("SigCgt:")[1].split()[0], 16)
        # Python itself catches SIGINT from the start, and SIGTERM never.
        if caught >> (signal.SIGTERM - 1) & 1:
            return
        time.sleep(0.001)
    pytest.fail("the node does not catch SIGTERM")


@pytest.mark.skipif(not Path("/proc/self/status").is_file(), reason="needs Linux's /proc")
def test_a_signal_at_any_moment_of_the_start(stage):
    delays_s = iter((0.0, 0.3, 0.3, 0.3, 0.3, 0.3))
    started = [(stage.start(party, **settings), number)
               for party, settings in (("predictor", {}), ("simulator", {"record": "false"}))
               for number in (*SIGNALS, signal.SIGTERM)]
    for node, number in started:
        wait_until_caught(node)
        time.sleep(next(delays_s))
        node.send_signal(number)
    for node, _ in started:
        assert node.wait() == 0, node.log()
        assert "Traceback" not in node.log()


def test_more_signals_change_nothing(stage, tmp_path):
    nodes = {"predictor": stage.start("predictor"), "simulator": stage.start("simulator")}
    bench = stage.bench
    bench.listen("gear_response")
    bench.join(*PARTIES)
    bench.wait_until(lambda: bench.received["gear_response"], "a run")
    for number in SIGNALS * 10:
        for node in nodes.values():
            if not node.ended:
                node.send_signal(number)
        time.sleep(0.01)
    for node in nodes.values():
        assert node.wait() == 0, node.log()
    # The bag is named by the time, and closed.
    (metadata,) = tmp_path.glob("shimmy_2*/metadata.yaml")
    recorded = read_messages(metadata.parent, ["/test/gear_response"])
    assert len(list(recorded)) > 0
    assert not recorded.damage


@pytest.mark.parametrize("number", SIGNALS)
@pytest.mark.parametrize("busy_in", ["python", "compiled"])
def test_a_computation_that_does_not_end_keeps_no_node(stage, busy_in, number):
    node = stage.start("busy", busy_in=busy_in)
    bench = stage.bench
    bench.join("predictor")

    def busy():
        bench.send_velocity(40.0)
        return "busy" in node.log()

    bench.wait_until(busy, "the node to be busy")
    time.sleep(0.3)
    begun = time.monotonic()
    assert node.stop(number) == 0, node.log()
    assert time.monotonic() - begun < LONGEST_S
    assert "a computation did not end" in node.log()


def test_a_gear_that_is_hard_to_solve_keeps_no_node(stage):
    # Its modes are a million times slower than the time in which the wheel turns.
    node = stage.start("predictor", gear__swivel_inertia=1e6, gear__trail=0.0, budget=1000.0,
                       gear__tyre_lateral_stiffness="0.000001")
    bench = stage.bench
    bench.join("predictor")
    bench.send_velocity(40.0)
    bench.spin_for(1.0)
    begun = time.monotonic()
    assert node.stop(signal.SIGTERM) == 0, node.log()
    assert time.monotonic() - begun < LONGEST_S


def test_a_bag_that_takes_long_to_close_is_not_cut(stage, tmp_path):
    node = stage.start("slow")
    bench = stage.bench
    bench.listen("gear_response")
    bench.join("simulator")
    bench.wait_until(lambda: len(bench.received["gear_response"]) > 100, "a run")
    begun = time.monotonic()
    assert node.stop(signal.SIGTERM) == 0, node.log()
    assert time.monotonic() - begun > 3.0
    (metadata,) = tmp_path.glob("shimmy_2*/metadata.yaml")
    recorded = read_messages(metadata.parent, ["/test/gear_response"])
    assert len(list(recorded)) > 100
    assert not recorded.damage


@pytest.mark.parametrize("number", SIGNALS)
def test_idle_nodes_end_at_once_and_of_themselves(stage, number):
    nodes = [stage.start("predictor"), stage.start("simulator")]
    stage.bench.join(*PARTIES)
    for node in nodes:
        begun = time.monotonic()
        assert node.stop(number) == 0, node.log()
        assert time.monotonic() - begun < LONGEST_S
        assert "did not end" not in node.log()


def test_a_signal_during_a_solve(stage):
    predictor = stage.start("predictor", harmonics="64")
    bench = stage.bench
    bench.join("predictor")
    for velocity in (20.0, 90.0, 15.0):
        bench.send_velocity(velocity)
        bench.spin_for(0.02)
    assert predictor.stop(signal.SIGTERM) == 0, predictor.log()
