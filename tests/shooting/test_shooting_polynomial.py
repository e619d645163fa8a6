import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from shimmy_ros.shooting.polynomial import first_descent, roots

SEPARATED = st.lists(st.integers(1, 19), min_size=0, max_size=5, unique=True).map(
    lambda places: sorted(place / 20.0 for place in places))
PAIRS = st.lists(st.tuples(st.floats(0.0, 1.0), st.floats(0.3, 2.0)), max_size=3)


def product(real: list[float], pairs: list[tuple[float, float]]) -> np.ndarray:
    """Ascending coefficients of the polynomial with these real and complex roots."""
    total = np.ones(1)
    for root in real:
        total = np.convolve(total, [-root, 1.0])
    for centre, height in pairs:
        total = np.convolve(total, [centre**2 + height**2, -2.0 * centre, 1.0])
    return total


@given(SEPARATED, PAIRS)
def test_all_roots_within_the_interval_are_found_and_no_others(real, pairs):
    found = roots(product([-0.5, *real, 1.5], pairs))
    assert found.tolist() == pytest.approx(real, abs=1e-6)


@given(SEPARATED, PAIRS)
def test_first_descent_is_the_first_root_of_a_polynomial_that_starts_positive(real, pairs):
    coefficients = product(real, pairs)
    first = first_descent(np.sign(coefficients[0]) * coefficients)
    assert first == (pytest.approx(real[0], abs=1e-6) if real else np.inf)


@pytest.mark.parametrize(("coefficients", "expected"), [
    ([0.0, 1.0, -4.0], 0.25),
    ([0.0, 0.0, 1.0], np.inf),
    ([0.0, -1.0, 4.0], 0.0),
    ([-1e-17, 1.0, -2.0], 0.5),
    ([0.0, 0.0, 0.0], np.inf),
    ([1.0, -1.0], 1.0),
])
def test_first_descent_after_contact(coefficients, expected):
    assert first_descent(np.array(coefficients)) == pytest.approx(expected, abs=1e-15)


def test_a_root_without_change_of_sign_and_one_at_zero_do_not_count():
    assert roots(product([0.0, 0.75, 0.75], [])).size == 0
    assert roots(np.zeros(5)).size == 0


def test_two_roots_close_together_are_both_found():
    assert roots(product([0.3, 0.3 + 1e-6], [])) == pytest.approx([0.3, 0.3 + 1e-6], abs=1e-9)
