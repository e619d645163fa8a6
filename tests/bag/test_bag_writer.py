"""The bag that is written, as other readers see it."""

from __future__ import annotations

import os

import pytest
import yaml
from mcap.reader import make_reader
from mcap.records import Chunk
from mcap.stream_reader import StreamReader
from rosbags.highlevel import AnyReader
from rosbags.interfaces import QosDurability, QosHistory, QosReliability
from rosbags.rosbag2 import Reader
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

from shimmy_ros.bag import writer as writer_module
from shimmy_ros.bag.errors import BagError
from shimmy_ros.bag.reader import read_messages
from shimmy_ros.bag.writer import BagWriter
from shimmy_ros.contract.messages import CODECS
from shimmy_ros.contract.records import GearResponse, TaxiVelocity
from shimmy_ros.contract.spec import load_contract

CONTRACT = load_contract()
VELOCITY, RESPONSE = "/shimmy/taxi_velocity", "/shimmy/gear_response"
START_NS = 1_700_000_000_000_000_000


def velocity(index):
    return CODECS["taxi_velocity"].encode(TaxiVelocity(START_NS + index, 40.0 + index))


def response(index):
    values = (0.1 * index, -0.2 * index, 0.3, 0.4)
    return CODECS["gear_response"].encode(GearResponse(START_NS + index, values, values, values))


def write_example(directory, count=20, **options):
    with BagWriter(directory, {"harmonics": "4"}, **options) as bag:
        for topic in CONTRACT.recorded:
            bag.add_topic(topic, "/shimmy")
        for index in range(count):
            bag.write(RESPONSE, response(index), START_NS + 1000 * index)
            if index % 10 == 0:
                bag.write(VELOCITY, velocity(index), START_NS + 1000 * index + 1,
                          publish_time_ns=START_NS + index)
    return directory


@pytest.fixture
def clock(monkeypatch):
    """A clock that the writer sees, in a list of one."""
    now = [100.0]
    monkeypatch.setattr(writer_module, "monotonic", lambda: now[0])
    return now


def chunks(path):
    with path.open("rb") as stream:
        return [record for record in StreamReader(stream, emit_chunks=True).records
                if isinstance(record, Chunk)]


def test_metadata_is_what_rosbag2_writes(tmp_path):
    directory = write_example(tmp_path / "run")
    content = yaml.safe_load((directory / "metadata.yaml").read_text("utf-8"))
    assert list(content) == ["rosbag2_bagfile_information"]
    information = content["rosbag2_bagfile_information"]
    topics = {topic["topic_metadata"]["name"]: topic
              for topic in information.pop("topics_with_message_count")}
    start = {"nanoseconds_since_epoch": START_NS}
    duration = {"nanoseconds": 19_000}
    assert information == {
        "version": 9, "storage_identifier": "mcap", "duration": duration, "starting_time": start,
        "message_count": 22, "compression_format": "", "compression_mode": "",
        "relative_file_paths": ["run_0.mcap"],
        "files": [{"path": "run_0.mcap", "starting_time": start, "duration": duration,
                   "message_count": 22}],
        "custom_data": None, "ros_distro": "jazzy",
    }
    assert list(topics) == [topic.resolved("/shimmy") for topic in CONTRACT.recorded]
    assert topics[VELOCITY]["message_count"] == 2
    assert topics[RESPONSE]["message_count"] == 20
    assert topics[VELOCITY]["topic_metadata"]["type"] == "geometry_msgs/msg/TwistStamped"
    assert topics["/shimmy/limit_cycle/orbit"]["topic_metadata"]["offered_qos_profiles"] == [{
        "history": "keep_last", "depth": 1, "reliability": "reliable",
        "durability": "transient_local",
        "deadline": {"sec": 9223372036, "nsec": 854775807},
        "lifespan": {"sec": 9223372036, "nsec": 854775807},
        "liveliness": "automatic",
        "liveliness_lease_duration": {"sec": 9223372036, "nsec": 854775807},
        "avoid_ros_namespace_conventions": False,
    }]
    assert sorted(os.listdir(directory)) == ["metadata.yaml", "run_0.mcap"]


def test_rosbags_reads_it_as_a_bag(tmp_path):
    directory = write_example(tmp_path / "run")
    with Reader(directory) as reader:
        assert (reader.message_count, reader.start_time) == (22, START_NS)
        assert reader.ros_distro == "jazzy"
        connections = {connection.topic: connection for connection in reader.connections}
        assert len(connections) == len(CONTRACT.recorded)
        for topic in CONTRACT.recorded:
            connection = connections[topic.resolved("/shimmy")]
            assert connection.digest == get_typestore(Stores.ROS2_JAZZY).hash_rihs01(topic.type)
            (qos,) = connection.ext.offered_qos_profiles
            assert qos.reliability is QosReliability[topic.qos.reliability.name]
            assert qos.durability is QosDurability[topic.qos.durability.name]
            assert (qos.history, qos.depth) == (QosHistory.KEEP_LAST, topic.qos.depth)
    with AnyReader([directory]) as any_reader:
        read = [(connection.topic, time, any_reader.deserialize(data, connection.msgtype))
                for connection, time, data in any_reader.messages()]
    velocities = [message.twist.linear.x for topic, _, message in read if topic == VELOCITY]
    assert velocities == [40.0, 50.0]
    swivels = [message.position[1] for topic, _, message in read if topic == RESPONSE]
    assert swivels == [-0.2 * index for index in range(20)]
    times = [time - START_NS for topic, time, _ in read if topic == VELOCITY]
    assert times == [1, 10_001]


