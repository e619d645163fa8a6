"""The compiled loop: Radau steps on a ladder of lengths, events located, sections compared.

All but one scalar of the equations is linear: the damper's torque C_d |u| u depends on the state
through its rate u alone. The stages of a step are known matrices times (x, torques at the stages),
and Newton's method has as many unknowns as there are stages.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from shimmy_ros.compiling import compiled

from .equations import (
    DAMPER,
    DAMPER_RATE,
    FRICTION,
    INNER,
    SIZE,
    SWIVEL,
    SWIVEL_RATE,
    TILT,
    TILT_RATE,
)
from .records import HELD, LEVELS, MOVING, SECTIONS, Accuracy, Clock, End, Problem, Record, Steps

Real = NDArray[np.float64]

_FIRST_LEVEL = 24
_LONGEST_WORD = 12
# An angle [rad] beyond which a motion is taken to grow for ever.
_LIMIT = np.pi
# Signs this close to zero, relatively, are rounding.
_BEYOND = 1e-13
# A motion whose kinetic energy has been below this part of all for a while only creeps, which a
# gear that oscillation leaves alone without friction goes on to do, or is still but for rounding.
_CREEP, _STILL = 1e-14, 1e-18
# For how long [s] a large value is remembered, and the share of all energy that a variable is
# taken to have at least, when errors are measured.
_MEMORY, _SHARE = 0.3, 1e-4


@compiled
def _times(row: Real, x: Real, torque: Real) -> float:
    """A row (9 + s,) times (x, torques at the stages)."""
    value = 0.0
    for k in range(SIZE):
        value += row[k] * x[k]
    for k in range(torque.size):
        value += row[SIZE + k] * torque[k]
    return value


@compiled
def _torques(table: Real, x: Real, quadratic: float, torque: Real, work: Real,
             rate: Real) -> bool:
    """C_d |u| u at the stages into ``torque`` (s,), by Newton's method on the rates u there."""
    stages = torque.size
    torque[:] = 0.0
    for i in range(stages):
        work[i, stages + 1] = _times(table[i, DAMPER_RATE], x, torque)
        rate[i] = x[DAMPER_RATE]
    if quadratic == 0.0:
        return True
    previous = np.inf
    for _ in range(25):
        for i in range(stages):
            value = work[i, stages + 1] - rate[i]
            for j in range(stages):
                slope = 2.0 * quadratic * abs(rate[j])
                value += table[i, DAMPER_RATE, SIZE + j] * 0.5 * slope * rate[j]
                work[i, j] = -table[i, DAMPER_RATE, SIZE + j] * slope
            work[i, i] += 1.0
            work[i, stages] = value
        # The matrix is the identity plus something like a positive one: no pivots.
        for i in range(stages):
            inverse = 1.0 / work[i, i]
            for j in range(i + 1, stages):
                factor = work[j, i] * inverse
                for k in range(i + 1, stages + 1):
                    work[j, k] -= factor * work[i, k]
        change, size = 0.0, 0.0
        for i in range(stages - 1, -1, -1):
            value = work[i, stages]
            for k in range(i + 1, stages):
                value -= work[i, k] * work[k, stages]
            work[i, stages] = value / work[i, i]
            rate[i] += work[i, stages]
            change = max(change, abs(work[i, stages]))
            size = max(size, abs(rate[i]))
        if not np.isfinite(change):
            return False
        # As accurate as it gets, or rounding alone is left.
        if change <= 1e-14 * size + 1e-300 or (
                change <= 1e-10 * size and change >= 0.1 * previous):
            for i in range(stages):
                torque[i] = quadratic * abs(rate[i]) * rate[i]
            return True
        previous = change
    return False


@compiled
def _value(coefficients: Real, fraction: float) -> float:
    value = 0.0
    for k in range(coefficients.size - 1, -1, -1):
        value = value * fraction + coefficients[k]
    return value


@compiled
def _root(coefficients: Real, low: float, high: float) -> float:
    """Where a polynomial changes its sign between ``low`` and ``high``, by halving."""
    positive_at_high = _value(coefficients, high) > 0.0
    for _ in range(52):
        middle = 0.5 * (low + high)
        if (_value(coefficients, middle) > 0.0) == positive_at_high:
            high = middle
        else:
            low = middle
    return 0.5 * (low + high)


