"""Records to CDR bytes.

rosbags' typestore lays out the parts of a message that never change, once per process; each record
only adds its numbers, which makes encoding a few microseconds instead of tens. The tests hold the
bytes against the typestore's own.
"""

from __future__ import annotations

import struct
from collections.abc import Sequence
from functools import lru_cache
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from .records import (
    JOINTS,
    GearResponse,
    LimitCycleAmplitude,
    LimitCycleOrbit,
    MessageError,
    Status,
    TaxiVelocity,
)
from .typestore import (
    DIAGNOSTIC_ARRAY,
    JOINT_STATE,
    JOINT_TRAJECTORY,
    TWIST_STAMPED,
    new,
    serialize,
)

FRAME = "base_link"
"""frame_id of encoded taxi velocities: the body frame of REP 105, x forward."""

ENCAPSULATION = b"\x00\x01\x00\x00"
_NUMBER = struct.Struct("<4sd")
_LENGTH = struct.Struct("<I")
_PADDING = (b"", b"\0", b"\0\0", b"\0\0\0")
_COUNT = len(JOINTS)
_VALUES = f"{_COUNT}d"

# A JointTrajectoryPoint: two sequences of numbers, two empty ones, time_from_start. CDR pads each
# number to a multiple of 8 bytes; behind these joint names the first point alone needs no padding.
_POINT = np.dtype([
    ("positions_length", "<u4"), ("positions_padding", "<u4"), ("positions", "<f8", _COUNT),
    ("velocities_length", "<u4"), ("velocities_padding", "<u4"), ("velocities", "<f8", _COUNT),
    ("accelerations_length", "<u4"), ("effort_length", "<u4"), ("sec", "<i4"), ("nanosec", "<u4"),
])
_LONGEST_NS = 2**31 * 10**9


class _Layout(NamedTuple):
    """A stamped message: encapsulation, stamp, ``fixed`` bytes, and numbers to the end."""

    numbers: struct.Struct
    fixed: bytes

    def pack(self, stamp_ns: int, *numbers: float) -> bytes:
        """The message's bytes. Raises MessageError."""
        try:
            return self.numbers.pack(ENCAPSULATION, *divmod(stamp_ns, 10**9), self.fixed, *numbers)
        except struct.error as error:
            raise MessageError(
                f"a record with stamp {stamp_ns} ns cannot be sent: {error}") from error


def _layout(message: Any, numbers: str) -> _Layout:
    """The layout of ``message``, which ends with ``numbers``, a format of the struct module."""
    data = serialize(message)
    fixed = data[12:len(data) - struct.calcsize(f"<{numbers}")]
    return _Layout(struct.Struct(f"<4siI{len(fixed)}s{numbers}"), fixed)


def _header(frame: str = "") -> Any:
    return new("std_msgs/msg/Header", new("builtin_interfaces/msg/Time", 0, 0), frame)


@lru_cache(maxsize=1)
def _taxi_velocity_layout() -> _Layout:
    zero = new("geometry_msgs/msg/Vector3", 0.0, 0.0, 0.0)
    twist = new("geometry_msgs/msg/Twist", zero, zero)
    return _layout(new(TWIST_STAMPED, _header(FRAME), twist), "6d")


@lru_cache(maxsize=2)
def _joint_state_layout(with_effort: bool) -> _Layout:
    values = np.zeros(_COUNT)
    effort = values if with_effort else np.zeros(0)
    message = new(JOINT_STATE, _header(), list(JOINTS), values, values, effort)
    return _layout(message, f"{_VALUES}I4x{_VALUES}I" + (f"4x{_VALUES}" if with_effort else ""))


@lru_cache(maxsize=1)
def _orbit_layout() -> _Layout:
    return _layout(new(JOINT_TRAJECTORY, _header(), list(JOINTS), []), "I")


