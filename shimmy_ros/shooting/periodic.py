"""Limit cycles of an odd autonomous system by shooting over half a period.

A cycle satisfies x(T/2) = -x(0), with q_c(0) = 0 for one coordinate c as phase condition. Newton's
method on (x(0), T/2) uses the derivatives of the flow, exact through slip, stick and release. A
cycle that sticks loses rank in these, but not in the equations: dx(T/2)/dx(0) + 1 stays regular.
"""

from __future__ import annotations

import enum
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from ..ihb.system import System
from .cycle import Cycle, cycle_of, final_rate
from .flow import MOST_STEPS, FlowError, ParameterRate, advance
from .modes import Model, Real, model_of
from .trajectory import Trajectory

TOLERANCE = 1e-11
# Where rounding ends the convergence earlier, this will do.
STAGNATION = 1e-8
MOST_SEARCH_STEPS = 20_000
_ITERATIONS = 25
_HALVINGS = 6
# The residual has to fall by half in so many iterations.
_PATIENCE = 6
_LONGEST_CHANGE = 0.2
_REST = 1e-6
_SAME = 1e-6


class Outcome(enum.Enum):
    """How a search for a cycle ended."""

    LIMIT_CYCLE = "limit_cycle"
    AT_REST = "at_rest"
    FAILED = "failed"


@dataclass(frozen=True)
class ShootingResult:
    """The answer of a search.

    ``cycle`` is there exactly if the outcome is LIMIT_CYCLE. ``residual`` is the largest component
    of x(T/2) + x(0) relative to its size on the cycle, and ``steps`` counts the Taylor steps of all
    motions on the way, to which the work is in proportion. AT_REST means that the search ended in a
    state of rest, which says nothing about cycles elsewhere.
    """

    outcome: Outcome
    cycle: Cycle | None
    iterations: int
    residual: float
    message: str
    steps: int


class Shot(NamedTuple):
    """Half a period from ``state``, with the equations' residual and Jacobian.

    ``residual`` (2n + 1,) is (x(T/2) + x(0), q_c(0)); the Jacobian's columns belong to x(0), T/2
    and, if there is one, the parameter. ``size`` (2n + 1,) holds the magnitudes of x and of T/2.
    """

    state: Real
    trajectory: Trajectory
    residual: Real
    jacobian: Real
    size: Real

    @property
    def error(self) -> float:
        """The largest residual relative to the size of its component."""
        return float(np.abs(self.residual[:-1] / self.size[:-1]).max())


def shoot(model: Model, state: Real, half_period: float, section: int,
          rate: ParameterRate | None = None, most_steps: int = MOST_STEPS) -> Shot:
    """Half a period from ``state`` with the derivatives. Raises FlowError."""
    count = len(state)
    trajectory = advance(model, state, half_period, derivatives=True, rate=rate,
                         most_steps=most_steps)
    jacobian = np.zeros((count + 1, count + 1 + (rate is not None)))
    jacobian[:count, :count] = trajectory.transition
    jacobian[:count, :count] += np.eye(count)
    jacobian[:count, count] = final_rate(model, trajectory)
    jacobian[count, section] = 1.0
    if rate is not None:
        jacobian[:count, count + 1] = trajectory.by_parameter
    return Shot(state, trajectory, np.append(trajectory.end + state, state[section]), jacobian,
                np.append(trajectory.magnitude(), half_period))


def checked_state(model: Model, name: str, state: ArrayLike) -> Real:
    """``state`` as an array (2n,). Raises ValueError."""
    values = np.array(state, dtype=np.float64)
    if values.shape != (2 * model.dofs,) or not np.isfinite(values).all():
        raise ValueError(f"{name} is {state!r}, but must be {2 * model.dofs} finite numbers")
    return values


def checked_section(model: Model, section: int | None) -> int:
    """The coordinate ``section``, by default the first that friction can hold, else the first.

    Raises ValueError.
    """
    if section is None:
        return model.active[model.frictional[0]] if model.frictional else 0
    if not 0 <= section < model.dofs:
        raise ValueError(f"section is {section}, but must be in 0..{model.dofs - 1}")
    return section


def limit_cycle(system: System, guess_state: ArrayLike, guess_period: float, *,
                section: int | None = None, tolerance: float = TOLERANCE,
                most_steps: int = MOST_SEARCH_STEPS) -> ShootingResult:
    """The limit cycle near the motion from ``guess_state`` (2n,) with ``guess_period`` [s].

    The guess may lie anywhere on the cycle: it is first moved on to where coordinate ``section``
    passes zero, which it has to do while slipping; by default that is the first with friction.
    Newton's method ends at a residual of ``tolerance``, or of 1e-8 where rounding lets it fall no
    further. A cycle is reported with its shortest period. The search gives up after ``most_steps``
    Taylor steps, or where the residual falls too slowly.

    Raises ValueError for arguments that do not fit and for elements that shooting does not know.
    """
    model = model_of(system)
    section = checked_section(model, section)
    state = checked_state(model, "guess_state", guess_state)
    if not (np.isfinite(guess_period) and guess_period > 0.0):
        raise ValueError(f"guess_period is {guess_period}, but must be positive and finite")
    if most_steps < 1:
        raise ValueError(f"most_steps is {most_steps}, but must be positive")
    search = _Search(model, section, tolerance, most_steps)
    try:
        return search.from_guess(state, guess_period)
    except FlowError as error:
        message = str(error) if search.left > 0 else (
            f"the search takes more than {most_steps} steps")
        return search.result(Outcome.FAILED, message)