@compiled
def _coefficients(steps: Steps, values: Real, into: Real) -> None:
    for k in range(values.size):
        value = 0.0
        for i in range(values.size):
            value += steps.polynomial[k, i] * values[i]
        into[k] = value


@compiled
def _crossing(steps: Steps, values: Real, floor: float, into: Real) -> float:
    """First fraction at which the polynomial through ``values`` falls below zero; 2 if nowhere."""
    before = 0.0
    for i in range(steps.samples.size):
        value = 0.0
        for j in range(values.size):
            value += steps.sampling[i, j] * values[j]
        if value < -floor:
            _coefficients(steps, values, into)
            return _root(into, before, steps.samples[i])
        before = steps.samples[i]
    return 2.0


@compiled
def _rests(x: Real, problem: Problem) -> bool:
    """Whether the friction holds the swivel for good, in a state with the swivel held."""
    if not problem.rest_is_stable:
        return False
    torque = abs(problem.torque_per_angle * x[SWIVEL])
    for i in range(4):
        mode = 0.0j
        for k in range(4):
            mode += problem.modes[i, k] * (x[INNER[k]] - problem.equilibrium[k] * x[SWIVEL])
        torque += problem.gains[i] * abs(mode)
    # The damper's energy falls, and with it the largest torque of its linkage.
    linkage, inertia = problem.holding[DAMPER], problem.weights[DAMPER_RATE]
    turn = x[DAMPER] - x[SWIVEL]
    torque += np.sqrt(linkage * (linkage * turn**2 + inertia * x[DAMPER_RATE]**2))
    return bool(torque < problem.friction)


@compiled
def _period(record: Record, count: int, size: Real, same: float) -> int:
    """Sections in a period, if the motion has settled on one; else 0."""
    states = record.section_states
    last = states[(count - 1) % SECTIONS]
    for word in range(1, _LONGEST_WORD + 1):
        if count - 1 < 20 * word:
            return 0
        near, ten, twenty = 0.0, 0.0, 0.0
        one = states[(count - 1 - word) % SECTIONS]
        for k in range(FRICTION):
            near = max(near, abs(last[k] - one[k]) / size[k])
        if near > 30.0 * same:
            continue
        middle = states[(count - 1 - 10 * word) % SECTIONS]
        first = states[(count - 1 - 20 * word) % SECTIONS]
        for k in range(FRICTION):
            ten = max(ten, abs(last[k] - middle[k]) / size[k])
            twenty = max(twenty, abs(middle[k] - first[k]) / size[k])
        # What is left to go, if the changes go on falling as a geometric series. A motion that
        # is still on its way to this period might pass for one of twice the period.
        settled = near <= same and ten <= same and (ten < 0.05 * same or (
            ten < 0.9 * twenty and ten * ten / (twenty - ten) <= same))
        return word if settled else 0
    return 0


@compiled
def _peaks(steps: Steps, problem: Problem, mode: int, x: Real, table: Real, torque: Real,
           upto: float, record: Record) -> None:
    """Extremes of the coordinates over a step, up to a fraction of it."""
    stages = torque.size
    states, rates = np.zeros((stages + 1, SIZE)), np.zeros(stages + 1)
    rate_line, line = np.zeros(stages + 1), np.zeros(stages + 1)
    states[0] = x
    for i in range(stages):
        for k in range(SIZE):
            states[i + 1, k] = _times(table[i, k], x, torque)
    for coordinate in range(4):
        rates[:] = 0.0
        for k in range(SIZE):
            rates += problem.matrices[mode, coordinate, k] * states[:, k]
        _coefficients(steps, rates, rate_line)
        _coefficients(steps, states[:, coordinate], line)
        record.highest[coordinate] = max(record.highest[coordinate], x[coordinate])
        record.lowest[coordinate] = min(record.lowest[coordinate], x[coordinate])
        low = 0.0
        for i in range(stages):
            high = min(steps.nodes[i], upto)
            if high <= low:
                break
            if _value(rate_line, low) * _value(rate_line, high) < 0.0:
                peak = _value(line, _root(rate_line, low, high))
                record.highest[coordinate] = max(record.highest[coordinate], peak)
                record.lowest[coordinate] = min(record.lowest[coordinate], peak)
            low = high


