"""The balance's arithmetic as compiled loops: zeros, elements, condensation, Newton's method.

A warm-started point is a few thousand multiplications, far less than the overhead of the calls
that would do them array by array. A row is [a_1..a_N, b_1..b_N], in complex form x_k = a_k - i b_k;
a system is its matrices and, for each element, its position among the active coordinates and its
strength. The equations are in ``harmonics``, ``elements`` and ``balance``, which the rest of the
package calls.
"""

from __future__ import annotations

from collections.abc import Callable
from types import FunctionType
from typing import Any, TypeVar, cast

import numpy as np
from numpy.typing import NDArray

from ..compiling import compiled

Real = NDArray[np.float64]
Complex = NDArray[np.complex128]
Index = NDArray[np.int64]

CONVERGED, NOT_FALLING, TOO_MANY, OVERFLOWED = 0, 1, 2, 3

# Rounding error of a sum, that of its angle included, relative to the sum of its terms' slopes.
ROUNDING = 4.0 * 2.220446049250313e-16
_POLISHING_STEPS = 48
# For so few, elimination in place takes less time than the call of a library.
_FEW_UNKNOWNS = 40
_STACK = 64
# Not aligned with multiples of pi/2, where the zeros of a sum in cosines alone lie.
_GRID_START = -0.1

Matrix = TypeVar("Matrix", Real, Complex)


def with_replacement(function: Callable[..., Any], **replaced: Any) -> Callable[..., Any]:
    """A compiled ``function`` as plain Python with some of the functions it calls replaced.

    For what cannot be compiled, an element given as Python functions, in the middle of what can.
    """
    source = cast(Any, function).py_func
    return FunctionType(source.__code__, {**source.__globals__, **replaced})


@compiled
def series(x: Complex, turn: complex) -> tuple[float, float]:
    """u = Re sum_k x_k z^(2k-1) and du/dtau, at z = e^(i tau)."""
    square = turn * turn
    wave = turn
    value = 0.0
    slope = 0.0
    for k in range(x.shape[0]):
        term = x[k] * wave
        value += term.real
        slope -= (2 * k + 1) * term.imag
        wave = wave * square
    return value, slope


@compiled
def _is_negative(value: float) -> bool:
    # The sign bit: a value of exactly zero has one as well, so that it counts once.
    return bool(np.copysign(1.0, value) < 0.0)


@compiled
def _polish(x: Complex, low: float, high: float, at_low: float, at_high: float) -> float:
    """Newton's method from the chord, inside a bracket in which u is monotone."""
    rising = at_high > at_low
    root = low - at_low * (high - low) / (at_high - at_low)
    for _ in range(_POLISHING_STEPS):
        value, slope = series(x, np.exp(1j * root))
        if (value > 0.0) == rising:
            high = root
        else:
            low = root
        following = root - value / slope if slope != 0.0 else 0.5 * (low + high)
        if not low <= following <= high:
            following = 0.5 * (low + high)
        if abs(following - root) <= ROUNDING * np.pi:
            return following
        root = following
    return root


