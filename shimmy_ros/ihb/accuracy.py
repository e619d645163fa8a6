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

from .describing_function import reference_coordinate
from .elements import OddElement
from .harmonics import Real, orders, to_complex, with_harmonics
from .newton import phase_of, step_once
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
    """Estimate the error that comes from the number of harmonics, and from that of points.

    Infinite where the steps to more harmonics do not exist.
    """
    finer, finest = (_refined(system, cycle, factor) for factor in (2, 4))
    staggered = _refined(system, cycle, 2, 0.5) if system.general_elements else finer
    if finer is None or finest is None or staggered is None:
        return ErrorEstimate(np.full(system.dofs, np.inf), np.inf)
    best = finest.amplitude()
    scale = np.where(best > 0.0, best, 1.0)
    lacking = (np.abs(cycle.amplitude() - best) + 2.0 * np.abs(finer.amplitude() - best)
               + 2.0 * np.abs(staggered.amplitude() - finer.amplitude()))
    amplitude = (_SAFETY * lacking + _tail(finest)) / scale
    frequency = _SAFETY / finest.frequency * (
        abs(cycle.frequency - finest.frequency) + 2.0 * abs(finer.frequency - finest.frequency)
        + 2.0 * abs(staggered.frequency - finer.frequency))
    worst = float(np.max(amplitude))
    return ErrorEstimate(np.maximum(amplitude, _LEAST_AMPLITUDE * worst) + _ROUNDING,
                         max(frequency, _LEAST_FREQUENCY * worst) + _ROUNDING)


def solve_to_accuracy(system: System, accuracy: float, start: LimitCycle | None = None,
                      largest: int = MAXIMUM_HARMONICS) -> tuple[Result, ErrorEstimate | None]:
    """The limit cycle whose estimated relative errors are all below ``accuracy``.

    Harmonics are doubled, from those of ``start`` or from four, until the balance has a cycle and
    the estimate is met; a result that does not meet it with ``largest`` of them comes with the
    estimate that it has.
    Without a limit cycle there is no estimate.
    """
    result = _first(system, largest) if start is None else solve_warm(system, start)
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


def _first(system: System, largest: int) -> Result:
    """A cycle with four harmonics, or with as many as a relaxation oscillation needs."""
    harmonics = _FIRST_HARMONICS
    result = solve_cold(system, harmonics)
    # Without an iteration there was nothing that more harmonics could help.
    while result.outcome is Outcome.NOT_CONVERGED and result.iterations and (
            2 * harmonics <= largest):
        harmonics *= 2
        following = solve_cold(system, harmonics)
        result = replace(following, iterations=result.iterations + following.iterations)
    return result


def _tail(cycle: LimitCycle) -> Real:
    """The sum of all harmonics beyond those of ``cycle``, shape (n,), as its last fourth has it.

    Harmonics that fall as a / order^2 leave a / (2 order) beyond the last.
    """
    order = orders(cycle.harmonics)
    last = slice(3 * cycle.harmonics // 4, None)
    falling = np.abs(to_complex(cycle.coefficients)[:, last]) * order[last] ** 2
    return np.asarray(falling.max(axis=1) / (2.0 * order[-1]))


def _refined(system: System, cycle: LimitCycle, factor: int, offset: float = 0.0
             ) -> LimitCycle | None:
    """One Newton step from ``cycle`` with ``factor`` times its harmonics; None if there is none.

    And with as many times the points of general elements, displaced by ``offset``.
    """
    if system.general_elements:
        system = replace(system, elements=tuple(
            replace(element, points=factor * element.points, offset=element.offset + offset)
            if isinstance(element, OddElement) else element for element in system.elements))
    active = system.nonlinear_dofs
    harmonics = factor * cycle.harmonics
    padded = replace(cycle, coefficients=with_harmonics(cycle.coefficients, harmonics))
    _, point = placed(system, padded, active)
    with np.errstate(all="ignore"):
        stepped = step_once(system, point, active,
                            phase_of(active, harmonics, reference_coordinate(system)))
    return None if stepped is None else LimitCycle(*stepped, cycle.orientation)
