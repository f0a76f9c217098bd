"""Every byte of a frame belongs to one span, and faults agree with the decoder."""

from __future__ import annotations

import random
from pathlib import Path

import pytest

from qlinkgen.model.message import Direction
from qlinkgen.plan import Plan
from qlinkgen.plan.codec import Codec
from qlinkgen.plan.dissect import dissect
from qlinkgen.plan.framing import AddressPart, ByLength, CheckPart, ConstantPart, IdPart, LengthPart, MarkPart
from qlinkgen.plan.payload import Member
from qlinkgen.plan.reading import BadFrame
from qlinkgen.plan.spans import Around, Dissection, Fault, Owner, Rule
from tests.plan.shapes import cases, frames
from tests.plan.shapes import plan as plan_at

_MUTANTS = 150


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
        case Rule.FIRST:
            assert (fault.at, seen) == (0, len(rest[Around.BEFORE])), what
        case Rule.WHOLE:
            assert fault.at == len(wire), what
            assert seen is not None, what
            assert seen > 0, what
        case Rule.LAST:
            assert (fault.at, seen) == (rest[Around.AFTER][0], len(rest[Around.AFTER])), what
        case Rule.ALONE:
            assert fault.at == rest[Around.NEXT][0], what
        case Rule.STUFFING if seen is not None:
            assert wire[fault.at] == seen, what
        case Rule.STUFFING | Rule.SIZE:
            inside = sorted(place for span in found.spans if _is_payload(span.of) for place in span.places)
            if inside:
                assert fault.at == (inside[-1] + 1 if fault.rule is Rule.STUFFING else inside[0]), what
        case Rule.VALUE:
            assert fault.at in own, what
        case _:
            assert own[:1] == [fault.at] or fault.at in rest[Around.NEXT], what


_ENVELOPE = ConstantPart | LengthPart | IdPart | AddressPart | MarkPart | CheckPart


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
