"""Check values and derived numbers among the fields of messages and records."""

from __future__ import annotations

import pytest

from qlinkgen.backends import construct, python
from qlinkgen.plan import plan_of
from qlinkgen.plan.content import BadContent, pack, unpack
from tests.scalars.protocols import faults_of, protocol_of

_WORD = "types: {word: {fields: {value: u16, crc: {type: u8, algorithm: crc-8/nrsc-5, over: [value]}}}}"
#: From the interface description of the sensor SCD30: 439 ppm, 27.2 degrees and 48.8 percent, as floats.
_SENSOR = bytes.fromhex("43DBCB 8C2E8F 41D970 E7FFF5 4243BF 3A1B74")


def test_words_of_a_sensor_have_a_check_value_each() -> None:
    payload = plan_of(protocol_of('{words: "word[6]"}', types=_WORD)).message("put.request").payload
    values = unpack(payload, _SENSOR)
    numbers = (0x43DB, 0x8C2E, 0x41D9, 0xE7FF, 0x4243, 0x3A1B)
    assert values == {"words": [{"value": number} for number in numbers]}
    assert pack(payload, values) == _SENSOR
    with pytest.raises(BadContent) as caught:
        unpack(payload, _SENSOR.replace(b"\x8f", b"\x8e"))
    assert (caught.value.kind, caught.value.field, caught.value.offset) == ("crc", "words[1].crc", 5)


@pytest.mark.parametrize(
    ("fields", "right", "wrong", "kind"),
    [
        (
            "{start: u32, check: {type: u8, algorithm: xor8, over: [start]}}",
            "0102040F 08",
            "0102040F 09",
            "crc",
        ),
        ("{count: u8, inverse: {type: u8, equals: ~count}}", "0B F4", "0B F5", "range"),
        ("{count: u8, more: {type: u8, equals: count + 250}}", "0B 05", "0B 06", "range"),
        ("{less: {type: u16, const: [300, 7]}, end: u8}", "012C 01", "012B 01", "range"),
        (
            '{n: {type: u8, counts: run}, run: "u8[0..4]", s: {type: u16, algorithm: sum16, over: [n, run]}}',
            "02 FE FE 01FE",
            "02 FE FE 01FD",
            "crc",
        ),
    ],
)
def test_targets_refuse_a_wrong_number(fields: str, right: str, wrong: str, kind: str) -> None:
    protocol = protocol_of(fields)
    payload = plan_of(protocol).message("put.request").payload
    values = unpack(payload, bytes.fromhex(right))
    assert pack(payload, values) == bytes.fromhex(right)
    with pytest.raises(BadContent, match=kind):
        unpack(payload, bytes.fromhex(wrong))
    module, live = python.load(protocol), construct.live(protocol)
    message = module.PutRequest(**values)
    frame = message.to_frame()
    assert module.PutRequest.from_checked(frame) == message
    assert live.payload("put.request", values) == bytes.fromhex(right)
    spoilt = bytearray(frame.replace(bytes.fromhex(right), bytes.fromhex(wrong)))
    spoilt[-1] = sum(spoilt[1:-1]) & 0xFF
    with pytest.raises(module.DecodeError) as caught:
        module.decode_request(bytes(spoilt))
    assert caught.value.kind == kind
    with pytest.raises(Exception, match=f"^{kind}"):
        live.parse("request", bytes(spoilt))


def test_the_other_value_of_a_constant_is_accepted() -> None:
    payload = (
        plan_of(protocol_of("{less: {type: u16, const: [300, 7]}, end: u8}")).message("put.request").payload
    )
    assert unpack(payload, bytes.fromhex("0007 01")) == unpack(payload, bytes.fromhex("012C 01"))


def test_a_count_sends_the_number_less_its_offset() -> None:
    fields = '{n: {type: u8, counts: run, offset: 1}, inverse: {type: u8, equals: ~n}, run: "u8[1..256]"}'
    payload = plan_of(protocol_of(fields)).message("put.request").payload
    assert pack(payload, {"run": [7] * 256}) == bytes.fromhex("FF 00") + bytes([7] * 256)
    assert unpack(payload, bytes.fromhex("00 FF 05")) == {"run": [5]}
    with pytest.raises(BadContent, match="length"):
        unpack(payload, bytes.fromhex("01 FE 05"))


def test_a_place_that_depends_on_values_is_refused() -> None:
    fields = '{flag: bool, list: {type: "u8[3]", if: flag}, sum: {type: u8, algorithm: sum8, over: [list]}}'
    (fault,) = faults_of(fields)
    assert fault.rule == "bad-derivation"
