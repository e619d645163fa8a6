"""Formulas of the paper in which the print is wrong: as printed they fail, as corrected they hold.

Integrals are sums over instants, and derivatives differences.
"""

from itertools import pairwise, product

import numpy as np
import pytest

from shimmy_ros.ihb.harmonics import evaluate, velocity_zeros
from shimmy_ros.ihb.loops import ROUNDING

HARMONICS = 3
ORBIT = np.array([1.0, -0.15, 0.06, 0.2, 0.12, -0.05])
A, B = ORBIT[:HARMONICS], ORBIT[HARMONICS:]
ORDER = np.array([1.0, 3.0, 5.0])
TAU = 2.0 * np.pi * (np.arange(400_000) + 0.5) / 400_000
SPEED = evaluate(ORBIT, TAU, 1)
ZEROS = np.concatenate([velocity_zeros(ORBIT), np.pi + velocity_zeros(ORBIT)])
BOUNDS = np.concatenate([[0.0], ZEROS, [2.0 * np.pi]])
SIGNS = [float(np.sign(evaluate(ORBIT, 0.5 * (low + high), 1))) for low, high in pairwise(BOUNDS)]
EVERY = list(product(range(HARMONICS), repeat=2))


def integral(values):
    return 2.0 * np.pi * np.mean(values)


def agree(found, expected):
    return np.allclose(found, expected, rtol=0.0, atol=1e-4 * np.max(np.abs(expected)))


def pulses(divided_by):
    """The Jacobian of the friction over T, (36)-(39), divided by a function of the zero."""
    result = np.zeros((2 * HARMONICS, 2 * HARMONICS))
    for tau in ZEROS:
        test = np.concatenate([np.cos(ORDER * tau), np.sin(ORDER * tau)])
        rate = np.concatenate([-ORDER * np.sin(ORDER * tau), ORDER * np.cos(ORDER * tau)])
        result -= 2.0 * np.outer(test, rate) / divided_by(tau)
    return result


def phi(tau):
    """(42), which is minus the acceleration."""
    return -evaluate(ORBIT, tau, 2)


def friction(orbit):
    """The integrals of sign(q') with cosines and sines, piecewise."""
    zeros = velocity_zeros(orbit)
    ends = np.concatenate([[0.0], zeros, np.pi + zeros, [2.0 * np.pi]])
    cosine, sine = np.zeros(HARMONICS), np.zeros(HARMONICS)
    for low, high in pairwise(ends):
        sign = np.sign(evaluate(orbit, 0.5 * (low + high), 1))
        cosine += sign * (np.sin(ORDER * high) - np.sin(ORDER * low)) / ORDER
        sine -= sign * (np.cos(ORDER * high) - np.cos(ORDER * low)) / ORDER
    return np.concatenate([cosine, sine])


def test_the_pulses_are_divided_by_minus_the_size_of_phi():
    step = 1e-6
    expected = np.column_stack([
        (friction(ORBIT + step * unit) - friction(ORBIT - step * unit)) / (2.0 * step)
        for unit in np.eye(ORBIT.size)])
    assert agree(pulses(lambda tau: -abs(phi(tau))), expected)
    # Phi changes its sign over half a period: the zeros of both halves cancel.
    assert np.max(np.abs(pulses(phi))) < 1e-9 * np.max(np.abs(expected))


def gamma(i, n, low, high):
    """(49)."""
    return (A[n - 1] * (np.sin(i * high) - np.sin(i * low))
            - B[n - 1] * (np.cos(i * high) - np.cos(i * low))) / i


def right_side(k, l):  # noqa: E741
    """That of (54)."""
    return 0.25 * sum(
        sign * (2 * n - 1) * (gamma(2 * n + 2 * k + 2 * l - 3, n, low, high)
                              - gamma(2 * n - 2 * k - 2 * l + 1, n, low, high)
                              + gamma(2 * n + 2 * k - 2 * l - 1, n, low, high)
                              - gamma(2 * n - 2 * k + 2 * l - 1, n, low, high))
        for sign, (low, high) in zip(SIGNS, pairwise(BOUNDS), strict=True)
        for n in range(1, HARMONICS + 1))


def test_the_last_integral_of_the_speed_has_sine_times_cosine():
    found = [right_side(k + 1, m + 1) for k, m in EVERY]
    assert agree(found, [integral(np.abs(SPEED) * np.sin(ORDER[k] * TAU) * np.cos(ORDER[m] * TAU))
                         for k, m in EVERY])
    assert not agree(found, [
        integral(np.abs(SPEED) * np.cos(ORDER[k] * TAU) * np.sin(ORDER[m] * TAU))
        for k, m in EVERY])


def test_the_speed_has_no_pulses():
    """The numerator of (55) is twice the squared velocity, which is zero where it is taken."""
    for tau in (0.4, 1.9, *ZEROS):
        numerator = 0.0
        for n, m in EVERY:
            minus, plus = ORDER[n] - ORDER[m], ORDER[n] + ORDER[m]
            numerator += ORDER[n] * ORDER[m] * (
                (A[n] * A[m] + B[n] * B[m]) * np.cos(minus * tau)
                + (-A[n] * A[m] + B[n] * B[m]) * np.cos(plus * tau)
                + (-A[n] * B[m] + B[n] * A[m]) * np.sin(minus * tau)
                - (A[n] * B[m] + B[n] * A[m]) * np.sin(plus * tau))
        assert numerator == pytest.approx(2.0 * evaluate(ORBIT, tau, 1)**2, abs=100.0 * ROUNDING)


def damping_sines(last_of_line_two):
    """(62) and (64) over C_d omega^2."""
    result = np.zeros(HARMONICS)
    for sign, (low, high) in zip(SIGNS, pairwise(BOUNDS), strict=True):
        def sines(i, low=low, high=high):
            return (np.sin(i * high) - np.sin(i * low)) / i

        def cosines(i, low=low, high=high):
            return (np.cos(i * high) - np.cos(i * low)) / i

        last = {"sines": sines, "cosines": cosines}[last_of_line_two]
        for k, n, m in product(range(HARMONICS), repeat=3):
            alike, other = ORDER[n] - ORDER[m], ORDER[n] + ORDER[m]
            result[k] += 0.25 * sign * ORDER[n] * ORDER[m] * (
                (A[n] * A[m] + B[n] * B[m]) * (cosines(alike - ORDER[k])
                                               - cosines(alike + ORDER[k]))
                + (-A[n] * A[m] + B[n] * B[m]) * (last(other - ORDER[k])
                                                  - cosines(other + ORDER[k]))
                + (A[n] * B[m] - B[n] * A[m]) * (sines(alike + ORDER[k]) - sines(alike - ORDER[k]))
                + (A[n] * B[m] + B[n] * A[m]) * (sines(other + ORDER[k]) - sines(other - ORDER[k])))
    return result


def test_the_second_line_of_psi_has_cosines_alone():
    expected = [integral(np.abs(SPEED) * SPEED * np.sin(order * TAU)) for order in ORDER]
    assert agree(damping_sines("cosines"), expected)
    assert not agree(damping_sines("sines"), expected)
