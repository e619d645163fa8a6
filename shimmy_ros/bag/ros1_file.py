"""Reads one ROS 1 bag (format 2.0): by its index where it has one, else as far as it goes.

Messages and channels leave as ROS 2 has them: CDR bytes, types named package/msg/Type.
"""

from __future__ import annotations

import bz2
import struct
from collections.abc import Collection, Iterator
from pathlib import Path
from typing import BinaryIO, NamedTuple

import lz4.frame  # type: ignore[import-untyped]
from rosbags.serde import SerdeError
from rosbags.typesys.store import Typestore

from .errors import BagError
from .file import BagFile
from .message import BagMessage, Channel
from .order import ChunkPlace, by_log_time
from .types import ros1_channel, ros1_types

MAGIC = b"#ROSBAG V2.0\n"

_MESSAGE, _BAG, _CHUNK, _CHUNK_INFO, _CONNECTION = 0x02, 0x03, 0x05, 0x06, 0x07
_U32 = struct.Struct("<I")
_U64 = struct.Struct("<Q")
_TIME = struct.Struct("<II")

_Fields = dict[bytes, bytes]


class _DamageError(Exception):
    """Bytes that are missing or wrong."""


# What decompressors and unpacking raise where bytes are wrong.
_DAMAGE = (_DamageError, struct.error, ValueError, OSError, EOFError, RuntimeError, LookupError,
           SerdeError, BagError)


class Ros1File(BagFile):
    """One ROS 1 bag; ``metadata`` is empty."""

    def channels(self) -> list[Channel]:
        """The channels, a damaged file's as far as they can be read. Raises BagError, OSError."""
        content = _Content(())
        with _Records(self.path) as records:
            if _index(records, content) is None:
                for _ in self._from_start(records, content, []):
                    pass
        return content.channels

    def messages(self, topics: Collection[str] | None) -> Iterator[BagMessage]:
        """The messages on ``topics`` or, with None, all of them. Raises BagError and OSError.

        In the order of log time where the file has an index, else in that of the file.
        """
        content = _Content(topics)
        with _Records(self.path) as records:
            chunks = _index(records, content)
            if chunks is None:
                yield from self._from_start(records, content, self.damage)
                return

            def load(place: int) -> list[BagMessage]:
                self.fraction = place / records.size
                try:
                    records.seek(place)
                    return list(content.of_chunk(*records.read()[1:]))
                except _DAMAGE as error:
                    self.damage.append(f"{self.path} is damaged in the chunk at byte {place}: "
                                       f"{_reason(error)}")
                    return []

            yield from by_log_time(chunks, load)

    def _from_start(self, records: _Records, content: _Content, damage: list[str]
                    ) -> Iterator[BagMessage]:
        records.seek(len(MAGIC))
        try:
            while not records.at_end:
                opcode, fields, data = records.read()
                self.fraction = records.place / records.size
                if opcode == _CHUNK:
                    yield from content.of_chunk(fields, data)
                else:
                    # The chunk that a killed writer had open says that it is empty; its records
                    # follow.
                    yield from content.of_record(opcode, fields, data)
        except _DAMAGE as error:
            damage.append(f"{self.path} is cut off or damaged after {content.count} messages: "
                          f"{_reason(error)}")
        else:
            damage.append(f"{self.path} is cut off after {content.count} messages")


class _Connection(NamedTuple):
    """A channel and its types; without them its messages stay as they are, in ROS 1's encoding."""

    channel: Channel
    types: Typestore | None


