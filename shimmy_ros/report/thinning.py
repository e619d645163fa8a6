"""What a picture shows of a long recording, in memory that does not grow with it."""

from __future__ import annotations

from array import array

import numpy as np

from .recording import Array

_LIMIT = 20_000


class Thinned:
    """Rows of numbers, of which every one is kept, then every second, every fourth, and so on.

    ``stride`` is that number, and between ``limit`` and twice as many rows are kept.
    """

    def __init__(self, columns: int, limit: int = _LIMIT) -> None:
        self.stride = 1
        self._columns = columns
        self._limit = limit
        self._count = 0
        self._values = array("d")

    def add(self, *row: float) -> None:
        """Take one row."""
        if self._count % self.stride == 0:
            self._values.extend(row)
            if len(self._values) > 2 * self._limit * self._columns:
                self._values = array("d", self.table[::2].ravel())
                self.stride *= 2
        self._count += 1

    @property
    def table(self) -> Array:
        """What is kept, shape (rows, columns)."""
        return np.array(self._values).reshape(-1, self._columns)


class Envelope:
    """The lowest and the highest value of each of at most ``limit`` stretches of a signal."""

    def __init__(self, limit: int = _LIMIT) -> None:
        self._limit = limit
        self._length = 1
        self._left = 0
        self._stretches: list[tuple[float, float, float]] = []

    def add(self, time: float, value: float) -> None:
        """Take one sample."""
        if self._left == 0:
            if len(self._stretches) == self._limit:
                pairs = zip(self._stretches[::2], self._stretches[1::2], strict=True)
                self._stretches = [(first[0], min(first[1], second[1]), max(first[2], second[2]))
                                   for first, second in pairs]
                self._length *= 2
            self._stretches.append((time, value, value))
            self._left = self._length - 1
            return
        begin, low, high = self._stretches[-1]
        if value < low or value > high:
            self._stretches[-1] = begin, min(low, value), max(high, value)
        self._left -= 1

    @property
    def line(self) -> tuple[Array, Array]:
        """Times and values to draw: both ends of each stretch, shape (2 stretches,) each."""
        table = np.array(self._stretches).reshape(-1, 3)
        return np.repeat(table[:, 0], 2), table[:, 1:].ravel()
