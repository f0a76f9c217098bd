"""Both directions of a bus in one stream, with senders and receivers."""

from __future__ import annotations

from itertools import pairwise
from typing import Any

import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from qlinkgen.codecs import qlink
from qlinkgen.link import Monitor, Timing
from qlinkgen.link.codec import address_of
from qlinkgen.link.events import Damaged, Stray
from qlinkgen.link.monitor import Asked, Replied, Unanswered, _same_frames
from qlinkgen.protocols.qlink.matching import ACCEPTS
from qlinkgen.sim import FaultPlan
from tests.link.line import BYTE, Node, bus, changed, request_of, timing
from tests.python.protocols import build, module, protocol

ASK = qlink.MotorPositionRequest(node=3)
ANSWER = qlink.MotorPositionResponse(node=3, position=7)
RESET, RESET_DONE = qlink.NodeResetRequest(node=3), qlink.NodeResetResponse(node=3)
BACK = qlink.LoopBackRequest(node=3, offset=1, data=b"\xa5\xa5x")
BACK_AGAIN = qlink.LoopBackResponse(node=3, offset=1, data=b"\xa5\xa5x")
SYNC = qlink.NodeSyncRequest(node=0, counter=3)
#: Until when an answer to a request that ended at 0 is in time.
IN_TIME = 20 * BYTE + 0.002


def monitor(codec: Any = qlink) -> Monitor:
    return Monitor(codec, timing() if codec is qlink else Timing.of(codec, host_slack=0.002), accepts=ACCEPTS)


def heard(*stream: tuple[float, Any], finish: bool = False) -> list[Any]:
    """The events of a monitor for messages and bytes at given times."""
    listener = monitor()
    for at, part in stream:
        listener.receive(part if isinstance(part, bytes) else part.to_frame(), at)
    if finish:
        listener.finish(stream[-1][0])
    return list(listener.heard)


def asked(at: float, request: Any, *, repeat: bool = False) -> Asked:
    return Asked(at, request, repeat, request.to_frame())


def replied(at: float, request: Any, response: Any, delay: float, *, late: bool = False) -> Replied:
    return Replied(at, request, response, pytest.approx(delay), late, response.to_frame())  # type: ignore[arg-type]


@pytest.mark.parametrize(
    ("request_", "response"),
    [(ASK, ANSWER), (RESET, RESET_DONE), (BACK, BACK_AGAIN)],
    ids=["plain", "reset", "back"],
)
class TestPairs:
    def test_a_pair(self, request_: Any, response: Any) -> None:
        expected = [asked(0.0, request_), replied(0.001, request_, response, 0.001)]
        assert heard((0.0, request_), (0.001, response)) == expected

    def test_in_one_piece(self, request_: Any, response: Any) -> None:
        both = request_.to_frame() + response.to_frame()
        assert heard((0.0, both)) == [asked(0.0, request_), replied(0.0, request_, response, 0.0)]
        twice = heard((0.0, both + both))
        assert [type(each) for each in twice] == [Asked, Replied, Asked, Replied]
        assert [each.repeat for each in twice if isinstance(each, Asked)] == [False, False]

    def test_again_and_again(self, request_: Any, response: Any) -> None:
        stream = [(0.01 * number, part) for number in range(4) for part in (request_, response)]
        kinds = [type(each) for each in heard(*stream)]
        assert kinds == [Asked, Replied] * 4

    def test_a_repeat(self, request_: Any, response: Any) -> None:
        got = heard((0.0, request_), (0.02, request_), (0.021, response))
        assert got == [
            asked(0.0, request_),
            Unanswered(0.02, request_),
            asked(0.02, request_, repeat=True),
            replied(0.021, request_, response, 0.001),
        ]

    def test_unanswered_at_the_end(self, request_: Any, response: Any) -> None:
        assert heard((0.0, request_), finish=True) == [asked(0.0, request_), Unanswered(0.0, request_)]
        assert heard((0.0, request_), (0.001, response), finish=True)[2:] == []


