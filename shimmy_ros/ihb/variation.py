"""The half-period map of a cycle's variational equation, as compiled loops.

In tau = omega t, coordinates scaled by their amplitudes, the variational equation is
x'' + C x' + K x + B f = 0 with constant C, K and the forces f = D(tau) x' + S(tau) x of the
elements, on the few coordinates that they act on. A step of Radau's method IIA of three stages,
of order five and L-stable, is then one linear map for every width, and its correction by the
elements a small system of equations. Steps are halved until one agrees with two of half the width;
no step straddles a zero of a velocity on which friction or a damper acts, where |v| has a kink.
"""

from __future__ import annotations

import numpy as np

from ..compiling import compiled
from .loops import Complex, Index, Real, add_product, crossings, eliminate_all, series

COMPLETE, TOO_MANY_STEPS, OVERFLOWED, AT_REST, STICKING = 0, 1, 2, 3, 4

_ROOT = np.sqrt(6.0)
_STAGES = np.array([
    [(88.0 - 7.0 * _ROOT) / 360.0, (296.0 - 169.0 * _ROOT) / 1800.0, (-2.0 + 3.0 * _ROOT) / 225.0],
    [(296.0 + 169.0 * _ROOT) / 1800.0, (88.0 + 7.0 * _ROOT) / 360.0, (-2.0 - 3.0 * _ROOT) / 225.0],
    [(16.0 - _ROOT) / 36.0, (16.0 + _ROOT) / 36.0, 1.0 / 9.0]])
_SQUARED = _STAGES @ _STAGES
_NODES = np.array([(4.0 - _ROOT) / 10.0, (4.0 + _ROOT) / 10.0, 1.0])
_LEVELS = 40


@compiled
def step_maps(damping: Real, stiffness: Real, inputs: Real, varying: Index, width: float,
              free: Real, forced: Real) -> None:
    """What a step of a ``width`` does, into ``free`` and ``forced``.

    From the state (2n,) and from the elements' forces (3m,) at the three stages: the state after
    the step, and of the ``varying`` coordinates the rates at the stages (3m,) and, if there is
    room for as many more rows, the places.
    """
    count, chosen = damping.shape[0], varying.shape[0]
    matrix = np.empty((3 * count, 3 * count))
    right = np.zeros((3 * count, 2 * count + 3 * chosen))
    for a in range(3):
        for i in range(count):
            row = a * count + i
            for b in range(3):
                for j in range(count):
                    matrix[row, b * count + j] = (
                        width * _STAGES[a, b] * damping[i, j]
                        + width * width * _SQUARED[a, b] * stiffness[i, j])
            matrix[row, row] += 1.0
            for j in range(count):
                right[row, j] = -stiffness[i, j]
                right[row, count + j] = -damping[i, j] - _NODES[a] * width * stiffness[i, j]
            for j in range(chosen):
                right[row, 2 * count + a * chosen + j] = -inputs[i, j]
    eliminate_all(matrix, right)
    both = np.zeros((free.shape[0], right.shape[1]))
    first_place = 2 * count + 3 * chosen
    for a in range(3):
        for k in range(chosen + count):
            # The last stage is the end of the step, where every coordinate is needed.
            if k < chosen:
                i = varying[k]
                rate, place = 2 * count + a * chosen + k, first_place + a * chosen + k
            elif a == 2:
                i = k - chosen
                place, rate = i, count + i
            else:
                break
            for b in range(3):
                factor = width * _STAGES[a, b]
                for j in range(right.shape[1]):
                    both[rate, j] += factor * right[b * count + i, j]
            both[rate, count + i] += 1.0
            if place >= free.shape[0]:
                continue
            for b in range(3):
                factor = width * width * _SQUARED[a, b]
                for j in range(right.shape[1]):
                    both[place, j] += factor * right[b * count + i, j]
            both[place, i] += 1.0
            both[place, count + i] += _NODES[a] * width
    free[:] = both[:, :2 * count]
    forced[:] = both[:, 2 * count:]


@compiled
def apply_step(free: Real, forced: Real, damping: Real, stiffness: Real, state: Real,
               result: Real, matrix: Real, forces: Real) -> None:
    """Carry ``state`` (2n, columns) over a step; the elements' rates (3, m, m) at its stages.

    The last three arguments are room to work in: as many rows as ``free`` has, (3m, 3m), and
    (3m, columns).
    """
    chosen = damping.shape[1]
    size, columns = state.shape
    stages = 3 * chosen
    by_places = free.shape[0] > size + stages
    result[:] = 0.0
    add_product(free, state, 1.0, result)
    matrix[:] = 0.0
    forces[:] = 0.0
    for a in range(3):
        for i in range(chosen):
            row = a * chosen + i
            matrix[row, row] = 1.0
            for j in range(chosen):
                factor, place = damping[a, i, j], size + a * chosen + j
                for _ in range(2 if by_places else 1):
                    for c in range(stages):
                        matrix[row, c] -= factor * forced[place, c]
                    for c in range(columns):
                        forces[row, c] += factor * result[place, c]
                    factor, place = stiffness[a, i, j], place + stages
    eliminate_all(matrix, forces)
    state[:] = result[:size]
    add_product(forced[:size], forces, 1.0, state)


