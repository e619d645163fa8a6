"""How large a disturbance starts shimmy: a kick of the swivel, or its release from an angle.

Under Coulomb friction small motion dies, and the trigger cycle lies between it and shimmy. What a
rig can apply is measured by simulation: disturbances of growing size until one starts shimmy, and
then bisection. Disturbances that start shimmy need not be an interval: where the motion dies late
compared with its neighbours of the scan, one in between might start it, and is looked for.
"""

from __future__ import annotations

import enum
import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..gear.matrices import DAMPER, STRUT_TILT, SWIVEL, TYRE_LATERAL, stiffness_matrix
from ..gear.parameters import MINIMUM_VELOCITY_RANGE
from ..gear.system import OperatingPoint
from ..simulation.rolling_state import (
    DAMPER_RATE,
    STATES,
    STRUT_TILT_RATE,
    SWIVEL_RATE,
    TYRE_TORSION,
    rolling_model,
    tyre_kinematics,
)
from ..simulation.simulation import ANGLE_LIMIT, KICK_RANGE, Simulation, SimulationError
from .limit_cycles import FoundCycle, Role, all_cycles, rest_is_stable
from .orbits import Orbit

Real = NDArray[np.float64]

_TOLERANCE = 1e-5
_BISECTION = 1e-4
_SCAN_RATIO = 1.05
_REFINEMENT = 8
_DEEPEST = 3
# The scan of kicks begins at this part of the rate with which the trigger cycle passes zero.
_SMALLEST_KICK = 0.2
# At the limit of sticking itself, rounding would release and hold the swivel in turns.
_ABOVE_STICKING = 1.000001
_SAMPLES = 64
# Shimmy has started when the motion has been nearest to a stable cycle for so many periods.
_PERIODS_OF_SHIMMY = 8
_MOST_PERIODS = 3000
_STRUT_AND_TYRE = [STRUT_TILT, TYRE_LATERAL, STRUT_TILT_RATE, TYRE_TORSION]


class Start(enum.Enum):
    """What it takes to start shimmy."""

    DISTURBANCE = "disturbance"
    ANYTHING = "anything"
    NOTHING = "nothing"


class Threshold(NamedTuple):
    """The smallest disturbance found that ``starts`` shimmy, and a smaller one that ``dies``.

    They differ by less than 1e-4 of either.
    """

    dies: float
    starts: float


@dataclass(frozen=True)
class Trigger:
    """How shimmy starts at an operating point.

    start : DISTURBANCE, if one of a certain size is needed; ANYTHING, where rest is unstable; or
        NOTHING, where there is no shimmy
    cycle : the trigger cycle
    kick : change of the swivel rate [rad/s] of the gear at rest
    release_angle : swivel angle [rad] from which the gear is released, after having been held
        there with all other coordinates in static equilibrium
    message : the same in a sentence

    A threshold is None where no disturbance within the model's range starts shimmy.
    """

    start: Start
    cycle: FoundCycle | None
    kick: Threshold | None
    release_angle: Threshold | None
    message: str


class TriggerError(ArithmeticError):
    """The simulation could not tell whether a motion dies."""


class _Fate(enum.Enum):
    DIES = "dies"
    STARTS = "starts"
    LEAVES = "leaves"


class _Motion(NamedTuple):
    """What became of a motion, and for how long [s] the swivel moved."""

    fate: _Fate
    life: float


