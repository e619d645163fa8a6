"""Closed forms against quadrature, against the paper's own sums, and against differences."""

import math
from dataclasses import replace
from itertools import pairwise, product

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st
from scipy.optimize import brentq

from shimmy_ros.ihb.elements import Coulomb, OddElement, QuadraticDamping
from shimmy_ros.ihb.harmonics import evaluate, orders

SEEDS = st.integers(0, 2**32 - 1)
HARMONICS = st.integers(1, 8)
FREQUENCY = 37.0
NODES, WEIGHTS = np.polynomial.legendre.leggauss(48)


def random_orbit(seed, harmonics, coordinates=1):
    """Coefficients (coordinates, 2N) whose velocity is nowhere near a double zero."""
    rng = np.random.default_rng(seed)
    decay = np.tile(orders(harmonics) ** rng.choice([0.0, -1.0, -2.0]), 2)
    orbit = rng.standard_normal((coordinates, 2 * harmonics)) * decay
    for row in orbit:
        slope = np.abs(evaluate(row, reversals(row), 2))
        assume(np.min(slope) > 0.03 * np.max(np.abs(evaluate(row, np.linspace(0.0, 3.2, 400), 2))))
    return orbit


def reversals(row):
    """The zeros of the velocity in [0, 2 pi), by sampling and bisection."""
    grid = np.linspace(0.0, 2.0 * np.pi, 200 * row.size + 1)
    sign = np.sign(evaluate(row, grid, 1))
    found = grid[:-1][sign[:-1] == 0.0].tolist()
    for index in np.flatnonzero(sign[:-1] * sign[1:] < 0.0):
        found.append(brentq(lambda tau: float(evaluate(row, tau, 1)), grid[index],
                            grid[index + 1], xtol=1e-15, rtol=1e-15))
    return np.array(sorted(found))


def projected(force, row):
    """(1/pi) integral of force(tau) cos and sin (2k-1) tau, piecewise between the reversals."""
    ends = np.concatenate([[0.0], reversals(row), [2.0 * np.pi]])
    bounds = np.concatenate([np.linspace(low, high, 4, endpoint=False)
                             for low, high in pairwise(ends)] + [ends[-1:]])
    harmonics = row.size // 2
    result = np.zeros(2 * harmonics)
    for low, high in pairwise(bounds):
        tau = 0.5 * (low + high) + 0.5 * (high - low) * NODES
        weights = 0.5 * (high - low) * WEIGHTS * force(tau) / np.pi
        for k, order in enumerate(orders(harmonics)):
            result[k] += weights @ np.cos(order * tau)
            result[harmonics + k] += weights @ np.sin(order * tau)
    return result


