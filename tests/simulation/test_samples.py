from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from shimmy_ros.gear.parameters import ParameterError
from shimmy_ros.simulation.samples import sample_grid


@given(st.floats(-100.0, 1e6), st.lists(st.floats(0.0, 1.0), min_size=1, max_size=20),
       st.sampled_from([0.002, 0.01, 1 / 3, 0.1]))
def test_grids_follow_each_other_without_gap_or_overlap(start, durations, period):
    ends = start + np.cumsum([0.0, *durations])
    times = np.concatenate([sample_grid(first, last, period)
                            for first, last in pairwise(ends)])
    np.testing.assert_array_equal(times, sample_grid(start, ends[-1], period))
    assert ((times > start) & (times <= ends[-1])).all()
    counts = np.rint(times / period)
    np.testing.assert_array_equal(times, counts * period)
    np.testing.assert_array_equal(np.diff(counts), 1.0)
    assert len(times) == pytest.approx((ends[-1] - start) / period, abs=1.0 + 1e-6)


@pytest.mark.parametrize("period", [0.0, -1.0, np.nan, np.inf])
def test_a_period_that_is_not_positive_is_refused(period):
    with pytest.raises(ParameterError, match=r"period is .*, but must be in"):
        sample_grid(0.0, 1.0, period)
