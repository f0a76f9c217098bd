"""The virtual node, command by command; every request and answer goes through the wire format."""

from __future__ import annotations

from typing import Any

import pytest

from qlinkgen.codecs import qlink
from qlinkgen.codecs.qlink import PositionType
from qlinkgen.codecs.qlink_bus import SlaveHandlers
from qlinkgen.protocols.qlink.virtual_node import VirtualNode


def ask(node: VirtualNode, request: qlink.Message, now: float = 0.0) -> qlink.Message | None:
    response = node.handle(qlink.decode_request(request.to_frame()), now)
    return None if response is None else qlink.decode_response(response.to_frame())


class TestNode:
    """Sections 7.1 to 7.5 and 7.7."""

    def test_setup_is_answered_under_the_new_number(self) -> None:
        node = VirtualNode(3)
        request = qlink.NodeSetupRequest(
            node=3, node_number=9, t1_delay=0.3, t2_delay=25.5, position_type=PositionType.METRONIX
        )
        assert ask(node, request) == qlink.NodeSetupResponse(node=9)
        assert (node.number, node.t1_delay, node.t2_delay) == (9, 0.3, 25.5)
        assert node.position_type is PositionType.METRONIX
        assert ask(node, request) is None, "it no longer answers to the old number"

    def test_setup_and_info_are_answered_as_broadcasts(self) -> None:
        node = VirtualNode(5)
        assert ask(node, qlink.NodeSetupRequest(node=0, node_number=6)) == qlink.NodeSetupResponse(node=6)
        info = ask(node, qlink.NodeInfoRequest(node=0))
        assert info is not None
        assert info.node == 6

    def test_info_tells_what_the_node_was_given(self) -> None:
        node = VirtualNode(
            2, version=(4, 17), product_id=0xA5A5, serial_number=0xFFFF_FFFF, t1_delay=0.0, position_type=77
        )
        assert ask(node, qlink.NodeInfoRequest(node=2)) == qlink.NodeInfoResponse(
            node=2,
            version_major=4,
            version_minor=17,
            product_id=0xA5A5,
            t1_delay=0.0,
            t2_delay=1.0,
            position_type=77,
            serial_number=0xFFFF_FFFF,
        )

    def test_the_settings_of_a_new_node_are_those_of_the_document(self) -> None:
        info = ask(VirtualNode(), qlink.NodeInfoRequest(node=1))
        assert isinstance(info, qlink.NodeInfoResponse)
        assert (info.t1_delay, info.t2_delay, info.position_type) == (1.0, 1.0, PositionType.NONE)

    def test_what_the_document_leaves_open_has_defaults(self) -> None:
        node = VirtualNode()
        assert (node.number, node.version, node.product_id, node.serial_number) == (1, (1, 0), 0, 0)
        assert (node.path.capacity, node.path.rate, node.path.started) == (48, 1000.0, False)
        assert (node.unsupported, node.record, node.now) == (frozenset(), None, None)
        ask(node, qlink.MotorRequestRequest(node=1, motor_data=b"x"), 0.0)
        assert [node.motor.poll(now)[0] for now in (0.049, 0.05)] == [0, 0x16]

    @pytest.mark.parametrize("number", [0, 1])
    def test_start_stop_and_sync_are_never_answered(self, number: int) -> None:
        node, states = VirtualNode(), []
        for request in (qlink.NodeStartRequest(node=number), qlink.NodeStopRequest(node=number)):
            assert ask(node, request) is None
            states.append(node.path.started)
        assert states == [True, False]
        assert ask(node, qlink.NodeSyncRequest(counter=number)) is None

    @pytest.mark.parametrize(
        ("counters", "missed", "repeated"),
        [
            ([200], 0, 0),
            ([0, 1, 2], 0, 0),
            ([255, 0], 0, 0),
            ([7, 9], 1, 0),
            ([254, 2], 3, 0),
            ([1, 0], 254, 0),
            ([4, 4, 5], 0, 1),
        ],
    )
    def test_missed_syncs_are_counted_from_the_first_on(
        self, counters: list[int], missed: int, repeated: int
    ) -> None:
        node = VirtualNode()
        for counter in counters:
            ask(node, qlink.NodeSyncRequest(counter=counter))
        counts = node.statistics
        assert (counts.syncs, counts.missed_syncs, counts.repeated_syncs) == (len(counters), missed, repeated)

    def test_a_reset_is_answered_and_clears(self) -> None:
        node = VirtualNode(4, motor_seconds=0.0)
        ask(node, qlink.NodeSetupRequest(node=4, node_number=5, t1_delay=2.0, position_type=1))
        ask(node, qlink.PresetMotorPositionRequest(node=5, position=-7))
        ask(node, qlink.NodeStartRequest(node=5))
        ask(node, qlink.MotionRequest(node=5, counter=3, outputs=0x81, segments=[1, 2, 3]))
        ask(node, qlink.MotorRequestRequest(node=5, motor_data=b"?"))
        ask(node, qlink.NodeSyncRequest(counter=10))
        node.inputs = 6
        assert ask(node, qlink.NodeResetRequest(node=5)) == qlink.NodeResetResponse(node=5)
        assert (node.path.waiting, node.path.dropped, node.outputs, node.path.started) == (0, 3, 0, False)
        assert (node.number, node.t1_delay, node.position_type, node.position) == (5, 2.0, 1, -7)
        assert (node.inputs, node.statistics.resets) == (6, 1)
        poll = ask(node, qlink.MotorResponsePollRequest(node=5))
        assert poll == qlink.MotorResponsePollResponse(node=5, last_completion=0)
        ask(node, qlink.NodeSyncRequest(counter=200))
        assert node.statistics.missed_syncs == 0, "the first sync after a reset is the base again"
        ask(node, qlink.MotionRequest(node=5, counter=3, segments=[9]))
        assert node.path.waiting == 1, "the first motion after a reset is new whatever its counter"

    def test_a_node_that_starts_by_itself_does_so_after_a_reset(self) -> None:
        node = VirtualNode(started=True)
        ask(node, qlink.NodeStopRequest(node=0))
        ask(node, qlink.NodeResetRequest(node=1))
        assert node.path.started


