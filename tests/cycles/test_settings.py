"""Settings: their ranges, and that what is refused is refused by name."""

import math

import numpy as np
import pytest

from shimmy_ros.cycles.settings import METHODS, Settings, check_harmonics
from shimmy_ros.gear.parameters import Limits, ParameterError


def test_the_defaults_are_what_is_documented():
    settings = Settings()
    assert (settings.harmonics, settings.accuracy, settings.method) == (4, 0.01, "auto")
    assert (settings.minimum_velocity, settings.budget) == (1.0, 1.0)
    assert settings.limits == Limits()
    assert METHODS == ("auto", "ihb", "shooting")


def test_numbers_become_floats_and_settings_compare_and_have_a_hash():
    settings = Settings(np.int64(8), np.float64(0.001), "ihb", 2, Limits(0.4, 0.3, 0.2), 3)
    assert [type(value) for value in (settings.harmonics, settings.accuracy,
                                      settings.minimum_velocity, settings.budget)] == [
        int, float, float, float]
    same = Settings(8, 0.001, "ihb", 2.0, Limits(0.4, 0.3, 0.2), 3.0)
    assert settings == same
    assert hash(settings) == hash(same)
    assert settings != Settings(8, 0.001, "ihb", 2.0, Limits(0.4, 0.3, 0.25), 3.0)


@pytest.mark.parametrize("harmonics", [0, -1, 65, math.nan, True, "4", None])
def test_bad_numbers_of_harmonics_are_refused(harmonics):
    with pytest.raises(ParameterError, match=r"harmonics is .*, but must be .*\[1, 64\]"):
        Settings(harmonics)


def test_harmonics_are_whole():
    assert check_harmonics(np.int64(3)) == 3
    assert Settings(5.0).harmonics == 5
    with pytest.raises(ParameterError, match=r"harmonics is 2\.5, but must be a whole number"):
        check_harmonics(2.5)


@pytest.mark.parametrize(("name", "values", "range_"), [
    ("minimum_velocity", [0.0, -1.0, 50.1, math.nan, "1"], r"\[0\.01, 50\] m/s"),
    ("accuracy", [0.0, -1.0, 0.51, math.nan, "1", None], r"\[1e-09, 0\.5\]"),
    ("budget", [0.0, 1e-4, 1001.0, math.inf, True], r"\[0\.001, 1000\] s")])
def test_values_outside_their_range_are_refused_by_name(name, values, range_):
    for value in values:
        with pytest.raises(ParameterError, match=rf"^{name} is .*, but must be .*{range_}$"):
            Settings(**{name: value})


@pytest.mark.parametrize(("name", "ends"), [
    ("harmonics", (1, 64)), ("accuracy", (1e-9, 0.5)), ("minimum_velocity", (0.01, 50.0)),
    ("budget", (0.001, 1000.0))])
def test_the_ends_of_a_range_are_in_it(name, ends):
    for end in ends:
        assert getattr(Settings(**{name: end}), name) == end


@pytest.mark.parametrize("method", ["", "AUTO", "newton", None, 1])
def test_an_unknown_method_is_refused(method):
    with pytest.raises(ParameterError, match=r"method is .*, but must be one of auto, ihb, shoot"):
        Settings(method=method)
