"""Headers of long frames: every index holds every size, and targets with a too small int get an error.

The family: payloads whose frame sizes need about 8, 15 and 16 bits, up to the longest legal payload; with a
length, with stuffing that doubles each byte, and with an end that follows from a count.
"""

from __future__ import annotations

import subprocess
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

from qlinkgen.backends import c
from qlinkgen.backends.base import Options
from qlinkgen.model.protocol import Protocol
from qlinkgen.schema import load
from tests.c.conftest import SANITIZED
from tests.support.cdriver import WARNINGS, Driver, build

SCHEMA = """
qlinkgen: 1
protocol: {{name: big, title: Big, revision: "1", source: this test, doc: Long frames.}}
byteorder: big
frame:
  parts:
    start: {{role: constant, value: 0xDC}}
    {length}
    id: {{role: message, type: u8}}
    data: {{role: payload, size: 0..{most}}}
    check: {{role: checksum, type: u16, algorithm: crc-16/modbus, over: [id, data]}}
  {stuffing}
bus: {{kind: master_slave, baud: 9600, response_within: 20 bytes}}
defaults: {{repeat: safe}}
commands:
  set:
    id: 0x01
    doc: Set.
    request: {{n: {{type: u24, counts: a}}, a: "bytes[0..{bytes}]"}}
    response: {{}}
"""
LENGTH = "len: {role: length, type: u24, counts: [data]}"
STUFFING = "stuffing: {after: 0xDC, insert: 0x00, exempt: [start]}"
KINDS = {"length": (LENGTH, ""), "stuffed": (LENGTH, STUFFING), "counted": ("", "")}
SIZES = (250, 32767, 65529, 65535)
#: A receiver of stuffed frames scans a frame again with every byte, which takes minutes for the longest.
FRAMES = [(kind, most) for kind in KINDS for most in (SIZES if kind != "stuffed" else (250, 4000))]


def long_frames(kind: str, most: int, folder: Path) -> Protocol:
    length, stuffing = KINDS[kind]
    file = folder / "big.yaml"
    file.write_text(SCHEMA.format(length=length, stuffing=stuffing, most=most, bytes=most - 3))
    return load(file)


@pytest.fixture
def longest(
    tmp_path: Path, require_tool: Callable[..., str], request: pytest.FixtureRequest
) -> Iterator[Driver]:
    """Give the driver of a schema, and close it."""
    kind, most = request.param
    protocol = long_frames(kind, most, tmp_path)
    with Driver(build(protocol, tmp_path, require_tool("gcc", package="gcc"), (*SANITIZED, "-O0"))) as driver:
        yield driver


@pytest.mark.parametrize(
    ("longest", "most"),
    [((kind, most), most) for kind, most in FRAMES],
    indirect=["longest"],
    ids=[f"{kind}-{most}" for kind, most in FRAMES],
)
def test_the_longest_frame_is_delivered(longest: Driver, most: int) -> None:
    for value in (b"\xdc" * (most - 3), bytes(most - 3), b"\xdc" * (most - 4)):
        status, payload, wire = longest.ask("encode", "set.request", "-", value.hex()).split()
        assert (status, payload) == ("ok", (len(value).to_bytes(3, "big") + value).hex())
        assert longest.ask("decode", "set.request", wire).split() == ["ok", "-", value.hex()]
        size = len(wire) // 2
        assert longest.ask("decode", "set.request", wire[:-4]) == "error truncated"
        events = longest.ask("stream", "request", wire + wire).split()[1:]
        assert events == [f"{at}:message:set.request:-:{payload}" for at in (size - 1, 2 * size - 1)]


@pytest.mark.parametrize("kind", KINDS)
def test_a_target_with_too_narrow_an_int_is_an_error(
    kind: str, tmp_path: Path, require_tool: Callable[..., str]
) -> None:
    """Functions return sizes as an int, which with 16 bits holds 32,767 bytes."""
    compiler = require_tool("avr-gcc", package="gcc-avr")

    def said(most: int) -> str:
        (text,) = c.generate(long_frames(kind, most, tmp_path), Options()).values()
        (tmp_path / "big.h").write_text(text)
        (tmp_path / "use.c").write_text('#include "big.h"\nint used(void);\nint used(void) { return 0; }\n')
        words = [compiler, "-mmcu=atmega328p", "-std=c99", *WARNINGS, "-c", "use.c", "-o", "use.o"]
        return subprocess.run(words, cwd=tmp_path, capture_output=True, text=True, check=False).stderr

    # Even if sizes fit an int, the receiver may be too large for the compiler.
    longest = {"length": 32767 - 7, "stuffed": 32767 // 2 - 6, "counted": 32767 - 4}[kind]
    assert "big_needs_sizes_in_int_" not in said(longest)
    assert "big_needs_sizes_in_int_" in said(longest + 1)
