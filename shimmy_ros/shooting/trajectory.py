"""A motion as a sequence of power series in time, exact to rounding."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from typing import NamedTuple

import numpy as np

from .modes import Real, Signs
from .polynomial import roots


class Piece(NamedTuple):
    """x(start + u s) = sum_k series[k] s^k for 0 <= s <= length / u, u being ``unit`` [s].

    ``series`` has shape (p + 1, 2n); ``signs`` is the mode.
    """

    start: float
    length: float
    unit: float
    series: Real
    signs: Signs


class Phase(NamedTuple):
    """A time [s] from ``start`` to ``stop`` in which no coordinate turns, sticks or is released.

    ``directions`` holds the sign of each coordinate with friction, ascending: 0 where it sticks.
    """

    start: float
    stop: float
    directions: Signs


@dataclass(frozen=True)
class Trajectory:
    """A motion from time 0 to ``duration``.

    ``end`` (2n,) is the state there, ``transition`` (2n, 2n) its derivative by the initial state,
    and ``by_parameter`` (2n,) that by the parameter; either is None unless asked for.
    """

    pieces: tuple[Piece, ...]
    duration: float
    end: Real
    transition: Real | None
    by_parameter: Real | None

    @cached_property
    def _starts(self) -> Real:
        return np.array([piece.start for piece in self.pieces])

    def sample(self, times: Real) -> Real:
        """The state at times within [0, duration], shape (2n, times)."""
        times = np.asarray(times, dtype=np.float64)
        states = np.empty((len(self.end), times.size))
        place = np.clip(np.searchsorted(self._starts, times, side="right") - 1, 0, None)
        for index in np.unique(place):
            piece, inside = self.pieces[index], place == index
            powers = np.vander((times[inside] - piece.start) / piece.unit, len(piece.series),
                               increasing=True)
            states[:, inside] = (powers @ piece.series).T
        return states

    def zeros(self, component: int) -> Real:
        """The times, ascending and after 0, at which a component of the state changes sign."""
        found: list[float] = []
        for piece in self.pieces:
            powers = (piece.length / piece.unit) ** np.arange(len(piece.series))
            found += [piece.start + piece.length * root
                      for root in roots(piece.series[:, component] * powers)]
        return np.array(found)

    def peaks(self) -> Real:
        """The largest |q| of each coordinate, shape (n,)."""
        dofs = len(self.end) // 2
        ends = np.append(self._starts, self.duration)
        return np.array([
            np.abs(self.sample(np.concatenate([ends, self.zeros(dofs + dof)]))[dof]).max()
            for dof in range(dofs)])

    def largest(self) -> Real:
        """The largest value of each component of the state where a step begins or ends, (2n,)."""
        return np.asarray(
            np.abs([piece.series[0] for piece in self.pieces] + [self.end]).max(axis=0))

    def magnitude(self) -> Real:
        """The same, but 1 for components that are zero throughout: a divisor, shape (2n,)."""
        largest = self.largest()
        return np.where(largest > 0.0, largest, 1.0)

    def reflected(self) -> Trajectory:
        """The motion -x(t), which an odd system has as well."""
        pieces = tuple(piece._replace(series=-piece.series, signs=tuple(-s for s in piece.signs))
                       for piece in self.pieces)
        by_parameter = None if self.by_parameter is None else -self.by_parameter
        return replace(self, pieces=pieces, end=-self.end, by_parameter=by_parameter)

    def phases(self, frictional: tuple[int, ...]) -> tuple[Phase, ...]:
        """The phases of slip and stick; ``frictional`` holds positions within a mode's signs."""
        found: list[Phase] = []
        for piece in self.pieces:
            directions = tuple(piece.signs[item] for item in frictional)
            stop = piece.start + piece.length
            if found and found[-1].directions == directions:
                found[-1] = found[-1]._replace(stop=stop)
            else:
                found.append(Phase(piece.start, stop, directions))
        return tuple(found)
