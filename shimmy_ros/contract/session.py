"""What the predictor does with each message: the live node and a replay both ask this."""

from __future__ import annotations

from dataclasses import replace

from ..cycles.prediction import Predictor
from ..cycles.verdict import Verdict
from ..gear.parameters import VELOCITY_RANGE, Damper, Gear
from ..gear.system import OperatingPoint
from .records import TaxiVelocity

REFERENCE_HARDWARE = "reference gear (invented)"
"""Default hardware_id of every diagnostic."""

UNSTAMPED = "a velocity sample has a stamp of zero; such samples get the time of their receipt"


class Session:
    """A predictor's state between messages: gear, damper, last velocity sample, warm start.

    The same samples and the same changes in the same order give the same answers, to the last bit.
    ``jumps`` counts how often time went back, ``unstamped`` the samples without a stamp.
    """

    def __init__(self, gear: Gear, damper: Damper, predictor: Predictor) -> None:
        self.gear = gear
        self.damper = damper
        self.predictor = predictor
        self.sample: TaxiVelocity | None = None
        self.jumps = 0
        self.unstamped = 0
        # Samples with a stamp may follow another clock than those without.
        self._latest_ns: dict[bool, int] = {}

    def take(self, sample: TaxiVelocity, received_ns: int) -> str:
        """Make ``sample`` the current one; a stamp of zero gives way to ``received_ns``.

        Returns a sentence where time jumped back, which drops the warm start, and else "". Raises
        ParameterError, and changes nothing, for a velocity outside its range.
        """
        VELOCITY_RANGE.check("taxi_velocity", sample.velocity)
        stamped = sample.stamp_ns != 0
        if not stamped:
            self.unstamped += 1
            sample = replace(sample, stamp_ns=received_ns)
        back_ns = self._latest_ns.get(stamped, sample.stamp_ns) - sample.stamp_ns
        self._latest_ns[stamped] = sample.stamp_ns
        self.sample = sample
        if back_ns <= 0:
            return ""
        self.jumps += 1
        self.predictor.forget()
        return f"time jumped back by {1e-9 * back_ns:g} s; the next answer starts cold"

    def predict(self) -> Verdict | None:
        """The answer for the current sample, gear and damper; None before the first sample."""
        if self.sample is None:
            return None
        return self.predictor.predict(OperatingPoint(self.gear, self.damper, self.sample.velocity))
