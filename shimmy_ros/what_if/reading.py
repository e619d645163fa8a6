"""From the content of a query to a Query: every word and number is checked, and named if wrong."""

from __future__ import annotations

import difflib
import itertools
import math
import re
from collections.abc import Mapping
from dataclasses import replace
from typing import Any

from ..cycles.settings import ACCURACY_RANGE, HARMONICS_RANGE, Settings, check_harmonics
from ..gear.matrices import NAMES, SWIVEL
from ..gear.parameters import Damper, Gear, Limits, ParameterError, Range, changed, ranges
from ..gear.system import OperatingPoint
from .query import (
    LARGEST,
    LARGEST_LOSS,
    LARGEST_RISE,
    LIMIT_CYCLE,
    PARAMETERS,
    RETURNS,
    SENSES,
    SMALLEST,
    VELOCITY,
    Cancel,
    Find,
    Grid,
    Listed,
    Present,
    Query,
    value_of,
    with_values,
)
from .text import QueryError, brief

LARGEST_AMPLITUDE = 100.0
LONGEST_ID = 100

# Where to look for a parameter, in multiples of its present value.
_DAMPER_FACTOR, _GEAR_FACTOR = 100.0, 2.0
_DEGREES = re.compile(r"([0-9]+(?:\.[0-9]+)?(?:[eE][-+]?[0-9]+)?) ?deg")
_WORDS = ("id", "cancel", "harmonics", "accuracy", "limits", "return", "find")


def id_of(content: Mapping[str, Any]) -> str | None:
    """The id of a query that may be wrong elsewhere; None without a usable one."""
    value = content.get("id")
    return value if isinstance(value, str) and 1 <= len(value) <= LONGEST_ID else None


def checked_id(content: Mapping[str, Any]) -> str | None:
    """The id of a query, None without one. Raises QueryError for what is no id."""
    return _word("id", content["id"]) if "id" in content else None


def read_query(content: Mapping[str, Any], present: Present, maximum_points: int
               ) -> Query | Cancel:
    """Check a query's content. Raises QueryError at the first thing that is wrong."""
    for name in content:
        if name not in PARAMETERS and name not in _WORDS:
            raise QueryError(str(name), f"{brief(name)} is not known{_instead(name)}")
    identifier = checked_id(content)
    if "cancel" in content:
        _alone(content, "cancel", ("id",))
        return Cancel(identifier, _word("cancel", content["cancel"]))
    if "find" in content and "return" in content:
        raise QueryError("return", "return and find exclude each other")
    wanted = _find_words(content["find"]) if "find" in content else None
    numbers: dict[str, float] = {}
    varied: dict[str, Grid | Listed] = {}
    interval = None
    for name in content:
        if name in PARAMETERS:
            value = _values(name, content[name], maximum_points, wanted is not None)
            if isinstance(value, tuple):
                interval = value
            elif isinstance(value, float):
                numbers[name] = value
            else:
                varied[name] = value
    query = Query(identifier, _base(present, numbers, varied, interval, wanted), varied,
                  _settings(content, present.settings), _returns(content), None)
    if len(query) > maximum_points:
        raise QueryError("", f"the query has {len(query)} points, but may have at most "
                         f"{maximum_points}")
    if wanted is not None:
        query = replace(query, find=_find(content, wanted, query, interval))
    _check_corners(query)
    return query


def _settings(content: Mapping[str, Any], present: Settings) -> Settings:
    values: dict[str, Any] = {"limits": _limits(content, present.limits)}
    if "harmonics" in content:
        values["harmonics"] = _harmonics(content["harmonics"])
    if "accuracy" in content:
        values["accuracy"] = _number("accuracy", content["accuracy"], ACCURACY_RANGE)
    return replace(present, **values)


def _limits(content: Mapping[str, Any], present: Limits) -> Limits:
    value = content.get("limits", {})
    known = ranges(Limits)
    if not isinstance(value, dict):
        raise QueryError("limits", f"limits is {brief(value)}, but must be a mapping of some of "
                         f"{', '.join(known)} to numbers")
    for word in value:
        if word not in known:
            raise QueryError(f"limits.{word}", f"{brief(word)} is not known in limits; it has "
                             f"{', '.join(known)}")
    return changed(present, **{name: _angle(f"limits.{name}", item, known[name])
                               for name, item in value.items()})


def _base(present: Present, numbers: dict[str, float], varied: Mapping[str, Grid | Listed],
          interval: tuple[float, float] | None, wanted: tuple[str, str] | None) -> OperatingPoint:
    velocity = present.velocity
    if VELOCITY in varied or interval is not None or (
            wanted is not None and wanted[1] == VELOCITY and wanted[0] in (SMALLEST, LARGEST)):
        velocity = math.nan
    elif VELOCITY not in numbers and velocity is None:
        raise QueryError(VELOCITY, "taxi_velocity is missing, and none was heard yet")
    base = OperatingPoint(present.gear, present.damper,
                          math.nan if velocity is None else velocity)
    # Single values that do not fit together only with what varies are judged at the corners.
    first = {name: values.values()[0] for name, values in varied.items() if name != VELOCITY}
    return _fitting(base, {**first, **numbers})


