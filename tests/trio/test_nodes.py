"""The behaviours without input or output: stored and dropped messages, counters, events."""

from __future__ import annotations

from decimal import Decimal
from pathlib import Path

import pytest

from qlinkgen.bus.ring_status import engine_of
from qlinkgen.codecs import trio
from qlinkgen.link.ring_events import CommsError, Dropped
from qlinkgen.protocols.trio import CoordinatorNode, KeypadNode, MotionCoordinator
from qlinkgen.transport import open_pty


def hear(node: CoordinatorNode | KeypadNode, *messages: trio.Message, now: float = 0.0) -> list[str]:
    """Pass messages to a node; return its texts about dropped ones."""
    for message in messages:
        node.link.receive(message.to_frame(), now)
    return [event.text for event in engine_of(node).events if isinstance(event, Dropped)]


def test_what_a_full_buffer_drops_is_told() -> None:
    node = CoordinatorNode()
    text = trio.CharacterTransfer(address=1, characters="x" * 200)
    assert hear(node, text) == []
    assert hear(node, text) == ["the receive buffer is full: the last 144 of its characters are lost"]
    assert len(node.received) == 256
    assert hear(node, text)[-1:] == ["the receive buffer is full: the last 200 of its characters are lost"]
    assert node.counters.characters_lost == 344
    assert node.link.commserror == CommsError.RX_BUFFER
    assert [event.at for event in node.link.events if isinstance(event, Dropped)] == [0.0, 0.0]


def test_what_a_missing_variable_drops_is_told() -> None:
    node = CoordinatorNode()
    message = trio.DirectVariableTransfer(address=1, number=300, value=Decimal(1))
    assert hear(node, message) == ["VR(300) does not exist; the last one is VR(250)"]


def test_a_wrong_checksum_leaves_the_variable_as_it_was() -> None:
    node = CoordinatorNode()
    node.vr[5] = 7.5
    frame = bytearray(trio.DirectVariableTransfer(address=1, number=5, value=Decimal(99)).to_frame())
    for place in range(1, 15):
        for bit in range(7):
            frame[place] ^= 1 << bit
            node.link.netstat = type(node.link.netstat)(0)
            node.link.receive(bytes(frame), 0.0)
            assert node.link.netstat == 4, (place, bit)
            assert node.vr[5] == 7.5
            frame[place] ^= 1 << bit
    assert node.link.counters.faults == {"crc": 14 * 7}
    assert node.link.commserror == 0, "the structure of the message is right"


def test_a_coordinator_that_is_switched_off_keeps_its_variables() -> None:
    node = CoordinatorNode()
    hear(node, trio.CharacterTransfer(address=1, characters="x"))
    node.vr[1] = 1
    node.reset()
    assert node.take(4) is None
    assert node.vr[1] == 1


def test_a_keypad_without_an_offset_takes_nothing_but_that() -> None:
    node = KeypadNode()
    early = trio.CharacterTransfer(address=1, characters="x")
    assert (
        hear(node, early, trio.KeypadMode(address=1, mode=127))
        == ["the keypad has no offset yet: send it first (SEND, type 2)"] * 2
    )
    assert (node.mode, node.display.lines[0]) == (0, "")
    assert hear(node, trio.KeypadOffset(address=1, offset=15), early)[2:] == []
    assert (node.offset, node.display.lines[0]) == (15, "x")


@pytest.mark.parametrize("mode", [1, 64, 126])
def test_a_mode_that_there_is_not_is_ignored(mode: int) -> None:
    node = KeypadNode()
    hear(node, trio.KeypadOffset(address=1, offset=1), trio.KeypadMode(address=1, mode=127))
    hear(node, trio.KeypadMode(address=1, mode=mode))
    assert node.mode == trio.KeypadModeEnum.ON_OFF
    assert node.counters.ignored == 1


def test_a_key_goes_as_many_nodes_on_as_the_offset_says() -> None:
    node = KeypadNode()
    hear(node, trio.KeypadOffset(address=1, offset=7))
    assert node.press("5", 0.0)
    assert not node.release("5", 0.0)
    assert node.link.bytes_to_send(0.0) == trio.CharacterTransfer(address=7, characters="5").to_frame()


def test_a_keypad_has_the_size_that_it_is_given() -> None:
    assert len(KeypadNode(rows=2, columns=16).display.lines) == 2


def test_counters_show_what_was_dropped() -> None:
    assert (
        repr(CoordinatorNode().counters)
        == "CoordinatorCounters(characters_lost=0, ignored=0, variables_lost=0)"
    )
    assert repr(KeypadNode().counters).startswith("KeypadCounters(early_keys=0")


def test_a_port_is_closed_where_the_node_can_not_be_made() -> None:
    with open_pty() as port:
        before = len(list(Path("/proc/self/fd").iterdir()))
        with pytest.raises(ValueError, match="patience"):
            MotionCoordinator.open(port.path, patience=0)
        assert len(list(Path("/proc/self/fd").iterdir())) == before
