"""Takes queries, works on all of them in turns, and hands out answers.

An answer comes in parts, each a mapping for JSON: id, state, part, done, of, points, and in the
first part the inputs used. What cannot be answered is refused, with the place and the reason.
"""

from __future__ import annotations

import sys
import traceback
from collections import deque
from collections.abc import Iterator
from dataclasses import dataclass, field
from time import monotonic

from .evaluate import TooLongError, evaluate
from .query import Cancel, Present, Query
from .reading import id_of, read_query
from .reply import CANCELLED, COMPLETE, FAILED, REFUSED, UNDER_WAY, Json, Reply
from .text import QueryError, brief, read_mapping

_MOST_QUERIES = 1000
_TURN_S = 0.02
_PART_S = 0.5
_PART_POINTS = 100


class Interrupted(BaseException):
    """Raised from a signal handler into a slice of a query that was cancelled."""


@dataclass
class _Active:
    """A query that is being worked on."""

    ticket: int
    query: Query
    work: Iterator[Json | None]
    sent_s: float
    parts: int = 0
    done: int = 0
    points: list[Json] = field(default_factory=list)


class Desk:
    """Queries under way, and replies not yet collected. Queries are told apart by tickets."""

    def __init__(self) -> None:
        self._active: deque[_Active] = deque()
        self._replies: deque[Reply] = deque()
        self._running: _Active | None = None

    @property
    def busy(self) -> bool:
        """Whether there is work to do."""
        return bool(self._active)

    def take(self, ticket: int, text: str, present: Present, maximum_points: int) -> None:
        """Accept a query, cancel one, or refuse; never raises for anything in ``text``."""
        name = None
        try:
            content = read_mapping(text)
            name = id_of(content)
            query = read_query(content, present, maximum_points)
            if isinstance(query, Cancel):
                self._cancel(query.target)
                self._replies.append(Reply(ticket, True, {
                    "id": name, "state": COMPLETE, "cancelled": query.target}))
                return
            self._check_room(query)
        except QueryError as error:
            self._replies.append(Reply(ticket, True, {
                "id": name, "state": REFUSED, "where": error.where, "message": str(error)}))
            return
        self._active.append(_Active(ticket, query, evaluate(query), monotonic()))

    def step(self) -> None:
        """Work on one query for a few hundredths of a second, or for one long slice."""
        try:
            if self._active:
                self._turn(self._active[0])
        except Interrupted:
            # The cancellation waits to be taken.
            self._running = None

    def _turn(self, active: _Active) -> None:
        end = monotonic() + _TURN_S
        try:
            self._running = active
            for item in active.work:
                if item is not None:
                    active.points.append(item)
                    active.done += 1
                now = monotonic()
                due = (len(active.points) >= _PART_POINTS
                       or (active.points and now - active.sent_s >= _PART_S))
                if due and active.done < len(active.query):
                    self._reply(active, UNDER_WAY)
                if now >= end:
                    self._active.rotate(-1)
                    return
        except (Exception, TooLongError) as error:
            # A defect of the solver: whoever asked is told, and others get their answers.
            traceback.print_exc(file=sys.stderr)
            self._active.remove(active)
            self._reply(active, FAILED, message=f"the solver failed: {error!r}")
            return
        finally:
            self._running = None
        self._active.remove(active)
        self._reply(active, COMPLETE)

    def replies(self) -> Iterator[Reply]:
        """Everything there is to hand out, each reply once."""
        while self._replies:
            yield self._replies.popleft()

    def interrupt(self, target: str) -> None:
        """End the slice that is running, if it is one of the query with this id.

        For the handler of a signal in the thread of step(); take() has to get the cancellation
        before the next step(). Raises Interrupted.
        """
        if self._running is not None and self._running.query.id == target:
            raise Interrupted

    def give_up(self, reason: str) -> None:
        """End the slice that is running without its result; the query goes on.

        For the handler of a signal in the thread of step(). Raises TooLongError.
        """
        if self._running is not None:
            raise TooLongError(reason)

    def _check_room(self, query: Query) -> None:
        if query.id is not None and any(item.query.id == query.id for item in self._active):
            raise QueryError("id", f"id {brief(query.id)} is that of a query under way")
        if len(self._active) >= _MOST_QUERIES:
            raise QueryError("", f"{_MOST_QUERIES} queries are under way; wait for one of them")

    def _cancel(self, target: str) -> None:
        for active in self._active:
            if active.query.id == target:
                self._active.remove(active)
                self._reply(active, CANCELLED)
                return
        raise QueryError("cancel", f"no query with the id {brief(target)} is under way")

    def _reply(self, active: _Active, state: str, **more: str) -> None:
        active.parts += 1
        answer: Json = {"id": active.query.id, "state": state, "part": active.parts,
                        "done": active.done, "of": len(active.query)}
        if active.parts == 1:
            answer["inputs"] = active.query.inputs()
        self._replies.append(Reply(active.ticket, state != UNDER_WAY, {
            **answer, **more, "points": active.points}))
        active.points = []
        active.sent_s = monotonic()
