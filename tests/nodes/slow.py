"""A simulator that takes long to close its bag, as on a slow disk; for the tests of endings."""

from __future__ import annotations

import sys
import time

from shimmy_ros.nodes.running import run
from shimmy_ros.nodes.simulator_node import SimulatorNode

CLOSING_S = 3.0


class SlowSimulator(SimulatorNode):
    """Waits before it closes the bag."""

    def end(self):
        if self.active:
            time.sleep(CLOSING_S)
        super().end()


if __name__ == "__main__":
    sys.exit(run(__name__, "SlowSimulator"))
