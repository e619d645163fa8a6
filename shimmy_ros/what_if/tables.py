"""The points of an answer as tables for people: angles in degrees, the rest in SI units."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from typing import Any

from .query import PARAMETERS, SENSES, VELOCITY
from .reply import Json

Row = Mapping[str, str]

# Outcomes that a row tells in full.
_PLAIN = ("limit_cycle", "no_limit_cycle", "disturbance", "found", "nowhere", "everywhere",
          "at_range_end", "exceeded_now")


def tables(answer: Json) -> list[str]:
    """One table for each kind of result that the points have, and what went wrong below it.

    Above the values found is what was looked for, and where.
    """
    points = answer["points"]
    kinds = [name for name in _ROWS if any(name in point for point in points)]
    found = [_table(kind, [point for point in points if kind in point]) for kind in kinds]
    return [_wanted(answer["inputs"]), *found] if "find" in kinds else found


def _wanted(inputs: Json) -> str:
    """What a find looks for, as a sentence."""
    find = inputs["find"]
    sense = next(word for word in SENSES if word in find)
    name, joint = find[sense], find["amplitude"]
    low, high = find["between"]
    limit = f"{find['below']:g} m" if joint == "tyre_lateral" else f"{_degrees(find['below'])} deg"
    holds = (f"the {_words(joint)} stays below {limit}" if find["below"]
             else "there is no limit cycle")
    velocity = inputs.get(VELOCITY)
    over = (f" at all taxi velocities from {velocity['from']:g} to {velocity['to']:g} m/s"
            if isinstance(velocity, dict) and "points" not in velocity else "")
    return (f"{_words(sense).capitalize()}{' of' * sense.startswith('largest_')} {_words(name)} "
            f"for which {holds}{over}; looked for from {low:g} to {high:g} "
            f"{PARAMETERS[name].unit}.")


def _table(kind: str, points: Sequence[Json]) -> str:
    rows: list[Row] = []
    notes: list[str] = []
    for point in points:
        at = {_heading(name): f"{value:g}" for name, value in point["at"].items()}
        result = point[kind]
        rows += [{**at, **row} for row in _ROWS[kind](result)]
        note = result.get("message", "")
        plain = result["outcome"] in _PLAIN and _part(result, "kick", "leads_to") != "growth"
        if note and note not in notes and not plain:
            notes.append(note)
    return "\n".join([*_aligned(rows), *(f"{note[0].upper()}{note[1:]}." for note in notes)])


def _aligned(rows: Sequence[Row]) -> list[str]:
    columns = list(dict.fromkeys(name for row in rows for name in row if row[name]))
    widths = {name: max(len(name), *(len(row.get(name, "")) for row in rows)) for name in columns}
    lines = ["  ".join(name.rjust(widths[name]) for name in columns)]
    for row in rows:
        lines.append("  ".join(row.get(name, "").rjust(widths[name]) for name in columns).rstrip())
    return lines


def _limit_cycle(result: Json) -> list[Row]:
    further = [f"{_degrees(cycle['amplitude']['swivel'])} deg"
               for cycle in result.get("further_stable_cycles") or []]
    cycle = {**result, "amplitude": result.get("amplitude") or result.get("envelope")}
    return [{"outcome": _words(result["outcome"]), **_cycle(cycle),
             **({"also stable": ", ".join(further)} if further else {})}]


def _all_cycles(result: Json) -> list[Row]:
    cycles = result.get("cycles") or []
    return [{"outcome": _words(cycle["role"]), **_cycle(cycle),
             "beyond the gear": "yes" if cycle["beyond_gear"] else "no"} for cycle in cycles] or [
        {"outcome": _words(result["outcome"])}]


def _trigger(result: Json) -> list[Row]:
    leads = [_part(result, name, "leads_to") for name in ("kick", "release_angle")]
    return [{
        "starts": _words(result["outcome"]),
        "kick [rad/s]": _number(_part(result, "kick", "starts")),
        "release angle [deg]": _degrees(_part(result, "release_angle", "starts")),
        "leads to": ", ".join(_words(word) for word in dict.fromkeys(filter(None, leads))) or "-",
        "trigger cycle [deg]": _degrees(_part(result, "cycle", "amplitude", "swivel")),
    }]


def _margin(result: Json) -> list[Row]:
    return [{
        "outcome": _words(result["outcome"]), "parameter": name,
        "value": _number(folds["value"]), "fold below": _number(folds["below"]),
        "fold above": _number(folds["above"]), "distance": _number(folds["distance"]),
    } for name, folds in (result.get("folds") or {}).items()] or [
        {"outcome": _words(result["outcome"])}]


def _find(result: Json) -> list[Row]:
    decided = result.get("decided_by") or {}
    return [{
        "outcome": _words(result["outcome"]), "value": _number(result.get("value")),
        "change": _number(result.get("change")), "decided by": decided.get("by", "-"),
        "at [m/s]": _number(decided.get("taxi_velocity")), **_cycle(decided.get("cycle") or {}),
    }]


def _cycle(result: Json) -> Row:
    amplitude = result.get("amplitude") or {}
    return {
        "swivel [deg]": _degrees(amplitude.get("swivel")),
        "damper [deg]": _degrees(amplitude.get("damper")),
        "strut tilt [deg]": _degrees(amplitude.get("strut_tilt")),
        "tyre lateral [m]": _number(amplitude.get("tyre_lateral")),
        "frequency [Hz]": _number(result.get("frequency")),
        "error": "-" if result.get("error") is None else f"{result['error']:.1e}",
        # Empty without such a cycle, so that the column is not there unless it says something.
        "beyond limits": ", ".join(_words(excess["quantity"])
                                   for excess in result.get("beyond_limits") or []),
    }


def _part(result: Json, *path: str) -> Any:
    value: Any = result
    for name in path:
        value = (value or {}).get(name)
    return value


def _number(value: float | None) -> str:
    return "-" if value is None else f"{value:.6g}"


def _degrees(value: float | None) -> str:
    return "-" if value is None else f"{math.degrees(value):.5g}"


def _words(outcome: str) -> str:
    return outcome.replace("_", " ")


def _heading(name: str) -> str:
    return name.replace("_", " ")


_ROWS: Mapping[str, Callable[[Json], list[Row]]] = {
    "limit_cycle": _limit_cycle, "all_cycles": _all_cycles, "trigger": _trigger,
    "margin": _margin, "find": _find,
}
