"""The simulator as a process."""

from __future__ import annotations

import sys
from collections.abc import Sequence

from .running import run


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the simulator until a signal stops it; returns the exit status."""
    return run("shimmy_ros.nodes.simulator_node", "SimulatorNode", arguments)


if __name__ == "__main__":
    sys.exit(main())
