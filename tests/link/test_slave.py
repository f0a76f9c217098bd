"""One node: the requests that it decodes, and when it answers."""

from __future__ import annotations

from typing import Any

import pytest

from qlinkgen.codecs import qlink
from qlinkgen.link import SlaveEngine
from qlinkgen.protocols.qlink import VirtualNode
from tests.link.line import BYTE, Node, bus, changed, ends_in_mark, pieces, request_of
from tests.python.protocols import module

ASK = qlink.MotorPositionRequest(node=3)
ANSWER = qlink.MotorPositionResponse(node=3, position=3000)


def slave(answer: Any = None, *, turnaround: float = 0.0) -> tuple[SlaveEngine, Node]:
    node = Node(3, answer)
    return SlaveEngine(qlink, node, turnaround=turnaround), node


def heard(*frames: Any, answer: Any = None) -> tuple[bytes, SlaveEngine, Node]:
    """The bytes that a slave sends after some messages."""
    engine, node = slave(answer)
    for frame in frames:
        engine.receive(frame if isinstance(frame, bytes) else frame.to_frame(), 0.0)
    return engine.bytes_to_send(0.0), engine, node


def test_a_request_is_answered_once() -> None:
    sent, engine, node = heard(ASK)
    assert sent == ANSWER.to_frame()
    assert engine.bytes_to_send(1.0) == b""
    assert engine.next_timer() is None
    assert node.heard == [ASK]
    assert (engine.counters.requests, engine.counters.answers) == (1, 1)


@pytest.mark.parametrize("size", [1, 2, 5])
def test_in_pieces_with_noise_before(size: int) -> None:
    sent, engine, _ = heard(*(part for _, part in pieces(b"\x00\xa5\x17" + ASK.to_frame(), 0.0, size)))
    assert sent == ANSWER.to_frame()
    assert engine.counters.damaged == {}


def test_other_nodes_are_not_this_one() -> None:
    for number in (*range(1, 3), *range(4, 17)):
        sent, engine, node = heard(qlink.MotorPositionRequest(node=number))
        assert (sent, node.heard, engine.counters.foreign) == (b"", [], 1)


def test_all_the_traffic_of_a_full_bus() -> None:
    """Each node hears every frame: its own requests, those of the others, and the others' answers."""
    wire, port, nodes = bus(*range(1, 17))
    engines = [station.engine for station in wire._stations]
    requests = 0
    for command in qlink.COMMANDS.values():
        for number in range(1, 17):
            port.write(request_of(command, number).to_frame())
            port.sleep(0.02)
            requests += 1
    assert wire.collisions == 0
    for node, engine in zip(nodes, engines, strict=True):
        assert isinstance(engine, SlaveEngine)
        own = [request.node for request in node.heard]
        assert set(own) == {0, node.number}
        assert own.count(node.number) == len(qlink.COMMANDS) - 1  # every command but node_sync
        assert own.count(0) == 16
        # Requests that have no answer here: see Node.usual.
        assert engine.counters.answers == sum(node.usual(request) is not None for request in node.heard)


def test_a_node_takes_no_answer_of_another_for_a_request_to_it() -> None:
    others = [qlink.NodeResetResponse(node=5), qlink.LoopBackResponse(node=5, data=b"abc")]
    sent, engine, node = heard(*others)
    assert (sent, node.heard, engine.counters.foreign) == (b"", [], 2)


class TestBroadcasts:
    def test_is_heard_and_not_answered(self) -> None:
        for request in (
            qlink.NodeSyncRequest(node=0),
            qlink.NodeStartRequest(node=0),
            qlink.NodeStopRequest(node=0),
        ):
            sent, engine, node = heard(request, answer=lambda request: ANSWER)  # whatever the node returns
            assert (sent, node.heard, engine.counters.broadcasts) == (b"", [request], 1)

    def test_unless_it_is_one_of_those_that_are(self) -> None:
        sent, engine, _ = heard(qlink.NodeInfoRequest(node=0))
        assert sent == qlink.NodeInfoResponse(node=3).to_frame()
        assert engine.counters.answers == 1


