"""A query to a predictor that is running, from outside."""

from __future__ import annotations

import json
import time
import uuid
from collections import deque
from collections.abc import Callable, Iterator
from typing import Any

import rclpy
from rclpy.duration import Duration
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node

from ..contract.messages import CODECS
from ..contract.spec import load_contract
from ..what_if.reading import checked_id
from ..what_if.reply import REFUSED, UNDER_WAY, Json
from ..what_if.text import QueryError, read_mapping
from .interface import message_class, qos_profile

_QUERY, _ANSWER = "what_if/query", "what_if/answer"
_JOIN_TIMEOUT_S = 10.0
_FAREWELL_S = 5.0


def ask_node(text: str, namespace: str, go_on: Callable[[], bool]) -> Iterator[Json]:
    """The parts of the answer to a query, while ``go_on``; a query without an id gets one.

    One that is stopped early is cancelled. Raises ConnectionError where no predictor
    answers in ``namespace``.
    """
    try:
        content = read_mapping(text)
        name = checked_id(content) or f"ask-{uuid.uuid4().hex[:12]}"
    except QueryError as error:
        # Without an id its refusal could not be told from another's.
        yield {"id": None, "state": REFUSED, "where": error.where, "message": str(error)}
        return
    asker = _Asker(namespace)
    try:
        yield from asker.ask({**content, "id": name}, go_on)
    finally:
        asker.close()


class _Asker:
    """A node of its own context that sends queries and hears all answers."""

    def __init__(self, namespace: str) -> None:
        self._answers: deque[Json] = deque()
        self._context = rclpy.Context()
        rclpy.init(context=self._context, args=[])
        self._node = Node("asker", namespace=namespace, context=self._context)
        self._executor = SingleThreadedExecutor(context=self._context)
        self._executor.add_node(self._node)
        contract = load_contract()
        query, answer = (contract.topic(name) for name in (_QUERY, _ANSWER))
        self._topic = query.resolved(namespace)
        self._publisher = self._node.create_publisher(
            message_class(query.type), query.name, qos_profile(query.qos))
        self._subscription: Any = self._node.create_subscription(
            message_class(answer.type), answer.name, self._take, qos_profile(answer.qos), raw=True)

    def close(self) -> None:
        """Leave the graph."""
        self._executor.shutdown()
        self._node.destroy_node()
        self._context.try_shutdown()

    def ask(self, content: Json, go_on: Callable[[], bool]) -> Iterator[Json]:
        """Send the query and wait for all of its answer, while ``go_on``."""
        self._join(go_on)
        if not go_on():
            return
        name = content["id"]
        final = False
        try:
            self._send(content)
            while not final and go_on():
                self._executor.spin_once(timeout_sec=0.1)
                if not self._publisher.get_subscription_count():
                    raise ConnectionError(f"nobody listens to {self._topic} any more")
                while self._answers and not final:
                    answer = self._answers.popleft()
                    if answer["id"] == name:
                        final = answer["state"] != UNDER_WAY
                        yield answer
        finally:
            if not final:
                self._send({"cancel": name})
                # What is under way when its sender leaves may be lost.
                self._publisher.wait_for_all_acked(Duration(seconds=_FAREWELL_S))

    def _join(self, go_on: Callable[[], bool]) -> None:
        until = time.monotonic() + _JOIN_TIMEOUT_S
        # Whoever records hears queries, too, but does not answer.
        while go_on() and not (self._publisher.get_subscription_count()
                               and self._node.count_publishers(_ANSWER)
                               and self._subscription.get_publisher_count()):
            if time.monotonic() > until:
                raise ConnectionError(f"no predictor listens to {self._topic}; is it running, and "
                                      "in this ROS_DOMAIN_ID and discovery range?")
            self._executor.spin_once(timeout_sec=0.05)

    def _send(self, content: Json) -> None:
        self._publisher.publish(CODECS[_QUERY].encode(json.dumps(content)))

    def _take(self, data: bytes) -> None:
        self._answers.append(json.loads(CODECS[_ANSWER].decode(data)))
