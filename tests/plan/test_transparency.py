"""Inserted bytes: where they are due, how many there may be, and how a cursor passes them."""

from __future__ import annotations

from qlinkgen.plan.coding import Insertion
from qlinkgen.plan.reading import Cursor
from qlinkgen.plan.transparency import FrameStuffing

ONE, TWO = Insertion(b"\xa5", 0x00), Insertion(b"\xa5\xa5", 0x00)


def test_only_stuffed_bytes_make_a_frame_longer() -> None:
    assert FrameStuffing(ONE, front=2, back=3).most_frame(10) == 10 + 5
    assert FrameStuffing(TWO, front=2, back=1).most_frame(11) == 11 + 4


def test_an_inserted_byte_is_not_the_first_of_the_next_sequence() -> None:
    assert [*Insertion(b"\x10", 0x10).places(b"\x10\x10\x41\x10\x10")] == [1, 4]


def test_a_cursor_passes_the_inserted_byte_of_the_first_byte() -> None:
    assert Cursor(b"\xa5\x00\x01", 0, ONE).take(2, stuffed=True) == b"\xa5\x01"


def test_an_inserted_byte_before_an_exempt_part_is_passed_once() -> None:
    cursor = Cursor(b"\xa5\x00\xa5\x01", 0, ONE)
    assert (cursor.take(1, stuffed=True), cursor.due) == (b"\xa5", True)
    assert (cursor.take(2, stuffed=False), cursor.due) == (b"\xa5\x01", False)
    assert cursor.inserted == [1]


def test_a_sequence_goes_on_in_the_next_stuffed_part_but_not_over_an_exempt_one() -> None:
    cursor = Cursor(b"\xa5\xa5\x00\xa5\x01\xa5\x02", 0, TWO)
    assert (cursor.take(1, stuffed=True), cursor.due) == (b"\xa5", False)
    assert (cursor.take(1, stuffed=True), cursor.due) == (b"\xa5", True)
    assert (cursor.take(1, stuffed=True), cursor.due) == (b"\xa5", False)
    assert cursor.take(1, stuffed=False) == b"\x01"
    assert (cursor.take(1, stuffed=True), cursor.due) == (b"\xa5", False)
