import numpy as np
import pytest

from shimmy_ros.ihb.elements import Coulomb, QuadraticDamping
from shimmy_ros.ihb.system import System
from shimmy_ros.shooting.flow import advance
from shimmy_ros.shooting.modes import model_of
from shimmy_ros.shooting.periodic import Outcome, limit_cycle
from shimmy_ros.shooting.settling import settle


def oscillator(growth, torque, drag):
    """x'' - growth x' + torque sgn x' + drag |x'| x' + x = 0."""
    return System([[1.0]], [[-growth]], [[1.0]], (Coulomb(0, torque), QuadraticDamping(0, drag)))


def trembling():
    """A driven mass, unstable of itself, drags another that sticks for part of every cycle."""
    return System(np.eye(2), [[-0.3, 0.0], [0.0, 0.2]], [[1.5, -0.5], [-0.5, 0.5]],
                  (Coulomb(1, 0.4), QuadraticDamping(0, 0.2)))


# (growth, torque, drag), then amplitude, frequency [rad/s] and stability.
CLOSED = [
    ((0.2, 0.05, 0.1), 0.380133057, 0.996899207, False),
    ((0.2, 0.05, 0.1), 1.977690577, 0.999673640, True),
    ((0.5, 0.1, 0.2), 0.285896890, 0.975794926, False),
    ((0.5, 0.1, 0.2), 2.675197961, 0.996826861, True),
    ((0.2, 0.0, 0.1), 2.358901328, 0.999081526, True),
]


@pytest.mark.parametrize(("coefficients", "amplitude", "frequency", "stable"), CLOSED)
def test_the_cycles_of_an_oscillator_with_friction_are_known(coefficients, amplitude, frequency,
                                                             stable):
    result = limit_cycle(oscillator(*coefficients), np.array([0.1, 1.1 * amplitude]), 6.0)
    assert result.outcome is Outcome.LIMIT_CYCLE
    assert result.cycle.amplitude == pytest.approx([amplitude], abs=1e-9)
    assert result.cycle.frequency == pytest.approx(frequency, abs=1e-9)
    assert result.cycle.stable is stable
    assert not result.cycle.sticks


def test_a_cycle_with_sticking_repeats_and_has_a_multiplier_of_zero():
    system = trembling()
    settled = settle(system, np.array([0.0, 0.0, 1.0, 0.0]), 60.0)
    cycle = limit_cycle(system, settled.state, settled.period).cycle
    assert cycle.sticks
    assert cycle.stable
    assert [phase.directions for phase in cycle.phases] in ([(1,), (0,), (-1,)],
                                                            [(1,), (0,), (1,)], [(1,), (0,)])
    motion = advance(model_of(system), cycle.state, cycle.period)
    assert motion.end == pytest.approx(cycle.state, abs=1e-10)
    times = np.linspace(0.0, cycle.period, 50)
    assert cycle.sample(times) == pytest.approx(motion.sample(times), abs=1e-10)
    assert cycle.sample(times - 3.0 * cycle.period) == pytest.approx(cycle.sample(times), abs=1e-10)
    assert cycle.amplitude == pytest.approx(motion.peaks(), abs=1e-12)
    assert np.abs(cycle.multipliers).min() < 1e-15
    assert limit_cycle(system, settled.state, settled.period).residual < 1e-11


@pytest.mark.parametrize(("system", "state", "duration"), [
    (trembling(), [0.0, 0.0, 1.0, 0.0], 60.0),
    (oscillator(0.5, 0.1, 0.2), [0.0, 1.0], 30.0),
])
def test_multipliers_are_the_eigenvalues_of_a_monodromy_by_differences(system, state, duration):
    settled = settle(system, np.array(state), duration)
    cycle = limit_cycle(system, settled.state, settled.period).cycle
    # Half a period starts in a phase of slip at the section, so that both sides are defined.
    step, model = 1e-6, model_of(system)
    monodromy = np.column_stack([
        (advance(model, cycle.state + step * unit, cycle.period).end
         - advance(model, cycle.state - step * unit, cycle.period).end) / (2.0 * step)
        for unit in np.eye(len(cycle.state))])
    expected = np.linalg.eigvals(monodromy)
    trivial = np.argmin(np.abs(expected - 1.0))
    assert expected[trivial] == pytest.approx(1.0, abs=1e-7)
    assert np.sort_complex(cycle.multipliers) == pytest.approx(
        np.sort_complex(np.delete(expected, trivial)), abs=1e-6)
    assert np.all(np.diff(np.abs(cycle.half_multipliers)) <= 0.0)


