"""Where kicks of the swivel lead: to rest, to a limit cycle, or beyond the model.

Kicks of ascending size are given to the gear at rest, and each motion is followed until it is
certain what becomes of it.
"""

from __future__ import annotations

import enum
import math
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from ..gear.linear import linear_modes
from ..gear.matrices import SWIVEL
from ..gear.system import OperatingPoint, gear_system
from .budget import Budget
from .motion import STATES, End, Motion
from .orbits import Orbit
from .refinement import guess_from_motion, refined, upward_passage
from .settings import BALANCE, Settings

Real = NDArray[np.float64]

KICKS = np.array([0.5, 2.0, 8.0, 30.0])
"""The kicks [rad/s] that are asked about, from what any runway gives a swivel at rest to what a rig
gives it at most; where all of these die, others in between and smaller ones are as well."""

_RATIO = 4.0 ** (1.0 / 3.0)
_BETWEEN = np.array([KICKS[0] * _RATIO ** step for step in (1, 2, 4, 5, 7, 8)])

_LEAST_KICK = 1e-4
_MOST_PASSAGES, _FEW_PASSAGES = 500, 100
_LONGEST = 20_000
# Settled motion changes by less from a cycle to the next; by less still where it was not settled.
_CHANGE, _TIGHTER, _SMALLEST_CHANGE = 3e-3, 0.25, 1e-6
# Where motion settles and no cycle is there, the rule's steps may be to blame: close to a fold it
# sees one too many. The motion goes on in steps so many times as short, so often.
_SHORTER, _MOST_TIMES = 4.0, 3
# A motion as far from where it seemed to settle as this has left it.
_LEFT = 0.3
# What grows by e to this has left an unstable cycle, from however near.
_LONG_SINCE = 40.0
# A motion as near to a stable cycle as this is captured.
_NEAR = 0.03
# Where a refinement failed, it is not tried again as near as this unless the motion has settled so
# many times as well.
_TRIED, _AGAIN = 0.02, 10.0
_SAMPLES = 512
# Without friction motion never ends: it has died when the swivel turns by less than this part of
# the angle by which the kick turns it at first.
_FADED = 1e-3
SAME = 1e-4
"""Cycles that differ by less are one."""

# The peaks of motion that is steady, as far as the rule's steps let it, differ by less than the
# first; those of motion that still changes drift by more than a part of the difference, unless that
# is slight, or differ less and less.
_STEADY, _DRIFT, _SLIGHT, _FALLING = 0.02, 0.25, 2e-5, 0.8


class Fate(enum.Enum):
    """What becomes of a kicked gear; ROAMS is bounded motion without a stable cycle, UNTOLD is one
    that settles where the method asked for has no cycle."""

    DIES = "dies"
    CYCLE = "cycle"
    GROWS = "grows"
    ROAMS = "roams"
    UNTOLD = "untold"


@dataclass(frozen=True)
class Course:
    """What became of a ``kick`` [rad/s]: ``orbit`` is there for CYCLE, ``envelope`` (4,), the
    largest magnitudes once the motion is steady, for ROAMS."""

    kick: float
    fate: Fate
    orbit: Orbit | None = None
    envelope: Real | None = None


