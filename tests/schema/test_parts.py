"""Parts of a frame: their notations, and the roles told by other keys."""

from __future__ import annotations

import json
from pathlib import Path

import pytest
from click.testing import CliRunner

from qlinkgen.backends import python
from qlinkgen.cli import cli
from qlinkgen.model.frame import DelimitedFrame, Part
from qlinkgen.model.protocol import Protocol
from qlinkgen.plan import plan_of
from qlinkgen.plan.codec import Codec
from qlinkgen.plan.reading import BadFrame
from qlinkgen.schema.loader import loads

SCHEMA = """\
qlinkgen: 1
protocol: {{name: sample, revision: "1", source: Made up}}
frame:
  parts:
    start: {start}
    length: {length}
    code: {{role: message, type: u8}}
    data: {{role: payload, size: 0..16}}
    crc: {crc}
bus: {{kind: master_slave, response_within: 3 bytes}}
defaults: {{repeat: safe}}
commands: {{go: {{id: 1, request: {{}}, response: {{}}}}}}
"""
LONG = {
    "start": "{role: constant, value: A5 A5}",
    "length": "{role: length, type: u8, counts: [data]}",
    "crc": "{role: checksum, type: u8, algorithm: sum8, over: [data]}",
}


def parts(**written: str) -> tuple[Part, ...]:
    protocol, faults = loads(_text(written), "sample")
    assert protocol is not None, faults
    assert isinstance(protocol.frame, DelimitedFrame)
    return protocol.frame.parts


def _text(written: dict[str, str]) -> str:
    return SCHEMA.format(**{**LONG, **written})


@pytest.mark.parametrize(
    ("text", "data"),
    [
        ("A5 A5", "A5A5"), ("{value: A5 A5}", "A5A5"), ("68", "68"), ("10", "10"), ("16", "16"), ("7E", "7E"),
        ("FC", "FC"), ("02", "02"), ("1002", "1002"), ("10 02", "1002"), ("0x68", "68"), ("0xA5", "A5"),
        ("'10'", "10"), ('{text: "$M"}', "244D"), ('{text: "10"}', "3130"),
    ],
)  # fmt: skip
def test_notations_of_a_constant(text: str, data: str) -> None:
    assert parts(start=text)[0] == parts(start=f"{{role: constant, value: '{data}'}}")[0]


def test_other_keys_tell_the_role() -> None:
    length, crc = "{type: u8, counts: [data]}", "{type: u8, algorithm: sum8, over: [data]}"
    assert parts(length=length, crc=crc) == parts()


@pytest.mark.parametrize(
    ("written", "where", "what"),
    [
        ({"crc": "{doc: A byte}"}, "9:5", "crc has no role"),
        ({"start": "{value: 7E, text: x}"}, "5:24", "start has both value and text"),
        ({"start": '{text: ""}'}, "5:19", "'' is not text of printable ASCII characters"),
        ({"start": '{text: "é"}'}, "5:19", "'é' is not text of printable ASCII characters"),
        ({"start": "{role: payload, size: 3, text: x}"}, "8:5", "data and start are both the payload"),
        ({"length": "{role: address, type: u8, text: x}"}, "6:39", "'text' has no effect on an address here"),
    ],
)
def test_wrong_parts(written: dict[str, str], where: str, what: str) -> None:
    protocol, faults = loads(_text(written), "sample")
    assert protocol is None
    assert (f"{faults[0].line}:{faults[0].column}", faults[0].message) == (where, what)


BITS = """\
qlinkgen: 1
protocol: {{name: sample, revision: "1", source: Made up}}
byteorder: {order}
frame:
  parts:
{parts}
    data: {{role: payload, size: 0..16}}
{after}
bus: {bus}
commands: {{go: {{{id}request: {request}, response: {response}, repeat: safe{more}}}}}
"""
USUAL_FIELDS = {"request": "{}", "response": "{value: u8}"}