@compiled
def zeros(x: Complex, out: Real) -> int:
    """The zeros of u in [-0.1, pi - 0.1), ascending, into ``out`` (2N + 2,); their number.

    An interval is passed over only where a bound on u'' excludes a zero, and taken to hold one
    only where the bound shows u to be monotone; any other is halved, down to where the bound is
    below rounding. Adjoining intervals that end there hold one zero if u changes sign over them.
    A sum that vanishes or is not finite is said to have none.
    """
    harmonics = x.shape[0]
    bound = 0.0
    slopes = 0.0
    for k in range(harmonics):
        bound += (2 * k + 1) ** 2 * abs(x[k])
        slopes += (2 * k + 1) * abs(x[k])
    if not 0.0 < bound < np.inf:
        return 0
    narrowest = np.sqrt(8.0 * ROUNDING * slopes / bound)
    cells = 8 * harmonics + 4
    cell = np.pi / cells
    turn = np.exp(1j * _GRID_START)
    step = np.exp(1j * cell)
    value, slope = series(x, turn)
    first_value, first_slope = value, slope
    # Six numbers an interval: ends, values and slopes there.
    stack = np.empty((_STACK, 6))
    count = 0
    run_low = 0.0
    run_high = 0.0
    run_from = 0.0
    run_to = 0.0
    in_run = False
    for number in range(cells):
        if number + 1 == cells:
            next_value, next_slope = -first_value, -first_slope
        else:
            turn = turn * step
            next_value, next_slope = series(x, turn)
        stack[0, 0] = _GRID_START + number * cell
        stack[0, 1] = _GRID_START + (number + 1) * cell
        stack[0, 2], stack[0, 3] = value, next_value
        stack[0, 4], stack[0, 5] = slope, next_slope
        top = 0
        while top >= 0:
            low, high = stack[top, 0], stack[top, 1]
            at_low, at_high = stack[top, 2], stack[top, 3]
            slope_low, slope_high = stack[top, 4], stack[top, 5]
            top -= 1
            width = high - low
            change = _is_negative(at_low) != _is_negative(at_high)
            if not change and min(abs(at_low), abs(at_high)) > bound * width * width / 8.0:
                continue
            if ((slope_low < 0.0) == (slope_high < 0.0)
                    and min(abs(slope_low), abs(slope_high)) > bound * width / 2.0):
                if change:
                    out[count] = _polish(x, low, high, at_low, at_high)
                    count += 1
                continue
            if width <= narrowest:
                if in_run and low <= run_high:
                    run_high, run_to = high, at_high
                else:
                    if in_run and _is_negative(run_from) != _is_negative(run_to):
                        out[count] = 0.5 * (run_low + run_high)
                        count += 1
                    in_run = True
                    run_low, run_high, run_from, run_to = low, high, at_low, at_high
                continue
            middle = 0.5 * (low + high)
            at_middle, slope_middle = series(x, np.exp(1j * middle))
            # The left half on top, so that intervals are met in ascending order.
            stack[top + 1, 0], stack[top + 1, 1] = middle, high
            stack[top + 1, 2], stack[top + 1, 3] = at_middle, at_high
            stack[top + 1, 4], stack[top + 1, 5] = slope_middle, slope_high
            stack[top + 2, 0], stack[top + 2, 1] = low, middle
            stack[top + 2, 2], stack[top + 2, 3] = at_low, at_middle
            stack[top + 2, 4], stack[top + 2, 5] = slope_low, slope_middle
            top += 2
        value, slope = next_value, next_slope
    if in_run and _is_negative(run_from) != _is_negative(run_to):
        out[count] = 0.5 * (run_low + run_high)
        count += 1
    out[:count].sort()
    return count


@compiled
def crossings(row: Real, tau: Real) -> tuple[Complex, int, float]:
    """Velocity dq/dtau of ``row`` in complex form, its zeros into ``tau``, their number, and the
    sign of the velocity after the first."""
    harmonics = row.shape[0] // 2
    rate = np.empty(harmonics, np.complex128)
    for k in range(harmonics):
        rate[k] = (2 * k + 1) * (1j * row[k] + row[harmonics + k])
    count = zeros(rate, tau)
    if count == 0:
        return rate, 0, 1.0
    # The sign is taken in the widest interval: in a narrow one it may be that of rounding.
    widest = count - 1
    width = tau[0] + np.pi - tau[count - 1]
    for v in range(count - 1):
        if tau[v + 1] - tau[v] > width:
            widest = v
            width = tau[v + 1] - tau[v]
    value, _ = series(rate, np.exp(1j * (tau[widest] + 0.5 * width)))
    return rate, count, 1.0 if (value > 0.0) == (widest % 2 == 0) else -1.0


@compiled
def add_coulomb(row: Real, torque: float, tau: Real, force: Real, jacobian: Real) -> None:
    """Add torque * sign(velocity) to ``force`` (2N,) and ``jacobian`` (2N, 2N).

    The force is NaN where the velocity vanishes altogether.
    """
    harmonics = row.shape[0] // 2
    rate, count, sign = crossings(row, tau)
    if count == 0:
        force[:] = np.nan
        return
    wave = np.empty(harmonics, np.complex128)
    total = np.zeros(harmonics, np.complex128)
    for v in range(count):
        turn = np.exp(1j * tau[v])
        square = turn * turn
        _, acceleration = series(rate, turn)
        power = turn
        for k in range(harmonics):
            wave[k] = power
            total[k] += sign * power / (1j * (2 * k + 1))
            power = power * square
        # d sign(v) is a pulse 2 dv / |dv/dtau| at every zero of v; the two halves of the period
        # contribute alike.
        pulse = 4.0 / np.pi * torque / abs(acceleration)
        for k in range(harmonics):
            for m in range(harmonics):
                by_cosine = -(2 * m + 1) * wave[m].imag * pulse
                by_sine = (2 * m + 1) * wave[m].real * pulse
                jacobian[k, m] += wave[k].real * by_cosine
                jacobian[k, harmonics + m] += wave[k].real * by_sine
                jacobian[harmonics + k, m] += wave[k].imag * by_cosine
                jacobian[harmonics + k, harmonics + m] += wave[k].imag * by_sine
        sign = -sign
    for k in range(harmonics):
        value = -4.0 / np.pi * torque * np.conj(total[k])
        force[k] += value.real
        force[harmonics + k] -= value.imag


