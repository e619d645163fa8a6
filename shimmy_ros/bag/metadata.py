"""What rosbag2 wants to know of a bag: metadata.yaml (version 9) and offered QoS profiles."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import yaml

from ..contract.spec import QoS
from .message import Channel

VERSION = 9
"""Of the layout of metadata.yaml, as ROS 2 Jazzy writes it."""

# rmw's infinite duration: no deadline, no lifespan, no lease.
_INFINITE = {"sec": 9223372036, "nsec": 854775807}
# What rosbag2 gives as the start of a bag without messages.
_NEVER_NS = 2**63 - 1


@dataclass
class Connection:
    """One recorded channel and the number of its messages."""

    channel: Channel
    message_count: int = 0


def qos_profiles(qos: QoS) -> str:
    """The YAML list of ``qos`` alone, as rosbag2 notes it for a channel."""
    profile = {
        "history": qos.history.value,
        "depth": qos.depth,
        "reliability": qos.reliability.value,
        "durability": qos.durability.value,
        "deadline": dict(_INFINITE),
        "lifespan": dict(_INFINITE),
        "liveliness": "automatic",
        "liveliness_lease_duration": dict(_INFINITE),
        "avoid_ros_namespace_conventions": False,
    }
    return yaml_text([profile]).rstrip()


def bag_information(
    file_name: str, connections: Sequence[Connection], first_ns: int | None, last_ns: int | None
) -> dict[str, Any]:
    """The content of ``rosbag2_bagfile_information`` for a bag of one MCAP file.

    ``first_ns`` and ``last_ns`` are the smallest and the largest log time, None in an empty bag.
    The compression is MCAP's own, of chunks, which rosbag2 counts as none.
    """
    topics = [
        {
            "topic_metadata": {
                "name": connection.channel.topic,
                "type": connection.channel.type,
                "serialization_format": connection.channel.encoding,
                "offered_qos_profiles": _listed(connection.channel.qos),
                "type_description_hash": connection.channel.type_hash,
            },
            "message_count": connection.message_count,
        }
        for connection in connections
    ]
    message_count = sum(connection.message_count for connection in connections)
    start = _NEVER_NS if first_ns is None else first_ns
    duration = 0 if first_ns is None or last_ns is None else last_ns - first_ns
    return {
        "version": VERSION,
        "storage_identifier": "mcap",
        "duration": {"nanoseconds": duration},
        "starting_time": {"nanoseconds_since_epoch": start},
        "message_count": message_count,
        "topics_with_message_count": topics,
        "compression_format": "",
        "compression_mode": "",
        "relative_file_paths": [file_name],
        "files": [
            {
                "path": file_name,
                "starting_time": {"nanoseconds_since_epoch": start},
                "duration": {"nanoseconds": duration},
                "message_count": message_count,
            }
        ],
        "custom_data": None,
        "ros_distro": "jazzy",
    }


def _listed(profiles: str) -> list[Any]:
    """The profiles of a channel as values; those of another bag may be unreadable."""
    try:
        listed = yaml.safe_load(profiles)
    except yaml.YAMLError:
        return []
    return listed if isinstance(listed, list) else []


def yaml_text(content: object) -> str:
    """``content`` as block YAML in the given order."""
    return yaml.safe_dump(content, sort_keys=False)