class TestTurnaround:
    def test_the_answer_waits(self) -> None:
        engine, _ = slave(turnaround=0.001)
        engine.receive(ASK.to_frame(), 5.0)
        assert engine.next_timer() == 5.001
        assert engine.bytes_to_send(5.0) == b""
        assert engine.bytes_to_send(5.0009) == b""
        assert engine.bytes_to_send(5.001) == ANSWER.to_frame()
        assert engine.next_timer() is None

    def test_without_one_it_is_due_at_once(self) -> None:
        engine, _ = slave()
        engine.receive(ASK.to_frame(), 5.0)
        assert engine.next_timer() == 5.0

    @pytest.mark.parametrize("bad", [-0.001, float("inf"), float("nan")])
    def test_bad(self, bad: float) -> None:
        with pytest.raises(ValueError, match=f"turnaround must be .* not {bad}"):
            slave(turnaround=bad)

    @pytest.mark.parametrize(
        "other",
        [
            qlink.MotorPositionRequest(node=5),  # the master has gone on
            qlink.MotorPositionResponse(node=5),
            qlink.NodeSyncRequest(node=0),
            qlink.NodeStartRequest(node=3),  # a request that nothing answers
        ],
    )
    def test_a_superseded_answer_is_not_sent(self, other: Any) -> None:
        engine, _ = slave(turnaround=0.001)
        engine.receive(ASK.to_frame(), 0.0)
        engine.receive(other.to_frame(), 0.0005)
        replaced = not isinstance(other, qlink.MotorPositionResponse)  # not a request, so not decoded
        assert engine.counters.replaced == replaced
        assert (engine.bytes_to_send(1.0) == b"") == replaced

    def test_a_new_request_replaces_the_answer(self) -> None:
        engine, _ = slave(turnaround=0.001)
        engine.receive(ASK.to_frame(), 0.0)
        engine.receive(qlink.NodeInfoRequest(node=3).to_frame(), 0.0005)
        assert engine.next_timer() == pytest.approx(0.0015)
        assert engine.bytes_to_send(0.001) == b""
        assert engine.bytes_to_send(0.0015) == qlink.NodeInfoResponse(node=3).to_frame()
        assert (engine.counters.replaced, engine.counters.answers, engine.counters.requests) == (1, 1, 2)

    def test_on_a_line_that_hands_on_each_byte_it_leaves_the_last_byte_its_time(self) -> None:
        request = ends_in_mark(lambda number: qlink.WriteReadRequest(node=3, outputs=number))
        wire, port, _ = bus(3, chunks="byte")
        port.write(request.to_frame())
        port.sleep(0.01)
        assert wire.collisions == 0
        assert port.read(0) != b""
        assert wire.byte_time == pytest.approx(BYTE)


class TestNumber:
    def test_node_setup_changes_it(self) -> None:
        def renumber(request: Any) -> Any:
            if isinstance(request, qlink.NodeSetupRequest):
                node.number = request.node_number
                return qlink.NodeSetupResponse(node=node.number)
            return node.usual(request)

        engine, node = slave(renumber)
        engine.receive(qlink.NodeSetupRequest(node=3, node_number=9).to_frame(), 0.0)
        assert engine.bytes_to_send(0.0) == qlink.NodeSetupResponse(node=9).to_frame()
        engine.receive(ASK.to_frame(), 1.0)
        assert engine.bytes_to_send(1.0) == b""
        engine.receive(qlink.MotorPositionRequest(node=9).to_frame(), 2.0)
        assert engine.bytes_to_send(2.0) == qlink.MotorPositionResponse(node=9, position=9000).to_frame()

    def test_two_requests_in_one_piece_around_the_change(self) -> None:
        def renumber(request: Any) -> Any:
            node.number = 9

        engine, node = slave(renumber)
        setup = qlink.NodeSetupRequest(node=3, node_number=9).to_frame()
        engine.receive(setup + ASK.to_frame() + qlink.NodeStartRequest(node=9).to_frame(), 0.0)
        assert [type(request) for request in node.heard] == [qlink.NodeSetupRequest, qlink.NodeStartRequest]
        assert engine.counters.foreign == 1


