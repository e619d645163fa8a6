"""Limit cycles over a parameter as rows, for CSV and JSON files."""

from __future__ import annotations

import csv
import json
import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any, TextIO

from ..cycles.diagram import DiagramPoint
from ..cycles.fold_curve import FoldPoint
from ..cycles.orbits import Orbit
from ..cycles.sweep import SweepPoint
from ..gear.system import OperatingPoint
from ..ihb.solution import Outcome

Row = dict[str, Any]

_CYCLE = ("stable", "fold", "strut_tilt_rad", "swivel_rad", "damper_rad", "tyre_lateral_m",
          "frequency_hz", "method", "harmonics", "estimated_error", "multiplier", "sticks")


def sweep_row(parameter: str, point: SweepPoint) -> Row:
    """The row of one answer; what there is not without a cycle is None."""
    cycle = dict.fromkeys(_CYCLE) if point.orbit is None else _cycle(point.orbit, False)
    return {parameter: point.value, "direction": "up" if point.upwards else "down",
            "outcome": point.outcome.value, **cycle}


def branch_row(parameter: str, point: DiagramPoint) -> Row:
    """The row of one point of a branch."""
    return {parameter: point.value, "branch": point.branch, "order": point.order,
            "on_grid": point.on_grid, **_cycle(point.orbit, point.is_fold)}


def node_row(parameters: tuple[str, str], values: tuple[float, float], orbit: Orbit | None,
             undecided: bool) -> Row:
    """The row of one node of a map; what there is not without a cycle is None."""
    outcome = (Outcome.LIMIT_CYCLE if orbit is not None
               else Outcome.FAILED if undecided else Outcome.NO_LIMIT_CYCLE)
    cycle = dict.fromkeys(_CYCLE) if orbit is None else _cycle(orbit, False)
    return {**dict(zip(parameters, values, strict=True)), "outcome": outcome.value, **cycle}


def fold_row(parameters: tuple[str, str], fold: FoldPoint) -> Row:
    """The row of one fold of a map."""
    return {**dict(zip(parameters, (fold.first, fold.second), strict=True)),
            "outcome": Outcome.LIMIT_CYCLE.value, **_cycle(fold.orbit, True)}


def write_csv(rows: Iterable[Row], stream: TextIO) -> None:
    """Write ``rows`` with a line of names; None is empty, truth is true and false."""
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
    tilt, swivel, damper, lateral = (float(value) for value in orbit.amplitude)
    return {
        "stable": orbit.stable, "fold": is_fold, "strut_tilt_rad": tilt, "swivel_rad": swivel,
        "damper_rad": damper, "tyre_lateral_m": lateral, "frequency_hz": float(orbit.frequency_hz),
        "method": orbit.method, "harmonics": orbit.harmonics or None,
        "estimated_error": _finite(orbit.error), "multiplier": _finite(orbit.multiplier),
        "sticks": orbit.sticks,
    }


def _finite(value: float) -> float | None:
    return float(value) if math.isfinite(value) else None


def _text(value: Any) -> Any:
    if isinstance(value, bool):
        return "true" if value else "false"
    return "" if value is None else value
