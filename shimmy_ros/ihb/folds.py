"""Folds of limit cycles, tracked in two parameters: the boundary of shimmy.

At a fold the Jacobian J of the balance at fixed parameters is singular. Bordered by b and c,
[[J, b], [c', 0]] [v, g] = [0, 1] defines a scalar g that vanishes there, with the gradient
-u' dJ v from the left solution u; with it the fold is a regular solution of n + 1 equations.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass

import numpy as np

from .arclength import Curve, CurvePoint, Evaluation, trace
from .balance import balance
from .continuation import BranchPoint
from .harmonics import Real
from .newton import Phase, Point, jacobian, moved, scales, unknowns
from .system import System

_DIFFERENCE = 1e-5


@dataclass(frozen=True)
class Plane:
    """Systems over two parameters, and their derivatives by the first and by the second."""

    system: Callable[[float, float], System]
    by_first: Callable[[float, float], System]
    by_second: Callable[[float, float], System]


@dataclass(frozen=True)
class Fold:
    """A fold: the cycle there and both parameters."""

    point: Point
    first: float
    second: float


def track_fold(plane: Plane, start: BranchPoint, second: float, scales_of: tuple[float, float],
               direction: int, active: tuple[int, ...], phase: Phase) -> Iterator[Fold]:
    """Follow the fold ``start``, found along the first parameter at the ``second`` given.

    ``scales_of`` are the sizes of both parameters; ``direction`` tells whether the second one
    grows (+1) or falls (-1) at first. Goes on until the caller stops it. Raises
    ContinuationError.
    """
    curve = _Folds(plane, start.point, scales_of, active, phase)
    begin = np.concatenate([unknowns(start.point, phase), [start.parameter, second]])
    curve.adapt(begin)
    for here in trace(curve, begin, direction):
        curve.adapt(here.y)
        yield curve.fold(here)


class _Folds(Curve):
    """The balance with the bordered determinant: unknowns, then both parameters."""

    def __init__(self, plane: Plane, start: Point, scales_of: tuple[float, float],
                 active: tuple[int, ...], phase: Phase) -> None:
        self._plane = plane
        self._start = start
        self._scales = scales_of
        self._active = active
        self._phase = phase
        self._left = self._right = np.zeros(unknowns(start, phase).size)

    def adapt(self, y: Real) -> None:
        """Border with the singular vectors at y, which keeps the bordered matrix regular.

        Their signs are arbitrary, and kept.
        """
        matrix = self._scaled_jacobian(y) * self._unknown_sizes(y)
        left, _, right = np.linalg.svd(matrix)
        self._left = _towards(self._left, left[:, -1])
        self._right = _towards(self._right, right[-1])

    def sizes(self, y: Real) -> Real:
        return np.concatenate([self._unknown_sizes(y), self._scales])

    def evaluate(self, y: Real) -> Evaluation:
        point = self._point(y)
        if point.frequency <= 0.0:
            raise ValueError("the frequency left the positive numbers")
        first, second = float(y[-2]), float(y[-1])
        system = self._plane.system(first, second)
        terms = balance(system, point.coefficients, point.frequency, self._active,
                        self._plane.by_first(first, second))
        other = balance(system, point.coefficients, point.frequency, self._active,
                        self._plane.by_second(first, second))
        assert terms.by_parameter is not None
        assert other.by_parameter is not None
        size = self._unknown_sizes(y)
        matrix = jacobian(terms, self._phase)
        scale = float(np.linalg.norm(matrix * size))
        bordered = np.block([[matrix * size / scale, self._left[:, None]],
                             [self._right[None], np.zeros((1, 1))]])
        unit = np.append(np.zeros(size.size), 1.0)
        right = np.linalg.solve(bordered, unit)
        left = np.linalg.solve(bordered.T, unit)
        v, g, u = right[:-1], float(right[-1]), left[:-1]
        change = size * v * _DIFFERENCE
        gradient = np.empty(y.size)
        step = np.concatenate([change, [0.0, 0.0]])
        along = (self._scaled_jacobian(y + step) - self._scaled_jacobian(y - step))
        gradient[:-2] = -(u @ along) / (2.0 * _DIFFERENCE * scale)
        for index, parameter_scale in zip((-2, -1), self._scales, strict=True):
            step = np.zeros(y.size)
            step[index] = _DIFFERENCE * parameter_scale
            along = self._scaled_jacobian(y + step) - self._scaled_jacobian(y - step)
            gradient[index] = -(u @ along @ (size * v)) / (
                2.0 * _DIFFERENCE * parameter_scale * scale)
        top = np.column_stack([matrix, terms.by_parameter, other.by_parameter])
        return Evaluation(np.append(terms.residual, scale * g), np.vstack([top, scale * gradient]),
                          max(terms.error, abs(g)))

    def fold(self, here: CurvePoint) -> Fold:
        return Fold(self._point(here.y), float(here.y[-2]), float(here.y[-1]))

    def _point(self, y: Real) -> Point:
        return moved(self._start, self._phase, y[:-2])

    def _unknown_sizes(self, y: Real) -> Real:
        return scales(self._point(y), self._phase)

    def _scaled_jacobian(self, y: Real) -> Real:
        point = self._point(y)
        terms = balance(self._plane.system(float(y[-2]), float(y[-1])), point.coefficients,
                        point.frequency, self._active)
        return jacobian(terms, self._phase)


def _towards(before: Real, vector: Real) -> Real:
    return vector if float(vector @ before) >= 0.0 else -vector
