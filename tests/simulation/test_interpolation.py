import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from shimmy_ros.simulation.interpolation import Cubic, first_exit, hermite

NUMBERS = st.floats(-3.0, 3.0)
CUBICS = st.builds(Cubic, NUMBERS, NUMBERS, NUMBERS, NUMBERS)
FINE = np.linspace(0.0, 1.0, 4001)


def values(cubic, at=FINE):
    return hermite(at, 1.0, cubic.start, cubic.start_slope, cubic.end, cubic.end_slope)


@given(st.lists(st.floats(-2.0, 2.0), min_size=4, max_size=4), st.floats(0.1, 5.0),
       st.floats(0.0, 1.0))
def test_a_cubic_is_reproduced(coefficients, length, fraction):
    polynomial = np.polynomial.Polynomial(coefficients)
    slope = polynomial.deriv()
    ends = (polynomial(0.0), slope(0.0), polynomial(length), slope(length))
    expected = polynomial(fraction * length)
    assert hermite(fraction, length, *ends) == pytest.approx(expected, abs=1e-11)
    scaled = Cubic(ends[0], length * ends[1], ends[2], length * ends[3])
    assert scaled.value(fraction) == pytest.approx(expected, abs=1e-11)


@given(st.floats(-1e3, 1e3), st.floats(0.0, 1.0), st.floats(1e-6, 1.0))
def test_what_stands_still_is_interpolated_without_rounding(value, fraction, length):
    assert hermite(fraction, length, value, 0.0, value, 0.0) == value


@given(CUBICS)
def test_turning_points_bound_the_cubic(cubic):
    points = cubic.turning_points()
    assert points == sorted(points)
    extremes = [cubic.start, cubic.end, *(cubic.value(at) for at in points)]
    sampled = values(cubic)
    assert sampled.max() == pytest.approx(max(extremes), abs=1e-5)
    assert sampled.min() == pytest.approx(min(extremes), abs=1e-5)


@given(CUBICS, st.floats(-2.0, 0.0), st.floats(0.0, 2.0))
def test_the_first_exit_is_the_first(cubic, low, high):
    cubic = cubic._replace(start=min(max(cubic.start, low), high))
    sampled = values(cubic)
    outside = np.flatnonzero((sampled < low) | (sampled > high))
    at = first_exit(cubic, low, high)
    if at is None:
        assert sampled.min() >= low - 1e-12
        assert sampled.max() <= high + 1e-12
        return
    assert 0.0 <= at <= 1.0
    before = values(cubic, at * FINE)
    assert before.min() >= low - 1e-9
    assert before.max() <= high + 1e-9
    assert min(abs(cubic.value(at) - low), abs(cubic.value(at) - high)) < 1e-9
    if outside.size:
        assert at <= FINE[outside[0]] + 1e-12


def test_leaving_a_bound_on_which_it_starts():
    assert first_exit(Cubic(0.0, 1.0, 1.0, 1.0), 0.0, np.inf) is None
    assert first_exit(Cubic(0.0, -1.0, -1.0, -1.0), 0.0, np.inf) == 0.0
    assert first_exit(Cubic(0.0, 1.0, 0.0, -1.0), 0.0, 0.1) == pytest.approx(
        0.5 - np.sqrt(0.15), abs=1e-12)
    assert first_exit(Cubic(0.0, 1.0, -1.0, -1.0), 0.0, np.inf) == pytest.approx(
        1.0 - np.sqrt(0.5), abs=1e-12)


@given(CUBICS, st.floats(-2.0, 2.0))
def test_a_crossing_lies_on_the_level(cubic, level):
    cubic = cubic._replace(start=min(cubic.start, level - 0.1), end=max(cubic.end, level + 0.1))
    assert cubic.value(cubic.crossing(level)) == pytest.approx(level, abs=1e-9)


@pytest.mark.parametrize(("start", "end", "expected"), [
    (-1.0, 0.0, 1.0), (1.0, 0.0, 1.0), (0.0, 1.0, 0.0), (0.0, 0.0, 0.0)])
def test_an_end_on_the_level_is_the_crossing(start, end, expected):
    assert Cubic(start, end - start, end, end - start).crossing(0.0) == expected
