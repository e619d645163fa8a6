"""Results as values that JSON has: SI units, null for what is not there or not known."""

from __future__ import annotations

import math
from collections.abc import Iterable

from ..cycles.limit_cycles import FoundCycle
from ..cycles.orbits import Orbit
from ..cycles.settings import Settings
from ..cycles.trigger import Threshold, Trigger
from ..cycles.verdict import Excess, Verdict, excesses
from ..gear.matrices import NAMES
from ..gear.system import OperatingPoint
from ..ihb.solution import Outcome
from .reply import Json

NOT_CONVERGED = Outcome.NOT_CONVERGED.value


def number(value: float | None) -> float | None:
    """``value``, or None for what is not finite."""
    return float(value) if value is not None and math.isfinite(value) else None


def by_joint(values: Iterable[float]) -> dict[str, float | None]:
    """Four values by the names of their joints."""
    return {name: number(value) for name, value in zip(NAMES, values, strict=True)}


def of_verdict(verdict: Verdict) -> Json:
    """What an operating point comes to, the cycle's numbers null without one."""
    orbit, kick = verdict.orbit, verdict.kick
    return {
        "outcome": verdict.outcome.value,
        "amplitude": None if orbit is None else by_joint(orbit.amplitude),
        "peak_velocity": None if orbit is None else by_joint(verdict.peak_velocity),
        "frequency": None if orbit is None else orbit.frequency_hz,
        "error": None if orbit is None else number(orbit.error),
        "method": None if orbit is None else orbit.method,
        "harmonics": None if orbit is None else orbit.harmonics or None,
        "multiplier": None if orbit is None else number(orbit.multiplier),
        "sticks": None if orbit is None else orbit.sticks,
        "envelope": None if verdict.envelope is None else by_joint(verdict.envelope),
        "beyond_limits": beyond_limits(verdict.excesses),
        "further_stable_cycles": [
            {"amplitude": by_joint(further.amplitude), "frequency": further.frequency_hz,
             "error": number(further.error)} for further in verdict.further],
        "rest_is_stable": verdict.rest_is_stable,
        "kick": None if kick is None else {
            "dies": kick.dies, "grows": kick.grows, "unbounded": kick.unbounded},
        "residual": number(verdict.residual),
        "message": verdict.message,
    }


def beyond_limits(found: Iterable[Excess]) -> list[Json]:
    """What passes the limits of the model, and by how much."""
    return [{"quantity": excess.quantity, "value": excess.value, "limit": excess.limit}
            for excess in found]


def of_orbit(point: OperatingPoint, orbit: Orbit, settings: Settings) -> Json:
    """A cycle with its stability; ``multiplier`` is the largest modulus of Floquet's."""
    return {
        "amplitude": by_joint(orbit.amplitude),
        "frequency": orbit.frequency_hz,
        "error": number(orbit.error),
        "method": orbit.method,
        "harmonics": orbit.harmonics or None,
        "stable": None if orbit.stable is None else bool(orbit.stable),
        "multiplier": number(orbit.multiplier),
        "sticks": bool(orbit.sticks),
        "beyond_limits": beyond_limits(excesses(point, orbit, settings.limits)),
    }


def of_found(point: OperatingPoint, cycle: FoundCycle, settings: Settings) -> Json:
    """A cycle with its role; one beyond the gear is true of the equations alone."""
    return {"role": cycle.role.value, **of_orbit(point, cycle.orbit, settings),
            "beyond_gear": cycle.beyond_gear}


def of_trigger(point: OperatingPoint, trigger: Trigger, settings: Settings) -> Json:
    """The smallest kick [rad/s] and release angle [rad] of the swivel that do not die."""
    return {
        "outcome": trigger.start.value,
        "cycle": None if trigger.cycle is None else of_found(point, trigger.cycle, settings),
        "kick": _threshold(trigger.kick),
        "release_angle": _threshold(trigger.release_angle),
        "message": trigger.message,
    }


def _threshold(threshold: Threshold | None) -> Json | None:
    return None if threshold is None else {
        "starts": threshold.starts, "dies": threshold.dies, "leads_to": threshold.leads_to.value}


def failure(error: BaseException) -> Json:
    """What did not converge."""
    return {"outcome": NOT_CONVERGED, "message": f"did not converge: {error}"}
