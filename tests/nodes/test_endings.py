"""SIGINT and SIGTERM end both nodes with status 0, whenever they come."""

from __future__ import annotations

import signal
import time
from pathlib import Path

import pytest

from shimmy_ros.bag.reader import read_messages

PARTIES = ("predictor", "simulator")
SIGNALS = (signal.SIGINT, signal.SIGTERM)


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


def test_a_signal_during_a_solve(stage):
    predictor = stage.start("predictor", harmonics="64")
    bench = stage.bench
    bench.join("predictor")
    for velocity in (20.0, 90.0, 15.0):
        bench.send_velocity(velocity)
        bench.spin_for(0.02)
    assert predictor.stop(signal.SIGTERM) == 0, predictor.log()
