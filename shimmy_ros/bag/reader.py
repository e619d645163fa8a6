"""Reads the messages of a bag that holds MCAP files, as far as a damaged one goes."""

from __future__ import annotations

import struct
from collections.abc import Collection, Iterator
from io import BufferedReader, FileIO
from pathlib import Path
from typing import NamedTuple

import yaml
from mcap.exceptions import EndOfFile, McapError
from mcap.records import Channel, Message, Schema, Statistics
from mcap.stream_reader import StreamReader
from zstandard import ZstdError

from .errors import BagError

_MAGIC = b"\x89MCAP0\r\n"

# What the mcap library and the decompressors raise where bytes are missing or wrong. A wrong length
# can ask for more memory than there is.
_DAMAGE = (McapError, ZstdError, struct.error, ValueError, RuntimeError, OverflowError, MemoryError)


class BagMessage(NamedTuple):
    """One message as it was recorded: resolved topic name, package/msg/Type, log time, bytes."""

    topic: str
    type: str
    log_time_ns: int
    data: bytes


class BagMessages(Iterator[BagMessage]):
    """The messages of a bag, in the order in which they were written.

    ``damage`` says, once the iteration has passed there, what is wrong with each file that ends
    early or cannot be read to its end; it is empty when the bag is whole.
    """

    def __init__(self, files: list[Path], topics: Collection[str] | None) -> None:
        """Read ``topics``, or all, of ``files``, one after the other."""
        self.damage: list[str] = []
        self._messages = self._read(files, topics)

    def __next__(self) -> BagMessage:
        return next(self._messages)

    def _read(self, files: list[Path], topics: Collection[str] | None) -> Iterator[BagMessage]:
        for file in files:
            count = 0
            try:
                for message in _messages(file):
                    count += 1
                    if topics is None or message.topic in topics:
                        yield message
            except EndOfFile:
                self.damage.append(f"{file} is cut off after {count} messages")
            except _DAMAGE as error:
                reason = " ".join(str(error).split()) or type(error).__name__
                self.damage.append(f"{file} is damaged after {count} messages: {reason}")


def read_messages(path: Path | str, topics: Collection[str] | None = None) -> BagMessages:
    """The messages of ``topics`` (resolved names), or of all, in a bag directory or an MCAP file.

    A directory without metadata.yaml, which a killed writer leaves, is read as well. Raises
    BagError where there is no bag, and OSError where the disk fails.
    """
    files = _files(Path(path))
    for file in files:
        if not file.is_file():
            raise BagError(f"bag {path} lacks its file {file.name}")
        with file.open("rb") as stream:
            if stream.read(len(_MAGIC)) != _MAGIC:
                raise BagError(f"{file} is no MCAP file")
    return BagMessages(files, topics)


class _WholeReads(BufferedReader):
    """A file that raises EndOfFile instead of returning fewer bytes than were asked for."""

    def __init__(self, file: Path) -> None:
        super().__init__(FileIO(file))
        self._left = file.stat().st_size

    def read(self, size: int | None = -1, /) -> bytes:
        if size is None or not 0 <= size <= self._left:
            raise EndOfFile
        self._left -= size
        return super().read(size)


def _messages(file: Path) -> Iterator[BagMessage]:
    schemas: dict[int, Schema] = {}
    channels: dict[int, Channel] = {}
    count = 0
    with _WholeReads(file) as stream:
        for record in StreamReader(stream, validate_crcs=True, record_size_limit=None).records:
            if isinstance(record, Schema):
                schemas[record.id] = record
            elif isinstance(record, Channel):
                channels[record.id] = record
            elif isinstance(record, Message):
                channel = channels.get(record.channel_id)
                schema = schemas.get(channel.schema_id) if channel else None
                if channel is None or schema is None:
                    raise McapError(f"channel {record.channel_id} has no topic or no type")
                count += 1
                yield BagMessage(channel.topic, schema.name, record.log_time, record.data)
            elif isinstance(record, Statistics) and record.message_count != count:
                raise McapError(f"it was written with {record.message_count}")


def _files(path: Path) -> list[Path]:
    if path.is_file():
        return [path]
    if not path.is_dir():
        raise BagError(f"bag {path} does not exist")
    metadata = path / "metadata.yaml"
    if metadata.is_file():
        return [path / name for name in _file_names(metadata)]
    # Without metadata, rosbag2's numbering gives the order: bag_2.mcap comes before bag_10.mcap.
    files = sorted(path.glob("*.mcap"), key=lambda file: (len(file.name), file.name))
    if not files:
        raise BagError(f"bag {path} holds neither metadata.yaml nor an MCAP file")
    return files


def _file_names(metadata: Path) -> list[str]:
    try:
        content = yaml.safe_load(metadata.read_text(encoding="utf-8"))
        names = content["rosbag2_bagfile_information"]["relative_file_paths"]
        return [str(name) for name in names]
    except (yaml.YAMLError, UnicodeDecodeError, LookupError, TypeError) as error:
        reason = " ".join(str(error).split())
        raise BagError(f"{metadata} is no metadata of a bag: {reason}") from error