@dataclass
class Kicks:
    """Kicks at one operating point; ``orbits`` are the stable limit cycles known so far."""

    point: OperatingPoint
    settings: Settings
    budget: Budget
    orbits: list[Orbit] = field(default_factory=list)

    def __post_init__(self) -> None:
        """Raises ValueError and LinAlgError for a gear whose numbers are beyond floating point."""
        self.system = gear_system(self.point)
        self._motion = Motion(self.point, self.system)
        self.warm = bool(self.orbits)
        self._passages = [upward_passage(orbit) for orbit in self.orbits]
        self._failed: list[tuple[Real, float, Orbit | None]] = []
        self._dying: list[Real] = []
        self.rest_is_stable = self._rest_is_stable()

    def _rest_is_stable(self) -> bool:
        """Whether a small disturbance dies."""
        if self.point.damper.coulomb_torque > 0.0:
            return bool(self._motion.law.rest_is_stable)
        modes = linear_modes(self.point.gear, self.point.damper, self.point.velocity)
        return bool(modes.growth_rate[0] < 0.0)

    def other_kicks(self) -> Real:
        """Kicks between those of KICKS and below, ascending [rad/s].

        Friction stops one of T / sqrt(I K), with the damper locked, before the swivel turns back;
        without friction they go down to a very small one.
        """
        inertia = float(self.system.mass[SWIVEL, SWIVEL])
        stiffness = abs(float(self.system.stiffness[SWIVEL, SWIVEL]))
        least = max(self.point.damper.coulomb_torque / math.sqrt(inertia * stiffness), _LEAST_KICK)
        count = max(math.ceil(math.log(KICKS[0] / least) / math.log(_RATIO)), 0)
        return np.concatenate([KICKS[0] * _RATIO ** np.arange(-count, 0.0), _BETWEEN])

    def courses(self, kicks: Real) -> list[Course]:
        """What becomes of each of ``kicks`` (m,). Raises BudgetError."""
        found: list[Course] = []
        while len(found) < len(kicks):
            ends, cycles, taken = self._motion.try_kicks(
                kicks[len(found):], min(self.budget.left + 1, _LONGEST), _CHANGE, self._known(),
                _NEAR, self._floor())
            self.budget.spend(taken)
            for end, cycle in zip(ends.tolist(), cycles.tolist(), strict=True):
                kick = float(kicks[len(found)])
                if end in (End.HELD, End.FADED):
                    found.append(Course(kick, Fate.DIES))
                elif end == End.CAPTURED:
                    found.append(Course(kick, Fate.CYCLE, self.orbits[cycle]))
                else:
                    found.append(self._followed(kick, End(end)))
        return found

    def _known(self) -> Real:
        return np.array(self._passages).reshape(-1, STATES)

    def _floor(self) -> float:
        """The swivel's angle per kick [s] below which a motion has died, or 0."""
        if self.point.damper.coulomb_torque > 0.0 or not self.rest_is_stable:
            return 0.0
        inertia = float(self.system.mass[SWIVEL, SWIVEL])
        stiffness = abs(float(self.system.stiffness[SWIVEL, SWIVEL]))
        return _FADED * math.sqrt(inertia / stiffness)

    def _followed(self, kick: float, end: End) -> Course:
        """What becomes of the motion after ``kick``, followed so far to ``end``."""
        motion, change, times = self._motion, _CHANGE, 0
        # The unstable cycle that the motion has come by and will leave, for how many passages it
        # has not, and where it seemed to settle.
        leaves: Orbit | None = None
        lingered = 0
        seeming: list[Real] = []
        while True:
            if end is End.GROWN:
                return Course(kick, Fate.GROWS)
            if end in (End.HELD, End.FADED):
                self._dying += seeming
                return Course(kick, Fate.DIES)
            if end is End.SETTLED:
                if any(_distance(motion, passage) < _TRIED for passage in self._dying):
                    return Course(kick, Fate.DIES)
                seeming.append(motion.memory.state[motion.passages - 1].copy())
                orbit = self._settled(motion, change)
                if orbit is not None and orbit.stable:
                    return Course(kick, Fate.CYCLE, orbit)
                change *= _TIGHTER
                leaves = orbit
            long = motion.passages > _MOST_PASSAGES or end is End.FULL
            hovers = bool(seeming) and motion.passages > _FEW_PASSAGES and _steady(motion) and (
                not _changes(motion))
            if long and leaves is not None and _steady(motion):
                lingered += motion.passages
            if long and (_changes(motion) or (
                    lingered and leaves is not None and not _stays(leaves, lingered))):
                motion.begin(motion.state)
            elif (long and (leaves is not None or times == _MOST_TIMES or not _steady(motion))) or (
                    end is End.SETTLED and times == _MOST_TIMES and change < _SMALLEST_CHANGE):
                # A cycle that attracts slowly, in turns, is not told from a torus by eye.
                orbit = self._settled(motion, change)
                if orbit is not None and orbit.stable:
                    return Course(kick, Fate.CYCLE, orbit)
                if self.settings.method == BALANCE and _steady(motion):
                    return Course(kick, Fate.UNTOLD)
                return Course(kick, Fate.ROAMS, envelope=_peaks(motion).max(axis=0))
            elif times < _MOST_TIMES and leaves is None and (
                    long or hovers or (end is End.SETTLED and change < _CHANGE / 10.0)):
                motion, times = self._finer(motion), times + 1
            elif times and seeming and motion.passages and (
                    _distance(motion, seeming[-1]) > _LEFT):
                # It did not settle there; what is left can be followed in long steps again.
                self._motion.begin(motion.state)
                motion, change, times = self._motion, _CHANGE, 0
            known = self._known()
            end, taken = motion.follow(min(self.budget.left + 1, _LONGEST), change, known, _NEAR,
                                       kick * self._floor())
            self.budget.spend(taken)
            if end is End.CAPTURED:
                state = motion.memory.state[motion.passages - 1]
                nearest = int(np.argmin(np.abs(known - state).max(axis=1)))
                return Course(kick, Fate.CYCLE, self.orbits[nearest])

    def _finer(self, motion: Motion) -> Motion:
        """The same motion in shorter steps."""
        finer = Motion(self.point, self.system, motion.law.step / _SHORTER)
        finer.begin(motion.state)
        return finer

    def _settled(self, motion: Motion, change: float) -> Orbit | None:
        """The cycle near the last passage, which differs by less than ``change`` from one before,
        or None; a stable one that is new is kept."""
        last = motion.passages - 1
        state = motion.memory.state[last].copy()
        for tried, best, found in self._failed:
            if _distance(motion, tried) < _TRIED and best <= _AGAIN * change:
                return found
        period = motion.period(last)
        self.budget.spend(_SAMPLES)
        recorder = Motion(self.point, self.system, period / _SAMPLES)
        recorder.begin(state)
        orbit = refined(self.system, guess_from_motion(recorder.record(_SAMPLES), state, period),
                        self.settings, self.budget)
        if orbit is None or not orbit.stable:
            self._failed.append((state, change, orbit))
            return orbit
        known = next((other for other in self.orbits if other.same_as(orbit, SAME)), None)
        if known is not None:
            return known
        self.orbits.append(orbit)
        self._passages.append(upward_passage(orbit))
        return orbit


