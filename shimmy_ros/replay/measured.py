"""The measured motion of a joint in a bag beside the answers of a replay: a table and a picture."""

from __future__ import annotations

import csv
import math
from collections.abc import Callable, Iterable, Mapping
from dataclasses import astuple, fields
from pathlib import Path
from typing import Any, NamedTuple, TextIO

import numpy as np

from ..bag.errors import BagError
from ..bag.message import BagMessage, Channel
from ..bag.reader import Bag
from ..bag.types import types_of
from ..contract.records import JOINTS, MessageError
from ..contract.session import Session
from ..contract.typestore import JOINT_STATE
from ..report.comparison import Comparison, summary
from ..report.kinds import UNKNOWN, beyond_of, kind_of_status, outcome_of
from ..report.matching import Matcher, Sample
from ..report.recording import Recording
from ..report.thinning import Envelope, Thinned
from .fields import decoded, stamp
from .replay import Inputs

SWIVEL = "swivel"
COLUMNS = ("time_s", "taxi_velocity_m_per_s", "measured_amplitude_rad", "measured_frequency_hz",
           "predicted_amplitude_rad", "predicted_frequency_hz", "predicted_outcome",
           "beyond_limits")
_SWIVEL_INDEX = JOINTS.index(SWIVEL)
_MARKED_CHANGES = 200


class Motion(NamedTuple):
    """Position and rate of a joint at a time [ns]; the rate is NaN where it is not known."""

    stamp_ns: int
    position: float
    rate: float


def motion_reader(bag: Bag, channels: Iterable[Channel], topic: str, joint: str
                  ) -> Callable[[BagMessage], Motion]:
    """A function that takes the motion of ``joint`` from the JointStates on ``topic``.

    It takes the log time for a stamp of zero and raises MessageError for a message without the
    joint. Raises BagError where the topic is missing or of another type, and where its first
    message has no such joint.
    """
    of_topic = [channel for channel in channels if channel.topic == topic]
    if not of_topic:
        known = [channel.topic for channel in channels if channel.type == JOINT_STATE]
        raise BagError(f"the bag has no topic {topic} to compare with; of type {JOINT_STATE} it "
                       f"has {', '.join(known) or 'none'}")
    for channel in of_topic:
        if channel.type != JOINT_STATE:
            raise BagError(f"topic {topic} is of type {channel.type}, but must be {JOINT_STATE}")
    types = {channel: types_of(channel) for channel in of_topic}

    def read(message: BagMessage) -> Motion:
        content = decoded(types[message.channel], message)
        try:
            index = content.name.index(joint)
            position = float(content.position[index])
        except (ValueError, IndexError) as error:
            raise MessageError(f"it has no position of a joint {joint}, but of "
                               f"{', '.join(content.name) or 'none'}") from error
        rate = float(content.velocity[index]) if index < len(content.velocity) else math.nan
        return Motion(stamp(content) or message.log_time_ns, position, rate)

    first = next(bag.messages({topic}), None)
    if first is None:
        raise BagError(f"the bag has no message on topic {topic} to compare with")
    try:
        read(first)
    except MessageError as error:
        raise BagError(f"the first message on topic {topic} does not fit: {error}") from error
    return read


class MotionComparison:
    """Writes the measured cycles of a motion beside the answers that were in force then.

    Times are in s from the first message, by log time; within the motion they follow its stamps.
    Where log times jump back, as in a bag of bags, time goes on from there.
    ``refused`` counts the messages of the motion that could not be used.
    """

    def __init__(self, stream: TextIO, inputs: Inputs, topic: str,
                 read: Callable[[BagMessage], Motion]) -> None:
        """Write the cycles of the motion on ``topic``, which ``read`` takes, as CSV."""
        self.refused = 0
        self._rows = csv.writer(stream, lineterminator="\n")
        self._rows.writerow(COLUMNS)
        self._damper = inputs.damper
        self._topic = topic
        self._read = read
        self._matcher = Matcher()
        # The log time that counts as zero, that of the last message, and the motion's last stamp.
        self._begin_ns: int | None = None
        self._log_ns = 0
        self._offset_ns = 0
        self._last_ns: int | None = None
        self._in_force = (math.nan, math.nan, math.nan, UNKNOWN)
        self._answers = Thinned(1 + len(self._in_force))
        self._cycles = Thinned(len(fields(Comparison)))
        self._envelope = Envelope()
        self._changes: list[tuple[float, str, float]] = []

    def take(self, message: BagMessage, session: Session, records: Mapping[str, Any] | None
             ) -> None:
        """Take a message, and the answer's records where it was answered."""
        if self._begin_ns is None:
            self._begin_ns = message.log_time_ns
        elif message.log_time_ns < self._log_ns:
            self._begin_ns -= self._log_ns - message.log_time_ns
            self._last_ns = None
        self._log_ns = message.log_time_ns
        if records is not None:
            self._answered(message, session, records)
        elif message.topic == self._topic:
            try:
                self._moved(message.log_time_ns, self._read(message))
            except MessageError:
                self.refused += 1

    def _answered(self, message: BagMessage, session: Session, records: Mapping[str, Any]) -> None:
        time_s = self._seconds(message.log_time_ns)
        assert session.sample is not None
        amplitude = records["limit_cycle/amplitude"].position[_SWIVEL_INDEX]
        self._in_force = (session.sample.velocity, amplitude, records["limit_cycle/frequency"],
                          kind_of_status(records["limit_cycle/status"][0].values))
        self._answers.add(time_s, *self._in_force)
        name = self._damper.get(message.topic)
        if name is not None and len(self._changes) < _MARKED_CHANGES:
            self._changes.append((time_s, f"damper/{name}", getattr(session.damper, name)))

    def _moved(self, log_time_ns: int, motion: Motion) -> None:
        if self._last_ns is None or motion.stamp_ns < self._last_ns:
            self._write(self._matcher.finish())
            self._offset_ns = log_time_ns - motion.stamp_ns
        self._last_ns = motion.stamp_ns
        time_s = self._seconds(motion.stamp_ns + self._offset_ns)
        self._envelope.add(time_s, motion.position)
        self._write(self._matcher.add(
            Sample(time_s, motion.position, motion.rate, *self._in_force)))

    def finish(self, outcomes: dict[str, int], title: str, picture: Path) -> str:
        """Write what is left, draw the picture and return the summary. Raises OSError."""
        # matplotlib takes its time to import, and is not needed before.
        from ..report.picture import draw_run

        self._write(self._matcher.finish())
        time, velocity, *predicted = self._answers.table.T
        line_time, line = self._envelope.line
        position = np.full((line.size, len(JOINTS)), math.nan)
        position[:, _SWIVEL_INDEX] = line
        recording = Recording(
            (time, velocity), (line_time, position, np.full_like(position, math.nan)),
            (time, *predicted), tuple(self._changes), outcomes, ())
        comparison = Comparison(*self._cycles.table.T)
        draw_run(recording, comparison, title, picture)
        return summary(comparison, recording)

    def _seconds(self, time_ns: int) -> float:
        return 1e-9 * (time_ns - (self._begin_ns or 0))

    def _write(self, comparisons: Iterable[Comparison]) -> None:
        for found in comparisons:
            for row in zip(*(column.tolist() for column in astuple(found)), strict=True):
                *numbers, kind = row
                self._rows.writerow([f"{numbers[0]:.6f}", *map(repr, numbers[1:]),
                                     outcome_of(kind), beyond_of(kind)])
                self._cycles.add(*row)
