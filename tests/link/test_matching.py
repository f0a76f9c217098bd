"""Which frames answer a request, and which do not."""

from __future__ import annotations

from typing import Any

import pytest

from qlinkgen.codecs import qlink
from qlinkgen.link import MasterEngine, Timing
from qlinkgen.link.events import Stray
from tests.link.line import BYTE, Node, drive, make, request_of, taken
from tests.python.protocols import module

#: When an answer to any request here may be complete, on a line of 115200 baud.
THEN = 0.0075


def answered(request: Any, *responses: Any, paced: bool = True) -> Any:
    """The response that a master accepts, None if it accepts none."""
    engine = make(slack=0.01, paced=paced)
    run = drive(engine, request, [(THEN, response.to_frame()) for response in responses], attempts=1)
    assert (run.reply is None) == (engine.total.answers == 0)
    return run.reply.response if run.reply else None


RESPONDING = [command for command in qlink.COMMANDS.values() if command.response is not None]


def usual_answer(command: Any) -> Any:
    usual = Node(3).usual(request_of(command))
    return usual if usual is not None else command.response(node=3)


@pytest.mark.parametrize("command", RESPONDING, ids=lambda command: command.name)
class TestEveryCommand:
    def test_its_answer(self, command: Any) -> None:
        assert answered(request_of(command), usual_answer(command)) == usual_answer(command)

    def test_another_node(self, command: Any) -> None:
        other = usual_answer(command)
        other.node = 4
        assert answered(request_of(command), other) is None
        assert answered(request_of(command), other, usual_answer(command)) == usual_answer(command)

    def test_another_command(self, command: Any) -> None:
        for other in RESPONDING:
            if other is not command:
                assert answered(request_of(command), usual_answer(other)) is None


class TestEchoes:
    """Fields that an answer has to repeat."""

    def test_the_counter_of_a_motion(self) -> None:
        request = qlink.MotionRequest(node=3, counter=200)
        right = qlink.MotionResponse(node=3, counter=200)
        for counter in (199, 201, 0):
            wrong = qlink.MotionResponse(node=3, counter=counter)
            assert answered(request, wrong) is None
            assert answered(request, wrong, right) == right

    def test_the_counter_of_a_piece(self) -> None:
        request = qlink.NodeProgramLoadRequest(node=3, counter=0, program_data=b":00000001FF")
        assert answered(request, qlink.NodeProgramLoadResponse(node=3, counter=255)) is None
        assert answered(request, qlink.NodeProgramLoadResponse(node=3, counter=0)) is not None

    def test_offset_and_data_of_a_loop_back(self) -> None:
        request = qlink.LoopBackRequest(node=3, offset=4, data=b"abc")
        for offset, data in ((4, b"abd"), (5, b"abc"), (4, b"ab"), (4, b"abcd")):
            assert answered(request, qlink.LoopBackResponse(node=3, offset=offset, data=data)) is None
        right = qlink.LoopBackResponse(node=3, offset=4, data=b"abc")
        assert answered(request, right) == right


class TestChecksOfTheProtocol:
    def test_a_renumbered_node_answers_with_its_old_or_its_new_number(self) -> None:
        request = qlink.NodeSetupRequest(node=3, node_number=7)
        for node in range(1, 17):
            response = qlink.NodeSetupResponse(node=node)
            assert (answered(request, response) == response) == (node in (3, 7))

    def test_a_read_gives_as_many_bytes_as_were_asked_for(self) -> None:
        request = qlink.ReadRequest(node=3, size=4)
        for size in (1, 3, 4, 5, 26):
            response = qlink.ReadResponse(node=3, data=bytes(size))
            assert (answered(request, response) == response) == (size == 4)
        assert answered(request, qlink.ReadResponse(node=4, data=bytes(4))) is None


class TestBroadcasts:
    @pytest.mark.parametrize("node", range(1, 17))
    def test_an_answered_one_takes_any_node(self, node: int) -> None:
        info = qlink.NodeInfoResponse(node=node)
        assert answered(qlink.NodeInfoRequest(node=0), info) == info
        setup = qlink.NodeSetupResponse(node=node)
        assert answered(qlink.NodeSetupRequest(node=0), setup) == setup

    @pytest.mark.parametrize("node", [0, 17, 255])
    def test_but_none_that_does_not_exist(self, node: int) -> None:
        frame = bytearray(qlink.NodeInfoResponse(node=1).to_frame())
        frame[4] = node
        frame[-2:] = _crc(bytes(frame[2:-2]))
        engine = make()
        run = drive(engine, qlink.NodeInfoRequest(node=0), [(0.004, bytes(frame))], attempts=1)
        assert run.error is not None
        assert sum(engine.total.damaged.values()) == 1

    def test_an_answered_one_is_repeated(self) -> None:
        assert len(drive(make(), qlink.NodeInfoRequest(node=0)).sent) == 3

    def test_another_answer_is_none(self) -> None:
        assert answered(qlink.NodeInfoRequest(node=0), qlink.NodeSetupResponse(node=3)) is None


def _crc(body: bytes) -> bytes:
    """CRC-16/IBM-3740, the slow way."""
    crc = 0xFFFF
    for byte in body:
        crc ^= byte << 8
        for _ in range(8):
            crc = (crc << 1 ^ 0x1021 if crc & 0x8000 else crc << 1) & 0xFFFF
    return crc.to_bytes(2, "big")


class TestEarly:
    """On a paced line a frame complete before the request was transmitted is not its answer."""

    REQUEST = qlink.LoopBackRequest(node=3, data=bytes(25))
    RESPONSE = qlink.LoopBackResponse(node=3, data=bytes(25))
    SIZE = len(REQUEST.to_frame())

    def test_it_is_a_stray(self) -> None:
        engine = make()
        early = (self.SIZE * 0.9 - 0.1) * BYTE
        run = drive(engine, self.REQUEST, [(early, self.RESPONSE.to_frame())], attempts=1)
        assert run.error is not None
        assert Stray(early, self.RESPONSE, late=True) in taken(engine)
        assert engine.counters[3].late == 1

    def test_a_clock_that_is_a_little_fast_does_no_harm(self) -> None:
        run = drive(make(), self.REQUEST, [(self.SIZE * 0.91 * BYTE, self.RESPONSE.to_frame())], attempts=1)
        assert run.response == self.RESPONSE

    def test_where_bytes_take_no_time_nothing_is_early(self) -> None:
        run = drive(make(paced=False), self.REQUEST, [(0.0, self.RESPONSE.to_frame())], attempts=1)
        assert run.response == self.RESPONSE


def test_another_protocol_without_checks_of_its_own() -> None:
    codec = module("dynamixel")
    engine = MasterEngine(codec, Timing.of(codec, host_slack=0.01))
    command = next(each for each in codec.COMMANDS.values() if each.name == "ping")
    request = command.request(**{command.request.ADDRESS: 5})
    response = command.response(**{command.request.ADDRESS: 5})
    other = command.response(**{command.request.ADDRESS: 6})
    run = drive(engine, request, [(0.008, other.to_frame()), (0.009, response.to_frame())])
    assert run.response == response
