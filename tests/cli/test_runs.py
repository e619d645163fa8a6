"""Velocity histories from CSV files."""

from __future__ import annotations

import math
from itertools import pairwise

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from shimmy_ros.cli.runs import COLUMNS, Run, bundled_run, read_run, synthetic_run
from shimmy_ros.gear.parameters import ParameterError

HEADER = ",".join(COLUMNS)
SHARED_FOLDER = settings(suppress_health_check=[HealthCheck.function_scoped_fixture],
                         deadline=None)


def write(path, *lines):
    path.write_text("\n".join([HEADER, *lines]) + "\n")
    return path


def test_a_file_is_read_from_time_zero(tmp_path):
    run = read_run(write(tmp_path / "braking.csv", "10.5,30", "10.75,29.5", "11,0"))
    assert run == Run("braking", (0.0, 0.25, 0.5), (30.0, 29.5, 0.0))


def test_other_columns_blank_lines_and_a_byte_order_mark_do_not_matter(tmp_path):
    file = tmp_path / "excel.csv"
    file.write_bytes(
        "\ufefftime_s,note,taxi_velocity_m_per_s\r\n 1, a ,30\r\n\r\n2,b,31\r\n".encode())
    assert read_run(file) == Run("excel", (0.0, 1.0), (30.0, 31.0))


@pytest.mark.parametrize("name", ["landing_EDW229", "takeoff_SWR137H"])
def test_the_bundled_runs(name):
    run = read_run(bundled_run(name))
    assert run.name == name
    assert run.time[0] == 0.0
    assert run.time[-1] > 100.0
    assert all(early < late for early, late in pairwise(run.time))
    assert max(run.velocity) > 60.0


def test_the_synthetic_run_goes_up_and_down():
    run = synthetic_run()
    assert run.velocity[0] == pytest.approx(10.0)
    assert max(run.velocity) == pytest.approx(100.0)
    assert run.velocity[-1] == pytest.approx(10.0)
    assert {round(late - early, 9) for early, late in pairwise(run.time)} == {0.1}


@pytest.mark.parametrize(("lines", "words"), [
    ([], ["0 samples", "at least 2"]),
    (["0,30"], ["1 samples", "at least 2"]),
    (["0,30", "0,31"], ["line 3", "time_s is 0", "greater than 0"]),
    (["1,30", "0.5,31"], ["line 3", "time_s is 0.5", "greater than 1"]),
    (["0,30", "1,fast"], ["line 3", "taxi_velocity_m_per_s is 'fast'", "finite number"]),
    (["0,30", "1,nan"], ["line 3", "'nan'", "finite number"]),
    (["0,30", "1,-0.5"], ["line 3", "taxi_velocity_m_per_s is -0.5", "[0, 200] m/s"]),
    (["0,30", "1,1e9"], ["line 3", "1e+09", "[0, 200] m/s"]),
    (["0,30", "", "inf,31"], ["line 4", "time_s is 'inf'", "finite number"]),
    (["0,30", "1"], ["line 3", "taxi_velocity_m_per_s", "missing"]),
])
def test_bad_lines_are_named(tmp_path, lines, words):
    file = write(tmp_path / "bad.csv", *lines)
    with pytest.raises(ParameterError) as raised:
        read_run(file)
    assert all(word in str(raised.value) for word in [str(file), *words]), raised.value


def test_a_file_without_the_columns(tmp_path):
    file = tmp_path / "other.csv"
    file.write_text("t,v\n0,1\n1,2\n")
    with pytest.raises(ParameterError, match="column time_s is missing; a run has time_s, taxi_"):
        read_run(file)


@pytest.mark.parametrize("content", [b"\xff\xfe\x00\x01", None, ""])
def test_files_that_cannot_be_read(tmp_path, content):
    file = tmp_path / "bad.csv"
    if content == "":
        file.mkdir()
    elif content is not None:
        file.write_bytes(content)
    with pytest.raises(ParameterError, match="cannot be read"):
        read_run(file)


@SHARED_FOLDER
@given(st.binary(max_size=300))
def test_any_bytes_are_a_run_or_refused(tmp_path, content):
    file = tmp_path / "any.csv"
    file.write_bytes(content)
    with pytest.raises(ParameterError, match=r"any\.csv"):
        read_run(file)


CELLS = st.one_of(
    st.floats().map(repr), st.integers(-10, 300).map(str), st.text(max_size=5),
    st.sampled_from(["", " ", "1e400", "0x10", "1_0", "\"", "\"a\nb\"", ",", "\x00", "-0"]))


@SHARED_FOLDER
@given(st.lists(st.lists(CELLS, max_size=4), max_size=5), st.booleans())
def test_any_table_is_a_sound_run_or_refused(tmp_path, rows, with_header):
    file = tmp_path / "any.csv"
    lines = [HEADER] * with_header + [",".join(row) for row in rows]
    file.write_text("\n".join(lines), encoding="utf-8", errors="surrogatepass")
    refusal = ""
    try:
        run = read_run(file)
    except ParameterError as error:
        refusal = str(error)
    if refusal:
        assert "any.csv" in refusal
        assert "\n" not in refusal
        return
    assert len(run.time) == len(run.velocity) >= 2
    assert run.time[0] == 0.0
    assert all(early < late for early, late in pairwise(run.time))
    assert all(math.isfinite(time) for time in run.time)
    assert all(0.0 <= velocity <= 200.0 for velocity in run.velocity)


@settings(deadline=None)
@given(st.lists(st.tuples(st.floats(1e-3, 10.0), st.floats(0.0, 200.0)), min_size=2, max_size=20),
       st.floats(-50.0, 250.0), st.floats(-50.0, 250.0))
def test_a_stretch_keeps_its_samples(steps, start, end):
    times = []
    for step, _ in steps:
        times.append((times[-1] if times else 0.0) + step * bool(times))
    run = Run("run", tuple(times), tuple(velocity for _, velocity in steps))
    inside = [index for index, time in enumerate(times) if start <= time <= end]
    if len(inside) < 2:
        with pytest.raises(ParameterError, match="leaves no stretch of run run"):
            run.between(start, end)
        return
    part = run.between(start, end)
    assert part.velocity == tuple(run.velocity[index] for index in inside)
    assert part.time[0] == 0.0
    assert part.time == pytest.approx(tuple(times[index] - times[inside[0]] for index in inside))
