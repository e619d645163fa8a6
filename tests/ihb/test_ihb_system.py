import numpy as np
import pytest

from shimmy_ros.ihb.elements import Coulomb, QuadraticDamping
from shimmy_ros.ihb.solution import LimitCycle
from shimmy_ros.ihb.solve import solve_cold, solve_warm
from shimmy_ros.ihb.stability import stability
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


SINGULAR = [np.zeros((2, 2)), np.ones((2, 2)), np.diag([1.0, 0.0]), np.diag([1.0, np.nan]),
            [[1.0, 1.0], [1.0, 1.0 + 1e-16]], [[0.1, 0.3], [0.2, 0.6]]]
CYCLE = LimitCycle(np.ones((2, 2)), 1.0, -1)
USES = [lambda system: solve_cold(system, 2), lambda system: solve_warm(system, CYCLE),
        lambda system: stability(system, CYCLE)]


@pytest.mark.parametrize("use", USES)
@pytest.mark.parametrize("mass", SINGULAR)
def test_a_singular_mass_is_refused_where_the_system_is_solved(mass, use):
    system = System(mass, IDENTITY, IDENTITY, (QuadraticDamping(0, 1.0),))
    with pytest.raises(ValueError, match=r"^mass is singular to rounding, but every coordinate"):
        use(system)
    with pytest.raises(ValueError, match="mass is singular"):
        system.inverse_mass  # noqa: B018


@pytest.mark.parametrize("use", USES)
@pytest.mark.parametrize(("element", "message"), [
    (Coulomb(1, -2.5), "^torque on coordinate 1 is -2.5, but must be at least 0$"),
    (QuadraticDamping(0, -1e-9), "^coefficient on coordinate 0 is -1e-09, but must be at least 0$"),
])
def test_an_element_of_negative_strength_is_refused_where_the_system_is_solved(
        element, message, use):
    with pytest.raises(ValueError, match=message):
        use(System(IDENTITY, IDENTITY, IDENTITY, (Coulomb(0, 1.0), element)))


@pytest.mark.parametrize("scales", [(1e-150, 1e150), (1e-9, 1e4), (1.0, 1.0)])
def test_units_do_not_make_a_mass_singular(scales):
    units = np.array(scales)
    mass = np.array([[2.0, 1.0], [1.0, 2.0]])
    system = System(mass * units / units[::-1, None], IDENTITY, IDENTITY)
    system.check()
    found = system.inverse_mass * units[:, None] / units[::-1]
    assert found == pytest.approx(np.linalg.inv(mass), rel=1e-12)


def test_a_derivative_may_have_no_mass_and_strengths_of_either_sign():
    zero = np.zeros((2, 2))
    rate = System(zero, IDENTITY, zero, (Coulomb(0, -1.0), QuadraticDamping(1, -2.0)))
    assert rate.closed_forms.torques == pytest.approx([-1.0])
