"""How large a disturbance does not die: a kick of the swivel, or its release from an angle.

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

from ..gear.linear import linear_modes
from ..gear.matrices import DAMPER, STRUT_TILT, SWIVEL, TYRE_LATERAL, stiffness_matrix
from ..gear.parameters import MINIMUM_VELOCITY_RANGE
from ..gear.system import OperatingPoint
from ..ihb.solution import Outcome
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
from .stable_cycle import stable_cycle
from .verdict import Verdict

Real = NDArray[np.float64]

_TOLERANCE = 1e-5
_BISECTION = 1e-4
_SCAN_RATIO = 1.05
_REFINEMENT = 8
_DEEPEST = 3
# The scan of kicks begins at this part of the rate with which the trigger cycle passes zero.
_SMALLEST_KICK = 0.2
_LEAST_KICK = 1e-4
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


class Leads(enum.Enum):
    """What a disturbance that does not die leads to.

    GROWTH is motion that leaves the range of the model, where no stable cycle is beyond it.
    """

    CYCLE = "limit_cycle"
    NOT_PERIODIC = "not_periodic"
    GROWTH = "growth"


class Threshold(NamedTuple):
    """The smallest disturbance found that does not die, ``starts``, and a smaller one that
    ``dies``; and what the former ``leads_to``.

    They differ by less than 1e-4 of either, but for a kick without a trigger cycle.
    """

    dies: float
    starts: float
    leads_to: Leads


@dataclass(frozen=True)
class Trigger:
    """How shimmy, or growth without bound, starts at an operating point.

    start : DISTURBANCE, if one of a certain size is needed; ANYTHING, where rest is unstable; or
        NOTHING, where every disturbance dies
    cycle : the trigger cycle, if there is one
    kick : change of the swivel rate [rad/s] of the gear at rest
    release_angle : swivel angle [rad] from which the gear is released, after having been held
        there with all other coordinates in static equilibrium
    message : the same in a sentence

    A threshold is None where every disturbance within the model's range dies.
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
    """What became of a motion, for how long [s] the swivel moved, and what it led to."""

    fate: _Fate
    life: float
    leads_to: Leads = Leads.CYCLE


_STARTED = {Outcome.LIMIT_CYCLE: "shimmy", Outcome.UNBOUNDED: "growth without bound",
            Outcome.NOT_PERIODIC: "motion that is not periodic"}
_NOTHING = "no trigger: there is no shimmy within the gear's range"


def trigger(point: OperatingPoint, cycles: Sequence[FoundCycle] | None = None,
            verdict: Verdict | None = None) -> Trigger:
    """The trigger at ``point``; ``cycles`` are all cycles there and ``verdict`` is that of
    stable_cycle(), if they are known.

    Raises ContinuationError as all_cycles, and TriggerError.
    """
    if verdict is None:
        verdict = stable_cycle(point)
    if not rest_is_stable(point):
        grows = {Outcome.UNBOUNDED: " without bound", Outcome.LIMIT_CYCLE: " to the limit cycle"}
        return Trigger(Start.ANYTHING, None, None, None,
                       "no trigger: rest is unstable, and any disturbance grows"
                       f"{grows.get(verdict.outcome, '')}")
    if cycles is None:
        cycles = all_cycles(point, verdict.stable_cycles)
    cycle = next((found for found in cycles
                  if found.role is Role.TRIGGER and not found.beyond_gear), None)
    what = _STARTED.get(verdict.outcome)
    if cycle is None and what is None:
        if verdict.failed:
            raise TriggerError(verdict.reason)
        return Trigger(Start.NOTHING, None, None, None, _NOTHING)
    if cycle is None and verdict.outcome is not Outcome.UNBOUNDED:
        return _without_cycle(verdict)
    if cycle is not None:
        first = _SMALLEST_KICK * _passing_rate(cycle.orbit)
    else:
        first = _SMALLEST_KICK * verdict.kick.dies if verdict.kick else 0.0
    follower = _Follower(point, cycles, verdict)
    kick = _smallest(lambda size: follower.follow(_kicked(size)), 0.0, max(first, _LEAST_KICK),
                     KICK_RANGE.high, follower.window)
    shape, stiffness = held_shape(point)
    reach = ANGLE_LIMIT / float(np.abs(shape[:DAMPER + 1]).max())
    # Friction alone holds the swivel up to there.
    least = point.damper.coulomb_torque / abs(stiffness) if stiffness else math.inf
    release = _smallest(lambda size: follower.follow(size * shape), least, _ABOVE_STICKING * least,
                        reach, follower.window)
    if what is None and kick is None and release is None:
        return Trigger(Start.NOTHING, None, None, None, _NOTHING)
    return Trigger(Start.DISTURBANCE, cycle, kick, release, _sentence(
        what or "motion that does not die", kick, release) + _growing_kick(verdict))


