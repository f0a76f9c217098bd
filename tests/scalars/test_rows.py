"""Bits in a row: the order of items and bits, padding, counts of items and bytes."""

from __future__ import annotations

from typing import Any

import pytest
from construct import ConstructError

from qlinkgen.backends import construct, python
from qlinkgen.model.integer import pack_row, unpack_row
from qlinkgen.plan import plan_of
from qlinkgen.plan.codec import Codec
from qlinkgen.plan.content import BadContent, pack, unpack
from qlinkgen.plan.describe import sizing_text
from qlinkgen.plan.dissect import dissect
from tests.proof.outputs import plain_numbers
from tests.scalars.protocols import faults_of, protocol_of

TYPES = "enums: {gear: {type: u3, values: {low: 1, high: 6}}}"
_UNKNOWN = (
    "the size of the payload does not tell the number of items of a; "
    "add a field with counts: a before it, or use a fixed number"
)
#: Field, values and bytes worked out by hand.
FIXED: dict[str, tuple[Any, str]] = {
    '{type: "bool[10]", packed: least}': ([True] + [False] * 7 + [True, True], "0103"),
    '{type: "bool[10]", packed: most}': ([True] + [False] * 7 + [True, True], "80c0"),
    '{type: "u11[3]", packed: least}': ([0x7FF, 0, 1], "ff07400000"),
    '{type: "u11[3]", packed: most}': ([0x7FF, 0, 1], "ffe0000080"),
    '{type: "i5[2]", packed: least}': ([-1, -16], "1f02"),
    '{type: "i5[2]", packed: most}': ([-1, -16], "fc00"),
    '{type: "gear[2]", packed: least}': ([6, 1], "0e"),
    '{type: "u4[2]", packed: most, scale: 1/2}': ([1.5, 7.5], "3f"),
    '{type: "u64[1]", packed: least}': ([0x0102030405060708], "0807060504030201"),
}  # fmt: skip
REQUEST = """
      quantity: {type: u16, counts: coils}
      size: {type: u8, counts: coils, counts_in: bytes}
      coils: {type: "bool[1..64]", packed: least}
      number: {type: u8, counts: levels}
      levels: {type: "u3[0..9]", packed: most, range: 1..6}
      last: u8
"""
VALUES: dict[str, Any] = {"coils": [True, False, True], "levels": [1, 6, 2], "last": 9}
PAYLOAD = bytes.fromhex("0003 01 05 03 3900 09")


@pytest.mark.parametrize("field", FIXED)
def test_bytes(field: str) -> None:
    values, data = FIXED[field]
    protocol = protocol_of(f"{{a: {field}}}", types=TYPES if "gear" in field else "")
    codec, live = python.load(protocol), construct.live(protocol)
    payload = bytes.fromhex(data)
    assert codec.PutRequest(a=values).to_bytes() == payload == live.payload("put.request", {"a": values})
    assert codec.PutRequest.from_bytes(payload).a == values
    assert plain_numbers(live.messages["put.request"].parse(payload)) == {"a": values}
    plan = plan_of(protocol).message("put").payload
    assert pack(plan, unpack(plan, payload)) == payload


@pytest.fixture(scope="module")
def codec() -> Any:
    return python.load(protocol_of(REQUEST))


def test_counts(codec: Any) -> None:
    live = construct.live(protocol_of(REQUEST))
    assert codec.PutRequest(**VALUES).to_bytes() == PAYLOAD == live.payload("put.request", VALUES)
    found = codec.PutRequest.from_bytes(PAYLOAD)
    assert {name: getattr(found, name) for name in VALUES} == VALUES
    assert dict(live.messages["put.request"].parse(PAYLOAD)) | {"_io": None} == VALUES | {"_io": None}


ASKED = '{size: {type: u8, counts: a, counts_in: bytes}, a: {type: "u3[request.number]", packed: least}}'


def _asked() -> Any:
    return protocol_of("{number: {type: u8, range: 2..9}}", response=ASKED)


@pytest.mark.parametrize(("number", "seen"), [(2, 2), (3, 5), (5, 5), (9, 10)])
def test_without_the_request_a_row_has_the_items_that_fit_its_bytes(number: int, seen: int) -> None:
    protocol = _asked()
    codec, live, plan = python.load(protocol), construct.live(protocol), plan_of(protocol)
    items = [at % 7 for at in range(number)]
    payload = codec.PutResponse(a=items).to_bytes()
    assert payload == live.payload("put.response", {"a": items})
    assert payload[0] == len(payload) - 1
    told = items + [0] * (seen - number)
    assert codec.PutResponse.from_bytes(payload).a == told
    assert plain_numbers(live.messages["put.response"].parse(payload)) == {"a": told}
    content = plan.message("put.response").payload
    assert unpack(content, payload) == {"a": told}
    assert pack(content, {"a": items}) == payload
    assert [sizing_text(each) for each in content.sizing] == ["a: 8*size / 3; size is 1..4"]
    damaged = dissect(plan, Codec(plan).wrap("put.response", payload + b"\0"), "response")
    assert [span.number for span in damaged.spans if getattr(span.of, "name", "") == "a"] == [seen]


