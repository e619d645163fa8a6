"""The predictor as a process."""

from __future__ import annotations

import sys
from collections.abc import Sequence

from .running import run


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the predictor until a signal stops it; returns the exit status."""
    return run("shimmy_ros.nodes.predictor_node", "PredictorNode", arguments)


if __name__ == "__main__":
    sys.exit(main())
