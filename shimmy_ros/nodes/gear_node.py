"""What the predictor and the simulator have in common: gear, damper, inputs and diagnostics."""

from __future__ import annotations

import math
import time
import traceback
from collections.abc import Callable, Iterable
from typing import Any

from lifecycle_msgs.srv import ChangeState
from rcl_interfaces.msg import SetParametersResult
from rclpy.clock import Clock, ClockType
from rclpy.lifecycle import LifecycleNode, LifecycleState, TransitionCallbackReturn
from rclpy.parameter import Parameter

from ..contract.messages import CODECS
from ..contract.records import Level, MessageError, Status, TaxiVelocity
from ..contract.session import REFERENCE_HARDWARE
from ..contract.spec import Topic, load_contract
from ..gear.parameter_file import reference_parameters
from ..gear.parameters import (
    DEFAULT_MINIMUM_VELOCITY,
    MINIMUM_VELOCITY_RANGE,
    VELOCITY_RANGE,
    Damper,
    Gear,
    ParameterError,
    changed,
)
from .interface import publisher, subscription
from .parameters import (
    changed_group,
    declare_group,
    declare_number,
    declare_setting,
    refusal,
)

_DIAGNOSTICS_PERIOD_S = 1.0
_LOG_PERIOD_S = 5.0
_VELOCITY_TIMEOUT_S = 2.0
_VELOCITY = "taxi_velocity"
_DAMPER_TOPIC = "damper/"


