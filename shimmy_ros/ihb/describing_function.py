"""Where a growing oscillation stops, by the describing function: a first guess without a guess.

Each element is replaced by what its force's first harmonic amounts to at an assumed amplitude.
At a given amplitude of one coordinate the system then has modes with growth rates; a limit cycle
is where the growth rate is zero, and it is stable where the rate falls as the amplitude rises.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np

from . import loops
from .balance import add_general, packed
from .elements import Coulomb, Element, OddElement, QuadraticDamping
from .harmonics import Complex, Real, to_real
from .loops import with_replacement
from .system import System

_STEP_RATIO = 1.4
_SMALLEST_STEP_RATIO = 1.005
_LARGEST_AMPLITUDE_RATIO = 1e7
_SMALLEST_AMPLITUDE_RATIO = 0.02
_NEWTON_ITERATIONS = 12
_TOLERANCE = 1e-9
_SMALL_CHANGE = 0.01


class Mode(NamedTuple):
    """A mode at one amplitude: complex shape x (n,) and ``rate`` sigma + i omega [1/s]."""

    shape: Complex
    rate: complex


class FirstHarmonic(NamedTuple):
    """A one-harmonic guess of a limit cycle: coefficients (n, 2) and frequency [rad/s]."""

    coefficients: Real
    frequency: float


class Growth(NamedTuple):
    """The ``cycles`` in which growth stops; ``undecided`` if a growing mode was not followed."""

    cycles: list[FirstHarmonic]
    undecided: bool


class LostModeError(ArithmeticError):
    """A mode could not be followed from one amplitude to the next."""


def with_coulomb_factor(system: System, factor: float) -> System:
    """The same system with every Coulomb element's torque multiplied by ``factor``."""
    if factor == 1.0:
        return system
    elements = tuple(
        replace(element, torque=factor * element.torque) if isinstance(element, Coulomb)
        else element
        for element in system.elements
        if factor > 0.0 or not isinstance(element, Coulomb)
    )
    return replace(system, elements=elements)


def reference_coordinate(system: System) -> int:
    """The coordinate whose amplitude and phase describe a cycle: the first Coulomb element's."""
    for element in system.elements:
        if isinstance(element, Coulomb):
            return element.dof
    return system.nonlinear_dofs[0]


def linear_modes(system: System) -> list[Mode]:
    """The modes of M q'' + C q' + K q = 0, one of each pair, the fastest growing first."""
    count = system.dofs
    state = np.zeros((2 * count, 2 * count))
    state[:count, count:] = np.eye(count)
    state[count:] = -np.linalg.solve(system.mass, np.hstack([system.stiffness, system.damping]))
    rates, vectors = np.linalg.eig(state)
    found = [Mode(vectors[:count, i], complex(rates[i]))
             for i in np.argsort(-rates.real) if rates[i].imag >= 0.0]
    return found


def separated(system: System) -> System:
    """The same system with the tangents at rest of its general elements moved to the matrices."""
    damping, stiffness = system.damping.copy(), system.stiffness.copy()
    elements: list[Element] = []
    for element in system.elements:
        if isinstance(element, OddElement):
            rest, place = np.zeros((len(element.dofs), 1)), np.ix_(element.dofs, element.dofs)
            tangents = element.stiffness(rest, rest)[..., 0], element.damping(rest, rest)[..., 0]
            stiffness[place] += tangents[0]
            damping[place] += tangents[1]
            element = _without_tangents(element, *tangents)
        elements.append(element)
    return replace(system, damping=damping, stiffness=stiffness, elements=tuple(elements))


def _without_tangents(element: OddElement, stiffness: Real, damping: Real) -> OddElement:
    return replace(
        element,
        force=lambda q, v: element.force(q, v) - stiffness @ q - damping @ v,
        stiffness=lambda q, v: element.stiffness(q, v) - stiffness[..., None],
        damping=lambda q, v: element.damping(q, v) - damping[..., None])


def growing_cycles(system: System, coulomb_factor: float = 1.0) -> Growth:
    """Cycles at which an oscillation that grows from rest with friction released comes to a stop.

    One per growing mode at most, that of the fastest growing mode first. Coulomb torques are
    multiplied by ``coulomb_factor``. Coulomb and velocity-squared elements only take energy; with
    a general element a mode that decays at small amplitude may grow at a larger one, and is
    looked at as well. A mode that grows without oscillating cannot be followed.
    """
    cycles, undecided = [], False
    dissipative = all(isinstance(e, (Coulomb, QuadraticDamping)) for e in system.elements)
    if system.general_elements:
        system = separated(system)
    free = with_coulomb_factor(system, 0.0)
    modes = linear_modes(free)
    rounding = _TOLERANCE * max(abs(mode.rate) for mode in modes)
    for mode in modes:
        if mode.rate.imag <= rounding:
            undecided = undecided or mode.rate.real > rounding
            continue
        if dissipative and mode.rate.real <= 0.0:
            continue
        try:
            cycle = _stop_of_growth(system, free, mode, coulomb_factor)
        except LostModeError:
            undecided = True
            continue
        if cycle is not None:
            cycles.append(cycle)
    return Growth(cycles, undecided)