def test_unanswered_by_the_clock() -> None:
    listener = monitor()
    assert listener.next_timer() is None
    listener.receive(ASK.to_frame(), 0.0)
    timer = listener.next_timer()
    assert timer == pytest.approx(IN_TIME)
    assert timer is not None
    listener.handle_timer(timer - 1e-6)
    assert len(listener.heard) == 1
    listener.handle_timer(timer)
    listener.handle_timer(timer)
    assert listener.heard[1] == Unanswered(timer, ASK)
    assert len(listener.heard) == 2
    assert listener.next_timer() is None


def test_late() -> None:
    got = heard((0.0, ASK), (0.5, ANSWER))
    assert got == [asked(0.0, ASK), Unanswered(0.5, ASK), replied(0.5, ASK, ANSWER, 0.5, late=True)]


def test_twice_answered() -> None:
    got = heard((0.0, ASK), (0.001, ANSWER), (0.002, ANSWER))
    assert got[2:] == [Stray(0.002, ANSWER, late=True)]


def test_strays() -> None:
    other = qlink.MotorPositionResponse(node=4)
    assert heard((0.0, ANSWER)) == [Stray(0.0, ANSWER, late=False)]
    assert heard((0.0, ASK), (0.001, other), (0.0015, ANSWER)) == [
        asked(0.0, ASK),
        Stray(0.001, other, late=False),
        replied(0.0015, ASK, ANSWER, 0.0015),
    ]


def test_two_requests_in_a_row() -> None:
    info = qlink.NodeInfoRequest(node=5)
    got = heard((0.0, ASK), (0.0005, info), (0.002, qlink.NodeInfoResponse(node=5)))
    assert got == [
        asked(0.0, ASK),
        Unanswered(0.0005, ASK),
        asked(0.0005, info),
        replied(0.002, info, qlink.NodeInfoResponse(node=5), 0.0015),
    ]


def test_the_same_again_after_an_answer_is_no_repeat() -> None:
    got = heard((0.0, ASK), (0.001, ANSWER), (0.002, ASK))
    assert got[2] == asked(0.002, ASK)


class TestBroadcasts:
    def test_nobody_answers(self) -> None:
        listener = monitor()
        listener.receive(SYNC.to_frame(), 0.0)
        assert listener.next_timer() is None
        listener.receive(ASK.to_frame(), 0.001)
        assert list(listener.heard) == [asked(0.0, SYNC), asked(0.001, ASK)]

    def test_the_same_twice(self) -> None:
        assert heard((0.0, SYNC), (0.001, SYNC)) == [asked(0.0, SYNC), asked(0.001, SYNC)]

    def test_unless_it_is_one_of_those_that_are(self) -> None:
        info, answer = qlink.NodeInfoRequest(node=0), qlink.NodeInfoResponse(node=12)
        assert heard((0.0, info), (0.001, answer)) == [
            asked(0.0, info),
            replied(0.001, info, answer, 0.001),
        ]


class TestWhatAnswers:
    def test_counters_and_data_must_be_the_same(self) -> None:
        request = qlink.MotionRequest(node=3, counter=9)
        old, right = qlink.MotionResponse(node=3, counter=8), qlink.MotionResponse(node=3, counter=9)
        got = heard((0.0, request), (0.001, old), (0.0015, right))
        assert [type(each) for each in got] == [Asked, Stray, Replied]

    def test_a_renumbered_node(self) -> None:
        request = qlink.NodeSetupRequest(node=3, node_number=9)
        for node in (3, 9):
            answer = qlink.NodeSetupResponse(node=node)
            assert heard((0.0, request), (0.001, answer))[1] == replied(0.001, request, answer, 0.001)
        assert isinstance(heard((0.0, request), (0.001, qlink.NodeSetupResponse(node=4)))[1], Stray)

    def test_a_read_of_another_size(self) -> None:
        request = qlink.ReadRequest(node=3, size=4)
        assert isinstance(heard((0.0, request), (0.001, qlink.ReadResponse(node=3, data=b"x")))[1], Stray)


