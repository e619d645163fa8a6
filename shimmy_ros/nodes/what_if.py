"""The predictor's what-if topics: queries in, parts of answers out."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from rclpy.lifecycle import LifecycleNode

from ..contract.messages import CODECS
from ..contract.records import Level, MessageError
from ..contract.spec import load_contract
from ..what_if.process import AnswerProcess
from ..what_if.query import Present
from ..what_if.reply import FAILED, REFUSED, refusal, to_text
from .interface import publisher, subscription

_QUERY, _ANSWER = "what_if/query", "what_if/answer"


class WhatIf:
    """Passes queries to a process of their own and publishes what comes back.

    The node's own answers never wait for one of these: a callback takes one query or publishes
    one part of an answer.
    """

    def __init__(self, node: LifecycleNode, present: Callable[[], Present | None],
                 maximum_points: Callable[[], int]) -> None:
        """``present`` gives the node's present state, or None while it is not active."""
        self._node = node
        self._present = present
        self._maximum_points = maximum_points
        self._received = 0
        self._ready = node.create_guard_condition(self._publish)
        self._process = AnswerProcess(self._ready.trigger)
        self._publisher: Any = None
        self._subscription: Any = None

    def open(self) -> None:
        """Create the topics."""
        self._publisher = publisher(self._node, _ANSWER, gated=False)
        self._subscription = subscription(
            self._node, load_contract().topic(_QUERY), self._take)

    def close(self) -> None:
        """Destroy them, and end the process."""
        if self._subscription is not None:
            self._node.destroy_subscription(self._subscription)
            self._subscription = None
        self._process.close()
        if self._publisher is not None:
            self._node.destroy_publisher(self._publisher)
            self._publisher = None

    def status(self) -> tuple[str, Level, str, dict[str, str]]:
        """A part of /diagnostics."""
        values = {"queries received": str(self._received),
                  "queries pending": str(self._process.pending),
                  "processes lost": str(self._process.deaths)}
        if self._process.deaths:
            return "what if", Level.WARN, "a process that answers queries was lost", values
        return "what if", Level.OK, "queries are answered", values

    def _take(self, data: bytes) -> None:
        self._received += 1
        text = ""
        try:
            text = CODECS[_QUERY].decode(data)
            present = self._present()
            if present is None:
                self._send(to_text(refusal(text, REFUSED, "", "the predictor is not active")))
            else:
                self._process.ask(text, present, self._maximum_points())
        except MessageError as error:
            self._send(to_text(refusal(text, REFUSED, "", str(error))))
        except OSError as error:
            self._send(to_text(refusal(
                text, FAILED, "", f"the process that answers queries did not start: {error}")))

    def _publish(self) -> None:
        text = self._process.next_answer()
        if text is not None and self._publisher is not None:
            self._send(text)
            # One at a time, so that other callbacks get their turn in between.
            self._ready.trigger()

    def _send(self, text: str) -> None:
        self._publisher.publish(CODECS[_ANSWER].encode(text))
