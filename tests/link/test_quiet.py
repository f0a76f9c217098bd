"""A late answer never answers the next request: the line has to be quiet first, for a limited time."""

from __future__ import annotations

from typing import Any

import pytest

from qlinkgen.codecs import qlink
from qlinkgen.errors import BadReply, NoReply
from qlinkgen.link.events import Stray, TimedOut
from tests.link.line import BYTE, EPSILON, SLACK, drive, make, taken

ASK = qlink.MotorPositionRequest(node=3)
OLD = qlink.MotorPositionResponse(node=3, position=111)
NEW = qlink.MotorPositionResponse(node=3, position=222)
DEADLINE = 27 * BYTE + SLACK
QUIET = 3 * BYTE + SLACK
LIMIT = 2 * QUIET + 61 * BYTE


def test_the_next_attempt_waits_for_silence() -> None:
    run = drive(make(), ASK, attempts=2)
    assert run.sent[1][0] == pytest.approx(DEADLINE + QUIET)


def test_each_byte_makes_it_longer() -> None:
    noise = [(DEADLINE + 0.001, b"?"), (DEADLINE + 0.003, b"?"), (DEADLINE + 0.004, b"?")]
    run = drive(make(), ASK, noise, attempts=2)
    assert run.sent[1][0] == pytest.approx(DEADLINE + 0.004 + QUIET)


def test_but_not_for_ever() -> None:
    noise = [(DEADLINE + 0.001 * number, b"?") for number in range(1, 100)]
    run = drive(make(), ASK, noise, attempts=2)
    assert isinstance(run.error, BadReply)
    assert "line never became idle" in str(run.error)
    assert len(run.sent) == 1
    assert run.error.attempts == 1
    assert run.end == pytest.approx(DEADLINE + LIMIT)


def test_a_caller_that_is_late_reads_old_bytes_and_listens_on() -> None:
    """A process that did not run for some time, as on a busy machine, has not seen traffic all that time."""
    engine = make()
    drive(engine, ASK, attempts=1)
    engine.start(ASK, DEADLINE, attempts=1)
    late = DEADLINE + LIMIT + 1
    engine.receive(OLD.to_frame(), late)
    engine.handle_timer(late)
    assert engine.next_timer() == pytest.approx(late + QUIET)
    assert engine.bytes_to_send(late + QUIET)


def test_a_caller_that_is_late_once_still_gives_up() -> None:
    engine = make()
    drive(engine, ASK, attempts=1)
    engine.start(ASK, DEADLINE, attempts=1)
    late = now = DEADLINE + LIMIT + 1
    while engine.next_timer() is not None:
        now += QUIET / 2
        engine.receive(b"?", now)
        engine.handle_timer(now)
    assert now == pytest.approx(late + LIMIT, abs=QUIET)
    with pytest.raises(BadReply, match="line never became idle"):
        engine.take()


@pytest.mark.parametrize("delay", [EPSILON, 0.0005, 0.001, QUIET - EPSILON])
def test_a_late_answer_is_no_answer_to_the_repeat(delay: float) -> None:
    engine = make()
    late = DEADLINE + delay
    run = drive(engine, ASK, [(late, OLD.to_frame()), (late + QUIET + 0.0017, NEW.to_frame())], attempts=2)
    assert run.response == NEW
    assert engine.counters[3].strays == engine.counters[3].late == 1
    assert Stray(late, OLD, late=True) in taken(engine)


@pytest.mark.parametrize("delay", [EPSILON, 0.0005, 0.001, QUIET - EPSILON])
@pytest.mark.parametrize("next_call", [0.0, 0.0004])
def test_nor_to_the_next_question_even_if_it_is_the_same(delay: float, next_call: float) -> None:
    engine = make()
    assert isinstance(drive(engine, ASK, attempts=1).error, NoReply)
    late, begun = DEADLINE + delay, DEADLINE + next_call
    answer = max(late, begun) + QUIET + 0.0017
    run = drive(engine, ASK, [(late, OLD.to_frame()), (answer, NEW.to_frame())], now=begun, attempts=1)
    assert run.response == NEW
    assert engine.counters[3].strays == engine.counters[3].late == 1


def test_nor_to_another_question() -> None:
    engine = make()
    drive(engine, ASK, attempts=1)
    other = qlink.NodeResetRequest(node=5)
    answer = qlink.NodeResetResponse(node=5)
    late = DEADLINE + 0.001
    arrivals = [(late, OLD.to_frame()), (late + QUIET + 0.0017, answer.to_frame())]
    run = drive(engine, other, arrivals, now=DEADLINE, attempts=1)
    assert run.response == answer
    assert engine.counters[3].late == 1  # counted for the node that was late