class _Content:
    """The connections that a file has declared so far, and how many messages went by."""

    def __init__(self, topics: Collection[str] | None) -> None:
        self.count = 0
        self._topics = topics
        self._connections: dict[bytes, _Connection] = {}
        self._wanted: dict[bytes, _Connection] = {}

    @property
    def channels(self) -> list[Channel]:
        """Each channel once, however many connections it has."""
        return list(dict.fromkeys(item.channel for item in self._connections.values()))

    def of_chunk(self, fields: _Fields, data: bytes) -> Iterator[BagMessage]:
        """The wanted messages of a chunk. Raises as _DAMAGE."""
        data = _decompressed(fields[b"compression"], data)
        at = 0
        while at < len(data):
            begin, end = _span(data, at)
            at = end + 4 + _U32.unpack_from(data, end)[0]
            if at > len(data):
                raise _DamageError("a record is longer than its chunk")
            header = _fields(data[begin:end])
            yield from self.of_record(header[b"op"][0], header, data[end + 4:at])

    def of_record(self, opcode: int, fields: _Fields, data: bytes) -> Iterator[BagMessage]:
        """The message of a record, if it is a wanted one. Raises as _DAMAGE."""
        if opcode == _MESSAGE:
            self.count += 1
            connection = self._wanted.get(fields[b"conn"])
            if connection is not None:
                yield _message(connection, _nanoseconds(fields[b"time"]), data)
            elif fields[b"conn"] not in self._connections:
                raise _DamageError("a message has no topic")
        elif opcode == _CONNECTION and fields[b"conn"] not in self._connections:
            self._add(fields, _fields(data))

    def _add(self, fields: _Fields, description: _Fields) -> None:
        topic, type_name = fields[b"topic"].decode(), description[b"type"].decode()
        definition = description[b"message_definition"].decode()
        try:
            channel = ros1_channel(topic, type_name, definition,
                                   description.get(b"latching") == b"1")
            connection = _Connection(channel, ros1_types(channel.type, definition))
        except BagError:
            connection = _Connection(Channel(topic, type_name, "ros1"), None)
        self._connections[fields[b"conn"]] = connection
        if self._topics is None or topic in self._topics:
            self._wanted[fields[b"conn"]] = connection


class _Records:
    """The records of a file."""

    def __init__(self, path: Path) -> None:
        self._stream: BinaryIO = path.open("rb")
        self.size = path.stat().st_size

    def __enter__(self) -> _Records:
        return self

    def __exit__(self, *_: object) -> None:
        self._stream.close()

    @property
    def place(self) -> int:
        return self._stream.tell()

    @property
    def at_end(self) -> bool:
        return self.place >= self.size

    def seek(self, place: int) -> None:
        self._stream.seek(place)

    def read(self) -> tuple[int, _Fields, bytes]:
        """Opcode, header and data of the next record. Raises as _DAMAGE."""
        fields = _fields(self._sized())
        return fields[b"op"][0], fields, self._sized()

    def _sized(self) -> bytes:
        size = _U32.unpack(self._stream.read(4))[0]
        if size > self.size - self.place:
            raise _DamageError("the file ends within a record")
        return self._stream.read(size)


def _index(records: _Records, content: _Content) -> list[ChunkPlace] | None:
    """The chunks of a bag that was closed, whose channels ``content`` learns, and else None.

    Raises BagError for what is encrypted.
    """
    chunks = []
    try:
        records.seek(len(MAGIC))
        _, fields, _ = records.read()
        if fields.get(b"encryptor"):
            raise BagError("a ROS 1 bag that is encrypted cannot be read")
        place = _U64.unpack(fields[b"index_pos"])[0]
        expected = _U32.unpack(fields[b"chunk_count"])[0]
        if place == 0:
            return None
        records.seek(place)
        while not records.at_end:
            opcode, fields, data = records.read()
            if opcode == _CONNECTION:
                for _ in content.of_record(opcode, fields, data):
                    pass
            elif opcode == _CHUNK_INFO:
                chunks.append((_nanoseconds(fields[b"start_time"]),
                               _U64.unpack(fields[b"chunk_pos"])[0]))
    except BagError:
        raise
    except _DAMAGE:
        return None
    return chunks if len(chunks) == expected else None


def _message(connection: _Connection, time_ns: int, data: bytes) -> BagMessage:
    if connection.types is not None:
        data = bytes(connection.types.ros1_to_cdr(data, connection.channel.type))
    return BagMessage(connection.channel, time_ns, time_ns, data)


def _span(data: bytes, at: int) -> tuple[int, int]:
    return at + 4, at + 4 + _U32.unpack_from(data, at)[0]


def _fields(header: bytes) -> _Fields:
    fields = {}
    at = 0
    while at < len(header):
        begin, at = _span(header, at)
        name, separator, value = header[begin:at].partition(b"=")
        if not separator or at > len(header):
            raise _DamageError("a record has no header")
        fields[name] = value
    return fields


def _decompressed(compression: bytes, data: bytes) -> bytes:
    if compression == b"none":
        return data
    if compression == b"bz2":
        return bz2.decompress(data)
    if compression == b"lz4":
        return bytes(lz4.frame.decompress(data))
    raise _DamageError(f"compression {compression.decode(errors='replace')} is not known")


def _nanoseconds(time: bytes) -> int:
    seconds, nanoseconds = _TIME.unpack(time)
    return int(seconds) * 10**9 + int(nanoseconds)


def _reason(error: Exception) -> str:
    return " ".join(str(error).split()) or type(error).__name__
