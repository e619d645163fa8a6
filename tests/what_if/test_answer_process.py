"""The process that answers: everything is answered, even if it dies, and it ends with its user."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import threading
import time
from pathlib import Path

import pytest

from shimmy_ros.what_if.process import AnswerProcess

PATIENCE_S = 60.0
LONG = {"id": "long", "taxi_velocity": {"from": 10, "to": 100, "points": 5000},
        "return": ["all_cycles", "trigger"]}


class Caller:
    """Asks a process, and waits for answers."""

    def __init__(self, present):
        self._present = present
        self._ready = threading.Event()
        self.process = AnswerProcess(self._ready.set)

    def ask(self, query, maximum_points=10_000):
        text = query if isinstance(query, str) else json.dumps(query)
        self.process.ask(text, self._present, maximum_points)

    def answer(self):
        """The next part of an answer."""
        end = time.monotonic() + PATIENCE_S
        while (text := self.process.next_answer()) is None:
            assert time.monotonic() < end, "waited in vain for an answer"
            self._ready.wait(0.1)
            self._ready.clear()
        return json.loads(text)


@pytest.fixture
def caller(present):
    caller = Caller(present)
    yield caller
    caller.process.close()


def worker_of(pid):
    """The process ids of the children of ``pid``."""
    return [int(child) for task in Path(f"/proc/{pid}/task").iterdir()
            for child in (task / "children").read_text().split()]


def test_queries_are_answered_and_bad_ones_refused(caller):
    caller.ask({"id": "a", "taxi_velocity": [30.0, 40.0]})
    caller.ask('{"id": "b", ')
    caller.ask({"id": "c", "taxi_velocity": [1.0] * 11}, maximum_points=10)
    # On a busy machine an answer may come in parts.
    answers = []
    while len(answers) < 3:
        answer = caller.answer()
        if answer["state"] != "under_way":
            answers.append(answer)
    assert {(answer["id"], answer["state"]) for answer in answers} == {
        ("a", "complete"), (None, "refused"), ("c", "refused")}
    assert caller.process.pending == 0
    assert caller.process.deaths == 0


def test_a_query_is_cancelled_in_the_middle_of_a_point(caller):
    caller.ask({"id": "quick"})
    assert caller.answer()["id"] == "quick"
    caller.ask(LONG)
    time.sleep(0.5)  # the first point takes longer
    caller.ask({"id": "me", "cancel": "long"})
    answers = [caller.answer() for _ in range(2)]
    assert [(answer["id"], answer["state"]) for answer in answers] == [
        ("long", "cancelled"), ("me", "complete")]
    assert answers[0]["done"] == 0
    assert caller.process.pending == 0


def test_a_death_is_answered_and_the_next_query_as_well(caller):
    caller.ask({"id": "quick"})
    assert caller.answer()["state"] == "complete"
    caller.ask(LONG)
    caller.ask({"id": "waits", "return": "trigger"})
    (worker,) = worker_of(os.getpid())
    os.kill(worker, signal.SIGKILL)
    lost = []
    while len(lost) < 2:
        answer = caller.answer()
        if answer["state"] != "under_way":
            lost.append(answer)
    assert sorted(answer["id"] for answer in lost) == ["long", "waits"]
    assert {answer["state"] for answer in lost} == {"failed"}
    assert "ended with status -9" in lost[0]["message"]
    assert caller.process.deaths == 1
    caller.ask({"id": "again"})
    assert caller.answer()["state"] == "complete"


def test_closing_ends_a_worker_that_is_busy(present):
    caller = Caller(present)
    caller.ask({"id": "quick"})
    caller.answer()
    caller.ask(LONG)
    (worker,) = worker_of(os.getpid())
    caller.process.close()
    assert not Path(f"/proc/{worker}").exists()
    assert caller.process.deaths == 0
    caller.ask({"id": "later"})
    assert caller.answer()["state"] in ("complete", "under_way")
    caller.process.close()


def test_closing_what_never_began_is_nothing(present):
    Caller(present).process.close()


def test_a_worker_ends_with_a_user_that_is_killed(tmp_path):
    program = tmp_path / "user.py"
    program.write_text(
        "import json, threading\n"
        "from shimmy_ros.cycles.settings import Settings\n"
        "from shimmy_ros.gear.parameter_file import reference_parameters\n"
        "from shimmy_ros.what_if.process import AnswerProcess\n"
        "from shimmy_ros.what_if.query import Present\n"
        "ready = threading.Event()\n"
        "process = AnswerProcess(ready.set)\n"
        "present = Present(*reference_parameters(), 40.0, Settings())\n"
        "process.ask('{}', present, 10)\n"
        "ready.wait()\n"
        f"process.ask({json.dumps(LONG)!r}, present, 10_000)\n"
        "print('asked', flush=True)\n"
        "threading.Event().wait()\n")
    path = os.pathsep.join([str(Path(__file__).parents[2]), os.environ.get("PYTHONPATH", "")])
    user = subprocess.Popen([sys.executable, str(program)], stdout=subprocess.PIPE, text=True,
                            env=os.environ | {"PYTHONPATH": path})
    with user.stdout as lines:
        assert lines.readline() == "asked\n"
        (worker,) = worker_of(user.pid)
        user.kill()
        user.wait()
    end = time.monotonic() + PATIENCE_S
    while Path(f"/proc/{worker}").exists() and time.monotonic() < end:
        time.sleep(0.05)
    assert not Path(f"/proc/{worker}").exists()


def test_an_interrupt_from_the_terminal_is_not_the_workers(caller):
    caller.ask({"id": "quick"})
    caller.answer()
    (worker,) = worker_of(os.getpid())
    os.kill(worker, signal.SIGINT)
    caller.ask({"id": "more"})
    assert caller.answer()["state"] == "complete"
    assert worker_of(os.getpid()) == [worker]


def test_a_cancellation_at_any_time_costs_no_process(caller):
    """Above all where numba unpacks arguments, in which a signal's exception crashes it."""
    caller.ask({"id": "first"})
    caller.answer()
    (worker,) = worker_of(os.getpid())
    for number in range(30):
        caller.ask(LONG)
        time.sleep(0.007 * number)
        caller.ask({"id": "end", "cancel": "long"})
        states = []
        while len(states) < 2:
            answer = caller.answer()
            if answer["state"] != "under_way":
                states.append((answer["id"], answer["state"]))
        assert states == [("long", "cancelled"), ("end", "complete")]
    assert worker_of(os.getpid()) == [worker]
    assert caller.process.deaths == 0
