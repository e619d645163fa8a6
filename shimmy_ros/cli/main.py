"""The ``shimmy`` command: one subcommand a module."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence

from ..bag.errors import BagError
from ..gear.parameters import ParameterError
from . import ask, demo, figures, map, predict, replay, salvage, sweep
from .progress import INTERRUPTED

FAILED = 1
BAD_INPUT = 2


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command; 0 with an answer, 1 for a failure, 2 on bad input, 130 when interrupted."""
    parser = argparse.ArgumentParser(
        prog="shimmy", description="Limit cycles of landing-gear shimmy.")
    commands = parser.add_subparsers(title="commands", required=True, metavar="COMMAND")
    for module in (predict, ask, sweep, map, figures, replay, salvage, demo):
        module.add_command(commands)
    options = parser.parse_args(arguments)
    try:
        return int(options.run(options))
    except (ParameterError, BagError) as error:
        print(f"shimmy: {error}", file=sys.stderr)
        return BAD_INPUT
    except OSError as error:
        print(f"shimmy: {error}", file=sys.stderr)
        return FAILED
    except KeyboardInterrupt:
        return INTERRUPTED


if __name__ == "__main__":
    sys.exit(main())
