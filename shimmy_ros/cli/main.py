"""The ``shimmy`` command: one subcommand a module."""

from __future__ import annotations

import argparse
import os
import sys
from collections.abc import Sequence
from importlib import import_module

from ..bag.errors import BagError
from ..gear.parameters import ParameterError
from .progress import INTERRUPTED, signals_held

COMMANDS = ("predict", "ask", "sweep", "map", "figures", "replay", "salvage", "demo")
FAILED = 1
BAD_INPUT = 2


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command; 0 with an answer, 1 for a failure, 2 on bad input, 130 when interrupted.

    ``shimmy predict`` has 3 as well, for motion that grows without bound.
    """
    try:
        options = _parsed(sys.argv[1:] if arguments is None else arguments)
        status = int(options.run(options))
        sys.stdout.flush()
        return status
    except (ParameterError, BagError) as error:
        print(f"shimmy: {error}", file=sys.stderr)
        return BAD_INPUT
    except BrokenPipeError:
        # Whoever read the output has had enough; what is still buffered must not fail, too.
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return FAILED
    except OSError as error:
        print(f"shimmy: {error}", file=sys.stderr)
        return FAILED
    except KeyboardInterrupt:
        return INTERRUPTED


def _parsed(arguments: Sequence[str]) -> argparse.Namespace:
    parser = argparse.ArgumentParser(
        prog="shimmy", description="Limit cycles of landing-gear shimmy.")
    commands = parser.add_subparsers(title="commands", required=True, metavar="COMMAND")
    # What the others import takes time and memory that this one need not wait for.
    for name in arguments[:1] if arguments and arguments[0] in COMMANDS else COMMANDS:
        with signals_held():
            module = import_module(f".{name}", __package__)
        module.add_command(commands)
    return parser.parse_args(arguments)


if __name__ == "__main__":
    sys.exit(main())
