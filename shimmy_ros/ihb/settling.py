"""A first guess of a cycle by integration: the motion that an oscillation settles to.

For relaxation oscillations, which grow from rest without turning or are far from a sine, so that
the describing function does not lead to them. Without Coulomb friction, whose equations are not
smooth.
"""

from __future__ import annotations

import warnings
from collections.abc import Callable, Iterator
from typing import Any, cast

import numpy as np
from numpy.typing import NDArray

from .describing_function import FirstHarmonic, linear_modes, reference_coordinate, separated
from .elements import OddElement, QuadraticDamping
from .harmonics import Real, to_complex
from .newton import Point
from .system import System

_TOLERANCE = 1e-7
# Of the equations of motion, in all: a second or two.
_MOST_EVALUATIONS = 30_000
# Successive half periods of a settled motion differ by less, relative to its size.
_SETTLED = 1e-5
# Beginning where the elements are so small a part of the forces.
_SMALL_PART = 0.01
_SMALLEST_EXPONENT, _LARGEST_EXPONENT = -40, 40
_SAMPLES = 1024
# Rates [1/s] beyond which steps are no numbers any more.
_SLOWEST = 1e-100
_TINY = 1e-300

Dense = Callable[[float], Real]


def settled_motions(system: System, guesses: list[FirstHarmonic], harmonics: int
                    ) -> Iterator[Point]:
    """Coefficients (n, 2N) and frequency of what motions settle to, of ``system`` without friction.

    From ``guesses`` first, then from every mode that grows at rest. A motion that does not settle
    to an odd cycle, or leaves the range of numbers, gives none, and after some ten thousand
    evaluations of the equations of motion there are no more.
    """
    motion = _Motion(system)
    starts: list[Real | None] = []
    for guess in guesses:
        x = to_complex(guess.coefficients)[:, 0]
        starts.append(np.concatenate([x.real, -guess.frequency * x.imag]))
    for mode in linear_modes(separated(system)):
        if mode.rate.real > 0.0:
            starts.append(motion.small(
                np.concatenate([mode.shape.real, (mode.rate * mode.shape).real])))
    for start in starts:
        found = None if start is None else _settled(motion, start, harmonics)
        if found is not None:
            yield found


class _MotionError(ArithmeticError):
    """The motion leaves the range of numbers, or takes too long."""


class _Motion:
    """The equations of motion in the state (q, dq/dt), shape (2n,)."""

    def __init__(self, system: System) -> None:
        self.reference = reference_coordinate(system)
        self._system = system
        self._inverse = system.inverse_mass
        self._left = _MOST_EVALUATIONS

    def rate(self, _: float, state: Real) -> Real:
        """d(state)/dt, shape (2n,). Raises _MotionError."""
        self._left -= 1
        if self._left < 0:
            raise _MotionError("the motion takes too long")
        return _finite(self._rate(state))

    def jacobian(self, _: float, state: Real) -> Real:
        """Its derivative by the state, shape (2n, 2n). Raises _MotionError."""
        return _finite(self._jacobian(state))

    def _jacobian(self, state: Real) -> Real:
        place, velocity = np.split(state, 2)
        damping, stiffness = self._system.damping.copy(), self._system.stiffness.copy()
        for element in self._system.elements:
            dofs = list(element.dofs)
            if isinstance(element, QuadraticDamping):
                damping[dofs, dofs] += 2.0 * element.coefficient * np.abs(velocity[dofs])
            elif isinstance(element, OddElement):
                at = place[dofs, None], velocity[dofs, None]
                stiffness[np.ix_(dofs, dofs)] += element.stiffness(*at)[..., 0]
                damping[np.ix_(dofs, dofs)] += element.damping(*at)[..., 0]
        count = place.size
        return np.block([[np.zeros((count, count)), np.eye(count)],
                         [-self._inverse @ stiffness, -self._inverse @ damping]])

    def small(self, direction: Real) -> Real | None:
        """A multiple of a state at which the elements hardly matter beside their tangents."""
        tangents = self._jacobian(np.zeros(direction.size))
        best = None
        for exponent in range(_SMALLEST_EXPONENT, _LARGEST_EXPONENT):
            state = 4.0**exponent * direction
            linear = tangents @ state
            if not np.linalg.norm(self._rate(state) - linear) <= (
                    _SMALL_PART * np.linalg.norm(linear)):
                break
            best = state
        return best

    def _rate(self, state: Real) -> Real:
        place, velocity = np.split(state, 2)
        force = self._system.damping @ velocity + self._system.stiffness @ place
        for element in self._system.elements:
            dofs = list(element.dofs)
            if isinstance(element, QuadraticDamping):
                force[dofs] += element.coefficient * np.abs(velocity[dofs]) * velocity[dofs]
            elif isinstance(element, OddElement):
                force[dofs] += element.force(place[dofs, None], velocity[dofs, None])[:, 0]
        return np.concatenate([velocity, -self._inverse @ force])


