import itertools

import numpy as np
import pytest

from shimmy_ros.ihb.elements import Coulomb, QuadraticDamping
from shimmy_ros.ihb.system import System
from shimmy_ros.shooting.modes import (
    MOST_ACTIVE,
    derivative,
    holding,
    mode_number,
    model_of,
    signs_at,
)

FRICTION, DRAG = np.array([0.6, 0.9, 0.0]), np.array([0.3, 0.0, 0.2])


def three_of_four():
    """Coordinates 0, 2 and 3 of four are active; without symmetry."""
    rng = np.random.default_rng(5)
    mass = 3.0 * np.eye(4) + 0.5 * rng.normal(size=(4, 4))
    elements = [Coulomb(dof, torque) for dof, torque in zip((0, 2), FRICTION[:2], strict=True)]
    drags = [QuadraticDamping(dof, drag) for dof, drag in ((0, DRAG[0]), (3, DRAG[2]))]
    return System(mass, rng.normal(size=(4, 4)), rng.normal(size=(4, 4)), (*elements, *drags))


@pytest.mark.parametrize("signs", itertools.product((-1, 0, 1), repeat=3))
def test_every_mode_obeys_the_equation_of_motion(signs):
    system = three_of_four()
    model, signs = model_of(system), np.array(signs)
    active = np.array(model.active)
    state = np.random.default_rng(7).normal(size=8)
    state[4 + active[signs == 0]] = 0.0
    speed = state[4:]
    rate = derivative(model.modes, signs, state)
    force = holding(model.modes, signs, state)
    friction = np.zeros(4)
    friction[active] = FRICTION * signs + DRAG * signs * speed[active]**2 - force
    # The holding force is what keeps the acceleration of the coordinates that stick at zero.
    balance = system.mass @ rate[4:] + system.damping @ speed + system.stiffness @ state[:4]
    friction[active[signs == 0]] = force[signs == 0]
    assert balance + friction == pytest.approx(np.zeros(4), abs=1e-12)
    assert np.array_equal(rate[:4], speed)
    assert rate[4 + active[signs == 0]] == pytest.approx(np.zeros(np.sum(signs == 0)), abs=1e-15)
    assert not force[signs != 0].any()


def test_modes_have_numbers_of_their_own_and_are_filled_in_once_needed():
    modes = model_of(three_of_four()).modes
    assert not modes.known.any()
    numbers = [mode_number(modes, np.array(signs))
               for signs in itertools.product((-1, 0, 1), repeat=3)]
    assert numbers == list(range(27))
    assert modes.known.all()


@pytest.mark.parametrize(("state", "before", "after"), [
    # Slipping tells; at rest friction holds, or gives way against the force.
    ([0.0, 0.0, 0.2, -0.1], [1, 1], [1, -1]),
    ([0.5, 0.1, 0.0, 0.0], [1, 1], [0, 0]),
    ([2.0, 0.1, 0.0, 0.0], [1, 1], [-1, 0]),
    ([-2.0, 3.0, 0.0, 0.0], [1, 1], [1, -1]),
])
def test_the_mode_that_a_state_moves_into_obeys_the_law_of_friction(state, before, after):
    model = model_of(System(np.eye(2), np.zeros((2, 2)), np.eye(2), (
        Coulomb(0, 1.0), Coulomb(1, 1.0))))
    assert signs_at(model.modes, np.array(state), np.array(before)).tolist() == after


def test_without_friction_and_force_the_sign_before_is_kept():
    model = model_of(System([[1.0]], [[0.0]], [[1.0]], (QuadraticDamping(0, 1.0),)))
    for before, after in ((1, 1), (-1, -1), (0, 1)):
        assert signs_at(model.modes, np.zeros(2), np.array([before])).tolist() == [after]


def test_more_active_coordinates_than_the_table_of_modes_holds_are_refused():
    many = MOST_ACTIVE + 1
    with pytest.raises(ValueError, match=f"{many} coordinates .* at most {MOST_ACTIVE}"):
        model_of(System(np.eye(many), np.eye(many), np.eye(many), tuple(
            Coulomb(dof, 1.0) for dof in range(many))))
