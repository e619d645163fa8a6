"""``shimmy salvage``: a whole bag from one whose writer was killed."""

from __future__ import annotations

import argparse
import sys
from contextlib import ExitStack
from pathlib import Path

from ..bag.copying import copy_message, copy_metadata
from ..bag.errors import BagError
from ..bag.output import check_new, new_bag
from ..bag.reader import Bag
from .options import Commands
from .progress import INTERRUPTED, STOPPED, stoppable, until_stopped
from .replay import default_output


def add_command(commands: Commands) -> None:
    """Declare the subcommand."""
    parser: argparse.ArgumentParser = commands.add_parser(
        "salvage", help="a whole bag from one that was cut",
        description="Copy every message that can still be read, of whatever type, to a new bag "
        "with index and metadata. Reads what replay reads and writes MCAP. Exit status 0, 2 where "
        "there is nothing to salvage, 130 when interrupted, with what was copied in the bag.")
    parser.add_argument("bag", metavar="BAG", type=Path, help="directory or file")
    parser.add_argument("-o", "--output", metavar="OUT", type=Path,
                        help="directory of the new bag (default: the bag's name with _salvaged)")
    parser.set_defaults(run=run)


def run(options: argparse.Namespace) -> int:
    """Copy and report; raises BagError and OSError."""
    messages = Bag(options.bag).messages()
    out = options.output or default_output(options.bag, "salvaged")
    check_new(out)
    count = 0
    topics = set()
    with ExitStack() as stack:
        stop = stack.enter_context(stoppable())
        bag = stack.enter_context(new_bag(out))
        for message in until_stopped(messages, stop, "salvaging", lambda: messages.fraction):
            copy_message(message, bag)
            topics.add(message.topic)
            count += 1
        if not count:
            raise BagError("; ".join([f"bag {options.bag} holds no message", *messages.damage]))
        copy_metadata(messages, bag)
    for damage in messages.damage:
        print(f"shimmy: {damage}", file=sys.stderr)
    print(f"bag      {out}\nholds    {count} messages on {len(topics)} topics")
    if stop.requested:
        print(STOPPED, file=sys.stderr)
        return INTERRUPTED
    return 0