@compiled
def speed_spectrum(rate: Complex, count: int, sign: float, tau: Real) -> Complex:
    """W_p = (1/pi) integral of |dq/dtau| e^(-2ip tau), p = 0..2N-1, given the crossings."""
    harmonics = rate.shape[0]
    # (2/pi) integral of sign(dq/dtau) e^(i m tau) over half a period, m = 1, 3, ... 6N-1. Signs
    # alternate and e^(i m (tau + pi)) = -e^(i m tau): each zero counts twice.
    signs = np.zeros(3 * harmonics, np.complex128)
    for v in range(count):
        turn = np.exp(1j * tau[v])
        square = turn * turn
        power = turn
        for j in range(3 * harmonics):
            signs[j] += sign * power
            power = power * square
        sign = -sign
    for j in range(3 * harmonics):
        signs[j] *= -4.0 / np.pi / (1j * (2 * j + 1))
    spectrum = np.empty(2 * harmonics, np.complex128)
    for p in range(2 * harmonics):
        total = 0.0 + 0.0j
        for k in range(harmonics):
            difference = signs[k - p] if k >= p else np.conj(signs[p - k - 1])
            total += rate[k] * difference + np.conj(rate[k] * signs[k + p])
        spectrum[p] = 0.5 * total
    return spectrum


@compiled
def add_quadratic(row: Real, coefficient: float, frequency: float, tau: Real, force: Real,
                  jacobian: Real, by_frequency: Real) -> None:
    """Add coefficient * |velocity| velocity to ``force``, ``jacobian`` and ``by_frequency``."""
    harmonics = row.shape[0] // 2
    rate, count, sign = crossings(row, tau)
    spectrum = speed_spectrum(rate, count, sign, tau)
    factor = frequency * frequency * coefficient
    for k in range(harmonics):
        cosine = 0.0
        sine = 0.0
        for m in range(harmonics):
            # |v| dv/dtau, with d(dq/dtau) = Re sum i (2m-1) dx_m e^(i(2m-1)tau), meets order k
            # through the spectrum of |v| at k - m and at k + m.
            difference = spectrum[k - m] if k >= m else np.conj(spectrum[m - k])
            total = spectrum[k + m + 1]
            by_cosine = factor * 1j * (2 * m + 1) * (difference - total)
            by_sine = factor * (2 * m + 1) * (difference + total)
            jacobian[k, m] += by_cosine.real
            jacobian[k, harmonics + m] += by_sine.real
            jacobian[harmonics + k, m] -= by_cosine.imag
            jacobian[harmonics + k, harmonics + m] -= by_sine.imag
            # Homogeneous of degree two: f = J A / 2.
            cosine += 0.5 * (by_cosine.real * row[m] + by_sine.real * row[harmonics + m])
            sine -= 0.5 * (by_cosine.imag * row[m] + by_sine.imag * row[harmonics + m])
        force[k] += cosine
        force[harmonics + k] += sine
        by_frequency[k] += 2.0 / frequency * cosine
        by_frequency[harmonics + k] += 2.0 / frequency * sine


@compiled
def fill_dynamic_stiffness(mass: Real, damping: Real, stiffness: Real, rate: float, rows: Index,
                           columns: Index, result: Complex) -> None:
    """Z = -rate^2 M + i rate C + K between coordinates, into ``result`` (rows, columns)."""
    for i in range(rows.shape[0]):
        for j in range(columns.shape[0]):
            p, q = rows[i], columns[j]
            result[i, j] = complex(stiffness[p, q] - rate * rate * mass[p, q],
                                   rate * damping[p, q])


@compiled
def fill_turning(mass: Real, damping: Real, rate: float, order: float, rows: Index,
                 columns: Index, result: Complex) -> None:
    """dZ/domega between coordinates, into ``result`` (rows, columns)."""
    for i in range(rows.shape[0]):
        for j in range(columns.shape[0]):
            p, q = rows[i], columns[j]
            result[i, j] = complex(-2.0 * order * rate * mass[p, q], order * damping[p, q])


@compiled
def condensation_space(kept: int, dropped: int) -> Complex:
    """Room in which ``condense`` works and leaves its results, for use again and again."""
    return np.empty((9, max(kept, dropped), max(kept, dropped)), np.complex128)


