"""Choices by an earlier field: one value in every output."""

from __future__ import annotations

import json
from functools import cache
from pathlib import Path
from typing import Any

import pytest
from click.testing import CliRunner
from construct import ConstructError

from qlinkgen.backends import c, construct, python
from qlinkgen.backends.base import Options
from qlinkgen.cli import cli
from qlinkgen.model.protocol import Protocol
from qlinkgen.plan import plan_of
from qlinkgen.plan.content import BadContent, Raw, Unsendable, pack, unpack
from qlinkgen.plan.payload import PayloadPlan
from qlinkgen.schema import loads
from tests.support.whole.trial import run_text

SCHEMA = """
qlinkgen: 1
protocol: {name: opt, title: Options, revision: "1", source: Example, doc: Options of several types}
byteorder: big
enums: {option: {type: u8, values: {unit_size: 1, magic: 5, end: 7}}}
types: {span: {fields: {first: u16, last: u16}}}
frame:
  parts:
    start: AA 55
    length: {type: u8, counts: [code, data]}
    code: {role: message, type: u8}
    data: {role: payload, size: 0..40}
    sum: {type: u8, algorithm: sum8, over: [length, code, data]}
bus: {kind: master_slave}
defaults: {addressing: none, repeat: safe}
commands:
  configure:
    id: 1
    request:
      kind: option
      value:
        switch: kind
        cases:
          unit_size: {size: {type: u16, range: 1..1500}}
          magic: u32
          end: {}
          8..9: span
          10: {type: i16, scale: 1/10}
          11: "u16[0..3]"
        default: bytes
    response:
      head: {type: u8, bits: {size: 0..1, more: 2}}
      value: {switch: head.size, cases: {0: {}, 1: i8, 2: i16, 3: f32}}
      tail: {type: u8, default: 3}
"""
#: Values and payloads of each case.
RIGHT: list[tuple[dict[str, Raw], str]] = [
    ({"kind": 1, "value": {"size": 9}}, "01 00 09"),
    ({"kind": 5, "value": 16}, "05 00 00 00 10"),
    ({"kind": 7, "value": None}, "07"),
    ({"kind": 9, "value": {"first": 1, "last": 2}}, "09 00 01 00 02"),
    ({"kind": 10, "value": -5}, "0A FF FB"),
    ({"kind": 11, "value": [1, 2]}, "0B 00 01 00 02"),
    ({"kind": 99, "value": b"abc"}, "63 61 62 63"),
]
#: Values that do not fit their case.
WRONG: list[dict[str, Raw]] = [
    {"kind": 1, "value": None},
    {"kind": 1, "value": 9},
    {"kind": 1, "value": {"size": 0}},
    {"kind": 5, "value": b"abcd"},
    {"kind": 5, "value": None},
    {"kind": 7, "value": 0},
    {"kind": 11, "value": [1, 2, 3, 4]},
    {"kind": 99, "value": 5},
]


@cache
def protocol() -> Protocol:
    found, faults = loads(SCHEMA, "opt.yaml")
    assert found is not None, faults
    return found


@cache
def module() -> Any:
    return python.load(protocol())


def payload() -> PayloadPlan:
    return plan_of(protocol()).message("configure.request").payload


@pytest.mark.parametrize(("values", "data"), RIGHT)
def test_the_interpreter_packs_and_unpacks_each_case(values: dict[str, Raw], data: str) -> None:
    assert pack(payload(), values) == bytes.fromhex(data)
    assert unpack(payload(), bytes.fromhex(data)) == values


@pytest.mark.parametrize("values", WRONG)
def test_a_value_that_does_not_fit_its_case_is_refused(values: dict[str, Raw]) -> None:
    with pytest.raises(Unsendable, match=r"^value"):
        pack(payload(), values)


def test_an_error_in_a_case_names_the_value() -> None:
    with pytest.raises(BadContent) as caught:
        unpack(payload(), bytes.fromhex("01 00 00"))
    assert (caught.value.kind, caught.value.field) == ("range", "value.size")
    with pytest.raises(BadContent) as caught:
        unpack(payload(), bytes.fromhex("05 00 00"))
    assert (caught.value.kind, caught.value.field) == ("length", "value")


