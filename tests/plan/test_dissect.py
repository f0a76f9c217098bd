"""Every byte of a frame belongs to one span, and faults agree with the decoder."""

from __future__ import annotations

import random
from pathlib import Path

import pytest

from qlinkgen.model.message import Direction
from qlinkgen.plan import Plan
from qlinkgen.plan.codec import Codec
from qlinkgen.plan.dissect import dissect
from qlinkgen.plan.ends import ByLength, ByMark, ByTerminator
from qlinkgen.plan.parts import AddressPart, CheckPart, ConstantPart, IdPart, LengthPart, MarkPart
from qlinkgen.plan.payload import Member
from qlinkgen.plan.reading import BadFrame
from qlinkgen.plan.spans import Around, Dissection, Fault, Owner, Rule
from tests.plan.shapes import cases, frames
from tests.plan.shapes import plan as plan_at

_MUTANTS = 150
_QLINK, _TRIO = (
    Path(__file__).resolve().parents[2] / "schemas" / f"{name}.yaml" for name in ("qlink", "trio")
)


def _mutant(wire: bytes, others: list[tuple[bytes, bytes]], chance: random.Random) -> bytes:
    frame = bytearray(wire)
    for _ in range(chance.randint(0, 2)):
        at = chance.randrange(len(frame) + 1)
        match chance.randrange(7):
            case 0 if at < len(frame):
                frame[at] ^= 1 << chance.randrange(8)
            case 1:
                del frame[at : at + chance.randint(1, 3)]
            case 2:
                del frame[at:]
            case 3:
                frame[at:at] = chance.choice((chance.randbytes(2), wire[:1], wire[:2], b"\x00"))
            case 4:
                frame += chance.choice((b"\x00", chance.randbytes(3), chance.choice(others)[0]))
            case 5 if at < len(frame):
                frame[at] = chance.choice((*wire, 0, 0x7F, 0xFF))
            case _:
                frame[:0] = chance.choice((b"", wire[:1], chance.randbytes(1)))
    return bytes(frame)


def _kind(plan: Plan, wire: bytes, direction: Direction, request: bytes) -> str:
    try:
        Codec(plan).decode(wire, direction, request)
    except BadFrame as bad:
        return bad.kind
    return ""


def _check(found: Dissection, kind: str) -> None:
    what = (found.wire.hex(), found.faults)
    assert found.kind == kind, what
    assert [fault.kind for fault in found.faults[:1]] == ([kind] if kind else []), what
    own = [span for span in found.spans if not isinstance(span.of, Member)]
    assert sorted(place for span in own for place in span.places) == list(range(len(found.wire))), what
    for span in found.spans:
        assert span.raw == bytes(found.wire[place] for place in span.places), what
    assert kind or not any(span.fault for span in found.spans), what
    for fault in found.faults:
        _check_place(found, fault)


def _check_place(found: Dissection, fault: Fault) -> None:
    """A fault is where its bytes are, and what was seen is what they say."""
    what, wire, seen = (found.wire.hex(), fault), found.wire, fault.seen
    own = [place for span in found.spans if span.of is fault.of for place in span.places]
    rest = {span.of: span.places for span in found.spans if isinstance(span.of, Around)}
    match fault.rule:
        case Rule.BEGINNING:
            assert fault.at == 0, what
            assert not any(_begins(found, at) for at in range(len(wire))), what
        case Rule.FIRST:
            assert (fault.at, seen) == (0, len(rest[Around.BEFORE])), what
            assert _begins(found, len(rest[Around.BEFORE])), what
        case Rule.WHOLE | Rule.TERMINATOR:
            assert fault.at == len(wire), what
            assert seen or fault.rule is Rule.TERMINATOR, what
        case Rule.LAST:
            assert (fault.at, seen) == (rest[Around.AFTER][0], len(rest[Around.AFTER])), what
        case Rule.ALONE:
            assert fault.at == rest[Around.NEXT][0], what
            assert _begins(found, fault.at), what
        case Rule.STUFFING if seen is not None:
            assert wire[fault.at] == seen, what
        case Rule.STUFFING | Rule.SIZE:
            if fault.rule is Rule.STUFFING and isinstance(found.plan.frame.end, ByTerminator):
                return
            inside = _payload_places(found)
            end = inside[-1:] if fault.rule is Rule.STUFFING else [each - 1 for each in inside[:1]]
            assert end in ([], [fault.at - 1]), what
        case Rule.VALUE:
            assert fault.at in own, what
        case _:
            assert own[:1] == [fault.at] or fault.at in rest[Around.NEXT], what
            assert fault.rule is not Rule.LENGTH or Around.AFTER not in rest, "the payload is what is left"


def _begins(found: Dissection, at: int) -> bool:
    """Whether a frame may begin at a place."""
    end = found.plan.frame.end
    if isinstance(end, ByMark):
        return bool(found.wire[at] & end.header.marker) and end.header.id_of(found.wire[at]) != end.end.end_id
    return found.wire[at:].startswith(found.plan.frame.envelope.preamble)


_ENVELOPE = ConstantPart | LengthPart | IdPart | AddressPart | MarkPart | CheckPart


def _payload_places(found: Dissection) -> list[int]:
    return sorted(place for span in found.spans if _is_payload(span.of) for place in span.places)


def _is_payload(of: Owner) -> bool:
    return of is Around.EXTRA or not isinstance(of, Around | _ENVELOPE)


