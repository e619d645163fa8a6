"""Interleaved timings and their ratios: what is compared is measured in turn, many times."""

from __future__ import annotations

import statistics
import time
from collections.abc import Callable
from typing import NamedTuple


class Spread(NamedTuple):
    """Median and extremes over the rounds."""

    median: float
    min: float
    max: float


def spread(values: list[float]) -> Spread:
    """Of a list of figures."""
    return Spread(statistics.median(values), min(values), max(values))


def seconds_of(function: Callable[[], object], repeat: int) -> float:
    """Seconds of one call, the mean of ``repeat``."""
    begun = time.perf_counter()
    for _ in range(repeat):
        function()
    return (time.perf_counter() - begun) / repeat


def ratio(measured: tuple[Callable[[], object], int], yardstick: tuple[Callable[[], object], int],
          rounds: int) -> tuple[Spread, Spread, Spread]:
    """Time of the first over that of the second, round by round: ratio and both times [s].

    Each is a function and how often it is called a round; both are called once before.
    """
    measured[0]()
    yardstick[0]()
    first, second = [], []
    for _ in range(rounds):
        first.append(seconds_of(*measured))
        second.append(seconds_of(*yardstick))
    ratios = [a / b for a, b in zip(first, second, strict=True)]
    return spread(ratios), spread(first), spread(second)


def exponent(sizes: list[int], times: list[float]) -> float:
    """The least-squares exponent p of time ~ size^p."""
    import numpy as np

    return float(np.polyfit(np.log(sizes), np.log(times), 1)[0])