def _check_corners(query: Query) -> None:
    """Whether gears at all the ends of what varies have a mass matrix: then all between have."""
    ends = {}
    for name, values in query.varied.items():
        if name in ranges(Gear):
            every = values.values()
            ends[name] = sorted({min(every), max(every)})
    if query.find is not None and query.find.parameter in ranges(Gear):
        ends[query.find.parameter] = [query.find.begin, query.find.end]
    for corner in itertools.product(*ends.values()):
        _fitting(query.base, dict(zip(ends, corner, strict=True)))


def _fitting(point: OperatingPoint, values: Mapping[str, float]) -> OperatingPoint:
    try:
        return with_values(point, values)
    except ParameterError as error:
        raise QueryError("", str(error)) from error


def _values(name: str, value: object, maximum_points: int, interval_allowed: bool
            ) -> float | Grid | Listed | tuple[float, float]:
    range_ = PARAMETERS[name]
    if isinstance(value, list):
        if not 1 <= len(value) <= maximum_points:
            raise QueryError(name, f"{name} has {len(value)} values, but must have between 1 and "
                             f"{maximum_points}")
        return Listed(tuple(_number(f"{name}[{index}]", item, range_)
                            for index, item in enumerate(value)))
    if isinstance(value, dict):
        known = {"from", "to", "points"}
        for word in value:
            if word not in known:
                raise QueryError(f"{name}.{word}", f"{brief(word)} is not known in {name}; it has "
                                 "from, to and points")
        for word in ("from", "to"):
            if word not in value:
                raise QueryError(name, f"{name}.{word} is missing")
        start, end = (_number(f"{name}.{word}", value[word], range_) for word in ("from", "to"))
        if "points" in value:
            return Grid(start, end, _points(name, value["points"], maximum_points))
        if not interval_allowed or name != VELOCITY:
            raise QueryError(name, f"{name}.points is missing; only find's taxi_velocity goes "
                             "without")
        if not start < end:
            raise QueryError(f"{name}.to", f"{name}.to is {end:g}, but must be greater than "
                             f"{name}.from, {start:g}")
        return start, end
    if isinstance(value, bool) or not isinstance(value, (int, float)):
        raise QueryError(name, f"{name} is {brief(value)}, but must be a number in "
                         f"{range_.describe()}, a list of such numbers, or "
                         "{from, to, points}")
    return _number(name, value, range_)


def _number(where: str, value: object, range_: Range) -> float:
    if isinstance(value, bool) or not isinstance(value, (int, float)):
        raise QueryError(where, f"{where} is {brief(value)}, but must be a number in "
                         f"{range_.describe()}")
    try:
        return range_.check(where, value)
    except ParameterError as error:
        raise QueryError(where, str(error)) from error


def _points(name: str, value: object, maximum_points: int) -> int:
    where = f"{name}.points"
    if isinstance(value, bool) or not isinstance(value, (int, float)) or not (
            2 <= value <= maximum_points and value == int(value)):
        raise QueryError(where, f"{where} is {brief(value)}, but must be a whole number in "
                         f"[2, {maximum_points}]")
    return int(value)


def _harmonics(value: object) -> int:
    _number("harmonics", value, HARMONICS_RANGE)
    try:
        return check_harmonics(value)  # type: ignore[arg-type]
    except ParameterError as error:
        raise QueryError("harmonics", str(error)) from error


def _returns(content: Mapping[str, Any]) -> tuple[str, ...]:
    value = content.get("return", LIMIT_CYCLE)
    words = value if isinstance(value, list) else [value]
    for index, word in enumerate(words):
        if word not in RETURNS:
            where = f"return[{index}]" if isinstance(value, list) else "return"
            raise QueryError(where, f"{where} is {brief(word)}, but must be one of "
                             f"{', '.join(RETURNS)}")
    if not words or len(set(words)) < len(words):
        raise QueryError("return", f"return is {brief(value)}, but must name one or more of "
                         f"{', '.join(RETURNS)}, each once")
    return tuple(words)


def _find_words(value: object) -> tuple[str, str]:
    """Sense and parameter of a find."""
    if not isinstance(value, dict):
        raise QueryError("find", f"find is {brief(value)}, but must be a mapping with one of "
                         f"{', '.join(SENSES)}, and below")
    for word in value:
        if word not in (*SENSES, "below", "amplitude", "between"):
            raise QueryError(f"find.{word}", f"{brief(word)} is not known in find; it has "
                             f"{', '.join(SENSES)}, below, amplitude and between")
    senses = [word for word in SENSES if word in value]
    if len(senses) != 1:
        raise QueryError("find", f"find has {' and '.join(senses) or 'nothing to look for'}, but "
                         f"must have one of {', '.join(SENSES)}")
    name = value[senses[0]]
    if not isinstance(name, str) or name not in PARAMETERS:
        raise QueryError(f"find.{senses[0]}", f"find.{senses[0]} is {brief(name)}, but must be a "
                         f"parameter's name{_instead(name, ())}")
    return senses[0], name


