"""No function reads past the end of its input, wherever a frame is cut.

The family: messages of random fields with counts, in frames with and without a length, preamble, stuffing,
check value and end. The test itself builds their bytes, and places them in memory of exactly their size, so
that the address sanitizer detects each byte read past the end.
"""

from __future__ import annotations

import random
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path

import pytest

from qlinkgen.model.protocol import Protocol
from qlinkgen.plan import plan_of
from qlinkgen.schema import load
from tests.c.conftest import SANITIZED
from tests.support.agreement import events, kind
from tests.support.cdriver import Driver, build

MESSAGES = 8
FLAGS = (*SANITIZED, "-O0")
HEAD = """
qlinkgen: 1
protocol: {{name: counted, title: Counted, revision: "1", source: this test, doc: Counts.}}
byteorder: {order}
frame:
{frame}
bus: {{kind: master_slave, baud: 9600, response_within: 20 bytes}}
defaults: {{repeat: safe}}
commands:
"""
SUM = "{role: checksum, type: u8, algorithm: sum8, over: [id, data]}"


@dataclass(frozen=True)
class Shape:
    """A frame around an id and a payload, as YAML and as bytes."""

    yaml: str
    start: bytes = b""
    length: bool = False
    summed: bool = False
    end: bytes = b""
    mark: int | None = None

    def wire(self, number: int, payload: bytes) -> bytes:
        body = bytes([number]) + payload
        counted = len(payload).to_bytes(2, "big") if self.length else b""
        body = counted + body + (bytes([sum(body) & 0xFF]) if self.summed else b"") + self.end
        if self.mark is not None:
            mark = bytes([self.mark])
            body = body.replace(mark, mark + b"\x00")
        return self.start + body


_START, _ID, _DATA = (
    "start: {role: constant, value: 0xDC}",
    "id: {role: message, type: u8}",
    "data: {role: payload, size: 0..600}",
)
_END, _LENGTH = (
    "end: {role: constant, value: 0x0D}",
    "len: {role: length, type: u16, byteorder: big, counts: [data]}",
)
_STUFFED = "  stuffing: {after: 0xDC, insert: 0x00, exempt: [start]}"


def _parts(*parts: str, more: str = "") -> str:
    return "\n".join(["  parts:", *(f"    {part}" for part in parts), *([more] if more else [])])


SHAPES = {
    "bare": Shape(_parts(_ID, _DATA)),
    "start": Shape(_parts(_START, _ID, _DATA), start=b"\xdc"),
    "end": Shape(_parts(_START, _ID, _DATA, _END), start=b"\xdc", end=b"\x0d"),
    "sum": Shape(_parts(_START, _ID, _DATA, f"check: {SUM}"), start=b"\xdc", summed=True),
    "sum_end": Shape(
        _parts(_ID, _DATA, f"check: {SUM}", _END), summed=True, end=b"\x0d"
    ),
    "stuffed": Shape(
        _parts(_START, _ID, _DATA, f"check: {SUM}", more=_STUFFED), start=b"\xdc", summed=True, mark=0xDC
    ),
    "length": Shape(
        _parts(_START, _LENGTH, _ID, _DATA, f"check: {SUM}"), start=b"\xdc", length=True, summed=True
    ),
}  # fmt: skip


