"""The stable cycle of random gears: harmonic balance against exact shooting.

The gears are drawn within 20 % of the reference, with quadratic damping from 5 to 50 N m s^2/rad^2,
friction up to 25 N m and velocities from 10 to 100 m/s. These are the ones of two hundred in which
friction matters most, which are closest to a fold or beyond it, and some of the others.
"""

import functools
from dataclasses import fields

import numpy as np
import pytest

from shimmy_ros.cycles.kicks import KICKS
from shimmy_ros.cycles.limit_cycles import Role, all_cycles
from shimmy_ros.cycles.prediction import Predictor
from shimmy_ros.cycles.settings import Settings
from shimmy_ros.cycles.stable_cycle import stable_cycle
from shimmy_ros.gear.matrices import SWIVEL
from shimmy_ros.gear.parameter_file import reference_parameters
from shimmy_ros.gear.parameters import Damper, changed
from shimmy_ros.gear.system import OperatingPoint, gear_system
from shimmy_ros.ihb.accuracy import estimate_error
from shimmy_ros.ihb.solution import Outcome
from shimmy_ros.ihb.solve import solve_cold
from shimmy_ros.shooting.periodic import limit_cycle
from shimmy_ros.shooting.settling import settle
from shimmy_ros.simulation.simulation import Simulation

WITH_CYCLE = (3, 12, 26, 37, 59, 70, 76, 85, 177, 196)
WITHOUT = (68, 107)


@functools.cache
def random_points():
    gear, damper = reference_parameters()
    rng = np.random.default_rng(2005)
    found = []
    for _ in range(200):
        varied = changed(gear, **{item.name: getattr(gear, item.name) * rng.uniform(0.8, 1.2)
                                  for item in fields(gear)})
        varied_damper = Damper(damper.linear_damping * rng.uniform(0.8, 1.2),
                               rng.uniform(5.0, 50.0), rng.uniform(0.0, 25.0))
        found.append(OperatingPoint(varied, varied_damper, rng.uniform(10.0, 100.0)))
    return found


@functools.cache
def exact(number):
    """Where the motion after a kick of 8 rad/s settles, by exact integration and shooting."""
    system = gear_system(random_points()[number])
    kicked = np.zeros(8)
    kicked[4 + SWIVEL] = 8.0
    settled = settle(system, kicked, 1.0)
    return limit_cycle(system, settled.state, settled.period).cycle


def deviations(orbit_amplitude, frequency_hz, number):
    cycle = exact(number)
    return np.abs(np.append(orbit_amplitude / cycle.amplitude,
                            2.0 * np.pi * frequency_hz / cycle.frequency) - 1.0)


@pytest.mark.parametrize("number", WITH_CYCLE)
def test_four_harmonics_find_the_stable_cycle_within_the_error_estimated(number):
    system = gear_system(random_points()[number])
    assert exact(number).stable
    result = solve_cold(system, 4)
    assert result.outcome is Outcome.LIMIT_CYCLE
    cycle = result.limit_cycle
    estimate = estimate_error(system, cycle)
    assert np.all(deviations(cycle.amplitude(), cycle.frequency_hz, number)
                  <= np.append(estimate.amplitude, estimate.frequency))


@pytest.mark.parametrize("number", WITH_CYCLE)
@pytest.mark.parametrize("accuracy", [1e-2, 1e-3])
def test_the_accuracy_asked_for_is_reached(number, accuracy):
    answer = stable_cycle(random_points()[number], Settings(accuracy=accuracy))
    assert answer.outcome is Outcome.LIMIT_CYCLE
    off = deviations(answer.orbit.amplitude, answer.orbit.frequency_hz, number)
    assert off.max() <= answer.error + 1e-9
    assert answer.error <= accuracy
    assert answer.orbit.stable
    assert answer.orbit.multiplier < 1.0


@pytest.mark.parametrize("number", WITHOUT)
def test_no_limit_cycle_is_right_where_it_is_answered(number):
    point = random_points()[number]
    assert solve_cold(gear_system(point), 4).outcome is Outcome.NO_LIMIT_CYCLE
    assert stable_cycle(point, Settings(accuracy=1e-3)).outcome is Outcome.NO_LIMIT_CYCLE
    assert stable_cycle(point).outcome is Outcome.NO_LIMIT_CYCLE
    assert stable_cycle(point).rest_is_stable is True
    # No branch of cycles has more friction than the gear itself, and no kick lasts.
    assert Role.STABLE not in {cycle.role for cycle in all_cycles(point)}
    for kick in KICKS:
        simulation = Simulation(point.gear, point.damper, point.velocity)
        simulation.kick(float(kick))
        simulation.advance(8.0)
        assert simulation.at_rest


def test_one_after_the_other_they_come_to_the_same():
    """Verdicts of altogether other gears are of no use, and do no harm."""
    predictor = Predictor()
    for point in random_points()[:40]:
        verdict, cold = predictor.predict(point), stable_cycle(point)
        assert verdict.outcome is cold.outcome
        assert not verdict.failed
        if cold.orbit is not None:
            assert verdict.amplitude == pytest.approx(cold.amplitude, rel=1e-6)
            assert verdict.frequency_hz == pytest.approx(cold.frequency_hz, rel=1e-6)
