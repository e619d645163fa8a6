"""The flow: Taylor series of high order from event to event, with its derivatives.

Within a mode the series of the state x follows from x' = A x + b + G w, w_i = s_i (q'_i)^2, by a
recurrence, and so does that of its derivatives. A step ends at the first event: an active
velocity that comes to zero, or a holding force that reaches the friction T. Where the velocity v
of a coordinate comes to zero, and the field changes from f- to f+, the derivatives X change by
saltation, X+ = X- + (f+ - f-) (X-)_v / (f-)_v. This covers reversal and sticking; in the latter
the row of v becomes zero and the rank drops. At a release the field is continuous, and so is X.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from .modes import Mode, Model, Real, Signs, derivative, extended, mode_of, signs_at
from .polynomial import first_descent
from .series import extended_series, keeps_sign, rows_after, step_length
from .trajectory import Piece, Trajectory

ORDER = 30
_TOLERANCE = 1e-16
_DERIVATIVE_TOLERANCE = 1e-12
_EXPONENTS = np.arange(ORDER + 1.0)
# A step grows at most so much; its length is settled to within so much.
_GROWTH = 8.0
_SETTLED = 0.9
_MOST_STEPS = 200_000


class FlowError(ArithmeticError):
    """The motion grows without bound or switches without end."""


class ParameterRate(NamedTuple):
    """Two models at parameter values ``width`` apart, on either side of the one that moves."""

    below: Model
    above: Model
    width: float

    def mode(self, signs: Signs) -> tuple[Real, Real]:
        """The derivatives by the parameter of a mode's matrix and constant."""
        low, high = mode_of(self.below, signs), mode_of(self.above, signs)
        return ((high.matrix - low.matrix) / self.width,
                (high.constant - low.constant) / self.width)


class _Event(NamedTuple):
    """At ``place``, a share of the step, active coordinate ``number`` stops or is released."""

    place: float
    number: int
    release: bool


def advance(model: Model, state: Real, duration: float, *, derivatives: bool = False,
            rate: ParameterRate | None = None) -> Trajectory:
    """The motion from ``state`` (2n,) over ``duration`` [s].

    ``derivatives`` asks for those by the initial state, and ``rate`` for that by a parameter as
    well. The last terms of every series are below 1e-16 of the largest value that the component
    has had, and 1e-12 for derivatives.

    Raises ValueError for a duration that is not positive and finite, and FlowError.
    """
    if not (np.isfinite(duration) and duration > 0.0):
        raise ValueError(f"duration is {duration} s, but must be positive and finite")
    flow = _Flow(model, rate)
    size = 2 * model.dofs
    signs = signs_at(model, np.asarray(state))
    rows = np.zeros((1, size))
    if derivatives or rate is not None:
        rows = np.zeros((1 + size + (rate is not None), size))
        rows[1:1 + size] = np.eye(size)
        rows[:, flow.stuck(signs)] = 0.0
    rows[0] = state
    with np.errstate(over="ignore", invalid="ignore"):
        rows, pieces = flow.run(rows, signs, duration)
    return Trajectory(
        tuple(pieces), duration, rows[0],
        rows[1:1 + size].T if derivatives or rate is not None else None,
        rows[-1] if rate is not None else None)


