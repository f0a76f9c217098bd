"""Two-wire adapters that echo sent bytes: whole, in pieces, in part, changed, or not at all."""

from __future__ import annotations

from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from qlinkgen.codecs import qlink
from qlinkgen.errors import Collision, LinkError, NoReply
from qlinkgen.link import MasterEngine
from qlinkgen.link.echo import OUTSTANDING, PROBE
from qlinkgen.link.events import Damaged, EchoBroken, EchoFound, Stray
from tests.link.line import BYTE, SLACK, Run, changed, drive, ends_in_mark, make, pieces, taken

ASK = qlink.MotorPositionRequest(node=3)
ANSWER = qlink.MotorPositionResponse(node=3, position=7)
SENT = ASK.to_frame()
GOT = ANSWER.to_frame()
DEADLINE = 27 * BYTE + SLACK

#: Requests whose answers are, or may be, the same bytes.
AMBIGUOUS = [
    (qlink.NodeResetRequest(node=3), qlink.NodeResetResponse(node=3)),
    (qlink.ClearFifoRequest(node=3), qlink.ClearFifoResponse(node=3)),
    (
        qlink.LoopBackRequest(node=3, offset=9, data=b"\xa5\xa5 back"),
        qlink.LoopBackResponse(node=3, offset=9, data=b"\xa5\xa5 back"),
    ),
    (
        qlink.NodeProgramLoadRequest(node=3, counter=4),
        qlink.NodeProgramLoadResponse(node=3, counter=4),
    ),
    (qlink.WriteReadRequest(node=3, outputs=0xA50001), qlink.WriteReadResponse(node=3, inputs=0xA50001)),
    (qlink.ReadRequest(node=3, size=2, offset=1), qlink.ReadResponse(node=3, data=b"\x02\x01")),
]
ambiguous = pytest.mark.parametrize(
    ("request_", "response"), AMBIGUOUS, ids=[type(request).NAME for request, _ in AMBIGUOUS]
)


def once(request: Any, *parts: bytes, engine: MasterEngine | None = None, attempts: int = 1) -> Run:
    """One transaction on an adapter with an echo; the parts come one after the other, from 4 ms on."""
    engine = engine or make(echo="expect", slack=0.02)
    return drive(
        engine,
        request,
        [(0.004 + 0.0001 * place, part) for place, part in enumerate(parts)],
        attempts=attempts,
    )


class TestExpected:
    @pytest.mark.parametrize("size", [1, 2, 3, 4, 7, 100])
    def test_whole(self, size: int) -> None:
        engine = make(echo="expect", slack=0.02)
        stream = [part for _, part in pieces(SENT + GOT, 0.0, size)]
        assert once(ASK, *stream, engine=engine).response == ANSWER
        total = engine.total
        assert (total.partial_echoes, total.missing_echoes, total.collisions, total.skipped) == (0, 0, 0, 0)
        assert total.damaged == {}

    @pytest.mark.parametrize("size", [1, 3, 100])
    def test_whole_but_no_answer(self, size: int) -> None:
        engine = make(echo="expect", slack=0.02)
        run = once(ASK, *(part for _, part in pieces(SENT, 0.0, size)), engine=engine)
        assert isinstance(run.error, NoReply)
        assert run.error.received == b""  # the echo is not part of the received bytes
        assert engine.total.missing_echoes == engine.total.collisions == 0

    @pytest.mark.parametrize("size", [1, 2, 100])
    @pytest.mark.parametrize("lost", range(1, 7))
    def test_without_its_head(self, lost: int, size: int) -> None:
        engine = make(echo="expect", slack=0.02)
        run = once(ASK, *(part for _, part in pieces(SENT[lost:] + GOT, 0.0, size)), engine=engine)
        assert run.response == ANSWER
        assert engine.total.partial_echoes == 1
        assert engine.total.damaged == {}

    @pytest.mark.parametrize("size", [1, 2, 100])
    @pytest.mark.parametrize("kept", range(1, 7))
    def test_without_its_tail(self, kept: int, size: int) -> None:
        engine = make(echo="expect", slack=0.02)
        run = once(ASK, *(part for _, part in pieces(SENT[:kept] + GOT, 0.0, size)), engine=engine)
        assert run.response == ANSWER
        assert engine.total.partial_echoes == 1
        assert engine.total.damaged == {}

    @pytest.mark.parametrize("size", [1, 2, 3, 100])
    def test_not_at_all(self, size: int) -> None:
        engine = make(echo="expect", slack=0.02)
        assert once(ASK, *(part for _, part in pieces(GOT, 0.0, size)), engine=engine).response == ANSWER
        assert engine.total.partial_echoes == 1

    def test_neither_echo_nor_answer(self) -> None:
        engine = make(echo="expect")
        run = drive(engine, ASK)
        assert isinstance(run.error, NoReply)
        assert engine.counters[3].missing_echoes == 3
        broken = [event for event in taken(engine) if isinstance(event, EchoBroken)]
        assert [event[1:] for event in broken] == [(3, SENT, b"")] * 3
        assert broken[0].at == pytest.approx(DEADLINE)

    def test_changed_each_time(self) -> None:
        engine = make(echo="expect", slack=0.02)
        arrivals = [(at, changed(SENT, 4)) for at in (0.002, 0.046, 0.09)]
        run = drive(engine, ASK, arrivals)
        assert isinstance(run.error, Collision)
        assert "echo of the request was changed" in str(run.error)
        assert run.error.attempts == 3
        assert engine.counters[3].collisions == 3
        assert engine.counters[3].missing_echoes == 0

    def test_changed_once(self) -> None:
        engine = make(echo="expect", slack=0.02)
        first = drive(make(echo="expect", slack=0.02), ASK, [(0.002, changed(SENT, 4))], attempts=2)
        second = first.sent[1][0]
        run = drive(engine, ASK, [(0.002, changed(SENT, 4)), (second + 0.002, SENT + GOT)], attempts=2)
        assert run.response == ANSWER
        assert engine.counters[3].collisions == 1
        assert engine.counters[3].partial_echoes == 0

    def test_changed_but_answered(self) -> None:
        engine = make(echo="expect", slack=0.02)
        assert once(ASK, changed(SENT, 4), GOT, engine=engine).response == ANSWER
        assert engine.total.collisions == 0
        assert engine.total.partial_echoes == 1

    def test_an_echo_of_an_attempt_before_is_no_fault_of_the_next(self) -> None:
        engine = make(echo="expect")
        drive(engine, ASK, attempts=1)
        late = drive(engine, ASK, [(1.001, SENT + GOT)], now=1.0, attempts=1)
        assert late.response == ANSWER
        assert engine.total.partial_echoes == 0


