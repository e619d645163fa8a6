"""Reading bags: whole, split, foreign, cut and damaged ones."""

from __future__ import annotations

import random
import shutil

import pytest
import yaml
from mcap.writer import CompressionType, IndexType, Writer
from rosbags.rosbag2 import CompressionFormat, CompressionMode, StoragePlugin
from rosbags.rosbag2 import Writer as RosbagsWriter

from shimmy_ros.bag.errors import BagError
from shimmy_ros.bag.reader import read_messages
from shimmy_ros.bag.writer import BagWriter
from shimmy_ros.contract.messages import CODECS
from shimmy_ros.contract.records import TaxiVelocity
from shimmy_ros.contract.spec import load_contract
from shimmy_ros.contract.typestore import typestore

VELOCITY, TORQUE = "/shimmy/taxi_velocity", "/shimmy/damper/coulomb_torque"
CONTRACT = load_contract()


def plain(messages):
    """What the messages say, without their channels."""
    return [(message.topic, message.type, message.log_time_ns, message.data)
            for message in messages]


def write_bag(directory, count=60, per_chunk=7):
    """A bag of ``count`` messages; returns them as they should be read."""
    expected = []
    with BagWriter(directory, {"run": "test"}, chunk_seconds=None) as bag:
        for name in ("taxi_velocity", "damper/coulomb_torque"):
            bag.add_topic(CONTRACT.topic(name), "/shimmy")
        for index in range(count):
            name = VELOCITY if index % 3 else TORQUE
            codec = CODECS[name.removeprefix("/shimmy/")]
            data = codec.encode(TaxiVelocity(index, 1.0 * index) if index % 3 else 1.0 * index)
            bag.write(name, data, 1000 + index)
            expected.append((name, codec.type, 1000 + index, data))
            if index % per_chunk == per_chunk - 1:
                bag.flush()
    return expected


@pytest.fixture(scope="module")
def whole(tmp_path_factory):
    directory = tmp_path_factory.mktemp("bags") / "run"
    expected = write_bag(directory)
    return directory, expected


def test_a_bag_and_its_file_are_read_alike(whole):
    directory, expected = whole
    for path in (directory, str(directory), directory / "run_0.mcap"):
        messages = read_messages(path)
        assert plain(messages) == expected
        assert messages.damage == []


def test_topics_are_picked(whole):
    directory, expected = whole
    messages = read_messages(directory, {TORQUE})
    assert plain(messages) == [message for message in expected if message[0] == TORQUE]
    assert list(read_messages(directory, ["/none"])) == []


def test_a_directory_without_metadata_is_read_in_rosbag2s_order(whole, tmp_path):
    directory, expected = whole
    (tmp_path / "split").mkdir()
    for name in ("run_10.mcap", "run_2.mcap"):
        shutil.copy(directory / "run_0.mcap", tmp_path / "split" / name)
    shorter = write_bag(tmp_path / "other", count=3)
    shutil.copy(tmp_path / "other" / "other_0.mcap", tmp_path / "split" / "run_2.mcap")
    assert plain(read_messages(tmp_path / "split")) == shorter + expected


def test_metadata_gives_the_order_of_a_split_bag(whole, tmp_path):
    directory, expected = whole
    shorter = write_bag(tmp_path / "b", count=3)
    shutil.copy(directory / "run_0.mcap", tmp_path / "b" / "a_1.mcap")
    metadata = tmp_path / "b" / "metadata.yaml"
    content = yaml.safe_load(metadata.read_text("utf-8"))
    content["rosbag2_bagfile_information"]["relative_file_paths"] = ["b_0.mcap", "a_1.mcap"]
    metadata.write_text(yaml.safe_dump(content))
    assert plain(read_messages(tmp_path / "b")) == shorter + expected


@pytest.mark.parametrize("compression", list(CompressionType))
@pytest.mark.parametrize("chunked", [True, False])
def test_files_of_other_writers_are_read(tmp_path, compression, chunked):
    path = tmp_path / "foreign.mcap"
    with path.open("wb") as stream:
        writer = Writer(stream, compression=compression, use_chunking=chunked,
                        index_types=IndexType.NONE, use_statistics=False, repeat_channels=False,
                        repeat_schemas=False, use_summary_offsets=False, enable_crcs=False)
        writer.start(profile="ros2")
        schema = writer.register_schema("std_msgs/msg/Float64", "ros2msg", b"float64 data")
        channel = writer.register_channel("/x", "cdr", schema)
        data = CODECS["limit_cycle/frequency"].encode(2.0)
        writer.add_message(channel, 7, data, 7)
        writer.finish()
    messages = read_messages(path)
    assert plain(messages) == [("/x", "std_msgs/msg/Float64", 7, data)]
    assert messages.damage == []


