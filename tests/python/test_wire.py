"""Facts of the documents and corner cases, by their bytes."""

from __future__ import annotations

import itertools
import random
from binascii import crc_hqx
from decimal import Decimal
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from qlinkgen.model.checksum import catalogue
from tests.python.protocols import EVERY, build, directions, module, protocol, stream, wire_of


def events(decoder: Any, wire: bytes) -> list[Any]:
    return [*decoder.feed(wire), *decoder.finish()]


# Q.link


def test_stuffing_is_undone_exactly() -> None:
    qlink = module("qlink")
    for size in range(7):
        for data in itertools.product((0xA5, 0x00, 0x01), repeat=size):
            sent = qlink.NodeProgramLoadRequest(node=1, counter=0xA5, program_data=bytes(data))
            wire = sent.to_frame()
            assert b"\xa5\xa5" not in wire[1:]
            assert wire.count(b"\xa5\x00") >= 1 + data.count(0xA5)
            assert qlink.decode_request(wire) == sent
            assert qlink.StreamDecoder("request").feed(wire) == [sent]


def frame_with_crc_ending_in_a5(qlink: Any) -> Any:
    found = (qlink.MotorPositionResponse(node=1, position=number) for number in itertools.count())
    return next(m for m in found if m.to_frame().endswith(b"\xa5\x00"))


def test_an_inserted_byte_after_the_last_one_is_consumed_or_missing() -> None:
    qlink = module("qlink")
    message = frame_with_crc_ending_in_a5(qlink)
    wire = message.to_frame()
    after = qlink.MotorPositionResponse(node=1, position=7)
    assert qlink.decode_response(wire) == qlink.decode_response(wire[:-1]) == message
    for between in (wire, wire[:-1]):
        decoder = qlink.StreamDecoder("response")
        assert decoder.feed(between[: len(wire) - 1]) == [message]  # at the last byte of the checksum
        assert events(decoder, between[len(wire) - 1 :] + after.to_frame()) == [after]
        assert decoder.counters.skipped == 0


@pytest.mark.parametrize("run", range(2, 8))
def test_of_a_run_of_marks_the_last_two_are_the_preamble(run: int) -> None:
    qlink = module("qlink")
    message = qlink.MotionRequest(node=2, segments=[1, 2])
    decoder = qlink.StreamDecoder("request")
    assert events(decoder, b"\xa5" * run + message.to_frame()[2:]) == [message]
    assert decoder.counters.skipped == run - 2


def test_a_new_preamble_aborts_a_frame() -> None:
    qlink = module("qlink")
    wire = qlink.MotionRequest(node=2, segments=[1, 2]).to_frame()
    first, second = events(qlink.StreamDecoder("request"), wire[:7] + wire)
    assert (first.kind, first.offset, first.raw) == ("truncated", 0, wire[:7])
    assert second.segments == [1, 2]


def test_an_empty_first_request_is_the_default_one() -> None:
    qlink = module("qlink")
    assert qlink.NodeProgramLoadRequest.from_bytes(b"", node=4) == qlink.NodeProgramLoadRequest(node=4)
    body = bytes((4, 6, 4))
    wire = b"\xa5\xa5" + body + crc_hqx(body, 0xFFFF).to_bytes(2, "big")
    assert qlink.decode_request(wire) == qlink.NodeProgramLoadRequest(node=4, counter=0, program_data=b"")


def test_the_least_significant_byte_of_outputs_is_sent_first() -> None:
    assert module("qlink").WriteReadRequest(node=1, outputs=0x030201).to_bytes() == bytes((1, 2, 3))


def test_an_unknown_number_of_an_enum_is_kept() -> None:
    qlink = module("qlink")
    back = qlink.NodeSetupRequest.from_bytes(bytes((1, 10, 10, 77)))
    assert back.position_type == 77
    assert type(back.position_type) is int
    known = qlink.NodeSetupRequest.from_bytes(bytes((1, 10, 10, 2))).position_type
    assert known is qlink.PositionType.METRONIX
    assert (known.name, known, repr(known)) == ("METRONIX", 2, "PositionType.METRONIX")