def _settled(motion: _Motion, start: Real, harmonics: int) -> Point | None:
    """The cycle that the motion from ``start`` settles to, found where the reference passes zero.
    """
    # Not at the top: it takes longer to import than all else, and few systems need it.
    from scipy.integrate import Radau

    size = np.abs(start)
    crossed, earlier = None, 0.0
    # A singular step is rejected by the solver, with a warning that nobody can use.
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        try:
            quickest = float(np.abs(np.linalg.eigvals(motion.jacobian(0.0, start))).max())
            if not _SLOWEST < quickest < 1.0 / _SLOWEST:
                return None
            # Not from zero, next to which there are steps too small to divide by.
            solver: Any = Radau(
                motion.rate, 1.0 / quickest, start, np.inf, rtol=_TOLERANCE,
                atol=cast(Any, _atol(size)), jac=motion.jacobian, first_step=1e-3 / quickest)
            pieces: list[tuple[float, Dense]] = []
            while True:
                before = solver.y[motion.reference]
                solver.step()
                if solver.status != "running":
                    return None
                size = np.maximum(size, np.abs(solver.y))
                solver.atol = _atol(size)
                dense: Dense = solver.dense_output()
                pieces.append((solver.t, dense))
                if (before < 0.0) == (solver.y[motion.reference] < 0.0):
                    continue
                time = _zero(dense, motion.reference, solver.t_old, solver.t)
                state = dense(time)
                if crossed is not None and np.all(np.abs(state + crossed) <= _SETTLED * size):
                    return _coefficients(pieces, earlier, time, harmonics)
                crossed, earlier = state, time
                size = np.abs(state)
                pieces = pieces[-1:]
        except (_MotionError, np.linalg.LinAlgError):
            # It grows without bound, or has not settled in all the time that it is given.
            return None


def _atol(size: Real) -> Real:
    return np.asarray(_TOLERANCE * np.maximum(size, 1e-6 * float(size.max())) + _TINY)


def _zero(dense: Dense, reference: int, low: float, high: float) -> float:
    """When the reference coordinate passes zero between two times, by bisection."""
    rising = dense(high)[reference] >= 0.0
    while True:
        middle = 0.5 * (low + high)
        if not low < middle < high:
            return middle
        if (dense(middle)[reference] >= 0.0) == rising:
            high = middle
        else:
            low = middle


def _coefficients(pieces: list[tuple[float, Dense]], start: float, end: float, harmonics: int
                  ) -> Point:
    """The odd harmonics of the motion in the half period from ``start`` to ``end`` [s]."""
    times = start + (end - start) * np.arange(_SAMPLES) / _SAMPLES
    ends = np.array([time for time, _ in pieces])
    which = np.searchsorted(ends, times).clip(max=len(pieces) - 1)
    states = np.array([pieces[i][1](time) for i, time in zip(which, times, strict=True)])
    half = states[:, :states.shape[1] // 2].T
    spectrum = np.fft.rfft(np.concatenate([half, -half], axis=1), axis=1)
    x = spectrum[:, 1:2 * harmonics:2] / _SAMPLES
    return Point(np.concatenate([x.real, -x.imag], axis=1), np.pi / (end - start))


def _finite(values: NDArray[np.float64]) -> Real:
    if not np.all(np.isfinite(values)):
        raise _MotionError("the motion leaves the range of numbers")
    return values
