"""Every odd limit cycle at one operating point, each found by exact shooting.

An orbit scaled by s is one of the gear with C_d/s and s T_CF: up to scale, the cycles depend on the
product of the two alone. As it grows, cycles meet in folds and vanish. A gear is therefore followed
from a product at which one harmonic knows all its cycles, up through the folds and back down: with
more friction, and, where its own product is smaller, from there with less friction or, for cycles
whose size is set by the friction, with less quadratic damping. What does not hang together with
these branches is looked for from the one-harmonic cycles at the point itself, and from the stable
cycles that are known.
"""

from __future__ import annotations

import enum
import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from ..gear.linear import linear_modes
from ..gear.matrices import DAMPER, SWIVEL
from ..gear.parameters import changed
from ..gear.system import OperatingPoint, family_between, gear_system
from ..ihb.arclength import ContinuationError
from ..ihb.harmonics import to_complex, with_harmonics
from ..ihb.stability import stability
from ..ihb.system import Family, System
from ..shooting import continuation as shooting_continuation
from ..shooting.cycle import Cycle
from ..simulation.simulation import ANGLE_LIMIT
from .one_harmonic import OneHarmonicCycle, fold_torques, one_harmonic_cycles
from .orbits import Orbit, balance_orbit, converge, shoot, shooting_orbit
from .stable_cycle import stable_cycle

Real = NDArray[np.float64]

# The folds lie at 0.9 to 1.5 of the friction at which one harmonic puts them.
_BELOW_FOLDS = 0.5
_FIRST_STEP, _LARGEST_STEP = 0.1, 0.6
_MOST_POINTS = 400
_SAME = 1e-6
# Further apart than by these factors, an estimate is of another cycle.
_SAME_AMPLITUDE, _SAME_FREQUENCY = 3.5, 1.7
_HARMONICS = (4, 8)
_FAR_HARMONICS = 32
_FAR_STEPS = 640
_FAR_ERROR = 0.01


class Role(enum.Enum):
    """What a limit cycle is to the gear: the trigger is the unstable cycle that borders on rest."""

    STABLE = "stable"
    TRIGGER = "trigger"
    UNSTABLE = "unstable"


@dataclass(frozen=True)
class FoundCycle:
    """A limit cycle and its ``role``; ``orbit.method`` is what vouches for it.

    ``multipliers`` (7,) are the Floquet multipliers of the full period but for the one of a shift
    in time, the largest first.
    """

    orbit: Orbit
    role: Role
    multipliers: NDArray[np.complex128]

    @property
    def beyond_gear(self) -> bool:
        """Whether an angle passes ANGLE_LIMIT: true of the equations, but not of any gear."""
        return _beyond_gear(self.orbit.amplitude)


def all_cycles(point: OperatingPoint, stable: Sequence[Orbit] | None = None) -> list[FoundCycle]:
    """Every odd limit cycle that can be found at ``point``, by ascending swivel amplitude.

    ``stable`` are the stable ones that are known, by default those of stable_cycle(); all of them
    will be among the ones found.
    Cycles that are not odd, x(t + T/2) = -x(t), are not looked for. Unstable ones outside all
    stable ones, where the damper locks and the equations are stiff, are from harmonic balance, and
    only those near one that one harmonic knows. Raises ContinuationError where a branch could not
    be followed to its end: cycles may then be missing.
    """
    search = _Search(point)
    search.run(stable_cycle(point).stable_cycles if stable is None else stable)
    system = gear_system(point)
    orbits = sorted(search.found, key=lambda orbit: orbit.swivel)
    found: list[FoundCycle] = []
    for orbit in orbits:
        multipliers = _multipliers(system, orbit)
        role = Role.STABLE if orbit.stable else Role.UNSTABLE
        # What lies outside all stable cycles borders on growth without end, not on shimmy, unless
        # nothing limits shimmy itself.
        inside = point.damper.quadratic_damping == 0.0 or not _outer(orbit, orbits)
        if (rest_is_stable(point) and inside and not _beyond_gear(orbit.amplitude)
                and np.count_nonzero(np.abs(multipliers) > 1.0) == 1
                and all(other.role is not Role.TRIGGER for other in found)):
            role = Role.TRIGGER
        found.append(FoundCycle(replace(orbit, multiplier=float(np.abs(multipliers).max())),
                                role, multipliers))
    return found


def rest_is_stable(point: OperatingPoint) -> bool:
    """Whether small motion dies: by friction, or because no mode grows."""
    return point.damper.coulomb_torque > 0.0 or bool(
        linear_modes(point.gear, point.damper, point.velocity).growth_rate[0] < 0.0)


