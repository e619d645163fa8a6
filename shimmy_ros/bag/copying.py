"""Messages of one bag into another, as they are, whatever their types."""

from __future__ import annotations

from dataclasses import replace
from functools import lru_cache

from ..contract.typestore import definition, type_hash, typestore
from .message import CDR, BagMessage, Channel
from .offloading import OffloadedWriter
from .reader import BagMessages
from .types import MSG


def copy_message(message: BagMessage, bag: OffloadedWriter) -> None:
    """Write ``message``, with its channel if that is new. Raises BagError and OSError."""
    bag.write(bag.add_channel(_completed(message.channel)), message.data, message.log_time_ns,
              message.publish_time_ns, message.sequence)


def copy_metadata(messages: BagMessages, bag: OffloadedWriter) -> None:
    """Write the metadata records that came by; rosbag2's own describes the bag that was cut."""
    for name, content in messages.metadata.items():
        if name != "rosbag2":
            bag.add_metadata(name, content)


@lru_cache(maxsize=1024)
def _completed(channel: Channel) -> Channel:
    """``channel`` with the definition of a stock type that the bag does not define."""
    if channel.definition or channel.encoding != CDR or (
            channel.type not in typestore().fielddefs):
        return channel
    return replace(channel, definition=definition(channel.type).encode(), definition_encoding=MSG,
                   type_hash=channel.type_hash or type_hash(channel.type))
