import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from shimmy_ros.ihb.harmonics import (
    evaluate,
    orders,
    peaks,
    shifted,
    to_complex,
    to_real,
    velocity_zeros,
    with_harmonics,
    zeros,
)

SEEDS = st.integers(0, 2**32 - 1)


def random_sum(seed, harmonics):
    rng = np.random.default_rng(seed)
    decay = orders(harmonics) ** rng.choice([0.0, -1.0, -2.0, -3.0])
    return (rng.standard_normal((2, harmonics)) * decay).ravel()


def product_of_sines(angles):
    """The complex coefficients of prod_i sin(tau - angles_i), an odd number of factors."""
    terms = {0: 1.0 + 0.0j}
    for angle in angles:
        following = dict.fromkeys(range(-len(angles), len(angles) + 1), 0.0j)
        for order, value in terms.items():
            if value:
                following[order + 1] += value * np.exp(-1j * angle) / 2j
                following[order - 1] -= value * np.exp(1j * angle) / 2j
        terms = following
    return 2.0 * np.array([terms[order] for order in range(1, len(angles) + 1, 2)])


def distance(first, second):
    """Between angles that are equal modulo pi."""
    apart = np.abs(np.asarray(first) - np.asarray(second)) % np.pi
    return np.minimum(apart, np.pi - apart)


def test_orders_are_odd_and_at_least_one():
    assert orders(4).tolist() == [1.0, 3.0, 5.0, 7.0]
    with pytest.raises(ValueError, match="harmonics is 0, but must be at least 1"):
        orders(0)


@pytest.mark.parametrize("harmonics", [1, 3, 8])
def test_evaluate_sums_cosines_and_sines(harmonics):
    row = random_sum(harmonics, harmonics)
    cosines, sines = row[:harmonics], row[harmonics:]
    for tau in (0.0, 0.3, 2.0, 5.5):
        angles = [(2 * k + 1) * tau for k in range(harmonics)]
        place = sum(a * math.cos(x) + b * math.sin(x)
                    for a, b, x in zip(cosines, sines, angles, strict=True))
        rate = sum((2 * k + 1) * (b * math.cos(x) - a * math.sin(x))
                   for k, (a, b, x) in enumerate(zip(cosines, sines, angles, strict=True)))
        bend = -sum((2 * k + 1) ** 2 * (a * math.cos(x) + b * math.sin(x))
                    for k, (a, b, x) in enumerate(zip(cosines, sines, angles, strict=True)))
        values = [float(evaluate(row, tau, derivative)) for derivative in range(3)]
        assert values == pytest.approx([place, rate, bend], abs=1e-12)


def test_evaluate_keeps_the_shape_of_coordinates_and_times():
    rows = np.stack([random_sum(seed, 3) for seed in range(4)])
    tau = np.linspace(0.0, 1.0, 5)
    values = evaluate(rows, tau)
    assert values.shape == (4, 5)
    assert values[2] == pytest.approx(evaluate(rows[2], tau))


@given(SEEDS, st.integers(1, 8), st.floats(-10.0, 10.0))
def test_a_shift_and_complex_form_and_padding_keep_the_sum(seed, harmonics, shift):
    row = random_sum(seed, harmonics)
    tau = np.linspace(0.0, 6.0, 7)
    assert to_real(to_complex(row)).tolist() == row.tolist()
    moved = evaluate(shifted(row, shift), tau)
    assert moved == pytest.approx(evaluate(row, tau + shift), abs=1e-11)
    padded = with_harmonics(row, harmonics + 2)
    assert evaluate(padded, tau) == pytest.approx(evaluate(row, tau), abs=1e-12)
    assert with_harmonics(padded, harmonics).tolist() == row.tolist()


