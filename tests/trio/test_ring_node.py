"""The engine of one node, byte by byte."""

from __future__ import annotations

from decimal import Decimal
from typing import Any

import pytest

from qlinkgen.codecs import trio
from qlinkgen.link.ring import PATIENCE, RingNode
from qlinkgen.link.ring_events import (
    Blocked,
    Broken,
    CommsError,
    NetStat,
    Passed,
    Queued,
    StatusRaised,
    Taken,
)

#: Terminates a message found broken after its head was forwarded: an end byte with the address 0.
CUT = b"\x80"


class Line:
    """A node with its received messages and sent bytes."""

    def __init__(self, **options: Any) -> None:
        self.taken: list[trio.Message] = []
        self.node = RingNode(trio, lambda message, _now: self.taken.append(message), **options)
        self.now = 0.0

    def hear(self, data: bytes, after: float = 0.0) -> bytes:
        """Pass bytes to the node; return the bytes that it sends then."""
        self.now += after
        self.node.receive(data, self.now)
        return self.sent()

    def sent(self, after: float = 0.0) -> bytes:
        self.now += after
        return self.node.bytes_to_send(self.now)

    def broken(self) -> list[Broken]:
        return [event for event in self.node.events if isinstance(event, Broken)]

    @property
    def faults(self) -> dict[str, int]:
        return self.node.counters.faults


def text(address: int, characters: str = "AB") -> bytes:
    return trio.CharacterTransfer(address=address, characters=characters).to_frame()


def variable(address: int, number: int = 5, value: int = 99) -> bytes:
    return trio.DirectVariableTransfer(address=address, number=number, value=Decimal(value)).to_frame()


def end(address: int) -> bytes:
    return bytes((0x80 | address << 3,))


# sending on


@pytest.mark.parametrize("address", range(2, 16))
@pytest.mark.parametrize("cut_through", [True, False])
@pytest.mark.parametrize("size", [1, 3, 1000])
def test_a_message_to_others_goes_on_with_the_address_one_lower(
    address: int, cut_through: bool, size: int
) -> None:
    line = Line(cut_through=cut_through)
    for frame, expected in (
        (text(address), text(address - 1)),
        (variable(address), variable(address - 1)),
    ):
        pieces = [line.hear(frame[at : at + size]) for at in range(0, len(frame), size)]
        assert b"".join(pieces) == expected
        if not cut_through:
            assert not any(pieces[:-1])
    assert line.taken == []
    assert line.node.counters.passed == 2
    assert line.node.counters.passed_bytes == len(text(1)) + len(variable(1))
    assert line.node.netstat == 0


def test_address_1_is_taken_and_not_sent_on() -> None:
    line = Line()
    assert line.hear(text(1) + variable(1)) == b""
    assert line.taken == [
        trio.CharacterTransfer(address=1, characters="AB"),
        trio.DirectVariableTransfer(address=1, number=5, value=Decimal(99)),
    ]
    assert line.node.counters.taken == 2


def test_cut_through_sends_a_byte_on_when_it_has_come() -> None:
    line = Line()
    assert [line.hear(bytes((byte,))) for byte in text(3)] == [bytes((byte,)) for byte in text(2)]


@pytest.mark.parametrize("kind", [5, 6, 7])
def test_an_unknown_type_goes_on_unchanged_but_for_the_address(kind: int) -> None:
    line = Line()
    header = bytes((0x80 | 2 << 3 | kind,))
    assert line.hear(header + b"\x01\x02" + end(2)) == bytes((0x80 | 1 << 3 | kind,)) + b"\x01\x02" + end(1)
    assert line.node.netstat == 0
    assert line.faults == {}


@pytest.mark.parametrize("kind", [5, 6, 7])
def test_an_unknown_type_to_this_node_is_dropped_with_a_frame_error(kind: int) -> None:
    line = Line()
    assert line.hear(bytes((0x88 | kind,)) + b"\x01" + end(1)) == b""
    assert line.taken == []
    assert line.node.netstat == NetStat.RX_FRAME
    assert line.faults == {"unknown": 1}


def test_what_stands_in_a_message_to_others_is_not_looked_at() -> None:
    line = Line()
    wrong = variable(4)[:-3] + b"\x01\x02" + end(4)
    assert line.hear(wrong) == variable(3)[:-3] + b"\x01\x02" + end(3)
    short = bytes((0x80 | 4 << 3 | 2,)) + b"\x01" + end(4)
    assert line.hear(short) == bytes((0x80 | 3 << 3 | 2,)) + b"\x01" + end(3)
    assert line.node.netstat == 0