@pytest.mark.parametrize("phase", [0.0, 0.1, 0.35, 0.5, 0.8])
def test_the_guess_may_lie_anywhere_on_the_cycle(phase):
    system = oscillator(0.2, 0.05, 0.1)
    cycle = limit_cycle(system, np.array([0.0, 2.0]), 6.0).cycle
    moved = limit_cycle(system, cycle.sample(np.array([phase * cycle.period]))[:, 0], cycle.period)
    assert moved.cycle.state == pytest.approx(cycle.state, abs=1e-11)
    assert moved.cycle.state[1] > 0.0


def test_a_guess_of_three_periods_gives_one():
    cycle = limit_cycle(oscillator(0.2, 0.05, 0.1), np.array([0.0, 2.0]), 3.0 * 6.2).cycle
    assert cycle.period == pytest.approx(2.0 * np.pi / 0.999673640, abs=1e-8)
    assert cycle.half_multipliers[0] == pytest.approx(np.sqrt(cycle.multipliers[0]))


def test_a_search_that_ends_at_rest_or_nowhere_is_no_cycle():
    calm = limit_cycle(oscillator(-0.1, 0.0, 0.1), np.array([0.0, 1.0]), 6.0)
    assert (calm.outcome, calm.cycle) == (Outcome.AT_REST, None)
    held = limit_cycle(oscillator(0.2, 0.5, 0.1), np.array([0.3, 0.0]), 6.0)
    assert (held.outcome, held.cycle) == (Outcome.AT_REST, None)
    lost = limit_cycle(oscillator(0.2, 0.2, 0.1), np.array([0.0, 3.0]), 6.0)
    assert (lost.outcome, lost.cycle) == (Outcome.FAILED, None)
    wild = limit_cycle(oscillator(0.2, 0.0, -0.1), np.array([0.0, 30.0]), 6.0)
    assert (wild.outcome, wild.cycle) == (Outcome.FAILED, None)
    assert "grows" in wild.message


def test_a_search_counts_its_steps_and_ends_where_they_are_used_up():
    system, guess = oscillator(0.2, 0.05, 0.1), np.array([0.1, 2.2])
    found = limit_cycle(system, guess, 6.0)
    assert found.cycle.trajectory.steps * found.iterations < found.steps < 1000
    again = limit_cycle(system, guess, 6.0, most_steps=found.steps)
    assert (again.outcome, again.steps) == (Outcome.LIMIT_CYCLE, found.steps)
    assert np.array_equal(again.cycle.state, found.cycle.state)
    for bound in (1, found.steps // 3, found.steps - 1):
        ended = limit_cycle(system, guess, 6.0, most_steps=bound)
        assert (ended.outcome, ended.cycle, ended.steps) == (Outcome.FAILED, None, bound)
        assert f"takes more than {bound} steps" in ended.message


def test_a_search_that_gets_nowhere_gives_up_early():
    # Beyond the fold there is no cycle, and Newton's method wanders.
    lost = limit_cycle(oscillator(0.2, 0.1, 0.1), np.array([0.0, 1.2]), 6.2)
    assert lost.outcome is Outcome.FAILED
    assert lost.residual > 1e-8
    assert lost.steps < 2000


@pytest.mark.parametrize(("arguments", "name"), [
    ({"most_steps": 0}, "most_steps"),
    ({"guess_state": [0.0, 1.0, 2.0]}, "guess_state"),
    ({"guess_state": [0.0, np.nan]}, "guess_state"),
    ({"guess_period": 0.0}, "guess_period"),
    ({"guess_period": np.inf}, "guess_period"),
    ({"section": 1}, "section"),
])
def test_arguments_that_do_not_fit_are_refused(arguments, name):
    good = {"guess_state": [0.0, 1.0], "guess_period": 6.0}
    with pytest.raises(ValueError, match=name):
        limit_cycle(oscillator(0.2, 0.05, 0.1), **(good | arguments))


def test_settling_finds_the_stable_cycle_and_rest():
    system = oscillator(0.2, 0.05, 0.1)
    settled = settle(system, np.array([0.0, 0.6]), 200.0)
    assert settled.period == pytest.approx(2.0 * np.pi / 0.999673640, abs=1e-6)
    assert settled.change < 1e-5
    assert settle(system, np.array([0.0, 0.3]), 200.0) is None


def test_settling_recognizes_a_half_period_with_several_zeros():
    # Two masses, coupled weakly, whose second follows the first in a ratio near three.
    system = System(np.eye(2), [[-0.3, 0.0], [0.6, 0.02]], [[1.0, 0.0], [0.0, 9.1]],
                    (QuadraticDamping(0, 0.2),))
    settled = settle(system, np.array([0.0, 0.0, 1.0, 0.0]), 800.0, section=1)
    first = settle(system, np.array([0.0, 0.0, 1.0, 0.0]), 800.0, section=0)
    assert settled.period == pytest.approx(first.period, rel=1e-5)
