"""Every cycle of the gear that one harmonic knows, in closed form.

At swivel amplitude A and frequency omega the friction is a torque of 4 T/pi in phase with the
swivel rate, and the damper one of equivalent damping c = C_t + 8/(3 pi) C_d omega u, u being its
amplitude. With D(omega) the dynamic stiffness of swivel, strut and tyre, and
e = i omega c - omega^2 I_beta that of the damper,

    D + K_t e / (K_t + e) + 4i T / (pi A) = 0.

Friction is not in the real part, which therefore gives c for every omega; c gives u and A, and the
imaginary part the T that belongs to them. So all cycles of a gear lie on one curve over omega, and
those of an operating point are where T on that curve is the one given.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import brentq

from ..gear.matrices import DAMPER, STRUT_TILT, SWIVEL, TYRE_LATERAL
from ..gear.system import OperatingPoint, gear_system
from ..ihb.harmonics import to_real

Real = NDArray[np.float64]
Complex = NDArray[np.complex128]

# Cycles are looked for within these frequencies; two that lie closer together than neighbours of
# the grid, 0.2 %, are both missed.
LOWEST_HZ, HIGHEST_HZ = 0.02, 1000.0
_GRID = 2.0 * np.pi * np.geomspace(LOWEST_HZ, HIGHEST_HZ, 5000)
_LINEAR = [STRUT_TILT, TYRE_LATERAL]


@dataclass(frozen=True)
class OneHarmonicCycle:
    """A cycle of one harmonic: ``coefficients`` (4, 2), eq. (10), and ``frequency`` in rad/s."""

    coefficients: Real
    frequency: float

    @property
    def amplitude(self) -> Real:
        """Amplitude of each coordinate, shape (4,)."""
        return np.asarray(np.hypot(self.coefficients[:, 0], self.coefficients[:, 1]))

    @property
    def swivel(self) -> float:
        """Swivel amplitude [rad]."""
        return float(self.amplitude[SWIVEL])

    @property
    def frequency_hz(self) -> float:
        """Frequency in Hz."""
        return self.frequency / (2.0 * np.pi)


def one_harmonic_cycles(point: OperatingPoint) -> list[OneHarmonicCycle]:
    """The cycles at an operating point, by ascending swivel amplitude."""
    curve = _Curve(point)
    friction, quadratic = point.damper.coulomb_torque, point.damper.quadratic_damping
    if quadratic > 0.0:
        # Pieces of the curve end where the amplitude is zero and where it is infinite.
        edges = _roots(curve.surplus, _GRID)
        frequencies = _roots(curve.torque_surplus, np.sort(np.concatenate([_GRID, edges])))
        found = [curve.cycle(frequency, curve.amplitude(frequency))
                 for frequency in frequencies[:, None]]
    else:
        # With a linear damper the frequency follows from the real part, the amplitude from T.
        frequencies = _roots(curve.real_part, _GRID)
        needed = -0.25 * np.pi * curve.stiffness(frequencies).imag
        found = [curve.cycle(frequency, np.array([friction / torque]))
                 for frequency, torque in zip(frequencies[:, None], needed, strict=True)
                 if torque > 0.0]
    moving = [item for item in found if 0.0 < item.swivel < np.inf]
    return sorted(moving, key=lambda item: item.swivel)


def fold_torques(point: OperatingPoint) -> list[float]:
    """The friction [N m] at which cycles of one harmonic meet and vanish, ascending.

    For the gear, the velocity and the dampers of ``point``, with C_d > 0, whatever its friction.
    """
    curve = _Curve(point)
    torque = -0.25 * np.pi * curve.stiffness(_GRID).imag * curve.amplitude(_GRID)
    before, here, after = torque[:-2], torque[1:-1], torque[2:]
    # NaN, where the curve has no cycle, compares as false.
    turns = ((here > before) & (here > after)) | ((here < before) & (here < after))
    return sorted(here[turns & (here > 0.0)].tolist())


class _Curve:
    """The cycles over the frequency [rad/s]; every argument and result has shape (m,)."""

    def __init__(self, point: OperatingPoint) -> None:
        self._system = gear_system(point)
        self._linkage = point.gear.damper_linkage_stiffness
        self._inertia = point.gear.damper_inertia
        self._linear = point.damper.linear_damping
        self._quadratic = point.damper.quadratic_damping
        self._friction = point.damper.coulomb_torque

    def surplus(self, frequency: Real) -> Real:
        """(omega c)^2 - (omega C_t)^2 from the real part."""
        swivel, _ = self._swivel(frequency)
        with np.errstate(divide="ignore", invalid="ignore"):
            return np.asarray(self.real_part(frequency) / (1.0 + swivel.real / self._linkage))

    def real_part(self, frequency: Real) -> Real:
        """The real part with c = C_t, of the sign of `surplus` where K_t + Re D > 0."""
        swivel, _ = self._swivel(frequency)
        spring = self._linkage - frequency**2 * self._inertia
        return np.asarray(
            self._linkage * spring
            - (1.0 + swivel.real / self._linkage) * (spring**2 + (frequency * self._linear)**2))

    def stiffness(self, frequency: Real) -> Complex:
        """What friction has to balance."""
        swivel, _ = self._swivel(frequency)
        damper = self._damper(frequency)
        return np.asarray(swivel + self._linkage * damper / (self._linkage + damper))

    def amplitude(self, frequency: Real) -> Real:
        """Swivel amplitude A [rad] where C_d > 0; NaN where there is none."""
        square = self.surplus(frequency)
        square = np.where(square > -1e-9 * self._linkage**2, square, np.nan)
        linear = frequency * self._linear
        # omega (c - C_t), without cancellation.
        rest = np.maximum(square, 0.0) / (linear + np.sqrt(np.maximum(square, 0.0) + linear**2)
                                          + np.finfo(float).tiny)
        damper = 3.0 * np.pi * rest / (8.0 * self._quadratic * frequency**2)
        return np.asarray(damper * np.abs(1.0 + self._damper(frequency) / self._linkage))

    def torque_surplus(self, frequency: Real) -> Real:
        """T of the cycle less the friction given; without friction, T per amplitude."""
        torque = -0.25 * np.pi * self.stiffness(frequency).imag
        amplitude = self.amplitude(frequency)
        if self._friction == 0.0:
            return np.where(np.isnan(amplitude), np.nan, torque)
        return np.asarray(amplitude * torque - self._friction)

    def cycle(self, frequency: Real, amplitude: Real) -> OneHarmonicCycle:
        """The cycle at one ``frequency`` and swivel ``amplitude``, both of shape (1,)."""
        shape = np.zeros((4, 1), dtype=np.complex128)
        shape[SWIVEL] = 1.0
        shape[DAMPER] = self._linkage / (self._linkage + self._damper(frequency))
        shape[_LINEAR] = self._swivel(frequency)[1].T
        return OneHarmonicCycle(to_real(amplitude * shape), float(frequency[0]))

    def _damper(self, frequency: Real) -> Complex:
        """e, with the equivalent damping from the real part."""
        reactance = np.sqrt(np.maximum(self.surplus(frequency), 0.0)
                            + (frequency * self._linear)**2)
        return np.asarray(1j * reactance - frequency**2 * self._inertia)

    def _swivel(self, frequency: Real) -> tuple[Complex, Complex]:
        """D (m,), and the strut's and the tyre's motion per swivel's (m, 2)."""
        rate = 1j * frequency[:, None, None]
        full = rate**2 * self._system.mass + rate * self._system.damping + self._system.stiffness
        inner = full[:, _LINEAR][:, :, _LINEAR]
        column = full[:, _LINEAR, SWIVEL][..., None]
        others = np.asarray(-np.linalg.solve(inner, column)[..., 0], dtype=np.complex128)
        own = full[:, SWIVEL, SWIVEL] - self._linkage
        return np.asarray(own + np.einsum("ki,ki->k", full[:, SWIVEL, _LINEAR], others)), others


def _roots(function: Callable[[Real], Real], grid: Real) -> Real:
    """Where ``function`` changes sign between neighbours of ``grid`` at which it is a number."""
    values = function(grid)
    change = (np.isfinite(values[:-1]) & np.isfinite(values[1:])
              & ((values[:-1] > 0.0) != (values[1:] > 0.0)))
    return np.array([
        brentq(lambda x: float(function(np.array([x]))[0]), grid[i], grid[i + 1],
               xtol=1e-13 * grid[i], rtol=1e-14)
        for i in np.flatnonzero(change)])
