"""Records of fixed size: interpreter, generated Python, construct."""

from __future__ import annotations

import copy
from functools import cache
from typing import Any

import pytest

from qlinkgen.backends import construct, python
from qlinkgen.model.protocol import Protocol
from qlinkgen.plan import plan_of
from qlinkgen.plan.codec import Codec
from qlinkgen.plan.content import BadContent, Raw, Unsendable, pack, unpack
from qlinkgen.schema import loads

SCHEMA = """
qlinkgen: 1
protocol: {name: sky, title: Sky, revision: "1", source: Example, doc: Satellites in view}
byteorder: little
enums: {system: {type: u8, values: {gps: 0, galileo: 2}}}
types:
  point: {fields: {x: i16, y: {type: i16, scale: 1/10, unit: m}}}
  satellite:
    fields:
      system: system
      number: {type: u8, range: 1..32, default: 1}
      place: point
      gap: {type: u8, reserved: true}
frame:
  parts:
    sync: {role: constant, value: B5 62}
    length: {role: length, type: u16, counts: [data]}
    number: {role: message, type: u8}
    data: {role: payload, size: 0..256}
    check: {role: checksum, type: u16, algorithm: crc-16/modbus, over: [length, number, data]}
bus: {kind: master_slave}
defaults: {repeat: safe}
commands:
  view:
    id: 1
    request: {home: point}
    response: {count: {type: u8, counts: satellites}, satellites: "satellite[0..12]", rest: "point[]"}
"""
ONE: dict[str, Raw] = {"system": 2, "number": 7, "place": {"x": -1, "y": 15}}
PAYLOAD = bytes.fromhex("01 02 07 ff ff 0f 00 00")


@cache
def protocol() -> Protocol:
    found, faults = loads(SCHEMA, "sky.yaml")
    assert found is not None, faults
    return found


@cache
def module() -> Any:
    return python.load(protocol())


def test_the_interpreter_packs_and_unpacks_mappings() -> None:
    payload = plan_of(protocol()).message("view.response").payload
    values: dict[str, Raw] = {"satellites": [ONE], "rest": []}
    assert pack(payload, values) == PAYLOAD
    assert unpack(payload, PAYLOAD) == values


def test_missing_values_of_a_record_have_their_defaults() -> None:
    payload = plan_of(protocol()).message("view.response").payload
    assert pack(payload, {"satellites": [{}]}) == bytes.fromhex("01 00 01 00 00 00 00 00")


def test_errors_name_the_value_in_the_record() -> None:
    payload = plan_of(protocol()).message("view.response").payload
    with pytest.raises(Unsendable, match=r"satellites\[1\]\.number"):
        pack(payload, {"satellites": [{}, {"number": 33}]})
    with pytest.raises(BadContent) as caught:
        unpack(payload, bytes.fromhex("01 02 00 ff ff 0f 00 00"))
    assert (caught.value.kind, caught.value.field, caught.value.offset) == (
        "range",
        "satellites[0].number",
        2,
    )


def test_a_size_that_is_not_a_whole_number_of_records_is_wrong() -> None:
    payload = plan_of(protocol()).message("view.response").payload
    with pytest.raises(BadContent, match="length"):
        unpack(payload, PAYLOAD + b"\0")


def test_python_has_a_class_for_each_record() -> None:
    m = module()
    made = m.ViewResponse(
        satellites=[m.Satellite(system=m.System.GALILEO, number=7, place=m.Point(x=-1, y=1.5))]
    )
    assert made.to_bytes() == PAYLOAD
    assert m.ViewResponse.from_bytes(PAYLOAD) == made
    assert m.ViewResponse.from_bytes(PAYLOAD).satellites[0].place.y == 1.5
    assert repr(made.satellites[0].place) == "Point(x=-1, y=1.5)"
    assert m.Satellite.from_bytes(made.satellites[0].to_bytes()) == made.satellites[0]
    assert {"point": m.Point, "satellite": m.Satellite} == m.RECORDS
    assert copy.copy(m.Point(x=3)) == m.Point(x=3)


def test_messages_do_not_share_default_records() -> None:
    first, second = module().ViewRequest(), module().ViewRequest()
    first.home.x = 5
    assert second.home.x == 0


@pytest.mark.parametrize(
    ("satellites", "text"),
    [
        ([{"number": 33}], r"satellites\[0\]: satellite: number: 33 cannot be sent"),
        ([{}] * 13, r"satellites: .* a list of 0..12 Satellite"),
        ([{"place": 5}], r"satellites\[0\]: satellite: place: 5 cannot be sent; give a Point"),
    ],
)
def test_python_names_what_cannot_be_sent(satellites: list[dict[str, Any]], text: str) -> None:
    m = module()
    made = m.ViewResponse(satellites=[m.Satellite(**each) for each in satellites])
    with pytest.raises(m.EncodeError, match=text):
        made.to_frame()
    with pytest.raises(m.EncodeError, match="home"):
        m.ViewRequest(home=3).to_frame()


def test_python_names_what_was_received() -> None:
    with pytest.raises(module().DecodeError) as caught:
        module().ViewResponse.from_bytes(bytes.fromhex("02") + PAYLOAD[1:] + bytes(7))
    assert caught.value.field == "satellites[1].number"
    assert caught.value.offset == 9


def test_construct_has_containers() -> None:
    live = construct.live(protocol())
    fields = {"satellites": [{"system": "galileo", "number": 7, "place": {"x": -1, "y": 1.5}}]}
    wire = live.frames["response"].build({"message": "view.response", "fields": fields})
    assert wire == Codec(plan_of(protocol())).wrap("view.response", PAYLOAD)
    assert live.parse("response", wire)["fields"]["satellites"][0].place.y == 1.5