def _distance(motion: Motion, passage: Real) -> float:
    """How far the last passage is from another (8,), relative to the motion's size."""
    size = motion.memory.largest[motion.passages - 1]
    away = motion.memory.state[motion.passages - 1] - passage
    return float(np.abs(away / np.where(size > 0.0, size, 1.0)).max())


def _steady(motion: Motion) -> bool:
    """Whether the swivel's peaks have become the same, but for what the rule's steps do to it."""
    peaks = _peaks(motion)[:, SWIVEL]
    return bool(len(peaks) > 1 and np.ptp(peaks) <= _STEADY * peaks.max())


def _stays(cycle: Orbit, passages: int) -> bool:
    """Whether a motion that has been near an unstable ``cycle`` for so long will not leave."""
    return passages * math.log(max(cycle.multiplier, 1.0)) > _LONG_SINCE


def _changes(motion: Motion) -> bool:
    """Whether the swivel's peaks still grow or fall, or differ less and less from one another."""
    peaks = _peaks(motion)[:, SWIVEL]
    half = len(peaks) // 2
    before, after = peaks[:half], peaks[half:]
    spread = np.ptp(peaks)
    return bool(abs(after.max() - before.max()) > _STEADY * before.max()
                or abs(after.mean() - before.mean()) > _DRIFT * spread > _SLIGHT * before.max()
                or _STEADY * before.max() < np.ptp(after) < _FALLING * np.ptp(before))


def _peaks(motion: Motion) -> Real:
    """The largest positions (m, 4) from passage to passage in the later half of a motion."""
    count = motion.passages
    return motion.memory.largest[count // 2:count, :STATES // 2]
