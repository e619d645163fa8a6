"""Motion of the gear by the implicit midpoint rule with set-valued friction: quick, not exact.

With the mean velocity u of a step h, q+ = q + h u and v+ = 2 u - v,
2 M (u - v) / h + C u + K (q + h u / 2) + T s e_swivel + C_d |u_d| u_d e_damper = 0.
The mean sign s of the swivel's rate in the step is that of its rate; where this turns, it follows
from the shares of the step before and after, taking the rate as linear; and where friction suffices
to hold the swivel, it is the one that leaves it at rest. However stiff, linear oscillations are
neither damped nor excited by the rule, so that what grows in it grows; their frequency errs as h^2.
"""

from __future__ import annotations

import enum
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..compiling import compiled
from ..gear.matrices import DAMPER, STRUT_TILT, SWIVEL, TYRE_LATERAL
from ..gear.parameters import HALF_TURN
from ..gear.system import OperatingPoint
from ..ihb.system import System
from .midpoint_law import Law, law_of

Real = NDArray[np.float64]
Index = NDArray[np.int64]

STATES = 8
_STEPS, _HALF, _EARLY, _RATE, _LONGEST, _TURNED = range(6)
STEPS_OF_FASTEST = 40.0
"""Steps in a period of the fastest mode of strut, swivel and tyre."""

_ITERATIONS, _ROUNDING = 16, 1e-7
# A passage is compared with so many before it: a cycle may pass zero several times.
_MOST_PASSAGES = 5
# So many passages of a motion are kept.
_ROOM = 2048
_CHECK_HELD_EVERY = 16
# Of a gear at rest all rates are smaller (SI).
_REST = 1e-9
# A swivel that slides one way for so many of the shortest periods and for so many times as long
# as ever before, in its later part slower by this factor, creeps to rest: friction may just balance
# the torque that is left. Before it has turned twice, it takes many more.
_SLIDE, _TIMES, _SLOWER = 80.0, 4.0, 0.9
_TURNS, _SLIDE_AT_FIRST = 2.0, 20_000.0
# The damper's rate is left out: stiff as it is, the rule reflects it and tells nothing about it.
_COMPARED = np.array([0, 1, 2, 3, 4, 5, 7])
_SAME_PASSAGE = 0.02


class End(enum.IntEnum):
    """Why a motion was followed no further."""

    STEPS = 0
    HELD = 1
    GROWN = 2
    SETTLED = 3
    CAPTURED = 4
    FADED = 5
    FULL = 6


class Memory(NamedTuple):
    """Upward passages of the swivel through zero, as far as ``passages`` (1,) says.

    ``clock`` (1,) is the time [s]. ``slide`` (6,) tells how the swivel slides: for how many steps
    one way, half of those that tell, its rate then and now, the longest slide before [s], and how
    often it has turned. ``time`` (m,) [s] and ``state`` (m, 8), (q, dq/dt), belong to the passages;
    ``largest`` (m + 1, 8) holds the largest magnitudes since the passage before.
    """

    clock: Real
    slide: Real
    passages: Index
    time: Real
    state: Real
    largest: Real


