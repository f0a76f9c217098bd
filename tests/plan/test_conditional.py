"""Parts that only some frames have: targets agree on frames without them, and refuse their values."""

from __future__ import annotations

import functools
from types import ModuleType

import pytest
from construct import ConstructError

from qlinkgen.backends import construct
from qlinkgen.backends.python import load
from qlinkgen.model.protocol import Protocol
from qlinkgen.plan import plan_of
from qlinkgen.plan.codec import Codec
from qlinkgen.plan.content import Unsendable
from qlinkgen.plan.dissect import dissect
from qlinkgen.schema import loads

_SCHEMA = """
qlinkgen: 1
protocol: {name: relay, revision: "1", source: Made up}
byteorder: big
frame:
  parts:
    start: FD
    length: {type: u8, counts: data}
    flags: {type: u8, bits: {signed: 0, relayed: 1, grade: {at: 2..4, signed: true}}}
    code: {role: message, type: u8}
    hops: {type: u8, if: {relayed: 1, grade: not -4..-2}, default: 7}
    data: {role: payload, size: 0..32}
    sum: {type: u8, algorithm: sum8, over: [length, flags, code, hops, data]}
    seal: {type: u16, if: flags.signed}
bus: {kind: master_slave}
defaults: {addressing: none, repeat: safe}
commands:
  go: {id: 1, request: {speed: u8}, response: {}}
"""
_FRAMES = [
    ({}, "FD 01 00 01 09 0B"),
    ({"relayed": 1}, "FD 01 02 01 07 09 14"),
    ({"relayed": 1, "hops": 2, "grade": -1}, "FD 01 1E 01 02 09 2B"),
    ({"relayed": 1, "grade": -2}, "FD 01 1A 01 09 25"),
    ({"signed": 1, "seal": 0x1234}, "FD 01 01 01 09 0C 12 34"),
    ({"signed": 1, "relayed": 1}, "FD 01 03 01 07 09 15 00 00"),
]


@functools.cache
def _protocol() -> Protocol:
    found, faults = loads(_SCHEMA, "relay.yaml")
    assert not faults
    assert found is not None
    return found


@functools.cache
def _module() -> ModuleType:
    return load(_protocol())


@pytest.mark.parametrize(("values", "text"), _FRAMES)
def test_a_frame_has_what_its_header_says(values: dict[str, int], text: str) -> None:
    wire, codec = bytes.fromhex(text), Codec(plan_of(_protocol()))
    expected = {"signed": 0, "relayed": 0, "grade": 0, "hops": 7, "seal": 0} | values
    assert codec.encode("go.request", {"speed": 9, **values}) == wire
    assert codec.decode(wire, "request").beside == expected
    assert _module().GoRequest(speed=9, **values).to_frame() == wire
    seen = _module().decode_request(wire)
    assert {name: getattr(seen, name) for name in expected} == expected
    frame = construct.live(_protocol()).frames["request"]
    assert frame.build(frame.parse(wire)) == wire


@pytest.mark.parametrize("values", [{"hops": 1}, {"seal": 3}, {"relayed": 1, "grade": -3, "hops": 1}])
def test_a_value_without_a_place_is_refused(values: dict[str, int]) -> None:
    with pytest.raises(Unsendable):
        Codec(plan_of(_protocol())).encode("go.request", values)
    with pytest.raises(_module().EncodeError):
        _module().GoRequest(**values).to_frame()
    with pytest.raises(ConstructError):
        construct.live(_protocol()).frames["request"].build({"message": "go.request", **values})


@pytest.mark.parametrize("signed", [False, True])
@pytest.mark.parametrize("seal", [None, 0.5, 0x10000, -1])
def test_an_illegal_value_at_the_end_is_named(seal: object, signed: bool) -> None:
    with pytest.raises(_module().EncodeError) as error:
        _module().GoRequest(speed=9, signed=signed, seal=seal).to_frame()
    assert (error.value.field, error.value.value) == ("seal", seal)


@pytest.mark.parametrize("text", [text for _, text in _FRAMES])
def test_each_beginning_of_a_frame_is_dissected(text: str) -> None:
    wire, plan = bytes.fromhex(text), plan_of(_protocol())
    assert not dissect(plan, wire, "request").faults
    for size in range(1, len(wire)):
        found = dissect(plan, wire[:size], "request")
        assert found.kind == "truncated"
        assert {place for span in found.spans for place in span.places} == {*range(size)}


