"""The desk: parts and running counts, turns, cancelling, limits, and solvers that fail."""

from __future__ import annotations

import json
from itertools import count

import pytest

from shimmy_ros.what_if import desk as desk_module
from shimmy_ros.what_if.desk import Desk, Interrupted

GRID = {"id": "grid", "taxi_velocity": {"from": 10, "to": 100, "points": 1000}}


@pytest.fixture
def desk(present):
    """A desk to which tell() gives queries with rising tickets."""
    desk = Desk()
    tickets = count(1)
    desk.tell = lambda query, maximum_points=10_000: desk.take(
        next(tickets), query if isinstance(query, str) else json.dumps(query), present,
        maximum_points)
    return desk


@pytest.fixture
def slow(monkeypatch):
    """Points that take as long as the clock in this list says, in s each."""
    now, step = [0.0], [0.0]
    monkeypatch.setattr(desk_module, "monotonic", lambda: now[0])

    def evaluate(query):
        for index in range(len(query)):
            now[0] += step[0]
            yield None
            yield {"index": index, "at": {}}

    monkeypatch.setattr(desk_module, "evaluate", evaluate)
    return step


def finished(desk):
    """All replies until the desk has nothing left to do."""
    replies = list(desk.replies())
    while desk.busy:
        desk.step()
        replies += desk.replies()
    return replies


def test_a_long_grid_comes_in_parts_with_a_running_count(points, ask):
    parts = ask(GRID)
    assert len(parts) > 5
    done = 0
    for number, part in enumerate(parts, 1):
        done += len(part["points"])
        assert (part["id"], part["part"], part["done"], part["of"]) == ("grid", number, done, 1000)
        assert part["state"] == ("complete" if number == len(parts) else "under_way")
        assert ("inputs" in part) == (number == 1)
        assert len(part["points"]) <= 100
    assert done == 1000
    assert parts[0]["inputs"]["taxi_velocity"] == {"from": 10.0, "to": 100.0, "points": 1000}
    assert parts[0]["inputs"]["coulomb_torque"] == 20.0


def test_slow_points_are_sent_as_they_come(desk, slow):
    slow[0] = 0.3
    desk.tell({"taxi_velocity": {"from": 10, "to": 100, "points": 9}})
    assert [len(reply.answer["points"]) for reply in finished(desk)] == [1, 2, 2, 2, 2]


def test_the_last_part_is_never_empty_for_want_of_time(desk, slow):
    slow[0] = 10.0
    desk.tell({})
    (reply,) = finished(desk)
    assert (reply.answer["state"], len(reply.answer["points"])) == ("complete", 1)


def test_queries_take_turns(desk, slow):
    slow[0] = 0.015
    desk.tell({"id": "a", "taxi_velocity": [10.0] * 9})
    desk.tell({"id": "b", "taxi_velocity": [10.0] * 3})
    desk.tell({"id": "c"})
    order = [reply.answer["id"] for reply in finished(desk) if reply.final]
    assert order == ["c", "b", "a"]


def test_a_query_is_cancelled_by_id(desk):
    desk.tell(GRID)
    desk.tell({"id": "other"})
    desk.step()
    desk.tell({"id": "me", "cancel": "grid"})
    replies = finished(desk)
    cancelled, answered, other = [reply for reply in replies if reply.final]
    assert (cancelled.ticket, cancelled.answer["id"], cancelled.answer["state"]) == (
        1, "grid", "cancelled")
    assert 0 < cancelled.answer["done"] < 1000
    assert sum(len(reply.answer.get("points", [])) for reply in replies
               if reply.ticket == 1) == cancelled.answer["done"]
    assert (answered.ticket, answered.answer) == (
        3, {"id": "me", "state": "complete", "cancelled": "grid"})
    assert (other.answer["id"], other.answer["state"]) == ("other", "complete")


def test_what_is_not_under_way_cannot_be_cancelled(desk):
    desk.tell({"id": "a"})
    finished(desk)
    desk.tell({"id": "b", "cancel": "a"})
    (reply,) = finished(desk)
    assert reply.answer == {"id": "b", "state": "refused", "where": "cancel",
                            "message": "no query with the id 'a' is under way"}


