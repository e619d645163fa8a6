"""The rig of the demo: plays a velocity history to the nodes, sets the damper, gives kicks."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import rclpy
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node

from ..contract.messages import CODECS
from ..contract.records import GearResponse, TaxiVelocity
from ..contract.spec import load_contract
from .interface import message_class, qos_profile

_RESPONSE = "gear_response"
# The swivel is quiet when it stayed below this for so long; then, as a runway's unevenness would,
# a kick gives shimmy another chance to start.
_QUIET_RAD = 2e-3
_QUIET_S = 1.0
_KICK_PERIOD_S = 4.0
# The last sample has to arrive, to be answered and to be recorded.
_LAST_ANSWER_S = 0.5
# The predictor compiles its solver before it listens, once after an installation.
_JOIN_TIMEOUT_S = 180.0


class RigError(RuntimeError):
    """The nodes under test are not there, or went away."""


@dataclass(frozen=True)
class Play:
    """What a rig does: velocities [m/s] at times [s from the start], and damper changes.

    ``damper_changes`` maps a time [s] to new values by their names in the parameter file.
    """

    time: Sequence[float]
    velocity: Sequence[float]
    damper_changes: Mapping[float, Mapping[str, float]] = field(default_factory=dict)


class Rig:
    """A node of its own context that plays to the predictor and the simulator of a namespace."""

    def __init__(self, namespace: str) -> None:
        self._context = rclpy.Context()
        rclpy.init(context=self._context)
        self._node = Node("rig", namespace=namespace, context=self._context)
        self._executor = SingleThreadedExecutor(context=self._context)
        self._executor.add_node(self._node)
        contract = load_contract()
        self._publishers: dict[str, Any] = {
            topic.name: self._node.create_publisher(
                message_class(topic.type), topic.name, qos_profile(topic.qos))
            for topic in contract.published_by("rig")
        }
        response = contract.topic(_RESPONSE)
        self._node.create_subscription(
            message_class(response.type), _RESPONSE, self._on_response,
            qos_profile(response.qos), raw=True)
        trigger = message_class("std_srvs/srv/Trigger")
        self._kick = self._node.create_client(trigger, "simulator/kick")
        self._request = trigger.Request()
        self._restless_at = time.monotonic()

    def close(self) -> None:
        """Leave the graph."""
        self._executor.shutdown()
        self._node.destroy_node()
        self._context.try_shutdown()

    def wait_for_nodes(self, go_on: Callable[[], bool]) -> None:
        """Wait until every input has its listeners, or until ``go_on`` is false.

        The velocity goes to the predictor, the simulator and the simulator's bag. Raises RigError.
        """
        until = time.monotonic() + _JOIN_TIMEOUT_S
        while go_on() and not (
                all(p.get_subscription_count() >= 3 for p in self._publishers.values())
                and self._kick.service_is_ready()):
            self._executor.spin_once(timeout_sec=0.05)
            if time.monotonic() > until:
                raise RigError(f"predictor and simulator did not join in {_JOIN_TIMEOUT_S:g} s")

    def play(self, play: Play, go_on: Callable[[], bool], progress: Callable[[float], None]
             ) -> None:
        """Send everything at its time, while ``go_on``; ``progress`` gets the time played [s]."""
        begun = time.monotonic()
        changes = sorted(play.damper_changes.items())
        kicked_at = -_KICK_PERIOD_S
        for due, velocity in zip(play.time, play.velocity, strict=True):
            while go_on() and (now := time.monotonic() - begun) < due:
                self._executor.spin_once(timeout_sec=min(0.02, due - now))
            if not go_on():
                return
            while changes and changes[0][0] <= due:
                for name, value in changes.pop(0)[1].items():
                    self._send(f"damper/{name}", value)
            stamp = self._node.get_clock().now().nanoseconds
            self._send("taxi_velocity", TaxiVelocity(stamp, velocity))
            quiet = time.monotonic() - self._restless_at > _QUIET_S
            if quiet and due - kicked_at >= _KICK_PERIOD_S:
                self._kick.call_async(self._request)
                kicked_at = due
            progress(due)
        self._spin_for(_LAST_ANSWER_S)

    def _spin_for(self, seconds: float) -> None:
        end = time.monotonic() + seconds
        while (left := end - time.monotonic()) > 0.0:
            self._executor.spin_once(timeout_sec=left)

    def _send(self, topic: str, record: Any) -> None:
        self._publishers[topic].publish(CODECS[topic].encode(record))

    def _on_response(self, data: bytes) -> None:
        response: GearResponse = CODECS[_RESPONSE].decode(data)
        if abs(response.position[1]) > _QUIET_RAD:
            self._restless_at = time.monotonic()
