"""Protocols without commands: both sides send messages, so frames and receivers have no direction."""

from __future__ import annotations

import random
from collections.abc import Callable
from pathlib import Path

import pytest

from qlinkgen.backends import c
from qlinkgen.backends.base import Options
from qlinkgen.schema import load
from tests.c.conftest import SANITIZED
from tests.support.cdriver import Driver, build, raw_text
from tests.support.random_raw import random_address, random_values

SCHEMA = """
qlinkgen: 1
protocol: {{name: peers, title: Peers, revision: "1", source: this test, doc: Messages alone.}}
byteorder: big
frame:
  parts:
{parts}
  {stuffing}
bus: {{kind: {bus}, {nodes}baud: 9600, response_within: 1 ms}}
messages:
  told: {{id: 1, doc: Told., fields: {{n: {{type: u8, counts: v}}, v: "u16[0..6]", last: u8}}}}
  bare: {{id: 2, doc: Bare., fields: {{}}}}
"""
START, LENGTH = "start: {role: constant, value: 0xDC}", "len: {role: length, type: u8, counts: [data]}"
NODE = "node: {role: address, type: u8}"
CHECK = "check: {role: checksum, type: u8, algorithm: crc-8/smbus, over: [id, data]}"
STUFFING = "stuffing: {after: 0xDC, insert: 0x00, exempt: [start]}"


@pytest.mark.parametrize("node", ["", NODE], ids=["", "node"])
@pytest.mark.parametrize("length", ["", LENGTH], ids=["", "length"])
@pytest.mark.parametrize("kind", ["bare", "start", "stuffed"])
def test_messages_go_round(
    kind: str, length: str, node: str, tmp_path: Path, require_tool: Callable[..., str]
) -> None:
    data = "data: {role: payload, size: 0..20}"
    parts = [START if kind != "bare" else "", length, "id: {role: message, type: u8}", node, data, CHECK]
    text = SCHEMA.format(
        parts="\n".join(f"    {part}" for part in parts if part),
        stuffing=STUFFING if kind == "stuffed" else "",
        bus="ring" if node else "host",
        nodes="nodes: 1..9, " if node else "",
    )
    (tmp_path / "peers.yaml").write_text(text)
    protocol, rng = load(tmp_path / "peers.yaml"), random.Random(text)
    (header,) = c.generate(protocol, Options()).values()
    assert "_direction_t" not in header
    program = build(protocol, tmp_path, require_tool("gcc", package="gcc"), (*SANITIZED, "-O0"))
    with Driver(program) as driver:
        for message in protocol.messages * 10:
            address = str(random_address(message, rng)) if node else "-"
            values = [
                raw_text(value, raw)
                for value, raw in zip(message.values, random_values(message, rng), strict=True)
            ]
            status, payload, wire = driver.ask("encode", message.name, address, *values).split()
            assert status == "ok"
            assert driver.ask("decode", message.name, wire).split() == ["ok", address, *values]
            heard = driver.ask("stream", "message", wire).split()[1:]
            assert [event.split(":", 1)[1] for event in heard] == [
                f"message:{message.name}:{address}:{payload}"
            ]
            assert driver.ask("cuts", "message", wire).split()[-1] == "intact"
