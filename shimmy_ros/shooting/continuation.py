"""A branch of cycles along a parameter, by pseudo-arclength steps, with its folds located."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from scipy.optimize import brentq

from ..ihb.system import System
from .cycle import Cycle
from .flow import FlowError, ParameterRate
from .modes import Model, Real, model_of
from .periodic import STAGNATION, TOLERANCE, Shot, shoot, upward_cycle

_ITERATIONS = 8
_FEW_ITERATIONS = 3
_GROWTH = 1.5
_SMALLEST_STEP = 1e-6
_STEEPEST_TURN = 0.9
_LARGEST_SHRINKAGE = 0.3
# By more the period does not change on the way to convergence.
_LARGEST_RATIO = 2.0
_PARAMETER_DIFFERENCE = 1e-5
_FOLD_ACCURACY = 1e-10
_NOTHING = 1e-6


class ContinuationError(ArithmeticError):
    """The branch could not be followed any further; the sentence says where and why."""


class _LostError(ArithmeticError):
    """Newton's method leads to no cycle."""


@dataclass(frozen=True)
class BranchPoint:
    """A cycle at a parameter value; ``fold`` tells whether the branch turns round there.

    ``slope`` is the parameter's share of the unit tangent in scaled variables, in the direction of
    travel.
    """

    parameter: float
    cycle: Cycle
    slope: float
    fold: bool
    iterations: int
    residual: float


class _Point(NamedTuple):
    """A converged shot at unknowns (x(0), T/2, parameter), and the unit tangent scaled by size."""

    unknowns: Real
    shot: Shot
    size: Real
    tangent: Real
    iterations: int


class _Family(NamedTuple):
    system: Callable[[float], System]
    scale: float
    bounds: tuple[float, float]
    section: int
    tolerance: float

    def shoot(self, unknowns: Real) -> Shot:
        parameter = float(unknowns[-1])
        low = max(parameter - _PARAMETER_DIFFERENCE * self.scale, self.bounds[0])
        high = min(parameter + _PARAMETER_DIFFERENCE * self.scale, self.bounds[1])
        rate = ParameterRate(self.model(low), self.model(high), high - low)
        return shoot(self.model(parameter), unknowns[:-2], float(unknowns[-2]), self.section, rate)

    def model(self, parameter: float) -> Model:
        return model_of(self.system(parameter))


def continue_branch(system: Callable[[float], System], start: Cycle, parameter: float, *,
                    direction: int, scale: float,
                    bounds: tuple[float, float] = (-np.inf, np.inf),
                    first_step: float = 0.02, largest_step: float = 0.1,
                    tolerance: float = TOLERANCE, locate_folds: bool = True
                    ) -> Iterator[BranchPoint]:
    """The branch of cycles of ``system(value)`` through ``start``, which is that at ``parameter``.

    Parameters
    ----------
    system : the system at a value of the parameter; called within ``bounds`` alone
    direction : +1 or -1, the way in which the parameter sets out
    scale : a change of the parameter that counts as much as a change of every amplitude by 100 %
    bounds : the branch ends where it reaches either value, with a point exactly there
    first_step, largest_step : arc length of a step in these scaled variables
    locate_folds : without, the branch passes its folds unmarked, which saves ten points each

    Yields the start, then the points in order, folds among them. A step that would turn the
    tangent sharply or shrink the motion to a fraction is refused and halved: neither a jump to
    rest nor a return onto the same branch passes for a continuation. A branch also ends where its
    cycles shrink to nothing, once they are a millionth of the largest.

    Raises ContinuationError where the branch cannot be followed.
    """
    family = _Family(system, scale, bounds, start.section, tolerance)
    unknowns = np.concatenate([start.state, [0.5 * start.period, parameter]])
    heading = np.zeros(len(unknowns))
    heading[-1] = float(direction)
    here = _converged(family, unknowns, _fixed_parameter(unknowns), heading)
    if here is None:
        raise ContinuationError(f"the start at {parameter:g} is not near a cycle")
    yield _branch_point(family, here)
    step, swing = first_step, 0.0
    while True:
        swing = max(swing, here.size[family.section])
        if here.size[family.section] < _NOTHING * swing:
            return
        following = _next(family, here, step, locate_folds)
        while following is None:
            step *= 0.5
            if step < _SMALLEST_STEP:
                raise ContinuationError("the branch cannot be followed beyond "
                                        f"{here.unknowns[-1]:g}")
            following = _next(family, here, step, locate_folds)
        if following.fold is not None:
            yield _branch_point(family, following.fold, fold=True)
        here = following.point
        yield _branch_point(family, here)
        if following.last:
            return
        if here.iterations <= _FEW_ITERATIONS:
            step = min(step * _GROWTH, largest_step)


class _Step(NamedTuple):
    """A step: the fold that it passes, if that is asked for, its end, and whether that is all."""

    fold: _Point | None
    point: _Point
    last: bool


