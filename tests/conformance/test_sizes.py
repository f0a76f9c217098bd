"""Kits of long frames, wide ids and large addresses: all planned tests run."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import pytest

from qlinkgen.backends.base import Options
from qlinkgen.cli.targets import TARGETS
from qlinkgen.schema import load
from tests.conformance import kits

SCHEMA = """
qlinkgen: 1
protocol: {{name: wide, title: Wide, revision: "1", source: this test, doc: Large numbers.}}
byteorder: big
frame:
  parts:
    start: {{role: constant, value: 0xA5}}
    len: {{role: length, type: u24, counts: [data]}}
    id: {{role: message, type: u{bits}}}
    to: {{role: address, type: u{bits}}}
    data: {{role: payload, size: 0..{most}}}
    check: {{role: checksum, type: u16, algorithm: crc-16/modbus, over: [id, to, data]}}
bus: {{kind: master_slave, nodes: 1..{nodes}, broadcast: 0, baud: 9600, response_within: 20 bytes}}
defaults: {{repeat: safe, addressing: node}}
commands:
  set:
    id: {number}
    doc: Set.
    request: {{a: "bytes[0..{most}]"}}
    response: {{b: u8}}
  many:
    id: {other}
    doc: Many values.
    request: {{{values}}}
    response: {{}}
"""


def write(folder: Path, *, most: int, bits: int = 8, values: int = 1) -> Path:
    """The kit of a schema with long frames, wide ids and addresses, or many values."""
    top = (1 << bits) - 1
    fields = ", ".join(f"v{number}: u8" for number in range(values))
    text = SCHEMA.format(bits=bits, most=most, number=top, other=top // 2, nodes=top - 1, values=fields)
    return written(folder, text)


def written(folder: Path, text: str) -> Path:
    """Write header and kit of a schema; returns the kit."""
    (folder / "wide.yaml").write_text(text)
    protocol = load(folder / "wide.yaml")
    for target in ("c", "conformance"):
        for path, made in TARGETS[target].load()(protocol, Options()).items():
            (folder / Path(path).name).write_text(made, "utf-8")
    return folder / "wide_conformance.c"


def check(kit: Path, compiler: str) -> None:
    kits.ran(kits.compiled(kit.with_name("kit"), compiler, "-std=c99", kits.STDIO, kit)).check()


@pytest.mark.parametrize("most", [250, 3000])
def test_long_values(most: int, tmp_path: Path, require_tool: Callable[..., str]) -> None:
    """The vectors of a message together exceed 65,535 bytes long before one of them does."""
    check(write(tmp_path, most=most), require_tool("gcc", package="gcc"))


@pytest.mark.parametrize("bits", [8, 16, 24, 32, 64])
@pytest.mark.parametrize("compiler", ["gcc", "clang"])
def test_wide_ids_and_addresses(
    bits: int, compiler: str, tmp_path: Path, require_tool: Callable[..., str]
) -> None:
    kit = write(tmp_path, most=8, bits=bits)
    check(kit, require_tool(compiler, package=compiler))


@pytest.mark.parametrize("values", [255, 256, 300])
def test_many_values(values: int, tmp_path: Path, require_tool: Callable[..., str]) -> None:
    check(write(tmp_path, most=values, values=values), require_tool("gcc", package="gcc"))
