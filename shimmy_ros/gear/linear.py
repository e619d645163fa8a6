"""Linear stability of the gear at small amplitude with the friction released.

M q'' + C(V) q' + K(V) q = 0: velocity-squared damping vanishes at small amplitude, and Coulomb
friction, which would hold the swivel, is taken away. Friction and velocity-squared damping only
take energy, so that a mode that grows here is what feeds a limit cycle of moderate amplitude.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from .matrices import damping_matrix, mass_matrix, stiffness_matrix
from .parameters import Damper, Gear, Range

Real = NDArray[np.float64]
Complex = NDArray[np.complex128]

# K is finite at rest, but C contains b/V.
LINEAR_VELOCITY_RANGE = Range("m/s", "taxi velocity", 0.01, 1000.0)
# Steps of the first look, in m/s and relative to the velocity.
_FIRST_STEP, _FIRST_RATIO = 1.0, 1.1
_SMALLEST_STEP = 1e-4
_SAFETY = 4.0
_VELOCITY_TOLERANCE = 1e-11


@dataclass(frozen=True)
class LinearModes:
    """The modes at one taxi ``velocity`` [m/s], the fastest growing first.

    ``eigenvalues`` [1/s], shape (m,), are all those that are real and one of each complex pair,
    that with the positive imaginary part.
    """

    velocity: float
    eigenvalues: Complex

    @property
    def growth_rate(self) -> Real:
        """Real parts [1/s]; positive for a mode that grows."""
        return np.asarray(self.eigenvalues.real)

    @property
    def frequency_hz(self) -> Real:
        """Frequencies of the damped motion [Hz]; 0 for a mode that does not oscillate."""
        return np.asarray(self.eigenvalues.imag / (2.0 * np.pi))

    @property
    def damping_ratio(self) -> Real:
        """-Re/|eigenvalue|: below 0 for a mode that grows, 1 for one that only decays."""
        size = np.abs(self.eigenvalues)
        return np.asarray(np.divide(-self.eigenvalues.real, size, out=np.zeros_like(size),
                                    where=size > 0.0))


@dataclass(frozen=True)
class Crossing:
    """A ``velocity`` [m/s] at which the largest growth rate is zero.

    ``onset`` where the gear becomes unstable as the velocity rises, otherwise the instability
    ends. ``frequency_hz`` is that of the mode concerned: 0 for divergence without oscillation.
    """

    velocity: float
    frequency_hz: float
    onset: bool


def linear_modes(gear: Gear, damper: Damper, velocity: float) -> LinearModes:
    """The modes at ``velocity`` [m/s] with the damper's linear damping. Raises ParameterError."""
    velocity = LINEAR_VELOCITY_RANGE.check("taxi_velocity", velocity)
    values = np.linalg.eigvals(state_matrix(gear, damper, velocity))
    upper = values[values.imag >= 0.0]
    return LinearModes(velocity, upper[np.argsort(-upper.real)].astype(np.complex128))


def state_matrix(gear: Gear, damper: Damper, velocity: float) -> Real:
    """The matrix A of x' = A x, x = (q, q'), shape (8, 8)."""
    mass = mass_matrix(gear)
    count = len(mass)
    matrix = np.zeros((2 * count, 2 * count))
    matrix[:count, count:] = np.eye(count)
    matrix[count:, :count] = -np.linalg.solve(mass, stiffness_matrix(gear, velocity))
    matrix[count:, count:] = -np.linalg.solve(
        mass, damping_matrix(gear, damper.linear_damping, velocity))
    return matrix


def crossings(gear: Gear, damper: Damper, low: float, high: float) -> list[Crossing]:
    """Every onset and every end of linear instability between two velocities [m/s], in order.

    The largest growth rate is sampled every metre per second and every tenth of the velocity at
    least, and down to 1e-4 m/s where it is near zero compared with its bend. Raises
    ParameterError for velocities outside the range, and for ``high`` below ``low``.
    """
    low = LINEAR_VELOCITY_RANGE.check("low", low)
    high = Range("m/s", "taxi velocity", low, LINEAR_VELOCITY_RANGE.high).check("high", high)

    def growth(velocity: float) -> float:
        return float(linear_modes(gear, damper, velocity).growth_rate[0])

    # Whoever only asks for modes need not import it.
    from scipy.optimize import brentq

    found = []
    for left, right in _sign_changes(growth, low, high):
        velocity = float(brentq(growth, left, right, xtol=_VELOCITY_TOLERANCE, rtol=1e-14))
        frequency = float(linear_modes(gear, damper, velocity).frequency_hz[0])
        found.append(Crossing(velocity, frequency, growth(left) <= 0.0))
    return found


def _sign_changes(function: Callable[[float], float], low: float, high: float
                  ) -> list[tuple[float, float]]:
    """Intervals in ascending order at whose ends ``function`` differs in sign.

    An interval without a change is halved as long as the bend seen in its middle would let the
    function reach zero inside.
    """
    ends = [low]
    while ends[-1] < high:
        ends.append(min(high, ends[-1] + _FIRST_STEP, ends[-1] * _FIRST_RATIO))
    values = [function(end) for end in ends]
    stack = [(ends[i], ends[i + 1], values[i], values[i + 1])
             for i in reversed(range(len(ends) - 1))]
    found = []
    while stack:
        left, right, at_left, at_right = stack.pop()
        middle = 0.5 * (left + right)
        at_middle = function(middle)
        if right - left <= _SMALLEST_STEP:
            if (at_left > 0.0) != (at_right > 0.0):
                found.append((left, right))
            continue
        bend = abs(at_middle - 0.5 * (at_left + at_right))
        smallest = min(abs(at_left), abs(at_middle), abs(at_right))
        signs = {at_left > 0.0, at_middle > 0.0, at_right > 0.0}
        if len(signs) == 1 and smallest > _SAFETY * bend:
            continue
        if len(signs) == 2 and _SAFETY * bend < 0.5 * abs(at_right - at_left):
            # Nearly straight from end to end: one crossing.
            found.append((left, right))
            continue
        stack.append((middle, right, at_middle, at_right))
        stack.append((left, middle, at_left, at_middle))
    return found
