"""``shimmy demo`` from end to end: real processes, a bag and a picture; and stopped on the way."""

from __future__ import annotations

import os
import re
import signal
import subprocess
import sys
import time
from collections import Counter

import numpy as np
import pytest
from matplotlib.image import imread
from rosbags.highlevel import AnyReader

PLAYED = {f"/shimmy/{name}" for name in (
    "taxi_velocity", "damper/linear_damping", "damper/quadratic_damping", "damper/coulomb_torque",
    "gear_response", "limit_cycle/amplitude", "limit_cycle/frequency", "limit_cycle/orbit",
    "limit_cycle/status")}
PATIENCE_S = 120.0


@pytest.fixture
def run(tmp_path):
    """A short run: standstill, then braking from 60 m/s."""
    file = tmp_path / "braking.csv"
    velocities = [0.0] * 5 + [60.0 - 0.5 * index for index in range(45)]
    lines = [f"{0.1 * index:.1f},{velocity}" for index, velocity in enumerate(velocities)]
    file.write_text("\n".join(["time_s,taxi_velocity_m_per_s", *lines]))
    return file


@pytest.fixture
def start(stage, run, tmp_path):
    """Start the demo; its output goes to a file. It is ended in any case."""
    processes = []

    def start():
        with (tmp_path / "log").open("w") as log:
            processes.append(subprocess.Popen(
                [sys.executable, "-m", "shimmy_ros.cli.main", "demo", f"--run={run}",
                 f"--out={tmp_path / 'out'}"], stdout=log, stderr=log, cwd=tmp_path,
                env=os.environ | {"ROS_DOMAIN_ID": str(stage.domain.number)}))
        return processes[-1]

    yield start
    for process in processes:
        process.kill()
        process.wait()


def assert_no_node_is_left(bench):
    bench.wait_until(lambda: not {"predictor", "simulator"} & set(bench.node.get_node_names()),
                     "the nodes to go")


def test_a_run_leaves_a_bag_and_a_picture(stage, start, run, tmp_path):
    bag, picture = tmp_path / "out" / "braking", tmp_path / "out" / "braking.png"
    bag.mkdir(parents=True)
    for name in ("metadata.yaml", "braking_0.mcap", "braking_1.mcap"):  # an earlier demo's
        (bag / name).write_text("old")
    process = start()
    assert process.wait(PATIENCE_S) == 0, (tmp_path / "log").read_text()
    assert {file.name for file in bag.iterdir()} == {"metadata.yaml", "braking_0.mcap"}
    domain_line, bag_line, picture_line, found = (tmp_path / "log").read_text().splitlines()
    assert domain_line.split()[:2] == ["domain", str(stage.domain.number)]
    assert bag_line.split(maxsplit=1) == ["bag", str(bag)]
    assert picture_line.split(maxsplit=1) == ["picture", str(picture)]
    amplitude, frequency = map(float, re.findall(r"([\d.]+) % in", found))
    assert amplitude < 3.0
    assert frequency < 3.0

    pixels = imread(picture)
    assert pixels.shape[0] > 600
    assert pixels.shape[1] > 800
    assert len(np.unique(pixels.reshape(-1, pixels.shape[2]), axis=0)) > 20

    counts = Counter()
    dampings = []
    with AnyReader([bag]) as reader:
        for connection, _, data in reader.messages():
            counts[connection.topic] += 1
            if connection.topic == "/shimmy/damper/coulomb_torque":
                dampings.append(reader.deserialize(data, connection.msgtype).data)
    assert set(counts) == PLAYED
    assert counts["/shimmy/taxi_velocity"] == len(run.read_text().splitlines()) - 1
    assert counts["/shimmy/gear_response"] > 500 * 4
    assert dampings == [20.0, 15.0]
    assert_no_node_is_left(stage.bench)


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM], ids=lambda number: number.name)
def test_a_run_that_is_stopped_leaves_what_there_is(stage, start, tmp_path, number):
    process = start()
    file = tmp_path / "out" / "braking" / "braking_0.mcap"
    stage.bench.wait_until(lambda: file.is_file() and file.stat().st_size > 20_000, "a bag")
    process.send_signal(number)
    assert process.wait(PATIENCE_S) == 130
    log = (tmp_path / "log").read_text()
    assert "Traceback" not in log
    assert (file.parent / "metadata.yaml").is_file()
    assert (tmp_path / "out" / "braking.png").is_file()
    assert_no_node_is_left(stage.bench)


@pytest.mark.parametrize("after_s", [0.2, 0.4, 0.6, 1.0, 1.5])
def test_a_run_that_is_stopped_before_it_begins_leaves_no_node(stage, start, tmp_path, after_s):
    process = start()
    time.sleep(after_s)
    process.send_signal(signal.SIGINT)
    assert process.wait(PATIENCE_S) in (130, -signal.SIGINT)
    assert_no_node_is_left(stage.bench)