def native(value: Raw, kind: Raw) -> Any:
    """A value for generated Python."""
    if isinstance(value, dict):
        return module().RECORDS["span" if "first" in value else "configure_request_value_unit_size"](**value)
    return value / 10 if kind == 10 and isinstance(value, int) else value


@pytest.mark.parametrize(("values", "data"), RIGHT)
def test_python_has_one_attribute(values: dict[str, Raw], data: str) -> None:
    message = module().ConfigureRequest(kind=values["kind"], value=native(values["value"], values["kind"]))
    assert message.to_bytes() == bytes.fromhex(data)
    assert module().ConfigureRequest.from_bytes(bytes.fromhex(data)) == message


@pytest.mark.parametrize("values", WRONG)
def test_python_refuses_what_does_not_fit(values: dict[str, Raw]) -> None:
    message = module().ConfigureRequest(kind=values["kind"], value=native(values["value"], values["kind"]))
    with pytest.raises(module().EncodeError) as caught:
        message.to_bytes()
    assert caught.value.field == "value"


def test_python_names_the_range_of_the_case() -> None:
    message = module().ConfigureRequest(kind=5, value=-1)
    with pytest.raises(
        module().EncodeError, match=r"value: -1 cannot be sent; give a whole number, 0\.\.4294967295"
    ):
        message.to_bytes()
    record = module().RECORDS["span"](first=1, last=2)
    with pytest.raises(module().EncodeError, match="it is present only if kind is 1"):
        module().ConfigureRequest(kind=1, value=record).to_bytes()


@pytest.mark.parametrize(("values", "data"), RIGHT)
def test_construct_has_one_key(values: dict[str, Raw], data: str) -> None:
    live = construct.live(protocol())
    given = dict(values, value=-0.5) if values["kind"] == 10 else values
    assert live.payload("configure.request", given) == bytes.fromhex(data)
    wire = live.wrap("configure.request", bytes.fromhex(data))
    fields = live.parse("request", wire)["fields"]
    assert set(fields) == {"kind", "value"}
    assert fields["value"] == given["value"]


@pytest.mark.parametrize("values", WRONG)
def test_construct_refuses_what_does_not_fit(values: dict[str, Raw]) -> None:
    with pytest.raises(ConstructError):
        construct.live(protocol()).payload("configure.request", values)


@pytest.mark.parametrize(
    ("given", "shown"),
    [
        (["kind=unit_size", 'value={"size": 9}'], {"kind": "unit_size", "value": {"size": 9}}),
        (["kind=end"], {"kind": "end", "value": None}),
        (["kind=magic"], {"kind": "magic", "value": 0}),
        (["kind=10", "value=1.5"], {"kind": 10, "value": 1.5}),
        (["kind=8", 'value={"last": 2}'], {"kind": 8, "value": {"first": 0, "last": 2}}),
        (["kind=12", "value=6162"], {"kind": 12, "value": "6162"}),
    ],
)
def test_json_has_one_key(given: list[str], shown: dict[str, object], tmp_path: Path) -> None:
    file = tmp_path / "opt.yaml"
    file.write_text(SCHEMA)

    def run(*words: str) -> str:
        done = CliRunner().invoke(cli, [words[0], str(file), *words[1:]])
        assert done.exit_code == 0, done.output
        return done.output.strip()

    wire = run("encode", "configure", *given)
    printed = run("decode", wire)
    assert json.loads(printed)["fields"] == shown
    assert run("encode", "--json", printed) == wire
    assert "value" in run("explain", wire) or shown["value"] is None


def test_c_has_a_union() -> None:
    (text,) = c.generate(protocol(), Options()).values()
    start = text.index("typedef struct opt_configure_response {")
    assert "union {\n        int8_t case_1;\n        int16_t case_2;" in text[start:]
    assert "message->value.unit_size" in text


def test_all_outputs_agree() -> None:
    assert run_text(SCHEMA).differences == []
