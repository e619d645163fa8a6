"""Chains of systems, each solved from the one before, against solves of every system alone."""

from dataclasses import replace

import numpy as np
import pytest

from shimmy_ros.ihb.chain import Stack, solve_chain
from shimmy_ros.ihb.elements import Coulomb, QuadraticDamping
from shimmy_ros.ihb.newton import STABLE_ORIENTATION
from shimmy_ros.ihb.solve import solve_cold, solve_warm
from shimmy_ros.ihb.system import System

HARMONICS = 5


def stack_of(torques, dampings, coulomb=1, quadratic=2, stiffer=0.0):
    """Three masses in a row, the first driven; friction and damper where they are said to be."""
    count = len(torques)
    stiffness = 2.0 * np.eye(3) - np.eye(3, k=1) - np.eye(3, k=-1)
    stiffnesses = np.stack([stiffness + share * stiffer * np.diag([0.0, 1.0, 0.0])
                            for share in np.linspace(0.0, 1.0, count)])
    return Stack(np.broadcast_to(np.eye(3), (count, 3, 3)).copy(),
                 np.broadcast_to(np.diag([-0.25, 0.05, 0.05]), (count, 3, 3)).copy(), stiffnesses,
                 coulomb, np.asarray(torques, dtype=float), quadratic,
                 np.asarray(dampings, dtype=float))


def system_of(stack, index):
    return System(stack.mass[index], stack.damping[index], stack.stiffness[index],
                  (Coulomb(stack.coulomb, float(stack.torques[index])),
                   QuadraticDamping(stack.quadratic, float(stack.coefficients[index]))))


def first_cycle(stack):
    return solve_cold(system_of(stack, 0), HARMONICS).limit_cycle


@pytest.mark.parametrize(("coulomb", "quadratic", "torque"), [
    (1, 2, 0.05), (0, 2, 0.005), (0, 0, 0.005)])
def test_every_point_is_that_of_a_solve_of_its_own(coulomb, quadratic, torque):
    stack = stack_of(np.linspace(torque, 2.0 * torque, 12), np.linspace(0.3, 0.2, 12), coulomb,
                     quadratic, 0.3)
    chain = solve_chain(stack, first_cycle(stack))
    assert len(chain.frequency) == len(stack) == 12
    for index in range(len(stack)):
        alone = solve_cold(system_of(stack, index), HARMONICS).limit_cycle
        assert chain.amplitude[index] == pytest.approx(alone.amplitude(), rel=1e-8)
        assert chain.frequency[index] == pytest.approx(alone.frequency, rel=1e-9)
    assert np.all(chain.residual <= 1e-9)
    assert np.all(chain.iterations >= 1)
    # Each starts from an extrapolation of two before it.
    assert chain.iterations[2:].max() <= 4
    end = chain.cycle
    assert end.amplitude() == pytest.approx(chain.amplitude[-1], rel=1e-12)
    assert end.frequency == chain.frequency[-1]
    assert end.orientation == STABLE_ORIENTATION
    assert solve_warm(system_of(stack, 11), end).iterations <= 1


def test_it_ends_before_the_fold_and_with_the_last_cycle():
    stack = stack_of(np.linspace(0.001, 0.05, 400), np.full(400, 0.3), coulomb=0)
    chain = solve_chain(stack, first_cycle(stack))
    solved = len(chain.frequency)
    assert 10 < solved < 400
    assert chain.amplitude.shape == (solved, 3)
    assert chain.iterations.shape == chain.residual.shape == (solved,)
    # As far as there are cycles, up to the few points whose step is too long for a warm start.
    beyond = [index for index in range(solved, min(solved + 10, 400))
              if solve_cold(system_of(stack, index), HARMONICS).limit_cycle is not None]
    assert len(beyond) < 10
    last = solve_cold(system_of(stack, solved - 1), HARMONICS).limit_cycle
    assert chain.cycle.amplitude() == pytest.approx(last.amplitude(), rel=1e-7)
    assert np.all(np.diff(chain.amplitude[:, 0]) < 0.0)


def test_a_jump_too_far_for_a_warm_start_ends_it():
    stack = stack_of([0.05, 0.051, 0.052, 0.053], [0.3, 0.3, 0.05, 0.05])
    chain = solve_chain(stack, first_cycle(stack))
    assert len(chain.frequency) == 2
    rest = stack.part(2, 4)
    assert len(rest) == 2
    assert rest.torques.tolist() == [0.052, 0.053]
    again = solve_chain(rest, first_cycle(rest))
    assert len(again.frequency) == 2


def test_a_start_that_leads_nowhere_gives_nothing():
    stack = stack_of([0.05, 0.05], [0.3, 0.3])
    start = first_cycle(stack)
    for wrong in (replace(start, orientation=-start.orientation),
                  replace(start, coefficients=2.0 * start.coefficients),
                  replace(start, frequency=1.3 * start.frequency)):
        chain = solve_chain(stack, wrong)
        assert chain.cycle is None
        assert chain.amplitude.shape == (0, 3)
        assert chain.frequency.size == chain.iterations.size == chain.residual.size == 0


def test_parts_of_a_stack_are_solved_as_the_whole():
    stack = stack_of(np.linspace(0.05, 0.1, 9), np.linspace(0.3, 0.2, 9))
    whole = solve_chain(stack, first_cycle(stack))
    first = solve_chain(stack.part(0, 4), first_cycle(stack))
    second = solve_chain(stack.part(4, 9), first.cycle)
    assert np.concatenate([first.frequency, second.frequency]) == pytest.approx(
        whole.frequency, rel=1e-10)
    assert np.concatenate([first.amplitude, second.amplitude]) == pytest.approx(
        whole.amplitude, rel=1e-8)