class TestMotorProtocol:
    """Sections 7.8 and 7.9."""

    def test_a_request_is_received_first_and_completed_later(self) -> None:
        node = VirtualNode(2, motor=lambda data: data[::-1], motor_seconds=0.5)
        poll = qlink.MotorResponsePollRequest(node=2)
        open_ = qlink.MotorResponsePollResponse(node=2, last_completion=0)
        assert ask(node, poll, 1.0) == open_, "nothing was asked yet"
        request = qlink.MotorRequestRequest(node=2, motor_data=b"abc")
        assert ask(node, request, 1.0) == qlink.MotorRequestResponse(node=2)
        assert ask(node, poll, 1.4) == open_
        done = qlink.MotorResponsePollResponse(node=2, last_completion=0x16, motor_data=b"cba")
        assert ask(node, poll, 1.5) == done
        assert ask(node, poll, 9.0) == done, "it stays until the next request"

    def test_a_newer_request_takes_the_place_of_the_older(self) -> None:
        node = VirtualNode(motor_seconds=1.0)
        ask(node, qlink.MotorRequestRequest(node=1, motor_data=b"old"), 0.0)
        ask(node, qlink.MotorRequestRequest(node=1, motor_data=b"new"), 0.5)
        poll = qlink.MotorResponsePollRequest(node=1)
        assert ask(node, poll, 1.2) == qlink.MotorResponsePollResponse(node=1, last_completion=0)
        answer = ask(node, poll, 1.5)
        assert answer == qlink.MotorResponsePollResponse(node=1, last_completion=0x16, motor_data=b"new")
        ask(node, qlink.MotorRequestRequest(node=1, motor_data=b"third"), 1.5)
        assert (node.statistics.motor_requests, node.statistics.replaced_motor_requests) == (3, 1)

    def test_the_echo_is_cut_to_what_an_answer_holds(self) -> None:
        node = VirtualNode(motor_seconds=0.0)
        ask(node, qlink.MotorRequestRequest(node=1, motor_data=bytes(range(26))))
        answer = ask(node, qlink.MotorResponsePollRequest(node=1))
        assert isinstance(answer, qlink.MotorResponsePollResponse)
        assert answer.motor_data == bytes(range(25))

    def test_a_motor_that_says_too_much_is_told_so(self) -> None:
        node = VirtualNode(motor=lambda _: bytes(26))
        with pytest.raises(ValueError, match="returned 26 bytes; at most 25"):
            ask(node, qlink.MotorRequestRequest(node=1, motor_data=b"x"))


