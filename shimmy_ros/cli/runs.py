"""Velocity histories to play: CSV files and a synthetic one."""

from __future__ import annotations

import csv
import math
from dataclasses import dataclass
from pathlib import Path

from ..gear.parameters import VELOCITY_RANGE, ParameterError
from ..resources import resource_directory

COLUMNS = ("time_s", "taxi_velocity_m_per_s")
SYNTHETIC = "synthetic"


@dataclass(frozen=True)
class Run:
    """A velocity history: ``time`` [s], from 0 and increasing, and ``velocity`` [m/s]."""

    name: str
    time: tuple[float, ...]
    velocity: tuple[float, ...]

    def between(self, start: float, end: float) -> Run:
        """The part between two times [s], with its time from 0. Raises ParameterError."""
        kept = [(t, v) for t, v in zip(self.time, self.velocity, strict=True)
                if start <= t <= end]
        if len(kept) < 2:
            raise ParameterError(
                f"--from {start:g} --to {end:g} leaves no stretch of run {self.name}, which lasts "
                f"from 0 to {self.time[-1]:g} s")
        times, velocities = zip(*kept, strict=True)
        return Run(self.name, tuple(t - times[0] for t in times), velocities)


def bundled_run(name: str) -> Path:
    """The file of a run that comes with the package."""
    return resource_directory("config") / "runs" / f"{name}.csv"


def synthetic_run() -> Run:
    """10 to 100 to 10 m/s in 40 s, at 10 Hz."""
    times = tuple(0.1 * step for step in range(401))
    return Run(SYNTHETIC, times, tuple(100.0 - 4.5 * abs(t - 20.0) for t in times))


def read_run(file: Path) -> Run:
    """Read a CSV with the columns time_s and taxi_velocity_m_per_s. Raises ParameterError."""
    try:
        with file.open(newline="", encoding="utf-8-sig") as stream:
            reader = csv.DictReader(stream)
            rows = [(reader.line_num, row) for row in reader]
    except (OSError, UnicodeDecodeError, csv.Error) as error:
        raise ParameterError(f"run {file} cannot be read: {error}") from error
    times: list[float] = []
    velocities: list[float] = []
    for number, row in rows:
        where = f"run {file}, line {number}: "
        time = _number(row, COLUMNS[0], where)
        if times and time <= times[-1]:
            raise ParameterError(f"{where}{COLUMNS[0]} is {time:g}, but must be greater than "
                                 f"{times[-1]:g} s, the line before")
        times.append(time)
        velocities.append(_number(row, COLUMNS[1], where))
        try:
            VELOCITY_RANGE.check(COLUMNS[1], velocities[-1])
        except ParameterError as error:
            raise ParameterError(f"{where}{error}") from error
    if len(times) < 2:
        raise ParameterError(f"run {file} has {len(times)} samples, but must have at least 2")
    return Run(file.stem, tuple(t - times[0] for t in times), tuple(velocities))


def _number(row: dict[str, str], column: str, where: str) -> float:
    text = row.get(column)
    if text is None:
        raise ParameterError(f"{where}column {column} is missing; a run has {', '.join(COLUMNS)}")
    try:
        value = float(text)
    except ValueError:
        value = math.nan
    if not math.isfinite(value):
        raise ParameterError(f"{where}{column} is {text!r}, but must be a finite number")
    return value
