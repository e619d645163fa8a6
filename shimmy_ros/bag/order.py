"""Messages of chunks that overlap in time, in the order of time."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from heapq import heappop, heappush
from math import inf
from operator import attrgetter

from .message import BagMessage

ChunkPlace = tuple[int, int]
"""Log time [ns] of a chunk's first message, and where in the file the chunk begins."""


def by_log_time(chunks: Iterable[ChunkPlace], load: Callable[[int], list[BagMessage]]
                ) -> Iterator[BagMessage]:
    """The messages of all chunks by log time; those of one time in the order of the chunks.

    ``load`` reads the chunk at a place. Only chunks that overlap are in memory together.
    """
    # Time of a chunk's next message, the chunk's number, and what is left of it, last one first.
    open_chunks: list[tuple[int, int, list[BagMessage]]] = []

    def before(limit: float) -> Iterator[BagMessage]:
        while open_chunks and open_chunks[0][0] < limit:
            _, number, left = heappop(open_chunks)
            bound = min(limit, open_chunks[0][0] if open_chunks else inf)
            yield left.pop()
            while left and left[-1].log_time_ns < bound:
                yield left.pop()
            if left:
                heappush(open_chunks, (left[-1].log_time_ns, number, left))

    for number, (begin, place) in enumerate(sorted(chunks)):
        yield from before(begin)
        messages = sorted(load(place), key=attrgetter("log_time_ns"))
        if messages:
            heappush(open_chunks, (messages[0].log_time_ns, number, messages[::-1]))
    yield from before(inf)
