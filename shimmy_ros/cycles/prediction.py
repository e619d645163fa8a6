"""Verdicts at one operating point after the other, each warm-started from the one before."""

from __future__ import annotations

from dataclasses import replace

from ..gear.system import OperatingPoint
from .settings import Settings
from .stable_cycle import stable_cycle
from .verdict import Verdict


class Predictor:
    """Predicts points one after the other.

    The answer for a point does not depend on the points before it, but for rounding: they change
    the cost alone.
    """

    def __init__(self, settings: Settings | None = None) -> None:
        self._settings = settings or Settings()
        self._last: Verdict | None = None

    @property
    def settings(self) -> Settings:
        """What the answers depend on besides the point."""
        return self._settings

    def use(self, **values: object) -> None:
        """Change some of the settings. Raises ParameterError and then changes nothing."""
        self._settings = replace(self._settings, **values)  # type: ignore[arg-type]
        self._last = None

    def forget(self) -> None:
        """Start cold at the next point."""
        self._last = None

    def predict(self, point: OperatingPoint) -> Verdict:
        """The verdict at ``point``. Raises ParameterError for a velocity outside its range."""
        last = self._last
        if last is not None and last.point == point:
            return replace(last, warm=True, work=0)
        self._last = stable_cycle(point, self._settings, last)
        return self._last
