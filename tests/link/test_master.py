"""One transaction: attempts, repeats, deadlines, and refusals before anything is sent."""

from __future__ import annotations

from typing import Any

import pytest

from qlinkgen.codecs import qlink
from qlinkgen.errors import BadReply, LinkError, NoReply
from qlinkgen.link import MasterEngine, Reply, Timing
from qlinkgen.link.events import Answered, Damaged, Failed, Sent, Stray, TimedOut
from tests.link.line import (
    BYTE,
    EPSILON,
    SLACK,
    changed,
    drive,
    ends_in_mark,
    make,
    pieces,
    request_of,
    taken,
)
from tests.python.protocols import build, module, protocol

ASK = qlink.MotorPositionRequest(node=3)
ANSWER = qlink.MotorPositionResponse(node=3, position=-5)
FRAME = ANSWER.to_frame()
#: 7 bytes out, up to 17 back, 3 to think, and the slack.
DEADLINE = 27 * BYTE + SLACK
QUIET = 3 * BYTE + SLACK


def test_an_answer_ends_it() -> None:
    engine = make()
    run = drive(engine, ASK, [(0.0016, FRAME)], attempts=1)
    assert run.reply == Reply(ANSWER, 1, 0.0016, 0.0016, 0.0016)
    assert run.sent == [(0.0, ASK.to_frame())]
    assert run.end == 0.0016
    assert not engine.busy
    assert engine.next_timer() is None
    assert engine.bytes_to_send(1.0) == b""


@pytest.mark.parametrize("size", [1, 2, 3, 5, 11])
def test_an_answer_in_pieces(size: int) -> None:
    run = drive(make(), ASK, pieces(FRAME, 0.0016, size))
    assert run.response == ANSWER
    assert run.reply is not None
    assert run.reply.attempts == 1


def test_attempts_are_tries_and_repeats_carry_the_same_bytes() -> None:
    for attempts in (1, 2, 3, 7):
        engine = make()
        run = drive(engine, ASK, attempts=attempts)
        assert isinstance(run.error, NoReply)
        assert run.error.attempts == attempts
        assert run.frames == [ASK.to_frame()] * attempts
        assert run.error.elapsed == run.end == pytest.approx(attempts * DEADLINE + (attempts - 1) * QUIET)
        assert run.error.node == 3
        assert run.error.received == b""
        assert engine.total.timeouts == attempts


def test_attempts_of_the_timing_count_unless_given() -> None:
    assert len(drive(make(attempts=2), ASK).sent) == 2
    assert len(drive(make(attempts=2), ASK, attempts=4).sent) == 4


def test_a_request_that_changes_meanwhile_is_repeated_as_it_was() -> None:
    engine = make()
    request = qlink.MotionRequest(node=3, counter=7, segments=[1, 2])
    engine.start(request, 0.0)
    first = engine.bytes_to_send(0.0)
    request.counter = 8
    now = engine.next_timer()
    assert now is not None
    engine.handle_timer(now)
    again = engine.next_timer()
    assert again is not None
    assert engine.bytes_to_send(again) == first


@pytest.mark.parametrize("command", qlink.COMMANDS.values(), ids=str)
def test_only_what_may_be_repeated_is(command: Any) -> None:
    request = request_of(command)
    run = drive(make(), request, attempts=5)
    asked = command.response is not None
    assert len(run.sent) == (5 if command.repeat_safe and asked else 1)
    assert (run.error is not None) == asked


def test_the_answer_to_a_repeat() -> None:
    engine = make()
    second = DEADLINE + QUIET
    run = drive(engine, ASK, [(second + 0.0017, FRAME)])
    assert run.response == ANSWER
    assert run.reply is not None
    assert run.reply.attempts == 2
    assert run.reply.elapsed == pytest.approx(second + 0.0017)
    assert run.reply.response_time == pytest.approx(0.0017)
    assert [at for at, _ in run.sent] == pytest.approx([0.0, second])


def test_the_answer_counts_until_the_deadline() -> None:
    assert drive(make(), ASK, [(DEADLINE - EPSILON, FRAME)], attempts=1).response == ANSWER
    assert drive(make(), ASK, [(DEADLINE + EPSILON, FRAME)], attempts=1).error is not None


def test_a_driver_that_is_late_still_takes_what_came() -> None:
    engine = make()
    engine.start(ASK, 0.0)
    engine.bytes_to_send(0.0)
    engine.receive(FRAME, 1.0)
    engine.handle_timer(1.0)
    assert engine.take().response == ANSWER


