"""Queries handed to a process of their own, and its answers: nobody who asks has to wait."""

from __future__ import annotations

import json
import os
import queue
import subprocess
import sys
import threading
from collections import deque
from collections.abc import Callable
from pathlib import Path
from typing import Any

from .query import Present
from .reply import FAILED, refusal, to_text

_WORKER = "shimmy_ros.what_if.worker"
# A node has two seconds to end in all.
_PATIENCE_S = 0.5

Outgoing = queue.SimpleQueue[dict[str, Any] | None]


class AnswerProcess:
    """Starts a worker with the first query, and another one where that has died.

    ``notify`` is called in a thread of its own whenever there are answers to collect. Every query
    is answered: those on which a worker died, with the state "failed".
    """

    def __init__(self, notify: Callable[[], None]) -> None:
        self._notify = notify
        self._lock = threading.Lock()
        self._process: subprocess.Popen[str] | None = None
        self._outgoing: Outgoing = queue.SimpleQueue()
        self._reader: threading.Thread | None = None
        self._pending: dict[int, str] = {}
        self._answers: deque[str] = deque()
        self._ticket = 0
        self.deaths = 0
        """Workers that ended without having been asked to."""

    @property
    def pending(self) -> int:
        """Queries that are not answered in full."""
        return len(self._pending)

    def ask(self, text: str, present: Present, maximum_points: int) -> None:
        """Hand over a query. Raises OSError where no worker could be started."""
        with self._lock:
            if self._process is None:
                self._start()
            self._ticket += 1
            self._pending[self._ticket] = text
            self._outgoing.put({"ticket": self._ticket, "text": text,
                                "present": present.to_json(), "maximum_points": maximum_points})

    def next_answer(self) -> str | None:
        """The next part of an answer, as JSON, or None if there is none at present."""
        return self._answers.popleft() if self._answers else None

    def close(self) -> None:
        """End the worker; queries that are pending remain unanswered."""
        with self._lock:
            process, reader = self._process, self._reader
            self._pending.clear()
            self._outgoing.put(None)
        if process is None or reader is None:
            return
        reader.join(_PATIENCE_S)
        if reader.is_alive():
            process.kill()
            reader.join()

    def _start(self) -> None:
        # The worker has to import this very package, from wherever it was imported here.
        path = [str(Path(__file__).parents[2]), os.environ.get("PYTHONPATH", "")]
        process = subprocess.Popen(
            [sys.executable, "-m", _WORKER], stdin=subprocess.PIPE, stdout=subprocess.PIPE,
            encoding="ascii", env=os.environ | {"PYTHONPATH": os.pathsep.join(filter(None, path))})
        self._process = process
        self._outgoing = queue.SimpleQueue()
        threading.Thread(target=_write, args=(process, self._outgoing), daemon=True).start()
        self._reader = threading.Thread(target=self._read, args=(process,), daemon=True)
        self._reader.start()

    def _read(self, process: subprocess.Popen[str]) -> None:
        assert process.stdout is not None
        with process.stdout as stream:
            for line in stream:
                ticket, final, text = line.rstrip("\n").split(" ", 2)
                if final == "1":
                    self._pending.pop(int(ticket), None)
                self._answers.append(text)
                self._notify()
        status = process.wait()
        with self._lock:
            self._process = None
            self._outgoing.put(None)
            lost = list(self._pending.values())
            self._pending.clear()
            if status:
                self.deaths += 1
        for text in lost:
            self._answers.append(to_text(refusal(
                text, FAILED, "", f"the process that answers queries ended with status {status}")))
        if lost:
            self._notify()


def _write(process: subprocess.Popen[str], outgoing: Outgoing) -> None:
    assert process.stdin is not None
    try:
        with process.stdin as stream:
            while (request := outgoing.get()) is not None:
                stream.write(json.dumps(request) + "\n")
                stream.flush()
    except BrokenPipeError:
        # The worker has ended, which the reader sees as well.
        return