class _Search:
    """The cycles ``found`` at a point so far."""

    def __init__(self, point: OperatingPoint) -> None:
        self._point = point
        self.found: list[Orbit] = []

    def run(self, stable: Sequence[Orbit]) -> None:
        """Find all cycles, those that are known to be ``stable`` included."""
        point = self._point
        if point.damper.coulomb_torque > 0.0:
            curbed = point if point.damper.quadratic_damping > 0.0 else _with_damping(point, 1.0)
            folds = fold_torques(curbed)
            if folds:
                self._through_folds(curbed, folds[0])
        for guess in _unmatched(one_harmonic_cycles(point), self.found):
            orbit = _near_guess(point, guess, self.found)
            if orbit is not None and self._add(orbit) and not _outer(orbit, self.found):
                self._from_here(orbit)
        for orbit in _by_shooting(point, stable):
            if self._add(orbit) and isinstance(orbit.source, Cycle):
                self._from_here(orbit)

    def _through_folds(self, curbed: OperatingPoint, fold: float) -> None:
        """Follow all cycles with a friction of half of ``fold``, that of the lowest fold, up."""
        base = _BELOW_FOLDS * fold
        start = _with_friction(curbed, base)
        own = self._point.damper.coulomb_torque
        # Below the base, and without quadratic damping, the point's own level is not passed.
        above = curbed is self._point and own > base
        levels = (base, own) if above else (base,)
        ends: list[Orbit] = []
        # Small cycles stick and are at the other ends of the large ones' branches.
        for guess in reversed(one_harmonic_cycles(start)):
            if not _unmatched([guess], ends):
                continue
            orbit = _near_guess(start, guess, ends)
            if orbit is None or _outer(orbit, ends) or (
                    any(orbit.same_as(end, _SAME) for end in ends)):
                continue
            ends.append(orbit)
            ends += self._walk(curbed, orbit, levels, 0, 1, fold)
        if not above:
            for end in ends:
                self._descend(start, end)

    def _from_here(self, orbit: Orbit) -> None:
        """Follow a branch that was met at the point itself with more friction and with less."""
        own = self._point.damper.coulomb_torque
        if own > 0.0 and self._point.damper.quadratic_damping > 0.0:
            for direction in (1, -1):
                self._walk(self._point, orbit, (_BELOW_FOLDS * own, own), 1, direction, own)

    def _walk(self, curbed: OperatingPoint, start: Orbit, levels: tuple[float, ...], level: int,
              direction: int, scale: float) -> list[Orbit]:
        """Follow a branch over the friction from one of the ascending ``levels`` to others.

        Keeps the cycles at level 1, which is the point's own. Ends where the branch passes level 0
        downwards, and returns the cycle there; or where it closes or ends.
        """
        family = _over_friction(curbed)
        ends = (-math.inf, *levels, math.inf)
        orbit = start
        for _ in range(_MOST_POINTS):
            bounds = (ends[level + 1], ends[level + 2]) if direction > 0 else (
                ends[level], ends[level + 1])
            orbit, parameter = _last(family, orbit, levels[level], direction, scale, bounds)
            arrived = [place for place, value in enumerate(levels)
                       if math.isclose(value, parameter, rel_tol=1e-12)]
            if not arrived:
                return []
            if arrived[0] == level:
                direction = -direction
            level = arrived[0]
            if orbit.same_as(start, _SAME) or (level == 1 and not self._add(orbit)):
                return []
            if level == 0 and direction < 0:
                return [orbit]
        raise ContinuationError(f"a branch passes {levels[-1]:g} N m without end")

    def _descend(self, start: OperatingPoint, end: Orbit) -> None:
        """Follow a cycle from ``start`` down to the smaller product of the point."""
        damper = self._point.damper
        if end.stable:
            if damper.quadratic_damping == 0.0:
                # It grows beyond all bounds as the damping that limits it goes.
                return
            family = _over_friction(self._point)
            low, high = damper.coulomb_torque, start.damper.coulomb_torque
        else:
            family = _over_damping(self._point)
            factor = damper.coulomb_torque / start.damper.coulomb_torque
            low, high = damper.quadratic_damping, start.damper.quadratic_damping / factor
            scaled = shoot(family.system(high), factor * _cycle(end).state, _cycle(end).period)
            if scaled is None:
                raise ContinuationError(f"a cycle is lost at {high:g} N m s^2/rad^2")
            end = scaled
        orbit, reached = _last(family, end, high, -1, high, (low, high))
        if abs(reached - low) <= 1e-12 * high:
            self._add(orbit)

    def _add(self, orbit: Orbit) -> bool:
        if any(orbit.same_as(other, _SAME) for other in self.found):
            return False
        self.found.append(orbit)
        return True


def _by_shooting(point: OperatingPoint, stable: Sequence[Orbit]) -> list[Orbit]:
    """The same cycles, exact where shooting confirms them."""
    found = []
    for orbit in stable:
        shot = None
        if not isinstance(orbit.source, Cycle):
            shot = shoot(gear_system(point), *orbit.initial_state())
        found.append(shot if shot is not None and shot.stable and shot.same_as(orbit) else orbit)
    return found