def trigger(point: OperatingPoint, cycles: Sequence[FoundCycle] | None = None) -> Trigger:
    """The trigger at ``point``; ``cycles`` are all cycles there, if they are known.

    Raises ContinuationError as all_cycles, and TriggerError.
    """
    if cycles is None:
        cycles = all_cycles(point)
    within = [found for found in cycles if not found.beyond_gear]
    if not rest_is_stable(point):
        return Trigger(Start.ANYTHING, None, None, None,
                       "no trigger: rest is unstable, and any disturbance grows")
    cycle = next((found for found in within if found.role is Role.TRIGGER), None)
    if cycle is None:
        return Trigger(Start.NOTHING, None, None, None,
                       "no trigger: there is no shimmy within the gear's range")
    follower = _Follower(point, [found.orbit for found in within])
    kick = _smallest(lambda size: follower.follow(_kicked(size)), 0.0,
                     _SMALLEST_KICK * _passing_rate(cycle.orbit), KICK_RANGE.high, follower.window)
    shape, stiffness = held_shape(point)
    reach = ANGLE_LIMIT / float(np.abs(shape[:DAMPER + 1]).max())
    # Friction alone holds the swivel up to there.
    least = point.damper.coulomb_torque / abs(stiffness) if stiffness else math.inf
    release = _smallest(lambda size: follower.follow(size * shape), least, _ABOVE_STICKING * least,
                        reach, follower.window)
    return Trigger(Start.DISTURBANCE, cycle, kick, release, _sentence(kick, release))


def held_shape(point: OperatingPoint) -> tuple[Real, float]:
    """The state (8,), as in `rolling_state`, of the gear held at a swivel angle of 1 rad.

    All other coordinates are in static equilibrium. Also returns the torque [N m/rad] against
    which the swivel is held.
    """
    matrix = stiffness_matrix(point.gear, point.velocity)
    others = [dof for dof in range(len(matrix)) if dof != SWIVEL]
    state = np.zeros(STATES)
    state[SWIVEL] = 1.0
    state[others] = -np.linalg.solve(matrix[np.ix_(others, others)], matrix[others, SWIVEL])
    # y' = -V (phi + psi) = 0.
    state[TYRE_TORSION] = -float(tyre_kinematics(point.gear).heading @ state)
    return state, float(matrix[SWIVEL] @ state[:len(matrix)])


def _kicked(size: float) -> Real:
    state = np.zeros(STATES)
    state[SWIVEL_RATE] = size
    return state


class _Held:
    """Tells for certain that friction will hold a swivel that is stuck.

    While it does, strut and tyre move linearly, in modes that decay one by one, and the damper by
    itself, against the linkage, losing energy: the torque that they ask for is bounded.
    """

    def __init__(self, point: OperatingPoint) -> None:
        model = rolling_model(point.gear).at(point.velocity)
        rates, modes = np.linalg.eig(model.sticking[np.ix_(_STRUT_AND_TYRE, _STRUT_AND_TYRE)])
        self._decays = bool(rates.real.max() < 0.0)
        # Each row gives one mode's share of the torque, from the way off equilibrium.
        self._torques = (model.holding_torque[_STRUT_AND_TYRE] @ modes)[:, None] * np.linalg.inv(
            modes)
        self._linkage = point.gear.damper_linkage_stiffness
        self._inertia = point.gear.damper_inertia
        self._friction = point.damper.coulomb_torque
        self._shape, self._stiffness = held_shape(point)

    def for_good(self, state: Real) -> bool:
        """Whether the swivel, stuck in ``state``, stays so for ever."""
        swivel = float(state[SWIVEL])
        away = state - swivel * self._shape
        torque = abs(self._stiffness * swivel)
        torque += float(np.abs(self._torques @ away[_STRUT_AND_TYRE]).sum())
        torque += float(np.hypot(self._linkage * away[DAMPER],
                                 math.sqrt(self._linkage * self._inertia) * away[DAMPER_RATE]))
        return self._decays and torque < self._friction


