"""The recurrence of a motion's power series, and of its derivatives', as a compiled loop."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, TypeVar, cast

import numba
import numpy as np
from numpy.typing import NDArray

Real = NDArray[np.float64]
Function = TypeVar("Function", bound=Callable[..., Any])


def _compiled(function: Function) -> Function:
    """``function`` compiled at its first call, from a cache on disk after that."""
    compiler: Any = numba.njit(cache=True, nogil=True, error_model="numpy")
    return cast(Function, compiler(function))


@_compiled
def extend(series: Real, matrix: Real, constant: Real, velocities: NDArray[np.int64],
           weights: Real, rate_matrix: Real, rate_constant: Real, has_rate: bool) -> None:
    """Fill in ``series`` (p + 1, r, 2n + m) from its first 2n columns at order 0.

    The rows are the state x, with x' = (x, w) matrix + constant and w_i = weight_i v_i^2 of the
    ``velocities`` v_i, then its derivatives, and, where ``has_rate``, as the last one that by the
    parameter, in which matrix and constant change at the rates given.
    """
    count, rows, width = series.shape
    size = matrix.shape[1]
    for order in range(count - 1):
        for number in range(velocities.shape[0]):
            velocity, weight = velocities[number], weights[number]
            for row in range(rows):
                # Cauchy's product of the velocity with itself, and with its derivatives.
                total = 0.0
                if weight != 0.0:
                    for k in range(order + 1):
                        total += series[k, 0, velocity] * series[order - k, row, velocity]
                series[order, row, size + number] = weight * (total if row == 0 else 2.0 * total)
        for row in range(rows):
            for column in range(size):
                total = constant[column] if order == 0 and row == 0 else 0.0
                for item in range(width):
                    total += series[order, row, item] * matrix[item, column]
                if has_rate and row == rows - 1:
                    if order == 0:
                        total += rate_constant[column]
                    for item in range(width):
                        total += series[order, 0, item] * rate_matrix[item, column]
                series[order + 1, row, column] = total / (order + 1)
    series[count - 1, :, size:] = 0.0
