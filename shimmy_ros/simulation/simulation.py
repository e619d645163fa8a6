"""Time integration of the gear with set-valued Coulomb friction and a velocity-squared damper.

While the swivel slips, the torque T_CF opposes its rate; where the rate comes to zero the swivel
sticks, with a rate of exactly zero, if a torque within +-T_CF holds it, and else turns round. It
is released where the holding torque reaches T_CF. Both events are located on the cubic through the
ends of a step, whose error is of the order of the step's own.

Between events the system is linear but for the damper, and each step is a `runge_kutta.Step`, made
once for a velocity and a step length. Lengths are powers of two, chosen by the embedded error in
the norm of the gear's energy. Motion faster than the shortest step (2^-20 s) is damped out and not
resolved. The steps depend on the history of the parameters alone and not on the times asked for: a
run advanced in pieces gives the same numbers as one advanced at once.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..gear.parameters import (
    DEFAULT_MINIMUM_VELOCITY,
    MINIMUM_VELOCITY_RANGE,
    VELOCITY_RANGE,
    Damper,
    Gear,
    ParameterError,
    Range,
)
from .interpolation import Cubic, first_exit, hermite
from .rolling_state import (
    DAMPER_RATE,
    STATES,
    STRUT_TILT_RATE,
    SWIVEL_RATE,
    TYRE_TORSION,
    Vector,
    energy_factor,
    rolling_model,
    tyre_kinematics,
)
from .runge_kutta import ORDER, Step, StepValues
from .samples import Samples, Segment, sample, states

TOLERANCE_RANGE = Range("1", "error of a step relative to the motion", 1e-9, 1e-2)
KICK_RANGE = Range("rad/s", "change of the swivel rate", -1e3, 1e3)
# Holds seconds since 1970; further out the shortest step would be lost in rounding.
TIME_RANGE = Range("s", "time", -4e9, 4e9)

# Half a turn: beyond it the linear geometry of the model describes no gear.
ANGLE_LIMIT = math.pi
# A stuck gear all of whose rates and accelerations are below this (SI) has come to rest.
REST = 1e-9
# Motion of this angle [rad], turned against the tyre, is the floor of the relative error.
SMALL_ANGLE = 1e-4

_LONGEST, _FIRST, _SHORTEST = 6, 11, 20  # binary logarithms of 1 / step length [s]
_GROWTH = 4.0**ORDER  # of the squared error estimate when a step is doubled


class SimulationError(ArithmeticError):
    """The motion has left the range of the model, or cannot be integrated."""


class Simulation:
    """The gear rolling in time, at rest at first.

    Velocity, gear and damper may change, and the swivel be kicked, at any moment; all take effect
    at the current ``time``. Below ``minimum_velocity`` [m/s] the tyre is taken to stand on the
    ground. ``tolerance`` is the error allowed in a step, relative to the motion in the norm of the
    gear's energy: with 1e-4 the amplitudes of the reference gear's cycles are right to 1e-4.
    ``start_time`` [s] is the time at which the simulation begins.

    Raises ParameterError for values out of range.
    """

    def __init__(self, gear: Gear, damper: Damper, taxi_velocity: float = 0.0, *,
                 minimum_velocity: float = DEFAULT_MINIMUM_VELOCITY, tolerance: float = 1e-4,
                 start_time: float = 0.0) -> None:
        self._taxi_velocity = VELOCITY_RANGE.check("taxi_velocity", taxi_velocity)
        self._minimum_velocity = MINIMUM_VELOCITY_RANGE.check("minimum_velocity", minimum_velocity)
        self._tolerance = TOLERANCE_RANGE.check("tolerance", tolerance)
        self._now = TIME_RANGE.check("start_time", start_time)
        self._damper = damper
        self._level = _FIRST
        self._values = StepValues()
        self._use_gear(gear)
        self._restart(np.zeros(STATES))

    @property
    def time(self) -> float:
        """The time [s] up to which the simulation has advanced."""
        return self._now

    @property
    def gear(self) -> Gear:
        """The gear in use."""
        return self._gear

    @property
    def damper(self) -> Damper:
        """The damper in use."""
        return self._damper

    @property
    def taxi_velocity(self) -> float:
        """The velocity last set [m/s]."""
        return self._taxi_velocity

    @property
    def rolling(self) -> bool:
        """Whether the tyre rolls; below the minimum velocity it stands."""
        return self._taxi_velocity >= self._minimum_velocity

    @property
    def state(self) -> Vector:
        """The state (8,) at the current time, as in `rolling_state`."""
        state: Vector = states([self._segment], np.array([self._now]))[0]
        return state

    @property
    def sticking(self) -> bool:
        """Whether friction holds the swivel at the current time."""
        return math.isnan(self._segment.friction)

    @property
    def at_rest(self) -> bool:
        """Whether the whole gear is at rest: every rate is exactly zero and stays so."""
        return math.isinf(self._segment.stop)

    def set_velocity(self, taxi_velocity: float) -> None:
        """Roll on at ``taxi_velocity`` [m/s]. Raises ParameterError."""
        before = self._rolling_velocity
        self._taxi_velocity = VELOCITY_RANGE.check("taxi_velocity", taxi_velocity)
        self._roll_on(before)

    def set_minimum_velocity(self, minimum_velocity: float) -> None:
        """Take the tyre to stand below ``minimum_velocity`` [m/s]. Raises ParameterError."""
        before = self._rolling_velocity
        self._minimum_velocity = MINIMUM_VELOCITY_RANGE.check("minimum_velocity", minimum_velocity)
        self._roll_on(before)

    def set_gear(self, gear: Gear) -> None:
        """Go on with another gear in the present state."""
        if gear != self._gear:
            state = self.state
            self._use_gear(gear)
            self._restart(state)

    def set_damper(self, damper: Damper) -> None:
        """Go on with another damper in the present state."""
        if damper != self._damper:
            self._damper = damper
            self._restart(self.state)

    def set_state(self, state: ArrayLike) -> None:
        """Go on from ``state`` (8,), as in `rolling_state`. Raises ParameterError."""
        values = np.array(state, dtype=float)
        if values.shape != (STATES,) or not np.isfinite(values).all():
            raise ParameterError(f"state is {state!r}, but must be {STATES} finite numbers")
        self._restart(values)

    def kick(self, swivel_rate: float) -> None:
        """Add ``swivel_rate`` [rad/s] to the rate of the swivel. Raises ParameterError."""
        state = self.state
        state[SWIVEL_RATE] += KICK_RANGE.check("swivel_rate", swivel_rate)
        self._restart(state)

    def advance(self, until: float, sample_times: ArrayLike = ()) -> Samples:
        """Advance to the time ``until`` [s] and return the motion at ``sample_times`` [s].

        The sample times do not decrease and lie between the current time and ``until``.

        Raises ParameterError for other times. Raises SimulationError where strut tilt, swivel,
        damper or the tyre's torsion passes `ANGLE_LIMIT`, or where no step is short enough; the
        simulation then stands where it could not go on, and fails again unless it is changed.
        """
        until = Range("s", "time", self._now, TIME_RANGE.high).check("until", until)
        times = np.array(sample_times, dtype=float)
        _check_times(times, self._now, until)
        wanted = times.tolist()
        picked: list[Segment] = []
        with np.errstate(all="ignore"):
            while True:
                segment = self._segment
                while len(picked) < len(wanted) and wanted[len(picked)] < segment.stop:
                    picked.append(segment)
                if segment.stop > until:
                    break
                self._now = max(self._now, segment.stop)
                self._proceed()
            self._now = until
            return sample(picked, times, self._damper, self._model.slipping[3],
                          self._model.holding_torque)

    def _roll_on(self, before: float) -> None:
        if self._rolling_velocity != before:
            state = self.state
            self._use_velocity()
            self._restart(state)

    @property
    def _rolling_velocity(self) -> float:
        return self._taxi_velocity if self.rolling else 0.0

    def _use_gear(self, gear: Gear) -> None:
        self._models = rolling_model(gear)
        self._gear = gear
        against_tyre = math.sqrt(gear.tyre_torsional_stiffness)
        self._weights = np.vstack([energy_factor(gear),
                                   against_tyre * tyre_kinematics(gear).heading])
        self._smallest = (SMALL_ANGLE * against_tyre) ** 2
        self._use_velocity()

    def _use_velocity(self) -> None:
        self._model = self._models.at(self._rolling_velocity)
        self._steps: dict[tuple[bool, int], Step] = {}

    def _restart(self, state: Vector) -> None:
        """Go on from ``state`` at the current time under the parameters as they are now."""
        with np.errstate(all="ignore"):
            self._begin(state)
        knot = np.concatenate([state, np.zeros(STATES)])
        self._segment = Segment(self._now, self._now, 1.0, knot, knot, self._friction)
        if self._rests():
            self._rest()

    def _begin(self, state: Vector) -> None:
        """Take the friction that the set-valued law gives for ``state``."""
        limit = self._damper.coulomb_torque
        rate = float(state[SWIVEL_RATE])
        holding = float(self._model.holding_torque @ state)
        if limit == 0.0:
            friction = 0.0
        elif rate != 0.0:
            friction = -math.copysign(limit, rate)
        elif abs(holding) <= limit:
            friction = math.nan
        else:
            friction = math.copysign(limit, holding)
        self._enter(state, friction)

    def _enter(self, state: Vector, friction: float) -> None:
        """Slip from ``state`` against the ``friction`` torque [N m], or stick where it is NaN."""
        model, damper = self._model, self._damper
        limit = damper.coulomb_torque
        sticking = math.isnan(friction)
        rate = state[DAMPER_RATE]
        torque = -(damper.linear_damping + damper.quadratic_damping * abs(rate)) * rate
        derivative = model.damper_input * torque
        if sticking:
            derivative += model.sticking @ state
            self._low, self._high = -limit, limit
            watch = model.holding_torque
        else:
            derivative += model.slipping @ state + model.friction_input * friction
            self._low = 0.0 if friction < 0.0 else -math.inf
            self._high = 0.0 if friction > 0.0 else math.inf
            watch = np.eye(STATES)[SWIVEL_RATE]
        self._watch = watch
        self._watched, self._watched_rate = float(watch @ state), float(watch @ derivative)
        self._friction, self._sticking = friction, sticking
        self._knot = np.concatenate([state, derivative])
        self._values.start[:] = state
        self._values.friction[:] = 0.0 if sticking else friction
        self._switched = True

    def _proceed(self) -> None:
        """Replace the segment by the next one: a step, or the part of it before an event."""
        if self._rests():
            self._rest()
            return
        begin = self._knot
        if self._switched and not np.isfinite(begin).all():
            raise self._too_fast()
        step, error = self._accepted_step()
        start, length = self._segment.stop, step.length
        end = self._values.knot.copy()
        watched, watched_rate = self._values.watched.tolist()
        at = first_exit(Cubic(self._watched, length * self._watched_rate, watched,
                              length * watched_rate), self._low, self._high)
        if at is None:
            self._segment = Segment(start, start + length, length, begin, end, self._friction)
            self._knot = end
            self._values.start[:] = self._values.state
            self._watched, self._watched_rate = watched, watched_rate
            self._switched = False
            if 2.0 * _GROWTH * error < 1.0 and self._level > _LONGEST:
                self._level -= 1
            return
        if self._switched:
            # Rounding could undo a switch as soon as it is made; time goes on all the same.
            at = max(at, min(1.0, 2.0**-_SHORTEST / length))
        self._segment = Segment(start, start + at * length, length, begin, end, self._friction)
        state = hermite(at, length, begin[:STATES], begin[STATES:], end[:STATES], end[STATES:])
        if self._sticking:
            holding = float(self._model.holding_torque @ state)
            self._enter(state, math.copysign(self._damper.coulomb_torque, holding))
        else:
            state[SWIVEL_RATE] = 0.0
            self._begin(state)

    def _accepted_step(self) -> tuple[Step, float]:
        """Take a step that passes the error test; the shortest one passes whatever its error.

        Returns it with its squared error, as a fraction of the one allowed.
        """
        damper, values, square = self._damper, self._values, self._tolerance**2
        error, scaled = values.error, values.scaled
        while True:
            step = self._step()
            step.take(values, damper.linear_damping, damper.quadratic_damping)
            ratio = float(error.dot(error)) / (
                square * (float(scaled.dot(scaled)) + self._smallest))
            if ratio <= 1.0 or self._level == _SHORTEST:
                break
            self._level = min(self._level + (1 if ratio < _GROWTH else 2), _SHORTEST)
        tilt, swivel, rotation, *_, torsion = values.state.tolist()
        if not (abs(tilt) <= ANGLE_LIMIT and abs(swivel) <= ANGLE_LIMIT
                and abs(rotation) <= ANGLE_LIMIT and abs(torsion) <= ANGLE_LIMIT):
            raise SimulationError(
                f"the motion leaves the range of the model, {ANGLE_LIMIT:.3f} rad, at "
                f"{self._now:.3f} s: strut tilt {tilt:.3g}, swivel {swivel:.3g}, damper "
                f"{rotation:.3g}, tyre torsion {torsion:.3g} rad"
            )
        return step, ratio

    def _step(self) -> Step:
        """The step of the present level, or the longest shorter one that can be used."""
        model = self._model
        while True:
            step = self._steps.get((self._sticking, self._level))
            if step is None:
                matrix = model.sticking if self._sticking else model.slipping
                friction = np.zeros(STATES) if self._sticking else model.friction_input
                step = Step(matrix, np.column_stack([friction, model.damper_input]),
                            2.0**-self._level, self._watch, self._weights)
                self._steps[self._sticking, self._level] = step
            if step.usable:
                return step
            if self._level == _SHORTEST:
                raise self._too_fast()
            self._level += 1

    def _too_fast(self) -> SimulationError:
        return SimulationError(
            f"the gear moves too fast to be integrated at {self._now:.3f} s: no step of "
            f"{2.0**-_SHORTEST:.1e} s or more has a solution within floating-point numbers"
        )

    def _rests(self) -> bool:
        """Whether nothing moves any more, up to `REST` under friction and exactly without it."""
        if not (self._sticking or self._friction == 0.0):
            return False
        limit = REST if self._sticking else 0.0
        return bool(np.abs(self._knot[STATES:]).max() <= limit)

    def _rest(self) -> None:
        knot = self._knot.copy()
        knot[STRUT_TILT_RATE:TYRE_TORSION] = 0.0
        knot[STATES:] = 0.0
        self._segment = Segment(self._now, math.inf, 1.0, knot, knot, self._friction)


def _check_times(times: NDArray[np.float64], start: float, until: float) -> None:
    if times.ndim != 1:
        raise ParameterError(f"sample_times has shape {times.shape}, but must be a list of times")
    if times.size and not (start <= times[0] and times[-1] <= until
                           and (np.diff(times) >= 0.0).all()):
        raise ParameterError(
            f"sample_times run from {times[0]} to {times[-1]} s, but must not decrease and lie in "
            f"[{start}, {until}] s"
        )
