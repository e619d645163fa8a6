"""Newton's method on the harmonic balance, with one Fourier coefficient fixed."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

import numpy as np

from . import loops
from .balance import Balance, add_general, balance, packed, recovered
from .elements import Element
from .loops import Real
from .system import System

RESIDUAL_TOLERANCE = 1e-11
STEP_TOLERANCE = 1e-8
MAXIMUM_ITERATIONS = 25
# With the held coefficient zero and cosine 1 positive, the determinant is minus the growth
# determinant's derivative at zero: negative exactly if an even number of disturbances grows
# without turning. A stable cycle has this sign, the one that it meets in a fold the other.
STABLE_ORIENTATION = -1
# A step that would change the frequency or the size of a coordinate by more is shortened.
_LARGEST_RELATIVE_STEP = 0.5
_HALVINGS = 8
# As ``loops`` takes them.
NEWTON_SETTINGS = (RESIDUAL_TOLERANCE, STEP_TOLERANCE, _LARGEST_RELATIVE_STEP,
                   MAXIMUM_ITERATIONS, _HALVINGS)
_ENDINGS = {
    loops.CONVERGED: "converged",
    loops.NOT_FALLING: "the residual stopped falling",
    loops.TOO_MANY: f"no convergence in {MAXIMUM_ITERATIONS} iterations",
    loops.OVERFLOWED: "an iterate overflowed",
}


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
    """The size of each unknown: its coordinate's, or the frequency itself."""
    result = np.empty(point.coefficients.size)
    loops.unknown_sizes(np.ascontiguousarray(point.coefficients), point.frequency, phase.position,
                        result)
    return result


def jacobian(terms: Balance, phase: Phase) -> Real:
    """Derivative of the residual by the unknowns, shape (2N m, 2N m)."""
    matrix = terms.by_coefficients.copy()
    matrix[:, phase.position] = terms.by_frequency
    return matrix


class Solved(NamedTuple):
    """A converged point with the coefficients (n, 2N) of all coordinates, the eliminated ones
    included, and the relative residual of their balance."""

    convergence: Convergence
    coefficients: Real
    residual: float


def newton(system: System, start: Point, active: tuple[int, ...], phase: Phase) -> Convergence:
    """Solve the balance from ``start`` by a damped Newton's method.

    Converged means that the relative residual is at most RESIDUAL_TOLERANCE and the last step at
    most STEP_TOLERANCE of the solution's size. The phase is that of ``start``.
    """
    general = system.general_elements
    solve = _newton_with(general, active) if general else loops.newton
    try:
        # Overflow is found out by the loop itself.
        with np.errstate(all="ignore"):
            return _convergence(solve(*packed(system, active), *_start(start, phase)))
    except np.linalg.LinAlgError:
        return _singular(start)
    except ArithmeticError:
        # Python's own numbers, where the loop is not compiled, raise it.
        return Convergence(False, start, 0, math.nan, 0, _ENDINGS[loops.OVERFLOWED])


def solve_point(system: System, start: Point, active: tuple[int, ...], phase: Phase) -> Solved:
    """As newton, followed by a check of the balance of every coordinate."""
    if not system.general_elements:
        try:
            *ending, coefficients, residual = loops.solve_point(
                *packed(system, active), *_start(start, phase))
        except np.linalg.LinAlgError:
            return Solved(_singular(start), np.empty((0, 0)), math.nan)
        return Solved(_convergence(ending), coefficients, residual)
    convergence = newton(system, start, active, phase)
    point = convergence.point
    coefficients = recovered(system, point.coefficients, point.frequency, active)
    everything = tuple(range(system.dofs))
    with np.errstate(all="ignore"):
        residual = balance(system, coefficients, point.frequency, everything).error
    return Solved(convergence, coefficients, residual)


def step_once(system: System, start: Point, active: tuple[int, ...], phase: Phase
              ) -> tuple[Real, float] | None:
    """The coefficients (n, 2N) of all coordinates and the frequency [rad/s] after one undamped
    step from ``start``; None where there is none."""
    general = system.general_elements
    step = loops.stepped
    if general:
        step = loops.with_replacement(step, assemble=_assemble_with(general, active))
    try:
        coefficients, frequency = step(
            *packed(system, active), np.ascontiguousarray(start.coefficients), start.frequency,
            phase.position)
    except np.linalg.LinAlgError:
        return None
    if not (frequency > 0.0 and np.all(np.isfinite(coefficients))):
        return None
    return coefficients, frequency


def _start(start: Point, phase: Phase) -> tuple[Any, ...]:
    return (np.ascontiguousarray(start.coefficients), start.frequency, phase.position,
            *NEWTON_SETTINGS)


def _convergence(end: Sequence[Any]) -> Convergence:
    coefficients, frequency, iterations, residual, orientation, ending = end
    return Convergence(ending == loops.CONVERGED, Point(coefficients, frequency), iterations,
                       residual, orientation, _ENDINGS[ending])


def _singular(start: Point) -> Convergence:
    return Convergence(False, start, 0, math.nan, 0, "the Jacobian is singular")


def _newton_with(general: tuple[Element, ...], active: tuple[int, ...]) -> Callable[..., Any]:
    """loops.newton, not compiled, with the elements added that cannot be."""
    return loops.with_replacement(loops.newton, assemble=_assemble_with(general, active))


def _assemble_with(general: tuple[Element, ...], active: tuple[int, ...]) -> Callable[..., None]:
    """loops.assemble with the elements added that cannot be compiled."""

    def assemble(*arguments: Any) -> None:
        loops.assemble(*arguments)
        for element in general:
            add_general(element, active, *arguments[9:])

    return assemble
