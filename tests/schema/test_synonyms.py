"""Words of other tools and documents lead to the key or type that is meant."""

from __future__ import annotations

import pytest

from qlinkgen.errors import Fault
from qlinkgen.schema import loads

SCHEMA = """\
qlinkgen: 1
protocol: {{name: sample, revision: "1", source: this test}}
{top}
frame:
  parts:
    length: {{type: u8, counts: [data]}}
    id: {{role: message, type: u8}}
    node: {{role: address, type: u8}}
    data: {{role: payload, size: 0..100}}
    sum: {{type: u8, {part}}}
bus: {{kind: {kind}, nodes: 1..9, {bus}: 5 ms}}
defaults: {{addressing: node, repeat: safe}}
commands:
  go: {{{id}: 1, request: {{a: {field}}}, response: {{}}}}
"""
USUAL = {
    "top": "", "part": "algorithm: sum8, over: [length, id, node, data]", "kind": "master_slave",
    "bus": "response_within", "id": "id", "field": "u8",
}  # fmt: skip
RANGE, SCALE = "write range: first..last", "write scale: the value of one step, like 1/10"
SIZE = (
    "write the number in the type, like bytes[4] or u16[0..8]; a field that counts another has counts: FIELD"
)
TYPE = "write type: the name of one under enums"
_MATCH = "write the one whose check value for 123456789 matches the document: "
KEYS = {
    **dict.fromkeys(("endian", "endianness"), "write byteorder: little or big"),
    **dict.fromkeys(("min", "max", "minimum", "maximum", "min_value", "MaxValue"), RANGE),
    **dict.fromkeys(("factor", "multiplier", "resolution"), SCALE),
    **dict.fromkeys(("length", "size", "count", "len"), SIZE),
    **dict.fromkeys(("description", "comment"), "write doc: text"),
    **dict.fromkeys(("bitfield", "bit-fields", "mask"), "write bits: {name: first..last}"),
    **dict.fromkeys(("enum", "values", "choices"), TYPE),
    "value": "write const: the number",
    "initial": "write default: the value",
    "units": "write unit: mm",
    "padding": "write pad: 00",
    "encoding": "write as: bcd",
}
TYPES = {
    "float": "f32", "double": "f64", "half": "f16", "float64": "f64",
    "uint16_t": "u16", "int32_t": "i32", "uint8": "u8", "uint8_t[4]": "u8[4]", "s16": "i16", "INT16": "i16",
    "byte": "u8", "word": "u16", "dword": "u32", "qword": "u64", "short": "i16", "unsigned_short": "u16",
    "string": "text", "string[0..9]": "text[0..9]", "char[8]": "text[8]", "boolean": "bool", "blob": "bytes",
    "uint16be": "u16 with byteorder: big", "int32_le": "i32 with byteorder: little",
}  # fmt: skip


def faults_of(**changes: str) -> list[Fault]:
    return loads(SCHEMA.format(**USUAL | changes), "sample.yaml")[1]


def hint(**changes: str) -> str:
    (fault,) = faults_of(**changes)
    return fault.hint


def test_the_schema_is_right_without_them() -> None:
    assert faults_of() == []


@pytest.mark.parametrize(("word", "said"), KEYS.items())
def test_keys_of_fields(word: str, said: str) -> None:
    assert hint(field=f"{{type: u8, {word}: 1}}") == said


@pytest.mark.parametrize(("word", "meant"), TYPES.items())
def test_types(word: str, meant: str) -> None:
    assert hint(field=f'{{type: "{word}"}}') == f"write {meant}"


def test_a_type_of_the_file_may_have_such_a_name() -> None:
    assert faults_of(top="types: {word: {type: u8}}", field="word") == []


@pytest.mark.parametrize(
    ("changes", "said"),
    [
        ({"top": "endian: little"}, "write byteorder: little or big"),
        ({"top": "enum: {a: {type: u8}}"}, "write enums: {name: {type: u8, values: {one: 1}}}"),
        ({"top": "byteorder: little-endian"}, "write little"),
        ({"top": "byteorder: BE"}, "write big"),
        ({"bus": "timeout"}, "write response_within: 5 ms"),
        ({"kind": "master-slave"}, "write master_slave"),
        ({"id": "opcode"}, "write id: a number"),
        ({"part": "crc: sum8, over: [id]"}, "write algorithm: crc-16/modbus"),
        ({"part": "algorithm: bcc, over: [id]"}, _MATCH + "xor8 (31) or sum8 (DD)"),
        ({"part": "algorithm: lrc, over: [id]"}, _MATCH + "xor8 (31) or sum8-zero (23)"),
        ({"field": "{type: u8, bits: {b: {bit: 3}}}"}, "write at: first..last"),
    ],
)  # fmt: skip
def test_other_places(changes: dict[str, str], said: str) -> None:
    assert said in [fault.hint for fault in faults_of(**changes)]


@pytest.mark.parametrize(("changes", "number"), [({"id": "opcode"}, 1), ({"kind": "master-slave"}, 1)])
def test_one_error_for_one_word(changes: dict[str, str], number: int) -> None:
    assert len(faults_of(**changes)) == number


@pytest.mark.parametrize(
    ("group", "said"),
    [
        ("enums: {g: {type: uint8_t, values: {a: 1}}}", "write u8"),
        ("flags: {g: {type: word, values: {a: 1}}}", "write u16"),
    ],
)
def test_types_of_enums_and_flags(group: str, said: str) -> None:
    assert hint(top=group, field="g") == said


def test_types_of_parts() -> None:
    (fault,) = loads(SCHEMA.format(**USUAL).replace("sum: {type: u8", "sum: {type: uint8_t"), "x.yaml")[1]
    assert fault.hint == "write u8"
