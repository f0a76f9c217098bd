"""Plans and frames for tests of the plan: of schema files, and of shapes that do not occur in them."""

from __future__ import annotations

import random
from collections.abc import Iterator
from functools import cache
from pathlib import Path

from qlinkgen.model.message import Direction
from qlinkgen.plan import Plan, plan_of
from qlinkgen.plan.codec import Codec
from qlinkgen.plan.content import Unsendable, pack
from qlinkgen.schema.loader import load, loads

_ROOT = Path(__file__).resolve().parents[2]
_SCHEMAS = sorted([*(_ROOT / "schemas").glob("*.yaml"), *(_ROOT / "tests" / "schemas").glob("*.yaml")])

#: Shapes of frames that do not occur in schema files: parts and stuffing.
_NUMBER, _NODE = "id: {role: message, type: u8}", "node: {role: address, type: u8}"
_DATA, _SIZE = "data: {role: payload, size: 0..40}", "size: {role: length, type: u8, counts: [data]}"
_SUM = "check: {role: checksum, type: u8, algorithm: sum8, over: [id, node, data]}"
_CRC = "check: {role: checksum, type: u16, algorithm: crc-16/xmodem, over: [size, id, node, data]}"
_DOUBLE = "start: {role: constant, value: 7E 7E}"
_SHAPES = {
    "constant_end": (
        [
            "start: {role: constant, value: 02}",
            _SIZE,
            _NUMBER,
            _NODE,
            _DATA,
            _CRC,
            "end: {role: constant, value: 03 0D}",
        ],
        "",
    ),
    "stuffed_between_constants": (
        [
            "start: {role: constant, value: 10 02}",
            _NUMBER,
            _NODE,
            "size: {role: length, type: u16, counts: [data, check]}",
            _DATA,
            _SUM,
            "end: {role: constant, value: 10 03}",
        ],
        "{after: 0x10, insert: 0x10, exempt: [start, end]}",
    ),
    "stuffed_after_two": (
        [_DOUBLE, _SIZE, _NUMBER, _NODE, _DATA, _CRC],
        "{after: 7E 7E, insert: 0x00, exempt: [start]}",
    ),
    "stuffed_payload": (
        [_DOUBLE, _SIZE, _NUMBER, _NODE, _DATA, _CRC],
        "{after: 7E 7E, insert: 0x7E, exempt: [start, size, id, node, check], checksum: after}",
    ),
    "neither_length_nor_check": (["start: {role: constant, value: 0x68}", _NUMBER, _NODE, _DATA], ""),
    "no_length_stuffed": (
        [_DOUBLE, _NUMBER, _NODE, _DATA, _SUM],
        "{after: 0x7E, insert: 0x00, exempt: [start]}",
    ),
    "wide": (
        [
            "start: {role: constant, value: 0x5A}",
            "size: {role: length, type: u16, counts: [data]}",
            "id: {role: message, type: u16}",
            "node: {role: address, type: u16}",
            _DATA,
            _CRC,
        ],
        "",
    ),
    "bare": ([_NUMBER, _NODE, _DATA, _SUM], ""),
}
_SCHEMA = """
qlinkgen: 1
protocol: {name: shape, title: Shape, revision: "1", source: Tests, doc: A shape}
byteorder: big
frame: {parts: {PARTS}STUFFING}
bus: {kind: master_slave, nodes: 1..16, response_within: 5 ms}
defaults: {addressing: node, repeat: safe}
commands:
  counted:
    id: 0x10
    request: {mark: {type: u8, const: 7}, n: {type: u8, counts: a}, a: "u16[0..9]", b: "u8[2]"}
    response: {n: {type: u8, counts: t, counts_in: bytes}, t: "text[0..12]", f: {type: u8, bits: FIELDS}}
  plain:
    id: 0x7E
    request: {a: {type: u16, range: 3..900, default: 5}}
    response: {}
"""
_FIELDS = "{low: {at: 0..2, range: 1..5, default: 1}, high: {at: 4..7, signed: true}}"


@cache
def plan(path: Path | str) -> Plan:
    """The plan of a schema file, or of a shape."""
    if isinstance(path, Path):
        return plan_of(load(path))
    parts, stuffing = _SHAPES[path]
    text = _SCHEMA.replace("PARTS", ", ".join(parts)).replace("FIELDS", _FIELDS)
    protocol, faults = loads(text.replace("STUFFING", stuffing and f", stuffing: {stuffing}"), f"{path}.yaml")
    assert protocol is not None, [str(fault) for fault in faults]
    return plan_of(protocol)


def cases() -> Iterator[tuple[Path | str, Direction]]:
    """Every schema file and shape in every direction that is heard."""
    paths: list[Path | str] = [*_SCHEMAS, *_SHAPES]
    for path in paths:
        yield from ((path, direction) for direction in plan(path).received_directions)


def frames(of: Plan, direction: Direction, chance: random.Random) -> list[tuple[bytes, bytes]]:
    """Two frames of each message, with default and with random values, and their requests."""
    codec, made = Codec(of), []
    for message in of.received(direction):
        request = bytes((message.id, *chance.randbytes(2)))
        address = message.message.default_address
        least, most = message.payload.least, min(message.payload.most, 40)
        payloads = [chance.randbytes(chance.randint(least, max(least, most)))]
        try:
            payloads.append(pack(message.payload, {}))
        except Unsendable:  # a value without a default
            payloads.append(bytes(least))
        made += [(codec.wrap(message.name, each, address, request), request) for each in payloads]
    return made
