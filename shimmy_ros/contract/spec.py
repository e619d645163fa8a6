"""The contract of ``msgs_spec/topics.yaml`` as values: topics, services, fields and their QoS."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from enum import Enum
from functools import lru_cache
from typing import Any, TypeVar

import yaml

from ..resources import resource_directory


class Reliability(Enum):
    """Whether every message arrives; the members' names are those of rclpy's policy."""

    RELIABLE = "reliable"
    BEST_EFFORT = "best_effort"


class Durability(Enum):
    """Whether late joiners get the last message; the members' names are those of rclpy's policy."""

    VOLATILE = "volatile"
    TRANSIENT_LOCAL = "transient_local"


class History(Enum):
    """What a queue keeps; the members' names are those of rclpy's policy."""

    KEEP_LAST = "keep_last"


@dataclass(frozen=True)
class QoS:
    """Quality of service, offered by a publisher and requested by a subscription.

    ``depth`` is the length of either side's own queue and no part of their matching.
    """

    reliability: Reliability
    durability: Durability
    history: History
    depth: int


@dataclass(frozen=True)
class Field:
    """What the field ``path`` of a message means, and its SI ``unit`` ("" for what is no number).

    ``of`` lists the joints or keys for which this holds; it is empty where it holds for all.
    """

    path: str
    unit: str
    meaning: str
    of: tuple[str, ...]


@dataclass(frozen=True)
class Topic:
    """One topic; ``type`` reads package/msg/Type, parties are rig, predictor, simulator, anyone."""

    name: str
    type: str
    meaning: str
    publishers: tuple[str, ...]
    subscribers: tuple[str, ...]
    recorded: bool
    qos: QoS
    fields: tuple[Field, ...]

    def resolved(self, namespace: str) -> str:
        """The absolute name in ``namespace``: taxi_velocity in /shimmy is /shimmy/taxi_velocity."""
        if self.name.startswith("/"):
            return self.name
        return "/" + "/".join([*namespace.strip("/").split("/"), self.name]).lstrip("/")


@dataclass(frozen=True)
class Service:
    """One service; ``type`` reads package/srv/Type."""

    name: str
    type: str
    meaning: str
    server: str


Named = TypeVar("Named", Topic, Service)


@dataclass(frozen=True)
class Contract:
    """All of it, in the order of the file; ``joints`` is the order in which joints are sent."""

    joints: tuple[str, ...]
    topics: tuple[Topic, ...]
    services: tuple[Service, ...]

    @property
    def recorded(self) -> tuple[Topic, ...]:
        """The topics that the simulator's bag holds."""
        return tuple(topic for topic in self.topics if topic.recorded)

    def topic(self, name: str) -> Topic:
        """The topic of this name in the file; KeyError names the known ones."""
        return _find(self.topics, name)

    def service(self, name: str) -> Service:
        """The service of this name in the file; KeyError names the known ones."""
        return _find(self.services, name)

    def published_by(self, party: str) -> tuple[Topic, ...]:
        """What rig, predictor or simulator sends."""
        return tuple(topic for topic in self.topics if party in topic.publishers)

    def subscribed_by(self, party: str) -> tuple[Topic, ...]:
        """What rig, predictor or simulator acts on."""
        return tuple(topic for topic in self.topics if party in topic.subscribers)


@lru_cache(maxsize=1)
def load_contract() -> Contract:
    """Read the contract that belongs to this package, once.

    Raises FileNotFoundError where the package is installed without it.
    """
    text = (resource_directory("msgs_spec") / "topics.yaml").read_text(encoding="utf-8")
    content = yaml.safe_load(text)
    return Contract(
        joints=tuple(content["joints"]),
        topics=tuple(_topic(entry) for entry in content["topics"]),
        services=tuple(Service(**entry) for entry in content["services"]),
    )


def topics_table() -> str:
    """The topics and services as a Markdown table, with the units of their fields."""
    contract = load_contract()
    rows = ["| topic | type | from → to | content | QoS | in the bag |",
            "|---|---|---|---|---|---|"]
    for topic in contract.topics:
        parties = f"{' and '.join(topic.publishers)} → {' and '.join(topic.subscribers)}".strip()
        qos = f"{topic.qos.reliability.value}, {topic.qos.durability.value}, {topic.qos.depth}"
        rows.append(_row(f"`{topic.name}`", topic.type.replace("/msg/", "/"), parties,
                         _content(topic), qos.replace("_", " "),
                         "yes" if topic.recorded else "no"))
    for service in contract.services:
        rows.append(_row(f"`{service.name}` (service)", service.type.replace("/srv/", "/"),
                         f"→ {service.server}", service.meaning, "", "no"))
    return "\n".join(rows) + "\n"


def _topic(entry: Mapping[str, Any]) -> Topic:
    qos = entry["qos"]
    return Topic(
        name=entry["name"],
        type=entry["type"],
        meaning=entry["meaning"],
        publishers=tuple(entry["publishers"]),
        subscribers=tuple(entry["subscribers"]),
        recorded=entry["recorded"],
        qos=QoS(Reliability(qos["reliability"]), Durability(qos["durability"]),
                History(qos["history"]), qos["depth"]),
        fields=tuple(Field(field["path"], field["unit"], field["meaning"],
                           tuple(field.get("of", ()))) for field in entry["fields"]),
    )


def _find(entries: tuple[Named, ...], name: str) -> Named:
    for entry in entries:
        if entry.name == name:
            return entry
    known = ", ".join(entry.name for entry in entries)
    raise KeyError(f"{name!r} is not in the contract, which has {known}")


def _row(*cells: str) -> str:
    return "| " + " | ".join(cells) + " |"


def _content(topic: Topic) -> str:
    units: dict[str, list[str]] = {}
    for field in topic.fields:
        if field.unit not in ("", "1") and field.path != "header.stamp":
            of = f"({', '.join(field.of)}) " if field.of else ""
            units.setdefault(field.path, []).append(f"{of}in {field.unit}")
    sentences = (f"`{path}` {', '.join(parts)}." for path, parts in units.items())
    return " ".join([topic.meaning, *sentences])
