"""Kicks of the swivel: what becomes of them, against simulation by other means."""

import math
from functools import cache
from itertools import pairwise

import numpy as np
import pytest

from shimmy_ros.cycles.budget import Budget, BudgetError
from shimmy_ros.cycles.kicks import KICKS, Fate, Kicks
from shimmy_ros.cycles.settings import Settings
from shimmy_ros.cycles.stable_cycle import stable_cycle
from shimmy_ros.gear.matrices import SWIVEL
from shimmy_ros.gear.parameter_file import reference_parameters
from shimmy_ros.gear.parameters import Damper
from shimmy_ros.gear.system import OperatingPoint
from shimmy_ros.simulation.simulation import Simulation, SimulationError

GEAR, _ = reference_parameters()


def at(velocity, quadratic_damping, coulomb_torque, linear_damping=2.0):
    return OperatingPoint(GEAR, Damper(linear_damping, quadratic_damping, coulomb_torque), velocity)


def kicks_at(point, orbits=(), seconds=10.0, settings=None):
    return Kicks(point, settings or Settings(), Budget.of(seconds), list(orbits))


def fates(point, kicks):
    return [course.fate for course in kicks_at(point).courses(np.asarray(kicks))]


@cache
def simulated(point, kick):
    """The fate of a kick in simulation, and the last peaks."""
    simulation = Simulation(point.gear, point.damper, point.velocity, tolerance=1e-5)
    simulation.kick(kick)
    sizes = []
    try:
        for second in range(1, 31):
            motion = simulation.advance(float(second), np.linspace(second - 0.5, second, 1000))
            sizes.append(np.ptp(motion.position[:, SWIVEL]))
            if simulation.at_rest:
                return Fate.DIES, np.zeros(4)
    except SimulationError:
        return Fate.GROWS, np.full(4, np.inf)
    # Held away from zero it has died as well, and so has what goes on falling.
    moves = sizes[-1] > 1e-6 and sizes[-1] > 0.9 * sizes[len(sizes) // 2]
    return (Fate.CYCLE if moves else Fate.DIES), np.abs(motion.position).max(axis=0)


POINTS = [at(40.0, 10.0, 20.0), at(10.0, 50.0, 10.0), at(7.0, 10.0, 20.0), at(60.0, 50.0, 60.0),
          at(90.0, 50.0, 60.0), at(40.0, 0.0, 20.0), at(4.0, 10.0, 20.0), at(40.0, 10.0, 0.0),
          at(4.0, 10.0, 0.0)]


@pytest.mark.parametrize("point", POINTS)
def test_the_fates_of_the_ladder_are_those_of_simulation(point):
    courses = kicks_at(point).courses(KICKS)
    assert [course.kick for course in courses] == KICKS.tolist()
    for course in courses:
        fate, peaks = simulated(point, course.kick)
        assert course.fate is fate
        assert (course.orbit is not None) == (fate is Fate.CYCLE)
        assert course.envelope is None
        if course.orbit is not None:
            assert course.orbit.stable
            assert course.orbit.amplitude == pytest.approx(
                peaks, rel=1e-3 + course.orbit.error)


# By bisection with exact integration: 0.504818 rad/s for the first one.
@pytest.mark.parametrize(("point", "low", "high"), [
    (at(40.0, 10.0, 20.0), 0.4, 0.7), (at(7.0, 10.0, 20.0), 0.5, 2.0),
    (at(40.0, 0.0, 20.0), 0.4, 0.6)])
def test_the_threshold_of_a_kick_is_that_of_simulation(point, low, high):
    assert fates(point, [low])[0] is simulated(point, low)[0] is Fate.DIES
    while high > 1.02 * low:
        middle = math.sqrt(low * high)
        if fates(point, [middle])[0] is Fate.DIES:
            low = middle
        else:
            high = middle
    # Close to it the quick rule may decide otherwise.
    assert simulated(point, 0.97 * low)[0] is Fate.DIES
    assert simulated(point, 1.03 * high)[0] is not Fate.DIES


def test_kicks_come_in_one_call_to_what_they_come_to_alone():
    point = at(40.0, 10.0, 20.0)
    values = np.array([0.1, 0.5, 0.51, 1.0, 8.0, 30.0])
    together = kicks_at(point).courses(values)
    for course in together:
        alone = kicks_at(point).courses(np.array([course.kick]))[0]
        assert course.fate is alone.fate
        if course.orbit is not None:
            assert course.orbit.same_as(alone.orbit, 1e-6)
    found = {id(course.orbit) for course in together if course.orbit is not None}
    assert len(found) == 1


@pytest.mark.parametrize("point", [POINTS[0], POINTS[2], at(40.0, 10.0, 150.0),
                                   at(20.0, 50.0, 10.0)])
def test_kicks_that_friction_is_said_to_stop_die(point):
    kicks = kicks_at(point)
    other = kicks.other_kicks()
    assert np.all(np.diff(other) > 0.0)
    # Between those of the ladder, and below it.
    assert not set(other.tolist()) & set(KICKS.tolist())
    assert other[-1] < KICKS[-1]
    for low, high in pairwise(KICKS):
        assert np.count_nonzero((other > low) & (other < high)) == 2
    inertia, stiffness = kicks.system.mass[SWIVEL, SWIVEL], kicks.system.stiffness[SWIVEL, SWIVEL]
    stopped = point.damper.coulomb_torque / math.sqrt(inertia * stiffness)
    if stopped < KICKS[0]:
        assert stopped / 1.6 < other[0] <= stopped * (1.0 + 1e-9)
    else:
        assert other[0] > KICKS[0]
    # What is not asked is below, and dies.
    for share in (0.999, 0.5, 0.1):
        assert simulated(point, share * min(stopped, KICKS[0]))[0] is Fate.DIES


def test_without_friction_other_kicks_go_down_to_a_very_small_one():
    other = kicks_at(at(4.0, 10.0, 0.0)).other_kicks()
    assert other[0] <= 1e-4
    assert np.all(np.diff(np.log(other[other < KICKS[0]])) < math.log(1.6))


def test_known_orbits_capture_and_change_nothing():
    point = at(40.0, 10.0, 20.0)
    orbit = stable_cycle(point).orbit
    cold, warm = kicks_at(point), kicks_at(point, [orbit])
    assert not cold.warm
    assert warm.warm
    before, after = cold.courses(KICKS), warm.courses(KICKS)
    assert [course.fate for course in before] == [course.fate for course in after]
    assert warm.orbits == [orbit]
    assert all(course.orbit is orbit for course in after[1:])
    assert warm.budget.spent < cold.budget.spent


def test_rest_is_stable_with_friction_and_without_it_where_nothing_grows():
    assert kicks_at(at(40.0, 10.0, 20.0)).rest_is_stable is True
    assert kicks_at(at(40.0, 10.0, 1e-9)).rest_is_stable is True
    assert kicks_at(at(40.0, 10.0, 0.0)).rest_is_stable is False
    assert kicks_at(at(4.0, 10.0, 0.0)).rest_is_stable is True


def test_work_is_counted_and_ends():
    point = at(40.0, 10.0, 20.0)
    kicks = kicks_at(point)
    kicks.courses(KICKS)
    spent = kicks.budget.spent
    assert spent > 1000
    again = kicks_at(point)
    again.courses(KICKS)
    assert again.budget.spent == spent
    short = Kicks(point, Settings(), Budget(spent - 1))
    with pytest.raises(BudgetError):
        short.courses(KICKS)