@lru_cache(maxsize=8)
def _points(count: int) -> NDArray[np.void]:
    """Points of an orbit, without their numbers."""
    points = np.zeros(count, _POINT)
    points["positions_length"] = points["velocities_length"] = _COUNT
    return points


@lru_cache(maxsize=1)
def _status_layout() -> _Layout:
    return _layout(new(DIAGNOSTIC_ARRAY, _header(), []), "I")


def encode_number(value: float) -> bytes:
    """The std_msgs/Float64 that holds ``value``. Raises MessageError for what is no number."""
    try:
        return _NUMBER.pack(ENCAPSULATION, value)
    except struct.error as error:
        raise MessageError(f"{value!r} cannot be sent as a number: {error}") from error


def encode_text(text: str) -> bytes:
    """The std_msgs/String that holds ``text``. Raises MessageError for what is no Unicode."""
    try:
        return ENCAPSULATION + _string(text)
    except UnicodeEncodeError as error:
        raise MessageError(f"a text cannot be sent: {error}") from error


def encode_taxi_velocity(record: TaxiVelocity) -> bytes:
    """The geometry_msgs/TwistStamped of ``record``. Raises MessageError."""
    return _taxi_velocity_layout().pack(
        record.stamp_ns, record.velocity, 0.0, 0.0, 0.0, 0.0, 0.0)


def encode_gear_response(record: GearResponse) -> bytes:
    """The sensor_msgs/JointState of ``record``. Raises MessageError."""
    return _joint_state_layout(True).pack(
        record.stamp_ns, *record.position, _COUNT, *record.velocity, _COUNT, *record.effort)


def encode_amplitude(record: LimitCycleAmplitude) -> bytes:
    """The sensor_msgs/JointState of ``record``, without effort. Raises MessageError."""
    return _joint_state_layout(False).pack(
        record.stamp_ns, *record.position, _COUNT, *record.velocity, 0)


def encode_orbit(record: LimitCycleOrbit) -> bytes:
    """The trajectory_msgs/JointTrajectory of ``record``. Raises MessageError."""
    times = record.times_ns
    outside = times[(times < 0) | (times >= _LONGEST_NS)]
    if len(outside):
        raise MessageError(f"a time of the orbit is {outside[0]} ns, but must be in "
                           f"[0, {_LONGEST_NS}) ns")
    points = _points(len(times)).copy()
    points["positions"] = record.positions
    points["velocities"] = record.velocities
    points["sec"], points["nanosec"] = np.divmod(times, 10**9)
    body = points.tobytes()
    return b"".join((_orbit_layout().pack(record.stamp_ns, len(times)), body[:4], body[8:]))


def encode_statuses(records: Sequence[Status]) -> bytes:
    """The diagnostic_msgs/DiagnosticArray of ``records``, which share one stamp.

    Raises MessageError for no record, for different stamps and for text that is no Unicode.
    """
    stamps = {record.stamp_ns for record in records}
    if len(stamps) != 1:
        raise MessageError(f"statuses of {len(stamps)} stamps were given, but one array has one")
    out = bytearray(_status_layout().pack(stamps.pop(), len(records)))
    try:
        for record in records:
            out.append(record.level)
            for text in (record.name, record.message, record.hardware_id):
                _append_aligned(out, _short_string(text))
            _append_aligned(out, _LENGTH.pack(len(record.values)))
            for key, value in record.values.items():
                _append_aligned(out, _short_string(key))
                _append_aligned(out, _short_string(value))
    except UnicodeEncodeError as error:
        raise MessageError(f"a status holds text that cannot be sent: {error}") from error
    return bytes(out)


def _append_aligned(out: bytearray, data: bytes) -> None:
    out += _PADDING[-len(out) % 4]
    out += data


def _string(text: str) -> bytes:
    data = text.encode()
    return b"".join((_LENGTH.pack(len(data) + 1), data, b"\0"))


# Most texts of a status are those of the one before.
_short_string = lru_cache(maxsize=64)(_string)