@compiled
def condense(mass: Real, damping: Real, stiffness: Real, frequency: float, order: float,
             kept: Index, dropped: Index, space: Complex
             ) -> tuple[Complex, Complex, Complex, Complex]:
    """One harmonic's dynamic stiffness of the ``kept`` coordinates and its derivative by frequency.

    Also what gives the ``dropped`` coordinates from the kept ones, shape (dropped, kept), and its
    counterpart for the rows, (kept, dropped). All four are views of ``space``.
    """
    m, n = kept.shape[0], dropped.shape[0]
    rate = order * frequency
    result, by_frequency = space[0, :m, :m], space[1, :m, :m]
    recover, rows = space[2, :n, :m], space[3, :m, :n]
    fill_dynamic_stiffness(mass, damping, stiffness, rate, kept, kept, result)
    fill_turning(mass, damping, rate, order, kept, kept, by_frequency)
    if n > 0:
        inner, inverse = space[4, :n, :n], space[5, :n, :n]
        across, down, changing = space[6, :n, :m], space[7, :m, :n], space[8]
        fill_dynamic_stiffness(mass, damping, stiffness, rate, dropped, dropped, inner)
        fill_dynamic_stiffness(mass, damping, stiffness, rate, dropped, kept, across)
        fill_dynamic_stiffness(mass, damping, stiffness, rate, kept, dropped, down)
        invert(inner, inverse)
        recover[:] = 0.0
        rows[:] = 0.0
        add_product(inverse, across, -1.0, recover)
        add_product(down, inverse, -1.0, rows)
        add_product(down, recover, 1.0, result)
        # d result = L dZ R with R = (1, recover) and L = (1, rows).
        fill_turning(mass, damping, rate, order, kept, dropped, changing[:m, :n])
        add_product(changing[:m, :n], recover, 1.0, by_frequency)
        fill_turning(mass, damping, rate, order, dropped, kept, across)
        fill_turning(mass, damping, rate, order, dropped, dropped, changing[:n, :n])
        add_product(changing[:n, :n], recover, 1.0, across)
        add_product(rows, across, 1.0, by_frequency)
    return result, by_frequency, recover, rows


@compiled
def add_product(left: Matrix, right: Matrix, factor: float, result: Matrix) -> None:
    """Add factor * left @ right to ``result``; small matrices, for which a library call is slow."""
    for i in range(left.shape[0]):
        for k in range(left.shape[1]):
            scaled = factor * left[i, k]
            for j in range(right.shape[1]):
                result[i, j] += scaled * right[k, j]


@compiled
def invert(matrix: Matrix, result: Matrix) -> None:
    """The inverse into ``result``, by Gauss and Jordan with partial pivoting; spoils ``matrix``.

    NaN where there is none.
    """
    size = matrix.shape[0]
    for i in range(size):
        for j in range(size):
            result[i, j] = 1.0 if i == j else 0.0
    for k in range(size):
        pivot = k
        for i in range(k + 1, size):
            if abs(matrix[i, k]) > abs(matrix[pivot, k]):
                pivot = i
        if pivot != k:
            for j in range(size):
                matrix[k, j], matrix[pivot, j] = matrix[pivot, j], matrix[k, j]
                result[k, j], result[pivot, j] = result[pivot, j], result[k, j]
        if matrix[k, k] == 0.0:
            result[:] = np.nan
            return
        scale = 1.0 / matrix[k, k]
        for j in range(size):
            matrix[k, j] *= scale
            result[k, j] *= scale
        for i in range(size):
            if i != k:
                factor = matrix[i, k]
                for j in range(size):
                    matrix[i, j] -= factor * matrix[k, j]
                    result[i, j] -= factor * result[k, j]


@compiled
def assemble(
    mass: Real, damping: Real, stiffness: Real, kept: Index, dropped: Index,
    coulomb: Index, torques: Real, quadratic: Index, coefficients: Real,
    point: Real, frequency: float,
    residual: Real, jacobian: Real, by_frequency: Real, terms: Real,
) -> None:
    """The balance at ``point`` (m, 2N): fills residual and by_frequency (m, 2N), jacobian
    (m, 2N, m, 2N), and for each coordinate the size ``terms`` (m,) of what the residual sums."""
    count, width = point.shape
    harmonics = width // 2
    residual[:] = 0.0
    jacobian[:] = 0.0
    by_frequency[:] = 0.0
    terms[:] = 0.0
    space = condensation_space(kept.shape[0], dropped.shape[0])
    for k in range(harmonics):
        linear, turning, _, _ = condense(
            mass, damping, stiffness, frequency, 2.0 * k + 1.0, kept, dropped, space)
        for i in range(count):
            force = 0.0 + 0.0j
            change = 0.0 + 0.0j
            size = 0.0
            for j in range(count):
                x = complex(point[j, k], -point[j, harmonics + k])
                force += linear[i, j] * x
                change += turning[i, j] * x
                size += abs(linear[i, j]) * abs(x)
                jacobian[i, k, j, k] = linear[i, j].real
                jacobian[i, k, j, harmonics + k] = linear[i, j].imag
                jacobian[i, harmonics + k, j, k] = -linear[i, j].imag
                jacobian[i, harmonics + k, j, harmonics + k] = linear[i, j].real
            residual[i, k] = force.real
            residual[i, harmonics + k] = -force.imag
            by_frequency[i, k] = change.real
            by_frequency[i, harmonics + k] = -change.imag
            terms[i] += size * size
    for i in range(count):
        terms[i] = np.sqrt(terms[i])
    add_elements(coulomb, torques, quadratic, coefficients, point, frequency, residual, jacobian,
                 by_frequency, terms)


