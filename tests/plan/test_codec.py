"""The interpreter of the plan against every vector."""

from __future__ import annotations

import json
from functools import cache
from pathlib import Path

import pytest

from qlinkgen.model.message import Direction
from qlinkgen.plan import Plan, plan_of
from qlinkgen.plan.codec import Codec
from qlinkgen.plan.content import Raw
from qlinkgen.plan.payload import BytesStep
from qlinkgen.plan.reading import BadFrame
from qlinkgen.schema.loader import load

_ROOT = Path(__file__).resolve().parents[2]
_SHIPPED = ("qlink", "trio", "mc1231a")


@cache
def _plan(path: Path) -> Plan:
    return plan_of(load(path))


def _vectors(name: str, kind: str) -> list[dict[str, object]]:
    text = (_ROOT / "generated" / "vectors" / f"{name}.json").read_text("utf-8")
    rows: list[dict[str, object]] = json.loads(text)[kind]
    return rows


def _raw(plan: Plan, row: dict[str, object]) -> dict[str, Raw]:
    """The raw values of a vector."""
    fields, raws = dict(row["fields"]), row.get("raw", {})  # type: ignore[call-overload]
    for each in plan.message(str(row["message"])).payload.settable:
        if isinstance(each, BytesStep):
            text = fields[each.name]
            fields[each.name] = text.encode("ascii") if each.text else bytes.fromhex(text)
    return {**fields, **raws}  # type: ignore[dict-item]


def _direction(plan: Plan, name: str) -> Direction:
    return "response" if plan.message(name).direction == "response" else "request"


@pytest.mark.parametrize("name", _SHIPPED)
def test_every_vector_is_encoded_and_decoded(name: str) -> None:
    plan = _plan(_ROOT / "schemas" / f"{name}.yaml")
    codec = Codec(plan)
    for row in _vectors(name, "vectors"):
        message, values = str(row["message"]), _raw(plan, row)
        address = row.get(plan.frame.address)
        assert address is None or isinstance(address, int)
        request = bytes.fromhex(str(row.get("request", "")))
        wire = codec.encode(message, values, address, request)
        assert wire.hex() == row["wire"], row
        decoded = codec.decode(wire, _direction(plan, message), request)
        assert (decoded.message.name, decoded.address, decoded.values) == (message, address, values)


@pytest.mark.parametrize("name", _SHIPPED)
def test_every_wrong_frame_has_the_kind_of_its_vector(name: str) -> None:
    plan = _plan(_ROOT / "schemas" / f"{name}.yaml")
    for row in _vectors(name, "faults"):
        wire, request = (bytes.fromhex(str(row.get(key, ""))) for key in ("wire", "request"))
        with pytest.raises(BadFrame) as caught:
            Codec(plan).decode(wire, _direction(plan, str(row["message"])), request)
        assert caught.value.kind == row["kind"], row


@pytest.mark.parametrize(
    ("name", "request_", "wire", "kind", "end"),
    [
        ("mc1231a", None, "EE", "unknown", 1),
        ("mc1231a", None, "0B 00", "length", 1),
        ("mc1231a", "EE", "00 00", "unknown", 0),
        ("mc1231a", "", "00 0B", "unknown", 0),
        ("mc1231a", "0B", "00", "truncated", 1),
        ("mc1231a", "0B", "00 0B 00 00", "length", 2),
        ("mc1231a", "0B", "00 00", "illegal", 2),
        ("mc1231a", "0B", "00 0C", "crc", 2),
        ("qlink", None, "", "truncated", 0),
        ("qlink", None, "A5 A5 05 05 00 00 D3", "truncated", 7),
        ("qlink", None, "A4 A5 05 05 00 00 D3 75", "frame", 0),
        ("qlink", None, "A5 A4 05 05 00 00 D3 75", "frame", 1),
        ("qlink", None, "A5 A5 03 05 00 00 D3 75", "length", 3),
        ("qlink", None, "A5 A5 05 05 00 00 D3 00", "crc", 8),
        ("qlink", None, "A5 A5 05 05 00 00 D3 75 00", "length", 8),
        ("trio", None, "9C 00", "truncated", 2),
        ("trio", None, "00 9C 00 98", "frame", 0),
        ("trio", None, "9C 00 98 00", "frame", 3),
    ],
)
def test_a_wrong_frame_ends_where_that_is_known(
    name: str, request_: str | None, wire: str, kind: str, end: int
) -> None:
    plan = _plan(_ROOT / "schemas" / f"{name}.yaml")
    direction: Direction = plan.received_directions[0] if request_ is None else "response"
    with pytest.raises(BadFrame) as caught:
        Codec(plan).decode(bytes.fromhex(wire), direction, bytes.fromhex(request_ or ""))
    assert (caught.value.kind, caught.value.end) == (kind, end)


def test_a_frame_is_for_address_0_unless_another_is_said() -> None:
    codec = Codec(_plan(_ROOT / "schemas" / "qlink.yaml"))
    assert codec.wrap("node_sync.request", b"\x00").hex() == "a5a505050000d375"
    assert codec.wrap("node_sync.request", b"\x00", 3)[4] == 3
