"""``shimmy salvage``: a whole bag from what can still be read."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest
import yaml
from mcap.reader import make_reader
from mcap.writer import CompressionType, Writer
from rosbags.highlevel import AnyReader
from rosbags.rosbag2 import Reader

from shimmy_ros.bag.reader import read_messages
from shimmy_ros.bag.writer import BagWriter
from shimmy_ros.cli.main import main
from shimmy_ros.contract.messages import CODECS
from shimmy_ros.contract.spec import load_contract


@pytest.fixture
def salvage(tmp_path, monkeypatch, capsys):
    """Runs the command in an empty directory: exit status, stdout, stderr."""
    monkeypatch.chdir(tmp_path)

    def run(*arguments):
        status = main(["salvage", *map(str, arguments)])
        return status, *capsys.readouterr()

    return run


def plain(messages):
    return [(message.topic, message.type, message.log_time_ns, message.publish_time_ns,
             message.sequence, message.data) for message in messages]


def write_foreign(path, count=300, compression=CompressionType.ZSTD):
    """An MCAP file of types that nobody here knows, one of them without a schema, in JSON too."""
    definition = b"other_msgs/Part[] parts\nstring name\n" + b"=" * 80 + (
        b"\nMSG: other_msgs/Part\nuint8[16] bytes\n")
    qos = yaml.safe_dump([{"history": "keep_last", "depth": 3, "reliability": "reliable"}])
    with path.open("wb") as stream:
        writer = Writer(stream, chunk_size=2000, compression=compression)
        writer.start(profile="ros2")
        writer.add_metadata("settings", {"of": "the run"})
        schema = writer.register_schema("other_msgs/msg/Whole", "ros2msg", definition)
        channels = [
            writer.register_channel("/foreign", "cdr", schema, {
                "offered_qos_profiles": qos, "topic_type_hash": "RIHS01_" + 64 * "a"}),
            writer.register_channel("/json", "json", 0, {}),
        ]
        for index in range(count):
            writer.add_message(channels[index % 2], 1000 + index, os.urandom(40) + b"x" * index,
                               900 + index, index)
        writer.finish()


def test_a_cut_bag_becomes_a_whole_one(salvage, tmp_path):
    write_foreign(Path("run_0.mcap"))
    written = list(read_messages("run_0.mcap"))
    content = Path("run_0.mcap").read_bytes()
    Path("run").mkdir()
    Path("run/run_0.mcap").write_bytes(content[:int(0.6 * len(content))])
    status, printed, complaints = salvage("run")
    assert status == 0
    assert "shimmy: run/run_0.mcap is cut off after" in complaints
    messages = read_messages("run_salvaged")
    read = list(messages)
    assert messages.damage == []
    assert messages.metadata["settings"] == {"of": "the run"}
    assert plain(read) == plain(written[:len(read)])
    assert 100 < len(read) < 300
    assert printed == f"bag      run_salvaged\nholds    {len(read)} messages on 2 topics\n"
    assert [message.channel for message in read] == [
        message.channel for message in written[:len(read)]]
    assert sorted(os.listdir("run_salvaged")) == ["metadata.yaml", "run_salvaged_0.mcap"]
    with Path("run_salvaged/run_salvaged_0.mcap").open("rb") as stream:
        summary = make_reader(stream).get_summary()
    assert summary.statistics.message_count == len(read)
    assert {channel.topic: channel.message_encoding
            for channel in summary.channels.values()} == {"/foreign": "cdr", "/json": "json"}
    information = yaml.safe_load(Path("run_salvaged/metadata.yaml").read_text())[
        "rosbag2_bagfile_information"]
    topics = {topic["topic_metadata"]["name"]: topic
              for topic in information["topics_with_message_count"]}
    assert topics["/foreign"]["message_count"] == -(-len(read) // 2)
    assert topics["/foreign"]["topic_metadata"]["type_description_hash"] == "RIHS01_" + 64 * "a"
    assert topics["/foreign"]["topic_metadata"]["offered_qos_profiles"] == [
        {"history": "keep_last", "depth": 3, "reliability": "reliable"}]
    assert topics["/json"]["topic_metadata"]["serialization_format"] == "json"


def test_every_kind_is_salvaged_and_read_by_other_tools(salvage, bags, kind, tmp_path):
    written = bags.example()
    path = bags.kinds[kind](tmp_path / "bags" / "run", written)
    assert salvage(path, "-o", "out")[0] == 0
    with AnyReader([Path("out")]) as reader:
        assert [(connection.topic, connection.msgtype, log_time, data)
                for connection, log_time, data in reader.messages()] == [
            (*message[:3], bags.cdr(message)) for message in written]
        for connection, _, data in reader.messages():
            reader.deserialize(data, connection.msgtype)


def test_a_killed_simulators_bag_is_whole_again(salvage):
    bag = BagWriter("run", {"publish_rate": "500.0"}, chunk_seconds=None)
    names = {topic.name: bag.add_topic(topic, "/shimmy") for topic in load_contract().recorded}
    for index in range(100):
        bag.write(names["limit_cycle/frequency"],
                  CODECS["limit_cycle/frequency"].encode(1.0 * index), 1000 + index)
        if index == 60:
            bag.flush()
    content = bag.path.read_bytes()
    bag.close()
    os.remove("run/metadata.yaml")
    Path("run/run_0.mcap").write_bytes(content)
    assert salvage("run", "-o", "out")[0] == 0
    messages = read_messages("out")
    assert [CODECS["limit_cycle/frequency"].decode(message.data)
            for message in messages] == [1.0 * index for index in range(61)]
    assert messages.metadata["shimmy_ros"] == {"publish_rate": "500.0"}
    with Reader(Path("out")) as reader:
        ((connection,),) = (reader.connections,)
        assert connection.ext.offered_qos_profiles[0].durability.name == "TRANSIENT_LOCAL"


def test_a_damaged_chunk_costs_no_more_than_itself(salvage):
    write_foreign(Path("run.mcap"), compression=CompressionType.NONE)
    written = plain(read_messages("run.mcap"))
    content = bytearray(Path("run.mcap").read_bytes())
    content[content.index(written[100][-1])] ^= 0xFF
    Path("run.mcap").write_bytes(content)
    status, _, complaints = salvage("run.mcap", "-o", "out")
    assert status == 0
    assert "is damaged in the chunk" in complaints
    read = plain(read_messages("out"))
    assert read[0] == written[0]
    assert read[-1] == written[-1]
    missing = [message for message in written if message not in read]
    first = written.index(missing[0])
    assert missing == written[first:first + len(missing)]
    assert len(missing) < 60


def test_two_salvages_are_the_same_to_the_byte(salvage):
    write_foreign(Path("run.mcap"))
    for place in ("a", "b"):
        assert salvage("run.mcap", "-o", f"{place}/out")[0] == 0
    for name in ("metadata.yaml", "out_0.mcap"):
        assert Path(f"a/out/{name}").read_bytes() == Path(f"b/out/{name}").read_bytes()


@pytest.mark.parametrize(("arguments", "sentence"), [
    (["nothing"], "bag nothing does not exist"),
    (["text.txt"], "text.txt is no bag"),
    (["short.mcap"], "bag short.mcap holds no message; short.mcap is cut off after 0 messages"),
    (["run.mcap", "-o", "run.mcap"], "run.mcap exists already and is not overwritten"),
])
def test_what_is_wrong_is_said_in_one_sentence(salvage, arguments, sentence):
    Path("text.txt").write_text("This is no bag.\n")
    write_foreign(Path("run.mcap"))
    Path("short.mcap").write_bytes(Path("run.mcap").read_bytes()[:500])
    before = sorted(os.listdir())
    status, printed, complaints = salvage(*arguments)
    assert (status, printed) == (2, "")
    assert complaints.startswith("shimmy: ")
    assert sentence in complaints
    assert complaints.count("\n") == 1
    assert sorted(os.listdir()) == before


def test_an_interrupt_keeps_what_is_copied(tmp_path):
    write_foreign(tmp_path / "run.mcap", count=12_000)
    child = subprocess.Popen(
        [sys.executable, "-m", "shimmy_ros.cli.main", "salvage", "run.mcap", "-o", "out"],
        stdout=subprocess.PIPE, text=True, cwd=tmp_path,
        env=os.environ | {"PYTHONPATH": str(Path(__file__).parents[2])})
    try:
        while not [file for file in tmp_path.glob(".out.*/out/out_0.mcap")
                   if file.stat().st_size > 50_000]:
            assert child.poll() is None
            time.sleep(0.002)
        child.send_signal(signal.SIGINT)
        child.communicate(timeout=60)
    finally:
        child.kill()
        child.wait()
    assert child.returncode == 130
    messages = read_messages(tmp_path / "out")
    assert 0 < len(list(messages)) < 12_000
    assert messages.damage == []
    assert sorted(os.listdir(tmp_path)) == ["out", "run.mcap"]
