"""The predictor: taxi velocity and damper in, the limit cycle out."""

from __future__ import annotations

import time
from dataclasses import replace
from typing import Any

from rclpy.parameter import Parameter

from ..contract.answers import ANSWER_TOPICS, Findings, answer, findings
from ..contract.messages import CODECS
from ..contract.records import Level, TaxiVelocity
from ..contract.session import UNSTAMPED, Session
from ..cycles.prediction import Predictor
from ..cycles.settings import (
    ACCURACY_RANGE,
    BUDGET_RANGE,
    DEFAULT_ACCURACY,
    DEFAULT_BUDGET,
    DEFAULT_HARMONICS,
    HARMONICS_RANGE,
    Settings,
)
from ..gear.parameter_file import reference_parameters
from ..gear.parameters import Limits, Range
from ..gear.system import OperatingPoint
from ..what_if.query import Present
from ..what_if.reply import DEFAULT_MAXIMUM_POINTS
from .gear_node import GearNode
from .interface import publisher
from .parameters import changed_group, declare_count, declare_group, declare_number
from .what_if import WhatIf

# Settings of the solver that are parameters by the same name.
_SETTINGS = ("harmonics", "accuracy", "budget", "minimum_velocity")
# At the last one the swivel sticks, which the balance cannot answer.
_WARM_UP_VELOCITIES = (40.0, 41.0, 7.0)
_MAXIMUM_POINTS_RANGE = Range("points", "points that a what-if query may have", 1, 1_000_000)


class PredictorNode(GearNode):
    """Answers every velocity sample that it can keep up with, and every change of a parameter."""

    def __init__(self, **options: Any) -> None:
        """Raises ParameterError."""
        super().__init__("predictor", "predictor", **options)
        self._session = Session(self.gear, self.damper, Predictor(Settings(
            harmonics=declare_count(self, "harmonics", DEFAULT_HARMONICS, HARMONICS_RANGE),
            accuracy=declare_number(self, "accuracy", DEFAULT_ACCURACY, ACCURACY_RANGE),
            budget=declare_number(self, "budget", DEFAULT_BUDGET, BUDGET_RANGE),
            minimum_velocity=self.minimum_velocity, limits=declare_group(self, Limits()))))
        self._answer_publishers: dict[str, Any] = {}
        self._outcomes: dict[str, int] = {}
        self._last: tuple[Findings, float] | None = None
        self._change = self.create_guard_condition(self._answer_change)
        self._change_pending = False
        self._maximum_points = declare_count(
            self, "what_if_maximum_points", DEFAULT_MAXIMUM_POINTS, _MAXIMUM_POINTS_RANGE)
        self._what_if = WhatIf(self, self._present, lambda: self._maximum_points)

    def open(self) -> None:
        """Create the answers' publishers as well, once the solver is ready."""
        self._warm_up()
        self._answer_publishers = {name: publisher(self, name) for name in ANSWER_TOPICS}
        self._what_if.open()
        super().open()

    def close(self) -> None:
        """Destroy them."""
        super().close()
        self._what_if.close()
        for handle in self._answer_publishers.values():
            self.destroy_lifecycle_publisher(handle)
        self._answer_publishers.clear()

    def begin(self) -> None:
        """Answer at once where a velocity was heard already: it or the damper may be a new one."""
        super().begin()
        self.on_change()

    def on_velocity(self, sample: TaxiVelocity) -> None:
        """Answer the sample; the queue is short, so that of a flood the newest are answered."""
        jump = self._session.take(sample, self._velocity_received_ns)
        if jump:
            self.get_logger().warning(jump, throttle_duration_sec=5.0)
        if self._session.unstamped:
            self.get_logger().warning(UNSTAMPED, once=True)
        self._answer()

    def on_change(self) -> None:
        """Answer for the last velocity, once for all the changes that are waiting."""
        self._session.gear, self._session.damper = self.gear, self.damper
        self._change_pending = True
        self._change.trigger()

    def on_damper(self) -> None:
        """Answer at once, so that the order of the messages alone decides what is answered."""
        self._answer_change()

    def check_parameter(self, parameter: Parameter) -> None:
        """The solver's settings have to be in their ranges, the number of points as well."""
        if parameter.name == "what_if_maximum_points":
            _MAXIMUM_POINTS_RANGE.check(parameter.name, parameter.value)
        replace(self._session.predictor.settings, **self._settings_of(parameter))

    def apply_parameter(self, parameter: Parameter) -> None:
        """Take over the solver's settings and the number of points."""
        if parameter.name == "what_if_maximum_points":
            self._maximum_points = parameter.value
        settings = self._settings_of(parameter)
        if settings:
            self._session.predictor.use(**settings)

    def statuses(self) -> list[tuple[str, Level, str, dict[str, str]]]:
        """How the last answer went, and how many of each kind there were."""
        values = {f"answers {outcome}": str(count) for outcome, count in self._outcomes.items()}
        values["time jumps"] = str(self._session.jumps)
        if self._last is None:
            return [("solver", Level.OK, "nothing to answer yet", values), self._what_if.status()]
        found, solve_time = self._last
        values["solve_time"] = repr(solve_time)
        # An aircraft that stands is nothing to be warned of.
        level = Level.OK if found.outcome == "not_rolling" else found.level
        return [("solver", level, found.message, values), self._what_if.status()]

    def _settings_of(self, parameter: Parameter) -> dict[str, Any]:
        """What a parameter changes of the solver's settings. Raises ParameterError."""
        if parameter.name in _SETTINGS:
            return {parameter.name: parameter.value}
        limits = self._session.predictor.settings.limits
        after = changed_group(limits, [parameter])
        return {} if after is limits else {"limits": after}

    def _present(self) -> Present | None:
        if not self.active:
            return None
        settings, sample = self._session.predictor.settings, self._session.sample
        return Present(self.gear, self.damper, None if sample is None else sample.velocity,
                       settings)

    def _warm_up(self) -> None:
        # The first solves after an installation compile the solver, cold and warm, for some
        # seconds. Whoever waits for the inputs to be heard need not wait for the answer then.
        predictor = Predictor()
        gear, damper = reference_parameters()
        for velocity in _WARM_UP_VELOCITIES:
            predictor.predict(OperatingPoint(gear, damper, velocity))

    def _answer_change(self) -> None:
        if self._change_pending:
            self._answer()

    def _answer(self) -> None:
        sample = self._session.sample
        if not self.active or sample is None:
            return
        self._change_pending = False
        started = time.perf_counter()
        verdict = self._session.predict()
        solve_time = time.perf_counter() - started
        found = findings(verdict)
        self._last = found, solve_time
        self._outcomes[found.outcome] = self._outcomes.get(found.outcome, 0) + 1
        if found.level is Level.ERROR:
            self.get_logger().error(
                f"at {sample.velocity:g} m/s: {found.message}", throttle_duration_sec=5.0)
        for name, record in answer(
                found, sample.stamp_ns, self._hardware_id, solve_time).items():
            self._answer_publishers[name].publish(CODECS[name].encode(record))
