"""Limit cycles over a parameter as rows, for CSV and JSON files."""

from __future__ import annotations

import csv
import json
import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any, TextIO

from ..cycles.amplitude_map import Node
from ..cycles.diagram import DiagramPoint
from ..cycles.fold_curve import FoldPoint
from ..cycles.orbits import Orbit
from ..cycles.sweep import SweepPoint
from ..gear.system import OperatingPoint
from ..ihb.solution import Outcome

Row = dict[str, Any]

_AMPLITUDES = ("strut_tilt_rad", "swivel_rad", "damper_rad", "tyre_lateral_m")
_CYCLE = ("stable", "fold", *_AMPLITUDES, "frequency_hz", "method", "harmonics",
          "estimated_error", "multiplier", "sticks")
# Whose the amplitudes are, in the column amplitudes_of.
_OF_CYCLE, _OF_ENVELOPE = "limit_cycle", "envelope"


def sweep_row(parameter: str, point: SweepPoint) -> Row:
    """The row of one answer; what there is not without a cycle is None."""
    cycle = _nothing() if point.orbit is None else _cycle(point.orbit, False)
    return {parameter: point.value, "direction": "up" if point.upwards else "down",
            "outcome": point.outcome.value, **cycle,
            **_amplitudes_of(point.orbit is not None, point.envelope),
            "beyond_limits": list(point.beyond_limits),
            "kick_leads_here": point.kick_leads_here, "further_stable_cycles": point.further}


def branch_row(parameter: str, point: DiagramPoint) -> Row:
    """The row of one point of a branch."""
    return {parameter: point.value, "branch": point.branch, "order": point.order,
            "on_grid": point.on_grid, **_cycle(point.orbit, point.is_fold),
            "beyond_limits": list(point.beyond_limits)}


def node_row(parameters: tuple[str, str], values: tuple[float, float], node: Node) -> Row:
    """The row of one node of a map; what there is not without a cycle is None."""
    cycle, found = _nothing(), node.outcome is Outcome.LIMIT_CYCLE
    if found and node.amplitude is not None:
        cycle |= {
            "stable": True, "fold": False, **_joints(node.amplitude),
            "frequency_hz": node.frequency_hz, "method": node.method, "harmonics": node.harmonics,
            "estimated_error": _finite(node.error), "multiplier": _finite(node.multiplier),
            "sticks": node.sticks}
    return {**dict(zip(parameters, values, strict=True)), "outcome": node.outcome.value, **cycle,
            **_amplitudes_of(found, None if found else node.amplitude),
            "beyond_limits": list(node.beyond_limits), "further_stable_cycles": node.further}


def fold_row(parameters: tuple[str, str], fold: FoldPoint, beyond_limits: Iterable[str]) -> Row:
    """The row of one fold of a map, and what is ``beyond_limits`` in its cycle."""
    return {**dict(zip(parameters, (fold.first, fold.second), strict=True)),
            "outcome": Outcome.LIMIT_CYCLE.value, **_cycle(fold.orbit, True),
            "amplitudes_of": _OF_CYCLE, "beyond_limits": list(beyond_limits),
            "further_stable_cycles": None}


def write_csv(rows: Iterable[Row], stream: TextIO) -> None:
    """Write ``rows`` with a line of names; None is empty, truth is true and false, and the words of
    a list have spaces between them."""
    rows = list(rows)
    if not rows:
        return
    writer = csv.DictWriter(stream, rows[0].keys(), lineterminator="\n")
    writer.writeheader()
    for row in rows:
        writer.writerow({name: _text(value) for name, value in row.items()})


def write_json(head: Mapping[str, Any], rows: Iterable[Row], file: Path) -> None:
    """Write one object: what ``head`` holds, and ``points``. Raises OSError."""
    file.write_text(json.dumps({**head, "points": list(rows)}, indent=1, allow_nan=False) + "\n",
                    encoding="utf-8")


def head_of(point: OperatingPoint, parameters: Sequence[str], problems: Iterable[str]
            ) -> dict[str, Any]:
    """What was varied, around what, and what did not converge."""
    return {"parameters": list(parameters), "taxi_velocity": point.velocity,
            "gear": asdict(point.gear), "damper": asdict(point.damper),
            "problems": list(problems)}


def _cycle(orbit: Orbit, is_fold: bool) -> Row:
    return {
        "stable": None if orbit.stable is None else bool(orbit.stable), "fold": is_fold,
        **_joints(orbit.amplitude), "frequency_hz": float(orbit.frequency_hz),
        "method": orbit.method, "harmonics": orbit.harmonics or None,
        "estimated_error": _finite(orbit.error), "multiplier": _finite(orbit.multiplier),
        "sticks": bool(orbit.sticks),
    }


def _nothing() -> Row:
    return dict.fromkeys(_CYCLE)


def _joints(amplitude: Iterable[float]) -> Row:
    return {name: float(value) for name, value in zip(_AMPLITUDES, amplitude, strict=True)}


def _amplitudes_of(found: bool, envelope: Iterable[float] | None) -> Row:
    """Whose the amplitudes are; those of an envelope as well."""
    if envelope is None:
        return {"amplitudes_of": _OF_CYCLE if found else None}
    return {**_joints(envelope), "amplitudes_of": _OF_ENVELOPE}


def _finite(value: float | None) -> float | None:
    return float(value) if value is not None and math.isfinite(value) else None


def _text(value: Any) -> Any:
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, list):
        return " ".join(value)
    return "" if value is None else value
