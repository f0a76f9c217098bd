"""Round trips of stuffed frames with any exempt parts: in C, Python, construct and by definition.

The family: a frame between two marks like DLE STX and DLE ETX, with every legal set of exempt parts (at the
beginning and at the end), with and without a length, stuffed after one byte and after two; and with a payload
that is stuffed before length and check value are computed. Values consist of significant bytes.
"""

from __future__ import annotations

import itertools
import random
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import pytest

from qlinkgen.backends import construct, python
from qlinkgen.plan import plan_of
from qlinkgen.schema import load, loads
from tests.support.agreement import compare
from tests.support.cdriver import Driver, build

SCHEMA = """
qlinkgen: 1
protocol: {{name: marks, title: Marks, revision: "1", source: this test, doc: Stuffed.}}
byteorder: big
frame:
  parts:
    start: {{role: constant, value: 10 02}}
    {length}
    id: {{role: message, type: u8}}
    data: {{role: payload, size: 0..40}}
    check: {{role: checksum, type: u8, algorithm: sum8, over: [id, data]}}
    end: {{role: constant, value: 10 03}}
  stuffing: {{after: {after}, insert: {insert}, {how}}}
bus: {{kind: master_slave, baud: 9600, response_within: 20 bytes}}
defaults: {{repeat: safe}}
commands:
  set:
    id: 0x10
    doc: Set.
    request: {{n: {{type: u8, counts: a}}, a: "bytes[0..16]", m: {{type: u8, counts: b}}, b: "bytes[0..16]"}}
    response: {{}}
"""
LENGTH = "len: {role: length, type: u8, counts: [data]}"
PARTS = ("start", "len", "id", "data", "check", "end")
MARKS = {"0x10": ("0x10", b"\x10", b"\x10"), "10 02": ("0x00", b"\x10\x02", b"\x00")}


@dataclass(frozen=True)
class Stuffed:
    """A frame with a set of exempt parts."""

    exempt: tuple[str, ...]
    length: bool
    after: str
    #: Length and checksum apply to the stuffed payload.
    late: bool = False

    @property
    def parts(self) -> tuple[str, ...]:
        return tuple(part for part in PARTS if self.length or part != "len")

    @property
    def text(self) -> str:
        return SCHEMA.format(
            length=LENGTH if self.length else "",
            after=self.after,
            insert=MARKS[self.after][0],
            how="checksum: after" if self.late else f"exempt: [{', '.join(self.exempt)}]",
        )

    def wire(self, payload: bytes) -> bytes:
        """The frame according to the definition."""
        _, after, insert = MARKS[self.after]
        payload = payload.replace(after, after + insert) if self.late else payload
        check = bytes([sum(b"\x10" + payload) & 0xFF])
        said = {"start": b"\x10\x02", "len": bytes([len(payload)]), "id": b"\x10", "data": payload}
        said |= {"check": check, "end": b"\x10\x03"}
        runs = itertools.groupby(self.parts, key=lambda part: self.late or part in self.exempt)
        pieces = [(plain, b"".join(said[part] for part in parts)) for plain, parts in runs]
        return b"".join(data if plain else data.replace(after, after + insert) for plain, data in pieces)

    @property
    def in_one_piece(self) -> bool:
        """Whether the stuffed parts are adjacent."""
        stuffed = [part not in self.exempt for part in self.parts]
        return sum(kind for kind, _ in itertools.groupby(stuffed)) == 1


def _exempt(*, length: bool) -> list[tuple[str, ...]]:
    others = [part for part in PARTS if part != "data" and (length or part != "len")]
    return [each for size in range(len(others) + 1) for each in itertools.combinations(others, size)]


EVERY = [
    Stuffed(exempt, length, after)
    for length in (True, False)
    for exempt in _exempt(length=length)
    for after in MARKS
]
#: One byte and two alternate.
ALLOWED = [
    *(each for each in EVERY if each.in_one_piece and list(MARKS)[len(each.exempt) % 2] == each.after),
    *(Stuffed((), length=True, after=after, late=True) for after in MARKS),
]


def test_a_payload_that_is_stuffed_first_needs_a_length() -> None:
    for after in MARKS:
        assert loads(Stuffed((), length=True, after=after, late=True).text, "marks.yaml")[0]
        protocol, faults = loads(Stuffed((), length=False, after=after, late=True).text, "marks.yaml")
        assert protocol is None
        assert [fault.rule for fault in faults if fault.severity == "error"] == ["no-frame-end"]


def test_the_schema_refuses_exempt_parts_in_the_middle() -> None:
    for each in EVERY:
        protocol, faults = loads(each.text, "marks.yaml")
        assert (protocol is not None) == each.in_one_piece, (each, faults)
        assert each.in_one_piece or [fault.rule for fault in faults if fault.severity == "error"], each


@pytest.mark.parametrize(
    "frame", ALLOWED, ids=lambda each: f"{'_'.join(each.exempt) or 'none'}-{each.after.replace(' ', '')}"
)
def test_round_trip(frame: Stuffed, tmp_path: Path, require_tool: Callable[..., str]) -> None:
    (tmp_path / "marks.yaml").write_text(frame.text)
    protocol, rng = load(tmp_path / "marks.yaml"), random.Random(frame.text)
    module, live = python.load(protocol), construct.live(protocol)
    decoder, stream, told = module.StreamDecoder("request"), b"", []
    with Driver(build(protocol, tmp_path, require_tool("gcc", package="gcc"), ("-O0", "-std=c99"))) as driver:
        for _ in range(40):
            a, b = (bytes(rng.choices(b"\x10\x02\x03\x00\xf0", k=rng.randint(0, 16))) for _ in range(2))
            payload = bytes([len(a), *a, len(b), *b])
            wire = frame.wire(payload)
            values = [value.hex() or "-" for value in (a, b)]
            assert driver.ask("encode", "set.request", "-", *values).split()[2] == wire.hex()
            assert driver.ask("decode", "set.request", wire.hex()).split() == ["ok", "-", *values]
            message = module.SetRequest(a=a, b=b)
            assert message.to_frame() == live.wrap("set.request", payload) == wire
            assert message.to_bytes() == payload
            assert module.decode_request(wire) == message
            assert live.parse("request", wire).fields.a == a
            stream += wire
            told += [message]
        heard = [each for at in range(len(stream)) for each in decoder.feed(stream[at : at + 1])]
        assert [each for each in heard if not isinstance(each, module.Fault)] == told
        heard_by_c = driver.ask("stream", "request", stream.hex()).split()[1:]
        for direction in protocol.directions:
            compare(plan_of(protocol), direction, driver, rng, 8)
        due = [each.to_bytes().hex() for each in told]
        assert [each.rsplit(":", 1)[1] for each in heard_by_c if ":message:" in each] == due