def wires(
    *before: str, after: tuple[str, ...] = (), id_: str = "id: 3", address: bool = False, **fields: str
) -> list[str]:
    """The frames of a request, and of a response with the value 9, from and to node 5."""
    text = BITS.format(
        order="little",
        parts="\n".join(f"    {part}" for part in before),
        after="\n".join(f"    {part}" for part in after),
        bus="{kind: master_slave, nodes: 1..7}" if address else "{kind: master_slave}",
        id=f"{id_}, " if id_ else "",
        more=", addressing: node" if address else "",
        **{**USUAL_FIELDS, **fields},
    )
    protocol, faults = loads(text, "sample")
    assert protocol is not None, faults
    codec = Codec(plan_of(protocol))
    frames = [codec.encode("go.request", {}, 5), codec.encode("go.response", {"value": 9}, 5)]
    for frame, direction in zip(frames, ("request", "response"), strict=True):
        decoded = codec.decode(frame, direction)  # type: ignore[arg-type]
        assert (decoded.message.name, decoded.address) == (f"go.{direction}", 5 if address else None)
    return [frame.hex(" ") for frame in frames]


def test_bits_with_roles() -> None:
    head = (
        "head: {type: u8, bits: {node: {at: 0..2, role: address}, code: {at: 4..6, role: message},"
        " one: {at: 7, const: 1}}}"
    )
    assert wires(head, address=True) == ["b5", "b5 09"]


def test_id_in_several_parts() -> None:
    parts = ("start: B5 62", "class: {role: message, type: u8}", "number: {role: message, type: u16}")
    assert wires(*parts, id_="id: {class: 6, number: 0x102}") == ["b5 62 06 02 01", "b5 62 06 02 01 09"]


def test_direction() -> None:
    way = "way: {role: direction, type: u8, values: {request: 0x3C, response: 0x3E}}"
    assert wires(way, "code: {role: message, type: u8}") == ["3c 03", "3e 03 09"]
    bits = "head: {type: u8, bits: {way: {at: 7, role: direction, values: {request: 1, response: 0}}}}"
    assert wires(bits, id_="") == ["80", "00 09"]


def test_no_message_id() -> None:
    assert wires("start: 7E", id_="") == ["7e", "7e 09"]


def test_text_ids() -> None:
    code = 'code: {role: message, type: "text[3]"}'
    assert wires("start: 24", code, id_="id: GGA") == ["24 47 47 41", "24 47 47 41 09"]
    answer = '{id: "V:1", fields: {value: u8}}'
    assert wires(code, id_="id: GGA", response=answer) == ["47 47 41", "56 3a 31 09"]
    parts = ('talker: {role: message, type: "text[2]"}', "number: {role: message, type: u8}")
    assert wires(*parts, id_="id: {talker: GP, number: 7}") == ["47 50 07", "47 50 07 09"]


@pytest.mark.parametrize(
    ("kind", "given", "what"),
    [
        ("text[3]", "GG", "code 'GG' does not fit the frame"),
        ("text[3]", "12", "code 12 is not text"),
        ("text[3]", '"12é"', "code '12é' does not fit the frame"),
        ("u8", "A", "'A' has the wrong type"),
        ("text[9]", "A", "'text[9]' is not a type for a part of a frame"),
    ],
)
def test_wrong_text_ids(kind: str, given: str, what: str) -> None:
    text = BITS.format(
        order="big",
        parts=f'    code: {{role: message, type: "{kind}"}}',
        after="",
        bus="{kind: master_slave}",
        id=f"id: {given}, ",
        more="",
        **USUAL_FIELDS,
    )
    assert what in [fault.message for fault in loads(text, "sample")[1]]


def test_numbers_as_constants() -> None:
    assert wires("version: {type: u16, const: 0x0E}", id_="") == ["0e 00", "0e 00 09"]
    assert wires("sync: {type: u8, const: [0xC8, 0xEA]}", id_="") == ["c8", "c8 09"]


def test_derived_numbers() -> None:
    length = ("start: 68", "length: {type: u8, counts: [data]}")
    assert wires(*length, "again: {type: u8, equals: length}", id_="") == ["68 00 00", "68 01 01 09"]
    code = "code: {role: message, type: u8}"
    assert wires(code, after=("inverse: {type: u8, equals: ~code}",)) == ["03 fc", "03 09 fc"]
    assert wires(code, after=("more: {type: u8, equals: code - 4}",)) == ["03 ff", "03 09 ff"]


