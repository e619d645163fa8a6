"""One step of an L-stable Runge-Kutta method for a linear system with one quadratic damper.

The method is the stiffly accurate SDIRK of order 4 with an embedded one of order 3 (Hairer &
Wanner, Solving Ordinary Differential Equations II, table IV.6.5). The system is

    x' = A x + input_1 * friction + input_2 * g(w),  w = x[DAMPER_RATE],  g = -(C_t + C_d |w|) w.

A is constant and the damper acts on one state only. Each stage is therefore linear in the state
at the start, in the friction torque and in the stages' damper torques, with coefficients that
depend on A and the step length alone; and each implicit stage comes down to one quadratic equation
for w, which is solved in closed form. No iteration can fail, however stiff the damper is.
"""

from __future__ import annotations

from math import sqrt

import numpy as np

from ..gear.matrices import Matrix
from .rolling_state import DAMPER_RATE, STATES, Vector

ORDER = 4
STAGES = 5
GAMMA = 1 / 4
_COEFFICIENTS = np.array([
    [1 / 4, 0, 0, 0, 0],
    [1 / 2, 1 / 4, 0, 0, 0],
    [17 / 50, -1 / 25, 1 / 4, 0, 0],
    [371 / 1360, -137 / 2720, 15 / 544, 1 / 4, 0],
    [25 / 24, -49 / 48, 125 / 16, -85 / 12, 1 / 4],
])
_EMBEDDED = np.array([59 / 48, -17 / 96, 225 / 32, -85 / 12, 0])
_ERROR_WEIGHTS = _COEFFICIENTS[-1] - _EMBEDDED

_INPUTS = STATES + 1 + STAGES
_START = np.eye(STATES, _INPUTS)
_EACH = np.arange(STAGES)


class StepValues:
    """What goes into a step and what comes out of it: two arrays, and views of their parts.

    Into it go ``start`` (8,), the state, and ``friction`` (1,) [N m], together ``given`` (9,); the
    step adds the stages' damper ``torques`` (5,). At its end lie ``knot`` (16,), the ``state`` (8,)
    and its derivative, ``watched`` (2,), the watched quantity and its rate, and the ``error`` (8,)
    and the state (8,) as ``scaled`` by the weights.
    """

    __slots__ = ("error", "friction", "given", "inputs", "knot", "results", "scaled", "start",
                 "state", "torques", "watched")

    def __init__(self) -> None:
        self.inputs = np.zeros(_INPUTS)
        self.start, self.friction = self.inputs[:STATES], self.inputs[STATES:STATES + 1]
        self.given, self.torques = self.inputs[:STATES + 1], self.inputs[STATES + 1:]
        self.results = np.zeros(4 * STATES + 2)
        self.knot, self.watched, self.error, self.scaled = np.split(
            self.results, np.cumsum([2 * STATES, 2, STATES]))
        self.state = self.knot[:STATES]


class Step:
    """A step of fixed length, made once for a system and taken many times.

    matrix : A, (8, 8)
    inputs : columns of the friction and the damper torque, (8, 2)
    length : step length [s]
    watched : row (8,) of a quantity whose crossings the caller looks for
    weights : scaling of state and error, (8, 8)

    ``usable`` is False where the step is too long for its stage equations to have one solution
    each, or where its coefficients overflow: a shorter one is needed.
    """

    __slots__ = ("_coupling", "_free", "_response", "_result", "length", "usable")
    _response: float
    _coupling: tuple[float, ...]

    def __init__(self, matrix: Matrix, inputs: Matrix, length: float, watched: Vector,
                 weights: Matrix) -> None:
        self.length = length
        try:
            stage_solver = np.linalg.inv(np.eye(STATES) - GAMMA * length * matrix)
        except np.linalg.LinAlgError:
            self.usable = False
            return
        # Elimination leaves rounding errors in what stands still; a stuck swivel must not creep.
        still = ~matrix.any(axis=1)
        stage_solver[still] = np.eye(STATES)[still]
        # Each stage's slope is k_i = P (A (x + h sum_{j<i} a_ij k_j) + B u_i), P the stage solver.
        solved = stage_solver @ matrix
        torques = stage_solver @ inputs
        slopes = np.zeros((STAGES, STATES, _INPUTS))
        slopes[:, :, :STATES] = solved
        slopes[:, :, STATES] = torques[:, 0]
        slopes[_EACH, :, STATES + 1 + _EACH] = torques[:, 1]
        flat = slopes.reshape(STAGES, -1)  # the same memory
        scaled = length * _COEFFICIENTS
        for stage in range(1, STAGES):
            slopes[stage] += solved @ (scaled[stage, :stage] @ flat[:stage]).reshape(_START.shape)
        damper_rates = scaled @ slopes[:, DAMPER_RATE]
        damper_rates[:, DAMPER_RATE] += 1.0
        last = _START + (scaled[-1] @ flat).reshape(_START.shape)
        error = (length * _ERROR_WEIGHTS @ flat).reshape(_START.shape)
        self._result = np.vstack([last, slopes[-1], watched @ last, watched @ slopes[-1],
                                  weights @ error, weights @ last])
        self._free = damper_rates[:, :STATES + 1].copy()
        coupling = damper_rates[:, STATES + 1:].tolist()
        self._response = coupling[0][0]
        self._coupling = tuple(coupling[i][j] for i in range(STAGES) for j in range(i))
        self.usable = bool(self._response > 0.0 and np.isfinite(self._result).all()
                           and np.isfinite(self._free).all())

    def take(self, values: StepValues, linear: float, quadratic: float) -> None:
        """Take the step from what is given in ``values``, with damping C_t and C_d, into them."""
        response = self._response
        one = 1.0 + response * linear
        square = one * one
        four = 4.0 * response * quadratic

        def torque(free: float) -> float:
            # The root of rate = free + response * torque(rate), in the form without cancellation.
            rate = 2.0 * free / (one + sqrt(square + four * abs(free)))
            return -(linear + quadratic * abs(rate)) * rate

        a21, a31, a32, a41, a42, a43, a51, a52, a53, a54 = self._coupling
        w1, w2, w3, w4, w5 = self._free.dot(values.given).tolist()
        g1 = torque(w1)
        g2 = torque(w2 + a21 * g1)
        g3 = torque(w3 + a31 * g1 + a32 * g2)
        g4 = torque(w4 + a41 * g1 + a42 * g2 + a43 * g3)
        g5 = torque(w5 + a51 * g1 + a52 * g2 + a53 * g3 + a54 * g4)
        values.torques[:] = (g1, g2, g3, g4, g5)
        self._result.dot(values.inputs, out=values.results)
