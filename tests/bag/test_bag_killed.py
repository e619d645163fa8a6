"""A writer that is killed loses at most its last quarter second."""

from __future__ import annotations

import signal
import subprocess
import sys

import pytest

from shimmy_ros.bag.reader import read_messages

WRITER = """
import sys, time
from shimmy_ros.bag.writer import BagWriter
from shimmy_ros.contract.messages import CODECS
from shimmy_ros.contract.records import GearResponse
from shimmy_ros.contract.spec import load_contract

bag = BagWriter(sys.argv[1])
name = bag.add_topic(load_contract().topic("gear_response"), "/shimmy")
encode = CODECS["gear_response"].encode
while True:
    now = time.time_ns()
    bag.write(name, encode(GearResponse(now, (0.1,) * 4, (0.2,) * 4, (0.3,) * 4)), now)
    print(now, flush=True)
    time.sleep(0.002)
"""


@pytest.mark.parametrize("age_ns", [260_000_000, 280_000_000, 400_000_000, 700_000_000])
def test_a_killed_writer_leaves_a_readable_bag(tmp_path, age_ns):
    child = subprocess.Popen([sys.executable, "-c", WRITER, str(tmp_path / "run")],
                             stdout=subprocess.PIPE, text=True)
    try:
        assert child.stdout is not None
        written = [int(child.stdout.readline())]
        while written[-1] < written[0] + age_ns:
            written.append(int(child.stdout.readline()))
    finally:
        child.send_signal(signal.SIGKILL)
        rest, _ = child.communicate()
    # The last line may be torn.
    written += [int(line) for line in rest.splitlines()[:-1]]
    messages = read_messages(tmp_path / "run")
    read = [message.log_time_ns for message in messages]
    due = [time_ns for time_ns in written if time_ns <= written[-1] - 250_000_000]
    assert due
    assert read[:len(due)] == due
    assert read[:len(written)] == written[:len(read)]
    assert len(messages.damage) == 1
    assert "is cut off" in messages.damage[0]
    assert not (tmp_path / "run" / "metadata.yaml").exists()
