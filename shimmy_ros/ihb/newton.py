"""Newton's method on the harmonic balance, with one Fourier coefficient fixed."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from .balance import Balance, balance
from .harmonics import Real
from .system import System

RESIDUAL_TOLERANCE = 1e-11
STEP_TOLERANCE = 1e-8
MAXIMUM_ITERATIONS = 25
# A step that would change the frequency or the size of a coordinate by more is shortened.
_LARGEST_RELATIVE_STEP = 0.5
_HALVINGS = 8


class Phase(NamedTuple):
    """The coefficient that is held, eq. (14) being one equation short: sine 1 of one coordinate.

    A cycle has no phase of its own, so that any value can be asked for. ``position`` counts in
    the active coordinates' flat coefficient vector; the frequency takes its place as an unknown.
    """

    position: int


class Point(NamedTuple):
    """An iterate: the active coordinates' coefficients (m, 2N) and the frequency [rad/s]."""

    coefficients: Real
    frequency: float


class Convergence(NamedTuple):
    """Where Newton's method ended; ``orientation`` is the sign of the Jacobian's determinant."""

    converged: bool
    point: Point
    iterations: int
    residual: float
    orientation: int
    message: str


def phase_of(active: tuple[int, ...], harmonics: int, reference: int) -> Phase:
    """Hold the first sine coefficient of the coordinate ``reference``, one of ``active``."""
    return Phase(active.index(reference) * 2 * harmonics + harmonics)


def unknowns(point: Point, phase: Phase) -> Real:
    """The vector that Newton's method works on, shape (2N m,)."""
    vector = point.coefficients.flatten()
    vector[phase.position] = point.frequency
    return vector


def moved(point: Point, phase: Phase, vector: Real) -> Point:
    """The iterate for other unknowns; the held coefficient is that of ``point``."""
    coefficients = vector.copy()
    coefficients[phase.position] = point.coefficients.flat[phase.position]
    return Point(coefficients.reshape(point.coefficients.shape), float(vector[phase.position]))


def scales(point: Point, phase: Phase) -> Real:
    """The size of each unknown: its coordinate's first harmonic, or the frequency itself."""
    size = np.linalg.norm(point.coefficients, axis=1)
    result = np.repeat(np.maximum(size, 1e-6 * size.max()), point.coefficients.shape[1])
    result[phase.position] = point.frequency
    return result


def jacobian(terms: Balance, phase: Phase) -> Real:
    """Derivative of the residual by the unknowns, shape (2N m, 2N m)."""
    matrix = terms.by_coefficients.copy()
    matrix[:, phase.position] = terms.by_frequency
    return matrix


def newton(system: System, start: Point, active: tuple[int, ...], phase: Phase) -> Convergence:
    """Solve the balance from ``start`` by a damped Newton's method.

    Converged means that the relative residual is at most RESIDUAL_TOLERANCE and the last step at
    most STEP_TOLERANCE of the solution's size. The phase is that of ``start``.
    """
    point = start
    terms = balance(system, point.coefficients, point.frequency, active)
    iterations = 0
    orientation = 0
    while iterations < MAXIMUM_ITERATIONS:
        matrix = jacobian(terms, phase)
        size = scales(point, phase)
        scaled = matrix * size
        try:
            step = np.linalg.solve(scaled, -terms.residual)
        except np.linalg.LinAlgError:
            return Convergence(False, point, iterations, terms.error, 0, "the Jacobian is singular")
        iterations += 1
        length = float(np.linalg.norm(step))
        if not np.isfinite(length):
            return Convergence(False, point, iterations, terms.error, 0, "an iterate overflowed")
        if terms.error <= RESIDUAL_TOLERANCE and length <= STEP_TOLERANCE:
            orientation = int(np.linalg.slogdet(scaled)[0])
            return Convergence(True, point, iterations, terms.error, orientation, "converged")
        fraction = min(1.0, _LARGEST_RELATIVE_STEP / length) if length > 0.0 else 1.0
        accepted = None
        for _ in range(_HALVINGS):
            candidate = moved(point, phase, unknowns(point, phase) + fraction * size * step)
            tried = balance(system, candidate.coefficients, candidate.frequency, active)
            if tried.error < terms.error or tried.error <= RESIDUAL_TOLERANCE:
                accepted = candidate, tried
                break
            fraction *= 0.5
        if accepted is None:
            return Convergence(False, point, iterations, terms.error, 0,
                               "the residual stopped falling")
        point, terms = accepted
    return Convergence(False, point, iterations, terms.error, orientation,
                       f"no convergence in {MAXIMUM_ITERATIONS} iterations")
