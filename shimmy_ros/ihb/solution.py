"""Limit cycles as values, and what became of an attempt to find one."""

from __future__ import annotations

import enum
from dataclasses import dataclass

import numpy as np

from .harmonics import Real, evaluate, orders, peaks, to_complex, to_real


class Outcome(enum.Enum):
    """What became of a question for a limit cycle; the value is what leaves the program.

    The balance by itself knows LIMIT_CYCLE, NO_LIMIT_CYCLE and NOT_CONVERGED; what an operating
    point comes to needs the others as well (see ``cycles.verdict``).
    """

    LIMIT_CYCLE = "limit_cycle"
    NO_LIMIT_CYCLE = "no_limit_cycle"
    UNBOUNDED = "unbounded"
    NOT_PERIODIC = "not_periodic"
    NOT_ROLLING = "not_rolling"
    NOT_CONVERGED = "not_converged"


@dataclass(frozen=True)
class LimitCycle:
    """One periodic solution: coefficients (n, 2N) in the units of q, and omega in rad/s.

    ``orientation``, +1 or -1, is the sign of the balance's determinant. It keeps along a branch
    and changes at a fold, which tells the two cycles that meet there apart: +1 is unstable.
    ``residual`` is that of the balance of all coordinates, relative, where it was asked for.
    """

    coefficients: Real
    frequency: float
    orientation: int
    residual: float = float("nan")

    @property
    def harmonics(self) -> int:
        """The number N of odd harmonics."""
        return int(self.coefficients.shape[1]) // 2

    @property
    def frequency_hz(self) -> float:
        """Frequency in Hz."""
        return self.frequency / (2.0 * np.pi)

    @property
    def period(self) -> float:
        """Period in s."""
        return 2.0 * np.pi / self.frequency

    def amplitude(self) -> Real:
        """Peak of |q| of each coordinate over the cycle, shape (n,)."""
        return peaks(self.coefficients)

    def peak_velocity(self) -> Real:
        """Peak of |dq/dt| of each coordinate over the cycle, shape (n,)."""
        order = orders(self.harmonics)
        return self.frequency * peaks(to_real(1j * order * to_complex(self.coefficients)))

    def position(self, time_s: Real) -> Real:
        """q at times [s], shape (n, times)."""
        return evaluate(self.coefficients, self.frequency * time_s)

    def velocity(self, time_s: Real) -> Real:
        """dq/dt at times [s], shape (n, times)."""
        return self.frequency * evaluate(self.coefficients, self.frequency * time_s, 1)


@dataclass(frozen=True)
class Result:
    """The answer of a solve.

    ``limit_cycle`` is there exactly if the outcome is LIMIT_CYCLE. ``residual`` is the relative
    residual of the last iterate (NaN if there was none), ``iterations`` counts all of Newton's,
    ``warm`` tells whether a previous point was used, and ``message`` says in a sentence how it
    ended.
    """

    outcome: Outcome
    limit_cycle: LimitCycle | None
    iterations: int
    residual: float
    warm: bool
    message: str

    def __post_init__(self) -> None:
        if (self.limit_cycle is not None) != (self.outcome is Outcome.LIMIT_CYCLE):
            raise ValueError("a limit cycle belongs to the outcome LIMIT_CYCLE and to no other")