@pytest.mark.parametrize("payload", ["00", "05 00000000 00", "02 00", "01 0000"])
def test_a_wrong_number_of_bytes_is_refused(payload: str) -> None:
    protocol, data = _asked(), bytes.fromhex(payload)
    codec, live = python.load(protocol), construct.live(protocol)
    with pytest.raises(codec.DecodeError, match=r"length|bytes"):
        codec.PutResponse.from_bytes(data)
    with pytest.raises(ConstructError):
        live.messages["put.response"].parse(data)
    with pytest.raises(BadContent) as caught:
        unpack(plan_of(protocol).message("put.response").payload, data)
    assert caught.value.kind == "length"


@pytest.mark.parametrize("row", ["u11[request.number]", "u3[request.number]"])
def test_a_row_that_its_bytes_do_not_tell_is_refused(row: str) -> None:
    limits = ", range: 1..6" if row.startswith("u3") else ""
    response = ASKED.replace("u3[request.number]", row).replace("packed: least", f"packed: least{limits}")
    found = faults_of("{number: {type: u8, range: 1..9}}", response=response)
    assert [fault.message for fault in found] == [
        "the bytes of a do not tell the number of its items without the request"
    ]


@pytest.mark.parametrize("number", [1, 7, 8, 9, 63, 64])
def test_any_number(codec: Any, number: int) -> None:
    made = codec.PutRequest(coils=[at % 3 == 0 for at in range(number)], levels=[], last=0)
    assert len(made.to_bytes()) == 5 + (number + 7) // 8
    assert codec.PutRequest.from_bytes(made.to_bytes()).coils == made.coils


def test_bits_after_the_last_item_are_ignored(codec: Any) -> None:
    payload = PAYLOAD[:3] + b"\xfd" + PAYLOAD[4:6] + b"\x7f" + PAYLOAD[7:]
    found = codec.PutRequest.from_bytes(payload)
    assert (found.coils, found.levels) == (VALUES["coils"], VALUES["levels"])
    assert found.to_bytes() == PAYLOAD


@pytest.mark.parametrize(
    ("at", "byte", "kind", "field"),
    [(1, 9, "length", ""), (2, 2, "length", ""), (4, 7, "length", ""), (5, 0x07, "range", "levels")],
)
def test_wrong_bytes(codec: Any, at: int, byte: int, kind: str, field: str) -> None:
    payload = bytearray(PAYLOAD)
    payload[at] = byte
    with pytest.raises(codec.DecodeError) as caught:
        codec.PutRequest.from_bytes(bytes(payload))
    assert (caught.value.kind, caught.value.field) == (kind, field)
    with pytest.raises(BadContent) as refused:
        unpack(plan_of(protocol_of(REQUEST)).message("put").payload, bytes(payload))
    assert refused.value.kind == kind
    with pytest.raises(ConstructError):
        construct.live(protocol_of(REQUEST)).messages["put.request"].parse(bytes(payload))


@pytest.mark.parametrize("field", ["coils", "levels"])
@pytest.mark.parametrize("value", [[2], [7], [-1], ["1"], [1.0], [1] * 65])
def test_what_cannot_be_sent(codec: Any, field: str, value: object) -> None:
    if (field, value) == ("levels", [2]):
        value = [0]
    with pytest.raises(codec.EncodeError) as caught:
        codec.PutRequest(**VALUES | {field: value}).to_bytes()
    assert caught.value.field == field


def test_explained() -> None:
    """The items of a row, without the bits after them."""
    protocol = protocol_of(REQUEST)
    wire = python.load(protocol).PutRequest(**VALUES).to_frame()
    found = dissect(plan_of(protocol), wire, "request")
    assert [span.number for span in found.spans if getattr(span.of, "name", "") == "coils"] == [3]
    plan = plan_of(protocol)
    bad = dissect(plan, Codec(plan).wrap("put.request", PAYLOAD[:5] + b"\x07\x00\x09"), "request")
    assert [(each.kind, each.seen, each.at) for each in bad.faults] == [("range", 0, 9)]


def test_rows_of_the_model() -> None:
    assert pack_row([1, 2, 3], 4, "least") == bytes.fromhex("2103")
    assert pack_row([1, 2, 3], 4, "most") == bytes.fromhex("1230")
    assert unpack_row(bytes.fromhex("21f3"), 3, 4, "least") == [1, 2, 3]
    assert unpack_row(bytes.fromhex("123f"), 3, 4, "most") == [1, 2, 3]
    assert pack_row([], 4, "most") == b""


@pytest.mark.parametrize(
    ("request_", "text"),
    [
        ('{a: {type: "bool[0..9]", packed: least}}',
         _UNKNOWN),
        ('{n: {type: u8, counts: a, counts_in: bytes}, a: {type: "bool[0..9]", packed: least}}',
         "n does not tell the number of items of a; a byte may hold several; put a count in items before it"),
        ("{a: {type: u8, packed: least}}", "'packed' has no effect on a single number; remove it"),
        ('{a: {type: "bytes[2]", packed: least}}', "'packed' has no effect on bytes; remove it"),
        ('{a: {type: "f32[2]", packed: least}}', "'packed' has no effect on f32; remove it"),
        ('{a: {type: "u11[2]", packed: least, byteorder: big}}',
         "'byteorder' has no effect on bits in a row; remove it"),
        ('{a: {type: "u11[6000]", packed: most}}',
         "6000 items of 11 bits are too many in a row; use at most 5957"),
        ('{a: {type: "u65[2]", packed: most}}',
         "an item of an array cannot have 65 bits; use bytes, or at most 64 bits"),
    ],
)  # fmt: skip
def test_wrong_keys(request_: str, text: str) -> None:
    assert text in [f"{fault.message}; {fault.hint}" for fault in faults_of(request_)]