class GearNode(LifecycleNode):
    """A managed node with a gear and a damper that listens to the rig.

    Bad input changes nothing; it is counted, logged (throttled for each topic) and named in
    /diagnostics, at least once and until the next good sample of the same topic.
    """

    def __init__(self, name: str, party: str, **options: Any) -> None:
        """``party`` is the node's name in the contract. Raises ParameterError."""
        super().__init__(name, **options)
        self._party = party
        self.gear, self.damper = (declare_group(self, group) for group in reference_parameters())
        self.minimum_velocity = declare_number(
            self, "minimum_velocity", DEFAULT_MINIMUM_VELOCITY, MINIMUM_VELOCITY_RANGE)
        self._hardware_id = declare_setting(
            self, "hardware_id", REFERENCE_HARDWARE,
            "what the diagnostics are about; never empty")
        if not self._hardware_id:
            raise ParameterError("parameter hardware_id is '', but must not be empty")
        self._autostart = declare_setting(
            self, "autostart", True, "configure and activate at the start")
        self._refuse_impossible_transitions()
        self._finalized = False
        self.failed = False
        self.active = False
        self.velocity: TaxiVelocity | None = None
        self._velocity_received_ns = 0
        self._received: dict[str, int] = {}
        self._refused: dict[str, int] = {}
        self._complaints: dict[str, str] = {}
        self._settled: set[str] = set()
        self._logged_s: dict[str, float] = {}
        self._inputs: list[Any] = []
        self._diagnostics_publisher: Any = None
        self._diagnostics_timer: Any = None

    # --- what a node adds -----------------------------------------------------------------

    @property
    def holds_a_bag(self) -> bool:
        """Whether a bag is open, which must not be cut."""
        return False

    def on_velocity(self, sample: TaxiVelocity) -> None:
        """A valid velocity sample came in; self.velocity is still the one before."""

    def on_change(self) -> None:
        """Gear, damper or another parameter changed."""

    def on_damper(self) -> None:
        """A message changed the damper; on_change() was called before."""

    def check_parameter(self, parameter: Parameter) -> None:
        """Raise ParameterError for a value of a parameter of the node's own."""

    def apply_parameter(self, parameter: Parameter) -> None:
        """Take over a value that check_parameter let pass."""

    def statuses(self) -> list[tuple[str, Level, str, dict[str, str]]]:
        """The node's own parts of /diagnostics: part, level, message, values."""
        return []

    def open(self) -> None:
        """Create what the node needs; inputs are heard from now on, answers gated."""
        self._diagnostics_publisher = publisher(self, "/diagnostics", gated=False)
        for topic in self._rig_topics():
            self._inputs.append(subscription(self, topic, self._input(topic.name)))
        # The node reports while simulated time stands still, too.
        self._diagnostics_timer = self.create_timer(
            _DIAGNOSTICS_PERIOD_S, self._diagnose, clock=Clock(clock_type=ClockType.STEADY_TIME))

    def begin(self) -> None:
        """Begin to answer."""
        self.active = True

    def end(self) -> None:
        """Stop answering, if it ever began; inputs are still heard."""
        self.active = False

    def close(self) -> None:
        """Give back whatever is held."""
        for handle in self._inputs:
            self.destroy_subscription(handle)
        self._inputs.clear()
        if self._diagnostics_timer is not None:
            self.destroy_timer(self._diagnostics_timer)
            self._diagnostics_timer = None
        if self._diagnostics_publisher is not None:
            self.destroy_publisher(self._diagnostics_publisher)
            self._diagnostics_publisher = None

    # --- lifecycle ------------------------------------------------------------------------

    def start(self) -> bool:
        """Configure and activate, unless the parameter ``autostart`` says otherwise.

        False where that failed; the log says why.
        """
        # Not before: rclpy calls them for declarations, too, which check their values themselves.
        self.add_on_set_parameters_callback(self._check_parameters)
        self.add_post_set_parameters_callback(self._apply_parameters)
        success = TransitionCallbackReturn.SUCCESS
        return not self._autostart or (
            self.trigger_configure() == success and self.trigger_activate() == success)

    def stop(self) -> bool:
        """Finalise, from whatever state the node is in; False where something has failed."""
        if not self._finalized:
            self.trigger_shutdown()
        return not self.failed

    def fail(self, sentence: str) -> None:
        """Say what has failed; the node goes on, but its process ends with a status of failure."""
        self.failed = True
        self.get_logger().fatal(sentence)

    def on_configure(self, state: LifecycleState) -> TransitionCallbackReturn:
        """See open()."""
        return self._transition("configure", self.open)

    def on_activate(self, state: LifecycleState) -> TransitionCallbackReturn:
        """See begin()."""
        super().on_activate(state)
        return self._transition("activate", self.begin)

    def on_deactivate(self, state: LifecycleState) -> TransitionCallbackReturn:
        """See end()."""
        result = self._transition("deactivate", self.end)
        super().on_deactivate(state)
        return result

    def on_cleanup(self, state: LifecycleState) -> TransitionCallbackReturn:
        """See close()."""
        return self._transition("clean up", self.close)

    def on_shutdown(self, state: LifecycleState) -> TransitionCallbackReturn:
        """See end() and close()."""
        self._finalized = True
        return self._transition("shut down", self.end, self.close)

    def on_error(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Back to unconfigured after a transition that failed."""
        return self._transition("recover", self.end, self.close)

    def _refuse_impossible_transitions(self) -> None:
        # rclpy lets the error of a transition that the present state does not have end the process.
        for service in self.services:
            if service.srv_type is ChangeState:
                service.callback = _guarded(service.callback, self.get_logger())

    def _transition(self, name: str, *actions: Callable[[], None]) -> TransitionCallbackReturn:
        # rclpy drops an exception of a transition without a word.
        try:
            for action in actions:
                action()
        except Exception as error:
            self.fail(f"could not {name}: {error}")
            self.get_logger().debug(traceback.format_exc())
            return TransitionCallbackReturn.ERROR
        return TransitionCallbackReturn.SUCCESS

    # --- inputs ---------------------------------------------------------------------------

    def _rig_topics(self) -> list[Topic]:
        return [topic for topic in load_contract().subscribed_by(self._party)
                if "rig" in topic.publishers]

    def _input(self, topic: str) -> Callable[[bytes], None]:
        take = self._take_velocity if topic == _VELOCITY else self._take_damper

        def callback(data: bytes) -> None:
            self._received[topic] = self._received.get(topic, 0) + 1
            if topic == _VELOCITY:
                self._velocity_received_ns = self.get_clock().now().nanoseconds
            try:
                take(topic, CODECS[topic].decode(data))
            except (ParameterError, MessageError) as error:
                self.refuse(topic, str(error))
            else:
                self._settled.add(topic)

        return callback

    def refuse(self, topic: str, sentence: str) -> None:
        """Count, log and remember an input that changes nothing."""
        self._refused[topic] = self._refused.get(topic, 0) + 1
        self._complaints[topic] = sentence
        self._settled.discard(topic)
        # rclpy's own throttle would let one topic silence the others.
        now_s = time.monotonic()
        if now_s - self._logged_s.get(topic, -math.inf) >= _LOG_PERIOD_S:
            self._logged_s[topic] = now_s
            self.get_logger().warning(f"refused a message on {topic}: {sentence}")

    def _take_velocity(self, topic: str, sample: TaxiVelocity) -> None:
        VELOCITY_RANGE.check(_VELOCITY, sample.velocity)
        self.on_velocity(sample)
        self.velocity = sample

    def _take_damper(self, topic: str, value: float) -> None:
        # Through the node's parameter, so that there is one current value and one check of it.
        name = topic.removeprefix(_DAMPER_TOPIC)
        changed(self.damper, **{name: value})
        result = self.set_parameters([Parameter(f"damper.{name}", value=value)])[0]
        if not result.successful:
            raise ParameterError(result.reason)
        self.on_damper()

    # --- parameters -----------------------------------------------------------------------

    def _check_parameters(self, parameters: list[Parameter]) -> SetParametersResult:
        try:
            changed_group(self.gear, parameters)
            changed_group(self.damper, parameters)
            for parameter in parameters:
                if parameter.name == "minimum_velocity":
                    MINIMUM_VELOCITY_RANGE.check(parameter.name, parameter.value)
                self.check_parameter(parameter)
        except ParameterError as error:
            return refusal(error)
        return SetParametersResult(successful=True)

    def _apply_parameters(self, parameters: Iterable[Parameter]) -> None:
        parameters = list(parameters)
        self.gear: Gear = changed_group(self.gear, parameters)
        self.damper: Damper = changed_group(self.damper, parameters)
        for parameter in parameters:
            if parameter.name == "minimum_velocity":
                self.minimum_velocity = parameter.value
            self.apply_parameter(parameter)
        self.on_change()

    # --- diagnostics ----------------------------------------------------------------------

    def _diagnose(self) -> None:
        stamp = self.get_clock().now().nanoseconds
        level, message, values = self._inputs_status(stamp)
        name = self.get_name()
        statuses = [Status(stamp, f"{name}: inputs", self._hardware_id, level, message, values)]
        statuses += [Status(stamp, f"{name}: {part}", self._hardware_id, *rest)
                     for part, *rest in self.statuses()]
        self._diagnostics_publisher.publish(CODECS["/diagnostics"].encode(statuses))
        for topic in self._settled:
            self._complaints.pop(topic, None)
        self._settled.clear()

    def _inputs_status(self, now_ns: int) -> tuple[Level, str, dict[str, str]]:
        values = {
            _VELOCITY: repr(self.velocity.velocity if self.velocity else math.nan),
            "linear_damping": repr(self.damper.linear_damping),
            "quadratic_damping": repr(self.damper.quadratic_damping),
            "coulomb_torque": repr(self.damper.coulomb_torque),
            "minimum_velocity": repr(self.minimum_velocity),
        }
        for topic in self._rig_topics():
            values[f"{topic.name} received"] = str(self._received.get(topic.name, 0))
            values[f"{topic.name} refused"] = str(self._refused.get(topic.name, 0))
        problems = [(Level.WARN, f"refused {topic}: {text}")
                    for topic, text in self._complaints.items()]
        silent_s = 1e-9 * (now_ns - self._velocity_received_ns)
        if not self._received.get(_VELOCITY):
            problems.append((Level.STALE, "no taxi velocity yet"))
        elif silent_s > _VELOCITY_TIMEOUT_S:
            problems.append((Level.STALE, f"no taxi velocity for {silent_s:.1f} s"))
        if not problems:
            return Level.OK, "taxi velocity is coming in", values
        return (max(level for level, _ in problems), "; ".join(text for _, text in problems),
                values)


def _guarded(change_state: Callable[[Any, Any], Any], logger: Any) -> Callable[[Any, Any], Any]:
    def change(request: Any, response: Any) -> Any:
        try:
            return change_state(request, response)
        except RuntimeError as error:
            logger.warning(f"refused a transition: {error}")
            response.success = False
            return response

    return change