class TestFaults:
    def test_a_damaged_request_is_not_answered(self) -> None:
        for index in range(len(ASK.to_frame())):
            sent, engine, node = heard(changed(ASK.to_frame(), index))
            assert (sent, node.heard) == (b"", [])
        sent, engine, _ = heard(changed(ASK.to_frame(), 5), ASK)
        assert sent == ANSWER.to_frame()
        assert engine.counters.damaged == {"crc": 1}

    def test_a_value_out_of_range(self) -> None:
        frame = bytes.fromhex("a5a50406") + b"\x00"  # a number of a command, and a node that it cannot have
        assert heard(frame, ASK)[0] == ANSWER.to_frame()

    def test_what_the_node_does_not_support_is_not_answered(self) -> None:
        sent, engine, _ = heard(ASK, answer=lambda request: None)
        assert (sent, engine.counters.requests, engine.counters.answers) == (b"", 1, 0)
        assert engine.next_timer() is None

    def test_an_answer_that_cannot_be_sent_is_the_fault_of_the_node(self) -> None:
        engine, _ = slave(lambda request: qlink.MotorPositionResponse(node=3, position=1 << 40))
        with pytest.raises(qlink.EncodeError):
            engine.receive(ASK.to_frame(), 0.0)
        assert engine.bytes_to_send(0.0) == b""
        engine.receive(qlink.NodeStartRequest(node=9).to_frame(), 0.0)  # and the engine continues
        assert engine.counters.foreign == 1

    def test_counters_show_themselves(self) -> None:
        _, engine, _ = heard(ASK)
        assert "requests=1" in repr(engine.counters)


def test_a_protocol_with_another_broadcast_address() -> None:
    codec = module("dynamixel")
    command = next(each for each in codec.COMMANDS.values() if each.name == "ping")
    name = command.request.ADDRESS
    node = Node(5, lambda request: command.response(**{name: 5}))
    engine = SlaveEngine(codec, node)
    engine.receive(command.request(**{name: 4}).to_frame(), 0.0)
    assert engine.counters.foreign == 1
    engine.receive(command.request(**{name: 5}).to_frame(), 0.0)
    assert engine.bytes_to_send(0.0) == command.response(**{name: 5}).to_frame()


AMBIGUOUS = [
    qlink.NodeResetRequest(node=3),
    qlink.ClearFifoRequest(node=3),
    qlink.LoopBackRequest(node=3, data=b"\xa5\x00\xa5"),
]


class TestEcho:
    """A two-wire adapter echoes an answer, and some answers are the same bytes as their requests."""

    @pytest.mark.parametrize("request_", AMBIGUOUS, ids=lambda request: request.NAME)
    @pytest.mark.parametrize("size", [1, 4, 99])
    def test_the_own_answer_is_no_request(self, request_: Any, size: int) -> None:
        node = VirtualNode(3)
        engine = SlaveEngine(qlink, node, echo="expect")
        for _ in range(3):
            engine.receive(request_.to_frame(), 0.0)
            answer = engine.bytes_to_send(1.0)
            assert answer == request_.to_frame()
            for at, part in pieces(answer, 1.0, size):
                engine.receive(part, at)
            assert engine.bytes_to_send(9.0) == b""
        assert (engine.counters.requests, engine.counters.answers) == (3, 3)

    def test_without_expecting_it_the_node_would_answer_itself(self) -> None:
        engine = SlaveEngine(qlink, VirtualNode(3))
        engine.receive(AMBIGUOUS[0].to_frame(), 0.0)
        engine.receive(engine.bytes_to_send(1.0), 1.0)
        assert engine.bytes_to_send(2.0) != b""

    def test_an_echo_that_does_not_come_hides_no_request(self) -> None:
        engine = SlaveEngine(qlink, VirtualNode(3), echo="expect")
        for _ in range(3):
            engine.receive(qlink.MotorPositionRequest(node=3).to_frame(), 0.0)
            assert engine.bytes_to_send(1.0) != b""

    def test_a_slave_cannot_look_for_it(self) -> None:
        with pytest.raises(ValueError, match="auto"):
            SlaveEngine(qlink, VirtualNode(3), echo="auto")  # type: ignore[arg-type]
