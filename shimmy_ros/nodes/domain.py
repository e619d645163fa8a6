"""A ROS domain of one's own, so that runs on the same machine do not hear each other."""

from __future__ import annotations

import fcntl
import os
import tempfile
from collections.abc import Iterator
from contextlib import ExitStack, closing, contextmanager
from pathlib import Path

# Below 102, the ports of a domain are clear of those that Linux gives out by itself.
_DOMAINS = range(1, 102)


class OwnDomain:
    """Holds a ROS_DOMAIN_ID, its ``number``, that no other holder on this machine has.

    Raises RuntimeError where all are held.
    """

    def __init__(self) -> None:
        for offset in range(len(_DOMAINS)):
            self.number = _DOMAINS[(os.getpid() + offset) % len(_DOMAINS)]
            path = Path(tempfile.gettempdir()) / f"shimmy_ros_domain_{self.number}.lock"
            try:
                self._file = path.open("w")
            except PermissionError:  # another user's
                continue
            try:
                fcntl.flock(self._file, fcntl.LOCK_EX | fcntl.LOCK_NB)
            except BlockingIOError:
                self._file.close()
            else:
                return
        raise RuntimeError(f"all ROS domains from {_DOMAINS[0]} to {_DOMAINS[-1]} are in use")

    def close(self) -> None:
        """Leave the domain to others."""
        self._file.close()


@contextmanager
def isolated_run() -> Iterator[str]:
    """Sets the environment so that nobody else hears or disturbs this process and its children.

    Gives the ROS_DOMAIN_ID: the one that is set, or else one of its own. Likewise ROS_LOG_DIR, or
    else a temporary directory; ROS_AUTOMATIC_DISCOVERY_RANGE becomes LOCALHOST unless it is set.
    """
    with ExitStack() as stack:
        own: dict[str, str] = {"ROS_AUTOMATIC_DISCOVERY_RANGE": "LOCALHOST"}
        if not os.environ.get("ROS_DOMAIN_ID"):
            own["ROS_DOMAIN_ID"] = str(stack.enter_context(closing(OwnDomain())).number)
        own["ROS_LOG_DIR"] = stack.enter_context(tempfile.TemporaryDirectory())
        own = {name: value for name, value in own.items() if not os.environ.get(name)}
        os.environ.update(own)
        try:
            yield os.environ["ROS_DOMAIN_ID"]
        finally:
            for name in own:
                del os.environ[name]