# the priority of forwarded bytes


def test_own_messages_wait_for_the_end_of_what_is_sent_on() -> None:
    line = Line()
    assert line.hear(text(2)[:2]) == text(1)[:2]
    assert line.node.send(trio.CharacterTransfer(address=9, characters="me"), line.now)
    assert line.sent() == b""
    assert line.hear(text(2)[2:]) == text(1)[2:] + text(9, "me")


def test_what_is_sent_on_goes_first() -> None:
    line = Line()
    line.node.send(trio.CharacterTransfer(address=9, characters="me"), line.now)
    assert line.hear(text(2)) == text(1) + text(9, "me")


def test_on_a_paced_line_one_own_message_goes_at_a_time() -> None:
    line = Line(baud=1000)  # a byte takes 10 ms
    for name in "abc":
        assert line.node.send(trio.CharacterTransfer(address=9, characters=name), line.now)
    assert line.sent() == text(9, "a")
    assert line.sent(0.02) == b""
    assert line.node.next_timer() == pytest.approx(0.03)
    assert line.hear(text(2)[:1]) == text(1)[:1], "queued after the own message in the transmitter"
    assert line.sent(0.02) == b"", "a message is being sent on"
    assert line.hear(text(2)[1:]) == text(1)[1:]
    assert line.sent(0.02) == b"", "the transmitter is not free before 70 ms"
    assert line.sent(0.015) == text(9, "b")
    assert line.sent(0.030001) == text(9, "c")
    assert line.node.next_timer() is None


def test_what_is_sent_on_behind_an_own_message_keeps_the_transmitter_busy_for_longer() -> None:
    line = Line(baud=1000)
    for name in "ab":
        line.node.send(trio.CharacterTransfer(address=9, characters=name), line.now)
    assert line.sent() == text(9, "a")
    assert line.hear(text(2), after=0.01) == text(1), "30 ms are own bytes, 40 ms follow"
    assert line.node.next_timer() == pytest.approx(0.07)
    assert line.sent(0.05) == b""
    assert line.sent(0.011) == text(9, "b")


def test_a_message_is_given_up_while_own_ones_wait_for_the_transmitter() -> None:
    line = Line(baud=10)  # a byte takes 1 s
    for name in "ab":
        line.node.send(trio.CharacterTransfer(address=9, characters=name), line.now)
    assert line.sent() == text(9, "a")
    line.hear(text(1)[:2])
    assert line.node.next_timer() == PATIENCE
    assert line.sent(PATIENCE) == b""
    assert line.faults == {"truncated": 1}
    assert line.node.next_timer() == pytest.approx(3.0)


def test_the_transmit_buffer_has_an_end() -> None:
    line = Line(room=300)
    line.hear(text(2)[:1])
    long = trio.CharacterTransfer(address=9, characters="x" * 256)
    assert line.node.send(long, line.now)
    assert not line.node.send(long, line.now)
    line.node.refuse(line.now)
    assert line.node.netstat == NetStat.TX_TIMEOUT
    assert line.node.counters.refused == 1
    line.hear(text(2)[1:])
    assert line.node.send(long, line.now)


@pytest.mark.parametrize(
    ("options", "complaint"),
    [
        ({"baud": 0}, "baud must be bits per second"),
        ({"patience": 0.0}, "patience must be above 0 s and finite, not 0.0"),
        ({"patience": float("inf")}, "patience must be above 0 s and finite, not inf"),
        ({"room": 259}, "room must be 260 or more, the longest message, not 259"),
    ],
)
def test_wrong_arguments(options: dict[str, Any], complaint: str) -> None:
    with pytest.raises(ValueError, match=complaint):
        Line(**options)


# faults (settled question 6)

FAULTS = {
    "header with address 0": (b"\x81A\x80", "a header with address 0"),
    "end byte with another address": (text(1)[:-1] + end(2), "another address than the header"),
    "end byte with address 0": (text(1)[:-1] + end(0), "another address than the header"),
    "no payload": (b"\x89\x88", ""),
    "offset of 2 bytes": (b"\x8b\x01\x01\x88", ""),
    "variable too short": (variable(1)[:5] + end(1), ""),
    "variable too long": (variable(1)[:-1] + b"\x00" + end(1), ""),
    "payload outside a message": (b"ABC", "payload bytes outside a message"),
    "end byte outside a message": (end(1), "an end byte outside a message"),
    "longer than any message": (b"\x89" + b"A" * 259, "more than 258 bytes"),
}