class _Search:
    """A search with ``left`` Taylor steps to go, so far with a residual of ``error``."""

    def __init__(self, model: Model, section: int, tolerance: float, most_steps: int) -> None:
        self.model, self.section, self.tolerance = model, section, tolerance
        self.most_steps = self.left = most_steps
        self.iterations, self.error = 0, np.nan

    def result(self, outcome: Outcome, message: str, cycle: Cycle | None = None) -> ShootingResult:
        """The answer, with what the search has taken."""
        return ShootingResult(outcome, cycle, self.iterations, self.error, message,
                              self.most_steps - self.left)

    def advance(self, state: Real, duration: float) -> Trajectory:
        """The motion from ``state``. Raises FlowError, also where no steps are left."""
        try:
            trajectory = advance(self.model, state, duration, most_steps=self.left)
        except FlowError as error:
            self.left -= error.steps
            raise
        self.left -= trajectory.steps
        return trajectory

    def shoot(self, state: Real, half_period: float) -> Shot:
        """The same with the equations. Raises FlowError, also where no steps are left."""
        try:
            shot = shoot(self.model, state, half_period, self.section, most_steps=self.left)
        except FlowError as error:
            self.left -= error.steps
            raise
        self.left -= shot.trajectory.steps
        return shot

    def from_guess(self, state: Real, period: float) -> ShootingResult:
        """The answer for a guess of state and period. Raises FlowError."""
        section = self.section
        if state[section] != 0.0:
            approach = self.advance(state, period)
            crossings = approach.zeros(section)
            if crossings.size == 0:
                stuck = approach.end[self.model.dofs + section] == 0.0
                return self.result(
                    Outcome.AT_REST if stuck else Outcome.FAILED,
                    f"from the guess, coordinate {section} does not pass zero within a period")
            state = approach.sample(crossings[:1])[:, 0]
            state[section] = 0.0
        result = self.newton(self.shoot(state, 0.5 * period))
        repeats = _repetitions(result.cycle) if result.cycle is not None else 1
        if result.cycle is None or repeats == 1:
            return result
        return self.newton(self.shoot(result.cycle.state, 0.5 * result.cycle.period / repeats))

    def newton(self, shot: Shot) -> ShootingResult:
        """The answer for a guess at which the section coordinate is zero. Raises FlowError."""
        section = self.section
        swing = shot.trajectory.largest()[section]
        errors: list[float] = []
        for self.iterations in range(_ITERATIONS):
            self.error = shot.error
            errors.append(self.error)
            if shot.trajectory.largest()[section] <= _REST * swing:
                return self.result(Outcome.AT_REST,
                                   f"the search came to rest in coordinate {section}")
            if len(errors) > _PATIENCE and self.error > max(0.5 * errors[-1 - _PATIENCE],
                                                            STAGNATION):
                return self.result(Outcome.FAILED, "Newton's method gets nearer to a cycle too "
                                                   "slowly")
            following = None if self.error <= self.tolerance else self.step(shot)
            if following is None:
                if self.error > max(self.tolerance, STAGNATION):
                    return self.result(Outcome.FAILED,
                                       "Newton's method does not get nearer to a cycle")
                return self.result(Outcome.LIMIT_CYCLE, "converged",
                                   upward_cycle(self.model, shot, section))
            shot = following
        self.iterations, self.error = _ITERATIONS, shot.error
        return self.result(Outcome.FAILED,
                           f"Newton's method did not converge in {_ITERATIONS} iterations")

    def step(self, shot: Shot) -> Shot | None:
        """The next iterate, on the way of Newton's step as far as the residual falls, or None.

        Raises FlowError where no steps are left.
        """
        try:
            change = -np.linalg.solve(shot.jacobian * shot.size / shot.size[:, None],
                                      shot.residual / shot.size) * shot.size
        except np.linalg.LinAlgError:
            return None
        half_period = shot.size[-1]
        fraction = min(1.0, _LONGEST_CHANGE * half_period / max(abs(change[-1]), 1e-300))
        for _ in range(_HALVINGS):
            try:
                trial = self.shoot(shot.state + fraction * change[:-1],
                                   half_period + fraction * change[-1])
            except FlowError:
                if self.left <= 0:
                    raise
                fraction *= 0.25
                continue
            error = np.abs(trial.residual[:-1] / shot.size[:-1]).max()
            if error < (1.0 - 0.1 * fraction) * shot.error:
                return trial
            fraction *= 0.5
        return None


def _repetitions(cycle: Cycle) -> int:
    """How often a cycle passes through itself in its period: an odd number."""
    half = cycle.trajectory.duration
    size = cycle.trajectory.magnitude()
    # Whether the zero at the very end is among them is a matter of rounding.
    most = cycle.trajectory.zeros(cycle.section).size + 1
    for repeats in range(most - 1 + most % 2, 1, -2):
        early = cycle.trajectory.sample(np.array([half / repeats]))[:, 0]
        if np.abs((early + cycle.state) / size).max() < _SAME:
            return repeats
    return 1


def upward_cycle(model: Model, shot: Shot, section: int) -> Cycle:
    """The cycle of a converged shot, from where coordinate ``section`` passes zero upwards."""
    if shot.state[model.dofs + section] < 0.0:
        return cycle_of(model, -shot.state, section, shot.trajectory.reflected())
    return cycle_of(model, shot.state, section, shot.trajectory)