class PaperSums:
    """The sums of the paper over pi, term by term, with tau_0 = 0 and tau_{M+1} = 2 pi.

    Where the print is wrong: (36)-(39) are divided by -|Phi|, the second line of (62) has Theta_c
    twice, and (51), (54) are the integrals with cosine times sine and sine times cosine.
    """

    def __init__(self, row):
        self.harmonics = row.size // 2
        self.a, self.b = row[:self.harmonics], row[self.harmonics:]
        self.zeros = reversals(row)
        self.tau = [0.0, *self.zeros, 2.0 * np.pi]
        self.signs = [float(np.sign(evaluate(row, 0.5 * (low + high), 1)))
                      for low, high in pairwise(self.tau)]
        self.range = range(1, self.harmonics + 1)

    def phi(self, tau):  # (42)
        return sum((2 * u - 1) ** 2 * (self.a[u - 1] * math.cos((2 * u - 1) * tau)
                                       + self.b[u - 1] * math.sin((2 * u - 1) * tau))
                   for u in self.range)

    def coulomb_force(self):  # (40), (41)
        cosine, sine = [], []
        for k in self.range:
            i = 2 * k - 1
            steps = list(zip(self.signs, self.tau[:-1], self.tau[1:], strict=True))
            cosine.append(sum(s * (math.sin(i * high) - math.sin(i * low))
                              for s, low, high in steps) / i)
            sine.append(sum(s * (math.cos(i * low) - math.cos(i * high))
                            for s, low, high in steps) / i)
        return np.array(cosine + sine) / np.pi

    def coulomb_jacobian(self):  # (36)-(39)
        result = np.zeros((2 * self.harmonics, 2 * self.harmonics))
        for k in self.range:
            for l in self.range:  # noqa: E741
                for tau in self.zeros:
                    weight = 2.0 * (2 * l - 1) / -abs(self.phi(tau)) / np.pi
                    ck, sk = math.cos((2 * k - 1) * tau), math.sin((2 * k - 1) * tau)
                    cl, sl = math.cos((2 * l - 1) * tau), math.sin((2 * l - 1) * tau)
                    row, column = k - 1, l - 1
                    result[row, column] += weight * ck * sl
                    result[row, self.harmonics + column] -= weight * ck * cl
                    result[self.harmonics + row, column] += weight * sk * sl
                    result[self.harmonics + row, self.harmonics + column] -= weight * sk * cl
        return result

    def gamma(self, i, n, low, high):  # (49)
        return (self.a[n - 1] * (math.sin(i * high) - math.sin(i * low)) / i
                - self.b[n - 1] * (math.cos(i * high) - math.cos(i * low)) / i)

    def pi(self, i, n, low, high):  # (50)
        return (self.a[n - 1] * (math.cos(i * high) - math.cos(i * low)) / i
                + self.b[n - 1] * (math.sin(i * high) - math.sin(i * low)) / i)

    def speed_integral(self, function, signs, k, l):  # noqa: E741
        total = 0.0
        for s, low, high in zip(self.signs, self.tau[:-1], self.tau[1:], strict=True):
            for n in self.range:
                indices = (2 * n + 2 * k + 2 * l - 3, 2 * n - 2 * k - 2 * l + 1,
                           2 * n + 2 * k - 2 * l - 1, 2 * n - 2 * k + 2 * l - 1)
                total += s * (2 * n - 1) * sum(
                    sign * function(i, n, low, high)
                    for sign, i in zip(signs, indices, strict=True))
        return 0.25 * total

    def damping_jacobian(self):  # (45)-(48) without the terms that vanish, by (51)-(54)
        result = np.zeros((2 * self.harmonics, 2 * self.harmonics))
        for k in self.range:
            for l in self.range:  # noqa: E741
                cosine_sine = self.speed_integral(self.gamma, (1, -1, -1, 1), k, l)
                cosine_cosine = self.speed_integral(self.pi, (1, 1, 1, 1), k, l)
                sine_sine = self.speed_integral(self.pi, (-1, -1, 1, 1), k, l)
                sine_cosine = self.speed_integral(self.gamma, (1, -1, 1, -1), k, l)
                row, column = k - 1, l - 1
                weight = 2.0 * (2 * l - 1) / np.pi
                result[row, column] = -weight * cosine_sine
                result[row, self.harmonics + column] = weight * cosine_cosine
                result[self.harmonics + row, column] = -weight * sine_sine
                result[self.harmonics + row, self.harmonics + column] = weight * sine_cosine
        return result

    def damping_force(self):  # (60)-(64)
        cosine, sine = np.zeros(self.harmonics), np.zeros(self.harmonics)
        for s, low, high in zip(self.signs, self.tau[:-1], self.tau[1:], strict=True):
            odd = range(3 - 4 * self.harmonics, 6 * self.harmonics, 2)
            theta_s = {i: (math.sin(i * high) - math.sin(i * low)) / i for i in odd}
            theta_c = {i: (math.cos(i * high) - math.cos(i * low)) / i for i in odd}
            for k, n, m in product(self.range, repeat=3):
                weight = 0.25 * s * (2 * n - 1) * (2 * m - 1) / np.pi
                an, bn, am, bm = self.a[n - 1], self.b[n - 1], self.a[m - 1], self.b[m - 1]
                i1, i2 = 2 * n - 2 * m + 2 * k - 1, 2 * n - 2 * m - 2 * k + 1
                i3, i4 = 2 * n + 2 * m + 2 * k - 3, 2 * n + 2 * m - 2 * k - 1
                cosine[k - 1] += weight * (
                    (an * am + bn * bm) * (theta_s[i1] + theta_s[i2])
                    + (-an * am + bn * bm) * (theta_s[i3] + theta_s[i4])
                    + (an * bm - bn * am) * (theta_c[i1] + theta_c[i2])
                    + (an * bm + bn * am) * (theta_c[i3] + theta_c[i4]))
                sine[k - 1] += weight * (
                    (an * am + bn * bm) * (-theta_c[i1] + theta_c[i2])
                    + (-an * am + bn * bm) * (-theta_c[i3] + theta_c[i4])
                    + (an * bm - bn * am) * (theta_s[i1] - theta_s[i2])
                    + (an * bm + bn * am) * (theta_s[i3] - theta_s[i4]))
        return np.concatenate([cosine, sine])