@pytest.mark.parametrize("size", [1, 1000])
@pytest.mark.parametrize("name", FAULTS)
def test_a_frame_error_is_told_once_and_the_next_message_is_taken(name: str, size: int) -> None:
    line = Line()
    data, reason = FAULTS[name]
    for at in range(0, len(data), size):
        assert line.hear(data[at : at + size]) == b""
    assert line.faults == {"frame": 1}
    assert line.node.netstat == NetStat.RX_FRAME
    assert [reason in event.text for event in line.broken()] == [True]
    assert not line.broken()[0].cut_short
    assert line.taken == []
    line.hear(text(1))
    assert len(line.taken) == 1
    assert line.faults == {"frame": 1}


def test_a_header_inside_a_message_begins_a_new_one() -> None:
    line = Line()
    line.hear(text(1)[:-1] + text(1, "new"))
    assert line.faults == {"frame": 1}
    assert line.taken == [trio.CharacterTransfer(address=1, characters="new")]
    assert line.broken()[0].raw == text(1)[:-1]


def test_bytes_behind_a_fault_are_skipped_and_counted() -> None:
    line = Line()
    line.hear(b"ABC")
    line.hear(b"DE" + end(1) + b"F")
    assert line.faults == {"frame": 1}
    assert line.node.counters.skipped == 4
    line.hear(text(1))
    assert len(line.taken) == 1


def test_a_wrong_checksum_is_a_crc_error() -> None:
    line = Line()
    frame = bytearray(variable(1))
    frame[3] ^= 0x04
    line.hear(bytes(frame))
    assert line.taken == []
    assert line.node.netstat == NetStat.RX_CRC
    assert line.faults == {"crc": 1}


def test_a_value_out_of_range_is_a_frame_error() -> None:
    line = Line()
    line.hear(b"\x8b\x00\x88")  # an offset of 0
    assert line.node.netstat == NetStat.RX_FRAME
    assert line.faults == {"range": 1}


def test_a_message_that_does_not_go_on_is_given_up() -> None:
    line = Line()
    line.hear(text(1)[:2])
    assert line.node.next_timer() == PATIENCE
    line.node.handle_timer(PATIENCE - 0.001)
    assert line.faults == {}
    line.node.handle_timer(PATIENCE)
    assert line.faults == {"truncated": 1}
    assert line.node.netstat == NetStat.RX_FRAME
    assert line.node.commserror == CommsError.RX_STRUCTURE
    assert line.node.next_timer() is None
    line.hear(b"CD" + end(1))
    assert line.faults == {"truncated": 1}
    assert line.node.counters.skipped == 3


def test_bytes_that_come_late_are_not_given_up_where_nobody_looked() -> None:
    line = Line()
    line.hear(text(1)[:2])
    line.hear(text(1)[2:], after=10 * PATIENCE)
    assert len(line.taken) == 1


# broken messages whose head has been sent on

CUT_SHORT = {
    "end byte with another address": (text(4)[:-1] + end(3), text(3)[:-1] + CUT, "another address"),
    "end byte that cuts it short already": (text(4)[:-1] + CUT, text(3)[:-1] + CUT, "another address"),
    "end byte with the lower address": (text(2)[:-1] + end(1), text(1)[:-1] + CUT, "another address"),
    "header of a message to this node": (text(4)[:2] + text(1), text(3)[:2] + CUT, "a new message"),
    "header of another message": (text(4)[:2] + text(5, "C"), text(3)[:2] + CUT + text(4, "C"), "a new"),
    "too long": (text(4, "A" * 256)[:-1] + b"AAA", text(3, "A" * 256)[:-1] + b"AA" + CUT, "more than"),
}


@pytest.mark.parametrize("name", CUT_SHORT)
def test_cut_through_ends_a_broken_message_for_the_nodes_behind(name: str) -> None:
    data, expected, reason = CUT_SHORT[name]
    line = Line()
    assert b"".join(line.hear(data[at : at + 1]) for at in range(len(data))) == expected
    assert line.faults == {"frame": 1}
    assert line.node.netstat == NetStat.RX_FRAME
    assert line.node.commserror == CommsError.RX_STRUCTURE | CommsError.TX_STRUCTURE
    assert line.node.counters.cut_short == 1
    assert [(event.cut_short, reason in event.text) for event in line.broken()] == [(True, True)]


