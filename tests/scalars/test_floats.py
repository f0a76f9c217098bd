"""Floating-point numbers: their bytes, NaN and infinities, ranges, what does not fit, and their bits in C."""

from __future__ import annotations

import json
import math
import struct
import subprocess
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from construct import ConstructError

from qlinkgen.backends import c, construct, python
from qlinkgen.backends.base import Options
from qlinkgen.cli.codec import build, fields
from qlinkgen.model.floats import Float
from qlinkgen.plan import plan_of
from qlinkgen.plan.content import BadContent, Unsendable, pack, unpack
from tests.scalars.protocols import faults_of, protocol_of
from tests.support.cdriver import WARNINGS

REQUEST = """
      half: f16
      single: {type: f32, unit: V}
      swapped: {type: f32, byteorder: little}
      double: {type: f64, byteorder: little, default: 1e-3}
      ratio: {type: f32, range: 0..1, default: 0.5}
      above: {type: f64, range: 5..9.5}
      mark: {type: f32, const: -0.5}
      nothing: {type: f32, default: nan}
      row: "f32[2]"
      back: {type: "f16[2]", byteorder: little, range: -1..1}
      count: {type: u8, counts: rest}
      rest: {type: "f64[0..3]", byteorder: little}
"""
VALUES: dict[str, Any] = {
    "half": 0.5, "single": -2.0, "swapped": 1.5, "double": 0.1, "ratio": -0.0, "above": 5, "nothing": 1.0,
    "row": [1.0, math.inf], "back": [-1, 0.25], "rest": [2.5],
}  # fmt: skip
PAYLOAD = bytes.fromhex(
    "3800 c0000000 0000c03f 9a9999999999b93f 80000000 4014000000000000 bf000000 3f800000"
    "3f800000 7f800000 00bc 0034 01 0000000000000440"
)


@pytest.fixture(scope="module")
def codec() -> Any:
    return python.load(protocol_of(REQUEST))


@pytest.fixture(scope="module")
def structures() -> construct.Live:
    return construct.live(protocol_of(REQUEST))


def test_bytes(codec: Any, structures: construct.Live) -> None:
    made = codec.PutRequest(**VALUES)
    assert made.to_bytes() == PAYLOAD
    assert codec.PutRequest.from_bytes(PAYLOAD) == made
    assert structures.payload("put.request", VALUES) == PAYLOAD
    parsed = structures.messages["put.request"].parse(PAYLOAD)
    assert {name: parsed[name] for name in VALUES} == VALUES
    assert codec.PutRequest(half=1, above=6.0, row=[0, 0], back=[0, 0]).double == 1e-3


def test_the_interpreter_has_bits() -> None:
    plan = plan_of(protocol_of(REQUEST)).message("put").payload
    found = unpack(plan, PAYLOAD)
    assert (found["half"], found["row"]) == (0x3800, [0x3F800000, 0x7F800000])
    assert pack(plan, found) == PAYLOAD


@pytest.mark.parametrize("special", [math.inf, -math.inf, math.nan])
def test_infinities_and_nan_pass(codec: Any, structures: construct.Live, special: float) -> None:
    given = VALUES | {"half": special, "single": special, "row": [special, special], "rest": [special]}
    payload = codec.PutRequest(**given).to_bytes()
    assert payload == structures.payload("put.request", given)
    found = codec.PutRequest.from_bytes(payload)
    seen = [found.half, found.single, *found.row, *found.rest]
    assert all(math.isnan(each) if math.isnan(special) else each == special for each in seen)