@ambiguous
class TestAmbiguousCommands:
    """The echo is never taken for the answer, in any chunks."""

    def test_nothing_but_the_echo(self, request_: Any, response: Any) -> None:
        assert response.to_frame() == request_.to_frame()
        for size in (1, 2, 5, 100):
            stream = [part for _, part in pieces(request_.to_frame(), 0.0, size)]
            assert isinstance(once(request_, *stream).error, NoReply)

    def test_echo_and_answer(self, request_: Any, response: Any) -> None:
        for size in (1, 2, 5, 7, 100):
            stream = [part for _, part in pieces(request_.to_frame() * 2, 0.0, size)]
            assert once(request_, *stream).response == response

    @pytest.mark.parametrize("noise", [b"\xff", b"\x00\x80", b"\xa5", b"\xa5\xa5\x07", b"\x13" * 9])
    @pytest.mark.parametrize("size", [1, 3, 100])
    def test_behind_noise(self, request_: Any, response: Any, noise: bytes, size: int) -> None:
        frame = request_.to_frame()
        alone = [part for _, part in pieces(noise + frame, 0.0, size)]
        error = once(request_, *alone).error
        assert isinstance(error, LinkError)
        both = [part for _, part in pieces(noise + frame + frame, 0.0, size)]
        assert once(request_, *both).response == response

    @pytest.mark.parametrize("size", [1, 3, 100])
    def test_partial_and_then_the_answer(self, request_: Any, response: Any, size: int) -> None:
        frame = request_.to_frame()
        for part in (*(frame[cut:] for cut in range(1, 4)), *(frame[:cut] for cut in range(4, 7))):
            stream = [piece for _, piece in pieces(part + frame, 0.0, size)]
            assert once(request_, *stream).response == response, part.hex(" ")

    def test_partial_and_no_answer(self, request_: Any, response: Any) -> None:
        frame = request_.to_frame()
        for part in (*(frame[cut:] for cut in range(1, 7)), *(frame[:cut] for cut in range(1, 7))):
            assert isinstance(once(request_, part).error, LinkError)

    def test_changed(self, request_: Any, response: Any) -> None:
        frame = request_.to_frame()
        for index in range(len(frame)):
            assert isinstance(once(request_, changed(frame, index)).error, LinkError)

    def test_the_echo_of_a_broadcast_that_is_late(self, request_: Any, response: Any) -> None:
        """An adapter holds bytes back, and the broadcast's echo arrives after the next request."""
        for size in (1, 4, 100):
            sync = qlink.NodeSyncRequest(node=0, counter=5)
            frame = request_.to_frame()
            for paced in (False, True):
                engine = make(echo="expect", slack=0.02, paced=paced)
                drive(engine, sync)
                stream = [part for _, part in pieces(sync.to_frame() + frame, 0.0, size)]
                assert isinstance(once(request_, *stream, engine=engine).error, NoReply)
                assert engine.total.collisions == engine.total.missing_echoes == 0
                engine = make(echo="expect", slack=0.02, paced=paced)
                drive(engine, sync)
                stream = [part for _, part in pieces(sync.to_frame() + frame * 2, 0.0, size)]
                assert once(request_, *stream, engine=engine).response == response
                assert engine.total.partial_echoes == 0

    def test_the_echo_of_a_broadcast_that_never_comes(self, request_: Any, response: Any) -> None:
        frame = request_.to_frame()
        for size in (1, 4, 100):
            for end, count in ((frame, 0), (frame * 2, 1)):
                engine = make(echo="expect", slack=0.02)
                drive(engine, qlink.NodeStopRequest(node=0))
                run = once(request_, *(part for _, part in pieces(end, 0.0, size)), engine=engine)
                assert engine.total.answers == count
                assert (run.reply is not None) == bool(count)