@given(SEEDS, st.integers(1, 32))
def test_no_zero_is_missed_and_none_is_invented(seed, harmonics):
    row = random_sum(seed, harmonics)
    found = velocity_zeros(row)
    assert found.size % 2 == 1
    assert np.all(np.diff(found) > 0.0)
    assert np.all((found >= 0.0) & (found < np.pi))
    slopes = orders(harmonics) ** 2 @ np.abs(to_complex(row))
    assert np.max(np.abs(evaluate(row, found, 1))) <= 1e-14 * slopes

    # Every change of sign on a dense grid holds an odd number of the zeros; every interval
    # without a change an even number, so that none at all is the rule.
    grid = np.linspace(0.0, np.pi, 400 * harmonics + 1) + 1e-3
    changes = np.diff(np.signbit(evaluate(row, grid, 1)))
    in_interval, _ = np.histogram(np.concatenate([found, found + np.pi]), grid)
    assert np.array_equal(in_interval % 2 == 1, changes)
    # Where two zeros share an interval the velocity does come back to zero in it.
    for index in np.flatnonzero(in_interval > 1):
        fine = np.linspace(grid[index], grid[index + 1], 10001)
        signs = np.signbit(evaluate(row, fine, 1))
        assert np.count_nonzero(np.diff(signs)) == in_interval[index]


@given(st.integers(0, 5).flatmap(lambda n: st.lists(
    st.integers(0, 40), min_size=2 * n + 1, max_size=2 * n + 1, unique=True)))
def test_zeros_of_a_product_are_those_of_its_factors(steps):
    angles = np.sort(np.array(steps)) * (np.pi / 41)
    found = zeros(product_of_sines(angles))
    assert found.size == angles.size
    # A zero is known as well as the sum, made of terms of size one, is: to rounding over slope.
    slope = np.array([abs(np.prod(np.sin(angle - np.delete(angles, i))))
                      for i, angle in enumerate(angles)])
    nearest = np.array([np.argmin(distance(found, angle)) for angle in angles])
    assert sorted(nearest) == list(range(angles.size))
    assert np.all(distance(found[nearest], angles) <= 2e-15 / slope)


@pytest.mark.parametrize("separation", [1e-1, 1e-3, 1e-5, 1e-6])
@pytest.mark.parametrize("first", [0.0, 0.3, 1.5, 3.0])
def test_two_zeros_close_together_are_told_apart(first, separation):
    angles = np.array([first, first + separation, first + 1.3])
    found = zeros(product_of_sines(angles))
    assert found.size == 3
    assert min(np.max(distance(np.roll(found, turn), angles)) for turn in range(3)) <= (
        1e-14 / separation)


@pytest.mark.parametrize("separation", 10.0 ** -np.arange(7.0, 17.0))
def test_two_zeros_that_rounding_cannot_tell_apart_come_in_a_pair_or_not_at_all(separation):
    angles = np.array([0.3, 0.3 + separation, 2.0])
    found = zeros(product_of_sines(angles))
    assert found.size in (1, 3)
    assert np.min(distance(found, 2.0)) <= 1e-14


@pytest.mark.parametrize("angle", [0.0, 0.7, np.pi - 0.1, 3.0])
@pytest.mark.parametrize("multiplicity", [3, 5, 7])
def test_a_multiple_zero_is_one(angle, multiplicity):
    found = zeros(product_of_sines([angle] * multiplicity))
    assert found.size == 1
    assert distance(found[0], angle) <= (1e-15) ** (1.0 / multiplicity)


@pytest.mark.parametrize("sign", [1.0, -1.0])
@pytest.mark.parametrize("around", [0.0, -0.1, np.pi / 2, np.pi])
def test_a_zero_at_an_end_of_the_search_counts_once(sign, around):
    for step in range(-20, 21):
        angle = around + step * np.spacing(0.1)
        (found,) = zeros(sign * product_of_sines([angle]))
        assert 0.0 <= found < np.pi
        assert distance(found, angle) <= 1e-15


@pytest.mark.parametrize("value", [0.0, math.nan, math.inf])
def test_zeros_of_nothing_are_refused(value):
    with pytest.raises(ValueError, match="zeros of a sum that vanishes or is not finite"):
        zeros(np.array([value + 0.0j, 0.0j]))


@given(SEEDS, st.integers(1, 16))
def test_peaks_are_the_largest_values(seed, harmonics):
    rows = np.stack([random_sum(seed, harmonics), np.zeros(2 * harmonics)])
    sampled = np.max(np.abs(evaluate(rows[0], np.linspace(0.0, np.pi, 4000 * harmonics))))
    peak, rest = peaks(rows)
    assert rest == 0.0
    assert sampled <= peak * (1.0 + 1e-14)
    assert peak <= sampled * (1.0 + 1e-5)