@pytest.mark.parametrize("algorithm", catalogue(16), ids=lambda each: each.name)
def test_a_codec_has_any_16_bit_algorithm(algorithm: Any) -> None:
    qlink = module("qlink")
    message = qlink.MotionRequest(node=3, counter=0xA5, segments=[0xA5A5, 1])
    before = message.to_frame()
    codec = qlink.Codec(algorithm.name.upper())
    assert codec.checksum.name == algorithm.name
    wire = codec.encode(message)
    frame = wire[2:].replace(b"\xa5\x00", b"\xa5")
    assert int.from_bytes(frame[-2:], "big") == algorithm.compute(frame[:-2])
    assert codec.decode_request(wire) == message
    assert events(codec.StreamDecoder("request"), b"\xa5" + wire) == [message]
    for junk in (b"", b"\xa5", b"\xa5\xa5", b"\xa5\xa5\x04", b"\0\0\0\0", b"\0\0\0\0\0\0\0"):
        with pytest.raises(qlink.DecodeError):
            codec.decode_request(junk)
    # The module keeps the algorithm of the schema.
    assert message.to_frame() == before
    assert qlink.encode(message) == before
    assert qlink.decode_request(before) == message
    if algorithm.name != "crc-16/ibm-3740" and wire != before:
        with pytest.raises(qlink.DecodeError):
            qlink.decode_request(wire)


def test_a_codec_needs_a_known_algorithm() -> None:
    with pytest.raises(ValueError, match="xmodem"):
        module("qlink").Codec("crc-17")


def test_values_round_to_the_nearest_step_and_ties_to_the_even_one() -> None:
    qlink = module("qlink")
    for value, raw in (
        (0.05, 1),
        (0.25, 2),
        (0.35, 3),
        (0.75, 8),
        (25.5, 255),
        (25.549, 255),
        (1, 10),
        (True, 10),
    ):
        assert qlink.NodeSetupRequest(node=1, node_number=1, t1_delay=value).to_bytes()[1] == raw, value
    with pytest.raises(qlink.EncodeError):
        qlink.NodeSetupRequest(node=1, node_number=1, t1_delay=25.56).to_bytes()


# Trio


def test_a_negative_fraction_is_a_negative_integer_and_a_positive_fraction() -> None:
    trio = module("trio")
    payload = trio.DirectVariableTransfer(address=1, value=Decimal("-0.25")).to_bytes()
    whole = sum(byte << 7 * index for index, byte in enumerate(payload[2:7]))
    fraction = sum(byte << 7 * index for index, byte in enumerate(payload[7:12]))
    assert (whole, fraction) == (0xFFFFFFFF, 0xC0000000)


@given(raw=st.integers(-(1 << 63), (1 << 63) - 1))
def test_every_bit_pattern_of_a_value_survives(raw: int) -> None:
    trio = module("trio")
    value = Decimal(raw * 5**32).scaleb(-32) if abs(raw) < 10**5 else Decimal(f"{raw * 5**32}E-32")
    payload = trio.DirectVariableTransfer(address=1, value=value).to_bytes()
    groups = [payload[2:7], payload[7:12]]
    whole, fraction = (sum(byte << 7 * index for index, byte in enumerate(group)) for group in groups)
    assert (whole << 32 | fraction) == raw & (1 << 64) - 1
    assert trio.DirectVariableTransfer.from_bytes(payload).value == value


def test_decimals_too_long_or_too_large_are_refused_at_once() -> None:
    trio = module("trio")
    for value in ("1E+999999999", "1E-999999999", "Infinity", "NaN", "sNaN", "2147483648"):
        with pytest.raises(trio.EncodeError, match="value"):
            trio.DirectVariableTransfer(address=1, value=Decimal(value)).to_bytes()


def test_only_the_transfer_of_a_variable_has_a_checksum() -> None:
    trio = module("trio")
    assert trio.KeypadOffset(address=3, offset=2).to_frame().hex(" ") == "9b 02 98"
    wire = trio.DirectVariableTransfer(address=3, number=5, value=Decimal(1)).to_frame()
    crc = crc_hqx(wire[1:13], 0xFFFF)
    assert wire[13:] == bytes((crc & 0x7F, crc >> 8 & 0x7F, 0x98))
    bad = wire[:13] + bytes((wire[13] ^ 1,)) + wire[14:]
    with pytest.raises(trio.DecodeError) as caught:
        trio.decode(bad)
    assert caught.value.kind == "crc"