@compiled
def add_elements(
    coulomb: Index, torques: Real, quadratic: Index, coefficients: Real,
    point: Real, frequency: float,
    residual: Real, jacobian: Real, by_frequency: Real, terms: Real,
) -> None:
    """Add the Coulomb and quadratic elements to what assemble fills."""
    width = point.shape[1]
    tau = np.empty(width + 2)
    element = np.zeros(width)
    for e in range(coulomb.shape[0]):
        i = coulomb[e]
        element[:] = 0.0
        add_coulomb(point[i], torques[e], tau, element, jacobian[i, :, i, :])
        residual[i] += element
        terms[i] += np.sqrt(np.sum(element * element))
    for e in range(quadratic.shape[0]):
        i = quadratic[e]
        element[:] = 0.0
        add_quadratic(point[i], coefficients[e], frequency, tau, element, jacobian[i, :, i, :],
                      by_frequency[i])
        residual[i] += element
        terms[i] += np.sqrt(np.sum(element * element))


@compiled
def relative_error(residual: Real, terms: Real) -> float:
    """The residual's largest size in one coordinate, relative to its terms'; infinite if NaN."""
    error = 0.0
    for i in range(residual.shape[0]):
        ratio = np.sqrt(np.sum(residual[i] * residual[i])) / max(terms[i], 1e-300)
        if not ratio < np.inf:
            return np.inf
        error = max(error, ratio)
    return error


@compiled
def unknown_sizes(point: Real, frequency: float, phase: int, sizes: Real) -> None:
    """The size of each unknown into ``sizes`` (2N m,): its coordinate's, or the frequency."""
    count, width = point.shape
    largest = 0.0
    for i in range(count):
        size = np.sqrt(np.sum(point[i] * point[i]))
        largest = max(largest, size)
        sizes[i * width:(i + 1) * width] = size
    for i in range(count * width):
        sizes[i] = max(sizes[i], 1e-6 * largest)
    sizes[phase] = frequency


@compiled
def largest_change(before: Real, after: Real) -> float:
    """The largest relative change of the size of a row between two points (m, 2N)."""
    change = 0.0
    for i in range(before.shape[0]):
        old = np.sqrt(np.sum(before[i] * before[i]))
        new = np.sqrt(np.sum(after[i] * after[i]))
        change = max(change, abs(new - old) / max(old, 1e-300))
    return change


@compiled
def eliminate(matrix: Real, right: Real) -> float:
    """Solve by Gauss with partial pivoting, ``right`` becoming the solution; spoils ``matrix``.

    Returns the determinant's sign. Raises LinAlgError for a singular matrix.
    """
    size = matrix.shape[0]
    sign = 1.0
    for k in range(size):
        pivot = k
        for i in range(k + 1, size):
            if abs(matrix[i, k]) > abs(matrix[pivot, k]):
                pivot = i
        if matrix[pivot, k] == 0.0:
            raise np.linalg.LinAlgError("singular matrix")
        if pivot != k:
            sign = -sign
            right[k], right[pivot] = right[pivot], right[k]
            for j in range(k, size):
                matrix[k, j], matrix[pivot, j] = matrix[pivot, j], matrix[k, j]
        if matrix[k, k] < 0.0:
            sign = -sign
        scale = 1.0 / matrix[k, k]
        for i in range(k + 1, size):
            factor = matrix[i, k] * scale
            if factor != 0.0:
                right[i] -= factor * right[k]
                for j in range(k + 1, size):
                    matrix[i, j] -= factor * matrix[k, j]
    for k in range(size - 1, -1, -1):
        total = right[k]
        for j in range(k + 1, size):
            total -= matrix[k, j] * right[j]
        right[k] = total / matrix[k, k]
    return sign


@compiled
def eliminate_all(matrix: Real, right: Real) -> None:
    """As eliminate, for many right sides (size, columns); NaN or infinite where singular."""
    size, columns = right.shape
    for k in range(size):
        pivot = k
        for i in range(k + 1, size):
            if abs(matrix[i, k]) > abs(matrix[pivot, k]):
                pivot = i
        if pivot != k:
            for j in range(k, size):
                matrix[k, j], matrix[pivot, j] = matrix[pivot, j], matrix[k, j]
            for j in range(columns):
                right[k, j], right[pivot, j] = right[pivot, j], right[k, j]
        scale = 1.0 / matrix[k, k]
        for i in range(k + 1, size):
            factor = matrix[i, k] * scale
            for j in range(k + 1, size):
                matrix[i, j] -= factor * matrix[k, j]
            for j in range(columns):
                right[i, j] -= factor * right[k, j]
    for k in range(size - 1, -1, -1):
        for i in range(k + 1, size):
            factor = matrix[k, i]
            for j in range(columns):
                right[k, j] -= factor * right[i, j]
        scale = 1.0 / matrix[k, k]
        for j in range(columns):
            right[k, j] *= scale


