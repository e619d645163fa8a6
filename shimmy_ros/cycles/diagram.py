"""The limit cycles over one parameter: what each value comes to, and the branches of cycles."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import pairwise

from ..gear.axes import Axis
from ..gear.parameters import ParameterError
from ..gear.system import OperatingPoint, family_between
from .branches import LARGEST_SWIVEL, BranchPoint, ContinuationError, Line, follow
from .limit_cycles import all_cycles
from .one_harmonic import one_harmonic_cycles
from .orbits import Orbit
from .settings import Settings
from .stable_cycle import stable_cycle
from .verdict import Verdict, excesses

# Behind a fold, a branch with a larger multiplier than this leads away from stable cycles.
_UNSTABLE_FOR_GOOD = 1.5
# Two cycles at one value are the same within this, apart from their errors.
_SAME = 1e-3


@dataclass(frozen=True)
class DiagramPoint:
    """A cycle of branch number ``branch`` at a ``value`` of the parameter.

    ``order`` counts along the branch, also downwards from where it was found. ``is_fold`` marks a
    fold; ``on_grid`` a point at one of the values asked for, other than the start again;
    ``beyond_limits`` names what passes the model's limits.
    """

    branch: int
    order: int
    value: float
    orbit: Orbit
    is_fold: bool
    on_grid: bool
    beyond_limits: tuple[str, ...] = ()


class Diagram:
    """What the ``values`` of one parameter come to, and branches over them as far as traced.

    ``verdicts``, by the number of their value, grow while `judge` runs, and ``points`` while
    `trace_all` or `trace_stable` does. ``losses`` are sentences about branches that were lost and
    values at which a solve did not converge.
    """

    def __init__(self, point: OperatingPoint, axis: Axis, values: Sequence[float],
                 settings: Settings) -> None:
        """``values`` ascend, and are at least two. Raises ParameterError."""
        if len(values) < 2 or any(b <= a for a, b in pairwise(values)):
            raise ParameterError(f"values of {axis.name} must be at least two and ascend")
        self.axis, self.settings = axis, settings
        self.values = tuple(float(value) for value in values)
        self.points: list[DiagramPoint] = []
        self.verdicts: dict[int, Verdict] = {}
        self.losses: list[str] = []
        self._base = point
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

    def verdict(self, index: int) -> Verdict:
        """What value number ``index`` comes to, from its nearest neighbour that is known."""
        if index not in self.verdicts:
            near = min(self.verdicts, key=lambda known: abs(known - index), default=None)
            start = None if near is None else self.verdicts[near]
            found = self.verdicts[index] = stable_cycle(self._grid[index], self.settings, start)
            if found.failed:
                self._lose(index, found.reason)
        return self.verdicts[index]

    def judge(self) -> Iterator[Verdict]:
        """What every value comes to, in ascending order."""
        for index in range(len(self._grid)):
            yield self.verdict(index)

    def stable_orbits(self, index: int) -> list[Orbit]:
        """The stable cycles known at value number ``index``, each once, the verdict's first."""
        verdict = self.verdicts.get(index)
        found: list[Orbit] = [] if verdict is None else list(verdict.stable_cycles)
        for point in self.stable(index):
            if not any(point.orbit.same_as(other, _SAME) for other in found):
                found.append(point.orbit)
        return found

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
        """Every branch of stable cycles, up to its folds, through the verdicts that are known.

        Where there is none, and no branch either, there will be one.
        """
        for index in dict.fromkeys((*self._seeds(), *range(len(self._grid)))):
            if index in self.verdicts or not self.stable(index):
                for orbit in self.verdict(index).stable_cycles:
                    if not any(orbit.same_as(point.orbit, _SAME) for point in self.stable(index)):
                        yield from self.trace(index, orbit, only_to_fold=True)

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
                    orbit.same_as(item.orbit, _SAME) for item in self.cycles(index)):
                yield from self.trace(index, orbit)

    def _point(self, branch: int, order: int, there: BranchPoint, closing: bool) -> DiagramPoint:
        index = self._index.get(there.position)
        low, high = self.values[0], self.values[-1]
        value = low + there.position * (high - low) if index is None else self.values[index]
        operating = self.axis.at(self._base, value) if index is None else self._grid[index]
        beyond = excesses(operating, there.orbit, self.settings.limits)
        return DiagramPoint(branch, order, value, there.orbit, there.is_fold,
                            index is not None and not closing,
                            tuple(excess.quantity for excess in beyond))

    def _lose(self, index: int, reason: object) -> None:
        self.losses.append(f"{self.axis.name} {self.values[index]:g}: {reason}")
