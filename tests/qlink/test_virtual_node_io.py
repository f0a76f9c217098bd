"""Inputs, outputs and delays of the virtual node (sections 7.1, 7.10 and 7.14 to 7.18)."""

from __future__ import annotations

import pytest

from qlinkgen.codecs import qlink
from qlinkgen.protocols.qlink.io_image import IoImage
from qlinkgen.protocols.qlink.virtual_node import VirtualNode


def ask(node: VirtualNode, request: qlink.Message, now: float = 0.0) -> qlink.Message | None:
    response = node.handle(qlink.decode_request(request.to_frame()), now)
    return None if response is None else qlink.decode_response(response.to_frame())


class TestInputsAndOutputs:
    """Sections 7.14 to 7.18."""

    def test_reading_is_of_inputs_least_significant_byte_first(self) -> None:
        node = VirtualNode()
        node.set_inputs(0x030201, 0.0)
        node.outputs = 0xFFFFFF
        read = ask(node, qlink.ReadRequest(node=1, size=2, offset=1))
        assert read == qlink.ReadResponse(node=1, data=b"\x02\x03")

    @pytest.mark.parametrize(
        ("size", "offset", "data"),
        [(26, 0, b"\x01\x02\x03" + bytes(23)), (3, 2, b"\x03\0\0"), (4, 3, bytes(4)), (1, 255, b"\0")],
    )
    def test_bytes_that_are_not_there_read_as_0(self, size: int, offset: int, data: bytes) -> None:
        node = VirtualNode()
        node.set_inputs(0x030201, 0.0)
        read = ask(node, qlink.ReadRequest(node=1, size=size, offset=offset))
        assert read == qlink.ReadResponse(node=1, data=data)

    @pytest.mark.parametrize(
        ("offset", "data", "outputs"),
        [
            (0, b"\x01\x02\x03", 0x030201),
            (1, b"\x55", 0xFF55FF),
            (2, b"\x77\x88", 0x77FFFF),
            (3, b"\0", 0xFFFFFF),
            (255, bytes(25), 0xFFFFFF),
            (0, bytes(25), 0),
        ],
    )
    def test_writing_past_the_outputs_is_ignored(self, offset: int, data: bytes, outputs: int) -> None:
        node = VirtualNode()
        node.outputs = 0xFFFFFF
        answer = ask(node, qlink.WriteRequest(node=1, offset=offset, data=data))
        assert answer == qlink.WriteResponse(node=1)
        assert node.outputs == outputs
        assert node.inputs == 0

    def test_write_read_takes_all_outputs_and_gives_all_inputs(self) -> None:
        node = VirtualNode()
        node.set_inputs(0xABCDEF, 0.0)
        answer = ask(node, qlink.WriteReadRequest(node=1, outputs=0x123456))
        assert answer == qlink.WriteReadResponse(node=1, inputs=0xABCDEF)
        assert node.outputs == 0x123456

    def test_masks_set_and_clear(self) -> None:
        node = VirtualNode()
        assert ask(node, qlink.SetOutputsRequest(node=1, mask=0x8000FF)) == qlink.SetOutputsResponse(node=1)
        ask(node, qlink.SetOutputsRequest(node=1, mask=0x000100))
        assert node.outputs == 0x8001FF
        cleared = ask(node, qlink.ClearOutputsRequest(node=1, mask=0x80000F))
        assert cleared == qlink.ClearOutputsResponse(node=1)
        assert node.outputs == 0x0001F0

    def test_a_motion_has_the_first_eight(self) -> None:
        node = VirtualNode()
        node.outputs = 0xABCDEF
        node.set_inputs(0x1234A5, 0.0)
        answer = ask(node, qlink.MotionRequest(node=1, outputs=0x5A))
        assert isinstance(answer, qlink.MotionResponse)
        assert (node.outputs, answer.inputs) == (0xABCD5A, 0xA5)

    @pytest.mark.parametrize("value", [-1, 1 << 24, 1.0, True, "1", None])
    def test_levels_out_of_range_are_refused(self, value: int) -> None:
        node = VirtualNode()
        with pytest.raises(ValueError, match=r"inputs=.* must be an integer from 0 to 16777215"):
            node.set_inputs(value, 0.0)
        with pytest.raises(ValueError, match=r"outputs=.* must be an integer from 0 to 16777215"):
            node.outputs = value
        with pytest.raises(ValueError, match="inputs="):
            VirtualNode().inputs = value


