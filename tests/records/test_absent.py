"""Fields that may be absent: interpreter, generated Python, construct."""

from __future__ import annotations

from functools import cache
from typing import Any

import pytest
from construct import ConstructError

from qlinkgen.backends import construct, python
from qlinkgen.model.protocol import Protocol
from qlinkgen.plan import plan_of
from qlinkgen.plan.content import BadContent, MoreNeeded, Raw, Unsendable, measure, pack, unpack
from qlinkgen.plan.dissect import dissect
from qlinkgen.schema import loads

SCHEMA = """
qlinkgen: 1
protocol: {name: heater, title: Heater, revision: "1", source: Example, doc: Fields that may be absent}
byteorder: little
enums: {mode: {type: u8, values: {off: 0, on: 1, timed: 2}}}
frame:
  parts:
    sync: B5 62
    length: {type: u16, counts: [data]}
    number: {role: message, type: u8}
    data: {role: payload, size: 0..256}
    check: {type: u16, algorithm: crc-16/modbus, over: [length, number, data]}
bus: {kind: master_slave}
defaults: {repeat: safe}
commands:
  heat:
    id: 1
    request:
      mode: mode
      options: {type: u8, bits: {more: 0, level: 1..3}}
      seconds: {type: u16, if: {mode: timed}, range: 1..1000}
      count: {type: u8, counts: points, if: options.more}
      points: {type: "u8[1..4]", if: more}
      gap: {type: u8, reserved: true, if: {level: not 2..3}}
      end: u8
    response: {a: u8, b: {type: u16, optional: true}, c: {type: u8, optional: true}}
  log:
    id: 2
    request: {}
    response: {kind: u8, words: {type: "u16[0..9]", if: {kind: 1..3}}, end: u8}
  tell:
    id: 3
    request: {}
    response:
      kind: u8
      words: {type: "u16[0..100]", if: {kind: 1..3}}
      note: {type: text, if: {kind: 4}}
      more: {type: u16, if: {kind: [5, 7..9]}}
      tail: u8
"""
ABSENT: dict[str, Raw] = {"mode": 0, "more": 0, "level": 2, "seconds": None, "points": None, "end": 9}
PRESENT: dict[str, Raw] = {"mode": 2, "more": 1, "level": 0, "seconds": 3, "points": [7, 8], "end": 9}
CASES = [(ABSENT, "00 04 09"), (PRESENT, "02 01 0300 02 07 08 00 09")]


@cache
def protocol() -> Protocol:
    found, faults = loads(SCHEMA, "heater.yaml")
    assert found is not None, faults
    return found


@cache
def module() -> Any:
    return python.load(protocol())


@pytest.mark.parametrize(("values", "payload"), CASES)
def test_every_output_has_the_same_bytes(values: dict[str, Raw], payload: str) -> None:
    data, plan = bytes.fromhex(payload), plan_of(protocol()).message("heat.request").payload
    assert pack(plan, values) == data
    assert unpack(plan, data) == values
    made = module().HeatRequest(**values)
    assert made.to_bytes() == data
    assert module().HeatRequest.from_bytes(data) == made
    live = construct.live(protocol())
    assert live.payload("heat.request", {**values, "mode": values["mode"]}) == data
    assert live.messages["heat.request"].parse(data)["seconds"] == values["seconds"]


@pytest.mark.parametrize(
    ("changed", "name"),
    [({"seconds": None}, "seconds"), ({"points": None}, "points"), ({"mode": 0}, "seconds")],
)
def test_a_value_that_is_absent_where_it_must_not_be_is_refused(changed: dict[str, Any], name: str) -> None:
    values = {**PRESENT, **changed}
    with pytest.raises(Unsendable, match=name):
        pack(plan_of(protocol()).message("heat.request").payload, values)
    with pytest.raises(module().EncodeError, match=f"{name}: .* present only if") as caught:
        module().HeatRequest(**values).to_frame()
    assert caught.value.field == name
    with pytest.raises(ConstructError):
        construct.live(protocol()).payload("heat.request", values)