@compiled
def solved(matrix: Real, right: Real) -> tuple[Real, float]:
    """The solution, and the determinant's sign where it is known by the way, or else 0.

    May spoil both arguments. Raises LinAlgError for a singular matrix.
    """
    if right.shape[0] <= _FEW_UNKNOWNS:
        return right, eliminate(matrix, right)
    solution: Any = np.linalg.solve(matrix, right)
    return solution, 0.0


@compiled
def newton(
    mass: Real, damping: Real, stiffness: Real, kept: Index, dropped: Index,
    coulomb: Index, torques: Real, quadratic: Index, coefficients: Real,
    start: Real, start_frequency: float, phase: int,
    residual_tolerance: float, step_tolerance: float, largest_step: float,
    maximum_iterations: int, halvings: int,
) -> tuple[Real, float, int, float, int, int]:
    """Damped Newton's method from ``start`` (m, 2N): point, frequency, iterations, relative
    residual, sign of the determinant, and how it ended."""
    count, width = start.shape
    unknowns = count * width
    point = start.copy()
    frequency = start_frequency
    residual = np.empty((count, width))
    by_frequency = np.empty((count, width))
    jacobian = np.empty((count, width, count, width))
    terms = np.empty(count)
    sizes = np.empty(unknowns)
    assemble(mass, damping, stiffness, kept, dropped, coulomb, torques, quadratic, coefficients,
             point, frequency, residual, jacobian, by_frequency, terms)
    error = relative_error(residual, terms)
    for iteration in range(1, maximum_iterations + 1):
        unknown_sizes(point, frequency, phase, sizes)
        matrix = jacobian.reshape(unknowns, unknowns) * sizes
        matrix[:, phase] = by_frequency.reshape(unknowns) * frequency
        right = -residual.reshape(unknowns)
        if not (np.isfinite(np.sum(matrix)) and np.isfinite(np.sum(right))):
            return point, frequency, iteration, error, 0, OVERFLOWED
        step, sign = solved(matrix, right)
        length = np.sqrt(np.sum(step * step))
        if error <= residual_tolerance and length <= step_tolerance:
            if sign == 0.0:
                sign = np.linalg.slogdet(matrix)[0]
            return point, frequency, iteration, error, 1 if sign > 0.0 else -1, CONVERGED
        fraction = min(1.0, largest_step / length) if length > 0.0 else 1.0
        accepted = False
        for _ in range(halvings):
            tried = (point.reshape(unknowns) + fraction * sizes * step)
            tried[phase] = point.reshape(unknowns)[phase]
            candidate = tried.reshape(count, width)
            candidate_frequency = frequency + fraction * frequency * step[phase]
            if candidate_frequency > 0.0:
                assemble(mass, damping, stiffness, kept, dropped, coulomb, torques, quadratic,
                         coefficients, candidate, candidate_frequency, residual, jacobian,
                         by_frequency, terms)
                tried_error = relative_error(residual, terms)
                if tried_error < error or tried_error <= residual_tolerance:
                    accepted = True
                    break
            fraction *= 0.5
        if not accepted:
            return point, frequency, iteration, error, 0, NOT_FALLING
        point, frequency, error = candidate, candidate_frequency, tried_error
    return point, frequency, maximum_iterations, error, 0, TOO_MANY


@compiled
def solve_point(
    mass: Real, damping: Real, stiffness: Real, kept: Index, dropped: Index,
    coulomb: Index, torques: Real, quadratic: Index, coefficients: Real,
    start: Real, start_frequency: float, phase: int,
    residual_tolerance: float, step_tolerance: float, largest_step: float,
    maximum_iterations: int, halvings: int,
) -> tuple[Real, float, int, float, int, int, Real, float]:
    """newton, then the rows (n, 2N) of all coordinates and the relative residual of all of them."""
    point, frequency, iterations, error, orientation, ending = newton(
        mass, damping, stiffness, kept, dropped, coulomb, torques, quadratic, coefficients,
        start, start_frequency, phase, residual_tolerance, step_tolerance, largest_step,
        maximum_iterations, halvings)
    everything = recover(mass, damping, stiffness, kept, dropped, point, frequency)
    return (point, frequency, iterations, error, orientation, ending, everything,
            full_error(mass, damping, stiffness, kept[coulomb], torques, kept[quadratic],
                       coefficients, everything, frequency))


