"""The messages of a bag, and the verdict that a live node would have come to for each."""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterable, Iterator
from dataclasses import dataclass
from typing import NamedTuple

from ..bag.errors import BagError
from ..bag.message import BagMessage, Channel
from ..bag.reader import Bag, BagMessages
from ..contract.answers import ANSWER_TOPICS
from ..contract.messages import CODECS
from ..contract.records import MessageError, TaxiVelocity
from ..contract.session import Session
from ..contract.spec import load_contract
from ..cycles.verdict import Verdict
from ..gear.parameters import ParameterError, changed
from .fields import velocity_reader

VELOCITY = "taxi_velocity"
DEFAULT_NAMESPACE = "/shimmy"
_DAMPER = "damper/"


@dataclass(frozen=True)
class Inputs:
    """The topics of a bag that a replay follows.

    ``velocity`` is the topic of the taxi velocity and ``field`` where it is in its messages ("" for
    the usual place); damper settings and answers are topics of the contract in ``namespace``.
    """

    velocity: str
    field: str
    namespace: str

    @property
    def damper(self) -> dict[str, str]:
        """The damper's topics, with the parameter that each of them sets."""
        return {topic.resolved(self.namespace): topic.name.removeprefix(_DAMPER)
                for topic in load_contract().subscribed_by("predictor")
                if topic.name.startswith(_DAMPER)}

    @property
    def answers(self) -> list[str]:
        """The topics on which a predictor would have answered."""
        contract = load_contract()
        return [contract.topic(name).resolved(self.namespace) for name in ANSWER_TOPICS]


def find_inputs(channels: Collection[Channel], velocity: str | None = None,
                namespace: str | None = None) -> Inputs:
    """The inputs in a bag with these channels.

    ``velocity`` is a topic or TOPIC:FIELD, by default the one topic named taxi_velocity. The
    namespace is by default that of such a topic, and otherwise DEFAULT_NAMESPACE. Raises BagError
    where the topic is missing.
    """
    topics = sorted({channel.topic for channel in channels})
    if velocity is None:
        wanted = namespace and load_contract().topic(VELOCITY).resolved(namespace)
        found = [topic for topic in topics
                 if topic == wanted or (not wanted and topic.rsplit("/", 1)[-1] == VELOCITY)]
        if len(found) != 1:
            raise BagError(f"the bag has {len(found) or 'no'} topic{'s' * (len(found) > 1)} "
                           f"{wanted or VELOCITY}; name one with --velocity-topic: "
                           f"{', '.join(found or topics) or 'it is empty'}")
        topic, field = found[0], ""
    else:
        topic, _, field = velocity.partition(":")
        if topic not in topics:
            raise BagError(f"the bag has no topic {topic}; it has {', '.join(topics) or 'none'}")
    place, _, name = topic.rpartition("/")
    own = (place or "/") if name == VELOCITY else DEFAULT_NAMESPACE
    return Inputs(topic, field, own if namespace is None else namespace)


class Step(NamedTuple):
    """A message, and the answer to it; None for what a predictor does not answer."""

    message: BagMessage
    verdict: Verdict | None


class Replay:
    """Feeds the messages of a bag to a session, in the order of the bag.

    ``session`` is the predictor's own; its sample, gear and damper are those of the last answer.
    ``samples`` counts the messages with a velocity, ``refused`` by topic the inputs that changed
    nothing, of which ``complaints`` has each topic's first reason. ``jump`` is the first sentence
    on time that jumped back.
    """

    def __init__(self, bag: Bag, channels: Iterable[Channel], inputs: Inputs, session: Session,
                 also: Collection[str] | None = ()) -> None:
        """Messages on ``also`` (None: on all topics) come unanswered among the others.

        ``channels`` are those of the bag. Raises BagError for topics of a wrong type.
        """
        self.session = session
        self.samples = 0
        self.refused: dict[str, int] = {}
        self.complaints: dict[str, str] = {}
        self.jump = ""
        self._inputs = inputs
        self._damper = inputs.damper
        self._readers: dict[Channel, Callable[[BagMessage], TaxiVelocity]] = {}
        for channel in channels:
            if channel.topic == inputs.velocity:
                self._readers[channel] = velocity_reader(channel, inputs.field)
            elif channel.topic in self._damper:
                _check_damper(channel)
        topics = None if also is None else {inputs.velocity, *self._damper, *also}
        self.messages: BagMessages = bag.messages(topics)

    def __iter__(self) -> Iterator[Step]:
        for message in self.messages:
            yield Step(message, self._answer(message))

    def _answer(self, message: BagMessage) -> Verdict | None:
        topic = message.topic
        try:
            if topic == self._inputs.velocity:
                self.samples += 1
                sample = self._readers[message.channel](message)
                jump = self.session.take(sample, message.log_time_ns)
                self.jump = self.jump or jump
            elif topic in self._damper:
                value = CODECS[_DAMPER + self._damper[topic]].decode(message.data)
                self.session.damper = changed(self.session.damper, **{self._damper[topic]: value})
            else:
                return None
        except (ParameterError, MessageError) as error:
            self.refused[topic] = self.refused.get(topic, 0) + 1
            self.complaints.setdefault(topic, str(error))
            return None
        return self.session.predict()


def _check_damper(channel: Channel) -> None:
    expected = CODECS[f"{_DAMPER}coulomb_torque"].type
    if channel.type != expected:
        raise BagError(f"topic {channel.topic} is of type {channel.type}, but must be {expected}")
