"""A limit cycle as shooting finds it: one half of it exactly, the other by x(t + T/2) = -x(t)."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from .modes import Model, Real, derivative
from .trajectory import Phase, Trajectory


@dataclass(frozen=True)
class Cycle:
    """A limit cycle of n coordinates, x = (q, q').

    ``state`` (2n,) is where coordinate ``section`` passes zero upwards, ``period`` in s, and
    ``amplitude`` (n,) the peaks of |q|. ``half_multipliers`` (2n - 1,) are the eigenvalues of the
    derivative of the half-period map x(0) -> -x(T/2) without the trivial one, which belongs to
    a shift in time; those of largest modulus come first. ``trajectory`` is half a period, and
    ``phases`` are its phases of slip and stick.
    """

    state: Real
    period: float
    section: int
    amplitude: Real
    half_multipliers: NDArray[np.complex128]
    trajectory: Trajectory
    phases: tuple[Phase, ...]

    @property
    def frequency(self) -> float:
        """Frequency in rad/s."""
        return 2.0 * np.pi / self.period

    @cached_property
    def multipliers(self) -> NDArray[np.complex128]:
        """The Floquet multipliers of the whole period but for the trivial one, shape (2n - 1,)."""
        return np.asarray(self.half_multipliers**2)

    @property
    def stable(self) -> bool:
        """Whether all multipliers lie within the unit circle."""
        return bool(np.abs(self.multipliers).max() < 1.0)

    @property
    def sticks(self) -> bool:
        """Whether a coordinate is held by friction for part of the cycle."""
        return any(0 in phase.directions for phase in self.phases)

    def sample(self, times: Real) -> Real:
        """The state at any times [s], shape (2n, times)."""
        half = 0.5 * self.period
        count = np.floor(np.asarray(times, dtype=np.float64) / half)
        inside = np.clip(times - count * half, 0.0, half)
        return np.where(count % 2.0 == 0.0, 1.0, -1.0) * self.trajectory.sample(inside)


def cycle_of(model: Model, state: Real, section: int, trajectory: Trajectory) -> Cycle:
    """The cycle whose first half is ``trajectory``, with its derivatives, from ``state``."""
    if trajectory.transition is None:
        raise ValueError("the trajectory lacks the derivatives by the initial state")
    return Cycle(state, 2.0 * trajectory.duration, section, trajectory.peaks(),
                 _half_multipliers(model, trajectory, -trajectory.transition),
                 trajectory, trajectory.phases(model.frictional))


def final_rate(model: Model, trajectory: Trajectory) -> Real:
    """x' at the end of a trajectory, shape (2n,)."""
    return derivative(model.modes, trajectory.pieces.signs[-1], trajectory.end)


def _half_multipliers(model: Model, trajectory: Trajectory,
                      half_map: Real) -> NDArray[np.complex128]:
    """The eigenvalues of ``half_map`` on the space across the flow, which it leaves invariant."""
    size = trajectory.magnitude()
    along = -final_rate(model, trajectory) / size
    across = np.linalg.qr(np.column_stack([along, np.eye(len(along))]))[0][:, 1:]
    values = np.linalg.eigvals(across.T @ (half_map / size[:, None] * size) @ across)
    return values[np.argsort(-np.abs(values), kind="stable")].astype(np.complex128)
