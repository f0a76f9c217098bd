"""Frames of many framings recovered from corrupted streams, by generated stream decoders.

`python -m tests.proof.framings` prints the tables of docs/recovery.md, `--write` writes them.
"""

from __future__ import annotations

import functools
import random
import re
import sys
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path

from qlinkgen.backends import python
from qlinkgen.model.message import Direction
from qlinkgen.plan import Plan, plan_of
from qlinkgen.plan.codec import Codec
from qlinkgen.plan.ended import frame_reader
from qlinkgen.plan.ends import Rescan
from qlinkgen.plan.reading import BadFrame, FrameReader, Incomplete, KindsReader, NoFrame
from qlinkgen.plan.receive import receiver
from qlinkgen.schema import find, library, load, loads
from tests.proof.corruption import EVERY_KIND
from tests.proof.recovery import Result, Subject
from tests.support.random_raw import random_frame

FRAMES = 600
PAGE = Path(__file__).parents[2] / "docs" / "recovery.md"

_SCHEMA = """
qlinkgen: 1
protocol: {{name: sample, revision: "1", source: Made up}}
frame:
  parts:
{parts}
{coding}
bus: {{kind: host}}
commands: {{}}
messages:
  told: {{id: 3, direction: request, fields: {{number: u16, data: bytes}}}}
"""
_CODE, _DATA = "code: {role: message, type: u8}", "data: {role: payload, size: 2..40}"
_SIZE = "size: {type: u8, counts: [code, data]}"
_CRC = "crc: {type: u16, algorithm: crc-16/ibm-sdlc, over: [code, data]}"
_LRC = "lrc: {type: u8, algorithm: sum8-zero, over: [code, data]}"
#: Parts and coding.
_FRAMINGS: Mapping[str, tuple[Sequence[str], str]] = {
    "preamble, length, CRC": (("start: A5", _SIZE, _CODE, _DATA, _CRC), ""),
    "flags as of HDLC, CRC": (
        ("open: 7E", _CODE, _DATA, _CRC, "close: {role: terminator, value: 7E, shared: true}"),
        "coding: {escape: 7D, xor: 20, of: [7E, 7D]}",
    ),
    "SLIP, CRC": (
        ("open: C0", _CODE, _DATA, _CRC, "close: {role: terminator, value: C0}"),
        "coding: {replace: {C0: DB DC, DB: DB DD}}",
    ),
    "COBS, CRC": ((_CODE, _DATA, _CRC, "end: {role: terminator, value: 00}"), "coding: {cobs: 00}"),
    "DLE STX, DLE ETX, CRC": (
        ("open: 10 02", _CODE, _DATA, _CRC, "close: {role: terminator, value: 10 03}"),
        "coding: {insert: 10, after: 10}",
    ),
    "digits as of Modbus ASCII, LRC": (
        ('start: {text: ":"}', _CODE, _DATA, _LRC, "end: {role: terminator, value: 0D 0A}"),
        "coding: {digits: hex}",
    ),
    "preamble, length, CRC, escapes": (
        ("start: 7E", _SIZE, _CODE, _DATA, _CRC),
        "coding: {escape: 7D, xor: 20, of: [7E, 7D]}",
    ),
    "a silence alone, CRC": ((_CODE, _DATA, _CRC, "gap: {role: idle, time: 3.5 bytes, alone: true}"), ""),
    "SLIP without a check value": (
        ("open: C0", _CODE, _DATA, "close: {role: terminator, value: C0}"),
        "coding: {replace: {C0: DB DC, DB: DB DD}}",
    ),
    "COBS without a check value": (
        (_CODE, _DATA, "end: {role: terminator, value: 00}"),
        "coding: {cobs: 00}",
    ),
}
#: Those whose receivers deliver every intact frame.
CHECKED = [name for name in _FRAMINGS if "without" not in name]
#: The protocols of the library.
LIBRARY = library()


@functools.cache
def subject(name: str) -> Subject:
    """Distinct frames of a framing, and the decoder generated for it."""
    parts, coding = _FRAMINGS[name]
    indented = "\n".join(f"    {part}" for part in parts)
    protocol, faults = loads(_SCHEMA.format(parts=indented, coding=f"  {coding}"), "sample.yaml")
    assert protocol is not None, faults
    module, chance = python.load(protocol), random.Random(name)
    silent = hasattr(module, "IDLE_ALONE")
    told = module.MESSAGES["told"]
    frames = [
        told(number=number, data=chance.randbytes(chance.randint(0, 20))).to_frame()
        for number in range(FRAMES)
    ]

    def decoded(chunks: Iterable[bytes]) -> Sequence[bytes]:
        decoder, events = module.StreamDecoder("request"), []
        for chunk in chunks:
            events += decoder.feed(chunk) + (decoder.gap() if silent else [])
        events += decoder.finish()
        return [event.to_frame() for event in events if not isinstance(event, module.Fault)]

    return Subject(frames, lambda each: frames[0][: each.randint(1, 4)], decoded, silent)


