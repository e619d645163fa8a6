"""``shimmy ask``: a what-if query, answered here or by a running predictor, as a table."""

from __future__ import annotations

import argparse
import json
import sys
from collections.abc import Iterator
from typing import Any

from tqdm import tqdm

from ..gear.parameters import ParameterError
from ..what_if.query import Present
from ..what_if.reply import DEFAULT_MAXIMUM_POINTS, REFUSED, Json
from ..what_if.tables import tables
from .options import (
    Commands,
    add_gear_options,
    add_settings_options,
    gear_and_damper,
    settings_of,
)
from .progress import stoppable

DEFAULT_NAMESPACE = "/shimmy"


def add_command(commands: Commands) -> None:
    """Declare the subcommand."""
    parser: argparse.ArgumentParser = commands.add_parser(
        "ask", help="what if: other values, grids of them, or the value that meets a limit",
        description="Answer a query as on the topic what_if/query (msgs_spec/"
        "what_if_query.schema.json), for example '{taxi_velocity: {from: 10, to: 100, points: 10}, "
        "coulomb_torque: [5, 20]}' or '{taxi_velocity: {from: 10, to: 100}, find: {smallest: "
        "quadratic_damping, below: 2 deg}}'. Exit status 0 with answers everywhere, 1 where a "
        "solve did not converge, 2 where the query was refused, 130 when interrupted.")
    parser.add_argument("query", metavar="QUERY", help="JSON or YAML; - reads it from stdin")
    parser.add_argument("--node", metavar="NAMESPACE", nargs="?", const=DEFAULT_NAMESPACE,
                        help="ask the predictor that runs in this namespace (default: "
                        f"{DEFAULT_NAMESPACE}), about gear, damper and velocity as it has them; "
                        "needs ROS 2")
    parser.add_argument("--velocity", type=float, metavar="V",
                        help="taxi velocity where the query names none, m/s")
    add_gear_options(parser)
    add_settings_options(parser)
    parser.add_argument("--json", action="store_true", help="print JSON")
    parser.set_defaults(run=run)


def run(options: argparse.Namespace) -> int:
    """Ask and print; raises ParameterError on bad input."""
    text = sys.stdin.read() if options.query == "-" else options.query
    parts = _from_node(text, options.node) if options.node else _from_here(text, options)
    answer = _collected(parts)
    if answer["state"] == REFUSED:
        where = f" (at {answer['where']})" if answer["where"] else ""
        raise ParameterError(f"the query is refused{where}: {answer['message']}")
    if options.json:
        print(json.dumps(answer, allow_nan=False))
    else:
        print("\n\n".join(tables(answer)))
    if answer["state"] != "complete":
        print(f"shimmy: {answer['state'].replace('_', ' ')}: {answer.get('message', '')}",
              file=sys.stderr)
        return 1
    failed = any(result["outcome"] == "not_converged" for point in answer["points"]
                 for result in _results(point))
    return 1 if failed else 0


def _results(point: Json) -> Iterator[Any]:
    return (value for name, value in point.items() if name not in ("index", "at"))


def _collected(parts: Iterator[Json]) -> Json:
    """All parts of an answer in one, its points in order."""
    answer: Json = {}
    points: list[Json] = []
    with tqdm(disable=not sys.stderr.isatty(), unit=" points", leave=False) as bar:
        for part in parts:
            points += part.get("points", [])
            answer |= part
            bar.total = part.get("of")
            bar.update(len(points) - bar.n)
    return {**answer, "points": sorted(points, key=lambda point: int(point["index"]))}


def _from_here(text: str, options: argparse.Namespace) -> Iterator[Json]:
    # The solvers take their time to import.
    from ..what_if.desk import Desk

    gear, damper = gear_and_damper(options)
    desk = Desk()
    desk.take(0, text, Present(gear, damper, options.velocity, settings_of(options)),
              DEFAULT_MAXIMUM_POINTS)
    while True:
        for reply in desk.replies():
            yield reply.answer
        if not desk.busy:
            return
        desk.step()


def _from_node(text: str, namespace: str) -> Iterator[Json]:
    try:
        from ..nodes.asking import ask_node
    except ImportError as error:
        raise ParameterError(
            "--node needs ROS 2 Jazzy's rclpy, from a sourced ROS or, in the source tree, by "
            f"pip install '.[ros]' ({error})") from error
    # A KeyboardInterrupt amid the exchange of messages could get lost, or the cancellation with it.
    with stoppable() as stop:
        yield from ask_node(text, namespace, lambda: not stop.requested)
        if stop.requested:
            raise KeyboardInterrupt
