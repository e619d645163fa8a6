"""Every kind of bag says the same, to this reader and to rosbags'."""

from __future__ import annotations

import shutil
import sqlite3

import pytest
import zstandard
from mcap.writer import CompressionType
from rosbags.highlevel import AnyReader

from shimmy_ros.bag.errors import BagError
from shimmy_ros.bag.message import Channel
from shimmy_ros.bag.reader import Bag, read_messages
from shimmy_ros.bag.types import types_of


def plain(messages):
    return [(message.topic, message.type, message.log_time_ns, message.data)
            for message in messages]


def test_every_kind_is_read(bags, kind, tmp_path):
    written = bags.example()
    path = bags.kinds[kind](tmp_path / "run", written)
    messages = read_messages(path)
    read = list(messages)
    assert plain(read) == [(*message[:3], bags.cdr(message)) for message in written]
    assert messages.damage == []
    assert messages.fraction == 1.0
    channels = Bag(path).channels()
    assert sorted({(channel.topic, channel.type) for channel in channels}) == sorted(
        {message[:2] for message in written})
    assert plain(read_messages(path, {bags.torque})) == [
        (*message[:3], bags.cdr(message)) for message in written if message[0] == bags.torque]
    store, _ = bags.stores()
    for channel in Bag(path).channels():
        types = types_of(channel)
        assert types.hash_rihs01(channel.type) == store.hash_rihs01(channel.type)
    if not kind.endswith(("no metadata", "oldest")):
        with AnyReader([path]) as reader:
            theirs = [(connection.topic, connection.msgtype, time)
                      for connection, time, _ in reader.messages()]
        assert theirs == [message[:3] for message in written]


@pytest.mark.parametrize("name", ["mcap", "mcap, lz4 chunks", "mcap, zstd files", "sqlite",
                                  "sqlite, oldest", "ros 1"])
def test_topics_that_were_written_one_after_the_other_come_by_time(bags, tmp_path, name):
    written = bags.example()
    path = bags.kinds[name](tmp_path / "run", sorted(written, key=lambda message: message[0]))
    assert plain(read_messages(path)) == [(*message[:3], bags.cdr(message)) for message in written]


@pytest.mark.parametrize("name", ["mcap, zstd files", "sqlite", "sqlite, zstd files", "ros 1, bz2"])
def test_a_file_that_was_cut_is_read_as_far_as_it_goes(bags, tmp_path, name):
    written = bags.example(4000)
    if name == "mcap, zstd files":
        # rosbags' chunks hold all of it; a recorder's are smaller.
        bare = bags.write_mcap(tmp_path / "run", written, compression=CompressionType.NONE)
        (tmp_path / "run" / "run_0.mcap.zstd").write_bytes(zstandard.compress(bare.read_bytes()))
        bare.unlink()
        path = tmp_path / "run"
    else:
        path = bags.kinds[name](tmp_path / "run", written)
    (file,) = [item for item in path.iterdir() if item.suffix != ".yaml"] if path.is_dir() else [
        path]
    whole = file.read_bytes()
    counts = []
    for part in (0.001, 0.3, 0.6, 0.9, 0.999):
        file.write_bytes(whole[:int(part * len(whole))])
        messages = read_messages(path)
        read = plain(messages)
        assert read == [(*message[:3], bags.cdr(message)) for message in written[:len(read)]]
        assert messages.damage
        assert all(file.name.removesuffix(".zstd") in text for text in messages.damage)
        counts.append(len(read))
    assert counts == sorted(counts)
    assert 1000 < counts[-1] <= len(written)


def test_a_ros1_bag_that_was_never_closed_is_read(bags, tmp_path):
    written = bags.example(100)
    path = bags.write_ros1(tmp_path / "run", written)
    content = bytearray(path.read_bytes())
    # A bag that is being written says that its index is at 0, and has none.
    field = content.index(b"index_pos=") + len(b"index_pos=")
    end = int.from_bytes(content[field:field + 8], "little")
    content[field:field + 8] = bytes(8)
    path.write_bytes(content[:end])
    messages = read_messages(path)
    assert plain(messages) == [(*message[:3], bags.cdr(message)) for message in written]
    assert messages.damage == [f"{path} is cut off after {len(written)} messages"]
    # In its last chunk, whose size it does not know yet, the records follow the header.
    chunk = content.rindex(b"compression=none")
    size = content.index(b"size=", chunk) + len(b"size=")
    content[size:size + 4] = bytes(4)
    content[size + 4:size + 8] = bytes(4)
    behind = content.index(b"op=\x04", size) - 8
    path.write_bytes(content[:behind - 40])
    messages = read_messages(path)
    read = plain(messages)
    assert read == [(*message[:3], bags.cdr(message)) for message in written[:len(read)]]
    assert len(read) > 90


def test_a_recorder_that_was_killed_before_its_first_message_of_a_file(bags, tmp_path):
    written = bags.example()
    path = bags.kinds["mcap, split, no metadata"](tmp_path / "run", written)
    (path / "run_3.mcap").touch()
    messages = read_messages(path)
    assert len(list(messages)) == len(written)
    assert len(messages.damage) == 1
    assert "run_3.mcap is no bag" in messages.damage[0]
    assert len(Bag(path).channels()) == 2


def test_a_write_ahead_log_is_read(bags, tmp_path):
    written = bags.example()
    path = bags.kinds["sqlite, bare file"](tmp_path / "run", written[:-1])
    database = sqlite3.connect(path)
    database.execute("PRAGMA journal_mode=WAL")
    with database:
        database.execute("INSERT INTO messages(topic_id, timestamp, data) VALUES (1, ?, ?)",
                         (written[-1][2], bags.cdr(written[-1])))
    killed = tmp_path / "killed"
    killed.mkdir()
    for file in path.parent.glob("run.db3*"):
        if not file.name.endswith("-shm"):
            shutil.copy(file, killed)
    database.close()
    assert len(list(read_messages(killed))) == len(written)


def test_a_type_that_the_bag_does_not_define(bags, tmp_path):
    channel = Channel("/x", "some_msgs/msg/Unknown")
    with pytest.raises(BagError, match="type some_msgs/msg/Unknown, which the bag does not define"):
        types_of(channel)
    with pytest.raises(BagError, match="is encoded as json, but must be cdr"):
        types_of(Channel("/x", "some_msgs/msg/Unknown", "json"))
    for definition, language in ((b"float64 x[", "ros2msg"), (b"\xff", "ros2msg"),
                                 (b"message X {}", "protobuf"), (b"module {", "ros2idl"),
                                 (b"other_msgs/Thing x", "ros2msg")):
        with pytest.raises(BagError, match=r"definition of some_msgs/msg/Bad in the bag"):
            types_of(Channel("/x", "some_msgs/msg/Bad", "cdr", definition, language))


def test_definitions_in_idl_are_read():
    part = "=" * 80 + "\nIDL: {}\n{}\n"
    text = part.format("some_msgs/msg/Outer", "module some_msgs { module msg { struct Outer { "
                       "some_msgs::msg::Inner inner; }; }; };")
    text += part.format("some_msgs/msg/Inner", "module some_msgs { module msg { struct Inner { "
                        "double x; }; }; };")
    types = types_of(Channel("/x", "some_msgs/msg/Outer", "cdr", text.encode(), "ros2idl"))
    assert types.fielddefs["some_msgs/msg/Outer"][1][0][0] == "inner"