@pytest.mark.parametrize(
    ("payload", "kind", "field", "offset"),
    [
        ("02 00", "length", "seconds", 2),
        ("02 00 0000", "range", "seconds", 2),
        ("02 01 0000 05", "range", "seconds", 2),
        ("02 01 0100 05", "length", "count", 4),
        ("00 04 09 00", "length", "", 3),
    ],
)
def test_the_first_error_in_wire_order_is_reported(payload: str, kind: str, field: str, offset: int) -> None:
    data = bytes.fromhex(payload)
    with pytest.raises(BadContent) as caught:
        unpack(plan_of(protocol()).message("heat.request").payload, data)
    assert (caught.value.kind, caught.value.field, caught.value.offset) == (kind, field, offset)
    with pytest.raises(module().DecodeError) as refused:
        module().HeatRequest.from_bytes(data)
    assert refused.value.kind == kind


def test_optional_fields_are_present_if_bytes_are_left() -> None:
    plan = plan_of(protocol()).message("heat.response").payload
    for payload, values in (("01", (1, None, None)), ("01 0200", (1, 2, None)), ("01 0200 03", (1, 2, 3))):
        assert tuple(unpack(plan, bytes.fromhex(payload)).values()) == values
        made = module().HeatResponse(a=values[0], b=values[1], c=values[2])
        assert made.to_bytes() == bytes.fromhex(payload)
    with pytest.raises(module().EncodeError, match="c: 3 cannot be sent"):
        module().HeatResponse(c=3).to_bytes()


@pytest.mark.parametrize(("payload", "words"), [("00 07", None), ("01 07", []), ("03 0200 0300 07", [2, 3])])
def test_a_rest_may_be_absent(payload: str, words: list[int] | None) -> None:
    data, plan = bytes.fromhex(payload), plan_of(protocol()).message("log.response").payload
    values = {"kind": data[0], "words": words, "end": 7}
    assert unpack(plan, data) == values
    assert pack(plan, values) == data
    assert module().LogResponse.from_bytes(data) == module().LogResponse(**values)
    assert construct.live(protocol()).payload("log.response", values) == data
    with pytest.raises(BadContent):
        unpack(plan, b"\0" + data)


@pytest.mark.parametrize(
    ("payload", "values"),
    [
        ("00 09", {"words": None, "note": None, "more": None}),
        ("01 0200 09", {"words": [2], "note": None, "more": None}),
        ("04 41 42 09", {"words": None, "note": "AB", "more": None}),
        ("05 0300 09", {"words": None, "note": None, "more": 3}),
    ],
)
def test_kinds_of_a_payload_may_have_a_rest_each(payload: str, values: dict[str, Any]) -> None:
    data, plan = bytes.fromhex(payload), plan_of(protocol()).message("tell.response").payload
    values = {"kind": data[0], **values, "tail": 9}
    assert module().TellResponse.from_bytes(data) == module().TellResponse(**values)
    assert module().TellResponse(**values).to_bytes() == data
    raw = {**values, "note": values["note"] and values["note"].encode()}
    assert unpack(plan, data) == raw
    assert pack(plan, raw) == data
    assert construct.live(protocol()).payload("tell.response", values) == data


def test_fields_that_exclude_each_other_share_the_room() -> None:
    message = plan_of(protocol()).message("tell.response")
    assert message.payload.most == 256
    assert [run.length.maximum for run in message.payload.runs] == [100, 254]


def test_the_size_follows_from_what_has_been_received() -> None:
    plan = plan_of(protocol()).message("heat.request").payload
    data = bytes.fromhex("02 01 0300 02 07 08 00 09")
    needed = []
    for size in range(len(data) + 1):
        try:
            assert measure(plan, data[:size]) == len(data)
        except MoreNeeded as more:
            needed.append(more.needed)
    assert needed == [1, 2, 5, 5, 5]


def test_explain_names_every_field_that_is_there() -> None:
    wire = module().HeatRequest(**PRESENT).to_frame()
    found = dissect(plan_of(protocol()), wire, "request")
    names = [getattr(span.of, "name", "") for span in found.spans]
    assert found.kind == ""
    assert names == ["sync", "length", "number", "mode", "options", "more", "level", "seconds", "count",
                     "points", "gap", "end", "check"]  # fmt: skip


def test_a_new_message_can_be_sent() -> None:
    assert module().HeatRequest().to_bytes() == bytes.fromhex("00 00 00 00")