_LONG = """
qlinkgen: 1
protocol: {name: lengthy, revision: "1", source: Made up}
byteorder: big
frame:
  parts:
    start: FD
    length: {type: u8, counts: [code, data], range: 0..3, otherwise: 255}
    code: {role: message, type: u8}
    long: {type: u16, counts: [code, data], if: {length: 255}}
    data: {role: payload, size: 0..32}
    sum: {type: u8, algorithm: sum8, over: [code, long, data]}
bus: {kind: master_slave}
defaults: {addressing: none, repeat: safe}
commands:
  go: {id: 1, request: {data: "bytes[0..32]"}, response: {}}
"""


@pytest.mark.parametrize(
    ("data", "text"),
    [("", "FD 01 01 01"), ("0708", "FD 03 01 07 08 10"), ("070809", "FD FF 01 00 04 07 08 09 1D")],
)
def test_a_length_hands_over_to_a_longer_one(data: str, text: str) -> None:
    protocol, faults = loads(_LONG, "lengthy.yaml")
    assert protocol is not None
    assert not faults
    module, wire, codec = load(protocol), bytes.fromhex(text), Codec(plan_of(protocol))
    assert codec.encode("go.request", {"data": bytes.fromhex(data)}) == wire
    assert codec.decode(wire, "request").payload.hex() == data
    assert module.GoRequest(data=bytes.fromhex(data)).to_frame() == wire
    assert module.decode_request(wire).data.hex() == data
    frame = construct.live(protocol).frames["request"]
    assert frame.build(frame.parse(wire)) == wire


@pytest.mark.parametrize("text", ["FD 04 01 07 08 09 19", "FD FF 01 00 03 07 08 13", "FD FF 01 00 22"])
def test_a_length_says_what_only_it_can_say(text: str) -> None:
    protocol, _ = loads(_LONG, "lengthy.yaml")
    assert protocol is not None
    wire, plan = bytes.fromhex(text), plan_of(protocol)
    assert dissect(plan, wire, "request").kind == "length"
    with pytest.raises(load(protocol).DecodeError, match="length"):
        load(protocol).decode_request(wire)
    with pytest.raises(ConstructError, match="length"):
        construct.live(protocol).frames["request"].parse(wire)


_SEALED = """
qlinkgen: 1
protocol: {name: sealed, revision: "1", source: Made up}
byteorder: big
frame:
  parts:
    start: 55 FF
    code: {role: message, type: u8}
    length: {type: u8, counts: data}
    data: {role: payload, size: 0..32}
    mark: {value: 5A, if: {length: not 0}}
    crc: {type: u16, byteorder: little, algorithm: crc-16/ibm-sdlc, over: [data], if: {length: not 0}}
bus: {kind: master_slave}
defaults: {addressing: none, repeat: safe}
commands:
  go: {id: 1, request: {data: "bytes[0..32]"}, response: {}}
"""


@pytest.mark.parametrize(
    ("data", "text"),
    [(b"", "55 FF 01 00"), (b"123456789", "55 FF 01 09 31 32 33 34 35 36 37 38 39 5A 6E 90")],
)
def test_only_frames_with_data_have_a_check_value(data: bytes, text: str) -> None:
    protocol, faults = loads(_SEALED, "sealed.yaml")
    assert protocol is not None
    assert not faults
    module, wire, plan = load(protocol), bytes.fromhex(text), plan_of(protocol)
    assert Codec(plan).encode("go.request", {"data": data}) == wire
    assert module.GoRequest(data=data).to_frame() == wire
    assert module.StreamDecoder("request").feed(wire * 2) == [module.GoRequest(data=data)] * 2
    frame = construct.live(protocol).frames["request"]
    assert frame.build(frame.parse(wire)) == wire
    assert not dissect(plan, wire, "request").faults
    for at, kind in ((-1, "crc"), (-3, "frame")) if data else ():
        wrong = bytearray(wire)
        wrong[at] ^= 1
        assert [fault.kind for fault in dissect(plan, bytes(wrong), "request").faults] == [kind]
        with pytest.raises(module.DecodeError) as error:
            module.decode_request(bytes(wrong))
        assert error.value.kind == kind
        with pytest.raises(ConstructError):
            frame.parse(bytes(wrong))
        found, rest = module.StreamDecoder("request").feed(bytes(wrong) + wire)[:2]
        assert (found.kind, rest) == (kind, module.GoRequest(data=data))
