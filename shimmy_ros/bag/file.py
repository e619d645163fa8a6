"""What the files of every storage have in common."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Collection, Iterator
from pathlib import Path

from .message import BagMessage, Channel


class BagFile(ABC):
    """One file of a bag.

    ``fraction`` of it has been read, ``damage`` says what is wrong with it, and ``metadata`` has
    the contents of its metadata records by name, all three as far as messages() went.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        self.fraction = 0.0
        self.damage: list[str] = []
        self.metadata: dict[str, dict[str, str]] = {}

    @abstractmethod
    def channels(self) -> list[Channel]:
        """The channels, as far as they can be read. Raises BagError and OSError."""

    @abstractmethod
    def messages(self, topics: Collection[str] | None) -> Iterator[BagMessage]:
        """The messages on ``topics`` or, with None, all of them. Raises BagError and OSError."""