class TestTheWhole:
    def test_loop_back_returns_what_came(self) -> None:
        node = VirtualNode(16)
        answer = ask(node, qlink.LoopBackRequest(node=16, offset=255, data=b"\xa5" * 25))
        assert answer == qlink.LoopBackResponse(node=16, offset=255, data=b"\xa5" * 25)

    def test_every_command_is_there(self) -> None:
        node = VirtualNode(motor_seconds=0.0)
        needed: dict[str, dict[str, Any]] = {
            "read": {"size": 1},
            "write": {"data": b"x"},
            "loop_back": {"data": b"x"},
            "motor_request": {"motor_data": b"x"},
        }
        for name, command in qlink.COMMANDS.items():
            address = 0 if command.addressing == "broadcast" else 1
            answer = ask(node, command.request(node=address, **needed.get(name, {})))
            assert isinstance(answer, command.response or type(None)), name
            assert getattr(VirtualNode, name) is not getattr(SlaveHandlers, name), name

    def test_a_subclass_replaces_one_command(self) -> None:
        class Odd(VirtualNode):
            def motor_position(
                self, request: qlink.MotorPositionRequest, now: float
            ) -> qlink.MotorPositionResponse | None:
                return qlink.MotorPositionResponse(node=self.number, position=round(now * 1000))

        node = Odd(3, capacity=7)
        answer = ask(node, qlink.MotorPositionRequest(node=3), 1.5)
        assert answer == qlink.MotorPositionResponse(node=3, position=1500)
        motion = ask(node, qlink.MotionRequest(node=3), 1.5)
        assert isinstance(motion, qlink.MotionResponse)
        assert motion.fifo_space == 7

    @pytest.mark.parametrize(
        "request_",
        [
            qlink.NodeStartRequest(node=1),
            qlink.NodeStopRequest(node=1),
            qlink.NodeResetRequest(node=1),
            qlink.MotorRequestRequest(node=1, motor_data=b"x"),
            qlink.MotorResponsePollRequest(node=1),
            qlink.MotionRequest(node=1),
            qlink.MotorPositionRequest(node=1),
            qlink.ClearFifoRequest(node=1),
            qlink.PresetMotorPositionRequest(node=1, position=30),
            qlink.ReadRequest(node=1, size=1),
            qlink.WriteRequest(node=1, data=b"x"),
            qlink.WriteReadRequest(node=1),
            qlink.SetOutputsRequest(node=1, mask=1),
            qlink.ClearOutputsRequest(node=1, mask=1),
        ],
        ids=lambda request: request.NAME,
    )
    def test_a_method_called_without_handle_knows_the_time(self, request_: qlink.Message) -> None:
        node = VirtualNode(rate=10, started=True)
        node.motion(qlink.MotionRequest(node=1, counter=9, segments=[10, 20]), 0.0)
        getattr(node, request_.NAME.partition(".")[0])(request_, 0.2)
        assert (node.now, node.path.drained, node.position) == (0.2, 2, 30)

    def test_commands_are_switched_off(self) -> None:
        node = VirtualNode(unsupported={"motor_request", "loop_back"})
        assert ask(node, qlink.LoopBackRequest(node=1, data=b"x")) is None
        assert ask(node, qlink.MotorRequestRequest(node=1, motor_data=b"x")) is None
        assert ask(node, qlink.NodeInfoRequest(node=1)) is not None
        counts = node.statistics
        assert (counts.requests, counts.unsupported, counts.motor_requests) == (3, 2, 0)

    def test_time_passes_also_with_commands_that_are_switched_off(self) -> None:
        node = VirtualNode(rate=1, started=True, unsupported={"loop_back"})
        ask(node, qlink.MotionRequest(node=1, segments=[5]), 0.0)
        ask(node, qlink.LoopBackRequest(node=1, data=b"x"), 1.0)
        assert node.position == 5

    def test_other_nodes_and_answers_are_none_of_its_business(self) -> None:
        node = VirtualNode(2)
        assert ask(node, qlink.MotionRequest(node=1, segments=[1])) is None
        assert node.handle(qlink.MotionResponse(node=2), 0.0) is None
        assert (node.statistics.requests, node.path.waiting) == (0, 0)

    @pytest.mark.parametrize(
        ("argument", "value", "rule"),
        [
            ("number", 0, "1 to 16"),
            ("number", 17, "1 to 16"),
            ("number", True, "1 to 16"),
            ("capacity", 256, "0 to 255"),
            ("capacity", -1, "0 to 255"),
            ("capacity", 4.0, "0 to 255"),
            ("rate", -1.0, "0 or more words per second"),
            ("rate", float("nan"), "0 or more"),
            ("rate", float("inf"), "0 or more"),
            ("rate", "fast", "0 or more"),
            ("t1_delay", 25.6, "0 to 25.5 s"),
            ("t2_delay", -0.1, "0 to 25.5 s"),
            ("position_type", 256, "0 to 255"),
            ("version", (1, 256), "0 to 255"),
            ("version", (-1, 0), "0 to 255"),
            ("product_id", 0x10000, "0 to 65535"),
            ("serial_number", -1, "0 to 4294967295"),
            ("motor_seconds", float("inf"), "0 or more seconds"),
            ("unsupported", {"motoin"}, "unknown 'motoin'; known are clear_fifo"),
            ("unsupported", "motion.request", "unknown 'motion.request'"),
        ],
    )
    def test_wrong_arguments_are_named(self, argument: str, value: object, rule: str) -> None:
        with pytest.raises(ValueError, match=argument) as caught:
            VirtualNode(**{argument: value})  # type: ignore[arg-type]
        assert rule in str(caught.value)

    def test_the_ends_of_all_ranges_are_legal(self) -> None:
        node = VirtualNode(
            16,
            capacity=255,
            t1_delay=25.5,
            t2_delay=0,
            position_type=255,
            version=(255, 0),
            product_id=0xFFFF,
            serial_number=0xFFFF_FFFF,
        )
        assert ask(node, qlink.NodeInfoRequest(node=16)) is not None

    def test_one_name_is_a_set_of_one(self) -> None:
        assert VirtualNode(unsupported="read").unsupported == {"read"}

    def test_time_may_stumble_but_not_run_backwards(self) -> None:
        node = VirtualNode(rate=10, started=True)
        ask(node, qlink.MotionRequest(node=1, segments=[1] * 12), 100.0)
        node.advance(100.5)
        node.advance(100.4)
        assert (node.now, node.path.waiting) == (100.5, 7)
        node.set_inputs(1, 99.5)
        with pytest.raises(ValueError, match=r"now=99\.4 is before 100\.5; take all times"):
            node.advance(99.4)
        for wrong in (float("nan"), float("inf")):
            with pytest.raises(ValueError, match="must be a finite number of seconds"):
                node.advance(wrong)
        assert (node.now, node.path.waiting) == (100.5, 7)

    def test_two_nodes_share_nothing(self) -> None:
        one, other = VirtualNode(1, record=True), VirtualNode(2, record=True)
        ask(one, qlink.MotionRequest(node=1, outputs=1, segments=[1]))
        assert (other.outputs, other.path.waiting, other.statistics.motions) == (0, 0, 0)
        assert other.record is not None
        assert not other.record.words
