"""Runs one node as a process: starts it, spins it, and ends it on SIGINT and SIGTERM.

Nothing that takes long to import stands at the top, so that signals are caught from the start.

Ending takes two seconds at most, whatever the node computes. rclpy's own signal handlers end the
context under the node's feet, which leaves no time to close a bag; the ones here only set a flag
that the spinning looks at, and during the teardown further signals are ignored. A callback that
does not return keeps the flag from being looked at. Hence every signal wakes a watch as well, a
thread of its own, which ends the process where the teardown is not finished in time. Python's C
handler wakes it, through the wakeup file descriptor: that works while the main thread is in
compiled code, too, where Python's own handlers have to wait. A predictor has nothing to lose then;
its what-if process ends with its input. A bag that is open is waited for, in any case.
"""

from __future__ import annotations

import os
import signal
import sys
import threading
import time
from collections.abc import Callable, Sequence
from importlib import import_module
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from .gear_node import GearNode

FAILED = 1
BAD_INPUT = 2
_SIGNALS = (signal.SIGINT, signal.SIGTERM)
_SPIN_TIMEOUT_S = 0.1
# From the first signal to the end of the process, unless a bag is still open.
_PATIENCE_S = 1.4
_BAG_PERIOD_S = 0.05
_STDERR = 2


class _Watch:
    """Ends the process some time after the first signal, if it has not ended by itself."""

    def __init__(self) -> None:
        self.node: GearNode | None = None
        self._heard, told = os.pipe()
        # Nothing may wait in a signal handler.
        os.set_blocking(told, False)
        signal.set_wakeup_fd(told, warn_on_full_buffer=False)
        threading.Thread(target=self._wait, daemon=True).start()

    def _wait(self) -> None:
        os.read(self._heard, 1)
        time.sleep(_PATIENCE_S)
        while self.node is not None and self.node.holds_a_bag:
            time.sleep(_BAG_PERIOD_S)
        # The main thread may hold whatever lock a log would ask for.
        os.write(_STDERR, (f"a computation did not end within {_PATIENCE_S:g} s of a signal; "
                           "the process ends without it\n").encode())
        os._exit(FAILED if self.node is not None and self.node.failed else 0)


def run(module: str, node_class: str, arguments: Sequence[str] | None = None) -> int:
    """Spin the node of this class until a signal asks to stop.

    Returns 0, or 2 where its parameters are refused, or 1 where it could not start, could not
    close its bag or lost a part of it.
    """
    stopping = False

    def ask_to_stop(signal_number: int, frame: object) -> None:
        nonlocal stopping
        stopping = True

    watch = _Watch()
    for number in _SIGNALS:
        signal.signal(number, ask_to_stop)
    make_node = getattr(import_module(module), node_class)
    return _run(make_node, arguments, lambda: stopping, watch)


def _run(make_node: Callable[[], GearNode], arguments: Sequence[str] | None,
         stopping: Callable[[], bool], watch: _Watch) -> int:
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
            node = watch.node = make_node()
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
