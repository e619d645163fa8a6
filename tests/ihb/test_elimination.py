"""Elimination in place against LAPACK."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from shimmy_ros.ihb import loops

SIZES = st.integers(1, 40)
NUMBERS = st.floats(-1.0, 1.0).map(lambda value: round(value, 6))


@settings(deadline=None)
@given(SIZES.flatmap(lambda size: st.tuples(arrays(float, (size, size), elements=NUMBERS),
                                            arrays(float, (size,), elements=NUMBERS))))
def test_solution_and_sign_are_those_of_the_library(pair):
    matrix, right = pair
    matrix = matrix + 1e-3 * np.eye(len(right))
    if np.linalg.cond(matrix) > 1e8:
        return
    solution = right.copy()
    sign = loops.eliminate(matrix.copy(), solution)
    assert sign == np.linalg.slogdet(matrix)[0]
    size = np.abs(matrix).sum(1) * np.abs(solution).max() + np.abs(right)
    assert np.all(np.abs(matrix @ solution - right) <= 1e-12 * size + 1e-300)


def test_rows_are_exchanged_where_a_pivot_vanishes():
    matrix, right = np.array([[0.0, 2.0], [1.0, 0.0]]), np.array([2.0, 3.0])
    assert loops.eliminate(matrix, right) == -1.0
    np.testing.assert_array_equal(right, [3.0, 1.0])


def test_a_singular_matrix_is_refused():
    with pytest.raises(np.linalg.LinAlgError):
        loops.eliminate(np.ones((3, 3)), np.ones(3))