@compiled
def stepped(
    mass: Real, damping: Real, stiffness: Real, kept: Index, dropped: Index,
    coulomb: Index, torques: Real, quadratic: Index, coefficients: Real,
    point: Real, frequency: float, phase: int,
) -> tuple[Real, float]:
    """One undamped step of Newton's method from ``point`` (m, 2N): the rows (n, 2N) of all
    coordinates and the frequency; NaN where there is none."""
    count, width = point.shape
    unknowns = count * width
    residual = np.empty((count, width))
    by_frequency = np.empty((count, width))
    jacobian = np.empty((count, width, count, width))
    terms = np.empty(count)
    sizes = np.empty(unknowns)
    assemble(mass, damping, stiffness, kept, dropped, coulomb, torques, quadratic, coefficients,
             point, frequency, residual, jacobian, by_frequency, terms)
    unknown_sizes(point, frequency, phase, sizes)
    matrix = jacobian.reshape(unknowns, unknowns) * sizes
    matrix[:, phase] = by_frequency.reshape(unknowns) * frequency
    step, _ = solved(matrix, -residual.reshape(unknowns))
    following = point.reshape(unknowns) + sizes * step
    following[phase] = point.reshape(unknowns)[phase]
    frequency = frequency + frequency * step[phase]
    return recover(mass, damping, stiffness, kept, dropped, following.reshape(count, width),
                   frequency), frequency


@compiled
def full_error(
    mass: Real, damping: Real, stiffness: Real, coulomb: Index, torques: Real,
    quadratic: Index, coefficients: Real, point: Real, frequency: float,
) -> float:
    """The relative residual of all coordinates at ``point`` (n, 2N), none of them eliminated."""
    count, width = point.shape
    harmonics = width // 2
    residual = np.zeros((count, width))
    terms = np.zeros(count)
    for k in range(harmonics):
        rate = (2 * k + 1) * frequency
        for i in range(count):
            force = 0.0 + 0.0j
            size = 0.0
            for j in range(count):
                x = complex(point[j, k], -point[j, harmonics + k])
                term = complex(stiffness[i, j] - rate * rate * mass[i, j],
                               rate * damping[i, j]) * x
                force += term
                size += abs(term)
            residual[i, k] = force.real
            residual[i, harmonics + k] = -force.imag
            terms[i] += size * size
    terms = np.sqrt(terms)
    # The elements' derivatives are not asked for, but come along.
    unused = np.zeros((width, width))
    also_unused = np.zeros(width)
    element = np.zeros(width)
    tau = np.empty(width + 2)
    for e in range(coulomb.shape[0] + quadratic.shape[0]):
        element[:] = 0.0
        if e < coulomb.shape[0]:
            i = coulomb[e]
            add_coulomb(point[i], torques[e], tau, element, unused)
        else:
            i = quadratic[e - coulomb.shape[0]]
            add_quadratic(point[i], coefficients[e - coulomb.shape[0]], frequency, tau, element,
                          unused, also_unused)
        residual[i] += element
        terms[i] += np.sqrt(np.sum(element * element))
    return relative_error(residual, terms)


@compiled
def recover(mass: Real, damping: Real, stiffness: Real, kept: Index, dropped: Index, point: Real,
            frequency: float) -> Real:
    """Rows (n, 2N) of all coordinates from those (m, 2N) of the ``kept`` ones."""
    count, width = point.shape
    harmonics = width // 2
    result = np.empty((count + dropped.shape[0], width))
    for i in range(count):
        result[kept[i]] = point[i]
    space = condensation_space(kept.shape[0], dropped.shape[0])
    for k in range(harmonics):
        _, _, others, _ = condense(
            mass, damping, stiffness, frequency, 2.0 * k + 1.0, kept, dropped, space)
        for i in range(dropped.shape[0]):
            x = 0.0 + 0.0j
            for j in range(count):
                x += others[i, j] * complex(point[j, k], -point[j, harmonics + k])
            result[dropped[i], k] = x.real
            result[dropped[i], harmonics + k] = -x.imag
    return result


