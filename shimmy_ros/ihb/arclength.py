"""Pseudo-arclength steps along a curve F(y) = 0 with one unknown more than equations.

Unknowns are scaled, so that a step is a relative change: a velocity of 100 m/s and a coefficient
of 0.01 rad weigh the same.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import NamedTuple, Protocol

import numpy as np

from .harmonics import Real
from .newton import RESIDUAL_TOLERANCE, STEP_TOLERANCE

_CORRECTOR_ITERATIONS = 12
_WANTED_ITERATIONS = 5
_HALVINGS = 5
_LARGEST_STEP = 0.2
_SMALLEST_STEP = 1e-7
# Below this cosine between two tangents a step is too long for the curve's bend.
_STEEPEST_TURN = 0.9
# Two curves that pass each other closer than a step of this length are taken to cross.
_NARROWEST_GAP = 1e-3
_LOCATION_ITERATIONS = 60
_LOCATION_TOLERANCE = 1e-10


class ContinuationError(ArithmeticError):
    """The curve could not be followed any further; the sentence says where and why."""


class Evaluation(NamedTuple):
    """F (n,), its derivative (n, n + 1), and the relative error by which convergence is judged."""

    residual: Real
    jacobian: Real
    error: float


class Curve(Protocol):
    """A curve to be followed."""

    def evaluate(self, y: Real) -> Evaluation:
        """F at y (n + 1,). Raises ArithmeticError or ValueError where it is not defined."""

    def sizes(self, y: Real) -> Real:
        """The size of each unknown near y, shape (n + 1,), all positive."""


@dataclass(frozen=True)
class CurvePoint:
    """A point of the curve: ``y``, the unit ``tangent`` in variables scaled by ``size``.

    ``iterations`` were needed; ``step`` was the length of the step that led here. ``sense`` is
    the sign of the determinant of the Jacobian with the tangent below it: it keeps along a curve,
    through its turns, and changes where another one crosses.
    """

    y: Real
    tangent: Real
    size: Real
    evaluation: Evaluation
    iterations: int
    step: float
    sense: int

    @property
    def slope(self) -> float:
        """The last unknown's component of the tangent."""
        return float(self.tangent[-1])


def trace(curve: Curve, start: Real, direction: int, first_step: float = 0.05
          ) -> Iterator[CurvePoint]:
    """The points of the curve from near ``start`` on, the last unknown growing (+1) at first or
    falling (-1).

    The step adapts to the effort and the bend: one that would turn sharply or change the sense,
    which is how a corrector falls back onto the piece it came from or onto another one, is refused
    and halved.
    Goes on until the caller stops. Raises ContinuationError.
    """
    size = curve.sizes(start)
    normal = np.zeros(start.size)
    normal[-1] = 1.0
    corrected = _correct(curve, start, normal, size)
    if corrected is None:
        raise ContinuationError(f"the start at parameter {start[-1]:g} does not converge")
    here = _point(curve, corrected, float(direction) * normal, 0.0)
    step = first_step
    while True:
        yield here
        if here.iterations <= _WANTED_ITERATIONS:
            step = min(_LARGEST_STEP, 1.5 * step)
        while True:
            following = step_from(curve, here, step)
            if following is not None and _smooth(here, following):
                here = following
                break
            step *= 0.5
            if step < _SMALLEST_STEP:
                raise ContinuationError(
                    f"the branch could not be followed beyond parameter {here.y[-1]:g}")


def step_from(curve: Curve, point: CurvePoint, step: float) -> CurvePoint | None:
    """The point of the curve a ``step`` ahead of ``point`` (behind, if negative), if any."""
    predicted = point.y + step * point.size * point.tangent
    corrected = _correct(curve, predicted, point.tangent, point.size)
    return None if corrected is None else _point(curve, corrected, point.tangent, abs(step))


def locate_turn(curve: Curve, before: CurvePoint, after: CurvePoint) -> CurvePoint | None:
    """The fold between two successive points whose slopes differ in sign; None if not found.

    There the last unknown's component of the tangent vanishes. By the Illinois variant of the
    secant method on the length of the step from ``before``.
    """
    low, high = 0.0, after.step
    at_low, at_high = before.slope, after.slope
    best: CurvePoint | None = None
    for _ in range(_LOCATION_ITERATIONS):
        step = (low * at_high - high * at_low) / (at_high - at_low)
        middle = step_from(curve, before, step)
        if middle is None:
            return best
        best = middle
        if abs(middle.slope) <= _LOCATION_TOLERANCE or high - low <= 1e-14:
            return best
        if (middle.slope < 0.0) == (before.slope < 0.0):
            low, at_low = step, middle.slope
            at_high *= 0.5
        else:
            high, at_high = step, middle.slope
            at_low *= 0.5
    return best


def _point(curve: Curve, corrected: tuple[Real, Evaluation, int], along: Real, step: float
           ) -> CurvePoint:
    y, evaluation, iterations = corrected
    size = curve.sizes(y)
    matrix = evaluation.jacobian * size
    null = np.linalg.svd(matrix)[2][-1]
    tangent = np.asarray(null if float(null @ along) >= 0.0 else -null)
    sense = int(np.linalg.slogdet(np.vstack([matrix, tangent]))[0])
    return CurvePoint(y, tangent, size, evaluation, iterations, step, sense)


def _smooth(before: CurvePoint, after: CurvePoint) -> bool:
    chord = (after.y - before.y) / before.size
    length = float(np.linalg.norm(chord))
    return bool(
        0.0 < length <= 2.0 * after.step
        and (after.sense == before.sense or after.step <= _NARROWEST_GAP)
        and float(after.tangent @ before.tangent) > _STEEPEST_TURN
        and float(chord @ before.tangent) > _STEEPEST_TURN * length)


def _correct(curve: Curve, y: Real, normal: Real, size: Real
             ) -> tuple[Real, Evaluation, int] | None:
    """Newton's method in the plane through ``y`` normal to ``normal``, in scaled variables."""
    try:
        evaluation = curve.evaluate(y)
        for iteration in range(1, _CORRECTOR_ITERATIONS + 1):
            matrix = np.vstack([evaluation.jacobian * size, normal])
            change = np.linalg.solve(matrix, np.append(-evaluation.residual, 0.0))
            length = float(np.linalg.norm(change))
            if evaluation.error <= RESIDUAL_TOLERANCE and length <= STEP_TOLERANCE:
                return y, evaluation, iteration
            if not length <= 1.0:
                return None
            fraction = 1.0
            for _ in range(_HALVINGS):
                tried = curve.evaluate(y + fraction * size * change)
                if tried.error < evaluation.error or tried.error <= RESIDUAL_TOLERANCE:
                    break
                fraction *= 0.5
            else:
                return None
            y, evaluation = y + fraction * size * change, tried
    except (ArithmeticError, ValueError, np.linalg.LinAlgError):
        # Left the region in which the balance is defined; a shorter step may stay inside.
        return None
    return None