def close(value, expected, tolerance):
    """Whether every column of ``value`` is ``expected`` relative to the column's size."""
    error, size = (np.max(np.abs(x), axis=0) for x in (value - expected, expected))
    return np.all(error <= tolerance * size)


@given(SEEDS, HARMONICS)
def test_coulomb_force_is_the_integral_of_the_sign(seed, harmonics):
    orbit = random_orbit(seed, harmonics)
    found = Coulomb(0, 3.0).balance(orbit, FREQUENCY)
    expected = projected(lambda tau: 3.0 * np.sign(evaluate(orbit[0], tau, 1)), orbit[0])
    assert close(found.force[0], expected, 1e-12)
    assert not found.by_frequency.any()


@given(SEEDS, HARMONICS)
def test_quadratic_damping_is_the_integral_of_the_squared_velocity(seed, harmonics):
    orbit = random_orbit(seed, harmonics)
    found = QuadraticDamping(0, 0.7).balance(orbit, FREQUENCY)

    def speed(tau):
        return FREQUENCY * evaluate(orbit[0], tau, 1)

    expected = projected(lambda tau: 0.7 * np.abs(speed(tau)) * speed(tau), orbit[0])
    assert close(found.force[0], expected, 1e-12)
    by_frequency = projected(
        lambda tau: 1.4 * np.abs(speed(tau)) * speed(tau) / FREQUENCY, orbit[0])
    assert close(found.by_frequency[0], by_frequency, 1e-12)
    for column, (order, quarter) in enumerate(
            (order, quarter) for quarter in (0.5 * np.pi, 0.0) for order in orders(harmonics)):
        def change(tau, order=order, quarter=quarter):
            return 1.4 * np.abs(speed(tau)) * FREQUENCY * order * np.cos(order * tau + quarter)

        expected = projected(change, orbit[0])
        assert np.max(np.abs(found.by_coefficients[0, :, 0, column] - expected)) <= (
            1e-12 * np.max(np.abs(found.by_coefficients)))


@settings(max_examples=40)
@given(SEEDS, HARMONICS)
def test_closed_forms_are_the_sums_of_the_paper(seed, harmonics):
    orbit = random_orbit(seed, harmonics)
    paper = PaperSums(orbit[0])
    coulomb = Coulomb(0, 1.0).balance(orbit, FREQUENCY)
    assert close(coulomb.force[0], paper.coulomb_force(), 1e-12)
    assert close(coulomb.by_coefficients[0, :, 0], paper.coulomb_jacobian(), 1e-11)
    damping = QuadraticDamping(0, 1.0 / FREQUENCY**2).balance(orbit, FREQUENCY)
    assert close(damping.force[0], paper.damping_force(), 1e-12)
    assert close(damping.by_coefficients[0, :, 0], paper.damping_jacobian(), 1e-12)
    assert close(damping.by_frequency[0], 2.0 / FREQUENCY * paper.damping_force(), 1e-12)  # (65)


def coupled(points=256):
    """A force on two coordinates that no part of which is linear, and its derivatives."""
    def force(q, v):
        return np.array([q[0] ** 2 * v[1] - 0.4 * v[0] ** 3, q[0] * q[1] * v[0] + q[1] ** 3])

    def stiffness(q, v):
        return np.array([[2.0 * q[0] * v[1], 0.0 * q[0]],
                         [q[1] * v[0], q[0] * v[0] + 3.0 * q[1] ** 2]])

    def damping(q, v):
        return np.array([[-1.2 * v[0] ** 2, q[0] ** 2], [q[0] * q[1], 0.0 * q[0]]])

    return OddElement((2, 0), force, stiffness, damping, points)


@given(SEEDS, HARMONICS)
def test_a_general_force_is_its_integral(seed, harmonics):
    orbit = random_orbit(seed, harmonics, 2)
    element = coupled()
    found = element.balance(orbit, 1.3)
    for i in range(2):
        def force(tau, i=i):
            return element.force(evaluate(orbit, tau), 1.3 * evaluate(orbit, tau, 1))[i]

        assert close(found.force[i], projected(force, orbit[0]), 1e-12)


@given(SEEDS, HARMONICS, st.sampled_from(
    [Coulomb(0, 3.0), QuadraticDamping(0, 0.7), coupled()]))
