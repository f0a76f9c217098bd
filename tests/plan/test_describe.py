"""The words for parts and steps, each case of each function."""

from __future__ import annotations

from dataclasses import replace
from fractions import Fraction
from pathlib import Path

import pytest

from qlinkgen.model.integer import Chunk, Integer, byte_chunks, group_chunks
from qlinkgen.model.types import Enum, Flags, NamedValue, Reserved, Scalar, Scaling
from qlinkgen.plan import Plan, describe, plan_of
from qlinkgen.plan.expr import Clear, OneOf, Size, Term, Within
from qlinkgen.plan.payload import CountStep
from qlinkgen.schema.loader import load

_ROOT = Path(__file__).resolve().parents[2]


def _plan(path: str) -> Plan:
    return plan_of(load(_ROOT / path))


def _scalar(
    bits: int = 16, meaning: Enum | Flags | None = None, scaling: Scaling | None = None, unit: str = ""
) -> Scalar:
    return Scalar(
        bits=bits,
        chunks=byte_chunks(bits // 8, "big"),
        minimum=0,
        maximum=(1 << bits) - 1,
        scaling=scaling,
        meaning=meaning,
        unit=unit,
    )


def test_spans_and_numbers_of_bytes() -> None:
    assert [describe.span_text(*each) for each in ((1, 1), (0, 2))] == ["1", "0..2"]
    counts = [(1, 1), (0, 0), (0, 1), (2, 2), (1, 2)]
    texts = ["1 byte", "0 bytes", "0..1 bytes", "2 bytes", "1..2 bytes"]
    assert [describe.bytes_text(*each) for each in counts] == texts


@pytest.mark.parametrize(
    ("scale", "offset", "text"),
    [
        ("1/10", "0", "1/10"),
        ("1/128", "0", "1/128"),
        ("1/256", "0", "1/2^8"),
        ("3/65536", "0", "3/2^16"),
        ("1/257", "0", "1/257"),
        ("1/300", "0", "1/300"),
        ("5", "-40", "5, from -40"),
        ("1/512", "1/2", "1/2^9, from 1/2"),
    ],
)
def test_a_scale_is_a_power_of_two_where_that_is_shorter(scale: str, offset: str, text: str) -> None:
    assert describe.scale_text(_scalar(scaling=Scaling(Fraction(scale), Fraction(offset)))) == text


def test_a_number_without_a_scale_has_none() -> None:
    assert describe.scale_text(_scalar()) == ""


def test_values_have_their_names_and_units() -> None:
    mode = Enum("mode", 8, (NamedValue("slow", 1), NamedValue("fast", 4)))
    bits = Flags("bits", 16, (NamedValue("ready", 0), NamedValue("hot", 9)))
    tenth = Scaling(Fraction(1, 10))
    assert [describe.value_text(_scalar(8, mode), raw) for raw in (4, 0)] == ["fast (4)", "no name (0)"]
    texts = ["0x0201 (ready | hot)", "0x0001 (ready)", "0x0000 (none set)", "0x0004 (none set)"]
    assert [describe.value_text(_scalar(16, bits), raw) for raw in (0x201, 1, 0, 4)] == texts
    assert describe.value_text(_scalar(unit="mm"), 7) == "7 mm"
    assert describe.value_text(_scalar(scaling=tenth, unit="V"), 7) == "0.7 V (raw 7)"
    assert describe.value_text(_scalar(scaling=tenth), 10) == "1 (raw 10)"


def test_ranges_are_told_where_names_do_not_tell_them() -> None:
    mode = Enum("mode", 8, (NamedValue("slow", 1),))
    part = Scalar(bits=8, chunks=byte_chunks(1, "big"), minimum=1, maximum=4, meaning=mode)
    none = Scalar(bits=8, chunks=byte_chunks(1, "big"), minimum=0, maximum=255, role=Reserved())
    texts = ["", "1..4", "0..255", "reserved"]
    assert [describe.range_text(each) for each in (_scalar(8, mode), part, _scalar(8), none)] == texts


@pytest.mark.parametrize(
    ("integer", "text"),
    [
        (Integer(8, signed=False, chunks=byte_chunks(1, "big")), "u8"),
        (Integer(3, signed=True, chunks=()), "i3"),
        (Integer(16, signed=False, chunks=byte_chunks(2, "big")), "u16 big"),
        (Integer(32, signed=True, chunks=byte_chunks(4, "little")), "i32 little"),
        (
            Integer(14, signed=False, chunks=group_chunks(((0, 13),), 7, least_first=False)),
            "u14 in groups: bits 7-13 0-6",
        ),
        (Integer(11, signed=False, chunks=(Chunk(4, 7), Chunk(0, 4))), "u11 in groups: bits 4-10 0-3"),
    ],
)
def test_integers(integer: Integer, text: str) -> None:
    assert describe.integer_text(integer) == text


@pytest.mark.parametrize(
    ("size", "text"),
    [
        (Size(), "0"),
        (Size(4), "4"),
        (Size(0, (Term("a", 1),)), "a"),
        (Size(3, (Term("a", 2), Term("b", 1))), "3 + 2*a + b"),
    ],
)
def test_sizes(size: Size, text: str) -> None:
    assert describe.size_text(size) == text


def test_conditions() -> None:
    assert describe.condition_text(Within(1, 1)) == "1"
    assert describe.condition_text(Clear(0xF0)) == "bits 0xF0 clear"
    assert describe.condition_text(OneOf((Within(0, 0), Within(2, 9)))) == "0 or 2..9"


def test_how_runs_are_sized() -> None:
    found = {
        describe.sizing_text(each)
        for path in ("tests/schemas/kitchen_sink.yaml", "tests/schemas/modbus_rtu.yaml", "schemas/trio.yaml")
        for message in _plan(path).messages
        for each in message.payload.sizing
    }
    assert found == {
        "blob: blob_size; blob_size is 2..10",
        "characters: payload size, 1..256",
        "longs: total / 4; total is 0..20",
        "name: name_size; name_size is 0..16",
        "note: payload size, 0..40",
        "registers: byte_count / 2, which must agree",
        "registers: byte_count / 2; byte_count is 2..250",
        "registers: quantity; quantity is 1..123",
        "row: (payload size - 13) / 2, 0..6",
        "samples: (payload size - 4) / 3, 0..20",
        "text: payload size - 2, 0..20",
        "words: word_count; word_count is 0..8",
    }


def test_a_count_is_of_items_or_of_bytes() -> None:
    steps = [
        step
        for message in _plan("tests/schemas/kitchen_sink.yaml").messages
        for step in message.payload.steps
    ]
    counts = [step for step in steps if isinstance(step, CountStep)]
    held = ["items of words", "items of name", "items of blob", "bytes of longs"]
    assert [describe.holds_text(each) for each in counts] == held
    limits = ["0..8", "0..16", "2..10", "0..20"]
    must = [f"{what}, {limit}" for what, limit in zip(held, limits, strict=True)]
    assert [describe.must_text(each) for each in counts] == must


_FRAMES = {
    "schemas/qlink.yaml": (
        [
            "A5 A5",
            "payload bytes + 4, 4..30",
            "message id",
            "address",
            "the message's fields",
            "crc-16/ibm-3740 over length, command, node, data",
        ],
        "the payload has length - 4 bytes",
        "a byte 00 is inserted after every A5, after the checksum is computed; not in preamble",
        "hunt",
        "0x05",
    ),
    "schemas/trio.yaml": (
        [
            "0x80, address, type",
            "the message's fields",
            "crc-16/ibm-3740 over payload; bits 0..6, 8..14 are sent",
            "0x80, address, 0 in place of type",
        ],
        "the next byte with bit 0x80 set",
        "no byte between header and end has bit 0x80 set",
        "marks",
        "5",
    ),
    "schemas/mc1231a.yaml": (
        ["the message's fields", "sum16 of command and every 2-byte word, written or read"],
        "the size follows from the message and the counts in its payload",
        "bytes are sent as they are",
        "in step",
        "0x05",
    ),
    "tests/schemas/dynamixel.yaml": (
        [
            "FF FF FD 00",
            "address",
            "payload bytes + 3, 3..344",
            "message id",
            "the message's fields",
            "crc-16/umts over header, id, length, instruction, parameters",
        ],
        "the payload has length - 3 bytes",
        "a byte FD is inserted after every FF FF FD in parameters, before length and checksum are computed",
        "rescan",
        "0x05",
    ),
}


@pytest.mark.parametrize(
    ("word", "text"), [(1, "every byte"), (2, "every 2-byte word"), (4, "every 4-byte word")]
)
def test_a_sum_of_a_packet_is_of_bytes_or_of_words(word: int, text: str) -> None:
    frame = _plan("schemas/mc1231a.yaml").frame
    assert frame.check
    sent = describe.check_text(replace(frame.check, word=word), frame)
    assert sent == f"sum16 of command and {text}, written or read"


@pytest.mark.parametrize("path", _FRAMES)
def test_frames(path: str) -> None:
    frame = _plan(path).frame
    parts = [describe.part_text(part, frame) for part in frame.envelope.parts]
    assert (
        parts,
        describe.end_text(frame),
        describe.transparency_text(frame),
        describe.receiver_text(frame)[0],
        describe.id_text(frame, 5),
    ) == _FRAMES[path]


@pytest.mark.parametrize(
    ("path", "why"),
    [
        ("tests/schemas/modbus_rtu.yaml", "frames do not begin with a constant"),
        ("tests/schemas/dynamixel.yaml", "FF FF FD 00 may also be data"),
    ],
)
def test_why_frames_are_searched_for(path: str, why: str) -> None:
    text = describe.receiver_text(_plan(path).frame)[1]
    assert text.startswith(f"{why}, so after a failure the search continues at the next byte; ")
