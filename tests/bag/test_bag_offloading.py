"""A bag from a process of its own is the bag that BagWriter writes."""

from __future__ import annotations

import os
import resource
import subprocess
import sys
import time

import pytest

from shimmy_ros.bag import offloading
from shimmy_ros.bag.errors import BagError
from shimmy_ros.bag.message import Channel
from shimmy_ros.bag.offloading import OffloadedWriter
from shimmy_ros.bag.output import new_bag, new_place
from shimmy_ros.bag.reader import read_messages
from shimmy_ros.bag.writer import BagWriter
from shimmy_ros.contract.encoding import encode_number
from shimmy_ros.contract.records import MessageError
from shimmy_ros.contract.spec import load_contract

CHUNK = 10_000
FOREIGN = Channel("/foreign", "other_msgs/msg/Thing", "cdr", b"float64 x\n", "ros2msg")


@pytest.fixture(params=["at once", "never"])
def process(request, monkeypatch):
    """Whether a process is started for the bag."""
    monkeypatch.setattr(offloading, "_OFFLOADED_BYTES", 0 if request.param == "at once" else 10**9)
    monkeypatch.setattr(offloading, "_BATCH_BYTES", 3000)
    return request.param == "at once"


def fill(bag, count=500):
    name = bag.add_topic(load_contract().topic("limit_cycle/frequency"), "/shimmy")
    for index in range(count):
        bag.write(name, b"\0\1\0\0" + bytes([index % 256]) * 8, 1000 + index)
        if index % 3 == 0:
            bag.write(bag.add_channel(FOREIGN), b"\0\1\0\0" + b"x" * index, 2000 + index, 7, index)
    bag.add_metadata("what", {"a": "b"})


def files(directory):
    return {file.name: file.read_bytes() for file in directory.iterdir()}


def test_the_bag_is_the_same_to_the_byte(process, tmp_path):
    with BagWriter(tmp_path / "a" / "run", {"x": "1"}, chunk_seconds=None,
                   chunk_bytes=CHUNK) as bag:
        fill(bag)
    bag = OffloadedWriter(tmp_path / "b" / "run", {"x": "1"}, CHUNK)
    fill(bag)
    assert (bag._process is not None) == process
    bag.close()
    assert files(tmp_path / "a" / "run") == files(tmp_path / "b" / "run")
    assert len(list(read_messages(tmp_path / "b" / "run"))) == 667


def test_messages_may_be_made_where_the_bag_is_written(process, tmp_path):
    topic = load_contract().topic("limit_cycle/frequency")
    data = [b"\0\1\0\0" + bytes([index]) * 8 for index in range(200)]
    with BagWriter(tmp_path / "a" / "run", chunk_seconds=None, chunk_bytes=CHUNK) as plain:
        name = plain.add_topic(topic, "/shimmy")
        for index in range(100):
            for item in data[2 * index:2 * index + 2]:
                plain.write(name, item, 1000 + index)
    with new_place(tmp_path / "b" / "run") as place:
        bag = OffloadedWriter(place, None, CHUNK)
        name = bag.add_topic(topic, "/shimmy")
        for index in range(100):
            # zip() makes pairs of a name and data.
            bag.write_made(zip, ((name, name), data[2 * index:2 * index + 2]), 1000 + index)
        assert (bag._process is not None) == process
        bag.close()
    assert files(tmp_path / "a" / "run") == files(tmp_path / "b" / "run")


def test_what_cannot_be_made_drops_the_bag(process, tmp_path):
    def write_no_number():
        with new_bag(tmp_path / "run") as bag:
            bag.write_made(encode_number, ("x",), 1000)

    with pytest.raises(MessageError, match="'x' cannot be sent as a number"):
        write_no_number()
    assert os.listdir(tmp_path) == []


def test_what_bagwriter_refuses_is_refused(process, tmp_path):
    def write_too_early():
        with new_bag(tmp_path / "run") as bag:
            name = bag.add_topic(load_contract().topic("limit_cycle/frequency"), "/shimmy")
            bag.write(name, b"", -1)

    with pytest.raises(BagError, match="log time of a message on /shimmy/limit_cycle/frequency"):
        write_too_early()
    assert os.listdir(tmp_path) == []


def test_an_error_drops_the_bag_and_ends_the_process(process, tmp_path):
    seen = []

    def fail_half_way():
        with new_bag(tmp_path / "run") as bag:
            fill(bag)
            seen.append(bag._process)
            raise ZeroDivisionError

    with pytest.raises(ZeroDivisionError):
        fail_half_way()
    assert os.listdir(tmp_path) == []
    assert (seen[0] is not None) == process
    assert seen[0] is None or seen[0].poll() is not None


def test_a_process_that_dies_is_reported(monkeypatch, tmp_path):
    monkeypatch.setattr(offloading, "_OFFLOADED_BYTES", 0)
    bag = OffloadedWriter(tmp_path / "run", None, CHUNK)
    fill(bag, 3)
    bag._process.kill()
    bag._process.wait()
    with pytest.raises(OSError, match="the process that wrote the bag ended with status -9"):
        bag.close()
    bag.abandon()


def test_without_its_owner_the_process_ends(monkeypatch, tmp_path):
    monkeypatch.setattr(offloading, "_OFFLOADED_BYTES", 0)
    bag = OffloadedWriter(tmp_path / "run", None, CHUNK)
    fill(bag, 3)
    process = bag._process
    process.communicate()
    assert process.returncode == 1
    assert not (tmp_path / "run" / "metadata.yaml").exists()


LIMITED = """
import sys
from pathlib import Path
from shimmy_ros.bag import offloading, output
from shimmy_ros.contract.encoding import encode_number
from shimmy_ros.contract.records import MessageError
from shimmy_ros.contract.spec import load_contract

offloading._OFFLOADED_BYTES = 0
try:
    with output.new_bag(Path(sys.argv[1])) as bag:
        name = bag.add_topic(load_contract().topic("limit_cycle/frequency"), "/shimmy")
        for index in range(3000):
            bag.write(name, bytes(index % 256 * k % 251 for k in range(2000)), index)
except OSError as error:
    print(error.strerror)
"""


def test_a_full_disk_is_reported_and_leaves_nothing(tmp_path):
    limit = 20_000

    def limited():
        resource.setrlimit(resource.RLIMIT_FSIZE, (limit, limit))

    printed = subprocess.run(
        [sys.executable, "-c", LIMITED, str(tmp_path / "run")], check=True, text=True,
        stdout=subprocess.PIPE, preexec_fn=limited,
        env=os.environ | {"PYTHONPATH": os.pathsep.join(sys.path)}).stdout
    assert printed == "File too large\n"
    deadline = time.monotonic() + 10.0
    while os.listdir(tmp_path):
        assert time.monotonic() < deadline
