"""Bags of a made-up run, whose figures are known."""

from __future__ import annotations

import math
from types import SimpleNamespace

import numpy as np
import pytest

from shimmy_ros.bag.writer import BagWriter
from shimmy_ros.contract.messages import CODECS
from shimmy_ros.contract.records import (
    GearResponse,
    Level,
    LimitCycleAmplitude,
    LimitCycleOrbit,
    Status,
    TaxiVelocity,
)
from shimmy_ros.contract.spec import load_contract

START_NS = 1_700_000_000_000_000_000
NAMESPACE = "/shimmy"


def nanoseconds(time_s):
    """A time of the run [s] as a stamp."""
    return START_NS + round(1e9 * time_s)


class MadeUpRun:
    """Messages of a run, each at a time [s] from its first velocity sample."""

    def __init__(self):
        self.messages = []

    def add(self, topic, time_s, record):
        """One record of a topic."""
        self.messages.append((topic, nanoseconds(time_s), record))

    def velocity(self, time_s, velocity):
        """A sample of the taxi velocity."""
        self.add("taxi_velocity", time_s, TaxiVelocity(nanoseconds(time_s), velocity))

    def answer(self, time_s, amplitude, frequency=math.nan, sample_s=None, missed=(),
               outcome=None, beyond=""):
        """An answer of the predictor; amplitude 0, infinite or NaN without a cycle."""
        stamp_ns = nanoseconds(time_s if sample_s is None else sample_s)
        if outcome is None:
            outcome = {0.0: "no_limit_cycle", math.inf: "unbounded"}.get(amplitude, "limit_cycle")
            if math.isnan(amplitude):
                outcome = "not_rolling"
        four = (0.1 * amplitude, amplitude, 1.1 * amplitude, 0.2 * amplitude)
        count = 65 if outcome == "limit_cycle" else 0
        times = np.rint(np.linspace(0.0, 1e9 / frequency if count else 0.0, count)).astype(np.int64)
        records = {
            "limit_cycle/amplitude": LimitCycleAmplitude(stamp_ns, four, four),
            "limit_cycle/frequency": frequency,
            "limit_cycle/orbit": LimitCycleOrbit(
                stamp_ns, times, np.zeros((count, 4)), np.zeros((count, 4))),
            "limit_cycle/status": (Status(stamp_ns, "predictor: limit cycle", "x", Level.OK, "",
                                          {"outcome": outcome, "beyond_limits": beyond}),)}
        for topic, record in records.items():
            if topic not in missed:
                self.add(topic, time_s, record)

    def swivel(self, times_s, amplitude, frequency):
        """A harmonic motion of the swivel."""
        for time_s in times_s:
            phase = 2.0 * math.pi * frequency * time_s
            swing, rate = amplitude * math.sin(phase), math.cos(phase)
            self.add("gear_response", time_s, GearResponse(
                nanoseconds(time_s), (0.01, swing, 0.02, 0.03),
                (0.0, 2.0 * math.pi * frequency * amplitude * rate, 0.0, 0.0), (0.0,) * 4))

    def write(self, directory, close=True):
        """The bag, at ``directory``."""
        bag = BagWriter(directory)
        names = {topic.name: bag.add_topic(topic, NAMESPACE)
                 for topic in load_contract().recorded}
        for topic, time_ns, record in sorted(self.messages, key=lambda message: message[1]):
            bag.write(names[topic], CODECS[topic].encode(record), time_ns)
        if close:
            bag.close()
        return directory


def landing():
    """Standstill without an answer, shimmy of 0.1 rad at 10 Hz, and then none."""
    run = MadeUpRun()
    for index in range(50):
        run.velocity(0.1 * index, 60.0 - index if index >= 10 else 0.0)
        shimmy = 10 <= index < 40
        nothing = math.nan if index < 10 else 0.0
        run.answer(0.1 * index + 0.003, 0.1 if shimmy else nothing, 10.0 if shimmy else math.nan)
    run.swivel(np.arange(1.0, 4.0, 0.002), 0.098, 10.1)
    run.add("damper/coulomb_torque", 2.0, 15.0)
    run.add("damper/quadratic_damping", 2.001, 20.0)
    return run


def perilous():
    """Shimmy, beyond the limits from 1 s on, unbounded from 2 s, not periodic from 3 s, and from
    4 s to 5 s not converged; from 50 m/s on, 10 m/s slower every second."""
    run = MadeUpRun()
    for index in range(51):
        run.velocity(0.1 * index, 50.0 - index)
        kind = min(index // 10, 4)
        run.answer(0.1 * index, *[
            (0.1, 10.0), (0.8, 9.0), (math.inf,), (0.3,), (math.nan,)][kind],
            outcome=["limit_cycle", "limit_cycle", "unbounded", "not_periodic",
                     "not_converged"][kind],
            beyond="swivel 0.8 rad > 0.5 rad" if kind == 1 else "")
    run.swivel(np.arange(0.0, 5.0, 0.002), 0.2, 10.0)
    return run


@pytest.fixture
def made_up():
    """How to make up runs, and some of them."""
    return SimpleNamespace(Run=MadeUpRun, landing=landing, perilous=perilous, namespace=NAMESPACE)
