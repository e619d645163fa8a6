"""The maximum over an interval: smooth, kinked, at an end; in slices and with few evaluations."""

from __future__ import annotations

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from shimmy_ros.what_if.maximum import maximum


def located(function, low, high, tolerance=1e-6):
    """Where the maximum is, and how often the function was asked."""
    asked = []

    def sliced(place):
        assert low <= place <= high
        asked.append(place)
        yield
        return function(place)

    work = maximum(sliced, low, high, tolerance)
    while True:
        try:
            assert next(work) is None
        except StopIteration as stop:
            return stop.value, len(asked)


@pytest.mark.parametrize(("function", "low", "high", "expected", "most"), [
    (lambda x: -((x - 0.3) ** 2), 0.0, 1.0, 0.3, 12),
    (math.sin, 0.0, 3.0, 0.5 * math.pi, 20),
    (lambda x: x * math.exp(-x), 0.0, 30.0, 1.0, 40),
    (lambda x: -abs(x - 0.7123), 0.0, 1.0, 0.7123, 40),
    (lambda x: -max(3.0 * (x - 0.4), 0.1 * (0.4 - x)), 0.0, 1.0, 0.4, 40),
    (lambda x: x, -2.0, 5.0, 5.0, 45),
    (lambda x: -x, -2.0, 5.0, -2.0, 45),
    (lambda x: -(x**4), -1.0, 2.0, 0.0, 45),
])
def test_it_is_found(function, low, high, expected, most):
    place, count = located(function, low, high)
    assert place == pytest.approx(expected, abs=1e-3 if expected == 0.0 else 5e-6)
    assert count <= most


@given(st.floats(-10.0, 10.0), st.floats(0.1, 10.0), st.floats(0.1, 100.0))
def test_a_parabola_is_found_wherever_it_is(vertex, width, scale):
    place, _ = located(lambda x: -scale * (x - vertex) ** 2, 0.0, width, 1e-7 * width)
    assert place == pytest.approx(min(max(vertex, 0.0), width), abs=1e-5 * width)


def test_a_flat_function_has_it_anywhere():
    place, _ = located(lambda x: 1.0, 0.0, 1.0)
    assert 0.0 <= place <= 1.0
