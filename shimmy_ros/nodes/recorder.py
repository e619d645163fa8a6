"""The bags of the simulator's runs, one after the other."""

from __future__ import annotations

import contextlib
import time
from collections.abc import Callable, Mapping
from pathlib import Path

from ..bag.writer import BagWriter
from ..contract.spec import load_contract


class Recorder:
    """Writes what the contract records, one bag a run; a disk that fails ends no run."""

    def __init__(self, directory: str, namespace: str, on_failure: Callable[[str], None]) -> None:
        """``directory`` is the first run's bag; empty: named by the time, in the working directory.

        A later run's bag has a number behind the name. ``on_failure`` gets a sentence where the
        disk fails.
        """
        self._asked = directory
        self._namespace = namespace
        self._bag: BagWriter | None = None
        self._names: dict[str, str] = {}
        self._runs = 0
        self.counts: dict[str, int] = {}
        """How many messages of each topic of the contract the bag has."""
        self._on_failure = on_failure
        self.failure = ""
        """Why the recording of the last run ended early; empty when it did not."""

    @property
    def directory(self) -> Path | None:
        """The bag that is being written."""
        return None if self._bag is None else self._bag.directory

    def begin(self, settings: Mapping[str, str]) -> Path:
        """Begin a bag and return its directory. Raises BagError and OSError."""
        self.failure = ""
        bag = BagWriter(self._new_directory(), settings)
        self._names = {topic.name: bag.add_topic(topic, self._namespace)
                       for topic in load_contract().recorded}
        self._bag = bag
        self.counts = dict.fromkeys(self._names, 0)
        self._runs += 1
        return bag.directory

    def write(self, topic: str, data: bytes, time_ns: int) -> None:
        """Record a message of a topic of the contract, if there is a bag."""
        if self._bag is not None:
            self.counts[topic] += 1
            self._try(lambda bag: bag.write(self._names[topic], data, time_ns))

    def flush(self) -> None:
        """Hand to the operating system what has waited long enough."""
        self._try(lambda bag: bag.flush_if_due())

    def end(self) -> Path | None:
        """Close the bag; returns its directory if that went well."""
        self._try(lambda bag: bag.close())
        bag, self._bag = self._bag, None
        return None if bag is None else bag.directory

    def _try(self, action: Callable[[BagWriter], None]) -> None:
        bag = self._bag
        if bag is None:
            return
        try:
            action(bag)
        except OSError as error:
            self._bag = None
            self.failure = f"{bag.directory} is incomplete: {error.strerror or error}"
            with contextlib.suppress(OSError):  # the failure is known already
                bag.close()
            self._on_failure(self.failure)

    def _new_directory(self) -> Path:
        path = Path(self._asked or time.strftime("shimmy_%Y_%m_%d-%H_%M_%S"))
        if self._asked and not self._runs:
            return path
        number, name = 1, path.name
        while path.exists():
            number += 1
            path = path.with_name(f"{name}+{number}")
        return path