def test_length_with_an_offset_and_in_steps() -> None:
    start = ("start: FE", "code: {role: message, type: u8}")
    assert wires(*start, "size: {type: u8, counts: data}") == ["fe 03 00", "fe 03 01 09"]
    more = "size: {type: u8, counts: [code, data], offset: 1}"
    assert wires(*start, more) == ["fe 03 00", "fe 03 01 09"]
    words = ("size: {type: u8, counts: [code, data], scale: 2}", "code: {role: message, type: u8}")
    request, response = "{gap: {type: u8, const: 7}}", '{value: u8, more: "u16[0..2]"}'
    assert wires(*words, request=request, response=response) == ["01 03 07", "01 03 09"]


def test_id_and_address_after_the_payload() -> None:
    after = ("code: {role: message, type: u8}", "node: {role: address, type: u40}")
    expected = ["00 03 05 00 00 00 00", "01 09 03 05 00 00 00 00"]
    assert wires("length: {type: u8, counts: [data]}", after=after, address=True) == expected


@pytest.mark.parametrize(
    ("wire", "kind"),
    [("c8 09", ""), ("ea 09", ""), ("c9 09", "frame"), ("c8", "truncated"), ("c8 09 00", "length")],
)
def test_each_of_several_constants_is_accepted(wire: str, kind: str) -> None:
    text = BITS.format(
        order="big",
        parts="    sync: {type: u8, const: [0xC8, 0xEA]}",
        after="",
        bus="{kind: master_slave}",
        id="",
        more="",
        **USUAL_FIELDS,
    )
    protocol, _ = loads(text, "sample")
    assert protocol is not None
    codec = Codec(plan_of(protocol))
    if kind:
        with pytest.raises(BadFrame) as caught:
            codec.decode(bytes.fromhex(wire), "response")
        assert caught.value.kind == kind
    else:
        assert codec.decode(bytes.fromhex(wire), "response").values == {"value": 9}


@pytest.mark.parametrize(
    ("part", "what"),
    [
        ("head: {type: u8, bits: {a: {at: 8, const: 1}}}", "a extends to bit 8"),
        ("head: {type: u8, bits: {a: {at: 0..1, const: 1}, b: {at: 1, const: 1}}}", "b overlaps a"),
        ("head: {type: u8, bits: {a: {at: 0..1, const: 4}}}", "4 does not fit 2 bits"),
        (
            "head: {type: u8, bits: {a: {at: 0..3, range: 1..17}}}",
            "raw values of 1..17 do not fit 4 unsigned bits",
        ),
        ("head: {type: u8, bits: {a: {at: 0..3, range: 1..3}}}", "a has no default, and 0 is not legal"),
        (
            "head: {type: u8, bits: {a: {at: 0..3, role: message, range: 1..3}}}",
            "'range' has no effect on bits with a role or a constant",
        ),
        ("more: {type: u8, range: 1..3}", "more has no default, and 0 is not legal"),
        ("more: {type: f32}", "'f32' is not the type of a value of every frame"),
        ("more: {type: 'u8[4]'}", "'u8[4]' is not the type of a value of every frame"),
        ("more: {type: part}", "unknown type 'part'"),
        ("more: bool", "'bool' is not the type of a value of every frame"),
        ("value: u8", "'value' and the frame's 'value' both become value"),
        ("head: {type: u8, bits: {a: {at: 0, role: message, const: 1}}}", "a has a role and a constant"),
        ("way: {role: direction, type: u8}", "way has no values"),
        (
            "way: {role: direction, type: u8, values: {request: 1, response: 1}}",
            "way has one value twice",
        ),
        ("way: {role: direction, type: u8, values: {request: 1, response: 256}}", "256 does not fit 8 bits"),
        ("more: {type: u8, equals: missing}", "unknown part 'missing'"),
        ("more: {type: u8, equals: later}", "later does not precede more"),
        ("more: {type: u16, equals: code}", "more cannot equal code"),
        ("more: {type: u8, equals: 3 + 4}", "'3 + 4' does not name a part"),
        ("more: {role: message, type: u8}", "the id consists of code and more"),
        ("more: {type: u8, echo: true}", "'echo' has no effect on a value here"),
        ("more: {role: counter, type: i8}", "more cannot count"),
        (
            "more: {type: u8, bits: {low: {at: 0..3, per: frame}}}",
            "'per' has no effect on a value that is not a counter",
        ),
        (
            "more: {type: u8, bits: {low: {at: 0..3, role: counter}, high: {at: 4..7, role: counter}}}",
            "high and low are both the counter",
        ),
        ("more: {type: u8, const: 1, value: 01}", "'value' has no effect on a constant with a type here"),
        ("start: {type: u8, value: 01}", "'type' has no effect on a constant without const here"),
    ],
)
def test_wrong_pieces(part: str, what: str) -> None:
    text = BITS.format(
        order="big",
        parts=f"    code: {{role: message, type: u8}}\n    {part}",
        after="    later: {type: u8, counts: [data]}" if "later" in part else "",
        bus="{kind: master_slave}",
        id="id: 3, ",
        more="",
        **USUAL_FIELDS,
    )
    protocol, faults = loads(text, "sample")
    assert protocol is None
    assert what in [fault.message for fault in faults]


