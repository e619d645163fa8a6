"""From the contract to rclpy: message classes, QoS profiles, publishers and subscriptions.

Messages travel as the CDR bytes that the contract encodes, so that what is sent, what is recorded
and what a replay writes are the same bytes.
"""

from __future__ import annotations

from collections.abc import Callable
from importlib import import_module
from typing import Any

from rclpy.event_handler import SubscriptionEventCallbacks
from rclpy.lifecycle import LifecycleNode
from rclpy.qos import DurabilityPolicy, HistoryPolicy, QoSProfile, ReliabilityPolicy

from ..contract.spec import QoS, Topic, load_contract


def message_class(type_name: str) -> Any:
    """The class of a type such as ``sensor_msgs/msg/JointState`` or ``std_srvs/srv/Trigger``."""
    package, kind, name = type_name.split("/")
    return getattr(import_module(f"{package}.{kind}"), name)


def qos_profile(qos: QoS) -> QoSProfile:
    """The contract's QoS for rclpy."""
    return QoSProfile(
        reliability=ReliabilityPolicy[qos.reliability.name],
        durability=DurabilityPolicy[qos.durability.name],
        history=HistoryPolicy[qos.history.name],
        depth=qos.depth,
    )


def publisher(node: LifecycleNode, topic_name: str, gated: bool = True) -> Any:
    """A publisher of a topic of the contract; it takes bytes.

    A ``gated`` one is silent while the node is not active.
    """
    topic = load_contract().topic(topic_name)
    create = node.create_lifecycle_publisher if gated else node.create_publisher
    return create(message_class(topic.type), topic.name, qos_profile(topic.qos))


def subscription(node: LifecycleNode, topic: Topic, callback: Callable[[bytes], None],
                 recorder_depth: int | None = None) -> Any:
    """A subscription to a topic of the contract; ``callback`` gets bytes.

    A recorder has a queue of its own depth. It leaves warnings of an incompatible QoS to the other
    parties: each event that can be reported costs time whenever the node waits.
    """
    profile = qos_profile(topic.qos)
    events = None
    if recorder_depth is not None:
        profile.depth = recorder_depth
        events = SubscriptionEventCallbacks(use_default_callbacks=False)
    return node.create_subscription(message_class(topic.type), topic.name, callback, profile,
                                    event_callbacks=events, raw=True)
