"""The power series of a motion and of its derivatives, as compiled loops.

``series`` (p + 1, 2n + m, r) holds the coefficients by powers of time. Column 0 is the motion: the
state x, and the m squares w of velocities that act on it. The others are derivatives of x and w by
what the motion depends on, the parameter last. Before the loops, a column is one row of ``rows``
(r, 2n).
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ..compiling import compiled

Real = NDArray[np.float64]

# Components below count as zero.
_TINY = 1e-200


@compiled
def extended_series(order: int, unit: float, rows: Real, matrix: Real, constant: Real,
                    velocities: NDArray[np.int64], weights: Real, rate_matrix: Real,
                    rate_constant: Real, has_rate: bool) -> Real:
    """The series up to ``order`` that begins with ``rows``, for times in terms of ``unit``.

    x' = (x, w) matrix + constant, with w_i = weight_i v_i^2 of the ``velocities`` v_i. Where
    ``has_rate``, matrix and constant change with the parameter at the rates given.
    """
    count, size = rows.shape
    width = matrix.shape[0]
    series = np.zeros((order + 1, width, count))
    for row in range(count):
        for column in range(size):
            series[0, column, row] = rows[row, column]
    for k in range(order):
        here, following = series[k], series[k + 1]
        for number in range(velocities.shape[0]):
            velocity, weight = velocities[number], weights[number]
            if weight == 0.0:
                continue
            # Cauchy's product of the velocity with itself, and with its derivatives.
            product = here[size + number]
            for j in range(k + 1):
                factor, other = series[j, velocity, 0], series[k - j, velocity]
                for row in range(count):
                    product[row] += factor * other[row]
            product[0] *= weight
            for row in range(1, count):
                product[row] *= 2.0 * weight
        for column in range(size):
            total = following[column]
            for item in range(width):
                factor = unit * matrix[item, column]
                if factor != 0.0:
                    for row in range(count):
                        total[row] += factor * here[item, row]
                if has_rate:
                    total[count - 1] += unit * rate_matrix[item, column] * here[item, 0]
            if k == 0:
                total[0] += unit * constant[column]
                if has_rate:
                    total[count - 1] += unit * rate_constant[column]
            for row in range(count):
                total[row] /= k + 1
    return series


@compiled
def step_length(series: Real, largest: Real, tolerance: float, derivative_tolerance: float,
                growth: float, settled: float) -> float:
    """How far in time the last two terms of ``series`` are negligible, or NaN where it overflows.

    They stay below ``tolerance``, or ``derivative_tolerance``, of the largest value that the
    component has had, ``largest`` (r, 2n), and has in any term. The result is at most ``growth``
    and settled to within ``settled``.
    """
    order = series.shape[0] - 1
    count, size = largest.shape
    length = 1.0
    while True:
        excess = np.zeros(2)
        for column in range(size):
            for row in range(count):
                biggest = max(largest[row, column], _TINY)
                power = 1.0
                for k in range(order + 1):
                    term = abs(series[k, column, row])
                    if not np.isfinite(term):
                        return np.nan
                    biggest = max(biggest, term * power)
                    power *= length
                biggest *= tolerance if row == 0 else derivative_tolerance
                for last in range(2):
                    term = abs(series[order - 1 + last, column, row])
                    excess[last] = max(excess[last], term / biggest)
        reached = growth
        for last in range(2):
            if excess[last] > 0.0:
                reached = min(reached, excess[last] ** (-1.0 / (order - 1 + last)))
        if not reached < settled * length:
            return reached
        # The terms of a step too long by far exaggerate the size of the motion.
        length = reached


@compiled
def rows_after(series: Real, length: float, largest: Real) -> Real:
    """The rows (r, 2n) at the end of a step; raises ``largest`` to their size."""
    count, size = largest.shape
    rows = np.empty((count, size))
    for row in range(count):
        for column in range(size):
            total = 0.0
            for k in range(series.shape[0] - 1, -1, -1):
                total = total * length + series[k, column, row]
            rows[row, column] = total
            largest[row, column] = max(largest[row, column], abs(total))
    return rows


@compiled
def keeps_sign(series: Real, column: int, length: float, sign: int) -> bool:
    """Whether a component of the motion has ``sign``, and its first term outweighs all others."""
    rest, power = 0.0, 1.0
    for k in range(1, series.shape[0]):
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
