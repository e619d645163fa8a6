"""A prediction as the records of the predictor's topics."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from functools import lru_cache
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from .messages import CODECS
from .records import JOINTS, Level, LimitCycleAmplitude, LimitCycleOrbit, Status

# Whoever only writes answers need not import the solver.
if TYPE_CHECKING:
    from ..cycles.prediction import Prediction

Real = NDArray[np.float64]

ORBIT_INTERVALS = 64
"""Intervals of a published orbit, which has one point more: the first and the last agree."""

ANSWER_TOPICS = ("limit_cycle/amplitude", "limit_cycle/frequency", "limit_cycle/orbit",
                 "limit_cycle/status")
"""The topics of an answer to a velocity sample."""

Record = LimitCycleAmplitude | LimitCycleOrbit | float | tuple[Status, ...]


@dataclass(frozen=True)
class CycleNumbers:
    """A limit cycle: ``coefficients`` (4, 2N), angular ``frequency`` [rad/s], peaks by joint."""

    coefficients: Real
    frequency: float
    amplitude: tuple[float, ...]
    peak_velocity: tuple[float, ...]


@dataclass(frozen=True)
class Findings:
    """What a prediction says, in plain values: it can be sent to a process without the solver.

    ``level`` is OK with an answer, which ``cycle`` is, or that there is none where that is None.
    """

    level: Level
    message: str
    cycle: CycleNumbers | None
    values: Mapping[str, str]


def findings(prediction: Prediction) -> Findings:
    """What ``prediction`` says."""
    level = Level.OK
    if prediction.failed:
        level = Level.ERROR
    elif prediction.stands:
        level = Level.WARN
    cycle, numbers = prediction.limit_cycle, None
    if cycle is not None:
        numbers = CycleNumbers(cycle.coefficients, cycle.frequency,
                               tuple(cycle.amplitude().tolist()),
                               tuple(cycle.peak_velocity().tolist()))
    damper = prediction.point.damper
    return Findings(level, prediction.message, numbers, {
        "outcome": prediction.outcome,
        "taxi_velocity": repr(prediction.point.velocity),
        "linear_damping": repr(damper.linear_damping),
        "quadratic_damping": repr(damper.quadratic_damping),
        "coulomb_torque": repr(damper.coulomb_torque),
        "harmonics": str(prediction.harmonics),
        "iterations": str(prediction.iterations),
        "residual": repr(prediction.residual),
        "start": "warm" if prediction.warm else "cold",
    })


def answer(found: Findings, stamp_ns: int, hardware_id: str, solve_time_s: float = math.nan
           ) -> Mapping[str, Record]:
    """The records of the predictor's topics, by name, stamped with the velocity sample's stamp.

    Without a limit cycle, amplitudes are zero, the frequency is NaN and the orbit has no points;
    where there is no answer (not converged, not rolling) amplitudes are NaN as well.
    """
    cycle = found.cycle
    if cycle is None:
        nothing = (0.0 if found.level is Level.OK else math.nan,) * len(JOINTS)
        amplitude = LimitCycleAmplitude(stamp_ns, nothing, nothing)
    else:
        amplitude = LimitCycleAmplitude(stamp_ns, cycle.amplitude, cycle.peak_velocity)
    return {
        "limit_cycle/amplitude": amplitude,
        "limit_cycle/frequency": math.nan if cycle is None else cycle.frequency / (2.0 * math.pi),
        "limit_cycle/orbit": _orbit(cycle, stamp_ns),
        "limit_cycle/status": (Status(
            stamp_ns, "predictor: limit cycle", hardware_id, found.level, found.message,
            {**found.values, "solve_time": repr(solve_time_s)}),),
    }


def answer_messages(names: Mapping[str, str], found: Findings, stamp_ns: int, hardware_id: str
                    ) -> Iterator[tuple[str, bytes]]:
    """The messages of an answer, with the ``names`` that their topics have in a bag."""
    for name, record in answer(found, stamp_ns, hardware_id).items():
        yield names[name], CODECS[name].encode(record)


def _orbit(cycle: CycleNumbers | None, stamp_ns: int) -> LimitCycleOrbit:
    if cycle is None:
        none = np.zeros((0, len(JOINTS)))
        return LimitCycleOrbit(stamp_ns, np.zeros(0, dtype=np.int64), none, none)
    coefficients = cycle.coefficients.T
    shares, waves, slopes = _sampling(len(coefficients) // 2)
    period = 2.0 * math.pi / cycle.frequency
    times_ns = np.rint(1e9 * period * shares).astype(np.int64)
    return LimitCycleOrbit(stamp_ns, times_ns, waves @ coefficients,
                           cycle.frequency * (slopes @ coefficients))


@lru_cache(maxsize=8)
def _sampling(harmonics: int) -> tuple[Real, Real, Real]:
    """Shares of the period at which an orbit is sampled, shape (m,); what gives its positions
    there from the coefficients, and its derivatives by tau, both of shape (m, 2N)."""
    shares = np.linspace(0.0, 1.0, ORBIT_INTERVALS + 1)
    order = np.arange(1.0, 2.0 * harmonics, 2.0)
    angles = 2.0 * np.pi * np.multiply.outer(shares, order)
    angles[-1] = angles[0]
    cosines, sines = np.cos(angles), np.sin(angles)
    return (shares, np.concatenate([cosines, sines], axis=1),
            np.concatenate([-order * sines, order * cosines], axis=1))
