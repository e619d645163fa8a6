"""Numbers and stamps in messages of any type, by the names of their fields."""

from __future__ import annotations

import keyword
import re
from collections.abc import Callable
from typing import Any

from rosbags.interfaces import Nodetype
from rosbags.serde import SerdeError
from rosbags.typesys.store import Typestore

from ..bag.errors import BagError
from ..bag.message import BagMessage, Channel
from ..bag.types import types_of
from ..contract.records import MessageError, TaxiVelocity
from ..contract.typestore import FLOAT64, TWIST_STAMPED

VELOCITY_FIELDS = {
    TWIST_STAMPED: "twist.linear.x",
    "geometry_msgs/msg/Twist": "linear.x",
    "nav_msgs/msg/Odometry": "twist.twist.linear.x",
    FLOAT64: "data",
}
"""Where a velocity is in the types that need no field to be named."""

_NUMBER = re.compile(r"u?int(8|16|32|64)|float(32|64)")
_PATH = re.compile(r"[A-Za-z_]\w*(\[\d+\])*(\.[A-Za-z_]\w*(\[\d+\])*)*")
_STEP = re.compile(r"([A-Za-z_]\w*)|\[(\d+)\]")
_HEADER = "std_msgs/msg/Header"


def velocity_reader(channel: Channel, field: str = "") -> Callable[[BagMessage], TaxiVelocity]:
    """A function that takes the taxi velocity from messages of ``channel``.

    ``field`` reads like ``twist.linear.x`` or ``velocities[0].data``; without it the type has to
    be one of VELOCITY_FIELDS. The stamp is the header's, or the log time where the type has none.
    Raises BagError where the type has no such number; the function raises MessageError for a
    message without it.
    """
    types = types_of(channel)
    if not field and channel.type not in VELOCITY_FIELDS:
        known = ", ".join(VELOCITY_FIELDS)
        raise BagError(f"topic {channel.topic} is of type {channel.type}, but must be one of "
                       f"{known}, or be given with its field, as in {channel.topic}:field.path")
    steps = _steps(channel, types, field or VELOCITY_FIELDS[channel.type])
    has_header = has_stamp(channel)

    def read(message: BagMessage) -> TaxiVelocity:
        content = decoded(types, message)
        stamp_ns = stamp(content) if has_header else message.log_time_ns
        return TaxiVelocity(stamp_ns, _follow(content, steps))

    return read


def has_stamp(channel: Channel) -> bool:
    """Whether the messages have a header. Raises BagError for a type that is not known."""
    message = Nodetype.NAME, channel.type
    return bool(_field(types_of(channel), message, "header") == (Nodetype.NAME, _HEADER))


def decoded(types: Typestore, message: BagMessage) -> Any:
    """The message as an object of rosbags. Raises MessageError."""
    try:
        return types.deserialize_cdr(message.data, message.channel.type)
    except SerdeError as error:
        raise MessageError(
            f"{len(message.data)} bytes are no {message.channel.type}: {error}") from error


def stamp(content: Any) -> int:
    """The stamp of a message's header in ns. Raises MessageError."""
    time = content.header.stamp
    if time.nanosec >= 10**9:
        raise MessageError(f"nanosec of a stamp is {time.nanosec}, but must be below 1000000000")
    return int(time.sec) * 10**9 + int(time.nanosec)


def _steps(channel: Channel, types: Typestore, path: str) -> list[str | int]:
    """The names and indices of ``path``, which leads to a number. Raises BagError."""
    if not _PATH.fullmatch(path):
        raise BagError(f"field {path!r} of topic {channel.topic} is no path such as twist.linear.x "
                       "or values[0]")
    steps: list[str | int] = []
    kind: Any = (Nodetype.NAME, channel.type)
    for name, index in _STEP.findall(path):
        kind = _field(types, kind, name) if name else _element(kind)
        if kind is None:
            known = ", ".join(known for known, _ in types.fielddefs[channel.type][1])
            raise BagError(f"topic {channel.topic} is of type {channel.type}, which has no field "
                           f"{path}; it has {known}")
        # rosbags appends this where Python could not have the name.
        steps.append(name + "_" * keyword.iskeyword(name) if name else int(index))
    if kind[0] != Nodetype.BASE or not _NUMBER.fullmatch(kind[1][0]):
        raise BagError(f"field {path} of topic {channel.topic} is no number")
    return steps


def _field(types: Typestore, kind: Any, name: str) -> Any:
    """What rosbags says of a field of a message: its kind and type; None without such a field."""
    return dict(types.fielddefs[kind[1]][1]).get(name) if kind[0] == Nodetype.NAME else None


def _element(kind: Any) -> Any:
    return kind[1][0] if kind[0] in (Nodetype.ARRAY, Nodetype.SEQUENCE) else None


def _follow(content: Any, steps: list[str | int]) -> float:
    try:
        for step in steps:
            content = getattr(content, step) if isinstance(step, str) else content[step]
    except IndexError as error:
        raise MessageError(f"it has no value [{step}], but {len(content)} values") from error
    return float(content)
