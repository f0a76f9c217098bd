"""Headers of every shape are clean under strict warnings, as C99 and as C++17, for each role.

The family is a product of options of a frame, kinds of messages, and roles. One run of each compiler compiles
enough members to include every pair of options. Back-ends must support all of them: unsupported ones are
schema errors with a location.
"""

from __future__ import annotations

import itertools
import random
import subprocess
from collections.abc import Callable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Literal

import pytest

from qlinkgen.backends import c
from qlinkgen.backends.base import Options
from qlinkgen.model.protocol import Protocol
from qlinkgen.schema import loads
from tests.support.cdriver import WARNINGS
from tests.support.sharing import made_once

STRICT = WARNINGS
START = {
    "no start": "",
    "start": "start: {role: constant, value: 0xDC}",
    "wide start": "start: {role: constant, value: A5 5A}",
}
LENGTH = {
    "no length": "",
    "u8 length": "len: {role: length, type: u8, counts: [data]}",
    "u16 length": "len: {role: length, type: u16, byteorder: little, counts: [@ID, data]}",
}
ID = {"u8 id": "id: {role: message, type: u8}", "u32 id": "id: {role: message, type: u32}"}
#: The part, the nodes and the broadcast address.
ADDRESS = {
    "no address": ("", "", ""),
    "some nodes": ("node: {role: address, type: u8}", "nodes: 1..31, broadcast: 0, ", ""),
    "every node": ("node: {role: address, type: u8}", "nodes: 0..255, ", ""),
    "wide nodes": ("node: {role: address, type: u24}", "nodes: 1..70000, broadcast: 0, ", ""),
}
MIDDLE = {"no middle": "", "middle": "mid: {role: constant, value: 0x7E}"}
DATA = {
    "some data": "data: {role: payload, size: 0..40}",
    "lots of data": "data: {role: payload, size: 0..300}",
}
CHECK = {
    "no check": "",
    "sum": "check: {role: checksum, type: u8, algorithm: sum8, over: [id, data]}",
    "crc": "check: {role: checksum, type: u16, algorithm: crc-16/modbus, over: [@ALL]}",
    "wide crc": "check: {role: checksum, type: u32, algorithm: crc-32, over: [data]}",
    "crc8": "check: {role: checksum, type: u8, algorithm: crc-8/smbus, over: [id]}",
}
END = {"no end": "", "end": "end: {role: constant, value: 0D 0A}"}
STUFFING = {
    "no stuffing": "",
    "stuffing": "stuffing: {after: 0xDC, insert: 0x00, exempt: [@START]}",
    "stuffing after two": "stuffing: {after: A5 5A, insert: 0x00, exempt: [@START]}",
    "stuffed payload": "stuffing: {after: 0xDC, insert: 0x00, checksum: after}",
}
EMPTY, RESERVED = "{}", "{gap: {type: u16, reserved: true}}"
FIELDS = {
    "empty": EMPTY,
    "reserved alone": RESERVED,
    "reserved after variable": '{n: {type: u8, counts: v}, v: "u16[0..6]", gap: {type: u24, reserved: true}}',
    "constant alone": "{magic: {type: u16, const: 0xCAFE}}",
    "one byte": "{a: u8}",
    "counted twice": (
        '{n: {type: u16, counts: v}, m: {type: u8, counts: v, counts_in: bytes}, v: "u16[1..6]", z: i8}'
    ),
    "two counted": (
        '{n: {type: u8, counts: v}, m: {type: u8, counts: w}, v: "bytes[0..6]", w: "text[2..9]", z: bool}'
    ),
    "open": '{a: u8, v: "u24[0..9]", gap: {type: u8, reserved: true}}',
    "open text": '{v: "text[0..9]"}',
    "whole signed bits": (
        "{b: {type: u40, bits: {s: {at: 0..7, signed: true}, t: {at: 8..39, signed: true}}},"
        " c: {type: u64, bits: {q: {at: 0..31, signed: true}, r: {at: 32..47, signed: true}, k: 48..63}},"
        " d: {type: u56, byteorder: little,"
        " bits: {x: {at: 40..55, signed: true}, y: {at: 3..34, signed: true}}}}"
    ),
    "odd signed bits": (
        "{b: {type: u48, bits: {s: {at: 0..6, signed: true}, t: {at: 7..39, signed: true}, f: 40}},"
        " c: {type: u8, bits: {q: {at: 0..3, signed: true}, r: {at: 4..7}}}}"
    ),
    "reserved bits alone": "{b: {type: u16, bits: {f: 3}}, gap: {type: u8, reserved: true, const: 7}}",
    "scaled": "{a: {type: i24, scale: 1/10, range: -5..5}, b: {type: u40, scale: 3}, c: fixed16.16}",
    "numbers": "{a: i64, b: u56, c: i40, d: i24, e: {type: i8, range: -3..9}, f: {type: u32, range: 7..9}}",
    "arrays": '{a: "i16[3]", b: "u40[2]", c: "bytes[4]", d: "text[2]", e: "i24[1]"}',
    "groups": (
        "{a: {type: u13, groups: {bits: 7, first: most}}, b: {type: i7, groups: {bits: 7, first: most}}}"
    ),
}
#: Request and response by their names in FIELDS, and messages with their direction.
TRAFFIC = {
    "command": ("@F", "@F", ()),
    "no response": ("@F", None, ()),
    "empty response": ("@F", "empty", ()),
    "empty request": ("empty", "@F", ()),
    "messages": (None, None, ("message",)),
    "requests": (None, None, ("request",)),
    "responses": (None, None, ("response",)),
    "command and message": ("@F", None, ("message", "response")),
    "all ways": ("empty", "@F", ("request", "response", "message")),
}
ROLES: tuple[Literal["both", "slave", "master"], ...] = ("both", "slave", "master")
AXES: Mapping[str, tuple[str, ...]] = {
    "start": tuple(START), "length": tuple(LENGTH), "id": tuple(ID), "address": tuple(ADDRESS),
    "middle": tuple(MIDDLE), "data": tuple(DATA), "check": tuple(CHECK), "end": tuple(END),
    "stuffing": tuple(STUFFING), "fields": tuple(FIELDS), "traffic": tuple(TRAFFIC), "role": ROLES,
}  # fmt: skip
Shape = Mapping[str, str]


