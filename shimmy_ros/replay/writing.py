"""The answers of a replay as the messages of a bag."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping

from ..bag.copying import copy_message
from ..bag.offloading import OffloadedWriter
from ..contract.answers import ANSWER_TOPICS, Record, answer, answer_messages, findings
from ..contract.session import Session
from ..contract.spec import load_contract
from .replay import Inputs, Step


class AnswerWriter:
    """Writes what a live node would have published; ``outcomes`` counts the answers of each kind.

    Log times are those of the messages that are answered, stamps those of the velocity samples.
    The time that a solve took is not written: the same bag always gives the same bytes.
    """

    def __init__(self, bag: OffloadedWriter, inputs: Inputs, session: Session, hardware_id: str,
                 with_input: bool) -> None:
        """``with_input`` also copies the messages themselves, but for those of older answers."""
        self.outcomes: Counter[str] = Counter()
        self._bag = bag
        self._session = session
        self._hardware_id = hardware_id
        self._with_input = with_input
        self._older = frozenset(inputs.answers)
        contract = load_contract()
        self._names = {name: bag.add_topic(contract.topic(name), inputs.namespace)
                       for name in ANSWER_TOPICS}

    def write(self, step: Step) -> None:
        """Write a step, and its answer if it has one. Raises OSError."""
        message, verdict = step
        if self._with_input and message.topic not in self._older:
            copy_message(message, self._bag)
        sample = self._session.sample
        if verdict is not None and sample is not None:
            self.outcomes[verdict.outcome.value] += 1
            # What it found is a few numbers, but their messages take as long as the prediction.
            self._bag.write_made(
                answer_messages,
                (self._names, findings(verdict), sample.stamp_ns, self._hardware_id),
                message.log_time_ns)

    def records(self, step: Step) -> Mapping[str, Record] | None:
        """The records of a step's answer, if it has one."""
        sample = self._session.sample
        if step.verdict is None or sample is None:
            return None
        return answer(findings(step.verdict), sample.stamp_ns, self._hardware_id)