def test_derivatives_are_those_of_the_force(differences, seed, harmonics, element):
    orbit = random_orbit(seed, harmonics, len(element.dofs))
    found = element.balance(orbit, 1.3)
    expected = differences(lambda moved: element.balance(moved, 1.3).force, orbit)
    assert close(found.by_coefficients.reshape(expected.shape), expected, 1e-6)
    expected = differences(lambda moved: element.balance(orbit, moved[0]).force, [1.3])
    assert np.allclose(found.by_frequency.ravel(), expected[:, 0], rtol=1e-6, atol=1e-8)


@given(SEEDS, HARMONICS)
def test_forces_are_homogeneous(seed, harmonics):
    orbit = random_orbit(seed, harmonics)
    for element, degree in ((Coulomb(0, 3.0), 0), (QuadraticDamping(0, 0.7), 2)):
        force, by_coefficients, _ = element.balance(orbit, FREQUENCY)
        assert element.balance(2.5 * orbit, FREQUENCY).force == pytest.approx(2.5**degree * force)
        euler = by_coefficients[0, :, 0] @ orbit[0] - degree * force[0]
        assert np.max(np.abs(euler)) <= 1e-12 * np.max(np.abs(by_coefficients)) * np.max(
            np.abs(orbit))


def test_a_linear_force_is_a_spring_and_a_damper():
    orbit = np.random.default_rng(1).standard_normal((1, 6))
    element = OddElement((0,), lambda q, v: 2.0 * q + 5.0 * v,
                         lambda q, v: np.full((1, 1, q.size), 2.0),
                         lambda q, v: np.full((1, 1, q.size), 5.0), 16)
    found = element.balance(orbit, 1.3)
    cosines, sines = orbit[0, :3], orbit[0, 3:]
    turning = 5.0 * 1.3 * orders(3)
    assert found.force[0, :3] == pytest.approx(2.0 * cosines + turning * sines)
    assert found.force[0, 3:] == pytest.approx(2.0 * sines - turning * cosines)


@pytest.mark.parametrize("separation", [0.0, 1e-15, 1e-12, 1e-9, 1e-8, 1e-7])
def test_a_pair_of_reversals_too_close_to_resolve_does_not_matter(separation):
    def orbit(velocity):
        tau = 2.0 * np.pi * np.arange(8) / 8
        x = np.array([np.exp(-1j * order * tau) @ velocity(tau) / 4.0 for order in orders(2)])
        x /= 1j * orders(2)
        return np.concatenate([x.real, -x.imag])[None]

    touching = orbit(
        lambda tau: np.sin(tau - 2.0) * np.sin(tau - 0.3) * np.sin(tau - 0.3 - separation))
    plain = orbit(lambda tau: np.sin(tau - 2.0))
    force = Coulomb(0, 1.0).balance(touching, 1.0).force
    assert force == pytest.approx(Coulomb(0, 1.0).balance(plain, 1.0).force, abs=1e-6)


def test_at_rest_friction_has_no_direction_and_damping_no_force():
    rest = np.zeros((1, 6))
    with pytest.raises(ValueError, match="coordinate at rest"):
        Coulomb(0, 1.0).balance(rest, 1.0)
    assert not any(part.any() for part in QuadraticDamping(0, 1.0).balance(rest, 1.0))


@pytest.mark.parametrize("value", [math.nan, math.inf, -math.inf])
@pytest.mark.parametrize(("element", "name"), [
    (Coulomb, "torque"), (QuadraticDamping, "coefficient")])
def test_a_strength_that_is_not_finite_is_refused(element, name, value):
    with pytest.raises(ValueError, match=f"^{name} on coordinate 3 is {value}, but must be a fin"):
        element(3, value)


@pytest.mark.parametrize("offset", [0.25, 0.5, 1.0])
def test_where_the_points_begin_does_not_matter_to_a_smooth_force(offset):
    plain = OddElement((0,), lambda q, v: q**2 * v, lambda q, v: (2.0 * q * v)[None],
                       lambda q, v: (q**2)[None], 64)
    orbit = np.random.default_rng(3).standard_normal((1, 8))
    expected = plain.balance(orbit, FREQUENCY)
    found = replace(plain, offset=offset).balance(orbit, FREQUENCY)
    for one, other in zip(found, expected, strict=True):
        assert one == pytest.approx(other, rel=1e-10, abs=1e-10 * np.abs(other).max())