def schema(shape: Shape, name: str) -> str:
    """The text of a schema."""
    parts = [
        START[shape["start"]], LENGTH[shape["length"]], ID[shape["id"]], ADDRESS[shape["address"]][0],
        MIDDLE[shape["middle"]], DATA[shape["data"]], CHECK[shape["check"]], END[shape["end"]],
    ]  # fmt: skip
    parts = [part for part in parts if part]
    names = [part.split(":")[0] for part in parts]
    checked = ", ".join(names[: names.index("check")] if "check" in names else names)
    stuffing = STUFFING[shape["stuffing"]].replace("@START", "start" if "start" in names else "")
    nodes = ADDRESS[shape["address"]][1]
    frame = [
        "frame:",
        "  parts:",
        *(f"    {part}".replace("@ALL", checked).replace("@ID", "id") for part in parts),
        *([f"  {stuffing}"] if stuffing else []),
    ]
    return "\n".join(_text(name, frame, nodes, shape))


def _text(name: str, frame: Sequence[str], nodes: str, shape: Shape) -> Iterator[str]:
    yield "qlinkgen: 1"
    yield f'protocol: {{name: {name}, title: S, revision: "1", source: this test, doc: A shape.}}'
    yield "byteorder: big"
    yield from frame
    yield f"bus: {{kind: master_slave, {nodes}baud: 9600, response_within: 1 ms}}"
    yield f"defaults: {{repeat: safe{', addressing: node' if nodes else ''}}}"
    yield from _traffic(shape)


def _traffic(shape: Shape) -> Iterator[str]:
    request, response, singles = TRAFFIC[shape["traffic"]]
    fields = FIELDS[shape["fields"]]
    if request is not None:
        yield "commands:"
        for number, which in enumerate(("set", "get"), 1):
            yield f"  {which}: {{id: {number}, doc: D., request: {_fields(request, fields)}, "
            yield f"        response: {_fields(response, fields) if response else 'none'}}}"
    if singles:
        yield "messages:"
        for number, direction in enumerate(singles, 3):
            said = "" if direction == "message" else f", direction: {direction}"
            yield f"  told{number}: {{id: {number}, doc: D.{said}, fields: {fields}}}"


def _fields(name: str, fields: str) -> str:
    return fields if name == "@F" else FIELDS[name]


def built(shape: Shape, name: str) -> Protocol | None:
    """The protocol of a shape, None if lint rejects it."""
    protocol, faults = loads(schema(shape, name), "shape.yaml")
    assert protocol or any(fault.severity == "error" for fault in faults)
    return protocol


def pairs() -> Iterator[tuple[Shape, Protocol]]:
    """Valid shapes, until each pair of options has occurred or was rejected a dozen times."""
    rng, keys = random.Random(1), tuple(AXES)
    missing = {
        ((a, one), (b, other))
        for a, b in itertools.combinations(keys, 2)
        for one in AXES[a]
        for other in AXES[b]
    }
    names = (f"s{number}" for number in itertools.count())
    name = next(names)
    while missing:
        wanted = dict(min(missing))
        tried = {min(missing)}
        for _ in range(12):
            some = [{key: rng.choice(AXES[key]) for key in keys} | wanted for _ in range(25)]
            shape = max(some, key=lambda each: len(missing & _pairs_of(each)))
            if protocol := built(shape, name):
                yield shape, protocol
                tried, name = _pairs_of(shape), next(names)
                break
        missing -= tried