@pytest.mark.parametrize("name", CUT_SHORT)
def test_the_node_behind_drops_it_and_tells_a_frame_error_too(name: str) -> None:
    line = Line()
    behind = Line()
    receiver = Line()
    for byte in CUT_SHORT[name][0]:
        receiver.hear(behind.hear(line.hear(bytes((byte,)))))
    assert behind.faults == {"frame": 1}
    whole = [message for message in receiver.taken if isinstance(message, trio.CharacterTransfer)]
    assert not any("AB" in message.characters for message in whole)


@pytest.mark.parametrize("name", CUT_SHORT)
def test_store_and_forward_sends_nothing_on_that_is_broken(name: str) -> None:
    data, _, _ = CUT_SHORT[name]
    line = Line(cut_through=False)
    sent = b"".join(line.hear(data[at : at + 1]) for at in range(len(data)))
    assert sent in {b"", text(4, "C")}
    assert line.faults == {"frame": 1}
    assert line.node.counters.cut_short == 0


def test_silence_frees_the_transmitter() -> None:
    line = Line()
    assert line.hear(text(4)[:2]) == text(3)[:2]
    line.node.send(trio.CharacterTransfer(address=9, characters="me"), line.now)
    assert line.sent() == b""
    assert line.node.next_timer() == PATIENCE
    assert line.sent(PATIENCE) == CUT + text(9, "me")
    assert line.faults == {"truncated": 1}
    assert line.node.counters.cut_short == 1


def test_an_own_message_behind_a_broken_one_is_in_order_for_the_node_behind() -> None:
    line, behind = Line(), Line()
    behind.hear(line.hear(text(4)[:2] + text(1)))
    line.node.send(trio.CharacterTransfer(address=1, characters="me"), line.now)
    behind.hear(line.sent())
    assert behind.taken == [trio.CharacterTransfer(address=1, characters="me")]


# nodes that pass nothing


def test_a_node_that_passes_nothing_counts_what_it_drops() -> None:
    line = Line()
    line.node.passes = False
    assert line.hear(text(2) + text(1) + text(3)) == b""
    assert len(line.taken) == 1
    assert line.node.counters.blocked == 2
    assert [event.header for event in line.node.events if isinstance(event, Blocked)] == [0x91, 0x99]
    assert line.node.netstat == 0


# events and counters


def test_a_verbose_node_tells_of_each_message() -> None:
    line = Line()
    line.node.verbose = True
    message = trio.CharacterTransfer(address=2, characters="me")
    line.node.send(message, 1.0)
    line.now = 2.0
    line.hear(text(1) + text(5))
    assert list(line.node.events) == [
        Queued(1.0, message),
        Taken(2.0, trio.CharacterTransfer(address=1, characters="AB"), text(1)),
        Passed(2.0, text(5)),
    ]


def test_a_status_bit_is_told_when_it_is_set() -> None:
    line = Line()
    line.hear(b"A" + text(1) + b"B")
    raised = [event for event in line.node.events if isinstance(event, StatusRaised)]
    assert raised == [StatusRaised(0.0, NetStat.RX_FRAME)]
    line.node.netstat = NetStat(0)
    line.hear(text(1) + b"C")
    assert line.node.netstat == NetStat.RX_FRAME


def test_the_status_bits_are_those_of_the_document() -> None:
    assert [(bit.name, bit.value) for bit in NetStat] == [
        ("TX_TIMEOUT", 1),
        ("TX_BUFFER", 2),
        ("RX_CRC", 4),
        ("RX_FRAME", 8),
    ]


def test_counters_show_what_was_seen() -> None:
    line = Line()
    line.hear(b"A" + text(1) + text(2))
    assert repr(line.node.counters) == "RingCounters(faults={'frame': 1}, passed=1, passed_bytes=4, taken=1)"
    assert line.node.counters.as_dict()["taken"] == 1
    assert line.node.counters.total_faults == 1


def test_a_reset_forgets_what_is_under_way() -> None:
    line = Line()
    line.hear(text(4)[:2])
    line.node.send(trio.CharacterTransfer(address=9, characters="me"), line.now)
    line.node.reset()
    assert line.node.idle
    assert line.sent() == b""
    assert line.hear(text(2)) == text(1)