def test_the_bare_file_says_everything(tmp_path):
    decoder = pytest.importorskip("mcap_ros2.decoder")
    path = write_example(tmp_path / "run") / "run_0.mcap"
    with path.open("rb") as stream:
        reader = make_reader(stream, validate_crcs=True,
                             decoder_factories=[decoder.DecoderFactory()])
        assert reader.get_header().profile == "ros2"
        summary = reader.get_summary()
        assert summary.statistics.message_count == 22
        assert summary.statistics.message_start_time == START_NS
        assert len(summary.chunk_indexes) == summary.statistics.chunk_count > 0
        assert {index.compression for index in summary.chunk_indexes} == {"zstd"}
        for channel in summary.channels.values():
            assert channel.message_encoding == "cdr"
            schema = summary.schemas[channel.schema_id]
            assert schema.encoding == "ros2msg"
            # The text alone, without any store, gives the type and its hash.
            store = get_typestore(Stores.EMPTY)
            store.register(get_types_from_msg(schema.data.decode(), schema.name))
            assert store.hash_rihs01(schema.name) == channel.metadata["topic_type_hash"]
            (qos,) = yaml.safe_load(channel.metadata["offered_qos_profiles"])
            assert qos["history"] == "keep_last"
        names = [schema.name for schema in summary.schemas.values()]
        assert sorted(names) == sorted({topic.type for topic in CONTRACT.recorded})
        metadata = {record.name: record.metadata for record in reader.iter_metadata()}
        assert metadata["shimmy_ros"] == {"harmonics": "4"}
        outside = yaml.safe_load((tmp_path / "run" / "metadata.yaml").read_text("utf-8"))
        assert yaml.safe_load(metadata["rosbag2"]["serialized_metadata"]) == (
            outside["rosbag2_bagfile_information"])
        decoded = [(channel.topic, message.publish_time, ros_message) for
                   _, channel, message, ros_message in reader.iter_decoded_messages([VELOCITY])]
    assert [(topic, time) for topic, time, _ in decoded] == [
        (VELOCITY, START_NS), (VELOCITY, START_NS + 10)]
    assert [message.twist.linear.x for *_, message in decoded] == [40.0, 50.0]


def test_an_empty_bag_is_a_bag(tmp_path):
    with BagWriter(tmp_path / "run") as bag:
        bag.add_topic(CONTRACT.topic("taxi_velocity"), "/")
    with Reader(tmp_path / "run") as reader:
        assert reader.message_count == 0
        assert [connection.topic for connection in reader.connections] == ["/taxi_velocity"]
    messages = read_messages(tmp_path / "run")
    assert (list(messages), messages.damage) == ([], [])


def test_times_in_any_order(tmp_path):
    times = [5_000, 2_000, 9_000, 9_000, 1_000]
    with BagWriter(tmp_path / "run") as bag:
        name = bag.add_topic(CONTRACT.topic("taxi_velocity"), "/shimmy")
        for index, time in enumerate(times):
            bag.write(name, velocity(index), time)
    read = [(message.log_time_ns, message.data) for message in read_messages(tmp_path / "run")]
    assert read == [(times[index], velocity(index)) for index in (4, 1, 0, 2, 3)]
    with Reader(tmp_path / "run") as reader:
        assert (reader.start_time, reader.end_time - reader.start_time) == (1_000, 8_001)
        assert [time for _, time, _ in reader.messages()] == sorted(times)


def test_an_old_chunk_is_handed_over_with_the_next_message(tmp_path, clock):
    bag = BagWriter(tmp_path / "run")
    name = bag.add_topic(CONTRACT.topic("taxi_velocity"), "/shimmy")
    for index in range(4):
        bag.write(name, velocity(index), index)
        clock[0] += 0.04
    # The fourth came 0.12 s after the first, which closed the chunk.
    assert len(list(read_messages(bag.path))) == 4
    bag.write(name, velocity(4), 4)
    assert len(list(read_messages(bag.path))) == 4
    bag.close()
    assert [message.data for message in read_messages(bag.path)] == [velocity(i) for i in range(5)]