@pytest.mark.parametrize(
    ("name", "bits"), [("f16", 0x7D01), ("f32", 0x7F800001), ("f64", 0x7FF0000000000001)]
)
def test_a_signalling_nan_stays_a_nan(name: str, bits: int) -> None:
    """Whether it still signals is not promised."""
    codec = python.load(protocol_of(f"{{a: {name}}}"))
    found = codec.PutRequest.from_bytes(bits.to_bytes(int(name[1:]) // 8, "big"))
    assert math.isnan(found.a)
    kind = Float(int(name[1:]))
    assert math.isnan(kind.value(int.from_bytes(found.to_bytes(), "big")))


@pytest.mark.parametrize(
    ("field", "value"),
    [
        *(("ratio", each) for each in (math.nan, math.inf, -0.1, 1.0000001, "0.5", b"1")),
        *(("above", each) for each in (4.999, 9.50001)),
        *(("half", each) for each in (65520.0, -1e5)),
        *(("single", each) for each in (1e39, 10**400, "1")),
        *(("row", each) for each in ([1.0, 1e39], [1.0], [1.0, "1"])),
        *(("back", each) for each in ([0.0, 1.5], [math.nan, 0])),
        ("rest", [0.0] * 4),
    ],
)
def test_what_cannot_be_sent(codec: Any, structures: construct.Live, field: str, value: object) -> None:
    given = VALUES | {field: value}
    with pytest.raises(codec.EncodeError) as caught:
        codec.PutRequest(**given).to_bytes()
    assert caught.value.field == field
    with pytest.raises((ConstructError, OverflowError)):
        structures.payload("put.request", given)


@pytest.mark.parametrize(
    ("field", "at", "data"),
    [
        *(("ratio", 18, struct.pack(">f", each)) for each in (math.nan, 1.5, -0.5, math.inf)),
        ("above", 22, struct.pack(">d", 4.9)),
        ("mark", 30, struct.pack(">f", 0.5)),
        ("back", 46, struct.pack("<e", math.nan)),
    ],
)
def test_what_is_refused_when_received(
    codec: Any, structures: construct.Live, field: str, at: int, data: bytes
) -> None:
    payload = PAYLOAD[:at] + data + PAYLOAD[at + len(data) :]
    with pytest.raises(codec.DecodeError) as caught:
        codec.PutRequest.from_bytes(payload)
    assert (caught.value.kind, caught.value.field) == ("range", field)
    with pytest.raises(BadContent) as refused:
        unpack(plan_of(protocol_of(REQUEST)).message("put").payload, payload)
    assert (refused.value.kind, refused.value.field) == ("range", field)
    with pytest.raises(ConstructError):
        structures.messages["put.request"].parse(payload)


def test_the_interpreter_refuses_bits_out_of_range() -> None:
    plan = plan_of(protocol_of("{a: {type: f32, range: -1..0}}")).message("put").payload
    for legal in (0, 0x80000000, 0xBF800000):
        assert pack(plan, {"a": legal}) == legal.to_bytes(4, "big")
    for wrong in (1, 0xBF800001, 0x7FC00000, 0xFFC00000):
        with pytest.raises(Unsendable):
            pack(plan, {"a": wrong})


def test_json() -> None:
    protocol = protocol_of("{a: f32, b: 'f64[0..3]'}")
    codec, message = python.load(protocol), protocol.message("put")
    given: Any = {"a": "nan", "b": ["-inf", "2.5", 1]}
    found = codec.PutRequest.from_bytes(build(codec, message, given, {}).to_bytes())
    assert json.dumps(fields(message, found)) == '{"a": "nan", "b": ["-inf", 2.5, 1.0]}'


@pytest.mark.parametrize(
    ("request_", "text"),
    [
        ("{a: {type: f32, scale: 1/10}}", "'scale' has no effect on f32; remove it, or use an integer type"),
        ("{a: {type: f64, offset: 1}}", "'offset' has no effect on f64; remove it, or use an integer type"),
        ("{a: {type: f32, raw_range: 0..1}}", "'raw_range' has no effect on f32; use range"),
        ("{a: {type: f16, range: 0..70000}}", "a bound does not fit f16; use a wider type"),
        ("{a: {type: f32, range: 0..1, default: 2}}", "'2' is out of range; use 0.0..1.0"),
        ("{a: {type: f32, range: 0..1, default: nan}}", "'nan' is out of range; use 0.0..1.0"),
        ("{a: {type: f32, default: 1e39}}", "'1e39' does not fit f32; use a wider type or another number"),
        ("{a: {type: f32, default: true}}", "'true' is not a number; write a number, nan, inf or -inf"),
        ("{a: {type: f32, groups: {bits: 7, first: least}}}",
         "f32 cannot be sent in groups of 7 bits; use an integer, or whole bytes"),
        ("{a: {type: f32, bits: {b: 0}}}", "only plain integers can have bits; use u8, u16 and so on"),
        ("{a: {type: u32, bits: {b: {at: 0..15, type: f16}}}}",
         "'f16' is not the type of a bit field; omit type, and write signed: true for a signed number"),
        ("{a: {type: f32, counts: b}, b: bytes}", "f32 cannot count; use an unsigned integer"),
    ],
)  # fmt: skip
def test_wrong_keys(request_: str, text: str) -> None:
    assert text in [f"{fault.message}; {fault.hint}" for fault in faults_of(request_)]


def test_an_echo_needs_an_exact_number() -> None:
    (fault,) = faults_of("{a: f32}", response="{a: {type: f32, echo: true}}")
    assert (fault.rule, fault.hint) == ("bad-echo", "remove echo")


def test_a_type_cannot_be_called_so() -> None:
    assert {"type-clash"} <= {each.rule for each in faults_of("{a: u8}", types="types: {f32: {type: u8}}")}


PROGRAM = r"""
#include "probe.h"
#include <stdio.h>
int main(void)
{
    probe_put_request_t message = PROBE_PUT_REQUEST_INIT;
    for (uint32_t bits = 0U; bits < 0x10000U; ++bits) {
        const float value = probe_f16_value((uint16_t)bits);
        printf("%lx %x\n", (unsigned long)probe_f32_bits(value), (unsigned)probe_f16_bits(value));
    }
    for (uint32_t bits = 0x33000000U; bits < 0x48000000U; bits += 997U) {
        printf("%x\n", (unsigned)probe_f16_bits(probe_f32_value(bits)));
    }
    message.b = probe_f64_bits(0.1);
    printf("%llx %d\n", (unsigned long long)message.b, probe_f64_value(message.b) == 0.1);
    return 0;
}
"""


def test_conversions_in_c(tmp_path: Path, require_tool: Callable[..., str]) -> None:
    """Every number of 16 bits, and rounding to them, as Python converts them."""
    (header,) = c.generate(protocol_of("{a: f16, b: {type: f64, range: 0..1}}"), Options()).values()
    (tmp_path / "probe.h").write_text(header)
    (tmp_path / "probe.c").write_text(PROGRAM)
    program = tmp_path / "probe"
    words = [require_tool("gcc", package="gcc"), *WARNINGS, "-std=c99", "-DPROBE_ENABLE_FLOAT=1", "probe.c"]
    subprocess.run([*words, "-o", program], cwd=tmp_path, check=True)
    lines = subprocess.run([program], capture_output=True, text=True, check=True).stdout.splitlines()
    for bits, line in enumerate(lines[:0x10000]):
        value = Float(16).value(bits)
        single, back = (int(word, 16) for word in line.split())
        if math.isnan(value):
            assert math.isnan(Float(32).value(single))
            assert math.isnan(Float(16).value(back))
        else:
            assert (single, back) == (Float(32).raw(value), bits)
    for bits, line in zip(range(0x33000000, 0x48000000, 997), lines[0x10000:-1], strict=True):
        value = Float(32).value(bits)
        assert int(line, 16) == (Float(16).raw(value) if value < 65520 else 0x7C00), hex(bits)
    assert lines[-1] == "3fb999999999999a 1"


def test_no_float_in_c_unless_asked(tmp_path: Path, require_tool: Callable[..., str]) -> None:
    (header,) = c.generate(protocol_of("{a: f16, b: {type: f64, range: 0..1}}"), Options()).values()
    assert "uint16_t a; /* bits of an f16 */" in header
    (tmp_path / "probe.c").write_text(header)
    words = [
        require_tool("gcc", package="gcc"),
        "-std=c99",
        "-Dfloat=?",
        "-Ddouble=?",
        "-fsyntax-only",
        "probe.c",
    ]
    subprocess.run(words, cwd=tmp_path, check=True)