def _next(family: _Family, here: _Point, step: float, locate_folds: bool) -> _Step | None:
    """The next step, or None where its end is not certain to be of the same branch."""
    predicted = here.unknowns + step * here.tangent * here.size
    within = min(max(predicted[-1], family.bounds[0]), family.bounds[1])
    at_bound = bool(within != predicted[-1])
    if at_bound:
        step *= (within - here.unknowns[-1]) / (predicted[-1] - here.unknowns[-1])
        predicted = here.unknowns + step * here.tangent * here.size
        predicted[-1] = within
        condition = _fixed_parameter(predicted)
    else:
        condition = _Condition(here.tangent / here.size, predicted)
    there = _converged(family, predicted, condition, here.tangent * here.size)
    if there is None:
        return None
    turn = float(here.tangent @ (there.tangent * there.size / here.size))
    turn /= float(np.linalg.norm(there.tangent * there.size / here.size))
    shrunk = there.size[family.section] < _LARGEST_SHRINKAGE * here.size[family.section]
    beyond = not family.bounds[0] <= there.unknowns[-1] <= family.bounds[1]
    turned = here.tangent[-1] * there.tangent[-1] < 0.0
    # A parameter that goes against the tangents at both ends has passed two folds.
    progress = (there.unknowns[-1] - here.unknowns[-1]) * here.tangent[-1]
    if turn < _STEEPEST_TURN or shrunk or beyond or (progress < 0.0 and not turned):
        return None
    if not (turned and locate_folds):
        return _Step(None, there, at_bound)
    fold = _fold(family, here, there)
    return None if fold is None else _Step(fold, there, at_bound)


class _Condition(NamedTuple):
    """row @ (unknowns - place) = 0."""

    row: Real
    place: Real


def _fixed_parameter(unknowns: Real) -> _Condition:
    row = np.zeros(len(unknowns))
    row[-1] = 1.0
    return _Condition(row, unknowns)


def _converged(family: _Family, unknowns: Real, condition: _Condition,
               heading: Real) -> _Point | None:
    """Newton's method for the equations and one condition; the tangent points along ``heading``."""
    last = np.inf
    shortest, longest = unknowns[-2] / _LARGEST_RATIO, unknowns[-2] * _LARGEST_RATIO
    for iteration in range(_ITERATIONS + 1):
        if not (family.bounds[0] <= unknowns[-1] <= family.bounds[1]
                and shortest <= unknowns[-2] <= longest):
            return None
        try:
            shot = family.shoot(unknowns)
        except FlowError:
            return None
        size = np.append(shot.size, family.scale)
        error = shot.error
        if error <= family.tolerance or (error <= STAGNATION and error > 0.5 * last):
            return _Point(unknowns, shot, size, _tangent(shot, size, heading), iteration)
        if error > last:
            # From a start near enough it only falls; a shorter step costs less than to go on.
            return None
        last = error
        row = condition.row * size
        weight = float(np.linalg.norm(row))
        matrix = np.vstack([shot.jacobian * size / shot.size[:, None], row / weight])
        offset = float(condition.row @ (unknowns - condition.place)) / weight
        try:
            change = -np.linalg.solve(matrix, np.append(shot.residual / shot.size, offset))
        except np.linalg.LinAlgError:
            return None
        unknowns = unknowns + change * size
    return None


def _tangent(shot: Shot, size: Real, heading: Real) -> Real:
    """The unit vector in scaled unknowns along which the residual keeps, towards ``heading``."""
    null = np.linalg.svd(shot.jacobian * size / shot.size[:, None])[2][-1]
    return np.asarray(null if null @ (heading / size) > 0.0 else -null)


def _fold(family: _Family, here: _Point, there: _Point) -> _Point | None:
    """The point between two where the parameter's share of the tangent is zero.

    None where Newton's method fails in between, since another fold is near.
    """
    row = here.tangent / here.size
    found = {0.0: here, 1.0: there}

    def slope(share: float) -> float:
        if share not in found:
            before = max(place for place in found if place < share)
            after = min(place for place in found if place > share)
            part = (share - before) / (after - before)
            start = found[before].unknowns
            guess = start + part * (found[after].unknowns - start)
            plane = _Condition(row, here.unknowns + share * (there.unknowns - here.unknowns))
            point = _converged(family, guess, plane, here.tangent * here.size)
            if point is None:
                raise _LostError
            found[share] = point
        return float(found[share].tangent[-1])

    try:
        brentq(slope, 0.0, 1.0, xtol=_FOLD_ACCURACY, rtol=_FOLD_ACCURACY)
    except _LostError:
        return None
    return min(found.values(), key=lambda point: abs(point.tangent[-1]))


def _branch_point(family: _Family, point: _Point, fold: bool = False) -> BranchPoint:
    parameter = float(point.unknowns[-1])
    return BranchPoint(parameter, upward_cycle(family.model(parameter), point.shot, family.section),
                       float(point.tangent[-1]), fold, point.iterations, point.shot.error)
