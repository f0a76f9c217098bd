"""Texts as values of every frame: of each target, with and without the bytes that end a frame."""

from __future__ import annotations

from typing import Any

import pytest
from construct import ConstructError

from qlinkgen.backends import c, construct, python
from qlinkgen.backends.base import Options
from qlinkgen.model.protocol import Protocol
from qlinkgen.plan import plan_of
from qlinkgen.plan.codec import Codec
from qlinkgen.plan.content import Unsendable
from qlinkgen.plan.reading import BadFrame
from qlinkgen.schema.loader import loads

SCHEMA = """\
qlinkgen: 1
protocol: {{name: sample, revision: "1", source: Made up}}
types: {{place: {{type: "text[3]"}}}}
frame:
  parts:
    start: {{text: "$"}}
    talker: {{type: "text[2]", default: GP}}
    code: {{role: message, type: "text[3]"}}
    data: {{role: payload, size: 0..16}}
    {end}
    place: place
bus: {{kind: master_slave}}
defaults: {{repeat: safe}}
commands: {{}}
messages: {{depth: {{id: DPT, fields: {{depth: {{type: u8, as: "decimal[3]"}}}}}}}}
"""
ENDED = 'end: {role: terminator, text: "*"}'
COUNTED = "end: {type: u8, algorithm: sum8, over: [talker, data]}"


def made(end: str) -> Protocol:
    protocol, faults = loads(SCHEMA.format(end=end), "sample")
    assert protocol is not None, [str(fault) for fault in faults]
    return protocol


@pytest.mark.parametrize("end", [ENDED, COUNTED])
def test_every_target_has_the_characters(end: str) -> None:
    protocol = made(end)
    module: Any = python.load(protocol)
    frame = module.Depth(talker="SD", depth=7, place="a b").to_frame()
    assert (frame[1:3], frame[-3:]) == (b"SD", b"a b")
    found = module.decode(frame)
    assert (found.talker, found.place) == ("SD", "a b")
    assert (module.Depth().talker, module.Depth().place) == ("GP", "   ")
    live = construct.live(protocol)
    parsed = live.parse("message", frame)
    assert (parsed["talker"], parsed["place"]) == ("SD", "a b")
    given = {"message": "depth", "talker": "SD", "place": "a b", "fields": {"depth": 7}}
    assert live.frames["message"].build(given) == frame
    assert "uint8_t talker[2];" in c.generate(protocol, Options())["c/sample.h"]


@pytest.mark.parametrize(("end", "legal"), [(ENDED, False), (COUNTED, True)])
def test_the_end_of_a_frame_is_not_in_a_text_before_it(end: str, legal: bool) -> None:
    protocol = made(end)
    module: Any = python.load(protocol)
    codec, live = Codec(plan_of(protocol)), construct.live(protocol)
    given = {"message": "depth", "talker": "S*", "place": "abc", "fields": {"depth": 7}}
    if legal:
        assert module.decode(module.Depth(talker="S*", depth=7).to_frame()).talker == "S*"
        return
    with pytest.raises(module.EncodeError, match=r"talker.*2 seven-bit characters without '\*'"):
        module.Depth(talker="S*", depth=7).to_frame()
    with pytest.raises(Unsendable):
        codec.encode("depth", {"talker": int.from_bytes(b"S*", "big"), "depth": 7})
    with pytest.raises(ConstructError):
        live.frames["message"].build(given)


def test_a_text_has_its_size_and_seven_bits() -> None:
    protocol = made(COUNTED)
    module: Any = python.load(protocol)
    for wrong in ("S", "SDX", "S\u00e4"):
        with pytest.raises(module.EncodeError):
            module.Depth(talker=wrong, depth=7).to_frame()
    frame = bytearray(module.Depth(talker="SD", depth=7).to_frame())
    frame[2] ^= 0x80
    frame[-4] = (frame[-4] + 0x80) & 0xFF
    with pytest.raises(module.DecodeError) as caught:
        module.decode(bytes(frame))
    assert (caught.value.kind, caught.value.field) == ("range", "talker")
    with pytest.raises(BadFrame) as bad:
        Codec(plan_of(protocol)).decode(bytes(frame), "request")
    assert (bad.value.kind, bad.value.field) == ("range", "talker")
