"""Integers of more than 64 bits: their bytes and ranges, two halves in C, what they cannot have."""

from __future__ import annotations

import subprocess
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from construct import ConstructError

from qlinkgen.backends import c, construct, python
from qlinkgen.backends.base import Options
from qlinkgen.plan import plan_of
from qlinkgen.plan.content import BadContent, unpack
from tests.scalars.protocols import faults_of, protocol_of
from tests.support.cdriver import WARNINGS

BIG = 0x0102030405060708090A
REQUEST = f"""
      whole: u128
      odd: {{type: i72, byteorder: little, range: -5..2361183241434822606847}}
      part: {{type: u80, default: {BIG}}}
      mark: {{type: u96, const: 0xFF}}
"""
VALUES: dict[str, Any] = {"whole": (1 << 128) - 2, "odd": -2, "part": BIG}
PAYLOAD = bytes.fromhex("ff" * 15 + "fe" + "fe" + "ff" * 8 + "0102030405060708090a" + "00" * 11 + "ff")


@pytest.fixture(scope="module")
def codec() -> Any:
    return python.load(protocol_of(REQUEST))


def test_bytes(codec: Any) -> None:
    live = construct.live(protocol_of(REQUEST))
    assert codec.PutRequest(**VALUES).to_bytes() == PAYLOAD == live.payload("put.request", VALUES)
    found, parsed = codec.PutRequest.from_bytes(PAYLOAD), live.messages["put.request"].parse(PAYLOAD)
    assert {name: getattr(found, name) for name in VALUES} == VALUES
    assert {name: parsed[name] for name in VALUES} == VALUES
    assert codec.PutRequest().part == BIG


@pytest.mark.parametrize(
    ("field", "value"), [("whole", 1 << 128), ("whole", -1), ("odd", -6), ("odd", 1 << 72), ("part", 1 << 80)]
)
def test_what_cannot_be_sent(codec: Any, field: str, value: int) -> None:
    with pytest.raises(codec.EncodeError) as caught:
        codec.PutRequest(**VALUES | {field: value}).to_bytes()
    assert caught.value.field == field
    with pytest.raises(ConstructError):
        construct.live(protocol_of(REQUEST)).payload("put.request", VALUES | {field: value})


@pytest.mark.parametrize(("field", "at", "byte"), [("odd", 16, 0xF0), ("mark", 35, 1)])
def test_what_is_refused_when_received(codec: Any, field: str, at: int, byte: int) -> None:
    payload = bytearray(PAYLOAD)
    payload[at] = byte
    with pytest.raises(codec.DecodeError) as caught:
        codec.PutRequest.from_bytes(bytes(payload))
    assert (caught.value.kind, caught.value.field) == ("range", field)
    with pytest.raises(BadContent):
        unpack(plan_of(protocol_of(REQUEST)).message("put").payload, bytes(payload))


PROGRAM = r"""
#include "probe.h"
#include <stdio.h>
int main(void)
{
    probe_put_request_t message = PROBE_PUT_REQUEST_INIT;
    uint8_t payload[PROBE_PUT_REQUEST_MAX_SIZE];
    printf("%llx %llx\n", (unsigned long long)message.part.high, (unsigned long long)message.part.low);
    message.whole.high = UINT64_MAX;
    message.whole.low = UINT64_MAX - 1U;
    message.odd.high = UINT64_MAX;
    message.odd.low = UINT64_MAX - 1U;
    printf("%d\n", probe_put_request_encode(&message, payload, sizeof payload));
    for (size_t index = 0U; index < sizeof payload; ++index) {
        printf("%02x", payload[index]);
    }
    message.odd.low = 0U;
    printf("\n%d", probe_put_request_decode(&message, payload, sizeof payload));
    printf(" %llx %llx\n", (unsigned long long)message.odd.high, (unsigned long long)message.odd.low);
    message.odd.low -= 5U;
    printf("%d\n", probe_put_request_encode(&message, payload, sizeof payload));
    return 0;
}
"""


def test_halves_in_c(tmp_path: Path, require_tool: Callable[..., str]) -> None:
    (header,) = c.generate(protocol_of(REQUEST), Options()).values()
    (tmp_path / "probe.h").write_text(header)
    (tmp_path / "probe.c").write_text(PROGRAM)
    program = tmp_path / "probe"
    words = [require_tool("gcc", package="gcc"), *WARNINGS, "-std=c99", "probe.c", "-o", str(program)]
    subprocess.run(words, cwd=tmp_path, check=True)
    said = subprocess.run([program], capture_output=True, text=True, check=True).stdout.splitlines()
    assert said == ["102 30405060708090a", "47", PAYLOAD.hex(), "0 ffffffffffffffff fffffffffffffffe", "-3"]


@pytest.mark.parametrize(
    ("field", "text"),
    [
        ("u129", "u129 has 129 bits; use 1 to 128"),
        ("u100",
         "u100 has 100 bits, not whole bytes; use u8, u16, u24 ... u128, bits inside an integer, or groups"),
        ("{type: u128, scale: 1/10}", "'scale' has no effect on an integer of more than 64 bits; remove it"),
        ("{type: u128, as: bcd}", "'as' has no effect on an integer of more than 64 bits; remove it"),
        ("{type: u128, bits: {b: 0}}", "an integer with bits cannot have 128 bits; use at most 64"),
        ('"u128[2]"', "an item of an array cannot have 128 bits; use bytes, or at most 64 bits"),
        ("{type: u72, groups: {bits: 7, first: least}}",
         "'groups' has no effect on an integer of more than 64 bits; remove it"),
    ],
)  # fmt: skip
def test_wrong_keys(field: str, text: str) -> None:
    assert text in [f"{fault.message}; {fault.hint}" for fault in faults_of(f"{{a: {field}}}")]


def test_an_enum_is_narrower() -> None:
    types = "enums: {g: {type: u72, values: {a: 1}}}"
    assert "unknown-type" in [fault.rule for fault in faults_of("{a: g}", types=types)]