def test_an_id_is_used_once_at_a_time(desk):
    desk.tell(GRID)
    desk.tell({"id": "grid"})
    refused, *_, last = finished(desk)
    assert (refused.ticket, refused.answer["state"]) == (2, "refused")
    assert refused.answer["where"] == "id"
    assert (last.ticket, last.answer["done"]) == (1, 1000)
    desk.tell({"id": "grid"})
    assert finished(desk)[-1].answer["state"] == "complete"


def test_queries_without_an_id_are_answered_without_one(desk):
    desk.tell({})
    desk.tell({})
    replies = finished(desk)
    assert [(reply.ticket, reply.answer["id"]) for reply in replies] == [(1, None), (2, None)]


def test_there_is_an_end_to_what_can_wait(desk):
    for number in range(1001):
        desk.tell({"id": str(number), "return": "all_cycles"})
    (reply,) = desk.replies()
    assert (reply.ticket, reply.answer["id"], reply.answer["state"]) == (1001, "1000", "refused")
    assert "1000 queries are under way" in reply.answer["message"]


def test_a_refusal_has_the_id_where_it_can_be_read(desk):
    for query, name in (({"id": "a", "velocity": 3}, "a"), ({"id": 3}, None), ("[", None),
                        ({"id": "b", "coulomb_torque": "x"}, "b")):
        desk.tell(query)
        (reply,) = finished(desk)
        assert (reply.answer["id"], reply.answer["state"]) == (name, "refused")
        assert reply.answer["message"]


def test_the_bound_of_points_is_the_one_given(desk):
    desk.tell(GRID, maximum_points=999)
    (reply,) = finished(desk)
    assert reply.answer["where"] == "taxi_velocity.points"


def test_a_solver_that_fails_is_told_of_and_others_go_on(desk, monkeypatch, capsys):
    def evaluate(query):
        yield {"index": 0, "at": {}}
        if query.id == "bad":
            raise ZeroDivisionError("what a pity")

    monkeypatch.setattr(desk_module, "evaluate", evaluate)
    desk.tell({"id": "bad", "taxi_velocity": [10.0, 20.0]})
    desk.tell({"id": "good"})
    bad, good = finished(desk)
    assert (bad.answer["state"], bad.answer["done"]) == ("failed", 1)
    assert "what a pity" in bad.answer["message"]
    assert good.answer["state"] == "complete"
    assert "ZeroDivisionError" in capsys.readouterr().err


def test_a_long_slice_is_interrupted(desk, monkeypatch):
    def evaluate(query):
        # As a signal's handler does, in the middle of the work.
        desk.interrupt("another")
        desk.interrupt("endless")
        yield {"index": 0, "at": {}}

    monkeypatch.setattr(desk_module, "evaluate", evaluate)
    desk.tell({"id": "endless"})
    desk.step()
    assert desk.busy
    assert list(desk.replies()) == []
    desk.interrupt("endless")  # it does not run any more
    desk.tell({"cancel": "endless"})
    assert [reply.answer["state"] for reply in finished(desk)] == ["cancelled", "complete"]
    assert issubclass(Interrupted, BaseException)
    assert not issubclass(Interrupted, Exception)


def test_a_slice_that_takes_too_long_costs_its_point_alone(desk, monkeypatch):
    from shimmy_ros.what_if import evaluate as evaluate_module

    def endless(point, stable):
        if point.velocity == 40.0:
            # As a signal's handler does; no solver may take it for a failure of its own.
            try:
                desk.give_up("it took too long")
            except Exception:
                return []
        return []

    monkeypatch.setattr(evaluate_module, "all_cycles", endless)
    desk.tell({"taxi_velocity": [30.0, 40.0, 50.0], "return": "all_cycles"})
    (reply,) = finished(desk)
    assert reply.answer["state"] == "complete"
    assert [point["all_cycles"]["outcome"] for point in reply.answer["points"]] == [
        "limit_cycle", "not_converged", "limit_cycle"]
    assert reply.answer["points"][1]["all_cycles"]["message"].endswith(": it took too long")
    desk.give_up("nothing runs")
