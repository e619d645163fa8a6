"""Measured cycles beside the predictions in force, from a stream of samples."""

from __future__ import annotations

from array import array
from collections.abc import Iterator
from math import inf, isfinite
from typing import NamedTuple

import numpy as np

from ..simulation.measurement import Cycles, measure_cycles
from .comparison import SMALLEST_SWIVEL_RAD, Comparison
from .recording import Array

LONGEST_CYCLE_S = 1.0
"""What takes longer is a rest between two oscillations, and no cycle."""

# Values, not samples, that come between one measurement and the next.
_BLOCK = 120_000


class Sample(NamedTuple):
    """One sample of a motion, and what was predicted then.

    ``time`` [s]; ``position`` [rad] and ``rate`` [rad/s] of the joint, the rate NaN where it is
    not known; taxi ``velocity`` [m/s], predicted ``amplitude`` [rad] and ``frequency`` [Hz], and
    the ``kind`` of that answer.
    """

    time: float
    position: float
    rate: float
    velocity: float
    amplitude: float
    frequency: float
    kind: float


class Matcher:
    """Measures the cycles of samples as they come; memory does not grow with their number.

    The cycles are those of measure_cycles, but for the ones longer than LONGEST_CYCLE_S.
    ``skipped`` counts the samples that could not be used.
    """

    def __init__(self) -> None:
        self.skipped = 0
        self._values = array("d")
        self._limit = _BLOCK
        self._last = -inf
        self._measured_until = -inf

    def add(self, sample: Sample) -> Iterator[Comparison]:
        """Take a sample; gives, every now and then, the cycles that were completed since.

        Samples that are not finite, or at the time of the one before, are skipped. A time before
        that begins anew.
        """
        if not isfinite(sample.position) or sample.time == self._last:
            self.skipped += 1
            return
        if sample.time < self._last:
            yield from self.finish()
        self._last = sample.time
        self._values.extend(sample)
        if len(self._values) >= self._limit:
            table = self._table()
            yield from self._new_cycles(table)
            # An open cycle begins less than one longest cycle ago, and its upward crossing no
            # further before that.
            kept = table[table[:, 0] >= table[-1, 0] - 2.0 * LONGEST_CYCLE_S]
            self._values = array("d", kept.ravel())
            self._limit = len(self._values) + _BLOCK

    def finish(self) -> Iterator[Comparison]:
        """The cycles that are left; then begins anew."""
        yield from self._new_cycles(self._table())
        self._values = array("d")
        self._last = self._measured_until = -inf

    def _table(self) -> Array:
        return np.array(self._values).reshape(-1, len(Sample._fields))

    def _new_cycles(self, table: Array) -> Iterator[Comparison]:
        for piece in _pieces(table):
            cycles = _measured(piece)
            middle = 0.5 * (cycles.start + cycles.end)
            new = (cycles.end - cycles.start <= LONGEST_CYCLE_S) & (middle > self._measured_until)
            if not new.any():
                continue
            self._measured_until = float(cycles.end[new][-1])
            then = piece[np.searchsorted(piece[:, 0], middle, side="right") - 1]
            yield Comparison(*(column[new] for column in (
                middle, then[:, 3], cycles.amplitude, cycles.frequency, *then[:, 4:].T)))


def _measured(table: Array) -> Cycles:
    time, position, rate = table[:, :3].T
    known = bool(np.isfinite(rate).all())
    return measure_cycles(time, position, rate if known else None, smallest=SMALLEST_SWIVEL_RAD)


def _pieces(table: Array) -> list[Array]:
    """The stretches of motion between rests that are longer than LONGEST_CYCLE_S."""
    outside = np.flatnonzero(np.abs(table[:, 1]) > SMALLEST_SWIVEL_RAD)
    rests = np.flatnonzero(np.diff(table[outside, 0]) > LONGEST_CYCLE_S) + 1
    return [table[stretch[0]:stretch[-1] + 1] for stretch in np.split(outside, rests)
            if stretch.size]