class _Flow:
    """A motion on its way.

    ``rows`` (r, 2n) hold the state, its derivative by every component of the initial state, and
    that by the parameter, as far as they are asked for. Series are in s = (t - start) / unit.
    """

    def __init__(self, model: Model, rate: ParameterRate | None) -> None:
        self.model, self.rate = model, rate
        self.size = 2 * model.dofs
        self.velocities = [model.dofs + dof for dof in model.active]
        self._velocities = np.array(self.velocities, dtype=np.int64)
        self._drags = model.drag.tolist()
        self._rates: dict[Signs, tuple[Real, Real]] = {}

    def rates(self, signs: Signs) -> tuple[Real, Real] | None:
        """The derivatives of a mode by the parameter, if that is asked for."""
        if self.rate is None:
            return None
        if signs not in self._rates:
            self._rates[signs] = self.rate.mode(signs)
        return self._rates[signs]

    def stuck(self, signs: Signs) -> list[int]:
        """The components of the state that are held at zero."""
        return [place for place, sign in zip(self.velocities, signs, strict=True) if sign == 0]

    def run(self, rows: Real, signs: Signs, duration: float) -> tuple[Real, list[Piece]]:
        pieces: list[Piece] = []
        largest = np.abs(rows)
        # How many terms of its velocity vanish, by the event just passed, in a coordinate.
        contact: dict[int, int] = {}
        time, unit = 0.0, 1.0 / float(np.abs(mode_of(self.model, signs).matrix[:self.size]).max())
        for _ in range(_MOST_STEPS):
            if time >= duration:
                return rows, pieces
            unit = min(unit, duration - time)
            series = self._series(rows, mode_of(self.model, signs), unit)
            natural = step_length(series, largest, _TOLERANCE, _DERIVATIVE_TOLERANCE, _GROWTH,
                                  _SETTLED)
            if not time + natural * unit > time:
                raise FlowError(f"the motion grows without bound after {time:g} s")
            length = min(natural, (duration - time) / unit)
            event = self._event(series, signs, length, contact)
            if event is not None:
                length *= event.place
            if length > 0.0:
                rows = rows_after(series, length, largest)
                pieces.append(Piece(time, length * unit, unit, series[:, :self.size, 0].copy(),
                                    signs))
                contact = {}
            if event is not None:
                # Without progress the sign of the next term has come from rounding: pass over it.
                passed = contact.get(event.number, 0)
                signs, order = self._switch(rows, signs, event)
                contact[event.number] = max(order, passed + 1)
            time = time + length * unit if event is not None or length == natural else duration
            unit *= natural
        raise FlowError(f"the motion takes more than {_MOST_STEPS} steps over {duration:g} s: it "
                        "grows without bound or switches without end")

    def _series(self, rows: Real, mode: Mode, unit: float) -> Real:
        """Coefficients (p + 1, 2n + m, r) of the rows and of w and its derivatives."""
        rates = self.rates(mode.signs)
        # Drag that is zero here may still change with the parameter.
        weights = np.array([float(sign) if drag != 0.0 or rates is not None else 0.0
                            for sign, drag in zip(mode.signs, self._drags, strict=True)])
        by_matrix, by_constant = (mode.matrix, mode.constant) if rates is None else rates
        series: Real = extended_series(
            ORDER, unit, rows, mode.matrix, mode.constant, self._velocities, weights, by_matrix,
            by_constant, rates is not None)
        return series

    def _event(self, series: Real, signs: Signs, length: float,
               contact: dict[int, int]) -> _Event | None:
        """The first event within ``length``, from the ``series`` (p + 1, 2n + m, r)."""
        powers = length ** _EXPONENTS
        found: list[_Event] = []
        for index, sign in enumerate(signs):
            velocity = self.velocities[index]
            if sign != 0:
                if index not in contact and keeps_sign(series, velocity, length, sign):
                    continue
                margin = sign * powers * series[:, velocity, 0]
                margin[:contact.get(index, 0)] = 0.0
                margins = [margin]
            else:
                mode = mode_of(self.model, signs)
                force = powers * (series[:, :, 0] @ mode.hold[:, index])
                force[0] += mode.hold_constant[index]
                margins = [-force, force]
                for margin in margins:
                    margin[0] += self.model.friction[index]
            for margin in margins:
                place = first_descent(margin)
                if place is not None:
                    found.append(_Event(place, index, sign == 0))
        return min(found, default=None)

    def _switch(self, rows: Real, signs: Signs, event: _Event) -> tuple[Signs, int]:
        """The mode after an event, and how many terms of the velocity vanish; changes ``rows``."""
        state, before = rows[0], mode_of(self.model, signs)
        index, velocity = event.number, self.velocities[event.number]
        if event.release:
            force = extended(self.model, signs, state) @ before.hold + before.hold_constant
            direction = 1 if force[index] > 0.0 else -1
            return (*signs[:index], direction, *signs[index + 1:]), 2
        state[velocity] = 0.0
        after = signs_at(self.model, state, signs)
        field = derivative(self.model, before, state)
        jump = derivative(self.model, mode_of(self.model, after), state) - field
        if len(rows) > 1 and field[velocity] != 0.0:
            rows[1:] += np.multiply.outer(rows[1:, velocity] / field[velocity], jump)
        rows[:, self.stuck(after)] = 0.0
        return after, 1
