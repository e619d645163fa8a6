"""Harmonic balance beside shooting over the taxi velocity: how far apart, and at what cost."""

from __future__ import annotations

import time
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..gear.axes import VELOCITY, Axis
from ..gear.system import OperatingPoint, gear_system
from ..ihb.harmonics import with_harmonics
from .diagram import Diagram, DiagramPoint
from .limit_cycles import Role, all_cycles
from .one_harmonic import one_harmonic_cycles
from .orbits import Orbit, balance_orbit, converge, fourier
from .settings import BALANCE, SHOOTING, Settings

Real = NDArray[np.float64]

# A cycle of the balance this much larger or smaller is not the trigger's.
_SAME = 3.5


@dataclass(frozen=True)
class Difference:
    """How far a method is from the reference over the ``velocities`` (m,) that both answer, m/s.

    ``amplitude`` (m,) of the swivel and ``frequency`` (m,) are relative.
    """

    velocities: Real
    amplitude: Real
    frequency: Real

    @property
    def worst_at(self) -> float:
        """The velocity [m/s] of the worst amplitude."""
        return float(self.velocities[np.argmax(self.amplitude)])


class MethodRun:
    """The cycles of one method over ``velocities`` around ``point``, as far as they are traced.

    ``harmonics`` is N of the balance, or None for shooting. ``seconds`` is the processor time that
    the stable cycles took, from the first guess on.
    """

    def __init__(self, point: OperatingPoint, velocities: Sequence[float], harmonics: int | None
                 ) -> None:
        """Raises ParameterError."""
        self.harmonics = harmonics
        settings = Settings(method=SHOOTING) if harmonics is None else Settings(
            harmonics, method=BALANCE)
        self.diagram = Diagram(point, Axis(VELOCITY), velocities, settings)
        self.seconds = 0.0
        self._points = [Axis(VELOCITY).at(point, velocity) for velocity in velocities]

    def trace_stable(self) -> Iterator[DiagramPoint]:
        """Trace the stable cycles, which is what is timed."""
        points = self.diagram.trace_stable()
        while True:
            begin = time.process_time()
            point = next(points, None)
            self.seconds += time.process_time() - begin
            if point is None:
                return
            yield point

    def trace_trigger(self, triggers: Sequence[tuple[int, Orbit]]) -> Iterator[DiagramPoint]:
        """Trace this method's counterparts of ``triggers``, given by the velocity's number."""
        for index, orbit in triggers:
            own = orbit if self.harmonics is None else _counterpart(
                self._points[index], orbit, self.harmonics)
            if own is not None and not any(
                    own.same_as(known.orbit, 1e-3) for known in self.diagram.cycles(index)):
                yield from self.diagram.trace(index, own)

    @property
    def seconds_per_cycle(self) -> float:
        """Processor time for each velocity with a stable cycle; NaN without any."""
        count = len(self._answers())
        return self.seconds / count if count else float("nan")

    def compared_with(self, reference: MethodRun) -> Difference | None:
        """The stable cycles beside those of ``reference``; None if no velocity has both."""
        own, other = self._answers(), reference._answers()
        both = [velocity for velocity in own if velocity in other]
        if not both:
            return None
        ratio = np.array([np.array(own[velocity]) / other[velocity] for velocity in both])
        amplitude, frequency = np.abs(ratio - 1.0).T
        return Difference(np.array(both), amplitude, frequency)

    def _answers(self) -> dict[float, tuple[float, float]]:
        """Swivel amplitude and frequency of the stable cycle at each velocity that has one."""
        return {point.value: (point.orbit.swivel, point.orbit.frequency_hz)
                for index in range(len(self._points)) for point in self.diagram.stable(index)}


def triggers(point: OperatingPoint, velocities: Sequence[float]) -> list[tuple[int, Orbit]]:
    """The trigger cycles at the first and the last velocity, by the velocity's number.

    Raises ContinuationError.
    """
    return [(index, found.orbit) for index in (0, len(velocities) - 1)
            for found in all_cycles(Axis(VELOCITY).at(point, velocities[index]))
            if found.role is Role.TRIGGER]


def _counterpart(point: OperatingPoint, orbit: Orbit, harmonics: int) -> Orbit | None:
    """The unstable cycle of the balance that is nearest in size to ``orbit``, or None."""
    system = gear_system(point)
    starts = [(fourier(orbit, harmonics), 2.0 * np.pi * orbit.frequency_hz)]
    starts += [(with_harmonics(guess.coefficients, harmonics), guess.frequency)
               for guess in one_harmonic_cycles(point)]
    found = []
    for coefficients, frequency in starts:
        cycle = converge(system, coefficients, frequency)
        if cycle is not None:
            own = balance_orbit(system, cycle)
            if not own.stable and abs(np.log(own.swivel / orbit.swivel)) < np.log(_SAME):
                found.append(own)
    return min(found, key=lambda own: float(abs(np.log(own.swivel / orbit.swivel))), default=None)
