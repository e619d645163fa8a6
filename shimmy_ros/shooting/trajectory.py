"""A motion as a sequence of power series in time, exact to rounding."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from typing import NamedTuple

import numpy as np

from .modes import Real, Signs
from .polynomial import roots
from .series import values_at


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

    @cached_property
    def _units(self) -> Real:
        return np.array([piece.unit for piece in self.pieces])

    @cached_property
    def _series(self) -> Real:
        """The series of all pieces, shape (pieces, p + 1, 2n)."""
        return np.array([piece.series for piece in self.pieces])

    @cached_property
    def _terms(self) -> Real:
        """The same in shares of the pieces' lengths."""
        shares = np.array([piece.length for piece in self.pieces]) / self._units
        return self._series * shares[:, None, None] ** np.arange(self._series.shape[1])[:, None]

    def sample(self, times: Real) -> Real:
        """The state at times within [0, duration], shape (2n, times)."""
        times = np.asarray(times, dtype=np.float64)
        numbers = np.clip(np.searchsorted(self._starts, times, side="right") - 1, 0, None)
        states: Real = values_at(self._series, numbers,
                                 (times - self._starts[numbers]) / self._units[numbers])
        return states

    def _changes(self, component: int) -> list[tuple[int, float]]:
        """Where a component changes sign: the number of the piece, and the share of its length."""
        sizes = np.abs(self._terms[:, :, component])
        unsure = np.flatnonzero(sizes[:, 0] <= sizes[:, 1:].sum(axis=1))
        return [(number, root) for number in unsure.tolist()
                for root in roots(self._terms[number, :, component])]

    def zeros(self, component: int) -> Real:
        """The times, ascending and after 0, at which a component of the state changes sign."""
        return np.array([self.pieces[number].start + self.pieces[number].length * share
                         for number, share in self._changes(component)])

    def peaks(self) -> Real:
        """The largest |q| of each coordinate, shape (n,)."""
        dofs = len(self.end) // 2
        peaks = self.largest()[:dofs]
        for dof in range(dofs):
            turns = self._changes(dofs + dof)
            inside = values_at(self._terms, np.array([number for number, _ in turns], np.int64),
                               np.array([share for _, share in turns], np.float64))
            peaks[dof] = np.abs(inside[dof]).max(initial=peaks[dof])
        return peaks

    def largest(self) -> Real:
        """The largest value of each component of the state where a step begins or ends, (2n,)."""
        return np.asarray(
            np.maximum(np.abs(self._series[:, 0]).max(axis=0), np.abs(self.end)))

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