@compiled
def _error(steps: Steps, problem: Problem, mode: int, level: int, x: Real, torque: Real,
           scale: Real, error: Real) -> float:
    """Estimated error of a step, relative to ``scale``, the largest over the variables."""
    slope = 2.0 * problem.quadratic * abs(x[DAMPER_RATE])
    filtered = steps.filtered[mode, level]
    table = steps.error[mode, level]
    for k in range(FRICTION):
        error[k] = _times(table[k], x, torque) + filtered[k] * 0.5 * slope * x[DAMPER_RATE]
    feedback = slope * error[DAMPER_RATE] / (1.0 - slope * filtered[DAMPER_RATE])
    largest = 0.0
    for k in range(FRICTION):
        largest = max(largest, abs(error[k] + feedback * filtered[k]) / scale[k])
    return largest if np.isfinite(largest) else np.inf


@compiled
def _event(steps: Steps, problem: Problem, mode: int, level: int, direction: float, x: Real,
           torque: Real, size: float, values: Real, into: Real) -> float:
    """Fraction of the step at which the swivel comes to rest, or is released; 2 if in none."""
    watched = steps.watched[mode, level]
    for i in range(torque.size):
        values[i + 1] = _times(watched[i], x, torque)
    if mode == MOVING:
        values[0] = x[SWIVEL_RATE]
        for i in range(values.size):
            values[i] *= direction
        return _crossing(steps, values, _BEYOND * size, into)
    values[0] = np.sum(problem.holding * x)
    first = 2.0
    for _ in range(2):
        # The reserve of the friction in one direction, then in the other.
        for i in range(values.size):
            values[i] = problem.friction - values[i]
        first = min(first, _crossing(steps, values, _BEYOND * problem.friction, into))
        for i in range(values.size):
            values[i] -= problem.friction
    return first


@compiled
def _go(steps: Steps, mode: int, level: int, fraction: float, x: Real, torque: Real,
        values: Real, into: Real, result: Real) -> None:
    """State after a ``fraction`` of the step, of 1 if it is larger, into ``result`` (9,)."""
    table = steps.stages[mode, level]
    last = torque.size - 1
    for k in range(SIZE):
        for i in range(last if fraction >= 1.0 else 0, last + 1):
            values[i + 1] = _times(table[i, k], x, torque)
        if fraction < 1.0:
            values[0] = x[k]
            _coefficients(steps, values, into)
            result[k] = _value(into, fraction)
        else:
            result[k] = values[last + 1]


