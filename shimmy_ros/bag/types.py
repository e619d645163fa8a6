"""The message types that a bag brings along: their layout, by rosbags' typestore."""

from __future__ import annotations

from functools import lru_cache
from typing import Any

from rosbags.typesys import (
    Stores,
    TypesysError,
    get_types_from_idl,
    get_types_from_msg,
    get_typestore,
)
from rosbags.typesys.store import Typestore

from ..contract.typestore import typestore
from .errors import BagError
from .message import CDR, Channel

MSG, IDL = "ros2msg", "ros2idl"

_HEADER = "std_msgs/msg/Header"
_IDL_SEPARATOR = "=" * 80 + "\n"


def types_of(channel: Channel) -> Typestore:
    """A typestore with the channel's type, as the bag defines it or else as ROS 2 Jazzy does.

    Raises BagError where neither does and for messages that are not CDR.
    """
    if channel.encoding != CDR:
        raise BagError(f"topic {channel.topic} is encoded as {channel.encoding}, but must be {CDR}")
    if channel.definition:
        return _types(channel.type, channel.definition, channel.definition_encoding)
    if channel.type not in typestore().fielddefs:
        raise BagError(f"topic {channel.topic} is of type {channel.type or 'unknown'}, which the "
                       "bag does not define")
    return typestore()


def ros1_channel(topic: str, type_name: str, definition: str, latched: bool) -> Channel:
    """The ROS 2 channel of a ROS 1 connection. Raises BagError for an unreadable definition."""
    package, _, name = type_name.rpartition("/")
    ros2_name = f"{package}/msg/{name}"
    types = ros1_types(ros2_name, definition)
    text, _ = types.generate_msgdef(ros2_name, ros_version=2)
    qos = "- durability: transient_local" if latched else ""
    return Channel(topic, ros2_name, CDR, text.encode(), MSG, qos, types.hash_rihs01(ros2_name))


@lru_cache(maxsize=256)
def ros1_types(type_name: str, definition: str) -> Typestore:
    """A typestore for a ROS 1 definition, whose header has lost ``seq``, as in ROS 2.

    Raises BagError.
    """
    types = _parsed(type_name, definition, MSG)
    if _HEADER in types:
        types[_HEADER] = typestore().fielddefs[_HEADER]
    return _registered(type_name, types)


@lru_cache(maxsize=256)
def _types(type_name: str, definition: bytes, language: str) -> Typestore:
    try:
        text = definition.decode()
    except UnicodeDecodeError as error:
        raise BagError(f"the definition of {type_name} in the bag is no text: {error}") from error
    return _registered(type_name, _parsed(type_name, text, language))


def _parsed(type_name: str, text: str, language: str) -> dict[str, Any]:
    try:
        if language == MSG:
            return get_types_from_msg(text, type_name)
        if language != IDL:
            raise BagError(f"the definition of {type_name} in the bag is in {language}, but must "
                           f"be in {MSG} or {IDL}")
        types: dict[str, Any] = {}
        # rosbag2 puts the types that a type contains behind it, each after such a line.
        parts = [part for part in text.split(_IDL_SEPARATOR) if part.strip()]
        for part in parts:
            heading, _, rest = part.partition("\n")
            types.update(get_types_from_idl(rest if heading.startswith("IDL: ") else part))
        return types
    except TypesysError as error:
        raise _unreadable(type_name, error) from error


def _registered(type_name: str, types: dict[str, Any]) -> Typestore:
    store = get_typestore(Stores.EMPTY)
    try:
        store.register(types)
        store.get_msgdef(type_name)
    except (TypesysError, KeyError) as error:
        raise _unreadable(type_name, error) from error
    return store


def _unreadable(type_name: str, error: Exception) -> BagError:
    reason = " ".join(str(error).split())[:200]
    return BagError(f"the definition of {type_name} in the bag cannot be read: {reason}")
