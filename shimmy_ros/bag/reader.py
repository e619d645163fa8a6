"""Reads the messages of any ROS bag, as far as a damaged one goes.

rosbag2's MCAP and SQLite files, alone or in a directory, with or without metadata.yaml, in every
compression that rosbag2 knows, and ROS 1 bags.
"""

from __future__ import annotations

from collections.abc import Collection, Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path, PurePath
from tempfile import TemporaryDirectory

import yaml
from zstandard import ZstdDecompressor, ZstdError

from . import mcap_file, ros1_file, sqlite_file
from .errors import BagError
from .file import BagFile
from .mcap_file import McapFile
from .message import CDR, BagMessage, Channel
from .ros1_file import Ros1File
from .sqlite_file import SqliteFile

_KINDS: tuple[tuple[bytes, type[BagFile]], ...] = (
    (mcap_file.MAGIC, McapFile),
    (sqlite_file.MAGIC, SqliteFile),
    (ros1_file.MAGIC, Ros1File),
)
_ZSTD_MAGIC = b"\x28\xb5\x2f\xfd"
_ZSTD = ".zstd"
_SUFFIXES = (".mcap", ".db3")
_BLOCK_BYTES = 1 << 20


class BagMessages(Iterator[BagMessage]):
    """The messages of a bag: file by file and, within a file, by log time.

    The messages of an MCAP file or a ROS 1 bag that has no index, because its writer was killed,
    come as they were written. ``damage`` says, once the iteration has passed there, what is wrong
    with each file that ends early or cannot be read to its end; it is empty when the bag is whole.
    ``metadata`` has the contents of MCAP's metadata records by name, and ``fraction`` is the part
    of the bag that has been read, both as far as the iteration went.
    """

    def __init__(self, files: list[Path], topics: Collection[str] | None) -> None:
        """Read ``topics``, or all, of ``files``, one after the other."""
        self.damage: list[str] = []
        self.metadata: dict[str, dict[str, str]] = {}
        self._sizes = [file.stat().st_size for file in files]
        self._done = 0
        self._file: BagFile | None = None
        self._messages = self._read(files, topics)

    def __next__(self) -> BagMessage:
        return next(self._messages)

    @property
    def fraction(self) -> float:
        """The part of the bag that has been read, from 0 to 1."""
        within = 0.0
        if self._file is not None:
            within = self._file.fraction * self._sizes[0]
        total = self._done + sum(self._sizes)
        return (self._done + within) / total if total else 1.0

    def _read(self, files: list[Path], topics: Collection[str] | None) -> Iterator[BagMessage]:
        for path in files:
            try:
                with _open(path, self.damage) as self._file:
                    yield from self._read_file(self._file, path, topics)
            except BagError as error:
                # The files before and behind it are read all the same.
                self.damage.append(str(error))
            self._file = None
            self._done += self._sizes.pop(0)

    def _read_file(self, file: BagFile, path: Path, topics: Collection[str] | None
                   ) -> Iterator[BagMessage]:
        try:
            for message in file.messages(topics):
                try:
                    yield _uncompressed(message)
                except ZstdError as error:
                    self.damage.append(
                        f"a message on {message.topic} in {path} is damaged: {error}")
        finally:
            # What is read may be a decompressed copy.
            self.damage += [text.replace(str(file.path), str(path)) for text in file.damage]
            self.metadata |= file.metadata


class Bag:
    """A bag that exists; nothing but its list of files has been read."""

    def __init__(self, path: Path | str) -> None:
        """Raises BagError where there is no bag, and OSError where the disk fails."""
        self.path = Path(path)
        self._files = _files(self.path)
        for file in self._files:
            if not file.is_file():
                raise BagError(f"bag {path} lacks its file {file.name}")
            # A killed recorder may leave the last of several files with nothing in it.
            if not _is_compressed(file) and (len(self._files) == 1 or file.stat().st_size):
                _kind(file)

    def channels(self) -> tuple[Channel, ...]:
        """Every channel once, in the order of the files. Raises OSError.

        Reads all of a file that was cut, and else its index. Raises BagError where no file can be
        read.
        """
        found: dict[Channel, None] = {}
        damage: list[str] = []
        for path in self._files:
            try:
                with _open(path, damage) as file:
                    found |= dict.fromkeys(file.channels())
            except BagError as error:
                damage.append(str(error))
        if len(damage) >= len(self._files) and not found:
            raise BagError("; ".join(damage))
        return tuple(found)

    def messages(self, topics: Collection[str] | None = None) -> BagMessages:
        """The messages on ``topics`` (resolved names), or on all; iterating raises OSError."""
        return BagMessages(self._files, topics)


