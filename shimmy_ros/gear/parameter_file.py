"""The one parameter file format: a ROS 2 params YAML, groups ``gear``, ``damper``, ``limits``."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

import yaml

from ..resources import resource_directory
from .parameters import Damper, Gear, Limits, ParameterError, from_mapping

REFERENCE_GEAR = "reference_gear.yaml"


def reference_parameters() -> tuple[Gear, Damper]:
    """The reference gear of ``config/`` (invented, of a fighter's plausible size), its damper."""
    return load_parameters(resource_directory("config") / REFERENCE_GEAR)


def load_parameters(*files: Path | str) -> tuple[Gear, Damper]:
    """Read gear and damper from one file, or from several of which later ones override.

    Every ``ros__parameters`` mapping in a file counts, whatever node it is for, so that a
    params file written for a node can be used as it is; other parameters in it are left alone.

    Raises ParameterError for an unreadable file and for anything in ``gear`` or ``damper`` that
    is unknown, missing or out of range.
    """
    groups = _groups(files)
    return from_mapping(Gear, groups["gear"]), from_mapping(Damper, groups["damper"])


def load_limits(*files: Path | str) -> Limits:
    """The model's limits from the same files; what none of them names has its default.

    Raises ParameterError as load_parameters.
    """
    default = Limits()
    return from_mapping(Limits, vars(default) | _groups(files)["limits"])


def _groups(files: Iterable[Path | str]) -> dict[str, dict[str, object]]:
    """The values of each group in ``files``, later ones before earlier ones."""
    groups: dict[str, dict[str, object]] = {"gear": {}, "damper": {}, "limits": {}}
    for file in files:
        try:
            content = yaml.safe_load(Path(file).read_text(encoding="utf-8"))
        except (OSError, UnicodeDecodeError, yaml.YAMLError) as error:
            reason = " ".join(str(error).split())
            raise ParameterError(f"parameter file {file} cannot be read: {reason}") from error
        found = False
        for parameters in _ros_parameters(content):
            for group, values in groups.items():
                if group in parameters:
                    found = True
                    values.update(_group(file, group, parameters[group]))
        if not found:
            raise ParameterError(
                f"parameter file {file} has no ros__parameters with a gear, damper or limits group"
            )
    return groups


def _ros_parameters(content: object) -> list[Mapping[str, Any]]:
    if not isinstance(content, Mapping):
        return []
    found: list[Mapping[str, Any]] = []
    for key, value in content.items():
        if key == "ros__parameters" and isinstance(value, Mapping):
            found.append(value)
        else:
            found.extend(_ros_parameters(value))
    return found


def _group(file: Path | str, group: str, values: object) -> dict[str, object]:
    if not isinstance(values, Mapping):
        raise ParameterError(
            f"{group} in parameter file {file} is {values!r}, but must map names to numbers"
        )
    return {str(name): value for name, value in values.items()}
