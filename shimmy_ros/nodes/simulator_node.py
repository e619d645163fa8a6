"""The simulator: taxi velocity and damper in, the gear's motion out and everything into a bag."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from rclpy.clock import Clock, ClockType
from rclpy.parameter import Parameter
from std_srvs.srv import Trigger

from ..contract.messages import CODECS
from ..contract.records import GearResponse, Level, TaxiVelocity
from ..contract.spec import load_contract
from ..gear.parameters import Range
from ..simulation.samples import Samples
from ..simulation.simulation import KICK_RANGE, Simulation, SimulationError
from .gear_node import GearNode
from .interface import publisher, subscription
from .parameters import declare_number, declare_setting
from .recorder import Recorder

_RESPONSE = "gear_response"
_RATE_RANGE = Range("Hz", "samples of gear_response a second", 1.0, 5000.0)
_DEFAULT_RATE_HZ = 500.0
_DEFAULT_KICK = 3.0
_FLUSH_PERIOD_S = 0.05
# Long enough that a bag misses nothing while the node is busy.
_RECORDER_DEPTH = 1000
# What is simulated in one go at most, so that the node stays responsive while it catches up.
_LONGEST_ADVANCE_S = 0.1
# A clock that is further ahead than this was set or restarted; there is nothing to catch up with.
_LARGEST_LAG_S = 5.0


class SimulatorNode(GearNode):
    """Integrates the gear in step with the node's clock, publishes and records."""

    def __init__(self, **options: Any) -> None:
        """Raises ParameterError."""
        super().__init__("simulator", "simulator", **options)
        self._rate = declare_number(self, "publish_rate", _DEFAULT_RATE_HZ, _RATE_RANGE)
        self._kick = declare_number(self, "kick_swivel_rate", _DEFAULT_KICK, KICK_RANGE)
        self._record = declare_setting(self, "record", True, "write a bag of each run")
        directory = declare_setting(
            self, "bag_directory", "", "directory of the bag, which must not exist; later runs add "
            "+2, +3 ... to it. Empty: named by the time of the start, in the working directory")
        self._recorder = Recorder(directory, self.get_namespace(), self.fail)
        self._simulation = self._new_simulation(0.0)
        self._handles: list[Any] = []
        self._timers_of_run: list[Any] = []
        self._response_publisher: Any = None
        self._kick_service: Any = None
        self._begun_ns = 0
        self._sample = 0
        self._published = 0
        self._resets = 0
        self._rebased = 0

    # --- lifecycle ------------------------------------------------------------------------

    @property
    def holds_a_bag(self) -> bool:
        """Whether a run is being recorded."""
        return self._recorder.directory is not None

    def open(self) -> None:
        """Create the response's publisher, the kick service and what listens for the bag."""
        super().open()
        self._response_publisher = publisher(self, _RESPONSE)
        self._kick_service = self.create_service(Trigger, "~/kick", self._on_kick)
        contract = load_contract()
        for topic in contract.recorded:
            if topic.name != _RESPONSE:
                self._handles.append(subscription(
                    self, topic, self._recording(topic.name), _RECORDER_DEPTH))

    def begin(self) -> None:
        """Begin a run, and its bag: the gear at rest, at the last velocity heard."""
        self._simulation = self._new_simulation(
            0.0 if self.velocity is None else self.velocity.velocity)
        self._begun_ns, self._sample = 0, 0
        self._rate = self.get_parameter("publish_rate").value
        if self._record:
            directory = self._recorder.begin(self._settings())
            self.get_logger().info(f"recording to {directory}")
            steady = Clock(clock_type=ClockType.STEADY_TIME)
            self._timers_of_run.append(self.create_timer(
                _FLUSH_PERIOD_S, self._recorder.flush, clock=steady))
        self._timers_of_run.append(self.create_timer(1.0 / self._rate, self._advance))
        super().begin()

    def end(self) -> None:
        """End the run and close its bag."""
        super().end()
        for timer in self._timers_of_run:
            self.destroy_timer(timer)
        self._timers_of_run.clear()
        directory = self._recorder.end()
        if directory is not None:
            self.get_logger().info(f"closed {directory}")

    def close(self) -> None:
        """Give back what open() made."""
        super().close()
        for handle in self._handles:
            self.destroy_subscription(handle)
        self._handles.clear()
        if self._kick_service is not None:
            self.destroy_service(self._kick_service)
            self._kick_service = None
        if self._response_publisher is not None:
            self.destroy_lifecycle_publisher(self._response_publisher)
            self._response_publisher = None

    # --- inputs ---------------------------------------------------------------------------

    def on_velocity(self, sample: TaxiVelocity) -> None:
        """Roll on at the new velocity from now on."""
        self._advance()
        self._simulation.set_velocity(sample.velocity)

    def on_change(self) -> None:
        """Go on with gear, damper and minimum velocity as they are from now on."""
        self._advance()
        before = self._simulation
        self._simulation = self._new_simulation(before.taxi_velocity, before.time)
        self._simulation.set_state(before.state)

    def check_parameter(self, parameter: Parameter) -> None:
        """The kick has to be in its range, the publishing rate as well."""
        if parameter.name == "kick_swivel_rate":
            KICK_RANGE.check(parameter.name, parameter.value)
        elif parameter.name == "publish_rate":
            _RATE_RANGE.check(parameter.name, parameter.value)

    def apply_parameter(self, parameter: Parameter) -> None:
        """The kick's new size counts from the next kick; a rate counts from the next run."""
        if parameter.name == "kick_swivel_rate":
            self._kick = parameter.value

    def _on_kick(self, request: Any, response: Any) -> Any:
        response.success = self.active
        if self.active:
            self._advance()
            self._simulation.kick(self._kick)
            response.message = f"added {self._kick:g} rad/s to the swivel's rate"
        else:
            response.message = "not kicked: the simulator is not active"
        return response

    # --- the run --------------------------------------------------------------------------

    def _advance(self) -> None:
        """Bring the simulation up to the clock; publish and record the samples on the way."""
        if not self.active:
            return
        now_ns = self.get_clock().now().nanoseconds
        if now_ns == 0:
            return  # simulated time that has not begun
        if self._begun_ns == 0:
            self._begun_ns = now_ns
        lag_s = 1e-9 * (now_ns - self._begun_ns) - self._simulation.time
        if lag_s > _LARGEST_LAG_S or lag_s < -1.0 / self._rate:
            self._begun_ns += round(1e9 * lag_s)
            self._rebased += 1
            self.get_logger().warning(
                f"the clock jumped by {lag_s:.3f} s; the simulation goes on from there")
            return
        until = self._simulation.time + min(lag_s, _LONGEST_ADVANCE_S)
        if until < self._simulation.time:
            return
        last = int(until * self._rate)
        if last / self._rate > until:
            last -= 1  # rounding
        numbers = range(self._sample, last + 1)
        samples = self._integrate(until, [number / self._rate for number in numbers])
        rows = zip(numbers, samples.position.tolist(), samples.velocity.tolist(),
                   samples.effort.tolist(), strict=True)
        for number, position, velocity, effort in rows:
            stamp_ns = self._begun_ns + round(1e9 * number / self._rate)
            data = CODECS[_RESPONSE].encode(
                GearResponse(stamp_ns, tuple(position), tuple(velocity), tuple(effort)))
            self._response_publisher.publish(data)
            self._recorder.write(_RESPONSE, data, stamp_ns)
        self._published += len(numbers)
        self._sample = last + 1

    def _integrate(self, until: float, times: list[float]) -> Samples:
        """The motion at ``times``; a gear that leaves the model's range rests from now on."""
        begin = self._simulation.time
        try:
            return self._simulation.advance(until, times)
        except SimulationError as error:
            self._resets += 1
            self.get_logger().error(f"{error}; the gear is put to rest")
            self._simulation = self._new_simulation(self._simulation.taxi_velocity, begin)
            return self._simulation.advance(until, times)

    def _new_simulation(self, taxi_velocity: float, time: float = 0.0) -> Simulation:
        """The gear at rest at ``time`` [s] of the run."""
        return Simulation(self.gear, self.damper, taxi_velocity,
                          minimum_velocity=self.minimum_velocity, start_time=time)

    # --- the bag --------------------------------------------------------------------------

    def _settings(self) -> dict[str, str]:
        return {name: repr(parameter.value)
                for name, parameter in self.get_parameters_by_prefix("").items()}

    def _recording(self, topic: str) -> Callable[[bytes], None]:
        def record(data: bytes) -> None:
            self._recorder.write(topic, data, self.get_clock().now().nanoseconds)

        return record

    # --- diagnostics ----------------------------------------------------------------------

    def statuses(self) -> list[tuple[str, Level, str, dict[str, str]]]:
        """How the simulation and the recording are doing."""
        simulation = self._simulation
        values = {
            "time": repr(simulation.time), "published": str(self._published),
            "resets": str(self._resets), "clock jumps": str(self._rebased),
            "sticking": str(simulation.sticking), "at rest": str(simulation.at_rest),
        }
        if not self.active:
            motion = Level.STALE, "not active"
        elif not simulation.rolling:
            motion = Level.OK, (f"the tyre stands: taxi velocity is below the minimum of "
                                f"{self.minimum_velocity:g} m/s")
        else:
            motion = Level.OK, f"rolling at {simulation.taxi_velocity:g} m/s"
        return [("motion", *motion, values), ("bag", *self._bag_status())]

    def _bag_status(self) -> tuple[Level, str, dict[str, str]]:
        directory = self._recorder.directory
        values = {"directory": str(directory or "")}
        values |= {topic: str(count) for topic, count in self._recorder.counts.items()}
        if self._recorder.failure:
            return Level.ERROR, self._recorder.failure, values
        if directory is None:
            return Level.OK, "not recording", values
        return Level.OK, f"recording to {directory}", values