def test_a_call_before_the_timer_does_nothing() -> None:
    engine = make()
    engine.start(ASK, 0.0)
    engine.bytes_to_send(0.0)
    for moment in (0.0, DEADLINE / 2, DEADLINE - EPSILON):
        engine.handle_timer(moment)
        assert engine.bytes_to_send(moment) == b""
        assert engine.next_timer() == pytest.approx(DEADLINE)
    assert engine.busy


class TestWhatIsWrong:
    """Errors and their attributes."""

    def test_damaged_answers(self) -> None:
        engine = make()
        broken = changed(FRAME, 6)
        run = drive(engine, ASK, [(0.0017, broken)], attempts=1)
        assert isinstance(run.error, BadReply)
        assert "crc" in str(run.error)
        assert run.error.received == broken
        assert [type(event) for event in taken(engine)] == [Sent, Damaged, TimedOut, Failed]

    def test_an_answer_of_another_shape(self) -> None:
        engine = make()
        short = qlink.ReadResponse(node=3, data=b"\x01")
        run = drive(engine, qlink.ReadRequest(node=3, size=2), [(0.0017, short.to_frame())], attempts=1)
        assert isinstance(run.error, BadReply)
        assert "read.response" in str(run.error)
        assert run.error.received == short.to_frame()

    def test_bytes_of_no_frame_are_shown(self) -> None:
        run = drive(make(), ASK, [(0.0017, b"\x80\xf0\xff")], attempts=1)
        assert isinstance(run.error, NoReply)  # another speed, say
        assert run.error.received == b"\x80\xf0\xff"

    def test_bytes_of_an_earlier_transaction_are_not_shown(self) -> None:
        engine = make()
        drive(engine, ASK, [(0.0017, FRAME)])
        run = drive(engine, ASK, now=1.0)
        assert run.error is not None
        assert run.error.received == b""

    def test_the_error_of_one_transaction_is_not_that_of_the_next(self) -> None:
        engine = make()
        drive(engine, ASK, [(0.0017, changed(FRAME, 6))], attempts=1)
        assert isinstance(drive(engine, ASK, now=1.0).error, NoReply)

    def test_a_long_mess_is_cut(self) -> None:
        mess = changed(qlink.LoopBackResponse(node=3, data=bytes(25)).to_frame(), 9)
        run = drive(make(), ASK, [(0.0017, mess), (0.0018, mess), (0.0019, mess)], attempts=1)
        assert run.error is not None
        assert len(run.error.received) == 64

    def test_texts(self) -> None:
        error = drive(make(), ASK).error
        assert str(error) == "motor_position.request to node 3: no answer; sent 3 times, 17.6 ms".replace(
            "17.6", f"{(3 * DEADLINE + 2 * QUIET) * 1e3:.1f}"
        )
        assert "sent once" in str(drive(make(), ASK, attempts=1).error)


class TestBeforeAByteIsSent:
    """Wrong use does not change the engine."""

    def untouched(self, engine: MasterEngine) -> None:
        assert not engine.busy
        assert engine.bytes_to_send(0.0) == b""
        assert engine.next_timer() is None
        assert engine.total.requests == 0
        assert drive(engine, ASK, [(0.0017, FRAME)]).response == ANSWER

    def test_what_cannot_be_encoded(self) -> None:
        engine = make()
        with pytest.raises(qlink.EncodeError, match="position"):
            engine.start(qlink.PresetMotorPositionRequest(node=3, position=1 << 31), 0.0)
        with pytest.raises(qlink.EncodeError, match="node"):
            engine.start(qlink.MotorPositionRequest(node=17), 0.0)
        self.untouched(engine)

    @pytest.mark.parametrize(
        "thing", [ANSWER, None, "motor_position", b"\xa5\xa5", qlink.MotorPositionRequest]
    )
    def test_what_is_no_request(self, thing: Any) -> None:
        engine = make()
        with pytest.raises(TypeError, match="is not a request of this protocol"):
            engine.start(thing, 0.0)
        self.untouched(engine)

    @pytest.mark.parametrize("attempts", [0, -1, 1.5, "3"])
    def test_attempts(self, attempts: Any) -> None:
        engine = make()
        with pytest.raises(ValueError, match=r"attempts must be 1 or more"):
            engine.start(ASK, 0.0, attempts=attempts)
        self.untouched(engine)

    def test_echo_mode(self) -> None:
        with pytest.raises(ValueError, match="echo must be 'auto', 'expect' or 'none', not 'maybe'"):
            make(echo="maybe")  # type: ignore[arg-type]


