"""Radau IIA methods: nodes, weights, dense output and an embedded estimate of the error."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Real = NDArray[np.float64]


@dataclass(frozen=True)
class Radau:
    """The method of s stages and order 2s - 1, L-stable and stiffly accurate.

    Parameters
    ----------
    nodes : c, shape (s,), the last one 1
    matrix : a, shape (s, s)
    damping : gamma_0, the weight of h f(x_0) in the estimate
    estimate : weights of the stages' increments in it, shape (s,): with h gamma_0 f(x_0) they give
        the difference to a formula of order s
    polynomial : takes values at 0 and the nodes to the coefficients of the polynomial through
        them, (s + 1, s + 1), ascending powers of the fraction of the step
    """

    nodes: Real
    matrix: Real
    damping: float
    estimate: Real
    polynomial: Real


def radau(stages: int) -> Radau:
    """The method of an odd number of ``stages``."""
    # Nodes are the zeros of P_s - P_{s-1} on (-1, 1], and 1 is one of them.
    series = np.zeros(stages + 1)
    series[stages - 1:] = -1.0, 1.0
    nodes = 0.5 * (np.sort(np.polynomial.legendre.legroots(series).real) + 1.0)
    nodes[-1] = 1.0
    powers = np.arange(stages)
    # Row i integrates every polynomial of degree below s from 0 to c_i.
    vandermonde = nodes[:, None] ** powers
    matrix = (nodes[:, None] ** (powers + 1) / (powers + 1)) @ np.linalg.inv(vandermonde)
    eigenvalues = np.linalg.eigvals(matrix)
    damping = float(eigenvalues[np.argmin(np.abs(eigenvalues.imag))].real)
    moments = 1.0 / (powers + 1)
    moments[0] -= damping
    embedded = np.linalg.solve(vandermonde.T, moments)
    estimate = np.linalg.solve(matrix.T, embedded - matrix[-1])
    with_start = np.concatenate([[0.0], nodes])
    polynomial = np.linalg.inv(with_start[:, None] ** np.arange(stages + 1))
    return Radau(nodes, matrix, damping, estimate, polynomial)
