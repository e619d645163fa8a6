"""Writes a bag as rosbag2 lays it out: a directory with metadata.yaml and one MCAP file.

The mcap library writes the container: profile ros2, ros2msg schemas, CDR messages, chunks
compressed with zstd. Chunks are closed by time and by size and handed to the operating system at
once, so that the file of a killed process is readable up to its last closed chunk.
"""

from __future__ import annotations

import os
from collections.abc import Mapping
from pathlib import Path
from time import monotonic
from types import TracebackType

from mcap.writer import CompressionType, Writer

from ..contract.spec import Topic
from ..contract.typestore import definition, type_hash
from .errors import BagError
from .message import CDR, Channel
from .metadata import Connection, bag_information, qos_profiles, yaml_text
from .types import MSG

CHUNK_SECONDS = 0.1
"""Age at which a chunk is closed: a quarter second less the delays of a timer."""

CHUNK_BYTES = 192 * 1024
"""Messages in a chunk at most; with the schemas in the first one it stays below 256 KiB."""

SETTINGS = "shimmy_ros"
"""Name of the MCAP metadata record that holds the settings of the run."""

_RECORD_OVERHEAD = 31  # opcode, length, channel, sequence and the two times of a message record
_LAST_NS = 2**63 - 1
_NO_SCHEMA = 0


