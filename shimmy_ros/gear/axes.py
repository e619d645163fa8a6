"""Single parameters by name, as axes along which operating points vary."""

from __future__ import annotations

from dataclasses import dataclass, replace

from ..ihb.elements import Coulomb, Element, QuadraticDamping
from ..ihb.system import System
from .parameters import VELOCITY_RANGE, Damper, Gear, ParameterError, Range, ranges
from .system import OperatingPoint, family_between

VELOCITY = "taxi_velocity"
# The rolling law divides by the velocity.
_ROLLING_RANGE = Range("m/s", VELOCITY_RANGE.meaning, 0.01, VELOCITY_RANGE.high)


@dataclass(frozen=True)
class Axis:
    """One parameter of an operating point, by its name: taxi_velocity, damper.* or gear.*."""

    name: str

    def __post_init__(self) -> None:
        if self.name not in axis_names():
            raise ParameterError(f"{self.name!r} is not a parameter; the known ones are "
                                 f"{', '.join(axis_names())}")

    @property
    def range(self) -> Range:
        """The allowed values, the unit and the meaning."""
        if self.name == VELOCITY:
            return _ROLLING_RANGE
        return ranges(Gear if self._group == "gear" else Damper)[self._field]

    @property
    def label(self) -> str:
        """Name and unit, as a picture's axis has it."""
        return f"{self._field.replace('_', ' ')} [{self.range.unit}]"

    def value(self, point: OperatingPoint) -> float:
        """The parameter's value at ``point``."""
        if self.name == VELOCITY:
            return point.velocity
        return float(getattr(getattr(point, self._group), self._field))

    def at(self, point: OperatingPoint, value: float) -> OperatingPoint:
        """``point`` with the parameter at ``value``. Raises ParameterError."""
        number = self.range.check(self.name, value)
        if self.name == VELOCITY:
            return replace(point, velocity=number)
        if self._group == "gear":
            return replace(point, gear=replace(point.gear, **{self._field: number}))
        return replace(point, damper=replace(point.damper, **{self._field: number}))

    def rate(self, point: OperatingPoint) -> System:
        """The derivative of the system by the parameter at ``point``. Raises ParameterError."""
        value, allowed = self.value(point), self.range
        width = 1e-3 * max(abs(value), 1e-3 * (allowed.high - allowed.low))
        if value + width > allowed.high:
            width = -width
        rate = family_between(point, self.at(point, value + width)).derivative(0.0)
        return System(rate.mass / width, rate.damping / width, rate.stiffness / width,
                      tuple(_scaled(element, 1.0 / width) for element in rate.elements))

    @property
    def _group(self) -> str:
        return self.name.partition(".")[0]

    @property
    def _field(self) -> str:
        return self.name.rpartition(".")[2]


def axis_names() -> tuple[str, ...]:
    """Every parameter's name."""
    return (VELOCITY, *(f"damper.{name}" for name in ranges(Damper)),
            *(f"gear.{name}" for name in ranges(Gear)))


def _scaled(element: Element, factor: float) -> Element:
    if isinstance(element, Coulomb):
        return replace(element, torque=factor * element.torque)
    assert isinstance(element, QuadraticDamping)
    return replace(element, coefficient=factor * element.coefficient)
