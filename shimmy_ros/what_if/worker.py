"""Answers queries in a process of its own, so that they take no time from a node's.

Reads lines of JSON with ticket, text, present and maximum_points; writes lines of a ticket, 1 for a
final reply or else 0, and the answer. Ends when its input ends.
"""

from __future__ import annotations

import json
import os
import queue
import signal
import sys
import threading
from types import FrameType
from typing import Any, NoReturn, TextIO

from ..gear.parameters import ParameterError
from .desk import Desk
from .query import Cancel, Present
from .reading import read_query
from .reply import to_text
from .text import QueryError, read_mapping

_NICENESS = 10
# Computing time of one slice, after which its point is given up, since others wait.
_LONGEST_SLICE_S = 60.0
# A signal that comes at a bad time comes again after this.
_LATER_S = 0.002


def main() -> NoReturn:
    """Answer until standard input ends."""
    # Whoever stops the node with Ctrl-C means the node; this process follows it.
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    os.nice(_NICENESS)
    answers = sys.stdout
    # Nothing else may come between the answers.
    sys.stdout = sys.stderr
    desk = Desk()
    lines: queue.SimpleQueue[tuple[dict[str, Any], str | None]] = queue.SimpleQueue()
    targets: list[str] = []

    def interrupt(number: int, frame: FrameType | None) -> None:
        if _in_compiler(frame):
            signal.setitimer(signal.ITIMER_REAL, _LATER_S)
            return
        while targets:
            desk.interrupt(targets.pop())

    def give_up(number: int, frame: FrameType | None) -> None:
        if _in_compiler(frame):
            signal.setitimer(signal.ITIMER_VIRTUAL, _LATER_S)
            return
        desk.give_up(f"it took more than {_LONGEST_SLICE_S:g} s of computing")

    signal.signal(signal.SIGUSR1, interrupt)
    signal.signal(signal.SIGALRM, interrupt)
    signal.signal(signal.SIGVTALRM, give_up)
    worker = threading.get_ident()

    def read() -> None:
        for line in sys.stdin:
            request = json.loads(line)
            target = _cancelled(request)
            if target is not None:
                targets.append(target)
            lines.put((request, target))
            if target is not None:
                signal.pthread_kill(worker, signal.SIGUSR1)
        # Nobody is left to read answers.
        os._exit(0)

    threading.Thread(target=read, daemon=True).start()
    while True:
        while not desk.busy or not lines.empty():
            request, target = lines.get()
            if target is not None and target in targets:
                # A signal that is still to come must not end a later query with this id.
                targets.remove(target)
            _take(desk, request)
            _write(desk, answers)
        signal.setitimer(signal.ITIMER_VIRTUAL, _LONGEST_SLICE_S)
        desk.step()
        signal.setitimer(signal.ITIMER_VIRTUAL, 0.0)
        _write(desk, answers)


def _in_compiler(frame: FrameType | None) -> bool:
    """Whether ``frame`` is of numba, or called by it.

    Numba compiles, or unpacks arguments for compiled code; an exception there crashes the process.
    """
    while frame is not None:
        if str(frame.f_globals.get("__name__")).partition(".")[0] in ("numba", "llvmlite"):
            return True
        frame = frame.f_back
    return False


def _take(desk: Desk, request: dict[str, Any]) -> None:
    desk.take(request["ticket"], request["text"], Present.from_json(request["present"]),
              request["maximum_points"])


def _write(desk: Desk, answers: TextIO) -> None:
    for reply in desk.replies():
        answers.write(f"{reply.ticket} {int(reply.final)} {to_text(reply.answer)}\n")
    answers.flush()


def _cancelled(request: dict[str, Any]) -> str | None:
    """The id that a request cancels, if it does."""
    if "cancel" not in request["text"]:
        return None
    try:
        query = read_query(read_mapping(request["text"]), Present.from_json(request["present"]),
                           request["maximum_points"])
    except (QueryError, ParameterError):
        return None
    return query.target if isinstance(query, Cancel) else None


if __name__ == "__main__":
    main()
