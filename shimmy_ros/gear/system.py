"""The gear as an odd autonomous system, eqs. (27)-(32), and families of it between two points."""

from __future__ import annotations

from dataclasses import dataclass, fields
from functools import lru_cache
from types import SimpleNamespace
from typing import cast

from ..ihb.elements import Coulomb, Element, QuadraticDamping
from ..ihb.system import Family, System
from .matrices import DAMPER, SWIVEL, Matrix, velocity_parts
from .parameters import Damper, Gear

# The matrices are analytic in every parameter, so that a complex step has no truncation error.
_COMPLEX_STEP = 1e-100


@dataclass(frozen=True)
class OperatingPoint:
    """All that a limit cycle depends on: gear, damper, and taxi ``velocity`` V > 0 [m/s]."""

    gear: Gear
    damper: Damper
    velocity: float


@lru_cache(maxsize=16)
def gear_system(point: OperatingPoint) -> System:
    """The system at an operating point, coordinates (strut tilt, swivel, damper, tyre lateral).

    SI. An element of no strength is left out.
    """
    damper, velocity = point.damper, point.velocity
    parts = _velocity_parts(point.gear)
    return System(
        parts.mass, parts.damping(damper.linear_damping, velocity), parts.stiffness(velocity),
        _elements(damper.coulomb_torque, damper.quadratic_damping,
                  damper.coulomb_torque > 0.0, damper.quadratic_damping > 0.0))


def family_between(start: OperatingPoint, end: OperatingPoint) -> Family:
    """Systems on the straight line of parameters from ``start`` (0) to ``end`` (1)."""
    has_coulomb = max(start.damper.coulomb_torque, end.damper.coulomb_torque) > 0.0
    has_quadratic = max(start.damper.quadratic_damping, end.damper.quadratic_damping) > 0.0
    first, last = _values(start), _values(end)
    change = {name: last[name] - first[name] for name in first}
    fixed = _velocity_parts(start.gear) if start.gear == end.gear else None

    def matrices(position: complex) -> tuple[Matrix, Matrix, Matrix]:
        value = {name: first[name] + position * change[name] for name in first}
        parts = fixed or velocity_parts(cast(Gear, SimpleNamespace(**value)))
        velocity = cast(float, value["velocity"])
        return (parts.mass, parts.damping(cast(float, value["linear_damping"]), velocity),
                parts.stiffness(velocity))

    def at(position: float) -> System:
        return System(*matrices(position), _elements(
            first["coulomb_torque"] + position * change["coulomb_torque"],
            first["quadratic_damping"] + position * change["quadratic_damping"],
            has_coulomb, has_quadratic))

    def derivative(position: float) -> System:
        mass, damping, stiffness = (matrix.imag / _COMPLEX_STEP for matrix in matrices(
            position + 1j * _COMPLEX_STEP))
        return System(mass, damping, stiffness,
                      _elements(change["coulomb_torque"], change["quadratic_damping"],
                                has_coulomb, has_quadratic))

    return Family(at, derivative)


# The matrices of a gear in use are asked for at every velocity.
_velocity_parts = lru_cache(maxsize=16)(velocity_parts)


def _values(point: OperatingPoint) -> dict[str, float]:
    values = {item.name: getattr(point.gear, item.name) for item in fields(Gear)}
    values |= {item.name: getattr(point.damper, item.name) for item in fields(Damper)}
    return values | {"velocity": point.velocity}


@lru_cache(maxsize=16)
def _elements(coulomb_torque: float, quadratic_damping: float,
              has_coulomb: bool, has_quadratic: bool) -> tuple[Element, ...]:
    elements: list[Element] = []
    if has_coulomb:
        elements.append(Coulomb(SWIVEL, coulomb_torque))
    if has_quadratic:
        elements.append(QuadraticDamping(DAMPER, quadratic_damping))
    return tuple(elements)
