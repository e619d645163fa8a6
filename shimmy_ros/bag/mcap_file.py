"""Reads one MCAP file: by its index where it has one, else from the start as far as it goes."""

from __future__ import annotations

import struct
import zlib
from collections.abc import Collection, Iterator
from io import BufferedReader, BytesIO, FileIO
from pathlib import Path
from typing import NamedTuple

from mcap.data_stream import ReadDataStream
from mcap.exceptions import EndOfFile, McapError
from mcap.opcode import Opcode
from mcap.records import Channel as McapChannel
from mcap.records import (
    Chunk,
    ChunkIndex,
    Footer,
    Message,
    Metadata,
    MetadataIndex,
    Schema,
    Statistics,
)
from mcap.stream_reader import StreamReader, get_chunk_data_stream
from zstandard import ZstdError

from .file import BagFile
from .message import BagMessage, Channel
from .order import ChunkPlace, by_log_time

MAGIC = b"\x89MCAP0\r\n"

# What the mcap library and the decompressors raise where bytes are missing or wrong. A wrong length
# can ask for more memory than there is.
_DAMAGE = (McapError, ZstdError, struct.error, ValueError, RuntimeError, OverflowError, MemoryError)

_RECORD = struct.Struct("<BQ")
_MESSAGE = struct.Struct("<HIQQ")
_MESSAGE_OPCODE = int(Opcode.MESSAGE)
_FOOTER_BYTES = 9 + 20 + len(MAGIC)


class McapFile(BagFile):
    """One MCAP file."""

    def channels(self) -> list[Channel]:
        """The channels, damaged files' as far as they can be read. Raises OSError."""
        content = _Content(())
        with _WholeReads(self.path) as stream:
            if _index(stream, content) is None:
                content = _Content(())
                stream.seek(0)
                for _ in self._from_start(stream, content, []):
                    pass
        return content.channels

    def messages(self, topics: Collection[str] | None) -> Iterator[BagMessage]:
        """The messages on ``topics`` or, with None, all of them. Raises OSError.

        In the order of log time where the file has an index, else in that of the file.
        """
        with _WholeReads(self.path) as stream:
            content = _Content(topics)
            index = _index(stream, content)
            if index is None:
                stream.seek(0)
                content = _Content(topics)
            self.metadata = content.metadata
            if index is None:
                yield from self._from_start(stream, content, self.damage)
            else:
                yield from self._by_index(stream, content, index)

    def _from_start(self, stream: _WholeReads, content: _Content, damage: list[str]
                    ) -> Iterator[BagMessage]:
        size = max(1, stream.size)
        try:
            records = StreamReader(stream, emit_chunks=True, validate_crcs=True,
                                   record_size_limit=None).records
            for record in records:
                if isinstance(record, Chunk):
                    yield from self._of_chunk(content, record, damage)
                    self.fraction = stream.tell() / size
                elif isinstance(record, Message):
                    yield from content.of_record(record)
                else:
                    content.learn(record)
        except EndOfFile:
            damage.append(f"{self.path} is cut off after {content.count} messages")
        except _DAMAGE as error:
            damage.append(f"{self.path} is damaged after {content.count} messages: "
                          f"{_reason(error)}")

    def _by_index(self, stream: _WholeReads, content: _Content, index: _Index
                  ) -> Iterator[BagMessage]:
        def load(place: int) -> list[BagMessage]:
            self.fraction = place / stream.size
            try:
                record = _record(stream, place)
                if not isinstance(record, Chunk):
                    raise McapError("it is none")
            except _DAMAGE as error:
                self.damage.append(f"{self.path} is damaged in a chunk: {_reason(error)}")
                return []
            return list(self._of_chunk(content, record, self.damage))

        yield from by_log_time(index.chunks, load)
        if not self.damage and content.count != index.message_count:
            self.damage.append(f"{self.path} is damaged after {content.count} messages: it was "
                               f"written with {index.message_count}")

    def _of_chunk(self, content: _Content, chunk: Chunk, damage: list[str]
                  ) -> Iterator[BagMessage]:
        """The wanted messages of a chunk; one that is damaged does not end the file."""
        try:
            yield from content.of_chunk(chunk)
        except _DAMAGE as error:
            damage.append(f"{self.path} is damaged in the chunk behind message {content.count}: "
                          f"{_reason(error)}")