def read_messages(path: Path | str, topics: Collection[str] | None = None) -> BagMessages:
    """The messages of ``topics`` (resolved names), or of all, in a bag: a directory or a file.

    A directory without metadata.yaml, which a killed writer leaves, is read as well. Raises
    BagError where there is no bag, and OSError where the disk fails.
    """
    return Bag(path).messages(topics)


def _uncompressed(message: BagMessage) -> BagMessage:
    # A killed recorder leaves no metadata to tell that messages are compressed one by one, but no
    # CDR message begins like this.
    if message.data[:4] != _ZSTD_MAGIC or message.channel.encoding != CDR:
        return message
    return message._replace(data=ZstdDecompressor().decompressobj().decompress(message.data))


@contextmanager
def _open(path: Path, damage: list[str]) -> Iterator[BagFile]:
    """One file; one that is compressed as a whole is decompressed into a temporary directory."""
    with ExitStack() as stack:
        if _is_compressed(path):
            directory = stack.enter_context(TemporaryDirectory(prefix="shimmy_ros_"))
            path = _decompressed(path, Path(directory), damage)
        yield _kind(path)(path)


def _decompressed(path: Path, directory: Path, damage: list[str]) -> Path:
    target = directory / path.name.removesuffix(_ZSTD)
    with path.open("rb") as source, target.open("wb") as sink:
        reader = ZstdDecompressor().stream_reader(source, read_across_frames=True)
        try:
            while block := reader.read(_BLOCK_BYTES):
                sink.write(block)
        except ZstdError as error:
            damage.append(f"{path} is damaged: {error}")
    if not target.stat().st_size:
        raise BagError(f"{path} is cut off before its first message")
    return target


def _is_compressed(path: Path) -> bool:
    with path.open("rb") as stream:
        return stream.read(len(_ZSTD_MAGIC)) == _ZSTD_MAGIC


def _kind(path: Path) -> type[BagFile]:
    with path.open("rb") as stream:
        head = stream.read(16)
    for magic, kind in _KINDS:
        if head.startswith(magic):
            return kind
    raise BagError(f"{path} is no bag: it is neither an MCAP nor an SQLite file nor a ROS 1 bag")


def _files(path: Path) -> list[Path]:
    if path.is_file():
        return [path]
    if not path.is_dir():
        raise BagError(f"bag {path} does not exist")
    metadata = path / "metadata.yaml"
    if metadata.is_file():
        # Before its version 4, rosbag2 put the directory's name before the file's.
        return [path / PurePath(name).name for name in _file_names(metadata)]
    # Without metadata, rosbag2's numbering gives the order: bag_2.mcap comes before bag_10.mcap.
    found: dict[str, Path] = {}
    for file in sorted(path.iterdir(), reverse=True):
        # Of a file whose compression was cut short the uncompressed one, which comes later here.
        name = file.name.removesuffix(_ZSTD)
        if name.endswith(_SUFFIXES):
            found[name] = file
    if not found:
        raise BagError(f"bag {path} holds neither metadata.yaml nor an MCAP or SQLite file")
    return [found[name] for name in sorted(found, key=lambda name: (len(name), name))]


def _file_names(metadata: Path) -> list[str]:
    try:
        content = yaml.safe_load(metadata.read_text(encoding="utf-8"))
        names = content["rosbag2_bagfile_information"]["relative_file_paths"]
        return [str(name) for name in names]
    except (yaml.YAMLError, UnicodeDecodeError, LookupError, TypeError) as error:
        reason = " ".join(str(error).split())
        raise BagError(f"{metadata} is no metadata of a bag: {reason}") from error