def _without_cycle(verdict: Verdict) -> Trigger:
    """What the verdict itself knows, where the cycle on the border of rest was not found."""
    if verdict.kick is None:
        raise TriggerError("the cycle between rest and shimmy was not found")
    leads = Leads.CYCLE if verdict.outcome is Outcome.LIMIT_CYCLE else Leads.NOT_PERIODIC
    kick = Threshold(verdict.kick.dies, verdict.kick.grows, leads)
    return Trigger(Start.DISTURBANCE, None, kick, None,
                   f"{_STARTED[verdict.outcome]} is started by {_by_kick(kick)}; the cycle between "
                   f"rest and shimmy was not found{_growing_kick(verdict)}")


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

    def __init__(self, point: OperatingPoint, cycles: Sequence[FoundCycle], verdict: Verdict
                 ) -> None:
        self._point = point
        self._held = _Held(point)
        within = [found.orbit for found in cycles if not found.beyond_gear]
        sizes = [orbit.swivel for orbit in within]
        self._leads: list[Leads | None] = [Leads.CYCLE if orbit.stable else None
                                           for orbit in within]
        if verdict.envelope is not None:
            sizes.append(float(verdict.envelope[SWIVEL]))
            self._leads.append(Leads.NOT_PERIODIC)
        self._sizes = np.log(sizes)
        self._beyond = Leads.CYCLE if any(
            found.role is Role.STABLE and found.beyond_gear for found in cycles) else Leads.GROWTH
        self.window = max((1.0 / orbit.frequency_hz for orbit in within), default=float(
            1.0 / linear_modes(point.gear, point.damper, point.velocity).frequency_hz[0]))

    def follow(self, state: Real) -> _Motion:
        """The fate of the motion from ``state``.

        It dies where friction holds the swivel for good, starts shimmy where its amplitude has
        stayed nearer to a stable cycle's than to an unstable one's, and may leave the range of the
        model.
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
                return _Motion(_Fate.LEAVES, math.inf, self._beyond)
            moving = np.flatnonzero(np.diff(swivel))
            if moving.size:
                life = float(times[moving[-1]])
            if simulation.at_rest or (
                    simulation.sticking and self._held.for_good(simulation.state)):
                return _Motion(_Fate.DIES, life)
            size = 0.5 * float(swivel.max() - swivel.min())
            leads = self._nearest(size) if moving.size else None
            near = 0 if leads is None else near + 1
            if leads is not None and near == _PERIODS_OF_SHIMMY:
                return _Motion(_Fate.STARTS, math.inf, leads)
        raise TriggerError(f"a motion has neither died nor grown after {life:g} s")

    def _nearest(self, size: float) -> Leads | None:
        """What motion of this amplitude is nearest to, None for an unstable cycle or nothing."""
        if not self._leads:
            return None
        return self._leads[int(np.argmin(np.abs(self._sizes - math.log(size))))]


def _smallest(follow: Callable[[float], _Motion], floor: float, first: float, last: float,
              period: float) -> Threshold | None:
    """The smallest disturbance that does not die, of those from ``first`` to ``last``.

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
        below, above, leads = early
    elif motions[-1].fate is _Fate.DIES:
        return None
    else:
        above, leads = sizes[-1], motions[-1].leads_to
        below = sizes[-2] if len(sizes) > 1 else floor
    while above - below > _BISECTION * above:
        middle = 0.5 * (below + above)
        motion = follow(middle)
        if motion.fate is _Fate.DIES:
            below = middle
        else:
            above, leads = middle, motion.leads_to
    return Threshold(below, above, leads)


def _hidden(follow: Callable[[float], _Motion], sizes: list[float], motions: list[_Motion],
            period: float, depth: int) -> tuple[float, float, Leads] | None:
    """Neighbours of which the larger does not die, and what it leads to, around a motion that
    dies late, or None."""
    lives = [motion.life for motion in motions]
    for index in range(1, len(sizes) - 1):
        if depth == _DEEPEST or not lives[index] > max(lives[index - 1], lives[index + 1]) + period:
            continue
        finer = np.linspace(sizes[index - 1], sizes[index + 1], 2 * _REFINEMENT + 1).tolist()
        found = [follow(size) for size in finer]
        for place, motion in enumerate(found):
            if motion.fate is not _Fate.DIES:
                return finer[place - 1], finer[place], motion.leads_to
        deeper = _hidden(follow, finer, found, period, depth + 1)
        if deeper is not None:
            return deeper
    return None


def _passing_rate(orbit: Orbit) -> float:
    """The swivel rate [rad/s] with which a cycle passes zero."""
    return float(orbit.initial_state()[0][len(orbit.amplitude) + SWIVEL])


def _growing_kick(verdict: Verdict) -> str:
    if verdict.kick is None or verdict.kick.unbounded is None:
        return ""
    return f"; a kick of {verdict.kick.unbounded:.4g} rad/s grows without bound"


_BEYOND_RANGE = " (the motion leaves the range of the model)"


def _by_kick(kick: Threshold | None) -> str:
    if kick is None:
        return "no kick of the swivel"
    return f"a kick of {kick.starts:.4g} rad/s of the swivel"


def _sentence(what: str, kick: Threshold | None, release: Threshold | None) -> str:
    by_release = ("no release" if release is None
                  else f"a release from {release.starts:.4g} rad")
    by_kick = _by_kick(kick)
    if kick is not None and kick.leads_to is Leads.GROWTH:
        by_kick += _BEYOND_RANGE
    if release is not None and release.leads_to is Leads.GROWTH:
        by_release += _BEYOND_RANGE
    shimmies = "" if what != _STARTED[Outcome.UNBOUNDED] else "nothing shimmies, but "
    return f"{shimmies}{what} is started by {by_kick} and by {by_release}"
