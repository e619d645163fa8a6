"""The limit cycle at an operating point, warm-started from the point before."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

from ..gear.parameters import (
    DEFAULT_MINIMUM_VELOCITY,
    MINIMUM_VELOCITY_RANGE,
    VELOCITY_RANGE,
    ParameterError,
    Range,
)
from ..gear.system import OperatingPoint, family_between, gear_system
from ..ihb.solution import LimitCycle, Outcome, Result
from ..ihb.solve import follow_in_steps, solve_cold, solve_warm

DEFAULT_HARMONICS = 4
MAXIMUM_HARMONICS = 64
HARMONICS_RANGE = Range("harmonics", "number of odd harmonics", 1, MAXIMUM_HARMONICS)

NOT_ROLLING = "not_rolling"


@dataclass(frozen=True)
class Prediction:
    """The answer for one operating point.

    ``outcome`` is an ihb Outcome's value, or NOT_ROLLING below the minimum velocity, where there
    is no answer to give. ``harmonics`` are those asked for; a ``limit_cycle`` from shooting, where
    they do not suffice, has more.
    """

    point: OperatingPoint
    harmonics: int
    outcome: str
    limit_cycle: LimitCycle | None
    iterations: int
    residual: float
    warm: bool
    message: str

    @property
    def failed(self) -> bool:
        """Whether the solve did not converge, which is no answer at all."""
        return self.outcome == Outcome.FAILED.value

    @property
    def stands(self) -> bool:
        """Whether the tyre does not roll, so that there is no answer to give."""
        return self.outcome == NOT_ROLLING


class Predictor:
    """Predicts points one after the other; a limit cycle found is the next one's start.

    The answer for a point depends on the points before it only through rounding: where a warm
    start does not lead to a limit cycle, a cold one decides; and a simulation, where neither finds
    one although friction and damper could limit it.
    """

    def __init__(self, harmonics: int = DEFAULT_HARMONICS,
                 minimum_velocity: float = DEFAULT_MINIMUM_VELOCITY) -> None:
        """``minimum_velocity`` in m/s. Raises ParameterError."""
        self.harmonics = check_harmonics(harmonics)
        self.minimum_velocity = MINIMUM_VELOCITY_RANGE.check(
            "minimum_velocity", minimum_velocity)
        self._last: tuple[OperatingPoint, LimitCycle] | None = None

    def forget(self) -> None:
        """Start cold at the next point."""
        self._last = None

    def remember(self, point: OperatingPoint, cycle: LimitCycle) -> None:
        """Start the next prediction from ``cycle``, which is that of ``point``."""
        self._last = point, cycle

    def predict(self, point: OperatingPoint) -> Prediction:
        """The limit cycle that a growing oscillation reaches at ``point``.

        Raises ParameterError for a velocity outside its range.
        """
        VELOCITY_RANGE.check("taxi_velocity", point.velocity)
        if point.velocity < self.minimum_velocity:
            self._last = None
            return Prediction(
                point, self.harmonics, NOT_ROLLING, None, 0, math.nan, False,
                f"not rolling: taxi velocity {point.velocity:g} m/s is below the minimum of "
                f"{self.minimum_velocity:g} m/s, where the rolling law does not hold")
        result = self._solve(point)
        damper = point.damper
        if result.limit_cycle is None and damper.coulomb_torque > 0.0 and (
                damper.quadratic_damping > 0.0):
            # Most runs never come near a fold, and this takes its time and memory to import.
            from .settling import confirmed

            result = confirmed(point, result)
        self._last = None if result.limit_cycle is None else (point, result.limit_cycle)
        return Prediction(point, self.harmonics, result.outcome.value, result.limit_cycle,
                          result.iterations, result.residual, result.warm, result.message)

    def _solve(self, point: OperatingPoint) -> Result:
        system = gear_system(point)
        if self._last is None or self._last[1].harmonics != self.harmonics:
            return solve_cold(system, self.harmonics)
        previous, cycle = self._last
        warm = solve_warm(system, cycle)
        if warm.outcome is not Outcome.FAILED:
            return warm
        # A cold start costs less than steps along the branch, and does not know the past.
        cold = solve_cold(system, self.harmonics)
        iterations = warm.iterations + cold.iterations
        if cold.outcome is Outcome.FAILED and previous != point:
            steps = follow_in_steps(family_between(previous, point), cycle, 0.0, 1.0)
            iterations += steps.iterations
            if steps.limit_cycle is not None:
                return replace(steps, iterations=iterations)
        return replace(cold, iterations=iterations)


def check_harmonics(harmonics: int) -> int:
    """``harmonics`` as an int, or ParameterError."""
    number = HARMONICS_RANGE.check("harmonics", harmonics)
    if number != int(number):
        raise ParameterError(
            f"harmonics is {number:g}, but must be a whole number in {HARMONICS_RANGE.describe()}")
    return int(number)