def _last(family: Family, start: Orbit, parameter: float, direction: int, scale: float,
          bounds: tuple[float, float]) -> tuple[Orbit, float]:
    """The end of a branch within ``bounds``, and the parameter there."""
    points = shooting_continuation.continue_branch(
        family.system, _cycle(start), parameter, direction=direction, scale=scale, bounds=bounds,
        first_step=_FIRST_STEP, largest_step=_LARGEST_STEP, locate_folds=False)
    try:
        for count, found in enumerate(points):
            if count > _MOST_POINTS:
                raise ContinuationError(f"a branch is longer than {_MOST_POINTS} points")
            last = found
    except shooting_continuation.ContinuationError as error:
        raise ContinuationError(str(error)) from error
    return shooting_orbit(last.cycle, last.residual), last.parameter


def _near_guess(point: OperatingPoint, guess: OneHarmonicCycle, found: Sequence[Orbit]
                ) -> Orbit | None:
    """The cycle near a one-harmonic one, or None where Newton's method leads to none."""
    if all(guess.swivel > orbit.swivel for orbit in found if orbit.stable):
        far = _balanced(point, guess, _FAR_HARMONICS)
        if far is not None and _outer(far, found) and far.error <= _FAR_ERROR and (
                _near(far, guess)):
            return far
    system = gear_system(point)
    direct = shoot(system, *_one_harmonic_start(guess))
    if direct is not None and _near(direct, guess):
        return direct
    for harmonics in _HARMONICS:
        balanced = _balanced(point, guess, harmonics)
        orbit = None if balanced is None else shoot(system, *balanced.initial_state())
        if orbit is not None and _near(orbit, guess):
            return orbit
    return None


def _outer(orbit: Orbit, found: Sequence[Orbit]) -> bool:
    """Whether an unstable ``orbit`` is larger than every stable one."""
    return orbit.stable is False and all(
        orbit.swivel > other.swivel for other in found if other.stable)


def _one_harmonic_start(guess: OneHarmonicCycle) -> tuple[Real, float]:
    """The state (8,) where the swivel passes zero upwards, and the period [s]."""
    x = to_complex(guess.coefficients)[:, 0]
    x = x * np.exp(-1j * (0.5 * np.pi + np.angle(x[SWIVEL])))
    return (np.concatenate([x.real, (1j * guess.frequency * x).real]),
            2.0 * np.pi / guess.frequency)


def _balanced(point: OperatingPoint, guess: OneHarmonicCycle, harmonics: int) -> Orbit | None:
    system = gear_system(point)
    cycle = converge(system, with_harmonics(guess.coefficients, harmonics), guess.frequency)
    return None if cycle is None else balance_orbit(system, cycle)


def _unmatched(guesses: Sequence[OneHarmonicCycle], found: Sequence[Orbit]
               ) -> list[OneHarmonicCycle]:
    """The guesses that are left when each orbit found has taken the one nearest to it."""
    pairs = sorted((abs(math.log(guess.swivel / orbit.swivel)), i, j)
                   for i, guess in enumerate(guesses) for j, orbit in enumerate(found)
                   if _near(orbit, guess))
    taken: dict[int, int] = {}
    for _, i, j in pairs:
        if i not in taken and j not in taken.values():
            taken[i] = j
    return [guess for i, guess in enumerate(guesses) if i not in taken]


def _near(orbit: Orbit, guess: OneHarmonicCycle) -> bool:
    return (abs(math.log(orbit.swivel / guess.swivel)) < math.log(_SAME_AMPLITUDE)
            and abs(math.log(orbit.frequency_hz / guess.frequency_hz)) < math.log(_SAME_FREQUENCY))


def _beyond_gear(amplitude: Real) -> bool:
    return bool(amplitude[:DAMPER + 1].max() > ANGLE_LIMIT)


def _multipliers(system: System, orbit: Orbit) -> NDArray[np.complex128]:
    if isinstance(orbit.source, Cycle):
        return orbit.source.multipliers
    return np.asarray(stability(system, orbit.source, _FAR_STEPS).full_period)


def _cycle(orbit: Orbit) -> Cycle:
    assert isinstance(orbit.source, Cycle)
    return orbit.source


def _with_friction(point: OperatingPoint, torque: float) -> OperatingPoint:
    return replace(point, damper=changed(point.damper, coulomb_torque=torque))


def _with_damping(point: OperatingPoint, quadratic: float) -> OperatingPoint:
    return replace(point, damper=changed(point.damper, quadratic_damping=quadratic))


def _over_friction(point: OperatingPoint) -> Family:
    """The systems over T_CF [N m]."""
    return family_between(_with_friction(point, 0.0), _with_friction(point, 1.0))


def _over_damping(point: OperatingPoint) -> Family:
    """The systems over C_d [N m s^2/rad^2], zero included."""
    return family_between(_with_damping(point, 0.0), _with_damping(point, 1.0))