class TestDelays:
    """T1 and T2 of section 7.1: from input 1 to output 1."""

    def node(self) -> VirtualNode:
        node = VirtualNode(t1_delay=2.0, t2_delay=0.5)
        node.advance(10.0)
        return node

    def outputs_at(self, node: VirtualNode, now: float) -> int:
        node.advance(now)
        return node.outputs

    def test_output_1_follows_input_1(self) -> None:
        node = self.node()
        node.set_inputs(1, 10.0)
        assert self.outputs_at(node, 11.9) == 0
        assert self.outputs_at(node, 12.0) == 1
        node.set_inputs(0, 20.0)
        assert self.outputs_at(node, 20.4) == 1
        assert self.outputs_at(node, 20.5) == 0

    def test_a_pulse_shorter_than_its_delay_is_not_seen(self) -> None:
        node = self.node()
        node.set_inputs(1, 10.0)
        node.set_inputs(0, 11.0)
        assert [self.outputs_at(node, now) for now in (11.2, 12.0, 15.0)] == [0, 0, 0]

    def test_an_image_alone_keeps_its_own_time(self) -> None:
        image = IoImage()
        image.set_inputs(1, 0.0, 1.0, 9.0)
        image.set_inputs(0, 2.0, 1.0, 9.0)
        assert image.outputs == 1

    def test_two_edges_at_once_leave_the_last(self) -> None:
        node = self.node()
        node.set_inputs(1, 11.0)
        node.set_inputs(0, 11.0)
        node.set_inputs(1, 11.0)
        assert self.outputs_at(node, 13.0) == 1

    def test_a_change_due_in_between_is_not_lost(self) -> None:
        node = self.node()
        node.set_inputs(1, 10.0)
        node.set_inputs(0, 12.1)
        assert node.outputs == 1
        assert self.outputs_at(node, 12.6) == 0

    def test_other_inputs_are_no_edge_and_no_delay_is_at_once(self) -> None:
        node = VirtualNode(t1_delay=0.0)
        node.set_inputs(0xFFFFFE, 0.0)
        assert self.outputs_at(node, 99.0) == 0
        node.set_inputs(0xFFFFFF, 99.0)
        assert node.outputs == 1

    def test_the_delay_of_the_edge_holds(self) -> None:
        node = self.node()
        node.set_inputs(1, 10.0)
        ask(node, qlink.NodeSetupRequest(node=1, t1_delay=25.5), 10.1)
        assert self.outputs_at(node, 12.0) == 1

    def test_a_master_writes_output_1_too(self) -> None:
        node = self.node()
        node.set_inputs(1, 10.0)
        ask(node, qlink.SetOutputsRequest(node=1, mask=3), 10.5)
        ask(node, qlink.ClearOutputsRequest(node=1, mask=1), 11.0)
        assert node.outputs == 2
        assert self.outputs_at(node, 12.0) == 3, "the change on its way comes all the same"
        ask(node, qlink.ClearOutputsRequest(node=1, mask=1), 12.5)
        assert self.outputs_at(node, 13.0) == 2, "but once"

    def test_the_answer_at_the_moment_already_shows_it(self) -> None:
        node = self.node()
        node.set_inputs(1, 10.0)
        ask(node, qlink.LoopBackRequest(node=1, data=b"x"), 12.0)
        assert node.outputs == 1

    def test_a_reset_calls_a_change_off(self) -> None:
        node = self.node()
        node.set_inputs(1, 10.0)
        ask(node, qlink.NodeResetRequest(node=1), 10.5)
        assert self.outputs_at(node, 20.0) == 0

    def test_levels_at_power_up_are_no_edge(self) -> None:
        node = VirtualNode(t1_delay=0.0, t2_delay=0.0)
        for value in (0, 0xFFFFFF, 1):
            node.inputs = value
            assert node.inputs == value
        assert self.outputs_at(node, 5.0) == 0
        node.inputs = 0
        node.inputs = 1
        assert (node.outputs, node.now) == (1, 5.0)
