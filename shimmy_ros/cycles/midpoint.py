"""Motion of the gear by the implicit midpoint rule with set-valued friction: quick, not exact.

With the mean velocity u of a step h, q+ = q + h u and v+ = 2 u - v,
2 M (u - v) / h + C u + K (q + h u / 2) + T s e_swivel + C_d |u_d| u_d e_damper = 0.
The mean sign s of the swivel's rate in the step is that of its rate; where this turns, it follows
from the shares of the step before and after, taking the rate as linear; and where friction suffices
to hold the swivel, it is the one that leaves it at rest. However stiff, linear oscillations are
neither damped nor excited by the rule, and their frequency errs as h^2.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..compiling import compiled
from ..gear.matrices import DAMPER, SWIVEL
from ..gear.system import OperatingPoint, gear_system

Real = NDArray[np.float64]

_ITERATIONS = 60
_ROUNDING = 1e-13


class Cycles(NamedTuple):
    """Cycles of the swivel from one upward passage of zero to the next, m of them.

    ``peak`` (m,) [rad] of the swivel and ``period`` (m,) [s]; ``state`` (m, 8) is (q, dq/dt) at the
    end of each, to within a step.
    """

    peak: Real
    period: Real
    state: Real


class Motion:
    """A motion on its way, in steps of a given length."""

    def __init__(self, point: OperatingPoint, state: Real, step: float) -> None:
        """From ``state`` (8,), (q, dq/dt), on in steps of ``step`` [s]."""
        system = gear_system(point)
        self._mass = 2.0 / step * system.mass
        self._stiffness = system.stiffness
        self._inverse: Real = np.asarray(np.linalg.inv(
            self._mass + system.damping + 0.5 * step * system.stiffness), dtype=np.float64)
        self._strengths = (point.damper.coulomb_torque, point.damper.quadratic_damping)
        self._step = step
        self._state = np.array(state, dtype=np.float64)
        # Time since the swivel passed zero, or NaN before; its peak since then; time stuck.
        self._memory = np.array([np.nan, 0.0, 0.0])

    @property
    def stuck(self) -> float:
        """For how long [s] friction has held the swivel without a break."""
        return float(self._memory[2])

    def advance(self, count: int) -> Cycles:
        """The cycles that end within the next ``count`` steps."""
        number, peak, period, state = _march(
            self._inverse, self._mass, self._stiffness, *self._strengths, self._step, self._state,
            self._memory, count)
        return Cycles(peak[:number], period[:number], state[:number])


@compiled
def _march(inverse: Real, mass: Real, stiffness: Real, torque: float, quadratic: float,
           step: float, state: Real, memory: Real, count: int) -> tuple[int, Real, Real, Real]:
    dofs = mass.shape[0]
    # A cycle takes two steps at least.
    peaks, periods = np.empty(count // 2 + 1), np.empty(count // 2 + 1)
    states = np.empty((count // 2 + 1, 2 * dofs))
    number = 0
    impulse, free, mean = np.empty(dofs), np.empty(dofs), np.empty(dofs)
    for _ in range(count):
        for row in range(dofs):
            total = 0.0
            for column in range(dofs):
                total += (mass[row, column] * state[dofs + column]
                          - stiffness[row, column] * state[column])
            impulse[row] = total
        for row in range(dofs):
            total = 0.0
            for column in range(dofs):
                total += inverse[row, column] * impulse[column]
            free[row] = total
        sign, held, drag = _friction(inverse, free, torque, quadratic, state[dofs + SWIVEL])
        for row in range(dofs):
            mean[row] = (free[row] - inverse[row, SWIVEL] * torque * sign
                         - inverse[row, DAMPER] * drag)
        if held:
            mean[SWIVEL] = 0.5 * state[dofs + SWIVEL]
        memory[2] = memory[2] + step if mean[SWIVEL] == 0.0 else 0.0
        before = state[SWIVEL]
        for row in range(dofs):
            state[row] += step * mean[row]
            state[dofs + row] = 2.0 * mean[row] - state[dofs + row]
        after = state[SWIVEL]
        memory[1] = max(memory[1], abs(after))
        if before < 0.0 <= after:
            rest = step * after / (after - before)
            if memory[0] == memory[0]:
                peaks[number], periods[number] = memory[1], memory[0] + step - rest
                states[number] = state
                number += 1
            memory[0], memory[1] = rest, abs(after)
        else:
            memory[0] += step
    return number, peaks, periods, states


@compiled
def _friction(inverse: Real, free: Real, torque: float, quadratic: float, before: float
              ) -> tuple[float, bool, float]:
    """The mean sign, whether the swivel is held, and the damper's drag C_d |u_d| u_d.

    ``before`` is the swivel's rate at the begin of the step.
    """
    first = 1.0 if before >= 0.0 else -1.0
    after, drag = _rate_after(inverse, free, torque, quadratic, before, first)
    if first * after > 0.0:
        return first, False, drag
    last = -first
    after_last, drag = _rate_after(inverse, free, torque, quadratic, before, last)
    turns = last * after_last > 0.0
    if turns and before == 0.0:
        return last, False, drag
    # Where it turns, the sign less that of the shares is zero, and else the rate afterwards.
    low, high = first, last
    at_low, at_high = after, after_last
    if turns:
        at_low = low - _mean_sign(before, after)
        at_high = high - _mean_sign(before, after_last)
    sign = 0.0
    largest = abs(at_low) + abs(at_high)
    for _ in range(_ITERATIONS):
        sign = (low * at_high - high * at_low) / (at_high - at_low)
        value, drag = _rate_after(inverse, free, torque, quadratic, before, sign)
        if turns:
            value = sign - _mean_sign(before, value)
        if abs(value) <= _ROUNDING * largest:
            break
        # Half of the value of an end that stays, so that it does not stay for ever.
        if (value > 0.0) == (at_low > 0.0):
            low, at_low, at_high = sign, value, 0.5 * at_high
        else:
            high, at_high, at_low = sign, value, 0.5 * at_low
    return sign, not turns, drag


@compiled
def _mean_sign(before: float, after: float) -> float:
    """The mean sign of a rate that goes linearly from one value to another, not both zero."""
    sign = 1.0 if before + after > 0.0 else -1.0
    if before * after >= 0.0:
        return sign
    return sign * abs(abs(before) - abs(after)) / (abs(before) + abs(after))


@compiled
def _rate_after(inverse: Real, free: Real, torque: float, quadratic: float, before: float,
                sign: float) -> tuple[float, float]:
    """The swivel's rate after a step with a mean ``sign`` of friction, and the damper's drag."""
    rate = free[DAMPER] - inverse[DAMPER, SWIVEL] * torque * sign
    rate = 2.0 * rate / (1.0 + np.sqrt(1.0 + 4.0 * inverse[DAMPER, DAMPER] * quadratic * abs(rate)))
    drag = quadratic * abs(rate) * rate
    return (2.0 * (free[SWIVEL] - inverse[SWIVEL, SWIVEL] * torque * sign
                   - inverse[SWIVEL, DAMPER] * drag) - before), drag
