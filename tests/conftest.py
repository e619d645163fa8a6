"""Bags of every kind that a replay has to read, written by rosbags, mcap and sqlite3.

One thread for BLAS, as in the package's own processes.
"""

from __future__ import annotations

import os
import sqlite3
from contextlib import closing
from functools import lru_cache
from types import SimpleNamespace

import pytest

# Before numpy is imported.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

START_NS = 1_700_000_000_000_000_000
FLOAT64, TWIST_STAMPED = "std_msgs/msg/Float64", "geometry_msgs/msg/TwistStamped"
VELOCITY, TORQUE = "/shimmy/taxi_velocity", "/shimmy/damper/coulomb_torque"


@lru_cache(maxsize=1)
def stores():
    """rosbags' types of ROS 2 and ROS 1."""
    from rosbags.typesys import Stores, get_typestore

    return get_typestore(Stores.ROS2_JAZZY), get_typestore(Stores.ROS1_NOETIC)


def twist_stamped(store, stamp_ns, velocity):
    """A TwistStamped of either ROS."""
    types = store.types
    vector = types["geometry_msgs/msg/Vector3"]
    time = types["builtin_interfaces/msg/Time"](*divmod(stamp_ns, 10**9))
    header = types["std_msgs/msg/Header"]
    number = (7,) if store.fielddefs["std_msgs/msg/Header"][1][0][0] == "seq" else ()
    twist = types["geometry_msgs/msg/Twist"](vector(velocity, 0.0, 0.0), vector(0.0, 0.0, 0.0))
    return types[TWIST_STAMPED](header(*number, time, "base_link"), twist)


def example(count=40):
    """(topic, type, log time, value) of a few velocities and changes of the friction."""
    messages = []
    for index in range(count):
        time = START_NS + index * 20_000_000
        if index % 15 == 7:
            messages.append((TORQUE, FLOAT64, time - 1_000_000, 10.0 + 0.5 * index))
        messages.append((VELOCITY, TWIST_STAMPED, time, 40.0 + 0.3 * index))
    return messages


def content(store, message):
    """The message as an object of rosbags."""
    _, type_name, time, value = message
    if type_name == FLOAT64:
        return store.types[FLOAT64](value)
    return twist_stamped(store, time - 500_000, value)


def cdr(message):
    """The message's CDR bytes."""
    store, _ = stores()
    return bytes(store.serialize_cdr(content(store, message), message[1]))


def write_mcap(directory, messages, **options):
    """A bare MCAP file, like rosbag2's."""
    from mcap.writer import Writer

    store, _ = stores()
    directory.mkdir(parents=True, exist_ok=True)
    path = directory / f"{directory.name}_0.mcap"
    with path.open("wb") as stream:
        writer = Writer(stream, chunk_size=1000, **options)
        writer.start(profile="ros2")
        channels = {}
        for message in messages:
            topic, type_name, time, _ = message
            if topic not in channels:
                schema = writer.register_schema(
                    type_name, "ros2msg",
                    store.generate_msgdef(type_name, ros_version=2)[0].encode())
                channels[topic] = writer.register_channel(
                    topic, "cdr", schema, {"offered_qos_profiles": ""})
            writer.add_message(channels[topic], time, cdr(message), time)
        writer.finish()
    return path


def write_rosbag2(directory, messages, storage="MCAP", mode="NONE"):
    """A directory by rosbags' writer, with metadata."""
    from rosbags.rosbag2 import CompressionFormat, CompressionMode, StoragePlugin, Writer

    store, _ = stores()
    writer = Writer(directory, version=9, storage_plugin=StoragePlugin[storage])
    writer.set_compression(CompressionMode[mode], CompressionFormat.ZSTD)
    connections = {}
    with writer:
        for message in messages:
            topic, type_name, time, _ = message
            if topic not in connections:
                connections[topic] = writer.add_connection(topic, type_name, typestore=store)
            writer.write(connections[topic], time, cdr(message))
    return directory


def write_split(directory, messages, storage="MCAP"):
    """A directory of three files, put together from bags of one each."""
    import yaml

    parts = [write_rosbag2(directory.with_name(f"{directory.name}_part{number}"), part, storage)
             for number, part in enumerate(split(messages, 3))]
    directory.mkdir()
    suffix = {"MCAP": ".mcap", "SQLITE3": ".db3"}[storage]
    names = []
    topics = {}
    for number, part in enumerate(parts):
        names.append(f"{directory.name}_{number}{suffix}")
        (part / f"{part.name}{suffix}").rename(directory / names[-1])
        metadata = yaml.safe_load((part / "metadata.yaml").read_text())
        information = metadata["rosbag2_bagfile_information"]
        for topic in information["topics_with_message_count"]:
            topics.setdefault(topic["topic_metadata"]["name"], topic)
    information["relative_file_paths"] = names
    information["topics_with_message_count"] = list(topics.values())
    information["message_count"] = len(messages)
    (directory / "metadata.yaml").write_text(yaml.safe_dump(metadata))
    return directory