def _find(content: Mapping[str, Any], wanted: tuple[str, str], query: Query,
          interval: tuple[float, float] | None) -> Find:
    sense, name = wanted
    value = content["find"]
    change = sense in (LARGEST_LOSS, LARGEST_RISE)
    if name in query.varied or (name in content and not change) or (
            name == VELOCITY and interval is not None):
        raise QueryError(name, f"{name} is what find looks for, and must not be given"
                         + (" but as one number" if change else ""))
    lowest = query.settings.minimum_velocity
    if interval is not None and interval[0] < lowest:
        raise QueryError(f"{VELOCITY}.from", f"taxi_velocity.from is {interval[0]:g}, but must be "
                         f"at least the minimum velocity of {lowest:g} m/s")
    if "below" not in value:
        raise QueryError("find", "find.below is missing")
    coordinate = value.get("amplitude", NAMES[SWIVEL])
    if coordinate not in NAMES:
        raise QueryError("find.amplitude", f"find.amplitude is {brief(coordinate)}, but must be "
                         f"one of {', '.join(NAMES)}")
    index = NAMES.index(coordinate)
    unit = "m" if coordinate == "tyre_lateral" else "rad"
    range_ = Range(unit, "amplitude", 0.0, LARGEST_AMPLITUDE)
    below = _angle("find.below", value["below"], range_)
    begin, end = _between(value, sense, name, query)
    return Find(sense, name, begin, end, index, below, interval)


def _angle(where: str, value: object, range_: Range) -> float:
    """A number, or that of a text such as "2 deg" for an angle."""
    if range_.unit != "rad" or not isinstance(value, str):
        return _number(where, value, range_)
    match = _DEGREES.fullmatch(value)
    if match is None:
        raise QueryError(where, f"{where} is {brief(value)}, but must be a number in "
                         f"{range_.describe()}, or an angle as in 2 deg")
    return _number(where, math.radians(float(match[1])), range_)


def _between(find: Mapping[str, Any], sense: str, name: str, query: Query
             ) -> tuple[float, float]:
    """Begin and end of the search."""
    allowed = PARAMETERS[name]
    lowest = query.settings.minimum_velocity if name == VELOCITY else allowed.low
    present = value_of(query.base, name)
    if sense in (LARGEST_LOSS, LARGEST_RISE):
        if "between" in find:
            raise QueryError("find.between", "find.between belongs to smallest and largest; a "
                             "loss or a rise begins at the present value")
        if not present >= lowest:
            raise QueryError(name, f"{name} is {present:g}, but must be at least {lowest:g}")
        ends = _usual(name, present, lowest)
        return present, ends[0] if sense == LARGEST_LOSS else ends[1]
    if "between" in find:
        given = find["between"]
        if not isinstance(given, list) or len(given) != 2:
            raise QueryError("find.between", f"find.between is {brief(given)}, but must be two "
                             "numbers")
        within = Range(allowed.unit, allowed.meaning, lowest, allowed.high)
        low, high = (_number(f"find.between[{index}]", item, within)
                     for index, item in enumerate(given))
        if not low < high:
            raise QueryError("find.between", f"find.between is [{low:g}, {high:g}], but the "
                             "second must be the greater")
    else:
        low, high = _usual(name, present, lowest)
    return (low, high) if sense == SMALLEST else (high, low)


def _usual(name: str, present: float, lowest: float) -> tuple[float, float]:
    """Where to look for a parameter whose value is ``present``."""
    allowed = PARAMETERS[name]
    if name == VELOCITY:
        return lowest, allowed.high
    if present == 0.0:
        raise QueryError("find", f"find.between is missing, which is needed since {name} is 0")
    if name in ranges(Damper):
        return 0.0, min(allowed.high, _DAMPER_FACTOR * present)
    low, high = sorted((present / _GEAR_FACTOR, present * _GEAR_FACTOR))
    return max(allowed.low, low), min(allowed.high, high)


def _word(where: str, value: object) -> str:
    if not isinstance(value, str) or not 1 <= len(value) <= LONGEST_ID:
        raise QueryError(where, f"{where} is {brief(value)}, but must be a text of 1 to "
                         f"{LONGEST_ID} characters")
    return value


def _alone(content: Mapping[str, Any], name: str, allowed: tuple[str, ...]) -> None:
    for other in content:
        if other != name and other not in allowed:
            raise QueryError(str(other), f"{brief(other)} does not go together with {name}")


def _instead(name: object, words: tuple[str, ...] = _WORDS) -> str:
    """What could have been meant: a parameter or one of ``words``."""
    if not isinstance(name, str):
        return ""
    near = difflib.get_close_matches(name.rpartition(".")[2][:50], [*PARAMETERS, *words], 1)
    if near:
        return f"; did you mean {near[0]}?"
    others = f"a query has {', '.join(words)} and the parameters" if words else "there are"
    return f"; {others} {', '.join(PARAMETERS)}"