class TestDamaged:
    @pytest.mark.parametrize("message", [ASK, ANSWER, RESET, SYNC])
    def test_once(self, message: Any) -> None:
        got = heard((0.0, changed(message.to_frame(), 5)), (0.1, ASK))
        assert [type(each) for each in got] == [Damaged, Asked]
        assert got[0].fault.kind == "crc"
        assert got[0].fault.raw == changed(message.to_frame(), 5)
        assert got[0].node is None

    def test_it_names_the_node_that_was_asked(self) -> None:
        got = heard((0.0, ASK), (0.001, changed(ANSWER.to_frame(), 7)))
        assert [type(each) for each in got] == [Asked, Damaged]
        assert got[1].node == 3

    def test_broken_off_by_the_next_frame(self) -> None:
        got = heard((0.0, ASK.to_frame()[:5] + ASK.to_frame()))
        assert [type(each) for each in got] == [Damaged, Asked]
        assert got[0].fault.kind == "truncated"

    def test_broken_off_at_the_end(self) -> None:
        got = heard((0.0, ASK.to_frame()[:5]), finish=True)
        assert [type(each) for each in got] == [Damaged]
        assert heard((0.0, ASK.to_frame()[:1]), finish=True) == []

    def test_noise_is_counted(self) -> None:
        listener = monitor()
        listener.receive(b"\x01\x02" + ASK.to_frame() + b"\x03\x00" + ANSWER.to_frame() + b"\xff", 0.0)
        assert [type(each) for each in listener.heard] == [Asked, Replied]
        assert listener.skipped == 5
        assert listener.bytes == 5 + len(ASK.to_frame()) + len(ANSWER.to_frame())

    def test_a_number_that_no_command_has(self) -> None:
        frame = bytes.fromhex("a5a5047f03") + b"\x00\x00"
        got = heard((0.0, frame), (0.1, ASK))
        assert [type(each) for each in got] == [Damaged, Asked]


@st.composite
def streams(draw: st.DrawFn) -> bytes:
    """Traffic with all sorts of faults in it."""
    frames = [request_of(command, node).to_frame() for command in qlink.COMMANDS.values() for node in (3, 7)]
    frames += [message.to_frame() for message in (ANSWER, RESET_DONE, BACK, BACK_AGAIN, SYNC)]
    good = st.sampled_from(frames)
    cut = st.builds(lambda frame, end: frame[:end], good, st.integers(1, 9))
    bad = st.builds(lambda frame, index: changed(frame, index % len(frame)), good, st.integers(0, 40))
    noise = st.one_of(st.binary(max_size=5), st.sampled_from([b"\xa5", b"\xa5\xa5", b"\x00"]))
    return b"".join(draw(st.lists(st.one_of(good, good, cut, bad, noise), max_size=12)))


def summary(listener: Monitor) -> list[Any]:
    return [*listener.heard, listener.skipped, listener.bytes]


@settings(max_examples=150)
@given(stream=streams(), cuts=st.lists(st.integers(1, 400), max_size=10))
def test_pieces_of_any_size_give_the_same(stream: bytes, cuts: list[int]) -> None:
    whole, cut = monitor(), monitor()
    whole.receive(stream, 1.0)
    places = sorted({0, len(stream), *(place for place in cuts if place < len(stream))})
    for begin, end in pairwise(places):
        cut.receive(stream[begin:end], 1.0)
    whole.finish(1.0)
    cut.finish(1.0)
    assert summary(whole) == summary(cut)


@settings(max_examples=150)
@given(stream=streams())
@example(stream=bytes.fromhex("A5A504020346A500"))  # the inserted byte belongs to the wrong frame
def test_everything_in_a_stream_is_accounted_for(stream: bytes) -> None:
    listener = monitor()
    listener.receive(stream, 1.0)
    listener.finish(1.0)
    size, asked_now, ended = 0, 0, 0
    for each in listener.heard:
        match each:
            case Asked() | Replied():
                size += len(each.frame)
            case Stray():
                size += len(each.message.to_frame())
            case Damaged():
                size += len(each.fault.raw) + each.fault.raw.endswith(b"\xa5")
        waits = isinstance(each, Asked) and address_of(each.request) != 0
        waits &= isinstance(each, Asked) and not isinstance(
            each.request, (qlink.NodeStartRequest, qlink.NodeStopRequest)
        )
        asked_now += waits
        ended += isinstance(each, Unanswered) or (isinstance(each, Replied) and not each.late)
    assert asked_now == ended
    # The byte inserted at a frame's end may be missing; bytes of a fault may be read again.
    assert size + listener.skipped >= len(stream)


