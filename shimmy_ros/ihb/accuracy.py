"""How many harmonics: an error estimate for every cycle, and a solve to a requested accuracy.

What N harmonics leave out is seen by balancing more of them: one Newton step from the cycle,
padded with zeros, gives nearly all of the difference. The error has a part that falls fast with N
and, from the friction's jumps, one that falls as 1/N, and the two may have opposite signs. With
steps to 2N and to 4N harmonics |x_N - x_4N| + |x_2N - x_4N| holds for both: its second term is
what 4N harmonics still lack, if that falls as 1/N. It counts twice, since with few harmonics it may
fall more slowly, and the estimate is twice the sum, for the safety that a single step asks for. A
coordinate that hardly moves the others may lack more: its own harmonics beyond, taken to fall as
the square of their order, may all meet at its peak. And where one number comes out right by chance,
it is not trusted more than a certain part of the worst amplitude.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from .balance import balance, recovered
from .describing_function import reference_coordinate
from .harmonics import Real, orders, peaks, to_complex, with_harmonics
from .newton import Phase, Point, jacobian, moved, phase_of, scales, unknowns
from .solution import LimitCycle, Outcome, Result
from .solve import placed, solve_cold, solve_warm
from .system import System

MAXIMUM_HARMONICS = 128
_FIRST_HARMONICS = 4
_SAFETY = 2.0
# The smallest part of the worst amplitude's error that other amplitudes, and the frequency, have.
_LEAST_AMPLITUDE, _LEAST_FREQUENCY = 0.05, 0.01
_ROUNDING = 1e-12


@dataclass(frozen=True)
class ErrorEstimate:
    """Estimated relative errors of a cycle: of each peak amplitude, shape (n,), and frequency."""

    amplitude: Real
    frequency: float

    @property
    def largest(self) -> float:
        """The largest of them all."""
        return max(float(np.max(self.amplitude)), self.frequency)


def estimate_error(system: System, cycle: LimitCycle) -> ErrorEstimate:
    """Estimate the error that comes from the number of harmonics.

    Infinite where the steps to more harmonics do not exist.
    """
    finer, finest = (_refined(system, cycle, factor) for factor in (2, 4))
    if finer is None or finest is None:
        return ErrorEstimate(np.full(system.dofs, np.inf), np.inf)
    best = finest.amplitude()
    scale = np.where(best > 0.0, best, 1.0)
    lacking = np.abs(cycle.amplitude() - best) + 2.0 * np.abs(finer.amplitude() - best)
    amplitude = (_SAFETY * lacking + _tail(finest)) / scale
    frequency = _SAFETY / finest.frequency * (abs(cycle.frequency - finest.frequency) + 2.0 * abs(
        finer.frequency - finest.frequency))
    worst = float(np.max(amplitude))
    return ErrorEstimate(np.maximum(amplitude, _LEAST_AMPLITUDE * worst) + _ROUNDING,
                         max(frequency, _LEAST_FREQUENCY * worst) + _ROUNDING)


def solve_to_accuracy(system: System, accuracy: float, start: LimitCycle | None = None,
                      largest: int = MAXIMUM_HARMONICS) -> tuple[Result, ErrorEstimate | None]:
    """The limit cycle whose estimated relative errors are all below ``accuracy``.

    Harmonics are doubled, from those of ``start`` or from four, until the estimate is met; a
    result that does not meet it with ``largest`` of them comes with the estimate that it has.
    Without a limit cycle there is no estimate.
    """
    result = (solve_cold(system, _FIRST_HARMONICS) if start is None
              else solve_warm(system, start))
    while result.limit_cycle is not None:
        cycle = result.limit_cycle
        estimate = estimate_error(system, cycle)
        if estimate.largest <= accuracy or 2 * cycle.harmonics > largest:
            return result, estimate
        padded = replace(cycle, coefficients=with_harmonics(
            cycle.coefficients, 2 * cycle.harmonics))
        finer = solve_warm(system, padded)
        if finer.outcome is not Outcome.LIMIT_CYCLE:
            finer = solve_cold(system, 2 * cycle.harmonics)
            if finer.limit_cycle is None:
                return result, estimate
        result = replace(finer, iterations=result.iterations + finer.iterations,
                         warm=start is not None)
    return result, None


def _tail(cycle: LimitCycle) -> Real:
    """The sum of all harmonics beyond those of ``cycle``, shape (n,), as its last fourth has it.

    Harmonics that fall as a / order^2 leave a / (2 order) beyond the last.
    """
    order = orders(cycle.harmonics)
    last = slice(3 * cycle.harmonics // 4, None)
    falling = np.abs(to_complex(cycle.coefficients)[:, last]) * order[last] ** 2
    return np.asarray(falling.max(axis=1) / (2.0 * order[-1]))


def _refined(system: System, cycle: LimitCycle, factor: int) -> LimitCycle | None:
    """One Newton step from ``cycle`` with ``factor`` times its harmonics; None if there is none."""
    active = system.nonlinear_dofs
    harmonics = factor * cycle.harmonics
    padded = replace(cycle, coefficients=with_harmonics(cycle.coefficients, harmonics))
    _, point = placed(system, padded, active)
    phase = phase_of(active, harmonics, reference_coordinate(system))
    stepped = _newton_step(system, point, active, phase)
    if stepped is None:
        return None
    coefficients = recovered(system, stepped.coefficients, stepped.frequency, active)
    if not np.all(np.isfinite(peaks(coefficients))):
        return None
    return LimitCycle(coefficients, stepped.frequency, cycle.orientation)


def _newton_step(system: System, point: Point, active: tuple[int, ...], phase: Phase
                 ) -> Point | None:
    terms = balance(system, point.coefficients, point.frequency, active)
    size = scales(point, phase)
    try:
        step = np.linalg.solve(jacobian(terms, phase) * size, -terms.residual)
    except np.linalg.LinAlgError:
        return None
    following = moved(point, phase, unknowns(point, phase) + size * step)
    if not (np.all(np.isfinite(following.coefficients)) and following.frequency > 0.0):
        return None
    return following
