"""A verdict as the records of the predictor's topics."""

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
    from ..cycles.verdict import Verdict

Real = NDArray[np.float64]

ORBIT_INTERVALS = 64
"""Intervals of a published orbit, which has one point more: the first and the last agree."""

ANSWER_TOPICS = ("limit_cycle/amplitude", "limit_cycle/frequency", "limit_cycle/orbit",
                 "limit_cycle/status")
"""The topics of an answer to a velocity sample."""

Record = LimitCycleAmplitude | LimitCycleOrbit | float | tuple[Status, ...]

_LEVELS = {
    "limit_cycle": Level.OK, "no_limit_cycle": Level.OK, "not_periodic": Level.WARN,
    "not_rolling": Level.WARN, "unbounded": Level.ERROR, "not_converged": Level.ERROR}


@dataclass(frozen=True)
class Course:
    """The course of a limit cycle: ``coefficients`` (4, 2N), angular ``frequency`` [rad/s]."""

    coefficients: Real
    frequency: float


@dataclass(frozen=True)
class Findings:
    """What a verdict says, in plain values: it can be sent to a process without the solver.

    ``amplitude`` and ``peak_velocity`` are those of the joints, to be compared with a limit: zero
    without a limit cycle alone, infinite for motion that grows without bound, NaN where nothing is
    known. ``course`` is there exactly if there is a limit cycle. ``values`` are the status's.
    """

    level: Level
    message: str
    amplitude: tuple[float, ...]
    peak_velocity: tuple[float, ...]
    course: Course | None
    values: Mapping[str, str]

    @property
    def outcome(self) -> str:
        """How it ended, by its name in the contract."""
        return self.values["outcome"]


def findings(verdict: Verdict) -> Findings:
    """What ``verdict`` says; a limit cycle beyond the model's limits is no ordinary answer."""
    outcome, orbit = verdict.outcome.value, verdict.orbit
    level = _LEVELS[outcome]
    beyond = verdict.beyond_limits
    if beyond:
        level = max(level, Level.WARN)
    course, harmonics = None, verdict.settings.harmonics
    if orbit is not None:
        series = orbit.series
        course = Course(series.coefficients, series.frequency)
        harmonics = orbit.harmonics or harmonics
    damper = verdict.point.damper
    return Findings(
        level, verdict.message, tuple(verdict.amplitude.tolist()),
        tuple(verdict.peak_velocity.tolist()), course, {
            "outcome": outcome,
            "taxi_velocity": repr(verdict.point.velocity),
            "linear_damping": repr(damper.linear_damping),
            "quadratic_damping": repr(damper.quadratic_damping),
            "coulomb_torque": repr(damper.coulomb_torque),
            "method": "" if orbit is None else orbit.method,
            "harmonics": str(harmonics),
            "work": str(verdict.work),
            "residual": repr(verdict.residual),
            "start": "warm" if verdict.warm else "cold",
            "beyond_limits": beyond,
            "further_stable_cycles": str(len(verdict.further)),
            "rest": {True: "stable", False: "unstable", None: ""}[verdict.rest_is_stable],
        })


def answer(found: Findings, stamp_ns: int, hardware_id: str, solve_time_s: float = math.nan
           ) -> Mapping[str, Record]:
    """The records of the predictor's topics, by name, stamped with the velocity sample's stamp.

    Without a limit cycle the frequency is NaN and the orbit has no points.
    """
    course = found.course
    return {
        "limit_cycle/amplitude": LimitCycleAmplitude(
            stamp_ns, found.amplitude, found.peak_velocity),
        "limit_cycle/frequency": math.nan if course is None else course.frequency / (2.0 * math.pi),
        "limit_cycle/orbit": _orbit(course, stamp_ns),
        "limit_cycle/status": (Status(
            stamp_ns, "predictor: limit cycle", hardware_id, found.level, found.message,
            {**found.values, "solve_time": repr(solve_time_s)}),),
    }


def answer_messages(names: Mapping[str, str], found: Findings, stamp_ns: int, hardware_id: str
                    ) -> Iterator[tuple[str, bytes]]:
    """The messages of an answer, with the ``names`` that their topics have in a bag."""
    for name, record in answer(found, stamp_ns, hardware_id).items():
        yield names[name], CODECS[name].encode(record)


def _orbit(course: Course | None, stamp_ns: int) -> LimitCycleOrbit:
    if course is None:
        none = np.zeros((0, len(JOINTS)))
        return LimitCycleOrbit(stamp_ns, np.zeros(0, dtype=np.int64), none, none)
    coefficients = course.coefficients.T
    shares, waves, slopes = _sampling(len(coefficients) // 2)
    period = 2.0 * math.pi / course.frequency
    times_ns = np.rint(1e9 * period * shares).astype(np.int64)
    return LimitCycleOrbit(stamp_ns, times_ns, waves @ coefficients,
                           course.frequency * (slopes @ coefficients))


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