def _stop_of_growth(system: System, free: System, mode: Mode, factor: float
                    ) -> FirstHarmonic | None:
    """Where the growth of ``mode`` of the ``free`` system, friction released, comes to a stop."""
    reference = reference_coordinate(system)
    if mode.shape[reference] == 0.0:
        raise LostModeError("the mode does not move the coordinate that describes a cycle")
    unit = Mode(mode.shape / mode.shape[reference], mode.rate)
    amplitude, at_start = _small_amplitude(free, unit, reference)
    top = _scan(free, at_start, reference, amplitude, _LARGEST_AMPLITUDE_RATIO * amplitude,
                falling=True)
    if top is None:
        return None
    if factor == 0.0:
        return _at_amplitude(*top)
    with_friction = _turn_on_friction(system, top[1], reference, top[0], factor)
    sliding = with_coulomb_factor(system, factor)
    if with_friction.rate.real > 0.0:
        end = _scan(sliding, with_friction, reference, top[0],
                    _LARGEST_AMPLITUDE_RATIO * top[0], falling=True)
    else:
        end = _scan(sliding, with_friction, reference, top[0],
                    _SMALLEST_AMPLITUDE_RATIO * top[0], falling=False)
    return None if end is None else _at_amplitude(*end)


def _small_amplitude(system: System, mode: Mode, reference: int) -> tuple[float, Mode]:
    """An amplitude so small that the elements, friction released, hardly change the mode."""
    amplitude = 1.0
    for _ in range(60):
        near = _mode_at(system, amplitude, mode, reference)
        if near is not None and (
                abs(near.rate - mode.rate) < _SMALL_CHANGE * abs(mode.rate)
                and (near.rate.real > 0.0) == (mode.rate.real > 0.0)):
            return amplitude, near
        amplitude /= 4.0
    raise LostModeError("no amplitude is small enough for the elements not to change the mode")


def _scan(system: System, mode: Mode, reference: int, start: float, end: float, falling: bool
          ) -> tuple[float, Mode] | None:
    """Follow ``mode`` from amplitude ``start`` to ``end`` until its growth rate changes sign.

    ``falling`` looks for a change from growth to decay, otherwise from decay to growth. None where
    there is no change; raises LostModeError.
    """
    direction = 1.0 if end > start else -1.0
    amplitude, ratio = start, _STEP_RATIO
    if falling and mode.rate.real <= 0.0:
        # A mode that decays at small amplitude may still grow at a larger one.
        rising = _scan(system, mode, reference, start, end, falling=False)
        if rising is None:
            return None
        amplitude, mode = rising
    while (end - amplitude) * direction > 0.0:
        following = amplitude * ratio**direction
        new = _mode_at(system, following, mode, reference)
        if new is None or abs(new.rate - mode.rate) > 0.5 * abs(mode.rate):
            if ratio <= _SMALLEST_STEP_RATIO:
                raise LostModeError(f"the mode is lost beyond an amplitude of {amplitude:g}")
            ratio = ratio**0.5
            continue
        if (new.rate.real <= 0.0) if falling else (new.rate.real > 0.0):
            old_rate, new_rate = mode.rate.real, new.rate.real
            part = old_rate / (old_rate - new_rate)
            crossing = amplitude * ratio**(direction * part)
            refined = _mode_at(system, crossing, new, reference)
            return (following, new) if refined is None else (crossing, refined)
        amplitude, mode = following, new
        ratio = min(_STEP_RATIO, ratio**1.5)
    return None


def _turn_on_friction(system: System, mode: Mode, reference: int, amplitude: float, factor: float
                      ) -> Mode:
    reached, step = 0.0, 1.0
    while reached < 1.0:
        part = min(1.0, reached + step)
        new = _mode_at(with_coulomb_factor(system, factor * part), amplitude, mode, reference)
        if new is None or abs(new.rate - mode.rate) > 0.5 * abs(mode.rate):
            step *= 0.5
            if step < 1e-3:
                raise LostModeError("the mode is lost as friction comes in")
            continue
        reached, mode = part, new
    return mode


def _mode_at(system: System, amplitude: float, guess: Mode, reference: int) -> Mode | None:
    """Newton's method for (mu^2 M + mu C + K) x + F(x, Im mu) = 0 with x[reference] = amplitude.

    Shapes are relative to the reference coordinate's; None where it does not converge.
    """
    parts = packed(system, tuple(range(system.dofs)))
    general = system.general_elements
    solve: Callable[..., tuple[Complex, complex, bool]] = (
        _solve_with(general, system.dofs) if general else loops.quasi_linear_mode)
    try:
        shape, rate, converged = solve(
            *parts[:3], *parts[5:], amplitude, guess.shape, guess.rate, reference,
            _NEWTON_ITERATIONS, _TOLERANCE)
    except (np.linalg.LinAlgError, ArithmeticError):
        # Singular, or, where the loop is not compiled, beyond the range of numbers.
        return None
    return Mode(shape, rate) if converged else None


def _solve_with(general: tuple[Element, ...], dofs: int) -> Callable[..., Any]:
    """loops.quasi_linear_mode, not compiled, with the elements added that cannot be."""

    def add_elements(*arguments: Any) -> None:
        loops.add_elements(*arguments)
        for element in general:
            add_general(element, tuple(range(dofs)), *arguments[4:])

    return with_replacement(loops.quasi_linear_mode, add_elements=add_elements)


def _at_amplitude(amplitude: float, mode: Mode) -> FirstHarmonic:
    return FirstHarmonic(to_real(amplitude * mode.shape[:, None]), mode.rate.imag)
