"""What is kept of a long recording."""

from __future__ import annotations

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from shimmy_ros.report.thinning import Envelope, Thinned


@given(st.integers(0, 2000), st.integers(1, 50))
def test_every_so_many_rows_are_kept(count, limit):
    thinned = Thinned(2, limit)
    for number in range(count):
        thinned.add(number, -number)
    table = thinned.table
    assert table.shape[1] == 2
    assert table[:, 0].tolist() == list(range(0, count, thinned.stride))
    assert (table[:, 1] == -table[:, 0]).all()
    assert len(table) <= 2 * limit
    assert count <= 2 * limit or len(table) >= limit


@given(st.lists(st.floats(-1.0, 1.0), max_size=1500), st.sampled_from([2, 8, 30]))
def test_an_envelope_keeps_the_extremes_of_its_stretches(values, limit):
    envelope = Envelope(limit)
    for number, value in enumerate(values):
        envelope.add(float(number), value)
    times, line = envelope.line
    assert times.size == line.size <= 2 * limit
    begins = times[::2].astype(int).tolist()
    assert begins == sorted(set(begins))
    assert len(values) <= limit or len(begins) >= limit // 2
    for number, begin in enumerate(begins):
        stretch = values[begin:[*begins, len(values)][number + 1]]
        assert line[2 * number:2 * number + 2].tolist() == [min(stretch), max(stretch)]


def test_an_empty_envelope_is_an_empty_line():
    times, line = Envelope().line
    assert times.shape == line.shape == (0,)
    assert Thinned(3).table.shape == (0, 3)
    assert np.array_equal(line, [])