@compiled
def parameter_force(
    mass: Real, damping: Real, stiffness: Real, kept: Index, dropped: Index,
    mass_rate: Real, damping_rate: Real, stiffness_rate: Real,
    point: Real, frequency: float, force: Real,
) -> None:
    """Add the derivative of the linear terms, the matrices changing at the given rates, to
    ``force`` (m, 2N)."""
    count, width = point.shape
    harmonics = width // 2
    everything = np.concatenate((kept, dropped))
    dofs = everything.shape[0]
    space = condensation_space(kept.shape[0], dropped.shape[0])
    changing = np.empty((dofs, dofs), np.complex128)
    for k in range(harmonics):
        order = 2.0 * k + 1.0
        _, _, recover_others, rows = condense(
            mass, damping, stiffness, frequency, order, kept, dropped, space)
        fill_dynamic_stiffness(mass_rate, damping_rate, stiffness_rate, order * frequency,
                               everything, everything, changing)
        x = np.zeros(dofs, np.complex128)
        for j in range(count):
            x[j] = complex(point[j, k], -point[j, harmonics + k])
        for i in range(dropped.shape[0]):
            for j in range(count):
                x[count + i] += recover_others[i, j] * x[j]
        for i in range(count):
            total = 0.0 + 0.0j
            for j in range(dofs):
                total += changing[i, j] * x[j]
                for q in range(dropped.shape[0]):
                    total += rows[i, q] * changing[count + q, j] * x[j]
            force[i, k] += total.real
            force[i, harmonics + k] -= total.imag


@compiled
def quasi_linear_mode(
    mass: Real, damping: Real, stiffness: Real,
    coulomb: Index, torques: Real, quadratic: Index, coefficients: Real,
    amplitude: float, shape: Complex, rate: complex, reference: int,
    maximum_iterations: int, tolerance: float,
) -> tuple[Complex, complex, bool]:
    """Newton's method for (mu^2 M + mu C + K) x + F(x, Im mu) = 0, x[reference] = amplitude.

    Starts from ``shape`` (n,), relative to the reference coordinate's, and ``rate`` mu; returns
    both and whether it converged.
    """
    count = mass.shape[0]
    place = 2 * reference
    residual = np.empty((count, 2))
    jacobian = np.empty((count, 2, count, 2))
    by_frequency = np.empty((count, 2))
    by_growth = np.empty((count, 2))
    point = np.empty((count, 2))
    terms = np.empty(count)
    for _ in range(maximum_iterations):
        largest = 0.0
        for i in range(count):
            force = 0.0 + 0.0j
            turning = 0.0 + 0.0j
            for j in range(count):
                linear = rate * rate * mass[i, j] + rate * damping[i, j] + stiffness[i, j]
                force += amplitude * linear * shape[j]
                turning += amplitude * (2.0 * rate * mass[i, j] + damping[i, j]) * shape[j]
                jacobian[i, 0, j, 0] = jacobian[i, 1, j, 1] = linear.real
                jacobian[i, 0, j, 1] = linear.imag
                jacobian[i, 1, j, 0] = -linear.imag
                largest = max(largest, abs(linear))
            residual[i, 0], residual[i, 1] = force.real, -force.imag
            by_growth[i, 0], by_growth[i, 1] = turning.real, -turning.imag
            by_frequency[i, 0], by_frequency[i, 1] = -turning.imag, -turning.real
            point[i, 0], point[i, 1] = amplitude * shape[i].real, -amplitude * shape[i].imag
            terms[i] = 0.0
        add_elements(coulomb, torques, quadratic, coefficients, point, rate.imag, residual,
                     jacobian, by_frequency, terms)
        size = abs(rate)
        matrix = amplitude * jacobian.reshape(2 * count, 2 * count)
        matrix[:, place] = size * by_growth.reshape(2 * count)
        matrix[:, place + 1] = size * by_frequency.reshape(2 * count)
        right = -residual.reshape(2 * count)
        if not (np.isfinite(np.sum(matrix)) and np.isfinite(np.sum(right))):
            return shape, rate, False
        step, _ = solved(matrix, right)
        rate = rate + complex(size * step[place], size * step[place + 1])
        if not rate.imag > 0.0:
            return shape, rate, False
        step[place] = step[place + 1] = 0.0
        changed = 0.0
        norm = 0.0
        new_shape = np.empty(count, np.complex128)
        for i in range(count):
            change = complex(step[2 * i], -step[2 * i + 1])
            new_shape[i] = shape[i] + change
            changed += abs(change) ** 2
            norm += abs(new_shape[i]) ** 2
        shape = new_shape
        left = np.sqrt(np.sum(residual * residual))
        if np.sqrt(changed) <= tolerance * np.sqrt(norm) and left <= 1e-6 * largest * amplitude:
            return shape, rate, True
    return shape, rate, False


@compiled
def peaks(point: Real, result: Real) -> None:
    """The largest magnitude of each row of ``point`` (n, 2N) over the period, into (n,)."""
    count, width = point.shape
    harmonics = width // 2
    tau = np.empty(width + 2)
    x = np.empty(harmonics, np.complex128)
    for i in range(count):
        _, number, _ = crossings(point[i], tau)
        for k in range(harmonics):
            x[k] = complex(point[i, k], -point[i, harmonics + k])
        result[i] = 0.0
        for v in range(number):
            value, _ = series(x, np.exp(1j * tau[v]))
            result[i] = max(result[i], abs(value))
