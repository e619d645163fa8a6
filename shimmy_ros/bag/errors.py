"""What can be wrong with a bag."""

from __future__ import annotations


class BagError(Exception):
    """A bag that cannot be written or read as asked; one sentence says why."""
