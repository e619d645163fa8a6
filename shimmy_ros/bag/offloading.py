"""A bag written by a process of its own, so that encoding and compression take another core.

Run as a module, this is that process: it reads pickled batches of calls from stdin and answers with
what went wrong, if anything, on stdout.
"""

from __future__ import annotations

import fcntl
import os
import pickle
import subprocess
import sys
from collections.abc import Callable, Iterable, Mapping
from pathlib import Path
from typing import Any

from ..contract.records import MessageError
from ..contract.spec import Topic
from .errors import BagError
from .message import Channel
from .writer import BagWriter

_BATCH_BYTES = 1 << 20
# A bag smaller than this is written before a process has started.
_OFFLOADED_BYTES = 8 << 20
# What a message takes in a batch besides its data.
_MESSAGE_BYTES = 64
# What messages take that are yet to be made.
_UNMADE_BYTES = 4096
_END = "end"

Call = tuple[str, tuple[Any, ...]]


class OffloadedWriter:
    """Takes what BagWriter takes and makes the same bag; all is there once close() has returned.

    What BagWriter would refuse at once may be refused later, at close() at the latest.
    """

    def __init__(self, directory: Path, settings: Mapping[str, str] | None, chunk_bytes: int
                 ) -> None:
        """Begin a bag that is closed by close() and dropped by abandon()."""
        self._begin = str(directory), dict(settings or {}), chunk_bytes
        self._calls: list[Call] = []
        self._waiting_bytes = 0
        self._numbers: dict[str | Channel, int] = {}
        self._process: subprocess.Popen[bytes] | None = None

    def add_topic(self, topic: Topic, namespace: str) -> str:
        """As BagWriter.add_topic."""
        name = topic.resolved(namespace)
        self._numbers[name] = len(self._numbers)
        self._calls.append(("add_topic", (topic, namespace)))
        return name

    def add_channel(self, channel: Channel) -> Channel:
        """As BagWriter.add_channel."""
        if channel not in self._numbers:
            self._numbers[channel] = len(self._numbers)
            self._calls.append(("add_channel", (channel,)))
        return channel

    def add_metadata(self, name: str, content: Mapping[str, str]) -> None:
        """As BagWriter.add_metadata."""
        self._calls.append(("add_metadata", (name, dict(content))))

    def write(self, name: str | Channel, data: bytes, log_time_ns: int,
              publish_time_ns: int | None = None, sequence: int = 0) -> None:
        """As BagWriter.write. Raises BagError and OSError."""
        self._calls.append(
            ("write", (self._numbers[name], data, log_time_ns, publish_time_ns, sequence)))
        self._wait_for(len(data) + _MESSAGE_BYTES)

    def write_made(self, make: Callable[..., Iterable[tuple[str, bytes]]],
                   arguments: tuple[Any, ...], log_time_ns: int) -> None:
        """Write what ``make(*arguments)``, called where the bag is written, gives: topics and data.

        ``make`` is a function of a module. Raises BagError and OSError, and MessageError from it.
        """
        self._calls.append(("write_made", (make, arguments, log_time_ns)))
        self._wait_for(_UNMADE_BYTES)

    def close(self) -> None:
        """Complete the bag. Raises BagError, MessageError and OSError."""
        self._calls.append((_END, ()))
        if self._process is None:
            with _writer(*self._begin) as bag:
                _carry_out(self._calls, bag, [])
        else:
            self._send()
            self._finish()

    def abandon(self) -> None:
        """End the process, if there is one, whatever has become of the bag."""
        if self._process is not None:
            self._process.kill()
            self._process.communicate()
            self._process = None

    def _wait_for(self, size: int) -> None:
        self._waiting_bytes += size
        if self._waiting_bytes > (_OFFLOADED_BYTES if self._process is None else _BATCH_BYTES):
            self._send()

    def _send(self) -> None:
        if self._process is None:
            self._process = _start()
            self._dump(self._begin)
        self._dump(self._calls)
        self._calls = []
        self._waiting_bytes = 0

    def _dump(self, content: Any) -> None:
        assert self._process is not None
        assert self._process.stdin is not None
        try:
            pickle.dump(content, self._process.stdin, protocol=pickle.HIGHEST_PROTOCOL)
            self._process.stdin.flush()
        except BrokenPipeError:
            self._finish()
            raise

    def _finish(self) -> None:
        """Wait for the end of the process and raise what it ended with."""
        assert self._process is not None
        process, self._process = self._process, None
        answer, _ = process.communicate()
        if not answer:
            raise OSError(f"the process that wrote the bag ended with status {process.returncode}")
        error = pickle.loads(answer)
        if error is not None:
            raise error


def _writer(directory: str, settings: Mapping[str, str], chunk_bytes: int) -> BagWriter:
    return BagWriter(directory, settings, chunk_seconds=None, chunk_bytes=chunk_bytes)


def _carry_out(calls: list[Call], bag: BagWriter, names: list[str | Channel]) -> bool:
    """Make ``calls`` to ``bag``, whose topics and channels have ``names``; True at the end."""
    for method, arguments in calls:
        if method == "write":
            number, *rest = arguments
            bag.write(names[number], *rest)
        elif method == "write_made":
            make, made_from, log_time_ns = arguments
            for name, data in make(*made_from):
                bag.write(name, data, log_time_ns)
        elif method == "add_metadata":
            bag.add_metadata(*arguments)
        elif method == _END:
            bag.close()
            return True
        else:
            names.append(getattr(bag, method)(*arguments))
    return False


def _start() -> subprocess.Popen[bytes]:
    # A session of its own keeps a Ctrl-C on the terminal from ending the bag before it is closed.
    process = subprocess.Popen(
        [sys.executable, "-m", __name__], stdin=subprocess.PIPE, stdout=subprocess.PIPE,
        start_new_session=True, env=os.environ | {"PYTHONPATH": os.pathsep.join(sys.path)})
    assert process.stdin is not None
    if hasattr(fcntl, "F_SETPIPE_SZ"):
        fcntl.fcntl(process.stdin, fcntl.F_SETPIPE_SZ, _BATCH_BYTES)
    return process


def main() -> int:
    """Write the bag whose parts come on stdin; the answer on stdout is a pickled error or None."""
    error: Exception | None = None
    names: list[str | Channel] = []
    try:
        bag = _writer(*pickle.load(sys.stdin.buffer))
        while not _carry_out(pickle.load(sys.stdin.buffer), bag, names):
            pass
    except EOFError:
        return 1  # Whoever wanted the bag is gone.
    except (BagError, MessageError, OSError) as found:
        error = found
    pickle.dump(error, sys.stdout.buffer)
    return 0


if __name__ == "__main__":
    sys.exit(main())
