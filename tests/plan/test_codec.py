"""The interpreter of the plan against every vector, and its receivers against the model of the tests."""

from __future__ import annotations

import json
import random
from collections.abc import Iterator
from functools import cache
from pathlib import Path

import pytest

from qlinkgen.model.message import Direction
from qlinkgen.plan import Plan, plan_of
from qlinkgen.plan.codec import Codec
from qlinkgen.plan.content import Raw, Unsendable, pack
from qlinkgen.plan.payload import BytesStep
from qlinkgen.plan.reading import BadFrame
from qlinkgen.plan.receive import Event, receiver
from qlinkgen.schema.loader import load
from tests.support import receiver_model

_ROOT = Path(__file__).resolve().parents[2]
_SHIPPED = ("qlink", "trio", "mc1231a")
_SCHEMAS = sorted([*(_ROOT / "schemas").glob("*.yaml"), *(_ROOT / "tests" / "schemas").glob("*.yaml")])


@cache
def _plan(path: Path) -> Plan:
    return plan_of(load(path))


def _vectors(name: str, kind: str) -> list[dict[str, object]]:
    text = (_ROOT / "generated" / "vectors" / f"{name}.json").read_text("utf-8")
    rows: list[dict[str, object]] = json.loads(text)[kind]
    return rows


def _raw(plan: Plan, row: dict[str, object]) -> dict[str, Raw]:
    """The values of a vector as they are on the wire."""
    fields, raws = dict(row["fields"]), row.get("raw", {})  # type: ignore[call-overload]
    for each in plan.message(str(row["message"])).payload.settable:
        if isinstance(each, BytesStep):
            text = fields[each.name]
            fields[each.name] = text.encode("ascii") if each.text else bytes.fromhex(text)
    return {**fields, **raws}  # type: ignore[dict-item]


def _direction(plan: Plan, name: str) -> Direction:
    return "response" if plan.message(name).direction == "response" else "request"


@pytest.mark.parametrize("name", _SHIPPED)
def test_every_vector_goes_both_ways(name: str) -> None:
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


def _good(plan: Plan, direction: Direction) -> list[bytes]:
    wires = []
    for message in plan.received(direction):
        try:
            payload = pack(message.payload, {})
        except Unsendable:  # the caller has to choose a value
            payload = bytes(message.payload.least)
        wires.append(Codec(plan).seal(message.name, payload, message.message.default_address))
    return wires


def _damaged(wires: list[bytes], chance: random.Random) -> bytes:
    stream = b""
    for _ in range(6):
        wire = bytearray(chance.choice(wires))
        at = chance.randrange(len(wire))
        match chance.randrange(6):
            case 0:
                wire[at] ^= 1 << chance.randrange(8)
            case 1:
                del wire[at]
            case 2:
                del wire[at:]
            case 3:
                wire[at:at] = chance.randbytes(3)
            case _:
                pass
        stream += bytes(wire)
    return stream


def _cases() -> Iterator[tuple[Path, Direction]]:
    for path in _SCHEMAS:
        plan = _plan(path)
        yield from ((path, each) for each in plan.heard if path.stem != "mc1231a" or each == "request")


def _told(event: receiver_model.Event | Event) -> tuple[object, ...]:
    # When a run of noise is long enough to be told depends on how early a header is given up.
    at = None if event.kind == "frame" else event.at
    return event.kind, at, event.offset, event.raw


@pytest.mark.parametrize(
    ("path", "direction"), list(_cases()), ids=lambda value: getattr(value, "stem", value)
)
def test_receivers_give_the_events_of_the_model(path: Path, direction: Direction) -> None:
    plan, chance = _plan(path), random.Random(path.stem)
    wires = _good(plan, direction)
    for _ in range(60):
        stream = _damaged(wires, chance)
        model, own = receiver_model.receiver(plan.protocol, direction), receiver(plan, direction)
        expected = [_told(event) for byte in stream for event in model.feed(byte)]
        found = [_told(event) for byte in stream for event in own.feed(byte)]
        assert found == expected, stream.hex()
        ends = [[(e.kind, e.offset, e.raw) for e in each.finish()] for each in (model, own)]
        assert ends[0] == ends[1], stream.hex()
