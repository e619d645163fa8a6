"""What an answer to a query is made of, apart from its results."""

from __future__ import annotations

import json
from typing import Any, NamedTuple

from .reading import id_of
from .text import QueryError, read_mapping

Json = dict[str, Any]

UNDER_WAY, COMPLETE, CANCELLED, REFUSED, FAILED = (
    "under_way", "complete", "cancelled", "refused", "failed")
DEFAULT_MAXIMUM_POINTS = 10_000


class Reply(NamedTuple):
    """A part of the answer to the query with ``ticket``; the ``final`` one is the last."""

    ticket: int
    final: bool
    answer: Json


def refusal(text: str, state: str, where: str, message: str) -> Json:
    """The answer to a query that gets no other, with its id if there is one to be found."""
    try:
        name = id_of(read_mapping(text))
    except QueryError:
        name = None
    return {"id": name, "state": state, "where": where, "message": message}


def to_text(answer: Json) -> str:
    """One line of JSON, ASCII alone."""
    return json.dumps(answer, allow_nan=False, separators=(",", ":"))