def test_all_commands_of_a_full_bus() -> None:
    wire, port, _ = bus(*range(1, 17))
    listener = monitor()
    wire.taps.append(lambda at, source, data: listener.receive(data, at))
    requests = [request_of(command, number) for command in qlink.COMMANDS.values() for number in (1, 9, 16)]
    for request in requests:
        port.write(request.to_frame())
        port.sleep(0.05)
    assert [each.request for each in listener.heard if isinstance(each, Asked)] == requests
    usual = [Node(request.node).usual(request) for request in requests if request.node]
    replies = [each.response for each in listener.heard if isinstance(each, Replied)]
    assert replies == [response for response in usual if response is not None]
    assert not [each for each in listener.heard if isinstance(each, (Stray, Damaged))]


def test_a_bad_line_does_not_stop_it() -> None:
    plan = FaultPlan(drop=0.1, flip=0.2, truncate=0.1, stray=0.1, noise=0.1, duplicate=0.1, seed=7)
    wire, port, _ = bus(3, faults=plan, chunks="random")
    listener = monitor()
    wire.taps.append(lambda at, source, data: listener.receive(data, at))
    for _ in range(300):
        port.write(ASK.to_frame())
        port.sleep(0.02)
    kinds = {type(each) for each in listener.heard}
    assert kinds == {Asked, Replied, Unanswered, Stray, Damaged}
    assert len(listener._suspected) <= 1  # the list does not grow with time


@pytest.mark.parametrize("name", ["modbus_rtu", "dynamixel", "kitchen_sink"])
def test_other_protocols(name: str) -> None:
    codec = module(name)
    listener = monitor(codec)
    asked_for: list[Any] = []
    for command in codec.COMMANDS.values():
        request = build(name, protocol(name).by_name[f"{command.name}.request"])
        asked_for.append(request)
        listener.receive(b"\x00" * 3 + request.to_frame(), float(len(asked_for)))
        listener.handle_timer(len(asked_for) + 0.9)
    got = [each.request for each in listener.heard if isinstance(each, Asked)]
    assert [type(request) for request in got] == [
        type(request) for request in asked_for
    ] or name == "modbus_rtu"


def test_frames_that_were_hidden_in_a_false_one_are_all_told() -> None:
    """Without stuffing a false start may cover several frames, which are found at the same byte."""
    codec = module("kitchen_sink")
    request, news = (
        build("kitchen_sink", protocol("kitchen_sink").by_name[f"{name}.request"])
        for name in ("either_way", "announce")
    )
    answer = protocol("kitchen_sink").by_name["either_way.response"]
    response = build("kitchen_sink", answer, counter=request.counter)
    frames = [message.to_frame() for message in (request, response, news)]
    hidden = 0
    for claim in range(3, 60):
        listener = monitor(codec)
        listener.receive(request.to_frame()[:1] + bytes((claim,)) + b"".join(frames) + bytes(200), 0.0)
        told = [each for each in listener.heard if isinstance(each, (Asked, Replied))]
        assert [each.frame for each in told] == frames, claim
        assert [type(each) for each in told] == [Asked, Replied, Asked]
        hidden += any(isinstance(each, Damaged) for each in listener.heard)
    assert hidden > 30


def test_a_broadcast_of_a_command_that_a_node_would_answer() -> None:
    codec = module("kitchen_sink")
    request = build("kitchen_sink", protocol("kitchen_sink").by_name["either_way.request"], station=0)
    listener = monitor(codec)
    listener.receive(request.to_frame(), 0.0)
    assert listener.next_timer() is None
    listener.receive(request.to_frame(), 1.0)
    assert [(type(each), each.repeat) for each in listener.heard if isinstance(each, Asked)] == [
        (Asked, False)
    ] * 2
    assert len(listener.heard) == 2


def test_where_one_decoder_has_seen_more_than_the_other_the_bytes_tell_what_is_the_same() -> None:
    fault = qlink.Fault("frame", 0, b"")
    both = list(_same_frames([ASK, RESET, SYNC], [fault, fault, ANSWER, RESET_DONE, fault]))
    assert both == [(ASK, None), (RESET, RESET_DONE), (SYNC, None), (None, ANSWER)]
    assert list(_same_frames([], [RESET_DONE])) == [(None, RESET_DONE)]
    assert list(_same_frames([RESET, RESET], [RESET_DONE])) == [(RESET, RESET_DONE), (RESET, None)]
