"""A branch of limit cycles along a parameter, by pseudo-arclength steps."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from .balance import balance
from .harmonics import Real
from .newton import (
    RESIDUAL_TOLERANCE,
    STEP_TOLERANCE,
    Phase,
    Point,
    jacobian,
    moved,
    scales,
    unknowns,
)
from .system import Family

_CORRECTOR_ITERATIONS = 8
_WANTED_ITERATIONS = 4
_LARGEST_STEP = 0.2
_SMALLEST_STEP = 1e-7
_STEEPEST_TURN = 0.9


class ContinuationError(ArithmeticError):
    """The branch could not be followed any further; the sentence says where and why."""


@dataclass(frozen=True)
class BranchPoint:
    """One converged point of a branch.

    ``slope`` is the parameter's component of the unit tangent in scaled variables, in the
    direction of travel: it changes sign at a fold. ``orientation`` is the sign of the determinant
    at fixed parameter.
    """

    point: Point
    parameter: float
    slope: float
    orientation: int
    iterations: int
    residual: float


class _Extended(NamedTuple):
    matrix: Real
    by_parameter: Real
    residual: Real
    error: float


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
    ``parameter_scale``, so that a step of 0.1 is a change of ten percent. The step adapts to the
    effort and to the curvature: a step that would turn sharply, which is how a corrector falls
    back onto the branch it came from or onto another, is refused and halved. Goes on until the
    caller stops it. Raises ContinuationError.
    """
    step = first_step
    point, size = start, np.append(scales(start, phase), parameter_scale)
    tangent: Real | None = None
    converged = _correct(family, point, parameter, None, size, active, phase)
    if converged is None:
        raise ContinuationError(f"the start of the branch at {parameter:g} does not converge")
    while True:
        point, parameter, terms, iterations = converged
        size = np.append(scales(point, phase), parameter_scale)
        new_tangent = _tangent(terms, size, tangent, direction)
        tangent = new_tangent
        orientation = int(np.linalg.slogdet(terms.matrix * size[:-1])[0])
        yield BranchPoint(point, parameter, float(tangent[-1]), orientation, iterations,
                          terms.error)
        if iterations <= _WANTED_ITERATIONS:
            step = min(_LARGEST_STEP, 1.5 * step)
        while True:
            attempt = _attempt(family, point, parameter, tangent, step, size, active, phase)
            if attempt is not None:
                converged = attempt
                break
            step *= 0.5
            if step < _SMALLEST_STEP:
                raise ContinuationError(
                    f"the branch could not be followed beyond parameter {parameter:g}")


def _attempt(family: Family, point: Point, parameter: float, tangent: Real, step: float,
             size: Real, active: tuple[int, ...], phase: Phase
             ) -> tuple[Point, float, _Extended, int] | None:
    predicted = moved(point, phase, unknowns(point, phase) + step * (size * tangent)[:-1])
    corrected = _correct(family, predicted, parameter + step * size[-1] * tangent[-1], tangent,
                         size, active, phase)
    if corrected is None:
        return None
    new_point, new_parameter, terms, _ = corrected
    new_size = np.append(scales(new_point, phase), size[-1])
    new_tangent = _tangent(terms, new_size, tangent, 0)
    chord = np.append(unknowns(new_point, phase) - unknowns(point, phase),
                      new_parameter - parameter) / size
    length = float(np.linalg.norm(chord))
    straight = min(float(new_tangent @ tangent), float(chord @ tangent) / length)
    if straight < _STEEPEST_TURN or length > 2.0 * step:
        return None
    return corrected


def _correct(family: Family, point: Point, parameter: float, tangent: Real | None, size: Real,
             active: tuple[int, ...], phase: Phase
             ) -> tuple[Point, float, _Extended, int] | None:
    """Newton's method in the plane normal to ``tangent``; without one at fixed parameter."""
    normal = np.zeros(size.size) if tangent is None else tangent
    if tangent is None:
        normal[-1] = 1.0
    previous = np.inf
    for iteration in range(1, _CORRECTOR_ITERATIONS + 1):
        if point.frequency <= 0.0:
            return None
        terms = _extended(family, point, parameter, active, phase)
        matrix = np.vstack([np.column_stack([terms.matrix, terms.by_parameter]) * size, normal])
        try:
            change = np.linalg.solve(matrix, np.append(-terms.residual, 0.0))
        except np.linalg.LinAlgError:
            return None
        length = float(np.linalg.norm(change))
        if terms.error <= RESIDUAL_TOLERANCE and length <= STEP_TOLERANCE:
            return point, parameter, terms, iteration
        if not length < max(1.0, 2.0 * previous):
            return None
        previous = length
        point = moved(point, phase, unknowns(point, phase) + (size * change)[:-1])
        parameter += float(size[-1] * change[-1])
    return None


def _extended(family: Family, point: Point, parameter: float, active: tuple[int, ...],
              phase: Phase) -> _Extended:
    terms = balance(family.system(parameter), point.coefficients, point.frequency, active,
                    family.derivative(parameter))
    assert terms.by_parameter is not None
    return _Extended(jacobian(terms, phase), terms.by_parameter, terms.residual, terms.error)


def _tangent(terms: _Extended, size: Real, old: Real | None, direction: int) -> Real:
    """The unit null vector of the scaled extended Jacobian, along ``old`` or ``direction``."""
    matrix = np.column_stack([terms.matrix, terms.by_parameter]) * size
    null = np.linalg.svd(matrix)[2][-1]
    sign = null[-1] * direction if old is None else float(null @ old)
    return np.asarray(null if sign >= 0.0 else -null)