def test_an_old_chunk_is_handed_over_without_a_further_message(tmp_path, clock):
    with BagWriter(tmp_path / "run") as bag:
        name = bag.add_topic(CONTRACT.topic("taxi_velocity"), "/shimmy")
        bag.flush_if_due()
        bag.write(name, velocity(0), 0)
        clock[0] += 0.09
        bag.flush_if_due()
        assert list(read_messages(bag.path)) == []
        clock[0] += 0.02
        bag.flush_if_due()
        messages = read_messages(bag.path)
        assert [message.data for message in messages] == [velocity(0)]
        assert messages.damage == [f"{bag.path} is cut off after 1 messages"]
        size = bag.path.stat().st_size
        clock[0] += 1.0
        bag.flush_if_due()
        assert bag.path.stat().st_size == size


def test_chunks_are_closed_by_size(tmp_path, clock):
    with BagWriter(tmp_path / "run") as bag:
        for topic in CONTRACT.recorded:
            bag.add_topic(topic, "/shimmy")
        for index in range(3000):
            bag.write(RESPONSE, response(index), index)
        # All but the last chunk are with the operating system already.
        assert len(list(read_messages(bag.path))) > 2000
    sizes = [chunk.uncompressed_size for chunk in chunks(bag.path)]
    assert len(sizes) == 4
    assert max(sizes) <= 256 * 1024


def test_without_a_clock_the_same_messages_give_the_same_bytes(tmp_path, clock):
    files = []
    for place in ("a", "b"):
        clock[0] += 1000.0
        (tmp_path / place).mkdir()
        directory = write_example(tmp_path / place / "run", count=50, chunk_seconds=None)
        files.append([(directory / name).read_bytes() for name in ("run_0.mcap", "metadata.yaml")])
        clock[0] += 1.0
    assert files[0] == files[1]


def test_an_existing_directory_is_refused_and_kept(tmp_path):
    (tmp_path / "run").mkdir()
    (tmp_path / "run" / "notes.txt").write_text("mine")
    with pytest.raises(BagError, match="run exists already and is not overwritten"):
        BagWriter(tmp_path / "run")
    assert os.listdir(tmp_path / "run") == ["notes.txt"]


def test_an_impossible_directory_is_refused(tmp_path):
    (tmp_path / "file").write_text("")
    with pytest.raises(BagError, match=r"bag .*run cannot be made: Not a directory"):
        BagWriter(tmp_path / "file" / "run")


def test_misuse_is_refused_and_the_bag_goes_on(tmp_path):
    bag = BagWriter(tmp_path / "run")
    topic = CONTRACT.topic("taxi_velocity")
    assert bag.add_topic(topic, "/shimmy") == VELOCITY
    with pytest.raises(BagError, match=f"topic {VELOCITY} is in bag .* already"):
        bag.add_topic(topic, "shimmy")
    with pytest.raises(BagError, match=f"topic {RESPONSE} is not in bag .* has {VELOCITY}"):
        bag.write(RESPONSE, response(0), 0)
    for time in (-1, 2**63):
        with pytest.raises(BagError, match=f"log time of a message on {VELOCITY} is {time} ns"):
            bag.write(VELOCITY, velocity(0), time)
        with pytest.raises(BagError, match="publish time"):
            bag.write(VELOCITY, velocity(0), 0, publish_time_ns=time)
    bag.write(VELOCITY, velocity(0), 0)
    bag.close()
    content = [path.read_bytes() for path in sorted(bag.directory.iterdir())]
    bag.close()
    assert [path.read_bytes() for path in sorted(bag.directory.iterdir())] == content
    with pytest.raises(BagError, match="is closed"):
        bag.write(VELOCITY, velocity(0), 0)
    with pytest.raises(BagError, match="is closed"):
        bag.add_topic(CONTRACT.topic("gear_response"), "/shimmy")
    assert len(list(read_messages(bag.directory))) == 1


def test_an_error_in_the_block_still_leaves_a_whole_bag(tmp_path):
    def fail_after_one_message():
        with BagWriter(tmp_path / "run") as bag:
            name = bag.add_topic(CONTRACT.topic("taxi_velocity"), "/shimmy")
            bag.write(name, velocity(0), 0)
            raise ZeroDivisionError

    with pytest.raises(ZeroDivisionError):
        fail_after_one_message()
    messages = read_messages(tmp_path / "run")
    assert (len(list(messages)), messages.damage) == (1, [])


def test_a_full_disk_is_reported_and_the_bag_closed(tmp_path):
    bag = BagWriter(tmp_path / "run")
    name = bag.add_topic(CONTRACT.topic("taxi_velocity"), "/shimmy")
    bag.write(name, velocity(0), 0)
    full = os.open("/dev/full", os.O_WRONLY)
    os.dup2(full, bag._stream.fileno())
    os.close(full)
    with pytest.raises(OSError, match="No space left"):
        bag.close()
    bag.close()
    assert not (bag.directory / "metadata.yaml").exists()