class Motion:
    """A motion of the gear at ``point``, whose system is ``system``, at first at rest."""

    def __init__(self, point: OperatingPoint, system: System, step: float | None = None) -> None:
        """In steps of ``step`` [s], by default STEPS_OF_FASTEST in a period of the gear's fastest
        mode, the damper's own apart.

        Raises ArithmeticError and LinAlgError for a gear whose numbers are beyond floating point.
        """
        try:
            system.check()
        except ValueError as error:
            raise ArithmeticError(str(error)) from error
        self.law = law_of(system.mass, system.damping, system.stiffness,
                        point.damper.coulomb_torque, point.damper.quadratic_damping,
                        point.gear.damper_linkage_stiffness, point.gear.damper_inertia,
                        0.0 if step is None else step, STEPS_OF_FASTEST)
        if not (np.isfinite(self.law.inverse).all() and 0.0 < self.law.step < np.inf):
            raise ArithmeticError("the gear's numbers are beyond floating point")
        self.state = np.zeros(STATES)
        self.memory = Memory(np.zeros(1), np.zeros(6), np.zeros(1, np.int64), np.empty(_ROOM),
                             np.empty((_ROOM, STATES)), np.zeros((_ROOM + 1, STATES)))

    def begin(self, state: Real) -> None:
        """Go on from ``state`` (8,), (q, dq/dt), as if nothing had been before."""
        self.state[:] = state
        _forget(self.memory)

    @property
    def passages(self) -> int:
        """How many upward passages there were."""
        return int(self.memory.passages[0])

    def follow(self, steps: int, change: float, known: Real, near: float, floor: float
               ) -> tuple[End, int]:
        """Follow for at most ``steps``; why it ended, and the steps taken.

        HELD where friction holds the swivel for good, or it creeps to rest; GROWN where an angle
        passes half a turn;
        SETTLED where a passage differs by less than ``change`` of its size from an earlier one;
        CAPTURED where it is as ``near`` to one of the ``known`` (k, 8) passages of cycles; FADED
        where the swivel's magnitude since the last passage is below ``floor`` [rad]; FULL where
        there were too many passages to remember.
        """
        end, taken, _ = _follow(self.law, self.state, self.memory, steps, change, known, near,
                                floor)
        return End(end), taken

    def try_kicks(self, kicks: Real, steps: int, change: float, known: Real, near: float,
                  floor: float) -> tuple[Index, Index, int]:
        """Kicks [rad/s] of the swivel at rest, one after the other, as far as they die or are
        captured: the end of each, shape (m,), the number of the cycle it led to, and the steps.

        The last one may have ended otherwise, and can be followed on. ``floor`` is per kick [s].
        """
        return _try_kicks(self.law, self.state, self.memory, kicks, steps, change, known, near,
                          floor)

    def period(self, number: int) -> float:
        """After how long [s] the motion at passage ``number`` has come back to where it was."""
        return _period(self.memory, number)

    def record(self, steps: int) -> Real:
        """The positions (steps, 4) before each of the next ``steps``."""
        positions = np.empty((steps, STATES // 2))
        _record(self.law, self.state, positions)
        return positions


@compiled
def _forget(memory: Memory) -> None:
    memory.clock[0] = 0.0
    memory.slide[:] = 0.0
    memory.passages[0] = 0
    memory.largest[0] = 0.0


@compiled
def _try_kicks(law: Law, state: Real, memory: Memory, kicks: Real, steps: int, change: float,
               known: Real, near: float, floor: float) -> tuple[Index, Index, int]:
    ends, cycles = np.zeros(kicks.shape[0], np.int64), np.full(kicks.shape[0], -1)
    total = 0
    for number in range(kicks.shape[0]):
        state[:] = 0.0
        state[STATES // 2 + SWIVEL] = kicks[number]
        _forget(memory)
        end, taken, cycle = _follow(law, state, memory, steps - total, change, known, near,
                                    floor * kicks[number])
        total += taken
        ends[number], cycles[number] = end, cycle
        if end not in (1, 4, 5):
            return ends[:number + 1], cycles[:number + 1], total
    return ends, cycles, total


@compiled
def _advance(inverse: Real, mass: Real, stiffness: Real, torque: float, quadratic: float,
             step: float, state: Real, work: Real) -> float:
    """One step: ``state`` is replaced; the swivel's mean rate. ``work`` (3, 4) is room."""
    dofs = STATES // 2
    for row in range(dofs):
        total = 0.0
        for column in range(dofs):
            total += (mass[row, column] * state[dofs + column]
                      - stiffness[row, column] * state[column])
        work[0, row] = total
    for row in range(dofs):
        total = 0.0
        for column in range(dofs):
            total += inverse[row, column] * work[0, column]
        work[1, row] = total
    sign, held, drag = _friction(inverse, work[1], torque, quadratic, state[dofs + SWIVEL])
    for row in range(dofs):
        work[2, row] = (work[1, row] - inverse[row, SWIVEL] * torque * sign
                        - inverse[row, DAMPER] * drag)
    if held:
        work[2, SWIVEL] = 0.5 * state[dofs + SWIVEL]
    for row in range(dofs):
        state[row] += step * work[2, row]
        state[dofs + row] = 2.0 * work[2, row] - state[dofs + row]
    return float(work[2, SWIVEL])


@compiled
def _record(law: Law, state: Real, positions: Real) -> None:
    dofs = STATES // 2
    work = np.empty((3, dofs))
    for number in range(positions.shape[0]):
        positions[number] = state[:dofs]
        _advance(law.inverse, law.mass, law.stiffness, law.torque, law.quadratic, law.step,
                 state, work)


@compiled
def _follow(law: Law, state: Real, memory: Memory, steps: int, change: float, known: Real,
            near: float, floor: float) -> tuple[int, int, int]:
    """See Motion.follow; also the number of the cycle that captures the motion, or -1."""
    dofs = STATES // 2
    work, passing = np.empty((3, dofs)), np.empty(STATES)
    inverse, mass, stiffness = law.inverse, law.mass, law.stiffness
    torque, quadratic, step = law.torque, law.quadratic, law.step
    rest_is_stable = law.rest_is_stable
    clock, times, states, largest = memory.clock, memory.time, memory.state, memory.largest
    count = memory.passages[0]
    time = clock[0]
    slide = memory.slide
    stuck = 0
    for number in range(1, steps + 1):
        before = state[SWIVEL]
        if before < 0.0:
            passing[:] = state
        mean = _advance(inverse, mass, stiffness, torque, quadratic, step, state, work)
        time += step
        bound = 0.0
        for row in range(STATES):
            size = abs(state[row])
            if size > largest[count, row]:
                largest[count, row] = size
            if row < TYRE_LATERAL and size > bound:
                bound = size
        if not (bound <= HALF_TURN and np.isfinite(state[TYRE_LATERAL])):
            return 2, number, -1
        if abs(mean) < _REST:
            stuck += 1
            if stuck % _CHECK_HELD_EVERY == 0 and (
                    _rests(state) or (rest_is_stable and mean == 0.0 and _held(law, state))):
                return 1, number, -1
        else:
            stuck = 0
        if mean * slide[_RATE] > 0.0:
            slide[_STEPS] += 1.0
            if slide[_STEPS] == slide[_HALF]:
                slide[_EARLY] = mean
            elif slide[_STEPS] == 2.0 * slide[_HALF]:
                if abs(mean) < _SLOWER * abs(slide[_EARLY]):
                    return 1, number, -1
                slide[_STEPS] = 0.0
        elif mean != 0.0:
            slide[_LONGEST] = max(slide[_LONGEST], slide[_STEPS] * step)
            slide[_TURNED] += 1.0
            slide[_STEPS] = 0.0
            least = _SLIDE if slide[_TURNED] > _TURNS else _SLIDE_AT_FIRST
            slide[_HALF] = np.ceil(
                0.5 * max(least * law.shortest, _TIMES * slide[_LONGEST]) / step)
        slide[_RATE] = mean
        after = state[SWIVEL]
        if not before < 0.0 <= after:
            continue
        share = after / (after - before)
        clock[0] = time
        times[count] = time - share * step
        for row in range(STATES):
            states[count, row] = state[row] + share * (passing[row] - state[row])
        count += 1
        memory.passages[0] = count
        for row in range(STATES):
            largest[count, row] = abs(state[row])
        if largest[count - 1, SWIVEL] < floor:
            return 5, number, -1
        for cycle in range(known.shape[0]):
            if _distance(states[count - 1], known[cycle], largest[count - 1]) < near:
                return 4, number, cycle
        if count > _MOST_PASSAGES:
            for back in range(1, _MOST_PASSAGES + 1):
                if _distance(states[count - 1], states[count - 1 - back],
                             largest[count - 1]) < change:
                    return 3, number, -1
        if count == times.shape[0]:
            return 6, number, -1
    clock[0] = time
    return 0, steps, -1


@compiled
def _period(memory: Memory, number: int) -> float:
    least = np.inf
    for back in range(1, min(_MOST_PASSAGES, number) + 1):
        least = min(least, _distance(memory.state[number], memory.state[number - back],
                                     memory.largest[number]))
    for back in range(1, min(_MOST_PASSAGES, number) + 1):
        # Steps are not exact: one return among others that differ as little is the shortest.
        if _distance(memory.state[number], memory.state[number - back],
                     memory.largest[number]) <= max(3.0 * least, _SAME_PASSAGE):
            return float(memory.time[number] - memory.time[number - back])
    return np.nan


@compiled
def _distance(state: Real, other: Real, size: Real) -> float:
    """The largest difference of two passages, relative to ``size``."""
    distance = 0.0
    for row in _COMPARED:
        if size[row] > 0.0:
            distance = max(distance, abs(state[row] - other[row]) / size[row])
    return distance


@compiled
def _rests(state: Real) -> bool:
    """Whether swivel, strut and tyre stand still."""
    dofs = STATES // 2
    return bool(abs(state[dofs + STRUT_TILT]) < _REST and abs(state[dofs + SWIVEL]) < _REST
                and abs(state[dofs + TYRE_LATERAL]) < _REST)


@compiled
def _held(law: Law, state: Real) -> bool:
    """Whether the swivel, stuck in ``state``, stays so for ever."""
    dofs = STATES // 2
    swivel = state[SWIVEL]
    away = (state[STRUT_TILT] - swivel * law.equilibrium[0],
            state[TYRE_LATERAL] - swivel * law.equilibrium[1],
            state[dofs + STRUT_TILT], state[dofs + TYRE_LATERAL])
    needed = abs(law.held * swivel)
    for mode in range(4):
        share = 0.0 + 0.0j
        for row in range(4):
            share += law.torques[mode, row] * away[row]
        needed += abs(share)
    needed += np.hypot(law.linkage * (state[DAMPER] - swivel), law.impedance * state[dofs + DAMPER])
    return bool(needed < law.torque)


@compiled
def _friction(inverse: Real, free: Real, torque: float, quadratic: float, before: float
              ) -> tuple[float, bool, float]:
    """The mean sign, whether the swivel is held, and the damper's drag C_d |u_d| u_d.

    ``before`` is the swivel's rate at the begin of the step.
    """
    first = 1.0 if before >= 0.0 else -1.0
    after, drag = _rate_after(inverse, free, torque, quadratic, before, first)
    if first * after > 0.0:
        return first, False, drag
    last = -first
    after_last, drag = _rate_after(inverse, free, torque, quadratic, before, last)
    turns = last * after_last > 0.0
    if turns and before == 0.0:
        return last, False, drag
    # Where it turns, the sign less that of the shares is zero, and else the rate afterwards.
    low, high = first, last
    at_low, at_high = after, after_last
    if turns:
        at_low = low - _mean_sign(before, after)
        at_high = high - _mean_sign(before, after_last)
    sign = 0.0
    largest = abs(at_low) + abs(at_high)
    for _ in range(_ITERATIONS):
        sign = (low * at_high - high * at_low) / (at_high - at_low)
        value, drag = _rate_after(inverse, free, torque, quadratic, before, sign)
        if turns:
            value = sign - _mean_sign(before, value)
        if abs(value) <= _ROUNDING * largest:
            break
        # Half of the value of an end that stays, so that it does not stay for ever.
        if (value > 0.0) == (at_low > 0.0):
            low, at_low, at_high = sign, value, 0.5 * at_high
        else:
            high, at_high, at_low = sign, value, 0.5 * at_low
    return sign, not turns, drag


@compiled
def _mean_sign(before: float, after: float) -> float:
    """The mean sign of a rate that goes linearly from one value to another, not both zero."""
    sign = 1.0 if before + after > 0.0 else -1.0
    if before * after >= 0.0:
        return sign
    return sign * abs(abs(before) - abs(after)) / (abs(before) + abs(after))


@compiled
def _rate_after(inverse: Real, free: Real, torque: float, quadratic: float, before: float,
                sign: float) -> tuple[float, float]:
    """The swivel's rate after a step with a mean ``sign`` of friction, and the damper's drag."""
    rate = free[DAMPER] - inverse[DAMPER, SWIVEL] * torque * sign
    rate = 2.0 * rate / (1.0 + np.sqrt(1.0 + 4.0 * inverse[DAMPER, DAMPER] * quadratic * abs(rate)))
    drag = quadratic * abs(rate) * rate
    return (2.0 * (free[SWIVEL] - inverse[SWIVEL, SWIVEL] * torque * sign
                   - inverse[SWIVEL, DAMPER] * drag) - before), drag