VALUES = """\
qlinkgen: 1
protocol: {name: sample, revision: "1", source: Made up}
byteorder: little
enums: {part: {type: u8, values: {all: 0, motor: 1}}}
frame:
  parts:
    start: FD
    length: {type: u8, counts: [data]}
    head:
      type: u8
      bits: {signed: 0, level: {at: 1..3, range: 1..5, default: 1}, node: {at: 4..7, role: address}}
    component: {type: part, default: motor}
    code: {role: message, type: u8}
    data: {role: payload, size: 0..16}
    check: {type: u8, algorithm: sum8, over: [length, head, component, code, data]}
    trim: {type: i8, scale: 1/2, unit: V}
bus: {kind: master_slave, nodes: 1..7}
commands: {set: {id: 5, addressing: node, request: {value: u16}, response: {}, repeat: safe}}
"""


def values() -> Protocol:
    protocol, faults = loads(VALUES, "sample")
    assert protocol is not None, faults
    return protocol


def test_values_of_every_frame_travel_in_the_interpreter() -> None:
    codec = Codec(plan_of(values()))
    given = {"signed": 1, "level": 3, "component": 0, "trim": -3, "value": 7}
    frame = codec.encode("set.request", given, 3)
    assert frame.hex(" ") == "fd 02 37 00 05 07 00 45 fd"
    decoded = codec.decode(frame, "request")
    assert decoded.beside == {"signed": 1, "level": 3, "component": 0, "trim": -3}
    assert (decoded.address, decoded.values) == (3, {"value": 7})
    assert codec.encode("set.response", {}, 3).hex(" ") == "fd 00 32 01 05 38 00"
    with pytest.raises(BadFrame) as caught:
        codec.decode(bytes.fromhex("fd 02 3d 00 05 07 00 4b fd"), "request")
    assert (caught.value.kind, caught.value.field) == ("range", "level")


def test_values_of_every_frame_are_attributes_in_python() -> None:
    module = python.load(values())
    message = module.SetRequest(node=3, signed=True, level=3, component=module.Part.ALL, trim=-1.5, value=7)
    assert message.to_frame().hex(" ") == "fd 02 37 00 05 07 00 45 fd"
    assert module.decode_request(message.to_frame()) == message
    assert module.SetRequest(node=3, value=7) != message
    assert "component=Part.ALL" in repr(message)
    assert module.SetRequest.from_bytes(b"\7\0", 3) == module.SetRequest(node=3, value=7)
    with pytest.raises(module.EncodeError, match="level: 6 cannot be sent"):
        module.SetRequest(node=3, level=6, value=7).to_frame()


def test_values_of_every_frame_are_keys_beside_the_address(tmp_path: Path) -> None:
    path = tmp_path / "sample.yaml"
    path.write_text(VALUES, "utf-8")
    given = ["set", "--node", "3", "value=7", "component=all", "level=3", "signed=true", "trim=-1.5"]
    wire = ran("encode", path, *given)
    line = ran("decode", path, "--direction", "request", wire)
    assert json.loads(line) == {
        "message": "set.request", "node": 3, "signed": True, "level": 3, "component": "all", "trim": -1.5,
        "fields": {"value": 7}, "offset": 0,
    }  # fmt: skip
    assert ran("encode", path, "--json", line) == wire
    assert ".level      3" in ran("explain", path, wire)


def ran(*words: object) -> str:
    done = CliRunner().invoke(cli, [str(word) for word in words])
    assert done.exit_code == 0, done.output
    return done.output.strip()
