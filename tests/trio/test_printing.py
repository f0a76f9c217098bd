"""PRINT: its items, formats and characters; SEND: its arguments; the numbers of nodes."""

from __future__ import annotations

from decimal import Decimal
from fractions import Fraction
from typing import Any

import pytest

from qlinkgen.codecs import trio
from qlinkgen.protocols.trio import CHR, CURSOR, VALUE, CoordinatorNode
from qlinkgen.protocols.trio.coordinator_node import send_message
from qlinkgen.protocols.trio.facts import wire_address
from qlinkgen.protocols.trio.keypad_node import check_key
from qlinkgen.protocols.trio.printing import printed
from qlinkgen.protocols.trio.variables import KeyTable, Variables
from qlinkgen.sim.virtual_ring import VirtualRing


@pytest.mark.parametrize(
    ("value", "shown"),
    [
        (VALUE(150, 6, 0), "   150"),
        (VALUE(2.5, 8, 1), "     2.5"),
        (VALUE(1.5, decimals=2), "1.50"),
        (VALUE(-1.5, 6, 2), " -1.50"),
        (VALUE(123456.7, 6, 1), "******"),
        (VALUE(-0.001, 6, 1), "   0.0"),
        (VALUE(0.05, 4, 1), " 0.1"),
        (VALUE(Decimal("0.25"), 0, 1), "0.2"),
        (VALUE(Fraction(1, 3), 6, 3), " 0.333"),
        (VALUE(10**20, 0, 0), "1" + "0" * 20),
        (VALUE(7), "7.0000"),
    ],
)
def test_width_and_decimals(value: Any, shown: str) -> None:
    assert str(value) == shown


def test_items_follow_one_another_and_a_line_ends() -> None:
    assert printed(("A", 1.5, VALUE(2, 3, 0), CHR(7)), "", "\r\n") == "A1.5000  2\x07\r\n"
    assert printed(("A", "B"), "\t", "") == "A\tB"


def test_characters_and_cursor() -> None:
    assert CHR(27) + CHR(72) + CHR(28) == CURSOR(28) == "\x1bH\x1c"


@pytest.mark.parametrize(
    ("call", "error", "complaint"),
    [
        (lambda: CHR(128), ValueError, "CHR: 128 was given; the ring carries characters 0 to 127"),
        (lambda: CURSOR(-1), ValueError, "CURSOR: -1 was given"),
        (lambda: VALUE("1"), TypeError, "number: '1' was given"),  # type: ignore[arg-type]
        (lambda: VALUE(True), TypeError, "number: True was given"),
        (lambda: VALUE(float("nan")), ValueError, "number: nan was given"),
        (lambda: VALUE(float("inf")), ValueError, "number: inf was given"),
        (lambda: VALUE(1, 128), ValueError, "width: 128 was given"),
        (lambda: VALUE(1, 6, -1), ValueError, "decimals: -1 was given"),
        (lambda: printed(("Länge",), "", ""), ValueError, "'ä' was given"),
        (lambda: printed((None,), "", ""), TypeError, "number: None was given"),  # type: ignore[arg-type]
        (lambda: wire_address(9), ValueError, "n: 9 was given; nodes .* 10 .* to 24"),
        (lambda: wire_address(25), ValueError, "n: 25 was given"),
        (lambda: wire_address(10.0), ValueError, "n: 10.0 was given"),  # type: ignore[arg-type]
        (lambda: send_message(10, 3, 0, None), ValueError, r"type: 3 was given; SEND has 1 .* and 2"),
        (lambda: send_message(10, 1, 0, None), TypeError, "data2: None was given"),
        (lambda: send_message(10, 2, 9, None), ValueError, "data1: 9 was given"),
        (lambda: Variables()[251], IndexError, r"VR\(251\): .* VR\(0\) to VR\(250\)"),
        (lambda: Variables()[-1], IndexError, r"VR\(-1\)"),
        (lambda: KeyTable().define(127, 1, 2), ValueError, "key 127 and 2 values"),
        (lambda: KeyTable().define(1), ValueError, "key 1 and 0 values"),
        (lambda: check_key(64), ValueError, "key: 64 was given; keys have the numbers 0 to 63"),
        (lambda: check_key("A"), ValueError, "key: 'A' was given"),
    ],
)
def test_wrong_arguments(call: Any, error: type[Exception], complaint: str) -> None:
    with pytest.raises(error, match=complaint):
        call()


def test_a_wrong_item_sends_nothing() -> None:
    ring = VirtualRing("coordinator,coordinator")
    mc = ring.coordinator(0)
    with pytest.raises(ValueError, match="seven-bit"):
        mc.print_(10, "x" * 300, "ö")
    with pytest.raises(ValueError, match="n: 25"):
        mc.print_(25, "x")
    with pytest.raises(trio.EncodeError):
        mc.send(10, 1, 16384, 0)
    with pytest.raises(trio.EncodeError):
        mc.send(10, 1, 0, 2**31)
    with pytest.raises(ValueError, match="channel: 5 was given"):
        mc.get(5)
    with pytest.raises(ValueError, match="channel: 5 was given"):
        mc.key(5)
    ring.settle()
    assert mc.counters.sent == 0


@pytest.mark.parametrize("number", range(10, 25))
def test_numbers_10_to_24_are_addresses_1_to_15(number: int) -> None:
    assert wire_address(number) == number - 9
    message = send_message(number, 2, number, None)
    assert message == trio.KeypadOffset(address=number - 9, offset=number - 9)
    assert send_message(number, 2, number, 0) == message, "BASIC does not use data2 here"
    assert send_message(number, 1, 7, 0.5) == trio.DirectVariableTransfer(
        address=number - 9, number=7, value=Decimal("0.5")
    )


def test_variables_read_as_floats_and_keep_every_bit() -> None:
    node = CoordinatorNode()
    exact = Decimal(2**63 - 1) / Decimal(2**32)
    frame = trio.DirectVariableTransfer(
        address=1, number=0, value=Decimal(2**31) - Decimal(2) ** -32
    ).to_frame()
    node.link.receive(frame, 0.0)
    assert node.vr.exact(0) * 2**32 == 2**63 - 1
    assert node.vr[0] == float(exact)
    node.vr[1] = 0.1
    node.vr[1] += 0.1
    assert node.vr[1] == 0.2
    assert float(node.vr.exact(1)) == 0.2
    node.vr[2] = Fraction(1, 4)
    assert node.vr.exact(2) == Decimal("0.25")
    assert len(node.vr) == len(list(node.vr)) == 251
    with pytest.raises(TypeError, match=r"VR\(3\): 'x' was given"):
        node.vr[3] = "x"  # type: ignore[assignment]
