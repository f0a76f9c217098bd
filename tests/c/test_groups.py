"""Signed integers of a few bits, sent in groups: sign extension does not reach the wire."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

from qlinkgen.schema import load
from tests.c.conftest import SANITIZED
from tests.support.cdriver import Driver, build

WIDTHS = (2, 6, 7, 8, 13, 14)
SCHEMA = """
qlinkgen: 1
protocol: {{name: groups, title: Groups, revision: "1", source: this test, doc: Seven bits a byte.}}
byteorder: big
groups: {{bits: 7, first: least}}
frame: {{marked: {{marker: 0x80, header: {{message: 0..2, address: 3..6}}, end: 7, payload: 0..60}}}}
bus: {{kind: ring, nodes: 1..15, baud: 9600, response_within: 1 ms}}
messages:
  told: {{id: 1, doc: Told., fields: {{{fields}}}}}
"""


def test_every_width(tmp_path: Path, require_tool: Callable[..., str]) -> None:
    fields = [f"i{bits}: i{bits}, u{bits}: u{bits}, a{bits}: 'i{bits}[2]'" for bits in WIDTHS]
    (tmp_path / "groups.yaml").write_text(SCHEMA.format(fields=", ".join(fields)))
    protocol = load(tmp_path / "groups.yaml")
    (message,) = protocol.messages
    program = build(protocol, tmp_path, require_tool("gcc", package="gcc"), (*SANITIZED, "-O0"))
    with Driver(program) as driver:
        for end in (0, 1):
            values = []
            for bits in WIDTHS:
                signed = (-(1 << bits - 1), (1 << bits - 1) - 1)[end]
                values += [str(signed), str((1 << bits) - 1 if end else 0), f"{signed},-1"]
            status, payload, wire = driver.ask("encode", message.name, 3, *values).split()
            assert status == "ok"
            assert not [byte for byte in bytes.fromhex(payload) if byte & 0x80]
            assert driver.ask("decode", message.name, wire).split() == ["ok", "3", *values]