@compiled
def sample(coefficients: Real, varying: Index, rate: Complex, tau: float, damping: Real,
           stiffness: Real) -> None:
    """The elements' derivatives by rates and places at ``tau``, into (m, m) each.

    By d|v|v/dv = 2 |v|; those of general elements cannot be compiled, and come in their place.
    """
    stiffness[:] = 0.0
    damping[:] = 0.0
    for j in range(varying.shape[0]):
        value, _ = series(rate[varying[j]], np.exp(1j * tau))
        damping[j, j] = 2.0 * coefficients[varying[j]] * abs(value)


@compiled
def general_forces(tau: float, forces: Real) -> None:
    """Those of general elements are added in its place to ``forces`` (n,)."""


@compiled
def reversal(inverse: Real, damping: Real, stiffness: Real, torques: Real, coefficients: Real,
             place: Complex, rate: Complex, dof: int, tau: float, forces: Real, state: Real
             ) -> bool:
    """Multiply ``state`` by the saltation matrix of a reversal; False where friction would hold.

    From the equations of motion at the cycle's state, ``forces`` (n,) being what general elements
    add to them.
    """
    count = inverse.shape[0]
    turn = np.exp(1j * tau)
    where = np.empty(count)
    speed = np.empty(count)
    for i in range(count):
        where[i], _ = series(place[i], turn)
        speed[i], _ = series(rate[i], turn)
    # Whether the velocity falls or rises through zero, from the series itself.
    earlier, _ = series(rate[dof], np.exp(1j * (tau - 1e-5)))
    before = 1.0 if earlier > 0.0 else -1.0
    free = 0.0
    for i in range(count):
        force = -forces[i]
        for j in range(count):
            force -= damping[i, j] * speed[j] + stiffness[i, j] * where[j]
        if i != dof:
            force -= torques[i] * np.sign(speed[i])
            force -= coefficients[i] * abs(speed[i]) * speed[i]
        free += inverse[dof, i] * force
    jump = inverse[dof, dof] * torques[dof]
    incoming, outgoing = free - before * jump, free + before * jump
    if not (incoming * before < 0.0 and outgoing * before < 0.0):
        return False
    for column in range(state.shape[1]):
        crossing = 2.0 * before * torques[dof] / incoming * state[count + dof, column]
        for i in range(count):
            state[count + i, column] += inverse[i, dof] * crossing
    return True


@compiled
def kinks(torques: Real, coefficients: Real, rows: Real, begin: float, times: Real,
          turning: Index) -> int:
    """Zeros in [begin, begin + pi) of the velocities on which friction or a damper acts, ascending.

    Into ``times`` and, which coordinate it is, ``turning``; their number, or -1 for a friction on
    a coordinate at rest.
    """
    number = 0
    tau = np.empty(rows.shape[1] + 2)
    for dof in range(rows.shape[0]):
        if torques[dof] == 0.0 and coefficients[dof] == 0.0:
            continue
        _, found, _ = crossings(rows[dof], tau)
        if found == 0 and torques[dof] != 0.0:
            return -1
        for v in range(found):
            time = begin + (tau[v] - begin) % np.pi
            at = number
            while at > 0 and times[at - 1] > time:
                times[at], turning[at] = times[at - 1], turning[at - 1]
                at -= 1
            times[at], turning[at] = time, dof
            number += 1
    return number


