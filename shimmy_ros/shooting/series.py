"""The power series of a motion and of its derivatives, as compiled loops.

``series`` (p + 9, 2n + m, r) holds the coefficients up to order p by powers of time, and eight
rows for the loops to read beyond. Column 0 is the motion: the state x = (q, q'), and the m squares
w of velocities that act on it. The others are derivatives of x and w by what the motion depends
on, the parameter last. A step begins with its first row.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..compiling import compiled

Real = NDArray[np.float64]

ORDER = 30
_BLOCK = 8
ROWS = ORDER + 1 + _BLOCK
# Components below count as zero.
_TINY = 1e-200


class Field(NamedTuple):
    """q'' = matrix (x, w) + constant, with w_i = weight_i v_i^2 of the ``velocities`` v_i.

    Row d of the matrix has ``factors[d]`` at ``items[d]``, the first ``numbers[d]`` of them; four
    zeros follow. Where ``has_rate``, matrix and constant change with the parameter at the rates
    given.
    """

    items: NDArray[np.int64]
    factors: Real
    numbers: NDArray[np.int64]
    constant: Real
    velocities: NDArray[np.int64]
    weights: Real
    rate_matrix: Real
    rate_constant: Real
    has_rate: bool


@compiled
def _squares(series: Real, k: int, target: int, velocity: int, backwards: Real) -> None:
    """Row ``target`` of the terms k: the product of series by those of the ``velocity``.

    ``backwards`` holds the factors of terms 0, 1, ..., k, and zeros.
    """
    for j in range(0, k + 1, _BLOCK):
        a, b, c, d = backwards[j], backwards[j + 1], backwards[j + 2], backwards[j + 3]
        e, f, g, h = backwards[j + 4], backwards[j + 5], backwards[j + 6], backwards[j + 7]
        for row in range(series.shape[2]):
            before = series[k, target, row] if j > 0 else 0.0
            series[k, target, row] = (
                before + a * series[j, velocity, row] + b * series[j + 1, velocity, row]
                + c * series[j + 2, velocity, row] + d * series[j + 3, velocity, row]
                + e * series[j + 4, velocity, row] + f * series[j + 5, velocity, row]
                + g * series[j + 6, velocity, row] + h * series[j + 7, velocity, row])


@compiled
def field_of(matrix: Real, constant: Real, velocities: NDArray[np.int64], weights: Real,
             rate_matrix: Real, rate_constant: Real, has_rate: bool) -> Field:
    """The field q'' = matrix (x, w) + constant; see there."""
    dofs, width = matrix.shape
    items, factors = np.zeros((dofs, width + 4), np.int64), np.zeros((dofs, width + 4))
    numbers = np.zeros(dofs, np.int64)
    for dof in range(dofs):
        for item in range(width):
            if matrix[dof, item] != 0.0:
                items[dof, numbers[dof]] = item
                factors[dof, numbers[dof]] = matrix[dof, item]
                numbers[dof] += 1
    return Field(items, factors, numbers, constant, velocities, weights, rate_matrix,
                 rate_constant, has_rate)


@compiled
def extend(series: Real, unit: float, field: Field) -> None:
    """Fills in the ``series`` after its first row, for times in terms of ``unit``.

    Squares w whose weight is zero it leaves as they are: they have to be zero.
    """
    items, factors, numbers = field.items, field.factors, field.numbers
    constant, velocities, weights = field.constant, field.velocities, field.weights
    rate_matrix, rate_constant, has_rate = field.rate_matrix, field.rate_constant, field.has_rate
    width, count = series.shape[1], series.shape[2]
    dofs, active = items.shape[0], velocities.shape[0]
    size, half = 2 * dofs, dofs * count
    flat = series.reshape((series.shape[0], width * count))
    # The coefficients of the active velocities, the last first, and zeros.
    backwards = np.zeros((active, ROWS + _BLOCK))
    for k in range(ORDER):
        factor = unit / (k + 1)
        for number in range(active):
            if weights[number] != 0.0:
                # Cauchy's product of the velocity with itself, and with its derivatives.
                velocity, square = velocities[number], size + number
                backwards[number, ORDER - k] = 2.0 * weights[number] * series[k, velocity, 0]
                _squares(series, k, square, velocity, backwards[number, ORDER - k:])
                series[k, square, 0] *= 0.5
        for item in range(half):
            flat[k + 1, item] = factor * flat[k, half + item]
        for dof in range(dofs):
            target = dofs + dof
            # Several items at once, since a loop along a row is too short to be worth its start.
            for at in range(0, max(numbers[dof], 1), 4):
                a, b = factor * factors[dof, at], factor * factors[dof, at + 1]
                c, d = factor * factors[dof, at + 2], factor * factors[dof, at + 3]
                e, f, g, h = (items[dof, at], items[dof, at + 1], items[dof, at + 2],
                              items[dof, at + 3])
                for row in range(count):
                    before = series[k + 1, target, row] if at > 0 else 0.0
                    series[k + 1, target, row] = (
                        before + a * series[k, e, row] + b * series[k, f, row]
                        + c * series[k, g, row] + d * series[k, h, row])
            if has_rate:
                for item in range(width):
                    series[k + 1, target, count - 1] += (
                        factor * rate_matrix[dof, item] * series[k, item, 0])
            if k == 0:
                series[1, target, 0] += unit * constant[dof]
                if has_rate:
                    series[1, target, count - 1] += unit * rate_constant[dof]


@compiled
def step_length(series: Real, largest: Real, tolerance: float, derivative_tolerance: float,
                growth: float, settled: float) -> float:
    """How far in time the last two terms of ``series`` are negligible, or NaN where it overflows.

    They stay below ``tolerance``, or ``derivative_tolerance``, of the largest value that the
    component has had, ``largest`` (2n, r), and has in any term. The result is at most ``growth``
    and settled to within ``settled``.
    """
    size, count = largest.shape
    items = size * count
    terms = series.reshape((series.shape[0], series.shape[1] * count))
    before = largest.reshape(items)
    biggest, total = np.empty(items), np.zeros(items)
    length = 1.0
    while True:
        for item in range(items):
            biggest[item] = before[item] if before[item] >= _TINY else _TINY
        power = 1.0
        # Several terms at once, since every pass through the arrays takes time.
        for k in range(0, ORDER + 1, 4):
            second, third, fourth = power * length, power * length**2, power * length**3
            for item in range(items):
                a, b = abs(terms[k, item]), abs(terms[k + 1, item])
                c, d = abs(terms[k + 2, item]), abs(terms[k + 3, item])
                total[item] += (a + b) + (c + d)
                a, b, c, d = a * power, b * second, c * third, d * fourth
                a, c = a if a >= b else b, c if c >= d else d
                a = a if a >= c else c
                biggest[item] = biggest[item] if biggest[item] >= a else a
            power = fourth * length
        for item in range(items):
            if not total[item] < np.inf:
                return np.nan
            biggest[item] = 1.0 / (biggest[item] * derivative_tolerance)
        for component in range(size):
            biggest[component * count] *= derivative_tolerance / tolerance
        reached = growth
        for last in range(ORDER - 1, ORDER + 1):
            excess = 0.0
            for item in range(items):
                excess = max(excess, abs(terms[last, item]) * biggest[item])
            if excess > 0.0:
                reached = min(reached, excess ** (-1.0 / last))
        if not reached < settled * length:
            return reached
        # The terms of a step too long by far exaggerate the size of the motion.
        length = reached


@compiled
def end_step(series: Real, length: float, rows: Real, largest: Real) -> None:
    """Puts the end of a step into ``rows`` (2n, r); raises ``largest`` to their size."""
    size, count = rows.shape
    items = size * count
    terms = series.reshape((series.shape[0], series.shape[1] * count))
    values, bounds = rows.reshape(items), largest.reshape(items)
    for item in range(items):
        values[item] = 0.0
    for k in range(ORDER // 4 * 4, -1, -4):
        for item in range(items):
            value = (values[item] * length + terms[k + 3, item]) * length + terms[k + 2, item]
            values[item] = (value * length + terms[k + 1, item]) * length + terms[k, item]
    for item in range(items):
        bounds[item] = max(bounds[item], abs(values[item]))


@compiled
def keeps_sign(series: Real, column: int, length: float, sign: int) -> bool:
    """Whether a component of the motion has ``sign``, and its first term outweighs all others."""
    rest, power = 0.0, 1.0
    for k in range(1, ORDER + 1):
        power *= length
        rest += abs(series[k, column, 0]) * power
    outweighs: bool = sign * series[0, column, 0] > rest
    return outweighs


@compiled
def values_at(series: Real, numbers: NDArray[np.int64], places: Real) -> Real:
    """The values (2n, k) of k polynomials of the ``series`` (pieces, p + 1, 2n) at k places."""
    size = series.shape[2]
    values = np.empty((size, numbers.shape[0]))
    for index in range(numbers.shape[0]):
        terms, place = series[numbers[index]], places[index]
        for component in range(size):
            total = 0.0
            for k in range(terms.shape[0] - 1, -1, -1):
                total = total * place + terms[k, component]
            values[component, index] = total
    return values
