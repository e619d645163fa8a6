"""The one policy: the stable limit cycle at an operating point, to the accuracy asked for.

The gear at rest is kicked at the swivel. The smallest kick of a ladder that does not die decides:
it leads to the limit cycle, grows beyond half a turn, or roams. Where every one dies, kicks smaller
than the ladder's are tried as well, since large ones may lock the damper and pass a cycle by.

A verdict nearby saves work and changes no answer: its cycles, carried to the point and found stable
there, capture motions at once; and where all kicks led to one cycle from one kick on, neither kicks
nor the error estimate are needed again very near.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from ..gear.parameters import VELOCITY_RANGE
from ..gear.system import OperatingPoint, gear_system
from ..ihb.solution import Outcome
from .budget import Budget, BudgetError
from .kicks import KICKS, SAME, Course, Fate, Kicks
from .orbits import Orbit
from .refinement import balance_near, balanced, guess_from_orbit
from .settings import SHOOTING, Settings
from .verdict import Kick, Ladder, Verdict

# An error below this part of what is allowed is not estimated anew nearby.
_SAFE = 0.35

_OUTCOMES = {Fate.DIES: Outcome.NO_LIMIT_CYCLE, Fate.CYCLE: Outcome.LIMIT_CYCLE,
             Fate.GROWS: Outcome.UNBOUNDED, Fate.ROAMS: Outcome.NOT_PERIODIC,
             Fate.UNTOLD: Outcome.NOT_CONVERGED}


def stable_cycle(point: OperatingPoint, settings: Settings | None = None,
                 start: Verdict | None = None) -> Verdict:
    """The verdict at ``point``; ``start``, one at a point nearby, saves work and changes no answer.

    Raises ParameterError for a velocity outside its range.
    """
    settings = settings or Settings()
    VELOCITY_RANGE.check("taxi_velocity", point.velocity)
    if point.velocity < settings.minimum_velocity:
        return Verdict(point, settings, Outcome.NOT_ROLLING, reason=(
            f"taxi velocity {point.velocity:g} m/s is below the minimum of "
            f"{settings.minimum_velocity:g} m/s, where the rolling law does not hold"))
    if start is not None and start.settings != settings:
        start = None
    budget = Budget.of(settings.budget)
    try:
        with np.errstate(all="ignore"):
            return _decided(point, settings, start, budget)
    except BudgetError as error:
        reason = str(error)
    except (ArithmeticError, np.linalg.LinAlgError) as error:
        # Numbers at the ends of floating point, which parameters in their ranges can lead to.
        reason = f"the gear's numbers are beyond what can be computed ({error})"
    return Verdict(point, settings, Outcome.NOT_CONVERGED, reason=reason, work=budget.spent)


def _decided(point: OperatingPoint, settings: Settings, start: Verdict | None, budget: Budget
             ) -> Verdict:
    ladder = None if start is None else start.ladder
    carried, kept = ([], False) if start is None else _carried(point, settings, start, budget)
    if start is not None and ladder is not None and len(carried) == 1 and ladder.holds_at(point):
        # A cycle that is still there and stable is what kicks lead to that led to it next door.
        return replace(start, point=point, orbit=carried[0], warm=True, work=budget.spent)
    kicks = Kicks(point, settings, budget, carried)
    courses = kicks.courses(KICKS)
    if all(course.fate is Fate.DIES for course in courses):
        courses = sorted([*courses, *kicks.courses(kicks.other_kicks())],
                         key=lambda course: course.kick)
        return _verdict(kicks, courses, None)
    return _verdict(kicks, courses, _ladder(point, courses, ladder if kept else None))


def _carried(point: OperatingPoint, settings: Settings, start: Verdict, budget: Budget
             ) -> tuple[list[Orbit], bool]:
    """The stable cycles of ``start`` as they are at ``point``, as far as the balance finds them.

    And whether the error of the only one was not estimated anew. Where friction sticks, cycles may
    lie so close together that shooting's choice depends on where it begins: those are found anew.
    """
    system, ladder = gear_system(point), start.ladder
    if ladder is not None and start.orbit is not None and (
            start.orbit.harmonics == settings.harmonics and ladder.error_holds_at(point)
            and ladder.error < _SAFE * settings.accuracy):
        orbit = balance_near(system, guess_from_orbit(start.orbit), settings, budget)
        if orbit is not None:
            return [orbit], True
    found: list[Orbit] = []
    for orbit in start.stable_cycles:
        if orbit.method == SHOOTING:
            continue
        here = balanced(system, guess_from_orbit(orbit), settings, budget)
        if here is not None and not any(here.same_as(other, SAME) for other in found):
            found.append(here)
    return found, False


def _ladder(point: OperatingPoint, courses: Sequence[Course], before: Ladder | None
            ) -> Ladder | None:
    """What the ``courses`` of all kicks tell about points nearby, or None.

    ``before`` is the ladder whose error estimate was relied on, if one was.
    """
    cycles = [course.orbit for course in courses if course.fate is not Fate.DIES]
    first = cycles[0]
    if first is None or any(orbit is not first for orbit in cycles) or (
            courses[-1].fate is not Fate.CYCLE):
        return None
    if before is not None:
        return replace(before, point=point)
    return Ladder(point, point, first.error)


def _verdict(kicks: Kicks, courses: Sequence[Course], ladder: Ladder | None) -> Verdict:
    """The verdict that ``courses`` of ascending kicks come to."""
    before, decisive, growing = 0.0, None, None
    further: list[Orbit] = []
    for course in courses:
        if decisive is None and course.fate is Fate.DIES:
            before = course.kick
        elif decisive is None:
            decisive = course
        elif growing is None and course.fate is Fate.GROWS and decisive.fate is not Fate.GROWS:
            growing = course.kick
        orbit = course.orbit
        if orbit is not None and decisive is not None and orbit is not decisive.orbit and not any(
                orbit is other for other in further):
            further.append(orbit)
    fate = Fate.DIES if decisive is None else decisive.fate
    reason = "a motion settles where the balance has no cycle" if fate is Fate.UNTOLD else ""
    orbit = None if decisive is None else decisive.orbit
    return Verdict(
        kicks.point, kicks.settings, _OUTCOMES[fate], orbit=orbit,
        envelope=None if decisive is None else decisive.envelope, further=tuple(further),
        rest_is_stable=kicks.rest_is_stable,
        kick=None if decisive is None else Kick(before, decisive.kick, growing),
        warm=kicks.warm, reason=reason, ladder=ladder,
        work=kicks.budget.spent)
