"""Long commands: a progress bar on a terminal, and a Ctrl-C that keeps what is finished."""

from __future__ import annotations

import signal
import sys
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from types import FrameType
from typing import TypeVar

from tqdm import tqdm

INTERRUPTED = 130
"""Exit status of a command that was asked to stop."""

STOPPED = "shimmy: stopped; what was finished until then is there"

_SIGNALS = (signal.SIGINT, signal.SIGTERM)
_UPDATE_EVERY = 256

Item = TypeVar("Item")


class Stop:
    """Whether the user asked to stop."""

    requested = False


@contextmanager
def signals_held() -> Iterator[None]:
    """SIGINT and SIGTERM wait until the end of this: amid an import, Python can lose one."""
    before = signal.pthread_sigmask(signal.SIG_BLOCK, _SIGNALS)
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)


@contextmanager
def stoppable() -> Iterator[Stop]:
    """SIGINT and SIGTERM only set the flag that this gives; a second one has its usual effect."""
    stop = Stop()
    before = {number: signal.getsignal(number) for number in _SIGNALS}

    def restore() -> None:
        for number, handler in before.items():
            signal.signal(number, handler)

    def ask(number: int, frame: FrameType | None) -> None:
        stop.requested = True
        restore()

    for number in _SIGNALS:
        signal.signal(number, ask)
    try:
        yield stop
    finally:
        restore()


def until_stopped(items: Iterable[Item], stop: Stop, what: str, fraction: Callable[[], float]
                  ) -> Iterator[Item]:
    """``items``, as long as nobody asked to stop, with a bar at ``fraction`` for ``what``."""
    with tqdm(total=100.0, desc=what, disable=not sys.stderr.isatty(),
              bar_format="{desc}: {percentage:3.0f} %|{bar}| {elapsed}, {remaining} left") as bar:
        for count, item in enumerate(items, 1):
            yield item
            if stop.requested:
                return
            if count % _UPDATE_EVERY == 0:
                bar.update(100.0 * fraction() - bar.n)
        bar.update(100.0 - bar.n)