def split(messages, count):
    """``messages`` in ``count`` parts, one after the other."""
    size = -(-len(messages) // count)
    return [messages[begin:begin + size] for begin in range(0, len(messages), size)]


def write_old_sqlite(directory, messages):
    """A .db3 of the first rosbag2: no definitions, no QoS, and a path with the directory's name."""
    import yaml

    directory.mkdir(parents=True)
    name = f"{directory.name}_0.db3"
    with closing(sqlite3.connect(directory / name)) as database, database:
        database.executescript(
            "CREATE TABLE topics(id INTEGER PRIMARY KEY, name TEXT NOT NULL, type TEXT NOT NULL,"
            " serialization_format TEXT NOT NULL);"
            "CREATE TABLE messages(id INTEGER PRIMARY KEY, topic_id INTEGER NOT NULL,"
            " timestamp INTEGER NOT NULL, data BLOB NOT NULL);"
            "CREATE INDEX timestamp_idx ON messages (timestamp ASC);")
        numbers = {}
        for message in messages:
            topic, type_name, time, _ = message
            if topic not in numbers:
                numbers[topic] = len(numbers) + 1
                database.execute("INSERT INTO topics VALUES (?, ?, ?, 'cdr')",
                                 (numbers[topic], topic, type_name))
            database.execute("INSERT INTO messages(topic_id, timestamp, data) VALUES (?, ?, ?)",
                             (numbers[topic], time, cdr(message)))
    information = {"version": 2, "relative_file_paths": [f"{directory.name}/{name}"]}
    (directory / "metadata.yaml").write_text(
        yaml.safe_dump({"rosbag2_bagfile_information": information}))
    return directory


def write_ros1(directory, messages, compression=None):
    """A ROS 1 bag, with two connections for the velocity, as two publishers make."""
    from rosbags.rosbag1 import Writer

    _, store = stores()
    directory.mkdir(parents=True, exist_ok=True)
    path = directory / f"{directory.name}.bag"
    writer = Writer(path)
    writer.chunk_threshold = 1000
    if compression:
        writer.set_compression(Writer.CompressionFormat[compression])
    connections = {}
    with writer:
        for number, message in enumerate(messages):
            topic, type_name, time, _ = message
            key = topic, number % 2 if topic == VELOCITY else 0
            if key not in connections:
                connections[key] = writer.add_connection(
                    topic, type_name, typestore=store, callerid=f"/node{key[1]}")
            writer.write(connections[key], time,
                         store.serialize_ros1(content(store, message), type_name))
    return path


def without_metadata(directory):
    """The directory as a killed recorder leaves it."""
    (directory / "metadata.yaml").unlink()
    return directory


def compressions():
    """How mcap's writer can compress chunks."""
    from mcap.writer import CompressionType

    return CompressionType


KINDS = {
    "mcap": lambda d, m: write_rosbag2(d, m),
    "mcap, zstd chunks": lambda d, m: write_mcap(d, m, compression=compressions().ZSTD),
    "mcap, lz4 chunks": lambda d, m: write_mcap(d, m, compression=compressions().LZ4),
    "mcap, no compression": lambda d, m: write_mcap(d, m, compression=compressions().NONE),
    "mcap, no chunks": lambda d, m: write_mcap(d, m, use_chunking=False),
    "mcap, zstd chunks by rosbags": lambda d, m: write_rosbag2(d, m, mode="STORAGE"),
    "mcap, zstd files": lambda d, m: write_rosbag2(d, m, mode="FILE"),
    "mcap, zstd messages": lambda d, m: write_rosbag2(d, m, mode="MESSAGE"),
    "mcap, split": lambda d, m: write_split(d, m),
    "mcap, split, no metadata": lambda d, m: without_metadata(write_split(d, m)),
    "mcap, zstd files, no metadata": lambda d, m: without_metadata(
        write_rosbag2(d, m, mode="FILE")),
    "mcap, zstd messages, no metadata": lambda d, m: without_metadata(
        write_rosbag2(d, m, mode="MESSAGE")),
    "sqlite": lambda d, m: write_rosbag2(d, m, "SQLITE3"),
    "sqlite, zstd files": lambda d, m: write_rosbag2(d, m, "SQLITE3", "FILE"),
    "sqlite, zstd messages": lambda d, m: write_rosbag2(d, m, "SQLITE3", "MESSAGE"),
    "sqlite, split": lambda d, m: write_split(d, m, "SQLITE3"),
    "sqlite, split, no metadata": lambda d, m: without_metadata(write_split(d, m, "SQLITE3")),
    "sqlite, bare file": lambda d, m: write_rosbag2(d, m, "SQLITE3") / f"{d.name}.db3",
    "sqlite, oldest": write_old_sqlite,
    "ros 1": write_ros1,
    "ros 1, bz2": lambda d, m: write_ros1(d, m, "BZ2"),
    "ros 1, lz4": lambda d, m: write_ros1(d, m, "LZ4"),
}


@pytest.fixture(scope="session")
def bags():
    """How to write bags: ``kinds`` by name, each from a directory and messages."""
    return SimpleNamespace(
        kinds=KINDS, example=example, cdr=cdr, stores=stores, velocity=VELOCITY, torque=TORQUE,
        start_ns=START_NS, write_mcap=write_mcap, write_rosbag2=write_rosbag2,
        write_ros1=write_ros1, twist_stamped=twist_stamped)


def pytest_generate_tests(metafunc):
    """A test with the argument ``kind`` runs for every kind of bag."""
    if "kind" in metafunc.fixturenames:
        metafunc.parametrize("kind", list(KINDS), scope="module")
