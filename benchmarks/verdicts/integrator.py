"""What becomes of a kick: the gear's motion in time, by a code that shares none with the solvers.

Radau IIA of five stages (order 9, L-stable), friction that sticks, and every reversal, sticking and
release located. Two points of the package are used: its parameters' dataclasses and its compiler's
decorator.
"""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum

import numpy as np
from numpy.typing import NDArray

from shimmy_ros.gear.parameters import Damper, Gear

from . import loops
from .equations import FRICTION, SIZE, SWIVEL_RATE, equations, held_rest
from .radau import radau
from .records import SECTIONS, Accuracy, Clock, End, Problem, Record
from .step_tables import step_tables

Real = NDArray[np.float64]

_STAGES = 5
SEARCHING = Accuracy(1e-6, 1e-9, 1e-6, 6_000_000, 20_000)
MEASURING = Accuracy(1e-8, 1e-10, 1e-6, 200_000, 4000)


class Fate(Enum):
    """What becomes of a motion."""

    CYCLE = "cycle"
    DIES = "dies"
    GROWS = "grows"
    BOUNDED = "bounded"
    UNDECIDED = "undecided"


@dataclass(frozen=True)
class Cycle:
    """A stable limit cycle.

    amplitude : largest magnitudes of strut tilt, swivel, damper [rad] and tyre lateral [m]
    frequency_hz : one over the period
    sticks : whether friction holds the swivel for a part of the period
    odd : whether q(t + T/2) = -q(t), as far as the extremes show
    """

    amplitude: tuple[float, float, float, float]
    frequency_hz: float
    sticks: bool
    odd: bool


@dataclass(frozen=True)
class Motion:
    """What a kick leads to: its cycle if there is one, the swivel's range of peaks [rad] over the
    last third of the sections, the time integrated [s], and the steps taken."""

    fate: Fate
    cycle: Cycle | None
    envelope: tuple[float, float]
    time: float
    steps: int
    sections: int


class IntegrationError(RuntimeError):
    """No step is short enough."""


class Integrator:
    """The motions of one gear with one damper at V = ``velocity`` > 0 [m/s]."""

    def __init__(self, gear: Gear, damper: Damper, velocity: float) -> None:
        self.system = equations(gear, damper, velocity)
        rest = held_rest(self.system)
        free = self.system.matrices[0][:FRICTION, :FRICTION]
        self._problem = Problem(
            self.system.matrices, self.system.load, self.system.holding, self.system.weights,
            self.system.quadratic, self.system.friction,
            bool(np.linalg.eigvals(free).real.max() < 0.0), rest.stable, rest.equilibrium,
            rest.torque_per_angle, rest.modes, rest.gains)
        self._steps = step_tables(self.system, radau(_STAGES))

    def kicked(self, kick: float) -> Record:
        """The swivel at rest after a kick, in rad/s."""
        state = np.zeros(SIZE)
        state[SWIVEL_RATE] = kick
        state[FRICTION] = np.sign(kick) * self.system.friction
        clock = np.zeros(8)
        clock[Clock.DIRECTION] = np.sign(kick)
        return Record(state, clock, np.zeros((SECTIONS, SIZE)),
                      np.zeros(max(SEARCHING.sections, MEASURING.sections)),
                      np.full(4, -np.inf), np.full(4, np.inf))

    def run(self, record: Record, accuracy: Accuracy = MEASURING, goal: int = 0) -> End:
        """Integrate on from ``record``, which changes; see loops.run. Raises IntegrationError."""
        status = End(loops.run(self._steps, self._problem, accuracy, goal, record))
        if status == End.FAILED:
            raise IntegrationError("no step is short enough")
        return status

    def fate(self, kick: float, accuracy: Accuracy = SEARCHING) -> Motion:
        """What becomes of a kick of the swivel at rest, in rad/s. Raises IntegrationError."""
        record = self.kicked(kick)
        status = self.run(record, accuracy)
        time, steps, sections = (record.clock[i] for i in (Clock.TIME, Clock.STEPS, Clock.PASSED))
        peaks = record.section_peaks[:int(sections)].copy()
        last = peaks[-(len(peaks) // 3 + 1):]
        cycle = None
        if status == End.SETTLED:
            cycle = self._measured(record)
            fate = Fate.CYCLE
        elif status == End.RESTS:
            fate = Fate.DIES
        elif status == End.GROWS:
            fate = Fate.GROWS
        else:
            fate = Fate.BOUNDED if _stationary(peaks) else Fate.UNDECIDED
        envelope = (float(last.min()), float(last.max())) if len(last) else (0.0, 0.0)
        return Motion(fate, cycle, envelope, float(time), int(steps), len(peaks))

    def _measured(self, record: Record) -> Cycle:
        """The cycle on which ``record`` has settled: a period, after two for higher accuracy."""
        word = int(record.clock[Clock.PERIOD])
        for periods in (2, 1):
            record.clock[[Clock.TIME, Clock.HELD_TIME]] = 0.0
            record.highest[:], record.lowest[:] = -np.inf, np.inf
            if self.run(record, MEASURING, periods * word) != End.COUNTED:
                raise IntegrationError("a settled motion does not come back to its section")
        amplitude = np.maximum(record.highest, -record.lowest)
        offset = 0.5 * np.abs(record.highest + record.lowest)
        first, second, third, fourth = (float(value) for value in amplitude)
        return Cycle((first, second, third, fourth), float(1.0 / record.clock[Clock.TIME]),
                     bool(record.clock[Clock.HELD_TIME] > 0.0),
                     bool((offset < 1e-4 * amplitude).all()))


def _stationary(peaks: Real) -> bool:
    """Whether the swivel's peaks, shape (n,), neither rise nor fall over the last two thirds."""
    third = len(peaks) // 3
    if third < 50:
        return False
    before, after = peaks[-2 * third:-third], peaks[-third:]
    change = np.abs([after.mean() - before.mean(), after.max() - before.max(),
                     after.min() - before.min()])
    spread = float(after.max() - after.min())
    return bool(change[0] < 0.1 * spread and change.max() < 0.3 * spread)
