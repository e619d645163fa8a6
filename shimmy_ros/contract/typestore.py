"""The stock message types of ROS 2 Jazzy, without ROS: layout, definition text and type hash."""

from __future__ import annotations

from functools import lru_cache
from typing import Any

from rosbags.typesys import Stores, get_typestore
from rosbags.typesys.store import Typestore

FLOAT64 = "std_msgs/msg/Float64"
STRING = "std_msgs/msg/String"
TWIST_STAMPED = "geometry_msgs/msg/TwistStamped"
JOINT_STATE = "sensor_msgs/msg/JointState"
JOINT_TRAJECTORY = "trajectory_msgs/msg/JointTrajectory"
DIAGNOSTIC_ARRAY = "diagnostic_msgs/msg/DiagnosticArray"


@lru_cache(maxsize=1)
def typestore() -> Typestore:
    """The types of ROS 2 Jazzy; the first call makes them, which takes about 0.1 s."""
    return get_typestore(Stores.ROS2_JAZZY)


def new(type_name: str, *fields: Any) -> Any:
    """A message of ``type_name`` from all of its fields, in the order of its definition."""
    return typestore().types[type_name](*fields)


def serialize(message: Any) -> bytes:
    """The little-endian CDR bytes of a message."""
    return bytes(typestore().serialize_cdr(message, message.__msgtype__, little_endian=True))


def definition(type_name: str) -> str:
    """The .msg text of ``type_name``, followed by those of the types that it contains."""
    text, _ = typestore().generate_msgdef(type_name, ros_version=2)
    return text


def type_hash(type_name: str) -> str:
    """The RIHS01 hash (REP 2016) of ``type_name``."""
    return typestore().hash_rihs01(type_name)