# MC1231A


def test_the_numbers_of_the_manual() -> None:
    chip = module("mc1231a")
    assert chip.SetPosRequest(value=1234567).to_bytes().hex() == "0012d687"
    assert chip.SetPosRequest(value=-746455).to_bytes().hex() == "fff49c29"
    assert chip.SetVelRequest(value=2.75).to_bytes().hex() == "0002c000"
    request = chip.SetVelRequest.from_bytes(bytes.fromhex("3EDCBA98"))
    assert chip.SetVelResponse().to_frame(request) == ((0x11 + 0x3EDC + 0xBA98) & 0xFFFF).to_bytes(2, "big")


def test_a_checksum_of_0_refuses_the_command_unless_it_is_the_right_one() -> None:
    chip = module("mc1231a")
    request = chip.SetVelRequest(value=1.0)
    assert chip.decode_response(chip.SetVelResponse().to_frame(request), request) == chip.SetVelResponse()
    for wire, kind in ((b"\0\0", "illegal"), (b"\0\1", "crc"), (b"", "truncated"), (b"\0\0\0", "length")):
        with pytest.raises(chip.DecodeError) as caught:
            chip.decode_response(wire, request)
        assert caught.value.kind == kind
    both = chip.SetPosRequest(value=-15)  # 10 + FFFF + FFF1 sums to 0
    assert chip.decode_response(b"\0\0", both) == chip.SetPosResponse()


def test_responses_are_split_by_the_expected_request() -> None:
    chip = module("mc1231a")
    requests = [chip.GetActlPosRequest(), chip.SetVelRequest(value=2.5), chip.Set1Request()]
    answers = [chip.GetActlPosResponse(value=-5), chip.SetVelResponse(), chip.Set1Response(status=3)]
    wire = b"".join(answer.to_frame(request) for answer, request in zip(answers, requests, strict=True))
    for step in (1, 3, 100):
        decoder = chip.StreamDecoder("response")
        for request in requests:
            decoder.expect(request)
        found = [event for at in range(0, len(wire), step) for event in decoder.feed(wire[at : at + step])]
        assert found == answers
        assert [event.kind for event in decoder.feed(b"\x07")] == ["frame"]


# Every protocol


@pytest.mark.parametrize("name", [name for name in EVERY if name != "mc1231a"])
def test_every_intact_frame_after_corruption_is_delivered(name: str) -> None:
    """Packets are omitted, because they have no delimiter."""
    random_source, lost = random.Random(name), 0
    for direction in directions(name):
        chosen = [m for m in protocol(name).messages if m.direction in (direction, "message")]
        for _ in range(300):
            wires = [wire_of(name, m, build(name, m)) for m in random_source.choices(chosen, k=4)]
            spoilt = bytearray(wires[0])
            spoilt[random_source.randrange(len(spoilt))] ^= 1 << random_source.randrange(8)
            del spoilt[random_source.randrange(len(spoilt) + 1) :]
            decoder = stream(name, direction)
            found = events(decoder, bytes(spoilt) + b"".join(wires[1:]))
            delivered = b"".join(bytes(event.to_frame()) for event in found if hasattr(event, "to_frame"))
            lost += not delivered.endswith(b"".join(wires[1:]))
    # A checksum of 8 bits accepts one wrong frame in 256, one of 16 bits none of these.
    assert lost <= (6 if name == "kitchen_sink" else 0)


@pytest.mark.slow
@pytest.mark.parametrize("name", EVERY)
def test_an_endless_stream_neither_grows_nor_slows_the_decoder(name: str) -> None:
    for direction in directions(name):
        for byte in (0x00, 0xA5, 0x7E, 0xFF, 0x99, 0x01):
            decoder = stream(name, direction)
            for _ in range(20):
                decoder.feed(bytes((byte,)) * 2000)
            kept = [getattr(decoder, each, b"") for each in ("_buffer", "_run", "_message")]
            assert sum(len(each) for each in kept if isinstance(each, bytes)) < 1000


@pytest.mark.parametrize("name", EVERY)
def test_a_wrong_direction_is_refused(name: str) -> None:
    with pytest.raises(ValueError, match="direction is 'sideways'; use"):
        module(name).StreamDecoder("sideways")
