"""What a bag holds, whatever its storage: channels and messages."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

CDR = "cdr"


@dataclass(frozen=True)
class Channel:
    """The messages of one ``type`` on one topic.

    ``type`` reads package/msg/Type. ``definition`` is its text as the bag has it, in the language
    ``definition_encoding`` (ros2msg or ros2idl), and empty where the bag has none. ``qos`` is the
    YAML list of the offered QoS profiles, and ``type_hash`` the type's RIHS01 hash; both may be
    empty.
    """

    topic: str
    type: str
    encoding: str = CDR
    definition: bytes = b""
    definition_encoding: str = ""
    qos: str = ""
    type_hash: str = ""


class BagMessage(NamedTuple):
    """One message as it was recorded: log and publish time in ns since the epoch, and its bytes."""

    channel: Channel
    log_time_ns: int
    publish_time_ns: int
    data: bytes
    sequence: int = 0

    @property
    def topic(self) -> str:
        """The resolved name of the topic."""
        return self.channel.topic

    @property
    def type(self) -> str:
        """The type as package/msg/Type."""
        return self.channel.type