class BagWriter:
    """A bag being written, for use by one thread.

    Use it as a context manager, which closes the bag even where the block raises, or call close().
    Whoever writes live calls flush_if_due() from a timer, twenty times a second or more often.
    """

    def __init__(
        self,
        directory: Path | str,
        settings: Mapping[str, str] | None = None,
        chunk_seconds: float | None = CHUNK_SECONDS,
        chunk_bytes: int = CHUNK_BYTES,
    ) -> None:
        """Make ``directory`` and begin its MCAP file; ``settings`` describe the run.

        With ``chunk_seconds`` None, chunks are closed at ``chunk_bytes`` alone, so that the same
        messages always give the same bytes. Every chunk takes about 1 kB of memory.

        Raises BagError where the directory exists or cannot be made.
        """
        self.directory = Path(directory)
        self.chunk_seconds = chunk_seconds
        self._chunk_bytes = chunk_bytes
        try:
            self.directory.mkdir(parents=True)
        except FileExistsError as error:
            raise BagError(f"bag {directory} exists already and is not overwritten") from error
        except OSError as error:
            raise BagError(f"bag {directory} cannot be made: {error.strerror}") from error
        self.path = self.directory / f"{self.directory.resolve().name}_0.mcap"
        self._connections: dict[str | Channel, tuple[int, Connection]] = {}
        self._schemas: dict[tuple[str, bytes, str], int] = {}
        self._first_ns: int | None = None
        self._last_ns: int | None = None
        self._pending_bytes = 0
        self._chunk_begun = 0.0
        self._stream = self.path.open("xb")
        self._writer = Writer(self._stream, chunk_size=2 * chunk_bytes,
                              compression=CompressionType.ZSTD)
        self._writer.start(profile="ros2")
        if settings:
            self._writer.add_metadata(SETTINGS, dict(settings))
        self._stream.flush()

    def add_topic(self, topic: Topic, namespace: str) -> str:
        """Begin a connection for ``topic`` and return its name in ``namespace``, for write().

        Raises BagError for a name that has one already.
        """
        self._check_open()
        name = topic.resolved(namespace)
        if name in self._connections:
            raise BagError(f"topic {name} is in bag {self.directory} already")
        self._connections[name] = self._begin(Channel(
            name, topic.type, CDR, definition(topic.type).encode(), MSG, qos_profiles(topic.qos),
            type_hash(topic.type)))
        return name

    def add_channel(self, channel: Channel) -> Channel:
        """Begin a connection for a channel of another bag, unless it has one; for write()."""
        self._check_open()
        if channel not in self._connections:
            self._connections[channel] = self._begin(channel)
        return channel

    def add_metadata(self, name: str, content: Mapping[str, str]) -> None:
        """Add one of MCAP's metadata records."""
        self._check_open()
        self.flush()
        self._writer.add_metadata(name, dict(content))

    def _begin(self, channel: Channel) -> tuple[int, Connection]:
        schema = channel.type, channel.definition, channel.definition_encoding
        if not channel.type:
            self._schemas[schema] = _NO_SCHEMA
        elif schema not in self._schemas:
            self._schemas[schema] = self._writer.register_schema(
                channel.type, channel.definition_encoding, channel.definition)
        number = self._writer.register_channel(
            channel.topic, channel.encoding, self._schemas[schema],
            {"offered_qos_profiles": channel.qos, "topic_type_hash": channel.type_hash})
        return number, Connection(channel)

    def write(
        self, name: str | Channel, data: bytes, log_time_ns: int,
        publish_time_ns: int | None = None, sequence: int = 0
    ) -> None:
        """Add one message, the bytes ``data`` of what add_topic() or add_channel() returned.

        ``log_time_ns`` is when it was received and ``publish_time_ns`` when it was sent (by
        default the same), both in ns since the epoch; messages may come in any order of time.
        Raises BagError for an unknown topic, for a time outside [0, 2^63) ns and after close(),
        and OSError where the disk fails.
        """
        self._check_open()
        if name not in self._connections:
            known = ", ".join(_topic(key) for key in self._connections)
            raise BagError(f"topic {_topic(name)} is not in bag {self.directory}, which has "
                           f"{known or 'none'}")
        sent_ns = log_time_ns if publish_time_ns is None else publish_time_ns
        for what, time_ns in (("log", log_time_ns), ("publish", sent_ns)):
            if not 0 <= time_ns <= _LAST_NS:
                raise BagError(f"{what} time of a message on {_topic(name)} is {time_ns} ns, "
                               f"but must be in [0, {_LAST_NS}] ns")
        size = len(data) + _RECORD_OVERHEAD
        if self._pending_bytes and self._pending_bytes + size > self._chunk_bytes:
            self.flush()
        if not self._pending_bytes:
            self._chunk_begun = monotonic()
        channel, connection = self._connections[name]
        self._writer.add_message(channel, log_time_ns, data, sent_ns, sequence)
        self._pending_bytes += size
        connection.message_count += 1
        self._first_ns = log_time_ns if self._first_ns is None else min(self._first_ns, log_time_ns)
        self._last_ns = log_time_ns if self._last_ns is None else max(self._last_ns, log_time_ns)
        self.flush_if_due()

    def flush_if_due(self) -> None:
        """Close the chunk if its first message has waited ``chunk_seconds``. Raises OSError."""
        if (self._pending_bytes and self.chunk_seconds is not None
                and monotonic() - self._chunk_begun >= self.chunk_seconds):
            self.flush()

    def flush(self) -> None:
        """Close the chunk and hand all bytes to the operating system. Raises OSError."""
        if self._pending_bytes:
            self._writer.flush()  # type: ignore[no-untyped-call]
            self._pending_bytes = 0

    def close(self) -> None:
        """Complete the MCAP file and write metadata.yaml; once closed, do nothing.

        Raises OSError where the disk fails; the bag is closed then, too.
        """
        if self._stream.closed:
            return
        information = bag_information(
            self.path.name, [connection for _, connection in self._connections.values()],
            self._first_ns, self._last_ns)
        with self._stream:
            self.flush()
            # A bare MCAP file opens with its QoS and distribution thanks to this record.
            self._writer.add_metadata("rosbag2", {"serialized_metadata": yaml_text(information)})
            self._writer.finish()  # type: ignore[no-untyped-call]
        unfinished = self.directory / "metadata.yaml.tmp"
        unfinished.write_text(yaml_text({"rosbag2_bagfile_information": information}),
                              encoding="utf-8")
        os.replace(unfinished, self.directory / "metadata.yaml")

    def __enter__(self) -> BagWriter:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        traceback: TracebackType | None,
    ) -> None:
        self.close()

    def _check_open(self) -> None:
        if self._stream.closed:
            raise BagError(f"bag {self.directory} is closed")


def _topic(name: str | Channel) -> str:
    return name if isinstance(name, str) else name.topic