@settings(max_examples=200)
@given(
    which=st.integers(0, len(AMBIGUOUS) - 1),
    noise=st.binary(max_size=6),
    cuts=st.lists(st.integers(1, 12), min_size=1, max_size=8),
    behind=st.binary(max_size=6),
)
def test_one_whole_echo_is_never_the_answer(which: int, noise: bytes, cuts: list[int], behind: bytes) -> None:
    request = AMBIGUOUS[which][0]
    stream, parts = noise + request.to_frame() + behind, list[bytes]()
    while stream:
        size = cuts[len(parts) % len(cuts)]
        parts.append(stream[:size])
        stream = stream[size:]
    assert once(request, *parts).error is not None


class TestInsertedByteAtTheEnd:
    """A request whose checksum ends in A5 is one byte longer on the wire than it needs to be read."""

    REQUEST = ends_in_mark(lambda number: qlink.WriteReadRequest(node=3, outputs=number))
    RESPONSE = qlink.WriteReadResponse(node=3, inputs=REQUEST.outputs)

    @pytest.mark.parametrize("size", [1, 4, 100])
    def test_whole(self, size: int) -> None:
        frame = self.REQUEST.to_frame()
        alone = once(self.REQUEST, *(part for _, part in pieces(frame, 0.0, size)))
        assert isinstance(alone.error, NoReply)
        both = once(self.REQUEST, *(part for _, part in pieces(frame * 2, 0.0, size)))
        assert both.response == self.RESPONSE

    @pytest.mark.parametrize("noise", [b"\xff", b"\x13\x14"])
    @pytest.mark.parametrize("size", [1, 100])
    def test_behind_noise(self, noise: bytes, size: int) -> None:
        frame = self.REQUEST.to_frame()
        for end in (frame, frame[:-1]):
            alone = once(self.REQUEST, *(part for _, part in pieces(noise + end, 0.0, size)))
            assert isinstance(alone.error, LinkError)

    def test_the_inserted_byte_of_the_last_answer_before_the_echo(self) -> None:
        engine = make(echo="expect", slack=0.02, paced=False)
        answer = self.REQUEST.to_frame()
        assert once(self.REQUEST, answer, answer[:-1], engine=engine).response == self.RESPONSE
        reset = qlink.NodeResetRequest(node=3)
        frame = reset.to_frame()
        run = drive(engine, reset, [(0.0055, b"\x00" + frame)], now=0.005, attempts=1)
        assert isinstance(run.error, NoReply)


class TestBroadcasts:
    SYNC = qlink.NodeSyncRequest(node=0, counter=1)

    def test_its_echo_comes_while_nothing_is_asked(self) -> None:
        engine = make(echo="expect")
        drive(engine, self.SYNC)
        engine.receive(self.SYNC.to_frame(), 0.001)
        assert drive(engine, ASK, [(0.0120, SENT + GOT)], now=0.01).response == ANSWER
        assert engine.total.skipped == 0
        assert engine.total.damaged == {}
        assert engine.total.missing_echoes == 0

    def test_many_without_an_echo_do_not_pile_up(self) -> None:
        engine = make(echo="expect")
        for number in range(100):
            drive(engine, self.SYNC, now=float(number))
        assert engine.total.missing_echoes == 100 - OUTSTANDING
        assert sum(isinstance(event, EchoBroken) for event in taken(engine)) == 100 - OUTSTANDING
        assert len(engine._echo.outstanding) == OUTSTANDING * len(self.SYNC.to_frame())
        run = drive(engine, ASK, [(200.0016, SENT + GOT)], now=200.0)
        assert run.response == ANSWER

    def test_many_whose_echoes_come_late(self) -> None:
        engine = make(echo="expect")
        for number in range(5):
            drive(engine, qlink.NodeSyncRequest(node=0, counter=number), now=number * 0.002)
        echoes = b"".join(qlink.NodeSyncRequest(node=0, counter=number).to_frame() for number in range(5))
        assert drive(engine, ASK, [(0.0119, echoes + SENT + GOT)], now=0.010).response == ANSWER
        assert engine.total.partial_echoes == engine.total.missing_echoes == 0


