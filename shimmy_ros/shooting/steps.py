"""The steps of a motion, from event to event, as one compiled loop.

Numba's cache does not notice that one of the functions called here has changed in another file:
whoever changes them deletes __pycache__.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from ..compiling import compiled
from .modes import Modes, Real, Signs, derivative, holding, mode_number, signs_at
from .polynomial import first_descent
from .series import ORDER, ROWS, end_step, extend, field_of, keeps_sign, step_length

DONE, GROWS, TOO_LONG = 0, 1, 2

_TOLERANCE = 1e-16
_DERIVATIVE_TOLERANCE = 1e-12
# A step grows at most so much; its length is settled to within so much.
_GROWTH = 8.0
_SETTLED = 0.9
_FIRST_CAPACITY = 128


class Rates(NamedTuple):
    """The modes at parameters ``width`` apart, on either side of the one that moves.

    ``asked`` tells whether the derivative by the parameter is wanted; ``width`` is 1 if not.
    """

    below: Modes
    above: Modes
    width: float
    asked: bool


class Pieces(NamedTuple):
    """x(start + u s) = sum_k series[k] s^k for 0 <= s <= length / u, u being the unit [s], for k
    pieces one after the other.

    ``starts``, ``lengths`` and ``units`` have shape (k,), ``signs``, the modes, (k, m) and
    ``series`` (k, p + 1, 2n).
    """

    starts: Real
    lengths: Real
    units: Real
    signs: Signs
    series: Real


@compiled
def _room(count: int, active: int, terms: int, size: int) -> Pieces:
    """Room for ``count`` pieces."""
    return Pieces(np.empty(count), np.empty(count), np.empty(count),
                  np.empty((count, active), np.int64), np.empty((count, terms, size)))


@compiled
def _larger(pieces: Pieces) -> Pieces:
    """The same with room for twice as many."""
    count, terms, size = pieces.series.shape
    active = pieces.signs.shape[1]
    larger = _room(2 * count, active, terms, size)
    for piece in range(count):
        larger.starts[piece], larger.lengths[piece] = pieces.starts[piece], pieces.lengths[piece]
        larger.units[piece] = pieces.units[piece]
        for index in range(active):
            larger.signs[piece, index] = pieces.signs[piece, index]
        for k in range(terms):
            for component in range(size):
                larger.series[piece, k, component] = pieces.series[piece, k, component]
    return larger


@compiled
def _until(pieces: Pieces, count: int) -> Pieces:
    """The first ``count`` pieces."""
    return Pieces(pieces.starts[:count], pieces.lengths[:count], pieces.units[:count],
                  pieces.signs[:count], pieces.series[:count])


@compiled
def _event(modes: Modes, series: Real, signs: Signs, length: float, contact: Signs
           ) -> tuple[float, int]:
    """The first event within ``length``, as a share of it, and the active coordinate concerned.

    That stops or is released; without an event the share is infinite.
    """
    place, number = np.inf, 0
    margin = np.empty(ORDER + 1)
    for index, sign in enumerate(signs):
        found = np.inf
        if sign != 0:
            velocity = modes.velocities[index]
            if contact[index] == 0 and keeps_sign(series, velocity, length, sign):
                continue
            power = float(sign)
            for k in range(ORDER + 1):
                margin[k] = power * series[k, velocity, 0] if k >= contact[index] else 0.0
                power *= length
            found = first_descent(margin)
        else:
            mode = mode_number(modes, signs)
            for side in (-1.0, 1.0):
                power = side
                for k in range(ORDER + 1):
                    force = 0.0
                    for item in range(series.shape[1]):
                        force += series[k, item, 0] * modes.hold[mode, index, item]
                    margin[k] = power * force
                    power *= length
                margin[0] += side * modes.hold_constant[mode, index] + modes.friction[index]
                found = min(found, first_descent(margin))
        if found < place:
            place, number = found, index
    return place, number


@compiled
def _switch(modes: Modes, rows: Real, signs: Signs, number: int) -> tuple[Signs, int]:
    """The mode after active coordinate ``number`` stopped or was released; changes ``rows``.

    Also how many terms of its velocity vanish.
    """
    state = rows[:, 0].copy()
    if signs[number] == 0:
        after = signs.copy()
        after[number] = 1 if holding(modes, signs, state)[number] > 0.0 else -1
        return after, 2
    velocity = modes.velocities[number]
    rows[velocity, 0] = state[velocity] = 0.0
    after = signs_at(modes, state, signs)
    field = derivative(modes, signs, state)
    if field[velocity] != 0.0:
        following = derivative(modes, after, state)
        for column in range(1, rows.shape[1]):
            share = rows[velocity, column] / field[velocity]
            for component in range(rows.shape[0]):
                rows[component, column] += share * (following[component] - field[component])
    for index, sign in enumerate(after):
        if sign == 0:
            for column in range(rows.shape[1]):
                rows[modes.velocities[index], column] = 0.0
    return after, 1


@compiled
def run(modes: Modes, rates: Rates, rows: Real, signs: Signs, duration: float, most_steps: int
        ) -> tuple[int, float, int, Pieces]:
    """The motion from ``rows`` (2n, r) over ``duration``, which it changes into those at the end.

    They hold the state, its derivative by every component of the initial state, and that by the
    parameter, as far as they are asked for. The result is DONE, GROWS or TOO_LONG, the time [s]
    that was reached, the number of steps, and the pieces.
    """
    (size, columns), active = rows.shape, signs.shape[0]
    dofs, width = modes.force.shape
    by_matrix, by_constant = np.zeros((dofs, width)), np.zeros(dofs)
    series = np.zeros((ROWS, width, columns))
    largest = np.abs(rows)
    # How many terms of its velocity vanish, by the event just passed, in a coordinate.
    contact = np.zeros(active, np.int64)
    pieces = _room(_FIRST_CAPACITY, active, ORDER + 1, size)
    count, time, unit, changed = 0, 0.0, 0.0, True
    step = 0
    while time < duration:
        if step == most_steps:
            return TOO_LONG, time, step, _until(pieces, count)
        if changed:
            mode = mode_number(modes, signs)
            weights = np.zeros(active)
            for index in range(active):
                # Drag that is zero here may still change with the parameter.
                if modes.drag[index] != 0.0 or rates.asked:
                    weights[index] = signs[index]
            if rates.asked:
                low, high = mode_number(rates.below, signs), mode_number(rates.above, signs)
                for dof in range(dofs):
                    change = rates.above.constant[high, dof] - rates.below.constant[low, dof]
                    by_constant[dof] = change / rates.width
                    for item in range(width):
                        change = rates.above.matrix[high, dof, item]
                        change -= rates.below.matrix[low, dof, item]
                        by_matrix[dof, item] = change / rates.width
            field = field_of(modes.matrix[mode], modes.constant[mode], modes.velocities, weights,
                             by_matrix, by_constant, rates.asked)
            for k in range(ROWS):
                for item in range(size, width):
                    for column in range(columns):
                        series[k, item, column] = 0.0
            changed = False
        if step == 0:
            fastest = 1.0
            for dof in range(dofs):
                for item in range(size):
                    fastest = max(fastest, abs(modes.matrix[mode, dof, item]))
            unit = 1.0 / fastest
        unit = min(unit, duration - time)
        for component in range(size):
            for column in range(columns):
                series[0, component, column] = rows[component, column]
        extend(series, unit, field)
        natural = step_length(series, largest, _TOLERANCE, _DERIVATIVE_TOLERANCE, _GROWTH, _SETTLED)
        if not time + natural * unit > time:
            return GROWS, time, step + 1, _until(pieces, count)
        length = min(natural, (duration - time) / unit)
        place, number = _event(modes, series, signs, length, contact)
        happens = place <= 1.0
        if happens:
            length *= place
        if length > 0.0:
            end_step(series, length, rows, largest)
            if count == pieces.starts.shape[0]:
                pieces = _larger(pieces)
            pieces.starts[count], pieces.lengths[count] = time, length * unit
            pieces.units[count] = unit
            for index in range(active):
                pieces.signs[count, index] = signs[index]
            for k in range(ORDER + 1):
                for component in range(size):
                    pieces.series[count, k, component] = series[k, component, 0]
            count += 1
        passed = contact[number] if length == 0.0 and happens else 0
        if length > 0.0:
            for index in range(active):
                contact[index] = 0
        if happens:
            # Without progress the sign of the next term has come from rounding: pass over it.
            signs, vanishing = _switch(modes, rows, signs, number)
            contact[number] = max(vanishing, passed + 1)
            changed = True
        time = time + length * unit if happens or length == natural else duration
        unit *= natural
        step += 1
    return DONE, time, step, _until(pieces, count)
