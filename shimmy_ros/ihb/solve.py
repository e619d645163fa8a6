"""Limit cycles of a system: cold, warm, and followed from one system to another."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from . import loops
from .continuation import ContinuationError, branch
from .describing_function import (
    FirstHarmonic,
    growing_cycles,
    reference_coordinate,
    with_coulomb_factor,
)
from .elements import Coulomb, OddElement, QuadraticDamping
from .harmonics import shifted, with_harmonics
from .newton import (
    RESIDUAL_TOLERANCE,
    STABLE_ORIENTATION,
    Convergence,
    Phase,
    Point,
    Solved,
    phase_of,
    solve_point,
)
from .settling import settled_motions
from .solution import LimitCycle, Outcome, Result
from .system import Family, System

# A residual of all coordinates may exceed that of the active ones by rounding alone.
CHECK_TOLERANCE = 100.0 * RESIDUAL_TOLERANCE
# A converged point further from its guess than this may lie on another branch.
LARGEST_WARM_CHANGE = 0.25
LARGEST_WARM_FREQUENCY_CHANGE = 0.1
_LARGEST_COLD_CHANGE = 0.6
_MAXIMUM_BRANCH_POINTS = 400
_FACTORS = (0.5, 0.25, 0.125, 0.0)


def solve_cold(system: System, harmonics: int) -> Result:
    """The limit cycle that a growing oscillation reaches, without a guess.

    The describing function gives the first harmonic. Where it sees no cycle, or the full balance
    does not converge from it, the Coulomb friction is reduced until one is found, and the branch
    is followed as the friction comes back: to the cycle, or to the fold in which it ends. Where
    the describing function does not lead there, motions without friction are integrated until they
    settle. Raises ValueError for a system with a singular mass or an element of negative strength.
    """
    system.check()
    if not system.elements:
        return _without(Outcome.NO_LIMIT_CYCLE, 0, False,
                        "no limit cycle: the system is linear")
    # Numbers out of range are found out where they matter.
    with np.errstate(all="ignore"):
        try:
            return _solve_cold(system, harmonics)
        except np.linalg.LinAlgError as error:
            return _without(Outcome.NOT_CONVERGED, 0, False, "did not converge: the matrices are "
                            f"beyond what can be computed with ({error})")


def _solve_cold(system: System, harmonics: int) -> Result:
    iterations = 0
    growth = growing_cycles(system)
    undecided = growth.undecided
    guesses = list(growth.cycles)
    for guess in growth.cycles:
        result = _from_first_harmonic(system, guess, harmonics)
        iterations += result.iterations
        if result.outcome is Outcome.LIMIT_CYCLE:
            return replace(result, iterations=iterations)
    rubs = any(isinstance(element, Coulomb) for element in system.elements)
    if rubs:
        family = _friction_family(system)
        for factor in _FACTORS:
            growth = growing_cycles(system, factor)
            undecided = undecided or growth.undecided
            guesses = list(growth.cycles)
            for guess in growth.cycles:
                start = _from_first_harmonic(with_coulomb_factor(system, factor), guess, harmonics)
                iterations += start.iterations
                if start.limit_cycle is None:
                    continue
                result = follow(family, start.limit_cycle, factor, 1.0)
                return replace(result, iterations=iterations + result.iterations, warm=False)
    if not undecided and not iterations:
        return _without(Outcome.NO_LIMIT_CYCLE, 0, False, "no limit cycle: no oscillation grows "
                        "from rest to one at which it would stop")
    result = _from_settled(system, guesses, harmonics)
    if result.limit_cycle is not None and rubs:
        iterations += result.iterations
        result = follow(family, result.limit_cycle, 0.0, 1.0)
    return replace(result, iterations=iterations + result.iterations, warm=False)


def solve_warm(system: System, start: LimitCycle) -> Result:
    """The limit cycle near ``start``, by Newton's method alone, with its number of harmonics.

    Fails, and says so, where Newton's method does not converge, and where it converges to a cycle
    too far from ``start`` to be of the same branch for certain. Raises ValueError as solve_cold.
    """
    system.check()
    if not system.elements:
        return _without(Outcome.NO_LIMIT_CYCLE, 0, True, "no limit cycle: the system is linear")
    active = system.nonlinear_dofs
    phase, point = placed(system, start, active)
    solved = solve_point(system, point, active, phase)
    converged = solved.convergence
    if not converged.converged:
        return _failed(converged, True)
    if converged.orientation != start.orientation or not _near(
            point, converged.point, LARGEST_WARM_CHANGE, LARGEST_WARM_FREQUENCY_CHANGE):
        return _without(Outcome.NOT_CONVERGED, converged.iterations, True,
                        "did not converge to a cycle near enough to be of the same branch",
                        converged.residual)
    return _checked(solved, True)


def follow(family: Family, start: LimitCycle, parameter: float, target: float) -> Result:
    """The limit cycle at parameter ``target`` on the branch of ``start`` at ``parameter``.

    Goes in one step where that is safe, otherwise in as many as the branch needs. The answer is
    NO_LIMIT_CYCLE where the branch turns back in a fold on the way, with the fold's parameter.
    """
    direct = solve_warm(family.system(target), start)
    if direct.outcome is Outcome.LIMIT_CYCLE or parameter == target:
        return direct
    result = follow_in_steps(family, start, parameter, target)
    return replace(result, iterations=result.iterations + direct.iterations)


def follow_in_steps(family: Family, start: LimitCycle, parameter: float, target: float) -> Result:
    """As follow, for two different parameters, in steps from the beginning."""
    iterations = 0
    system = family.system(parameter)
    active = _active(system, family.system(target))
    phase, point = placed(system, start, active)
    direction = 1 if target > parameter else -1
    scale = abs(target - parameter)
    previous = None
    try:
        for count, here in enumerate(branch(family, point, parameter, scale, direction, active,
                                            phase)):
            iterations += here.iterations
            if (here.parameter - target) * direction >= 0.0:
                assert previous is not None
                part = (target - previous.parameter) / (here.parameter - previous.parameter)
                guess = Point(
                    previous.point.coefficients
                    + part * (here.point.coefficients - previous.point.coefficients),
                    previous.point.frequency
                    + part * (here.point.frequency - previous.point.frequency))
                solved = solve_point(family.system(target), guess, active, phase)
                last = solved.convergence._replace(
                    iterations=solved.convergence.iterations + iterations)
                if not last.converged:
                    return _failed(last, True)
                if last.orientation != start.orientation:
                    return _without(Outcome.NOT_CONVERGED, last.iterations, True,
                                    "did not converge to a cycle of the same branch",
                                    last.residual)
                return _checked(solved._replace(convergence=last), True)
            if here.is_fold or here.slope * direction <= 0.0:
                share = 100.0 * (here.parameter - parameter) / (target - parameter)
                return _without(
                    Outcome.NO_LIMIT_CYCLE, iterations, True,
                    f"no limit cycle: the branch ends in a fold {share:.1f} % of the way",
                    here.residual)
            if count >= _MAXIMUM_BRANCH_POINTS:
                break
            previous = here
    except ContinuationError as error:
        return _without(Outcome.NOT_CONVERGED, iterations, True, f"did not converge: {error}")
    return _without(Outcome.NOT_CONVERGED, iterations, True,
                    f"did not converge: the branch is longer than {_MAXIMUM_BRANCH_POINTS} steps")


def _from_first_harmonic(system: System, guess: FirstHarmonic, harmonics: int) -> Result:
    """Newton's method at N harmonics from one; in between, by doubling, where that fails."""
    active = system.nonlinear_dofs
    iterations = 0
    reference = reference_coordinate(system)
    ladder = [harmonics]
    first = Point(guess.coefficients[list(active)], guess.frequency)
    while True:
        point = first
        for count in ladder:
            point = Point(with_harmonics(point.coefficients, count), point.frequency)
            solved = solve_point(system, point, active, phase_of(active, count, reference))
            iterations += solved.convergence.iterations
            converged = solved.convergence._replace(iterations=iterations)
            if not converged.converged or not _near(
                    Point(with_harmonics(first.coefficients, count), first.frequency),
                    converged.point, _LARGEST_COLD_CHANGE, _LARGEST_COLD_CHANGE):
                break
            point = converged.point
        else:
            if converged.orientation == STABLE_ORIENTATION:
                return _checked(solved._replace(convergence=converged), False)
            converged = converged._replace(message="the cycle found is unstable")
        if ladder[0] == 1:
            return _failed(converged, False)
        ladder = [max(1, ladder[0] // 2), *ladder]


def _from_settled(system: System, guesses: list[FirstHarmonic], harmonics: int) -> Result:
    """Newton's method, without friction, from what motions settle to."""
    free = with_coulomb_factor(system, 0.0)
    if not all(isinstance(e, (QuadraticDamping, OddElement)) for e in free.elements):
        return _without(
            Outcome.NOT_CONVERGED, 0, False, "did not converge: the describing function does not "
            "lead to a cycle, and an element is of a kind that is not integrated")
    result = _without(Outcome.NOT_CONVERGED, 0, False,
                      "did not converge: no motion that grows from rest settles to a cycle")
    if not free.elements:
        return result
    iterations = 0
    active = free.nonlinear_dofs
    for motion in settled_motions(free, guesses, harmonics):
        guess = LimitCycle(motion.coefficients, motion.frequency, STABLE_ORIENTATION)
        phase, point = placed(free, guess, active)
        solved = solve_point(free, point, active, phase)
        converged = solved.convergence
        iterations += converged.iterations
        converged = converged._replace(iterations=iterations)
        if not converged.converged:
            result = _failed(converged, False)
        elif converged.orientation == STABLE_ORIENTATION and _near(
                point, converged.point, _LARGEST_COLD_CHANGE, _LARGEST_COLD_CHANGE):
            return _checked(solved._replace(convergence=converged), False)
        else:
            result = _failed(converged._replace(
                message="the balance's cycle is not that of the motion"), False)
    return result


def placed(system: System, start: LimitCycle, active: tuple[int, ...]) -> tuple[Phase, Point]:
    """``start`` shifted in time so that the held coefficient is zero."""
    reference = reference_coordinate(system)
    coefficients = start.coefficients
    cosine, sine = coefficients[reference, 0], coefficients[reference, start.harmonics]
    if sine != 0.0 or cosine <= 0.0:
        coefficients = shifted(coefficients, float(np.arctan2(sine, cosine)))
        coefficients[reference, start.harmonics] = 0.0
    return (phase_of(active, start.harmonics, reference),
            Point(coefficients[list(active)], start.frequency))


def _near(before: Point, after: Point, largest: float, largest_in_frequency: float) -> bool:
    return (abs(after.frequency - before.frequency) <= largest_in_frequency * before.frequency
            and loops.largest_change(before.coefficients, after.coefficients) <= largest)


def _checked(solved: Solved, warm: bool) -> Result:
    """The result, if the balance of every coordinate, eliminated ones included, holds."""
    converged, residual = solved.convergence, solved.residual
    if not residual <= CHECK_TOLERANCE:
        return _without(Outcome.NOT_CONVERGED, converged.iterations, warm,
                        f"did not converge: the balance is left with a residual of {residual:.1e}",
                        residual)
    cycle = LimitCycle(solved.coefficients, converged.point.frequency, converged.orientation)
    return Result(Outcome.LIMIT_CYCLE, cycle, converged.iterations, residual, warm,
                  "limit cycle found")


def _failed(converged: Convergence, warm: bool) -> Result:
    return _without(Outcome.NOT_CONVERGED, converged.iterations, warm,
                    f"did not converge: {converged.message}", converged.residual)


def _without(outcome: Outcome, iterations: int, warm: bool, message: str,
             residual: float = float("nan")) -> Result:
    return Result(outcome, None, iterations, residual, warm, message)


def _active(*systems: System) -> tuple[int, ...]:
    return tuple(sorted({dof for system in systems for dof in system.nonlinear_dofs}))


def _friction_family(system: System) -> Family:
    """Systems along a factor of every Coulomb torque."""
    zero = np.zeros_like(system.mass)
    rest = tuple(e for e in system.elements if not isinstance(e, Coulomb))
    friction = tuple(e for e in system.elements if isinstance(e, Coulomb))

    def at(factor: float) -> System:
        weakened = tuple(replace(e, torque=factor * e.torque) for e in friction)
        return replace(system, elements=(*weakened, *rest))

    derivative = System(zero, zero, zero, friction)
    return Family(at, lambda factor: derivative)