class _Follower:
    """Follows motions of one gear until it is certain what becomes of them."""

    def __init__(self, point: OperatingPoint, orbits: Sequence[Orbit]) -> None:
        self._point = point
        self._held = _Held(point)
        self._sizes = np.log([orbit.swivel for orbit in orbits])
        self._stable = [bool(orbit.stable) for orbit in orbits]
        self.window = max(1.0 / orbit.frequency_hz for orbit in orbits)

    def follow(self, state: Real) -> _Motion:
        """The fate of the motion from ``state``.

        It dies where friction holds the swivel for good, and starts where its amplitude has stayed
        nearer to a stable cycle's than to an unstable one's, or, where no cycle is stable, where
        it leaves the range of the model.
        """
        point = self._point
        simulation = Simulation(point.gear, point.damper, point.velocity, tolerance=_TOLERANCE,
                                minimum_velocity=MINIMUM_VELOCITY_RANGE.low)
        simulation.set_state(state)
        life, near = 0.0, 0
        for count in range(_MOST_PERIODS):
            times = self.window * (count + np.linspace(0.0, 1.0, _SAMPLES + 1))
            try:
                swivel = simulation.advance(float(times[-1]), times).position[:, SWIVEL]
            except SimulationError:
                return _Motion(_Fate.LEAVES if any(self._stable) else _Fate.STARTS, math.inf)
            moving = np.flatnonzero(np.diff(swivel))
            if moving.size:
                life = float(times[moving[-1]])
            if simulation.at_rest or (
                    simulation.sticking and self._held.for_good(simulation.state)):
                return _Motion(_Fate.DIES, life)
            size = 0.5 * float(swivel.max() - swivel.min())
            if moving.size and self._stable[
                    int(np.argmin(np.abs(self._sizes - math.log(size))))]:
                near += 1
            else:
                near = 0
            if near == _PERIODS_OF_SHIMMY:
                return _Motion(_Fate.STARTS, math.inf)
        raise TriggerError(f"a motion has neither died nor grown after {life:g} s")


def _smallest(follow: Callable[[float], _Motion], floor: float, first: float, last: float,
              period: float) -> Threshold | None:
    """The smallest disturbance that starts shimmy, of those from ``first`` to ``last``.

    At ``floor``, below the first, motion dies for certain.
    """
    sizes: list[float] = []
    motions: list[_Motion] = []
    size = first
    while size <= last:
        sizes.append(size)
        motions.append(follow(size))
        if motions[-1].fate is not _Fate.DIES:
            break
        size *= _SCAN_RATIO
    if not sizes:
        return None
    early = _hidden(follow, sizes, motions, period, 0)
    if early is not None:
        below, above = early
    elif motions[-1].fate is _Fate.STARTS:
        above = sizes[-1]
        below = sizes[-2] if len(sizes) > 1 else floor
    else:
        return None
    while above - below > _BISECTION * above:
        middle = 0.5 * (below + above)
        if follow(middle).fate is _Fate.DIES:
            below = middle
        else:
            above = middle
    return Threshold(below, above)


def _hidden(follow: Callable[[float], _Motion], sizes: list[float], motions: list[_Motion],
            period: float, depth: int) -> tuple[float, float] | None:
    """Neighbours of which the larger starts shimmy, around a motion that dies late, or None."""
    lives = [motion.life for motion in motions]
    for index in range(1, len(sizes) - 1):
        if depth == _DEEPEST or not lives[index] > max(lives[index - 1], lives[index + 1]) + period:
            continue
        finer = np.linspace(sizes[index - 1], sizes[index + 1], 2 * _REFINEMENT + 1).tolist()
        found = [follow(size) for size in finer]
        for place, motion in enumerate(found):
            if motion.fate is _Fate.STARTS:
                return finer[place - 1], finer[place]
        deeper = _hidden(follow, finer, found, period, depth + 1)
        if deeper is not None:
            return deeper
    return None


def _passing_rate(orbit: Orbit) -> float:
    """The swivel rate [rad/s] with which a cycle passes zero."""
    return float(orbit.initial_state()[0][len(orbit.amplitude) + SWIVEL])


def _sentence(kick: Threshold | None, release: Threshold | None) -> str:
    by_kick = "no kick" if kick is None else f"a kick of {kick.starts:.4g} rad/s"
    by_release = ("no release" if release is None
                  else f"a release from {release.starts:.4g} rad")
    return f"shimmy is started by {by_kick} of the swivel and by {by_release}"