@compiled
def run(steps: Steps, problem: Problem, accuracy: Accuracy, goal: int, record: Record) -> int:
    """Integrate on from ``record`` until a motion's fate is known, or ``goal`` sections are passed.

    A section is where the swivel's rate falls to zero for the first time after an upward passage of
    the swivel through zero. With ``goal`` 0 sections are compared, else they are counted. Returns
    SETTLED, RESTS, GROWS, OUT_OF_TIME, FAILED or COUNTED.
    """
    stages = steps.nodes.size
    x, clock = record.state, record.clock
    mode, direction = int(clock[Clock.MODE]), clock[Clock.DIRECTION]
    torque, rate, work = np.zeros(stages), np.zeros(stages), np.zeros((stages, stages + 2))
    values, into = np.zeros(stages + 1), np.zeros(stages + 1)
    error, following, recent, scale = np.zeros(SIZE), np.zeros(SIZE), np.abs(x), np.ones(SIZE)
    exponent = 1.0 / (stages + 1.0)
    energy, kinetic, peak = 0.0, 0.0, 0.0
    below, armed, blind, stalled = False, False, False, 0
    begun = np.sum(problem.weights * x * x)
    level, taken, passed, status = _FIRST_LEVEL, 0, 0, End.OUT_OF_TIME
    while taken < accuracy.steps:
        taken += 1
        if level >= LEVELS:
            status = End.FAILED
            break
        if not _torques(steps.stages[mode, level], x, problem.quadratic, torque, work, rate):
            level += 2
            continue
        now = np.sum(problem.weights * x * x)
        energy = max(now, energy)
        for k in range(FRICTION):
            scale[k] = max(recent[k], abs(x[k]), np.sqrt(_SHARE * energy / problem.weights[k]))
        size = _error(steps, problem, mode, level, x, torque, scale, error)
        if size > accuracy.step:
            needed = np.log2(min(size / accuracy.step, 1e12)) * exponent
            level += max(1, int(np.ceil(2.0 * needed + 0.3)))
            continue
        fraction = 2.0
        if not blind:
            fraction = _event(steps, problem, mode, level, direction, x, torque,
                              scale[SWIVEL_RATE], values, into)
        if 0.0 < fraction <= 1.0 and size > accuracy.event:
            # Go closer, until the polynomial is as good there as a step.
            nearer = max(0.98 * fraction, 0.9 * (accuracy.event / size) ** exponent)
            level += max(1, int(np.ceil(-2.0 * np.log2(nearer))))
            continue
        duration = min(fraction, 1.0) * steps.lengths[level]
        if goal > 0:
            _peaks(steps, problem, mode, x, steps.stages[mode, level], torque, min(fraction, 1.0),
                   record)
        _go(steps, mode, level, fraction, x, torque, values, into, following)
        clock[Clock.TIME] += duration
        if mode == HELD:
            clock[Clock.HELD_TIME] += duration
            following[SWIVEL_RATE] = 0.0
        fade = np.exp(-duration / _MEMORY)
        moving = 0.0
        for k in range(SIZE):
            recent[k] = max(recent[k] * fade, abs(following[k]))
            x[k] = following[k]
            if TILT_RATE <= k <= DAMPER_RATE:
                moving += problem.weights[k] * x[k] * x[k]
        energy, kinetic = energy * fade**2, max(kinetic * fade**2, moving)
        blind = False
        peak = max(peak, abs(x[SWIVEL]))
        armed = armed or (below and not x[SWIVEL] < 0.0)
        below = bool(x[SWIVEL] < 0.0)
        if max(abs(x[TILT]), abs(x[SWIVEL]), abs(x[DAMPER])) > _LIMIT:
            status = End.GROWS
            break
        if goal == 0 and (kinetic < (_CREEP if problem.free_is_stable else _STILL) * energy
                          or (problem.friction == 0.0 and now < 1e-16 * begun)
                          or (mode == HELD and fraction > 1.0 and _rests(x, problem))):
            # It rests, or creeps ever more slowly to where the friction can just hold it.
            status = End.RESTS
            break
        if fraction > 1.0:
            room = (accuracy.step / max(size, 1e-30)) ** exponent
            level = max(0, level - max(-1, min(4, int(np.floor(2.0 * np.log2(0.9 * room))))))
            stalled = 0
            continue

        clock[Clock.EVENTS] += 1.0
        stalled = stalled + 1 if duration < 1e-13 else 0
        x[SWIVEL_RATE] = 0.0
        load = np.sum(problem.holding * x)
        falls = mode == MOVING and direction > 0.0
        holds = mode == MOVING and (
            abs(load) <= problem.friction or (load > 0.0) == (direction > 0.0))
        if holds or stalled > 8:
            # If it can't be held, that is rounding, and it is for a step.
            blind = stalled > 8 or bool(abs(load) > problem.friction)
            mode, x[FRICTION], stalled = HELD, 0.0, 0 if stalled > 8 else stalled
        else:
            direction = 1.0 if load > 0.0 else -1.0
            mode, x[FRICTION] = MOVING, direction * problem.friction
        if mode == HELD and goal == 0 and _rests(x, problem):
            status = End.RESTS
            break
        if not (falls and armed):
            continue
        armed = False
        record.section_states[passed % SECTIONS] = x
        record.section_peaks[passed] = peak
        peak = 0.0
        passed += 1
        if passed == goal:
            status = End.COUNTED
            break
        if goal == 0:
            clock[Clock.PERIOD] = _period(record, passed, scale, accuracy.same)
            if clock[Clock.PERIOD] > 0.0:
                status = End.SETTLED
                break
        if passed >= accuracy.sections:
            break
    clock[Clock.MODE], clock[Clock.DIRECTION] = mode, direction
    clock[Clock.STEPS], clock[Clock.PASSED] = clock[Clock.STEPS] + taken, passed
    return status
