"""Where over an interval of taxi velocities an amplitude exceeds a limit."""

from __future__ import annotations

import math
from collections.abc import Generator
from dataclasses import dataclass, replace

from scipy.optimize import minimize_scalar

from ..cycles.settings import Settings
from ..cycles.stable_cycle import stable_cycle
from ..cycles.verdict import Verdict
from ..gear.system import OperatingPoint

# Relative excess that counts as none: the boundary itself is looked at again.
TOLERANCE = 1e-6
_SPACING = 2.0
_FEWEST, _MOST = 16, 100
# Stands for infinity where differences are taken.
_HUGE = 1e12


@dataclass(frozen=True)
class Sample:
    """An amplitude at a ``velocity`` [m/s], as Verdict.amplitude has it: of the stable cycle or the
    envelope, 0 where every motion dies, infinite where a disturbance grows without bound."""

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
        self._last: Verdict | None = None
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
        """Amplitude at one point. Raises ArithmeticError where the solve did not converge."""
        return float(self.verdict(point).amplitude[self.coordinate])

    def verdict(self, point: OperatingPoint) -> Verdict:
        """What one point comes to. Raises ArithmeticError where the solve did not converge."""
        if self._last is None or self._last.point != point:
            self._last = stable_cycle(point, self._settings, self._last)
        if self._last.failed:
            raise ArithmeticError(self._last.reason)
        return self._last

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
                # Between samples the curve is not taken to rise by more than it falls beside them.
                most = 3.0 * here.amplitude - left.amplitude - right.amplitude
                if left.velocity < right.velocity and math.isfinite(here.amplitude) and (
                        self.exceeds(most)):
                    refined = self._refined(point, left.velocity, right.velocity)
                    here = max(here, refined, key=lambda sample: sample.amplitude)
                    yield
                if self.exceeds(here.amplitude):
                    found.append(here)
        return sorted(found, key=lambda sample: -sample.amplitude)

    def _refined(self, point: OperatingPoint, low: float, high: float) -> Sample:
        found = minimize_scalar(
            lambda velocity: -min(
                self.amplitude(replace(point, velocity=float(velocity))), _HUGE),
            bounds=(low, high), method="bounded", options={"xatol": 1e-4 * (high - low)})
        largest = -float(found.fun)
        return Sample(float(found.x), math.inf if largest == _HUGE else largest)