def test_one_transaction_at_a_time() -> None:
    engine = make()
    engine.start(ASK, 0.0)
    with pytest.raises(RuntimeError, match="one at a time"):
        engine.start(ASK, 0.0)
    engine.bytes_to_send(0.0)
    with pytest.raises(RuntimeError, match="one at a time"):
        engine.start(ASK, 0.0)
    with pytest.raises(RuntimeError, match="no finished transaction"):
        engine.take()
    engine.receive(FRAME, 0.0017)
    assert engine.take().response == ANSWER
    with pytest.raises(RuntimeError, match="no finished transaction"):
        engine.take()


class TestAbort:
    """Aborting a transaction: Ctrl-C, a cancelled task."""

    def test_while_idle_it_does_nothing(self) -> None:
        engine = make()
        engine.abort(0.0)
        assert drive(engine, ASK, [(0.0017, FRAME)]).sent == [(0.0, ASK.to_frame())]

    def test_before_anything_is_sent(self) -> None:
        engine = make()
        engine.start(ASK, 0.0)
        engine.abort(0.0)
        assert not engine.busy
        assert drive(engine, ASK, [(0.0967, FRAME)], now=0.095).response == ANSWER

    def test_the_answer_of_what_was_given_up_answers_nothing(self) -> None:
        engine = make()
        engine.start(ASK, 0.0)
        engine.bytes_to_send(0.0)
        engine.abort(0.0001)
        with pytest.raises(RuntimeError, match="no finished transaction"):
            engine.take()
        late = qlink.MotorPositionResponse(node=3, position=99).to_frame()
        run = drive(engine, ASK, [(0.0018, late), (0.0100, FRAME)], now=0.0002)
        assert run.response == ANSWER
        assert engine.counters[3].late == 1

    def test_nothing_is_asked_while_the_node_may_still_answer(self) -> None:
        engine = make(slack=0.0)
        engine.start(qlink.NodeProgramLoadRequest(node=3), 0.0)  # 10 ms to answer
        engine.bytes_to_send(0.0)
        engine.abort(0.0)
        until = (8 + 11) * BYTE + 0.010
        late = qlink.NodeProgramLoadResponse(node=3).to_frame()
        run = drive(engine, qlink.NodeProgramLoadRequest(node=3), [(0.0112, late)], now=0.001, attempts=1)
        assert run.error is not None
        assert run.sent[0][0] >= until

    def test_between_attempts(self) -> None:
        engine = make()
        engine.start(ASK, 0.0)
        engine.bytes_to_send(0.0)
        engine.handle_timer(DEADLINE)
        engine.abort(DEADLINE)
        run = drive(engine, ASK, [(0.0085, FRAME)], now=0.005)
        assert run.response == ANSWER
        assert run.reply is not None
        assert run.reply.attempts == 1


class TestPlainBroadcasts:
    """A request without a response does not wait."""

    SYNC = qlink.NodeSyncRequest(node=0, counter=1)

    def test_ends_at_once(self) -> None:
        engine = make()
        run = drive(engine, self.SYNC, now=5.0)
        assert run.reply == Reply(None, 1, 0.0, 5.0, 0.0)
        assert run.end == 5.0
        assert [type(event) for event in taken(engine)] == [Sent]

    def test_the_next_request_waits_until_it_has_left_a_paced_line(self) -> None:
        engine = make()
        size = len(self.SYNC.to_frame())
        drive(engine, self.SYNC)
        run = drive(engine, ASK, [(0.0040, FRAME)])
        assert run.sent[0][0] == pytest.approx((size + 3) * BYTE)
        assert run.response == ANSWER
        drive(engine, self.SYNC, now=1.0)
        assert drive(engine, self.SYNC, now=1.0).sent[0][0] == pytest.approx(1.0 + (size + 3) * BYTE)

    def test_on_a_pty_it_does_not(self) -> None:
        engine = make(paced=False)
        drive(engine, self.SYNC)
        assert drive(engine, ASK, [(0.001, FRAME)]).sent[0][0] == 0.0

    def test_one_node_that_never_answers_this(self) -> None:
        run = drive(make(), qlink.NodeStartRequest(node=3))
        assert run.reply == Reply(None, 1, 0.0, 0.0, 0.0)