def test_a_late_answer_that_comes_in_the_middle_of_another_question() -> None:
    engine = make()
    drive(engine, ASK, attempts=1)
    other, answer = qlink.NodeResetRequest(node=5), qlink.NodeResetResponse(node=5)
    begun = 1.0
    arrivals = [(begun + 0.0016, OLD.to_frame()), (begun + 0.0025, answer.to_frame())]
    run = drive(engine, other, arrivals, now=begun, attempts=1)
    assert run.response == answer
    assert (engine.counters[3].late, engine.counters[5].late) == (1, 0)


def test_after_the_answer_to_a_repeat_another_may_come() -> None:
    engine = make()
    answered = DEADLINE + QUIET + 0.0017
    run = drive(engine, ASK, [(answered, NEW.to_frame())])
    assert run.end == answered
    late = answered + 0.001
    newer = qlink.MotorPositionResponse(node=3, position=333)
    arrivals = [(late, OLD.to_frame()), (late + QUIET + 0.0017, newer.to_frame())]
    run = drive(engine, ASK, arrivals, now=answered, attempts=1)
    assert run.response == newer
    assert run.sent[0][0] == pytest.approx(late + QUIET)


def test_after_the_answer_to_a_first_attempt_nothing_is_waited_for() -> None:
    engine = make()
    drive(engine, ASK, [(0.0017, NEW.to_frame())])
    assert drive(engine, ASK, now=0.0017, attempts=1).sent[0][0] == 0.0017


def test_time_that_has_passed_counts_as_silence() -> None:
    engine = make()
    drive(engine, ASK, attempts=1)
    for now in (DEADLINE + QUIET, 1.0):
        fresh = make()
        drive(fresh, ASK, attempts=1)
        assert drive(fresh, ASK, now=now, attempts=1).sent[0][0] == now
    assert drive(engine, ASK, now=DEADLINE + QUIET / 2, attempts=1).sent[0][0] == pytest.approx(
        DEADLINE + QUIET
    )


def test_bytes_read_before_the_next_call_are_a_line_that_is_not_quiet() -> None:
    engine = make()
    drive(engine, ASK, attempts=1)
    run = drive(engine, ASK, [(0.9999, OLD.to_frame()[:4])], now=1.0, attempts=1)
    assert run.sent[0][0] == pytest.approx(1.0 + QUIET)  # when they came is not known: it may be just now


def test_a_broadcast_waits_too() -> None:
    engine = make()
    drive(engine, ASK, attempts=1)
    assert drive(engine, qlink.NodeSyncRequest(node=0), now=DEADLINE).sent[0][0] == pytest.approx(
        DEADLINE + QUIET
    )


def test_a_line_that_is_not_quiet_is_no_fault_of_the_node() -> None:
    noise = [(DEADLINE + 0.001 * number, b"?") for number in range(1, 100)]
    engine = make()
    drive(engine, ASK, noise, attempts=1)
    run = drive(engine, ASK, noise, now=DEADLINE + 0.0001)
    assert isinstance(run.error, BadReply)
    assert run.error.attempts == 0
    assert "sent 0 times" in str(run.error)


@pytest.mark.parametrize(
    ("message", "node", "late"),
    [
        (OLD, 3, True),
        (qlink.MotorPositionResponse(node=5), None, False),  # was never asked: counted for the bus
        (qlink.ClearFifoResponse(node=3), 3, False),
    ],
)
def test_strays_while_nothing_is_asked(message: Any, node: int | None, late: bool) -> None:
    engine = make()
    drive(engine, ASK, attempts=1)
    taken(engine)
    engine.receive(message.to_frame(), 1.0)
    assert taken(engine) == [Stray(1.0, message, late)]
    assert engine.counters[node].strays == 1
    assert engine.counters[node].late == late


def test_a_stray_before_anything_was_asked() -> None:
    engine = make()
    engine.receive(OLD.to_frame(), 0.0)
    assert taken(engine) == [Stray(0.0, OLD, late=False)]


def test_each_attempt_that_failed_is_told() -> None:
    engine = make()
    drive(engine, ASK)
    assert [event.attempt for event in taken(engine) if isinstance(event, TimedOut)] == [1, 2, 3]
