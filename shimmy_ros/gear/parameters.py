"""The gear's and the damper's physical parameters, and the model's limits: names, units, checks."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field, fields, replace
from typing import Any, TypeVar

import numpy as np


class ParameterError(ValueError):
    """A parameter that is missing, unknown or outside its allowed range."""


@dataclass(frozen=True)
class Range:
    """The allowed values of one parameter, both bounds included, its SI unit and its meaning."""

    unit: str
    meaning: str
    low: float
    high: float

    def describe(self) -> str:
        """The allowed range in words, with the unit unless that is 1."""
        unit = "" if self.unit == "1" else f" {self.unit}"
        return f"[{self.low:g}, {self.high:g}]{unit}"

    def check(self, name: str, value: object) -> float:
        """Return ``value`` as a float, or raise ParameterError that names field, value, range."""
        if isinstance(value, bool) or not isinstance(value, (int, float, np.floating, np.integer)):
            raise ParameterError(f"{name} is {value!r}, but must be a number in {self.describe()}")
        try:
            number = float(value)
        except OverflowError:
            number = math.inf if value > 0 else -math.inf
        if not (math.isfinite(number) and self.low <= number <= self.high):
            raise ParameterError(f"{name} is {number:g}, but must be in {self.describe()}")
        return number


HALF_TURN = math.pi
"""An angle [rad] of swivel, tilt or damper beyond which nothing is left of the linear model."""

# Of what has to be positive. Quotients of far smaller numbers leave floating-point range.
SMALLEST_POSITIVE = 1e-6


def _parameter(range_: Range) -> Any:
    return field(metadata={"range": range_})


def _positive(unit: str, meaning: str, high: float) -> Any:
    return _parameter(Range(unit, meaning, SMALLEST_POSITIVE, high))


def _non_negative(unit: str, meaning: str, high: float) -> Any:
    return _parameter(Range(unit, meaning, 0.0, high))


def _limit(default: float, unit: str, meaning: str, high: float) -> Any:
    return field(default=default,
                 metadata={"range": Range(unit, meaning, SMALLEST_POSITIVE, high)})


@dataclass(frozen=True)
class Gear:
    """The landing gear of Zhou & Zhang 2005, eqs. (27)-(30), with Keldysh's tyre; SI units."""

    strut_inertia: float = _positive("kg m^2", "I_LG, landing gear about its trunnion", 1e6)
    wheel_mass: float = _positive("kg", "m, wheel", 1e5)
    trunnion_to_axle: float = _positive("m", "H, trunnion to axle", 20.0)
    trail: float = _parameter(Range("m", "t, trail of the axle", -5.0, 5.0))
    swivel_inertia: float = _positive("kg m^2", "I, wheel about the strut axis", 1e6)
    wheel_polar_inertia: float = _positive("kg m^2", "I_wp, wheel about its axle", 1e6)
    wheel_radius: float = _positive("m", "r, wheel", 5.0)
    damper_inertia: float = _positive("kg m^2", "I_beta, shimmy damper", 1e5)
    strut_tilt_stiffness: float = _positive("N m/rad", "K_s, lateral tilt of the strut", 1e12)
    damper_linkage_stiffness: float = _positive("N m/rad", "K_t, damper linkage", 1e12)
    strut_rake: float = _parameter(
        Range("rad", "k, strut's lower end forward of its trunnion", -1.0, 1.0)
    )
    tyre_lateral_stiffness: float = _positive("N/m", "a, tyre", 1e12)
    tyre_torsional_stiffness: float = _positive("N m/rad", "b, tyre", 1e12)
    rolling_alpha: float = _non_negative("1/m^2", "alpha, Keldysh's rolling coefficient", 1e5)
    rolling_beta: float = _positive("1/m", "beta, Keldysh's rolling coefficient", 1e5)
    rolling_gamma: float = _parameter(
        Range("1/m", "gamma, Keldysh's rolling coefficient", -1e5, 1e5)
    )

    def __post_init__(self) -> None:
        _check_fields(self, "gear")
        coupling = self.wheel_mass * self.trunnion_to_axle * self.trail
        if coupling * coupling >= self.strut_inertia * self.swivel_inertia:
            limit = math.sqrt(self.strut_inertia * self.swivel_inertia)
            raise ParameterError(
                f"gear.wheel_mass * gear.trunnion_to_axle * gear.trail is {coupling:g} kg m^2, but "
                "the mass matrix is positive definite only if its magnitude is below "
                f"sqrt(gear.strut_inertia * gear.swivel_inertia) = {limit:g} kg m^2"
            )


@dataclass(frozen=True)
class Damper:
    """The shimmy damper and the Coulomb friction of the swivel; SI units."""

    linear_damping: float = _non_negative("N m s/rad", "C_t, linear damping", 1e6)
    quadratic_damping: float = _non_negative("N m s^2/rad^2", "C_d, velocity-squared damping", 1e6)
    coulomb_torque: float = _non_negative("N m", "T_CF, Coulomb friction of the swivel", 1e6)

    def __post_init__(self) -> None:
        _check_fields(self, "damper")


@dataclass(frozen=True)
class Limits:
    """How far the gear may move for the model's linear geometry and tyre to describe it."""

    swivel: float = _limit(0.5, "rad", "largest swivel angle", HALF_TURN)
    strut_tilt: float = _limit(0.2, "rad", "largest strut tilt", HALF_TURN)
    tyre_deflection: float = _limit(
        0.3, "1", "largest lateral deflection of the tyre, in radii of the wheel", 10.0)

    def __post_init__(self) -> None:
        _check_fields(self, "limits")


Parameters = TypeVar("Parameters", Gear, Damper, Limits)

VELOCITY_RANGE = Range("m/s", "taxi velocity", 0.0, 200.0)
# Below this the tyre creeps rather than rolls, and the rolling law of eq. (30) does not hold.
MINIMUM_VELOCITY_RANGE = Range("m/s", "velocity below which the tyre is taken not to roll",
                               0.01, 50.0)
DEFAULT_MINIMUM_VELOCITY = 1.0


def ranges(kind: type[Gear] | type[Damper] | type[Limits]) -> dict[str, Range]:
    """Every parameter of ``kind`` with its range, by its name in the parameter file."""
    return {item.name: item.metadata["range"] for item in fields(kind)}


def from_mapping(kind: type[Parameters], values: Mapping[str, object]) -> Parameters:
    """Build ``kind`` from names and numbers; unknown and missing names are refused by name.

    Raises ParameterError.
    """
    group = kind.__name__.lower()
    known = ranges(kind)
    for name in values:
        if name not in known:
            raise ParameterError(
                f"{group}.{name} is not a parameter; the known ones are {', '.join(known)}"
            )
    for name, range_ in known.items():
        if name not in values:
            raise ParameterError(f"{group}.{name} is missing; it must be in {range_.describe()}")
    return kind(**{name: range_.check(f"{group}.{name}", values[name])
                   for name, range_ in known.items()})


def changed(parameters: Parameters, **values: float) -> Parameters:
    """``parameters`` with some of them changed and all of them checked again."""
    return replace(parameters, **values)


def _check_fields(parameters: Gear | Damper | Limits, group: str) -> None:
    for name, range_ in ranges(type(parameters)).items():
        object.__setattr__(parameters, name,
                           range_.check(f"{group}.{name}", getattr(parameters, name)))