class TestDecoderState:
    """Bytes of one transaction left in the decoder do not affect the next."""

    def test_a_frame_that_broke_off(self) -> None:
        engine = make()
        drive(engine, ASK, [(0.0017, FRAME[:5])], attempts=1)
        run = drive(engine, ASK, [(1.0017, FRAME)], now=1.0, attempts=1)
        assert run.response == ANSWER
        assert engine.total.damaged == {"truncated": 1}

    def test_behind_an_answer(self) -> None:
        engine = make(paced=False)
        drive(engine, ASK, [(0.0017, FRAME + FRAME[:6])])
        run = drive(engine, ASK, [(0.003, FRAME)], now=0.002, attempts=1)
        assert run.response == ANSWER
        assert engine.total.damaged == {"truncated": 1}

    def test_it_does_not_make_an_answer_out_of_two_halves(self) -> None:
        engine = make()
        drive(engine, ASK, [(0.0017, FRAME[:5])], attempts=1)
        run = drive(engine, ASK, [(1.0017, FRAME[5:])], now=1.0, attempts=1)
        assert isinstance(run.error, NoReply)

    def test_a_second_answer_in_one_piece_is_a_stray(self) -> None:
        engine = make()
        other = qlink.MotorPositionResponse(node=3, position=6)
        run = drive(engine, ASK, [(0.0017, FRAME + other.to_frame())])
        assert run.response == ANSWER
        assert taken(engine)[-1] == Stray(0.0017, other, late=True)


class TestInsertedByteAtTheEnd:
    """A checksum that ends in A5 is followed by a 00, which comes after the answer is complete."""

    ANSWER = ends_in_mark(lambda number: qlink.MotorPositionResponse(node=3, position=number))

    def test_the_answer_is_complete_before_it(self) -> None:
        engine = make()
        run = drive(engine, ASK, [(0.0017, self.ANSWER.to_frame()[:-1])])
        assert run.response == self.ANSWER
        assert run.end == 0.0017

    def test_the_next_request_leaves_it_its_time(self) -> None:
        engine = make()
        drive(engine, ASK, [(0.0017, self.ANSWER.to_frame()[:-1])])
        run = drive(engine, ASK, [(0.0017 + BYTE, b"\x00"), (0.0040, FRAME)], now=0.0017)
        assert run.sent[0][0] == pytest.approx(0.0017 + BYTE)
        assert run.response == ANSWER
        assert engine.total.skipped == 0

    def test_no_time_is_lost_where_it_came(self) -> None:
        for data in (self.ANSWER.to_frame(), FRAME):
            engine = make()
            drive(engine, ASK, [(0.0017, data)])
            assert drive(engine, ASK, now=0.0017).sent[0][0] == 0.0017

    def test_it_may_come_after_the_next_request(self) -> None:
        engine = make(paced=False)
        drive(engine, ASK, [(0.0017, self.ANSWER.to_frame()[:-1])])
        run = drive(engine, ASK, [(0.0018, b"\x00"), (0.0030, FRAME)], now=0.0017)
        assert run.response == ANSWER
        assert engine.total.damaged == {}

    def test_it_may_never_come(self) -> None:
        engine = make()
        drive(engine, ASK, [(0.0017, self.ANSWER.to_frame()[:-1])])
        assert drive(engine, ASK, [(1.0017, FRAME)], now=1.0).response == ANSWER
        assert engine.total.skipped == 0


def test_events_of_a_good_transaction_are_told_only_to_those_who_listen() -> None:
    engine = make()
    engine.verbose = False
    drive(engine, ASK, [(0.0017, FRAME)])
    assert taken(engine) == []
    engine.verbose = True
    drive(engine, ASK, [(1.0017, FRAME)], now=1.0)
    sent, answered = taken(engine)
    assert sent == Sent(1.0, 3, ASK, 1, ASK.to_frame())
    assert answered == Answered(1.0017, 3, ASK, ANSWER, 1, 1.0017 - 1.0)


def test_events_that_nobody_fetches_do_not_grow_without_end() -> None:
    engine = make()
    for number in range(3000):
        drive(engine, ASK, [(number + 0.0017, FRAME)], now=float(number))
    assert len(engine.events) == 4096
    assert engine.total.answers == 3000


def test_errors_are_those_of_the_link() -> None:
    error = drive(make(), ASK).error
    assert isinstance(error, LinkError)
    assert isinstance(error, TimeoutError)


def test_an_answer_that_a_false_beginning_hides_until_the_next_attempt_is_told_as_a_stray() -> None:
    codec = module("kitchen_sink")
    messages = protocol("kitchen_sink").by_name
    request = build("kitchen_sink", messages["integers.request"])
    answer = build("kitchen_sink", messages["integers.response"])
    engine = MasterEngine(codec, Timing.of(codec, host_slack=SLACK, baud=115200))
    hidden = b"\x7e\x38" + answer.to_frame()  # the length reaches beyond the frame
    run = drive(engine, request, [(0.01, hidden)], attempts=2)
    assert isinstance(run.error, LinkError)
    assert len(run.sent) == 2
    strays = [event for event in engine.events if isinstance(event, Stray)]
    assert [(stray.message, stray.late) for stray in strays] == [(answer, True)]
