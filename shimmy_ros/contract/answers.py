"""A prediction as the records of the predictor's topics."""

from __future__ import annotations

import math
from collections.abc import Mapping
from functools import lru_cache

import numpy as np

from ..cycles.prediction import NOT_ROLLING, Prediction
from ..ihb.harmonics import Real, orders
from ..ihb.solution import LimitCycle, Outcome
from .records import JOINTS, Level, LimitCycleAmplitude, LimitCycleOrbit, Status

ORBIT_INTERVALS = 64
"""Intervals of a published orbit, which has one point more: the first and the last agree."""

ANSWER_TOPICS = ("limit_cycle/amplitude", "limit_cycle/frequency", "limit_cycle/orbit",
                 "limit_cycle/status")
"""The topics of an answer to a velocity sample."""

Record = LimitCycleAmplitude | LimitCycleOrbit | float | tuple[Status, ...]


def answer(prediction: Prediction, stamp_ns: int, hardware_id: str,
           solve_time_s: float = math.nan) -> Mapping[str, Record]:
    """The records of the predictor's topics, by name, stamped with the velocity sample's stamp.

    Without a limit cycle, amplitudes are zero, the frequency is NaN and the orbit has no points;
    where there is no answer (not converged, not rolling) amplitudes are NaN as well.
    """
    cycle = prediction.limit_cycle
    if cycle is None:
        known = prediction.outcome == Outcome.NO_LIMIT_CYCLE.value
        nothing = (0.0 if known else math.nan,) * len(JOINTS)
        amplitude = LimitCycleAmplitude(stamp_ns, nothing, nothing)
    else:
        amplitude = LimitCycleAmplitude(
            stamp_ns, tuple(cycle.amplitude().tolist()), tuple(cycle.peak_velocity().tolist()))
    return {
        "limit_cycle/amplitude": amplitude,
        "limit_cycle/frequency": math.nan if cycle is None else cycle.frequency_hz,
        "limit_cycle/orbit": _orbit(cycle, stamp_ns),
        "limit_cycle/status": (_status(prediction, stamp_ns, hardware_id, solve_time_s),),
    }


def _orbit(cycle: LimitCycle | None, stamp_ns: int) -> LimitCycleOrbit:
    if cycle is None:
        none = np.zeros((0, len(JOINTS)))
        return LimitCycleOrbit(stamp_ns, np.zeros(0, dtype=np.int64), none, none)
    shares, waves, slopes = _sampling(cycle.harmonics)
    coefficients = cycle.coefficients.T
    times_ns = np.rint(1e9 * cycle.period * shares).astype(np.int64)
    return LimitCycleOrbit(stamp_ns, times_ns, waves @ coefficients,
                           cycle.frequency * (slopes @ coefficients))


@lru_cache(maxsize=8)
def _sampling(harmonics: int) -> tuple[Real, Real, Real]:
    """Shares of the period at which an orbit is sampled, shape (m,); what gives its positions
    there from the coefficients, and its derivatives by tau, both of shape (m, 2N)."""
    shares = np.linspace(0.0, 1.0, ORBIT_INTERVALS + 1)
    order = orders(harmonics)
    angles = 2.0 * np.pi * np.multiply.outer(shares, order)
    angles[-1] = angles[0]
    cosines, sines = np.cos(angles), np.sin(angles)
    return (shares, np.concatenate([cosines, sines], axis=1),
            np.concatenate([-order * sines, order * cosines], axis=1))


def _status(prediction: Prediction, stamp_ns: int, hardware_id: str, solve_time_s: float
            ) -> Status:
    level = Level.OK
    if prediction.failed:
        level = Level.ERROR
    elif prediction.outcome == NOT_ROLLING:
        level = Level.WARN
    damper = prediction.point.damper
    return Status(stamp_ns, "predictor: limit cycle", hardware_id, level, prediction.message, {
        "outcome": prediction.outcome,
        "taxi_velocity": repr(prediction.point.velocity),
        "linear_damping": repr(damper.linear_damping),
        "quadratic_damping": repr(damper.quadratic_damping),
        "coulomb_torque": repr(damper.coulomb_torque),
        "harmonics": str(prediction.harmonics),
        "iterations": str(prediction.iterations),
        "residual": repr(prediction.residual),
        "start": "warm" if prediction.warm else "cold",
        "solve_time": repr(solve_time_s),
    })
