"""The limit cycles over one parameter: all branches within a range, or the stable ones alone."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import pairwise

from ..gear.axes import Axis
from ..gear.parameters import ParameterError
from ..gear.system import OperatingPoint, family_between
from .branches import (
    LARGEST_SWIVEL,
    BranchPoint,
    ContinuationError,
    Line,
    Settings,
    follow,
)
from .growing import growing_cycle
from .limit_cycles import all_cycles
from .one_harmonic import one_harmonic_cycles
from .orbits import Orbit

# Behind a fold, a branch with a larger multiplier than this leads away from stable cycles.
_UNSTABLE_FOR_GOOD = 1.5


@dataclass(frozen=True)
class DiagramPoint:
    """A cycle of branch number ``branch`` at a ``value`` of the parameter.

    ``order`` counts along the branch, also downwards from where it was found. ``is_fold`` marks a
    fold; ``on_grid`` a point at one of the values asked for, other than the start again.
    """

    branch: int
    order: int
    value: float
    orbit: Orbit
    is_fold: bool
    on_grid: bool


class Diagram:
    """Branches over the ``values`` of one parameter, as far as they have been traced.

    ``points`` grow while `trace_all` or `trace_stable` runs. ``losses`` are sentences about
    branches that were lost and values at which a search did not converge; ``undecided`` are the
    numbers of those values.
    """

    def __init__(self, point: OperatingPoint, axis: Axis, values: Sequence[float],
                 settings: Settings) -> None:
        """``values`` ascend, and are at least two. Raises ParameterError."""
        if len(values) < 2 or any(b <= a for a, b in pairwise(values)):
            raise ParameterError(f"values of {axis.name} must be at least two and ascend")
        self.axis, self.settings = axis, settings
        self.values = tuple(float(value) for value in values)
        self.points: list[DiagramPoint] = []
        self.losses: list[str] = []
        self.undecided: set[int] = set()
        low, high = self.values[0], self.values[-1]
        # The ends first: they are what a user named.
        ends = [axis.at(point, value) for value in (low, high)]
        self._grid = [ends[0], *(axis.at(point, value) for value in self.values[1:-1]), ends[1]]
        self._positions = [(value - low) / (high - low) for value in self.values]
        self._index = {position: i for i, position in enumerate(self._positions)}
        self._line = Line(family_between(self._grid[0], self._grid[-1]))
        self._branches = 0

    def at(self, index: int) -> OperatingPoint:
        """The operating point of value number ``index``."""
        return self._grid[index]

    def cycles(self, index: int) -> list[DiagramPoint]:
        """The points found at value number ``index``."""
        value = self.values[index]
        return [point for point in self.points if point.on_grid and point.value == value]

    def stable(self, index: int) -> list[DiagramPoint]:
        """The stable ones of `cycles`."""
        return [point for point in self.cycles(index) if point.orbit.stable]

    def trace_all(self) -> Iterator[DiagramPoint]:
        """Every branch that the search finds, through its folds, as its points come."""
        for index in self._seeds():
            yield from self._search_all(index)
        unseen = 0
        for index, point in enumerate(self._grid):
            guesses = [item for item in one_harmonic_cycles(point) if item.swivel < LARGEST_SWIVEL]
            excess = len(guesses) - len(self.cycles(index))
            if excess > unseen:
                yield from self._search_all(index)
            # What one harmonic sees and the search does not find is not sought again next door.
            unseen = max(0, len(guesses) - len(self.cycles(index)))

    def trace_stable(self) -> Iterator[DiagramPoint]:
        """Every branch of stable cycles that the search finds, up to its folds."""
        for index in dict.fromkeys((*self._seeds(), *range(len(self._grid)))):
            if not self.stable(index):
                yield from self._search_growing(index)
        for index in range(len(self._grid)):
            if not self.stable(index) and any(
                    point.orbit.stable is None for point in self.cycles(index)):
                self._lose(index, "the balance cannot tell stability where the swivel sticks")
                self.undecided.add(index)

    def trace(self, index: int, start: Orbit, only_to_fold: bool = False
              ) -> Iterator[DiagramPoint]:
        """The branch through ``start`` at value number ``index``, up and then down.

        ``only_to_fold`` ends it in a fold, unless it soon becomes stable again behind.
        """
        branch, position = self._branches, self._positions[index]
        self._branches += 1
        for direction in (1, -1):
            order, closed, origin = 0, False, start
            # Unstable points wait until the branch has become stable again.
            waiting: list[DiagramPoint] = []
            try:
                for there in follow(self._line, start, position, direction, self.settings,
                                    tuple(self._positions)):
                    if order == 0:
                        origin = there.orbit
                    closed = order > 0 and there.position == position and (
                        there.orbit.same_as(origin))
                    point = self._point(branch, order, there, closed)
                    order += direction
                    if order == direction < 0:
                        continue
                    if only_to_fold and there.orbit.stable is False:
                        if there.orbit.multiplier > _UNSTABLE_FOR_GOOD:
                            break
                        waiting.append(point)
                        continue
                    for found in (*waiting, point):
                        self.points.append(found)
                        yield found
                    waiting = []
            except ContinuationError as error:
                self._lose(index, error)
            if closed:
                return

    def _seeds(self) -> list[int]:
        last = len(self.values) - 1
        return list(dict.fromkeys((0, last, last // 2)))

    def _search_all(self, index: int) -> Iterator[DiagramPoint]:
        try:
            found = [item.orbit for item in all_cycles(self._grid[index])]
        except ContinuationError as error:
            self._lose(index, error)
            return
        for orbit in found:
            if orbit.swivel < LARGEST_SWIVEL and not any(
                    orbit.same_as(item.orbit, 1e-3) for item in self.cycles(index)):
                yield from self.trace(index, orbit)

    def _search_growing(self, index: int) -> Iterator[DiagramPoint]:
        try:
            growing = growing_cycle(self._grid[index], self.settings)
        except ContinuationError as error:
            self._lose(index, error)
            self.undecided.add(index)
            return
        if growing is not None and growing.stable is not False:
            yield from self.trace(index, growing, only_to_fold=True)

    def _point(self, branch: int, order: int, there: BranchPoint, closing: bool) -> DiagramPoint:
        index = self._index.get(there.position)
        low, high = self.values[0], self.values[-1]
        value = low + there.position * (high - low) if index is None else self.values[index]
        return DiagramPoint(branch, order, value, there.orbit, there.is_fold,
                            index is not None and not closing)

    def _lose(self, index: int, reason: object) -> None:
        self.losses.append(f"{self.axis.name} {self.values[index]:g}: {reason}")
