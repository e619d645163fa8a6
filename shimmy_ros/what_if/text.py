"""The text of a query as plain values: JSON, or YAML as the JSON-like schema of YAML 1.2 has it."""

from __future__ import annotations

import json
import re
import reprlib
from typing import Any, cast

import yaml

LONGEST_TEXT = 100_000
"""Characters that a query may have."""

_LONGEST_PLACE = 100


class QueryError(ValueError):
    """A query that cannot be answered; ``where`` is the place in it, as in taxi_velocity[2].

    ``where`` is empty where the query as a whole is meant.
    """

    def __init__(self, where: str, message: str) -> None:
        super().__init__(message)
        self.where = where[:_LONGEST_PLACE]


def read_mapping(text: str) -> dict[str, Any]:
    """The mapping that ``text`` holds. Raises QueryError."""
    if len(text) > LONGEST_TEXT:
        raise QueryError("", f"the query has {len(text)} characters, but must have at most "
                         f"{LONGEST_TEXT}")
    content = _parsed(text)
    if content is None:
        raise QueryError("", "the query is empty, but must be a mapping of names to values")
    if not isinstance(content, dict):
        raise QueryError("", f"the query is {brief(content)}, but must be a mapping of names to "
                         "values")
    return content


def brief(value: object) -> str:
    """``value`` as a query would have it, in a few characters however large it is."""
    return "null" if value is None else _BRIEF.repr(value)


def _parsed(text: str) -> Any:
    try:
        return json.loads(text, object_pairs_hook=_unrepeated)
    except QueryError:
        raise
    except ValueError as error:  # a number of too many digits is none of JSON's own errors
        in_json = error
    except RecursionError as error:
        raise QueryError("", "the query is nested too deeply") from error
    try:
        return yaml.load(text, _Loader)
    except yaml.MarkedYAMLError as error:
        if isinstance(in_json, json.JSONDecodeError) and text.lstrip().startswith('{"'):
            raise QueryError(
                f"line {in_json.lineno}, column {in_json.colno}",
                f"the query is no JSON: {_lower(in_json.msg)}") from error
        mark = error.problem_mark or error.context_mark
        where = "" if mark is None else f"line {mark.line + 1}, column {mark.column + 1}"
        raise QueryError(where, f"the query is no YAML: {error.problem or error.context}"
                         ) from error
    except QueryError:
        raise
    except (yaml.YAMLError, ValueError) as error:
        raise QueryError("", f"the query is no YAML: {' '.join(str(error).split())}") from error
    except RecursionError as error:
        raise QueryError("", "the query is nested too deeply") from error


def _lower(sentence: str) -> str:
    return sentence[:1].lower() + sentence[1:]


def _unrepeated(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
    result: dict[str, Any] = {}
    for name, value in pairs:
        if name in result:
            raise QueryError(name, f"{brief(name)} is named twice")
        result[name] = value
    return result


class _Loader(yaml.SafeLoader):
    """YAML that JSON has a match for: no aliases, tags, repeated keys, dates, 1:30, yes and no."""

    def compose_node(self, parent: Any, index: Any) -> Any:
        event = cast(Any, self).peek_event()
        if isinstance(event, yaml.AliasEvent) or getattr(event, "tag", None) is not None:
            raise yaml.MarkedYAMLError(problem="aliases and tags are not accepted",
                                       problem_mark=event.start_mark)
        return super().compose_node(parent, index)

    def construct_mapping(self, node: Any, deep: bool = False) -> dict[Any, Any]:
        pairs = []
        for key, value in node.value:
            if not isinstance(key, yaml.ScalarNode):
                raise yaml.MarkedYAMLError(problem="a name must be a word",
                                           problem_mark=key.start_mark)
            pairs.append((key.value, self.construct_object(value, deep=True)))
        return _unrepeated(pairs)


_Loader.yaml_implicit_resolvers = {}
for tag, pattern, first in (
        ("null", r"~|null|", ["~", "n", ""]),
        ("bool", r"true|false", list("tf")),
        ("int", r"[-+]?[0-9]+", list("-+0123456789")),
        ("float", r"[-+]?(\.[0-9]+|[0-9]+(\.[0-9]*)?)([eE][-+]?[0-9]+)?|[-+]?\.inf|\.nan",
         list("-+.0123456789"))):
    _Loader.add_implicit_resolver(f"tag:yaml.org,2002:{tag}", re.compile(f"^(?:{pattern})$"), first)


def _float(loader: _Loader, node: Any) -> float:
    return float(str(loader.construct_scalar(node)).replace(".inf", "inf").replace(".nan", "nan"))


def _int(loader: _Loader, node: Any) -> int:
    return int(str(loader.construct_scalar(node)))


_Loader.add_constructor("tag:yaml.org,2002:float", _float)
_Loader.add_constructor("tag:yaml.org,2002:int", _int)

_BRIEF = reprlib.Repr()
_BRIEF.maxlevel = 2
_BRIEF.maxdict = _BRIEF.maxlist = _BRIEF.maxtuple = 3
_BRIEF.maxstring = _BRIEF.maxother = _BRIEF.maxlong = 40
