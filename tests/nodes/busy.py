"""A predictor whose first answer does not come, in Python's code or in compiled code.

A process for the tests of endings; the parameter ``busy_in`` says in which of the two.
"""

from __future__ import annotations

import sys

import numba

from shimmy_ros.nodes.predictor_node import PredictorNode
from shimmy_ros.nodes.running import run


@numba.njit(nogil=True)
def compiled(turns):
    """Count, for minutes."""
    count = 0
    for turn in range(turns):
        count += turn % 7 ^ count
    return count


class BusyPredictor(PredictorNode):
    """Says that it is busy, and is busy from then on."""

    def __init__(self):
        super().__init__()
        self._busy_in = self.declare_parameter("busy_in", "python").value

    def _warm_up(self):
        compiled(10)

    def on_velocity(self, sample):
        print("busy", flush=True)
        while True:
            if self._busy_in == "compiled":
                compiled(10**12)


if __name__ == "__main__":
    sys.exit(run(__name__, "BusyPredictor"))
