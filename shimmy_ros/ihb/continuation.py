"""A branch of limit cycles along a parameter, with its folds."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from .arclength import ContinuationError, Curve, CurvePoint, Evaluation, locate_turn, trace
from .balance import balance
from .harmonics import Real
from .newton import Phase, Point, jacobian, moved, scales, unknowns
from .system import Family

__all__ = ["BranchPoint", "ContinuationError", "branch"]


@dataclass(frozen=True)
class BranchPoint:
    """One converged point of a branch.

    ``slope`` is the parameter's component of the unit tangent in scaled variables, in the
    direction of travel: it changes sign at a fold, and ``is_fold`` marks the point where it is
    zero. ``orientation`` is the sign of the determinant at fixed parameter.
    """

    point: Point
    parameter: float
    slope: float
    orientation: int
    iterations: int
    residual: float
    is_fold: bool = False


def branch(
    family: Family,
    start: Point,
    parameter: float,
    parameter_scale: float,
    direction: int,
    active: tuple[int, ...],
    phase: Phase,
    first_step: float = 0.05,
) -> Iterator[BranchPoint]:
    """Follow the branch through ``start``, beginning towards larger (+1) or smaller (-1) parameter.

    Unknowns are scaled by the size of their coordinate, of the frequency, and by
    ``parameter_scale``. Folds are located and yielded as points of their own, and the branch goes
    on behind them. Goes on until the caller stops it. Raises ContinuationError.
    """
    curve = _Branch(family, start, parameter_scale, active, phase)
    before: CurvePoint | None = None
    for here in trace(curve, np.append(unknowns(start, phase), parameter), direction, first_step):
        if before is not None and before.slope * here.slope < 0.0:
            fold = locate_turn(curve, before, here)
            if fold is not None:
                yield curve.branch_point(fold, True)
        yield curve.branch_point(here, False)
        before = here


class _Branch(Curve):
    """The balance along a family: unknowns, then the parameter."""

    def __init__(self, family: Family, start: Point, parameter_scale: float,
                 active: tuple[int, ...], phase: Phase) -> None:
        self._family = family
        self._start = start
        self._parameter_scale = parameter_scale
        self._active = active
        self._phase = phase

    def evaluate(self, y: Real) -> Evaluation:
        point, parameter = moved(self._start, self._phase, y[:-1]), float(y[-1])
        if point.frequency <= 0.0:
            raise ValueError("the frequency left the positive numbers")
        terms = balance(self._family.system(parameter), point.coefficients, point.frequency,
                        self._active, self._family.derivative(parameter))
        assert terms.by_parameter is not None
        return Evaluation(
            terms.residual,
            np.column_stack([jacobian(terms, self._phase), terms.by_parameter]), terms.error)

    def sizes(self, y: Real) -> Real:
        point = moved(self._start, self._phase, y[:-1])
        return np.append(scales(point, self._phase), self._parameter_scale)

    def branch_point(self, here: CurvePoint, is_fold: bool) -> BranchPoint:
        matrix = here.evaluation.jacobian[:, :-1] * here.size[:-1]
        return BranchPoint(
            moved(self._start, self._phase, here.y[:-1]), float(here.y[-1]), here.slope,
            int(np.linalg.slogdet(matrix)[0]), here.iterations, here.evaluation.error, is_fold)