@pytest.mark.parametrize(
    ("path", "direction"), list(cases()), ids=lambda value: getattr(value, "stem", value)
)
def test_dissecting_and_decoding_find_the_same_fault(path: Path | str, direction: Direction) -> None:
    plan, chance = plan_at(path), random.Random(f"{getattr(path, 'stem', path)} {direction}")
    made = frames(plan, direction, chance)
    for index in range(_MUTANTS):
        wire, request = made[index % len(made)]
        mutant = _mutant(wire, made, chance)
        _check(dissect(plan, mutant, direction, request), _kind(plan, mutant, direction, request))


@pytest.mark.parametrize(
    ("path", "direction"),
    [each for each in cases() if isinstance(plan_at(each[0]).frame.end, ByLength)],
    ids=lambda value: getattr(value, "stem", value),
)
def test_a_frame_that_is_cut_lacks_what_was_cut(path: Path | str, direction: Direction) -> None:
    plan = plan_at(path)
    for wire, _ in frames(plan, direction, random.Random(0))[:8]:
        whole = dissect(plan, wire, direction)
        added = [span.places[0] for span in whole.spans if span.of is Around.INSERTED]
        for cut in range(plan.frame.envelope.header_size + len(added), len(wire)):
            missing = len(wire) - cut - sum(at >= cut for at in added)
            if missing and not whole.kind:
                faults = {fault.rule: fault for fault in dissect(plan, wire[:cut], direction).faults}
                assert (faults[Rule.WHOLE].at, faults[Rule.WHOLE].seen) == (cut, missing)


@pytest.mark.parametrize(
    ("sent", "faults"),
    [
        ("07 01 00 7E 01 02", []),
        ("07 01 7E 7E 7E 01 02", []),
        ("07 01 00 01 7E 7E 7E", []),
        ("07 01 00 01 7E 7E", [("stuffing", 11, None)]),
        ("07 01 7E 7E 05 06", [("stuffing", 9, 5)]),
        ("07 01 7E 7E 05 06 7E 7E", [("stuffing", 9, 5), ("stuffing", 13, None)]),
    ],
)
def test_a_byte_that_is_not_inserted_into_a_payload(
    sent: str, faults: list[tuple[str, int, int | None]]
) -> None:
    plan = plan_at("stuffed_payload")
    codec, message = Codec(plan), plan.message("counted.request")
    wire = codec.join(message, codec.cells(message, bytes.fromhex(sent), 3))
    found = dissect(plan, wire, "request")
    assert [(fault.kind, fault.at, fault.seen) for fault in found.faults] == faults


def _places(found: Dissection) -> str:
    """The places of each span, with what is wrong."""
    texts = []
    for span in found.spans:
        name = span.of.value if isinstance(span.of, Around) else span.of.name
        texts.append(f"{name} {span.places[0]}..{span.places[-1]}{span.fault and f' {span.fault}'}")
    return ", ".join(texts)


def _faults(found: Dissection) -> list[tuple[str, Rule, int, int | None]]:
    return [(fault.kind, fault.rule, fault.at, fault.seen) for fault in found.faults]


@pytest.mark.parametrize(
    ("after", "spans", "faults"),
    [
        ("", "", []),
        ("00", ", inserted 8..8", []),
        ("01", ", after 8..8 length", [("length", Rule.LAST, 8, 1)]),
        ("A5", ", after 8..8 length", [("length", Rule.LAST, 8, 1)]),
        ("00 00", ", inserted 8..8, after 9..9 length", [("length", Rule.LAST, 9, 1)]),
    ],
)
def test_a_frame_that_ends_with_the_stuffed_byte(
    after: str, spans: str, faults: list[tuple[str, Rule, int, int | None]]
) -> None:
    """The byte inserted after it belongs to it, and may be missing."""
    plan = plan_at(_QLINK)
    found = dissect(plan, bytes.fromhex("A5 A5 05 05 00 DD C9 A5" + after), "request")
    frame = "preamble 0..1, length 2..2, command 3..3, node 4..4, counter 5..5, crc 6..7"
    assert (_places(found), _faults(found)) == (frame + spans, faults)


@pytest.mark.parametrize(
    ("size", "check", "end", "spans", "faults"),
    [
        (12, "7904", "98", "value 3..12, checksum 13..14, end 15..15", []),
        (12, "7904", "", "value 3..12, checksum 13..14", [("truncated", Rule.WHOLE, 15, 1)]),
        (12, "79", "", "value 3..12, checksum 13..13 truncated", [("truncated", Rule.WHOLE, 14, 2)]),
        (12, "", "98", "value 3..12, end 13..13", [("frame", Rule.SIZE, 1, 12)]),
        (12, "79", "98", "value 3..12, extra 13..13 length, end 14..14", [("frame", Rule.SIZE, 1, 13)]),
        (
            13,
            "7904",
            "98",
            "value 3..12, extra 13..13 length, checksum 14..15 crc, end 16..16",
            [("frame", Rule.SIZE, 1, 13), ("crc", Rule.CHECK, 14, 0x479)],
        ),
    ],
)
def test_a_check_value_precedes_the_end(
    size: int, check: str, end: str, spans: str, faults: list[tuple[str, Rule, int, int | None]]
) -> None:
    """Between two marks is the payload, and the check value if there is room for both."""
    wire = b"\x9a" + bytes(size) + bytes.fromhex(check + end)
    found = dissect(plan_at(_TRIO), wire, "message")
    assert (_places(found), _faults(found)) == (f"header 0..0, number 1..2, {spans}", faults)