@functools.cache
def library_subject(name: str) -> Subject:
    """Distinct frames of a protocol of the library, in the direction that most messages have."""
    protocol = load(find(name))
    plan, module, chance = plan_of(protocol), python.load(protocol), random.Random(name)
    direction = _direction(plan)
    messages = [protocol.by_name[each.name] for each in plan.received(direction)]
    frames = list(dict.fromkeys(random_frame(plan, chance.choice(messages), chance) for _ in range(FRAMES)))
    arguments = () if direction == "message" else (direction,)

    def decoded(chunks: Iterable[bytes]) -> Sequence[bytes]:
        decoder = module.StreamDecoder(*arguments)
        events = [event for chunk in chunks for event in decoder.feed(chunk)] + decoder.finish()
        return [event.to_frame() for event in events if not isinstance(event, module.Fault)]

    return Subject(frames, lambda each: frames[0][: each.randint(1, 4)], decoded)


def _direction(plan: Plan) -> Direction:
    """The direction that most messages have."""
    return max(plan.received_directions, key=lambda each: len(plan.received(each)))


def total(name: str) -> Result:
    """The sum of the results for every kind of corruption."""
    found = library_subject(name) if name in LIBRARY else subject(name)
    results = [found.result(kind) for kind in EVERY_KIND]
    return Result(
        *(sum(getattr(each, key) for each in results) for key in ("intact", "recovered", "strange"))
    )


def unexplained(subject: Subject, plan: Plan) -> Mapping[str, Sequence[int]]:
    """Where intact frames begin that are lost without a reason, by kind of corruption.

    The only reason is a false frame which the reference receiver finds over their beginning: its check values
    are right by chance, or its loss is after them.
    """
    found = {}
    for kind in EVERY_KIND:
        lost = subject.lost(kind)
        false = _right(plan, subject.stream(kind).data) if lost else ()
        if rest := [at for at in lost if not any(each.start < at < each.stop for each in false)]:
            found[kind] = rest
    return found


def _right(plan: Plan, stream: bytes) -> Sequence[range]:
    """Where the reference receiver finds frames with right check values in a stream."""
    direction = _direction(plan)
    reader = frame_reader(plan.frames[direction], plan.known(direction))
    return [
        range(event.offset, event.offset + len(event.raw))
        for event in receiver(plan, direction).run(stream)
        if event.kind == "message" or _is_right(plan, direction, reader, event.raw)
    ]


def _is_right(plan: Plan, direction: Direction, reader: FrameReader | KindsReader, raw: bytes) -> bool:
    """Whether the check values of a frame with a fault are right."""
    try:
        taken = reader.read(raw)
        Codec(plan).judge(taken, direction)
    except (Incomplete, NoFrame):
        return False
    except BadFrame as bad:
        way = plan.frame.receiver
        return isinstance(way, Rescan) and way.proves(bad.kind, inside=bool(bad.field))
    return True


def row(name: str) -> str:
    """A row of the table."""
    found = total(name)
    share = 100 * found.recovered / found.intact
    return f"| {name} | {found.recovered}/{found.intact} = {share:.4g} % | {found.strange} |"


def table() -> str:
    """Recovered and intact frames of every framing, as Markdown."""
    return "\n".join(["| framing | delivered | not sent |", "|---|---|---|", *map(row, _FRAMINGS)])


def library_table() -> str:
    """The same of every protocol of the library."""
    return "\n".join(["| protocol | delivered | not sent |", "|---|---|---|", *map(row, LIBRARY)])


def main(arguments: Sequence[str]) -> None:
    """Print or write the tables."""
    tables = (table(), library_table())
    print("\n\n".join(tables))
    if "--write" in arguments:
        page = PAGE.read_text("utf-8")
        for each in tables:
            head = re.escape(each.partition("\n")[0])
            begin, standing, end = re.split(rf"^({head}\n(?:\|.*\n)*)", page, flags=re.MULTILINE)
            page = f"{begin}{each}\n{end}" if standing else page
        PAGE.write_text(page, "utf-8")


if __name__ == "__main__":
    main(sys.argv[1:])