class _Content:
    """The channels that a file has declared so far, and how many messages went by."""

    def __init__(self, topics: Collection[str] | None) -> None:
        self.count = 0
        self.metadata: dict[str, dict[str, str]] = {}
        self._topics = topics
        self._schemas: dict[int, Schema] = {}
        self._channels: dict[int, Channel] = {}
        self._wanted: dict[int, Channel] = {}

    @property
    def channels(self) -> list[Channel]:
        """Each channel once."""
        return list(dict.fromkeys(self._channels.values()))

    def learn(self, record: object) -> None:
        """Take note of a schema, a channel, a metadata record or the statistics."""
        if isinstance(record, Schema):
            self._schemas[record.id] = record
        elif isinstance(record, McapChannel):
            if record.id not in self._channels:
                self._add(record)
        elif isinstance(record, Metadata):
            self.metadata[record.name] = record.metadata
        elif isinstance(record, Statistics) and record.message_count != self.count:
            raise McapError(f"it was written with {record.message_count}")

    def of_record(self, record: Message) -> Iterator[BagMessage]:
        """The message of a record outside of chunks, if it is wanted."""
        self._check(record.channel_id)
        self.count += 1
        channel = self._wanted.get(record.channel_id)
        if channel is not None:
            yield BagMessage(channel, record.log_time, record.publish_time, record.data,
                             record.sequence)

    def of_chunk(self, chunk: Chunk) -> Iterator[BagMessage]:
        """The wanted messages of a chunk.

        Only what is wanted becomes an object: a bag is mostly other topics. Raises as _DAMAGE.
        """
        stream, size = get_chunk_data_stream(chunk, validate_crc=True)
        data = stream.read(size)
        known, wanted = self._channels, self._wanted
        at = 0
        while at < size:
            opcode, length = _RECORD.unpack_from(data, at)
            begin = at + 9
            at = begin + length
            if at > size:
                raise McapError("a record is longer than its chunk")
            if opcode == _MESSAGE_OPCODE:
                channel_id, sequence, log_time, publish_time = _MESSAGE.unpack_from(data, begin)
                channel = wanted.get(channel_id)
                if channel is None and channel_id not in known:
                    self._check(channel_id)
                self.count += 1
                if channel is not None:
                    yield BagMessage(channel, log_time, publish_time,
                                     data[begin + _MESSAGE.size:at], sequence)
            elif opcode == Opcode.SCHEMA:
                self.learn(Schema.read(ReadDataStream(BytesIO(data[begin:at]))))
            elif opcode == Opcode.CHANNEL:
                self.learn(McapChannel.read(ReadDataStream(BytesIO(data[begin:at]))))

    def _add(self, record: McapChannel) -> None:
        schema = self._schemas.get(record.schema_id)
        if schema is None and record.schema_id != 0:
            raise McapError(f"channel {record.id} has no type")
        channel = Channel(
            record.topic, "" if schema is None else schema.name, record.message_encoding,
            b"" if schema is None else schema.data, "" if schema is None else schema.encoding,
            record.metadata.get("offered_qos_profiles", ""),
            record.metadata.get("topic_type_hash", ""))
        self._channels[record.id] = channel
        if self._topics is None or channel.topic in self._topics:
            self._wanted[record.id] = channel

    def _check(self, channel_id: int) -> None:
        if channel_id not in self._channels:
            raise McapError(f"channel {channel_id} has no topic")


class _Index(NamedTuple):
    """The chunks, and the number of messages in all of them."""

    chunks: list[ChunkPlace]
    message_count: int


def _index(stream: _WholeReads, content: _Content) -> _Index | None:
    """The index of a whole file with chunks, whose channels ``content`` learns; None without.

    None for a file that was cut or whose index is damaged: it has to be read from the start.
    """
    statistics: Statistics | None = None
    chunks: list[ChunkPlace] = []
    try:
        for record in StreamReader(BytesIO(_summary(stream)), skip_magic=True).records:
            if isinstance(record, ChunkIndex):
                chunks.append((record.message_start_time, record.chunk_start_offset))
            elif isinstance(record, MetadataIndex):
                content.learn(_record(stream, record.offset))
            elif isinstance(record, Statistics):
                statistics = record
            else:
                content.learn(record)
    except _DAMAGE:
        return None
    if (statistics is None or not chunks or len(chunks) != statistics.chunk_count
            or len(content.channels) < statistics.channel_count):
        return None
    return _Index(chunks, statistics.message_count)


def _summary(stream: _WholeReads) -> bytes:
    """The records of the summary section, followed by the footer. Raises as _DAMAGE."""
    if stream.size < _FOOTER_BYTES:
        raise EndOfFile
    stream.seek(stream.size - _FOOTER_BYTES)
    end = stream.read(_FOOTER_BYTES)
    footer = Footer.read(ReadDataStream(BytesIO(end[9:])))
    begin = footer.summary_start
    if end[-len(MAGIC):] != MAGIC or not 0 < begin <= stream.size - _FOOTER_BYTES:
        raise McapError("there is no summary")
    stream.seek(begin)
    summary = stream.read(stream.size - begin)
    if footer.summary_crc not in (0, zlib.crc32(summary[:-len(MAGIC) - 4])):
        raise McapError("the summary is damaged")
    return summary


def _record(stream: _WholeReads, place: int) -> object:
    """The record at a place of the file. Raises as _DAMAGE."""
    stream.seek(place)
    return next(StreamReader(stream, skip_magic=True, emit_chunks=True,
                             record_size_limit=None).records)


class _WholeReads(BufferedReader):
    """A file that raises EndOfFile instead of returning fewer bytes than were asked for."""

    def __init__(self, file: Path) -> None:
        super().__init__(FileIO(file))
        self.size = file.stat().st_size

    def read(self, size: int | None = -1, /) -> bytes:
        if size is None or not 0 <= size <= self.size - self.tell():
            raise EndOfFile
        return super().read(size)


def _reason(error: Exception) -> str:
    return " ".join(str(error).split()) or type(error).__name__
