"""A motion as a sequence of power series in time, exact to rounding."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..compiling import compiled
from .modes import Real
from .polynomial import roots
from .series import values_at
from .steps import Pieces

# A zero so near to a piece's end, in shares of it, is at the end.
_BORDER = 1e-9


class Phase(NamedTuple):
    """A time [s] from ``start`` to ``stop`` in which no coordinate turns, sticks or is released.

    ``directions`` holds the sign of each coordinate with friction, ascending: 0 where it sticks.
    """

    start: float
    stop: float
    directions: tuple[int, ...]


@dataclass(frozen=True)
class Trajectory:
    """A motion from time 0 to ``duration``, for which it took so many ``steps``.

    ``end`` (2n,) is the state there, ``transition`` (2n, 2n) its derivative by the initial state,
    and ``by_parameter`` (2n,) that by the parameter; either is None unless asked for.
    """

    pieces: Pieces
    duration: float
    end: Real
    transition: Real | None
    by_parameter: Real | None
    steps: int

    def sample(self, times: Real) -> Real:
        """The state at times within [0, duration], shape (2n, times)."""
        times = np.asarray(times, dtype=np.float64)
        starts, units = self.pieces.starts, self.pieces.units
        numbers = np.maximum(np.searchsorted(starts, times, side="right") - 1, 0)
        return values_at(self.pieces.series, numbers, (times - starts[numbers]) / units[numbers])

    def _changes(self, component: int) -> tuple[NDArray[np.int64], Real]:
        """Where a component changes sign: the numbers of the pieces, and the places in units."""
        return sign_changes(self.pieces.series, self.pieces.lengths / self.pieces.units, component)

    def zeros(self, component: int) -> Real:
        """The times, ascending and after 0, at which a component of the state changes sign.

        Where it rests at zero in between, that is when it sets out again.
        """
        numbers, places = self._changes(component)
        return np.asarray(self.pieces.starts[numbers] + self.pieces.units[numbers] * places)

    def peaks(self) -> Real:
        """The largest |q| of each coordinate, shape (n,)."""
        dofs = len(self.end) // 2
        peaks = self.largest()[:dofs]
        for dof in range(dofs):
            inside = values_at(self.pieces.series, *self._changes(dofs + dof))
            peaks[dof] = np.abs(inside[dof]).max(initial=peaks[dof])
        return peaks

    def largest(self) -> Real:
        """The largest value of each component of the state where a step begins or ends, (2n,)."""
        return np.asarray(
            np.maximum(np.abs(self.pieces.series[:, 0]).max(axis=0), np.abs(self.end)))

    def magnitude(self) -> Real:
        """The same, but 1 for components that are zero throughout: a divisor, shape (2n,)."""
        largest = self.largest()
        return np.where(largest > 0.0, largest, 1.0)

    def reflected(self) -> Trajectory:
        """The motion -x(t), which an odd system has as well."""
        pieces = self.pieces._replace(series=-self.pieces.series, signs=-self.pieces.signs)
        by_parameter = None if self.by_parameter is None else -self.by_parameter
        return replace(self, pieces=pieces, end=-self.end, by_parameter=by_parameter)

    def phases(self, frictional: tuple[int, ...]) -> tuple[Phase, ...]:
        """The phases of slip and stick; ``frictional`` holds positions within a mode's signs."""
        directions = self.pieces.signs[:, list(frictional)]
        changes = 1 + np.flatnonzero((directions[1:] != directions[:-1]).any(axis=1))
        firsts, lasts = [0, *changes], [*(changes - 1), len(directions) - 1]
        starts = self.pieces.starts[firsts]
        stops = self.pieces.starts[lasts] + self.pieces.lengths[lasts]
        return tuple(Phase(start, stop, tuple(signs)) for start, stop, signs in zip(
            starts.tolist(), stops.tolist(), directions[firsts].tolist(), strict=True))


@compiled
def sign_changes(series: Real, lengths: Real, component: int) -> tuple[NDArray[np.int64], Real]:
    """Where a component of the ``series`` (pieces, p + 1, 2n) changes sign, ascending.

    The numbers of the pieces, and the places within [0, length] of these. A change at the border
    of two pieces, or in a time at zero, counts once: where the later piece begins.
    """
    count = series.shape[1]
    terms = np.empty(count)
    numbers, places = np.empty(series.shape[0] * count, np.int64), np.empty(series.shape[0] * count)
    found, sign = 0, 0.0
    for number in range(series.shape[0]):
        power, rest, begins = 1.0, 0.0, 0.0
        for k in range(count):
            terms[k] = series[number, k, component] * power
            rest += abs(terms[k])
            power *= lengths[number]
            if begins == 0.0:
                begins = np.sign(terms[k])
        if begins == 0.0:
            continue
        if begins == -sign:
            numbers[found], places[found] = number, 0.0
            found += 1
        sign = begins
        if 2.0 * abs(terms[0]) <= rest:
            stops = number + 1 < series.shape[0] and series[number + 1, 0, component] == 0.0
            for place in roots(terms):
                if stops and place > 1.0 - _BORDER:
                    # Rounding made it; what follows tells.
                    continue
                numbers[found], places[found] = number, place * lengths[number]
                found += 1
                sign = -sign
    return numbers[:found], places[:found]
