"""Results as values that JSON has: SI units, null for what is not there or not known."""

from __future__ import annotations

import math
from collections.abc import Iterable

from ..cycles.limit_cycles import FoundCycle
from ..cycles.orbits import Orbit
from ..cycles.prediction import Prediction
from ..cycles.trigger import Threshold, Trigger
from ..gear.matrices import NAMES
from .reply import Json

NOT_CONVERGED = "not_converged"


def number(value: float | None) -> float | None:
    """``value``, or None for what is not finite."""
    return float(value) if value is not None and math.isfinite(value) else None


def by_joint(values: Iterable[float]) -> dict[str, float | None]:
    """Four values by the names of their joints."""
    return {name: number(value) for name, value in zip(NAMES, values, strict=True)}


def of_prediction(prediction: Prediction, error: float | None) -> Json:
    """A prediction, with the estimated relative error of its amplitudes and frequency."""
    cycle = prediction.limit_cycle
    return {
        "outcome": prediction.outcome,
        "amplitude": None if cycle is None else by_joint(cycle.amplitude()),
        "peak_velocity": None if cycle is None else by_joint(cycle.peak_velocity()),
        "frequency": None if cycle is None else cycle.frequency_hz,
        "error": number(error),
        "method": "ihb",
        "harmonics": prediction.harmonics,
        "iterations": prediction.iterations,
        "residual": number(prediction.residual),
        "message": prediction.message,
    }


def of_orbit(orbit: Orbit) -> Json:
    """A cycle with its stability; ``multiplier`` is the largest modulus of Floquet's."""
    return {
        "amplitude": by_joint(orbit.amplitude),
        "frequency": orbit.frequency_hz,
        "error": number(orbit.error),
        "method": orbit.method,
        "harmonics": orbit.harmonics or None,
        "stable": orbit.stable,
        "multiplier": number(orbit.multiplier),
        "sticks": orbit.sticks,
    }


def of_found(cycle: FoundCycle) -> Json:
    """A cycle with its role; one beyond the gear is true of the equations alone."""
    return {"role": cycle.role.value, **of_orbit(cycle.orbit), "beyond_gear": cycle.beyond_gear}


def of_trigger(trigger: Trigger) -> Json:
    """The smallest kick [rad/s] and release angle [rad] of the swivel that start shimmy."""
    return {
        "outcome": trigger.start.value,
        "cycle": None if trigger.cycle is None else of_found(trigger.cycle),
        "kick": _threshold(trigger.kick),
        "release_angle": _threshold(trigger.release_angle),
        "message": trigger.message,
    }


def _threshold(threshold: Threshold | None) -> Json | None:
    return None if threshold is None else {"starts": threshold.starts, "dies": threshold.dies}


def failure(error: BaseException) -> Json:
    """What did not converge."""
    return {"outcome": NOT_CONVERGED, "message": f"did not converge: {error}"}
