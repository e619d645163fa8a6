"""CDR bytes to records, by rosbags' typestore.

Another sender may name frames, order joints, add joints and order bytes as it likes, so nothing
is assumed of the layout. Values are not judged: NaN passes.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray
from rosbags.serde import SerdeError

from .records import (
    JOINTS,
    GearResponse,
    Level,
    LimitCycleAmplitude,
    LimitCycleOrbit,
    MessageError,
    Status,
    TaxiVelocity,
)
from .typestore import (
    DIAGNOSTIC_ARRAY,
    FLOAT64,
    JOINT_STATE,
    JOINT_TRAJECTORY,
    STRING,
    TWIST_STAMPED,
    typestore,
)

_IN_ORDER = list(range(len(JOINTS)))


def decode_number(data: bytes) -> float:
    """The value of a std_msgs/Float64. Raises MessageError."""
    return float(_message(data, FLOAT64).data)


def decode_text(data: bytes) -> str:
    """The text of a std_msgs/String. Raises MessageError."""
    return str(_message(data, STRING).data)


def decode_taxi_velocity(data: bytes) -> TaxiVelocity:
    """The record of a geometry_msgs/TwistStamped. Raises MessageError."""
    message = _message(data, TWIST_STAMPED)
    return TaxiVelocity(_stamp(message), message.twist.linear.x)


def decode_gear_response(data: bytes) -> GearResponse:
    """The record of a sensor_msgs/JointState with position, velocity and effort.

    Joints are found by name. Raises MessageError.
    """
    message = _message(data, JOINT_STATE)
    order = _order(message.name)
    return GearResponse(_stamp(message), _pick(message, "position", order),
                        _pick(message, "velocity", order), _pick(message, "effort", order))


def decode_amplitude(data: bytes) -> LimitCycleAmplitude:
    """The record of a sensor_msgs/JointState with position and velocity.

    Joints are found by name. Raises MessageError.
    """
    message = _message(data, JOINT_STATE)
    order = _order(message.name)
    return LimitCycleAmplitude(_stamp(message), _pick(message, "position", order),
                               _pick(message, "velocity", order))


def decode_orbit(data: bytes) -> LimitCycleOrbit:
    """The record of a trajectory_msgs/JointTrajectory with positions and velocities.

    Joints are found by name. Raises MessageError.
    """
    message = _message(data, JOINT_TRAJECTORY)
    order = _order(message.joint_names)
    times = [_nanoseconds(point.time_from_start) for point in message.points]
    return LimitCycleOrbit(_stamp(message), np.array(times, np.int64),
                           _columns(message, "positions", order),
                           _columns(message, "velocities", order))


def decode_statuses(data: bytes) -> tuple[Status, ...]:
    """The records of a diagnostic_msgs/DiagnosticArray; of a repeated key the last value counts.

    Raises MessageError.
    """
    message = _message(data, DIAGNOSTIC_ARRAY)
    stamp_ns = _stamp(message)
    return tuple(
        Status(stamp_ns, status.name, status.hardware_id, _level(status.level), status.message,
               {item.key: item.value for item in status.values})
        for status in message.status)


def _message(data: bytes, type_name: str) -> Any:
    try:
        return typestore().deserialize_cdr(data, type_name)
    except SerdeError as error:
        raise MessageError(f"{len(data)} bytes are no {type_name}: {error}") from error


def _stamp(message: Any) -> int:
    return _nanoseconds(message.header.stamp)


def _nanoseconds(time: Any) -> int:
    if time.nanosec >= 10**9:
        raise MessageError(f"nanosec of a stamp is {time.nanosec}, but must be below 1000000000")
    return int(time.sec) * 10**9 + int(time.nanosec)


def _level(value: int) -> Level:
    try:
        return Level(value)
    except ValueError as error:
        raise MessageError(f"level of a status is {value}, but must be 0, 1, 2 or 3") from error


def _order(names: Sequence[str]) -> list[int]:
    """Where the joints of the contract stand among ``names``."""
    if tuple(names) == JOINTS:
        return _IN_ORDER
    for joint in JOINTS:
        if names.count(joint) != 1:
            # repr: a damaged name may hold anything, a line break as well.
            given = ", ".join(map(repr, names)) or "no names"
            raise MessageError(f"joint {joint} appears {names.count(joint)} times among {given}, "
                               "but must appear once")
    return [names.index(joint) for joint in JOINTS]


def _pick(message: Any, field: str, order: list[int]) -> tuple[float, ...]:
    values = getattr(message, field)
    if len(values) != len(message.name):
        raise MessageError(f"{field} of a JointState has {len(values)} values, but must have one "
                           f"for each of {len(message.name)} names")
    numbers = values.tolist()
    return tuple([numbers[index] for index in order])


def _columns(message: Any, field: str, order: list[int]) -> NDArray[np.float64]:
    width = len(message.joint_names)
    rows = [getattr(point, field) for point in message.points]
    for index, row in enumerate(rows):
        if len(row) != width:
            raise MessageError(f"{field} of point {index} of a JointTrajectory has {len(row)} "
                               f"values, but must have one for each of {width} names")
    return np.array(rows, np.float64).reshape(len(rows), width)[:, order]
