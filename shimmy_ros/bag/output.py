"""Outputs that are complete or not there."""

from __future__ import annotations

import os
import shutil
import tempfile
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path

from .errors import BagError
from .offloading import OffloadedWriter

# Nobody reads a bag before it is complete, so that its index may be coarse.
_CHUNK_BYTES = 1 << 20


@contextmanager
def new_bag(directory: Path, settings: Mapping[str, str] | None = None
            ) -> Iterator[OffloadedWriter]:
    """A bag that takes its place when the block ends, closed, unless it raises.

    The same messages give the same bytes. Raises BagError where ``directory`` exists or cannot be
    made, and OSError where the disk fails.
    """
    with new_place(directory) as place:
        bag = OffloadedWriter(place, settings, _CHUNK_BYTES)
        try:
            yield bag
            bag.close()
        finally:
            bag.abandon()


@contextmanager
def new_place(path: Path) -> Iterator[Path]:
    """Where to make the file or directory ``path``, which is moved there when the block ends.

    It is beside ``path`` and has its name; when the block raises, it is removed. Raises BagError
    where ``path`` exists or its directory cannot be made, and OSError where the disk fails.
    """
    check_new(path)
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        parent = Path(tempfile.mkdtemp(prefix=f".{path.name}.", dir=path.parent))
    except OSError as error:
        raise BagError(f"{path} cannot be made: {error.strerror}") from error
    try:
        yield parent / path.name
        check_new(path)
        os.rename(parent / path.name, path)
    finally:
        shutil.rmtree(parent, ignore_errors=True)


def check_new(path: Path) -> None:
    """Raise BagError where something is at ``path`` already."""
    if path.exists():
        raise BagError(f"{path} exists already and is not overwritten")
