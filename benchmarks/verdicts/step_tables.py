"""All steps of a ladder of lengths, solved in advance but for the damper's torque."""

from __future__ import annotations

import numpy as np

from .equations import SIZE, SWIVEL_RATE, Equations
from .radau import Radau
from .records import LEVELS, Steps

LONGEST = 0.05
"""The longest step [s]: a quarter of the period of the slowest gear's motion."""


def step_tables(system: Equations, method: Radau) -> Steps:
    """Of X_i = x + h sum_j a_ij (A X_j + B F_j), X_i as a matrix times (x, F).

    The estimate is (1 - h gamma_0 A)^-1 (gamma_0 h f(x) + sum_i e_i (X_i - x)); what the damper's
    slope adds to A is of rank one, and left to the loop.
    """
    count = method.nodes.size
    lengths = np.asarray(LONGEST * 2.0 ** (-0.5 * np.arange(LEVELS)), dtype=np.float64)
    h = lengths[:, None, None]
    stages = np.empty((2, LEVELS, count, SIZE, SIZE + count))
    error = np.empty((2, LEVELS, SIZE, SIZE + count))
    filtered = np.empty((2, LEVELS, SIZE))
    for mode, a in enumerate(system.matrices):
        left = np.eye(count * SIZE) - h * np.kron(method.matrix, a)
        start = np.tile(np.eye(SIZE), (LEVELS, count, 1))
        torque = h * np.kron(method.matrix, system.load[:, None])
        solved = np.linalg.solve(left, np.concatenate([start, torque], axis=2))
        stages[mode] = solved.reshape(LEVELS, count, SIZE, SIZE + count)
        raw = np.einsum("i,lijk->ljk", method.estimate, stages[mode])
        raw[:, :, :SIZE] += h * method.damping * a - method.estimate.sum() * np.eye(SIZE)
        at_start = h * method.damping * system.load[:, None]
        both = np.linalg.solve(np.eye(SIZE) - h * method.damping * a,
                               np.concatenate([raw, at_start], axis=2))
        error[mode], filtered[mode] = both[:, :, :-1], both[:, :, -1]
    watched = np.empty((2, LEVELS, count, SIZE + count))
    watched[0] = stages[0, :, :, SWIVEL_RATE]
    watched[1] = np.einsum("j,lijk->lik", system.holding, stages[1])
    edges = np.concatenate([[0.0], method.nodes])
    samples = np.sort(np.concatenate([method.nodes, 0.5 * (edges[1:] + edges[:-1])]))
    sampling = samples[:, None] ** np.arange(count + 1) @ method.polynomial
    return Steps(lengths, stages, watched, error, filtered, method.nodes, method.polynomial,
                 samples, sampling)