@compiled
def half_map(
    inverse: Real, damping: Real, stiffness: Real, torques: Real, coefficients: Real,
    varying: Index, rows: Real, frequency: float, sizes: Real,
    begin: float, from_kink: bool, with_places: bool, growth: float,
    fewest: int, most: int, tolerance: float,
) -> tuple[Real, int, int]:
    """Two approximations (2, 2n, 2n) of the map over half a period.

    The first is by steps of half the width of the second's: how far they are apart is an estimate
    of the error. The map is that of (q / sizes, dq/dtau / sizes) from ``begin``, or from the first
    kink after it if ``from_kink``: a smooth stretch is cut in two otherwise. ``inverse`` is the
    mass matrix's; strengths are one a coordinate (n,). No step is longer than 1 / ``growth``, nor
    than what negative damping on a coordinate asks for: a mode that grows many times faster than a
    step can tell would be damped by it. Also how many steps it took and how it
    ended; where the friction would hold, the coordinate instead of the number.
    """
    count, chosen = rows.shape[0], varying.shape[0]
    maps = np.empty((2, 2 * count, 2 * count))
    harmonics = rows.shape[1] // 2
    # tau for time, and every coordinate in its own size.
    place = np.empty((count, harmonics), np.complex128)
    rate = np.empty((count, harmonics), np.complex128)
    for i in range(count):
        for k in range(harmonics):
            x = complex(rows[i, k], -rows[i, harmonics + k])
            place[i, k] = x
            rate[i, k] = (2 * k + 1) * 1j * x
    square = frequency * frequency
    turning_mass = inverse / square
    turning_damping = frequency * damping
    drag = square * coefficients
    by_rate = np.zeros((count, count))
    by_place = np.zeros((count, count))
    add_product(turning_mass, turning_damping, 1.0, by_rate)
    add_product(turning_mass, stiffness, 1.0, by_place)
    inputs = np.empty((count, chosen))
    density = 0.5 * fewest / np.pi
    for i in range(count):
        for j in range(count):
            by_rate[i, j] *= sizes[j] / sizes[i]
            by_place[i, j] *= sizes[j] / sizes[i]
        for j in range(chosen):
            inputs[i, j] = turning_mass[i, varying[j]] * sizes[varying[j]] / sizes[i]
        density = max(density, growth, -by_rate[i, i])
    if not density * np.pi < most:
        return maps, 0, TOO_MANY_STEPS
    salting = np.empty((count, count))
    for i in range(count):
        for j in range(count):
            salting[i, j] = turning_mass[i, j] / sizes[i]

    state = np.zeros((2 * count, 4 * count))
    for i in range(2 * count):
        state[i, i] = state[i, 2 * count + i] = 1.0
    tried = np.empty((2 * count, 4 * count))
    fine = np.empty((2 * count, 2 * count))
    heights = 2 * count + (6 if with_places else 3) * chosen
    result = np.empty((heights, 4 * count))
    half_result = np.empty((heights, 2 * count))
    matrix = np.empty((3 * chosen, 3 * chosen))
    forces = np.empty((3 * chosen, 4 * count))
    half_forces = np.empty((3 * chosen, 2 * count))
    times = np.empty(count * (2 * harmonics + 2) + 1)
    turning = np.empty(times.shape[0], np.int64)
    number = kinks(torques, coefficients, rows, begin, times, turning)
    if number < 0:
        return maps, 0, AT_REST
    if from_kink and number > 0:
        # What happens there comes at the end.
        begin = times[0]
        times[number], turning[number] = begin + np.pi, turning[0]
        times, turning = times[1:], turning[1:]
    others = np.zeros(count)
    free = np.empty((_LEVELS, heights, 2 * count))
    forced = np.empty((_LEVELS, heights, 3 * chosen))
    rates = np.empty((3, chosen, chosen))
    places = np.empty((3, chosen, chosen))
    depth = np.empty(_LEVELS + 1, np.int64)
    steps = 0
    start = begin
    for piece in range(number + 1):
        end = times[piece] if piece < number else begin + np.pi
        if end > start:
            parts = max(1, int(np.ceil(density * (end - start))))
            known = 0
            for part in range(parts):
                now = start + (end - start) * part / parts
                depth[0] = 0
                top = 0
                while top >= 0:
                    level = depth[top]
                    top -= 1
                    width = (end - start) / parts * 0.5**level
                    while known < level + 2:
                        step_maps(by_rate, by_place, inputs, varying,
                                  (end - start) / parts * 0.5**known, free[known], forced[known])
                        known += 1
                    tried[:] = state
                    for a in range(3):
                        sample(drag, varying, rate, now + _NODES[a] * width, rates[a], places[a])
                    apply_step(free[level], forced[level], rates, places, tried,
                               result, matrix, forces)
                    fine[:] = state[:, :2 * count]
                    for half in range(2):
                        for a in range(3):
                            sample(drag, varying, rate, now + (half + _NODES[a]) * 0.5 * width,
                                   rates[a], places[a])
                        apply_step(free[level + 1], forced[level + 1], rates, places, fine,
                                   half_result, matrix, half_forces)
                    steps += 3
                    apart = 0.0
                    largest = 0.0
                    total = 0.0
                    for i in range(2 * count):
                        for j in range(2 * count):
                            total += tried[i, j] - fine[i, j]
                            apart = max(apart, abs(tried[i, j] - fine[i, j]))
                            largest = max(largest, abs(fine[i, j]))
                    finite = np.isfinite(total)
                    if not (finite and apart <= tolerance * largest) and level + 3 <= _LEVELS:
                        depth[top + 1] = depth[top + 2] = level + 1
                        top += 2
                    else:
                        if not finite:
                            return maps, steps, OVERFLOWED
                        now += width
                        state[:, 2 * count:] = tried[:, 2 * count:]
                        state[:, :2 * count] = fine
                    if steps > most:
                        return maps, steps, TOO_MANY_STEPS
            start = end
        if piece < number and torques[turning[piece]] != 0.0:
            others[:] = 0.0
            general_forces(times[piece], others)
            if not reversal(salting, turning_damping, stiffness, torques, drag, place, rate,
                            turning[piece], times[piece], others, state):
                return maps, turning[piece], STICKING
    maps[0] = state[:, :2 * count]
    maps[1] = state[:, 2 * count:]
    return maps, steps, COMPLETE