@pytest.mark.parametrize("mode", [CompressionMode.NONE, CompressionMode.STORAGE])
def test_a_bag_of_rosbags_is_read(tmp_path, mode):
    bag = RosbagsWriter(tmp_path / "run", version=9, storage_plugin=StoragePlugin.MCAP)
    bag.set_compression(mode, CompressionFormat.ZSTD)
    with bag:
        connection = bag.add_connection("/x", "std_msgs/msg/Float64", typestore=typestore())
        bag.write(connection, 7, CODECS["limit_cycle/frequency"].encode(2.0))
    assert [message[:3] for message in plain(read_messages(tmp_path / "run"))] == [
        ("/x", "std_msgs/msg/Float64", 7)]


def test_a_file_cut_anywhere_is_read_as_far_as_it_goes(whole, tmp_path):
    directory, expected = whole
    content = (directory / "run_0.mcap").read_bytes()
    path = tmp_path / "cut.mcap"
    counts = []
    for end in [*range(8, len(content), 23), len(content) - 1]:
        path.write_bytes(content[:end])
        messages = read_messages(path)
        read = plain(messages)
        assert read == expected[:len(read)]
        assert messages.damage == [f"{path} is cut off after {len(read)} messages"]
        counts.append(len(read))
    assert counts == sorted(counts)
    assert set(counts) == {*range(0, 60, 7), 60}


def test_a_file_with_a_wrong_byte_loses_no_message_silently(whole, tmp_path):
    directory, expected = whole
    content = (directory / "run_0.mcap").read_bytes()
    path = tmp_path / "wrong.mcap"
    random_source = random.Random(20240607)
    damaged = 0
    for position in [*range(8, 60), *random_source.sample(range(60, len(content)), 400)]:
        wrong = bytearray(content)
        wrong[position] ^= 1 << random_source.randrange(8)
        path.write_bytes(wrong)
        messages = read_messages(path)
        read = plain(messages)
        assert all(message in expected for message in read)
        assert read == expected or messages.damage
        for sentence in messages.damage:
            assert sentence.startswith(str(path))
            assert "\n" not in sentence
        damaged += bool(messages.damage)
    assert damaged > 100


def test_the_files_behind_a_damaged_one_are_read(whole, tmp_path):
    directory, expected = whole
    (tmp_path / "split").mkdir()
    content = (directory / "run_0.mcap").read_bytes()
    (tmp_path / "split" / "run_0.mcap").write_bytes(content[:len(content) // 2])
    (tmp_path / "split" / "run_1.mcap").write_bytes(content)
    messages = read_messages(tmp_path / "split")
    assert plain(messages)[-60:] == expected
    assert len(messages.damage) == 1
    assert "run_0.mcap is cut off after" in messages.damage[0]


def test_what_is_no_bag_is_refused(whole, tmp_path):
    directory, _ = whole
    with pytest.raises(BagError, match=r"bag .*nothing does not exist"):
        read_messages(tmp_path / "nothing")
    (tmp_path / "empty").mkdir()
    with pytest.raises(BagError, match=r"empty holds neither metadata\.yaml nor an MCAP or"):
        read_messages(tmp_path / "empty")
    for content in (b"", b"\x89MCAP0\r", b"#ROSBAG V1.2\n"):
        (tmp_path / "file.mcap").write_bytes(content)
        with pytest.raises(BagError, match=r"file\.mcap is no bag: it is neither an MCAP nor"):
            read_messages(tmp_path / "file.mcap")
    shutil.copytree(directory, tmp_path / "lacking")
    (tmp_path / "lacking" / "run_0.mcap").unlink()
    with pytest.raises(BagError, match=r"lacking lacks its file run_0\.mcap"):
        read_messages(tmp_path / "lacking")
    for content in ("", "[]", "a: [", "rosbag2_bagfile_information: {relative_file_paths: 3}"):
        (tmp_path / "lacking" / "metadata.yaml").write_text(content)
        with pytest.raises(BagError, match=r"metadata\.yaml is no metadata of a bag"):
            read_messages(tmp_path / "lacking")