def _pairs_of(shape: Shape) -> set[tuple[tuple[str, str], tuple[str, str]]]:
    return {((a, shape[a]), (b, shape[b])) for a, b in itertools.combinations(tuple(AXES), 2)}


GROUPS = "groups: {bits: 7, first: least}"
#: Frames of the other two kinds, with kinds of messages that fit them.
OTHERS = {
    "marked": (
        "frame: {marked: {marker: 0x80, header: {message: 0..2, address: 3..6}, end: 7, payload: 0..40}}",
        "nodes: 1..15, ",
        ("empty", "seven bits", "reserved seven bits", "open text"),
    ),
    "marked and checked": (
        (
            "frame:\n  marked: {marker: 0x80, header: {message: 0..2, address: 3..6}, end: 7, payload: 0..40,"
            " checksum: {role: checksum, type: u16, algorithm: crc-16/modbus, over: [payload],"
            " sent: [0..6, 7..13]}}"
        ),
        "nodes: 1..15, broadcast: 0, ",
        ("empty", "seven bits", "reserved seven bits", "open text"),
    ),
    "packet": (
        "frame: {packet: {id: {role: message, type: u8}, data: {role: payload, size: 0..40}}}",
        "",
        ("empty", "reserved alone", "constant alone", "reserved word and bits"),
    ),
    "checked packet": (
        (
            "frame: {packet: {id: {role: message, type: u8}, data: {role: payload, size: 0..40},"
            " check: {role: checksum, type: u16, algorithm: sum16, words: 2, rejected: 0}}}"
        ),
        "",
        ("empty", "reserved alone", "constant alone", "reserved word and bits"),
    ),
}
FIELDS["seven bits"] = f"{{a: {{type: u7, {GROUPS}}}, b: {{type: i14, {GROUPS}}}}}"
FIELDS["reserved seven bits"] = f"{{a: {{type: u7, {GROUPS}, reserved: true}}}}"
FIELDS["reserved word and bits"] = (
    "{gap: {type: u16, reserved: true}, b: {type: u64, bits: {s: {at: 0..31, signed: true}, t: 33}}}"
)


def others() -> Iterator[tuple[Shape, Protocol]]:
    """Marked frames and packets with every kind of traffic."""
    number = 0
    for kind, (frame, nodes, fields) in OTHERS.items():
        for which, traffic in itertools.product(fields, TRAFFIC):
            name, role = f"o{number}", ROLES[number % 3]
            shape = {"frame": kind, "fields": which, "traffic": traffic, "role": role}
            protocol, faults = loads("\n".join(_text(name, [frame], nodes, shape)), "other.yaml")
            assert protocol or any(fault.severity == "error" for fault in faults)
            if protocol:
                yield shape, protocol
                number += 1


@pytest.fixture(scope="module")
def headers(shared: Path) -> Path:
    """Give a folder with the header of each shape, and a file that includes them all."""
    folder = shared / "headers of shapes"
    with made_once(folder) as first:
        if first:
            _write(folder)
    return folder


def _write(folder: Path) -> None:
    lines = []
    for shape, protocol in itertools.chain(pairs(), others()):
        role = next(role for role in ROLES if role == shape["role"])
        (text,) = c.generate(protocol, Options(role=role)).values()
        (folder / f"{protocol.name}.h").write_text(f"/* {dict(shape)} */\n{text}", "utf-8")
        upper = protocol.name.upper()
        lines += [f"#define {upper}_ENABLE_{what} 1" for what in ("FLOAT", "NAMES")]
        lines.append(f'#include "{protocol.name}.h"')
    (folder / "use.c").write_text("\n".join([*lines, "int used(void);", "int used(void) { return 0; }", ""]))


@pytest.mark.parametrize("language", ["c99", "c++17"])
@pytest.mark.parametrize("compiler", ["gcc", "clang"])
def test_clean(compiler: str, language: str, headers: Path, require_tool: Callable[..., str]) -> None:
    form = ("-x", "c++" if "++" in language else "c", f"-std={language}", "-fsyntax-only")
    words = [require_tool(compiler, package=compiler), *form, *STRICT, "use.c"]
    done = subprocess.run(words, cwd=headers, capture_output=True, text=True, timeout=300, check=False)
    assert done.returncode == 0, done.stderr[:4000]


@pytest.mark.slow
def test_every_option_is_there(headers: Path) -> None:
    """Every option of every axis occurs in a valid schema."""
    text = "".join(path.read_text("utf-8").splitlines()[0] for path in headers.glob("*.h"))
    assert not [option for options in AXES.values() for option in options if f"'{option}'" not in text]
