"""Where over an interval of taxi velocities an amplitude exceeds a limit."""

from __future__ import annotations

import math
from collections.abc import Generator
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import minimize_scalar

from ..cycles.branches import Settings
from ..cycles.growing import growing_cycle
from ..gear.linear import linear_modes
from ..gear.parameters import changed
from ..gear.system import OperatingPoint, gear_system
from ..ihb.solution import LimitCycle, Outcome
from ..ihb.solve import solve_cold, solve_warm

# Relative excess that counts as none: the boundary itself is looked at again.
TOLERANCE = 1e-6
_SPACING = 2.0
_FEWEST, _MOST = 16, 100
_FEWER = (2, 1)

Real = NDArray[np.float64]


@dataclass(frozen=True)
class Sample:
    """An amplitude at a ``velocity`` [m/s]: 0 without a limit cycle, infinite without bound."""

    velocity: float
    amplitude: float


class Scan:
    """Amplitudes of coordinate ``coordinate`` against a limit ``below`` (0: no cycle at all).

    ``velocities`` is an interval [m/s], or None for the velocity of each point.
    """

    def __init__(self, coordinate: int, below: float, velocities: tuple[float, float] | None,
                 settings: Settings) -> None:
        self.coordinate = coordinate
        self.below = below
        self._settings = settings
        self._last: LimitCycle | None = None
        self._velocities: tuple[float, ...] = ()
        if velocities is not None:
            low, high = velocities
            count = min(max(math.ceil((high - low) / _SPACING), _FEWEST), _MOST)
            self._velocities = (
                *(low + (high - low) * index / count for index in range(count)), high)

    def exceeds(self, amplitude: float) -> bool:
        """Whether ``amplitude`` is beyond the limit by more than the tolerance."""
        return amplitude > self.below * (1.0 + TOLERANCE)

    def amplitude(self, point: OperatingPoint) -> float:
        """Amplitude at one point. Raises ArithmeticError where no method converged."""
        cycle = self._cycle(point)
        if cycle is not None:
            return float(cycle[self.coordinate])
        return math.inf if self._unbounded(point) else 0.0

    def _cycle(self, point: OperatingPoint) -> Real | None:
        """Amplitudes of the limit cycle, or None without one."""
        system = gear_system(point)
        start, self._last = self._last, None
        if start is not None:
            self._last = solve_warm(system, start).limit_cycle
        if self._last is None:
            result = solve_cold(system, self._settings.harmonics)
            self._last = result.limit_cycle
            if result.outcome is Outcome.FAILED:
                # Beyond a fold in which small cycles end, the balance may not converge; there,
                # fewer harmonics tell that there is none.
                result = next((fewer for fewer in (solve_cold(system, count) for count in _FEWER)
                               if fewer.outcome is not Outcome.FAILED), result)
                if result.outcome is Outcome.FAILED:
                    orbit = growing_cycle(point, self._settings)
                    return None if orbit is None else orbit.amplitude
                return None if result.limit_cycle is None else result.limit_cycle.amplitude()
        return None if self._last is None else self._last.amplitude()

    def samples(self, point: OperatingPoint) -> Generator[None, None, list[Sample]]:
        """Amplitudes at all velocities, ascending; ``point`` has the other parameters."""
        found = []
        for velocity in self._velocities or (point.velocity,):
            found.append(Sample(velocity, self.amplitude(replace(point, velocity=velocity))))
            yield
        return found

    def peaks(self, point: OperatingPoint) -> Generator[None, None, list[Sample]]:
        """Where the limit is exceeded the most: peaks over the velocity, the largest first."""
        samples = yield from self.samples(point)
        found = []
        for index, here in enumerate(samples):
            left, right = samples[max(index - 1, 0)], samples[min(index + 1, len(samples) - 1)]
            if left.amplitude <= here.amplitude >= right.amplitude and here.amplitude > 0.0:
                if left.velocity < right.velocity and math.isfinite(here.amplitude):
                    refined = self._refined(point, left.velocity, right.velocity)
                    here = max(here, refined, key=lambda sample: sample.amplitude)
                    yield
                if self.exceeds(here.amplitude):
                    found.append(here)
        return sorted(found, key=lambda sample: -sample.amplitude)

    def _refined(self, point: OperatingPoint, low: float, high: float) -> Sample:
        found = minimize_scalar(
            lambda velocity: -self.amplitude(replace(point, velocity=float(velocity))),
            bounds=(low, high), method="bounded", options={"xatol": 1e-4 * (high - low)})
        return Sample(float(found.x), -float(found.fun))

    def _unbounded(self, point: OperatingPoint) -> bool:
        """Whether, with no limit cycle, oscillations grow for ever once friction is overcome.

        They do where rest without friction is unstable and no cycle without friction stops them.
        """
        if linear_modes(point.gear, point.damper, point.velocity).growth_rate[0] <= 0.0:
            return False
        free = replace(point, damper=changed(point.damper, coulomb_torque=0.0))
        return solve_cold(gear_system(free), self._settings.harmonics).limit_cycle is None