@dataclass
class Made:
    """A message of random fields: its YAML, and payloads of it."""

    rng: random.Random
    order: str
    #: Name and YAML; for a count its field, for a field the size of an item and its bounds.
    fields: list[tuple[str, str]] = field(default_factory=list)
    counts: dict[str, tuple[str, int, bool, str]] = field(default_factory=dict)
    runs: dict[str, tuple[int, int, int]] = field(default_factory=dict)
    plain: dict[str, int] = field(default_factory=dict)

    def __post_init__(self) -> None:
        """Counts anywhere before their field, plain fields anywhere."""
        for number in range(self.rng.randint(1, 4)):
            self._add_run(f"r{number}")
        for number in range(self.rng.randint(0, 2)):
            size = self.rng.choice((1, 2, 3))
            self.plain[f"p{number}"] = size
            self._insert(f"p{number}", f"u{8 * size}", 0, len(self.fields))

    def _insert(self, name: str, yaml: str, first: int, last: int) -> None:
        self.fields.insert(self.rng.randint(first, last), (name, yaml))

    def _add_run(self, name: str) -> None:
        item = self.rng.choice((1, 1, 2, 3, 4))
        low = self.rng.choice((0, 0, 1, 3))
        high = low + self.rng.choice((1, 5, 40, 60 // item))
        self.runs[name] = (item, low, high)
        base = self.rng.choice(("bytes", "u8")) if item == 1 else f"u{8 * item}"
        self._insert(name, f'"{base}[{low}..{high}]"', 0, len(self.fields))
        for number in range(self.rng.choice((1, 1, 1, 2))):
            size, in_bytes = self.rng.choice((1, 1, 2, 3, 4)), self.rng.random() < 0.4
            if high * item > 0xFF:
                size = max(size, 2)
            order = self.rng.choice(("big", "little"))
            count = f"{name}_n{number}"
            self.counts[count] = (name, size, in_bytes and base != "bytes", order)
            unit = ", counts_in: bytes" if in_bytes else ""
            at = next(index for index, each in enumerate(self.fields) if each[0] == name)
            yaml = f"{{type: u{8 * size}, byteorder: {order}, counts: {name}{unit}}}"
            self._insert(count, yaml, 0, at)

    def payload(self) -> bytes:
        sizes = {
            name: self.rng.choice((low, high, self.rng.randint(low, high)))
            for name, (_, low, high) in self.runs.items()
        }
        return b"".join(self._bytes(name, sizes) for name, _ in self.fields)

    def _bytes(self, name: str, sizes: dict[str, int]) -> bytes:
        if name in self.counts:
            counted, size, in_bytes, order = self.counts[name]
            item = self.runs[counted][0] if in_bytes else 1
            return (sizes[counted] * item).to_bytes(size, order)  # type: ignore[arg-type]
        size = sizes[name] * self.runs[name][0] if name in self.runs else self.plain[name]
        return bytes(self.rng.choice((self.rng.randrange(256), 0xDC, 0x00, 0x28)) for _ in range(size))


def made(shape: str, seed: int, folder: Path) -> tuple[Protocol, list[Made]]:
    rng = random.Random(f"{shape} {seed}")
    order = rng.choice(("big", "little"))
    messages = [Made(rng, order) for _ in range(MESSAGES)]
    text = HEAD.format(order=order, frame=SHAPES[shape].yaml)
    for number, message in enumerate(messages):
        fields = "".join(f"      {name}: {yaml}\n" for name, yaml in message.fields)
        text += f"  m{number}:\n    id: {number + 1}\n    doc: D.\n    request:\n{fields}    response: {{}}\n"
    file = folder / "counted.yaml"
    file.write_text(text)
    return load(file), messages


def hostile(frame: bytes, rng: random.Random) -> bytes:
    """The frame with some possible counts changed, followed by other bytes."""
    data = bytearray(frame)
    for _ in range(rng.randint(1, 3)):
        at = rng.randrange(min(len(data), 12))
        data[at] = rng.choice((0, 1, 40, 0x7F, 0xFF, data[at] ^ 1, data[at] ^ 2))
    return bytes(data[: 1 + rng.randrange(len(data))]) + bytes(rng.randrange(3))


@pytest.mark.parametrize("shape", SHAPES)
def test_every_cut(shape: str, tmp_path: Path, require_tool: Callable[..., str]) -> None:
    compiler, rng = require_tool("gcc", package="gcc"), random.Random(shape)
    protocol, messages = made(shape, 1, tmp_path)
    program, plan = build(protocol, tmp_path, compiler, FLAGS), plan_of(protocol)
    with Driver(program) as driver:
        for number, message in enumerate(messages, 1):
            for _ in range(3):
                payload = message.payload()
                frame = SHAPES[shape].wire(number, payload)
                said = driver.ask("cuts", "request", frame.hex()).split()[1:]
                assert said[-1] == "intact", (message.fields, frame.hex())
                assert "intact" not in said[:-1] or shape == "stuffed", (message.fields, frame.hex())
                heard = driver.ask("stream", "request", (frame + frame).hex()).split()[1:]
                told = f"message:m{number - 1}.request:-:{payload.hex() or '-'}"
                due = [f"{len(frame) - 1}:{told}", f"{2 * len(frame) - 1}:{told}"]
                assert heard == due, (message.fields, frame.hex())
            for _ in range(16):
                broken = hostile(SHAPES[shape].wire(number, message.payload()), rng)
                said = driver.ask("cuts", "request", broken.hex()).split()[1:]
                expected = [kind(plan, "request", broken[:end]) for end in range(len(broken) + 1)]
                assert said == expected, broken.hex()
                said = driver.ask("stream", "request", broken.hex()).split()[1:]
                assert said == events(plan, "request", broken), broken.hex()
