import numpy as np
import pytest

from shimmy_ros.ihb.elements import Coulomb, QuadraticDamping
from shimmy_ros.ihb.system import System

IDENTITY = np.eye(2)


def test_a_system_knows_its_size_and_its_nonlinear_coordinates():
    system = System(np.eye(4), np.eye(4), np.eye(4),
                    (QuadraticDamping(3, 1.0), Coulomb(1, 1.0), Coulomb(3, 1.0)))
    assert system.dofs == 4
    assert system.nonlinear_dofs == (1, 3)


def test_matrices_are_copied_and_cannot_be_changed():
    mass = np.eye(2)
    system = System(mass, IDENTITY, IDENTITY)
    mass[0, 0] = 5.0
    assert system.mass[0, 0] == 1.0
    with pytest.raises(ValueError, match="read-only"):
        system.mass[0, 0] = 5.0


@pytest.mark.parametrize(("matrices", "message"), [
    ((np.eye(2, 3), IDENTITY, IDENTITY), r"mass has shape \(2, 3\), but must be square"),
    ((IDENTITY, np.eye(3), IDENTITY), r"damping has shape \(3, 3\), but mass has 2 rows"),
    ((IDENTITY, IDENTITY, np.ones(2)), r"stiffness has shape \(2,\), but must be square"),
])
def test_matrices_that_do_not_fit_are_refused(matrices, message):
    with pytest.raises(ValueError, match=message):
        System(*matrices)


@pytest.mark.parametrize("dof", [-1, 2])
def test_elements_on_missing_coordinates_are_refused(dof):
    with pytest.raises(ValueError, match=rf"act on the coordinates \({dof},\).* 0\.\.1"):
        System(IDENTITY, IDENTITY, IDENTITY, (Coulomb(dof, 1.0),))


def test_an_element_without_a_hash_is_an_element_as_well():
    class Nothing:
        dofs = (0,)
        __hash__ = None

    system = System([[1.0]], [[0.0]], [[1.0]], (Coulomb(0, 1.0), Nothing()))
    assert system.nonlinear_dofs == (0,)
    assert len(system.general_elements) == 1
    assert system.closed_forms.coulomb == (0,)
