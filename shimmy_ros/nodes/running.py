"""Runs one node as a process: starts it, spins it, and ends it cleanly on SIGINT and SIGTERM.

Nothing that takes long to import stands at the top, so that signals are caught from the start.
"""

from __future__ import annotations

import signal
import sys
from collections.abc import Callable, Sequence
from importlib import import_module
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from .gear_node import GearNode

FAILED = 1
BAD_INPUT = 2
_SIGNALS = (signal.SIGINT, signal.SIGTERM)
_SPIN_TIMEOUT_S = 0.1


def run(module: str, node_class: str, arguments: Sequence[str] | None = None) -> int:
    """Spin the node of this class until a signal asks to stop.

    Returns 0, or 2 where its parameters are refused, or 1 where it could not start, could not
    close its bag or lost a part of it.

    rclpy's own signal handlers end the context under the node's feet, which leaves no time to
    close a bag; these only set a flag, and during the teardown further signals are ignored.
    """
    stopping = False

    def ask_to_stop(signal_number: int, frame: object) -> None:
        nonlocal stopping
        stopping = True

    for number in _SIGNALS:
        signal.signal(number, ask_to_stop)
    make_node = getattr(import_module(module), node_class)
    return _run(make_node, arguments, lambda: stopping)


def _run(make_node: Callable[[], GearNode], arguments: Sequence[str] | None,
         stopping: Callable[[], bool]) -> int:
    import rclpy
    from rclpy.signals import SignalHandlerOptions

    from ..gear.parameters import ParameterError

    try:
        rclpy.init(args=arguments, signal_handler_options=SignalHandlerOptions.NO)
    except RuntimeError as error:  # rcl's errors: arguments or a params file that cannot be read
        print(" ".join(str(error).split()), file=sys.stderr)
        return BAD_INPUT
    try:
        try:
            node = make_node()
        except ParameterError as error:
            print(f"{error}", file=sys.stderr)
            return BAD_INPUT
        return 0 if _spin(node, stopping) else FAILED
    finally:
        rclpy.try_shutdown()


def _spin(node: GearNode, stopping: Callable[[], bool]) -> bool:
    """Start the node, spin and stop it; whether nothing went wrong."""
    from rclpy.executors import ExternalShutdownException, SingleThreadedExecutor

    executor = SingleThreadedExecutor()
    executor.add_node(node)
    try:
        started = node.start()
        while started and not stopping():
            executor.spin_once(timeout_sec=_SPIN_TIMEOUT_S)
    except ExternalShutdownException:
        node.get_logger().info("the context was shut down from outside")
    finally:
        for number in _SIGNALS:
            signal.signal(number, signal.SIG_IGN)
        stopped = node.stop()
        executor.shutdown()
        node.destroy_node()
    return started and stopped
