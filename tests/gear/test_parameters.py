import math
from dataclasses import asdict, fields

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from shimmy_ros.gear.parameter_file import reference_parameters
from shimmy_ros.gear.parameters import (
    Damper,
    Gear,
    Limits,
    ParameterError,
    Range,
    changed,
    from_mapping,
    ranges,
)

GEAR, DAMPER = reference_parameters()
KINDS = {"gear": (Gear, GEAR), "damper": (Damper, DAMPER), "limits": (Limits, Limits())}
NAMES = [(group, item.name) for group, (kind, _) in KINDS.items() for item in fields(kind)]


def test_names_are_those_of_the_parameter_file():
    assert [name for group, name in NAMES if group == "gear"] == [
        "strut_inertia", "wheel_mass", "trunnion_to_axle", "trail", "swivel_inertia",
        "wheel_polar_inertia", "wheel_radius", "damper_inertia", "strut_tilt_stiffness",
        "damper_linkage_stiffness", "strut_rake", "tyre_lateral_stiffness",
        "tyre_torsional_stiffness", "rolling_alpha", "rolling_beta", "rolling_gamma"]
    assert [name for group, name in NAMES if group == "damper"] == [
        "linear_damping", "quadratic_damping", "coulomb_torque"]
    assert [name for group, name in NAMES if group == "limits"] == [
        "swivel", "strut_tilt", "tyre_deflection"]


def test_the_limits_have_defaults():
    assert asdict(Limits()) == {"swivel": 0.5, "strut_tilt": 0.2, "tyre_deflection": 0.3}


@pytest.mark.parametrize("name", ["swivel", "strut_tilt", "tyre_deflection"])
@pytest.mark.parametrize("bad", [0.0, -0.1, 10.1])
def test_a_limit_is_positive_and_no_licence(name, bad):
    with pytest.raises(ParameterError, match=rf"limits\.{name} is .*, but must be in \[1e-06, "):
        changed(Limits(), **{name: bad})


@pytest.mark.parametrize(("group", "name"), NAMES)
@pytest.mark.parametrize("bad", [math.nan, math.inf, -math.inf, 1e13, -1e13, 10**400, -10**400,
                                 "1", None, True, [1.0], 1j])
def test_a_bad_value_is_refused_with_field_value_and_range(group, name, bad):
    kind, good = KINDS[group]
    with pytest.raises(ParameterError) as refusal:
        from_mapping(kind, {**asdict(good), name: bad})
    text = str(refusal.value)
    assert text.startswith(f"{group}.{name} is ")
    assert text.endswith(ranges(kind)[name].describe())


@pytest.mark.parametrize("name", [
    "strut_inertia", "wheel_mass", "trunnion_to_axle", "swivel_inertia", "wheel_polar_inertia",
    "wheel_radius", "damper_inertia", "strut_tilt_stiffness", "damper_linkage_stiffness",
    "tyre_lateral_stiffness", "tyre_torsional_stiffness", "rolling_beta"])
@pytest.mark.parametrize("bad", [0.0, -0.0, -1.0, 1e-300])
def test_what_has_to_be_positive_is_neither_zero_nor_next_to_it(name, bad):
    with pytest.raises(ParameterError, match=rf"gear\.{name} is .*, but must be in \[1e-06, "):
        changed(GEAR, **{name: bad})


@pytest.mark.parametrize("name", ["linear_damping", "quadratic_damping", "coulomb_torque"])
def test_a_damper_may_be_absent_but_not_negative(name):
    assert getattr(changed(DAMPER, **{name: 0}), name) == 0.0
    with pytest.raises(ParameterError, match=rf"damper\.{name} is -1e-09"):
        changed(DAMPER, **{name: -1e-9})


def test_a_mass_matrix_that_is_not_positive_definite_is_refused():
    limit = math.sqrt(GEAR.strut_inertia * GEAR.swivel_inertia)
    heavy = limit / (GEAR.trunnion_to_axle * GEAR.trail)
    changed(GEAR, wheel_mass=0.999 * heavy)
    for trail in (GEAR.trail, -GEAR.trail):
        with pytest.raises(ParameterError, match="mass matrix is positive definite only if"):
            changed(GEAR, wheel_mass=1.001 * heavy, trail=trail)


@given(st.floats(1e-3, 1e3), st.floats(1e-3, 1e3), st.floats(1e-3, 4.0))
def test_whatever_gear_is_accepted_has_an_invertible_mass_matrix(strut, swivel, trail):
    mass = math.sqrt(strut * swivel) / trail
    for factor in (1.0 - 2e-16, 1.0, 1.0 + 2e-16):
        try:
            gear = changed(GEAR, strut_inertia=strut, swivel_inertia=swivel, trail=trail,
                           trunnion_to_axle=1.0, wheel_mass=mass * factor)
        except ParameterError:
            continue
        coupling = gear.wheel_mass * gear.trunnion_to_axle * gear.trail
        assert gear.strut_inertia * gear.swivel_inertia - coupling * coupling > 0.0


def test_unknown_and_missing_names_are_refused_by_name():
    with pytest.raises(ParameterError, match=r"gear\.mass is not a parameter; the known ones are "):
        from_mapping(Gear, {**asdict(GEAR), "mass": 1.0})
    values = asdict(GEAR)
    del values["trail"]
    with pytest.raises(ParameterError, match=r"gear\.trail is missing; it must be in \[-5, 5\] m"):
        from_mapping(Gear, values)


@given(st.floats(allow_nan=True, allow_infinity=True))
def test_a_range_accepts_exactly_what_lies_in_it(value):
    allowed = Range("m", "somewhere", -2.0, 3.0)
    if -2.0 <= value <= 3.0:
        assert allowed.check("place", value) == value
    else:
        with pytest.raises(ParameterError, match=r"place is .*, but must be in \[-2, 3\] m"):
            allowed.check("place", value)


@pytest.mark.parametrize("value", [2, np.float64(2.0), np.int64(2), np.float32(2.0)])
def test_every_kind_of_real_number_becomes_a_float(value):
    checked = Range("m", "somewhere", 0.0, 3.0).check("place", value)
    assert checked == 2.0
    assert type(checked) is float