class TestAuto:
    """Two zero bytes before the first request detect the echo."""

    UNTIL = 2 * BYTE + 3 * BYTE + SLACK

    @pytest.mark.parametrize(
        ("arrivals", "found"),
        [
            ([(0.0005, PROBE)], True),
            ([(0.0005, b"\x00"), (0.0006, b"\x00")], True),
            ([(0.0005, b"\x00")], True),  # the adapter enabled its receiver too late
            ([(0.0005, b"\xff\x00\x00")], True),  # enabling it caused a spike
            ([(0.0004, b"\xff"), (0.0005, b"\x00\x00")], True),
            ([(0.0004, b"\xff"), (0.0005, b"\x00"), (0.0006, b"\x00")], True),
            ([], False),
            ([(0.0005, b"\xff\x80")], False),
            ([(0.0005, GOT)], False),
        ],
    )
    def test_what_it_finds(self, arrivals: list[tuple[float, bytes]], found: bool) -> None:
        engine = make(echo="auto")
        run = drive(engine, ASK, arrivals, attempts=1)
        assert run.frames == [PROBE, SENT]
        (event,) = [event for event in taken(engine) if isinstance(event, EchoFound)]
        assert event.echo == found
        assert event.at == pytest.approx(self.UNTIL) or found
        echo = SENT if found else b""
        again = drive(engine, ASK, [(1.0018, echo + GOT)], now=1.0, attempts=1)
        assert again.response == ANSWER
        assert again.frames == [SENT]  # the probe is sent only once
        assert engine.total.partial_echoes == 0

    def test_the_first_request_waits_for_it(self) -> None:
        run = drive(make(echo="auto"), ASK)
        assert run.sent[1][0] == pytest.approx(self.UNTIL)
        found = drive(make(echo="auto"), ASK, [(0.0005, PROBE)])
        assert found.sent[1][0] < 0.0005 + 3 * BYTE
        rest = 0.0005 + BYTE
        halves = drive(make(echo="auto"), ASK, [(0.0005, b"\x00"), (rest, b"\x00")])
        assert halves.sent[1][0] > rest

    def test_elapsed_includes_it(self) -> None:
        at = self.UNTIL + 0.0017
        run = drive(make(echo="auto"), ASK, [(at, GOT)])
        assert run.reply is not None
        assert run.reply.elapsed == pytest.approx(at)

    def test_a_broadcast_as_the_first_request(self) -> None:
        engine = make(echo="auto")
        run = drive(engine, qlink.NodeSyncRequest(node=0), [(0.0005, PROBE)])
        assert run.frames == [PROBE, qlink.NodeSyncRequest(node=0).to_frame()]
        assert run.reply is not None

    def test_given_up_it_is_tried_again(self) -> None:
        engine = make(echo="auto")
        engine.start(ASK, 0.0)
        assert engine.bytes_to_send(0.0) == PROBE
        assert engine.bytes_to_send(0.0) == b""
        engine.abort(0.0001)
        run = drive(engine, ASK, [(0.0005, PROBE), (0.0034, PROBE), (0.0065, SENT + GOT)], now=0.0002)
        assert run.response == ANSWER
        assert run.frames == [PROBE, SENT]

    def test_frames_that_come_meanwhile_are_counted(self) -> None:
        engine = make(echo="auto")
        drive(engine, ASK, [(0.0005, GOT), (0.0006, changed(GOT, 5))], attempts=1)
        kinds = [type(event) for event in taken(engine)]
        assert kinds.count(Stray) == 1
        assert kinds.count(Damaged) == 1

    def test_none_and_expect_do_not_probe(self) -> None:
        assert drive(make(echo="none"), ASK, attempts=1).frames == [SENT]
        assert drive(make(echo="expect"), ASK, attempts=1).frames == [SENT]


class TestNone:
    def test_the_echo_of_a_plain_question_is_no_answer(self) -> None:
        engine = make(echo="none")
        assert drive(engine, ASK, [(0.0010, SENT), (0.0020, GOT)], attempts=1).response == ANSWER
        assert engine.total.damaged == {"length": 1}
