"""Gear, damper and limits as node parameters, and the checks of every parameter's value."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

from rcl_interfaces.msg import (
    FloatingPointRange,
    IntegerRange,
    ParameterDescriptor,
    SetParametersResult,
)
from rclpy.node import Node
from rclpy.parameter import Parameter

from ..gear.parameters import ParameterError, Range, changed, ranges


def declare_number(node: Node, name: str, default: float, range_: Range) -> float:
    """Declare a double with its range and return its value. Raises ParameterError."""
    descriptor = ParameterDescriptor(
        description=f"{range_.meaning} [{range_.unit}]",
        floating_point_range=[FloatingPointRange(
            from_value=range_.low, to_value=range_.high, step=0.0)])
    return float(_declared(node, name, default, descriptor, f"a double in {range_.describe()}"))


def declare_count(node: Node, name: str, default: int, range_: Range) -> int:
    """Declare an integer with its range and return its value. Raises ParameterError."""
    descriptor = ParameterDescriptor(
        description=range_.meaning,
        integer_range=[IntegerRange(
            from_value=int(range_.low), to_value=int(range_.high), step=1)])
    return int(_declared(
        node, name, default, descriptor,
        f"a whole number in [{range_.low:g}, {range_.high:g}]"))


def declare_setting(node: Node, name: str, default: bool | str, description: str,
                    read_only: bool = True) -> Any:
    """Declare a bool or a string and return its value. Raises ParameterError."""
    descriptor = ParameterDescriptor(description=description, read_only=read_only)
    return _declared(node, name, default, descriptor, f"a {type(default).__name__}")


def declare_group(node: Node, default: Any) -> Any:
    """Declare a Gear, a Damper or Limits as ``gear.*``, ``damper.*`` or ``limits.*``.

    ``default`` has the default values; returns the values that the node has. Raises ParameterError
    for a value that is refused, and for the name of a parameter that the group does not have.
    """
    group = type(default).__name__.lower()
    known = ranges(type(default))
    for name in node._parameter_overrides:
        if name.startswith(f"{group}.") and name.removeprefix(f"{group}.") not in known:
            raise ParameterError(f"parameter {name} is unknown, but must be one of "
                                 + ", ".join(f"{group}.{item}" for item in sorted(known)))
    values = {name: declare_number(node, f"{group}.{name}", getattr(default, name), range_)
              for name, range_ in known.items()}
    return changed(default, **values)


def changed_group(group: Any, parameters: Iterable[Parameter]) -> Any:
    """A Gear, a Damper or Limits with those of ``parameters`` that are its own.

    Raises ParameterError.
    """
    prefix = type(group).__name__.lower() + "."
    values = {
        parameter.name.removeprefix(prefix): parameter.value
        for parameter in parameters if parameter.name.startswith(prefix)
    }
    return changed(group, **values) if values else group


def refusal(error: ParameterError) -> SetParametersResult:
    """The answer to a change that is refused."""
    return SetParametersResult(successful=False, reason=str(error))


def _declared(node: Node, name: str, default: Any, descriptor: ParameterDescriptor,
              allowed: str) -> Any:
    # rclpy has a family of exceptions for this, none with the value and the allowed range in one
    # sentence; each of them derives from ParameterException or ValueError.
    from rclpy.exceptions import ParameterException

    try:
        return node.declare_parameter(name, default, descriptor).value
    except (ParameterException, ValueError, TypeError) as error:
        given = node._parameter_overrides.get(name)
        value = "not usable" if given is None else repr(given.value)
        raise ParameterError(f"parameter {name} is {value}, but must be {allowed}") from error
