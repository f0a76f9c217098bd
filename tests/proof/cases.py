"""Expectations: protocols with their vectors, by hand and by the reference."""

from __future__ import annotations

import functools
import json
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from decimal import Decimal
from pathlib import Path
from typing import Any

import yaml

from qlinkgen.backends import construct, python, vectors
from qlinkgen.backends.base import Options
from qlinkgen.model import naming
from qlinkgen.model.message import Message
from qlinkgen.model.protocol import Protocol
from qlinkgen.model.values import from_json
from qlinkgen.schema import find, load

ROOT = Path(__file__).parents[2]
SHIPPED = ("qlink", "trio", "mc1231a")
#: Kinds of frames and fields that do not occur in shipped protocols.
OTHERS = tuple(sorted(path.stem for path in (ROOT / "tests" / "schemas").glob("*.yaml")))
PROTOCOLS = (*SHIPPED, *OTHERS)


@dataclass(frozen=True)
class Case:
    """A valid frame."""

    message: Message
    address: int
    #: Values of the frame.
    beside: Mapping[str, Any]
    fields: Mapping[str, Any]
    payload: bytes
    wire: bytes
    request: bytes = b""
    #: Raw values that differ from the values of Python objects.
    raw: Mapping[str, int] = field(default_factory=dict)
    kinds: tuple[str, ...] = ()
    decode_only: bool = False


@dataclass(frozen=True)
class Refusal:
    """A wrong frame, and its kind of fault."""

    kind: str
    message: Message
    wire: bytes
    request: bytes
    what: str


@functools.cache
def protocol(name: str) -> Protocol:
    """A shipped protocol, or one of the tests."""
    return load(find(name) if name in SHIPPED else ROOT / "tests" / "schemas" / f"{name}.yaml")


@functools.cache
def reference(name: str) -> construct.Live:
    """Live construct structures."""
    return construct.live(protocol(name))


@functools.cache
def module(name: str) -> Any:
    """The generated Python module."""
    return python.load(protocol(name))


@functools.cache
def generated(name: str) -> Mapping[str, Any]:
    """The generated vectors, parsed from their text."""
    [text] = vectors.generate(protocol(name), Options()).values()
    return json.loads(text, parse_float=Decimal)  # type: ignore[no-any-return]


@functools.cache
def by_hand(name: str) -> Mapping[str, Any]:
    """The vectors worked out by hand; the protocols of the tests have none."""
    path = ROOT / "schemas" / "vectors" / f"{name}.yaml"
    return yaml.safe_load(path.read_text("utf-8")) if path.exists() else {}


def cases(name: str) -> list[Case]:
    """All valid frames."""
    return [
        _case(protocol(name), row)
        for source in (by_hand, generated)
        for row in source(name).get("vectors", ())
    ]


def refusals(name: str) -> list[Refusal]:
    """All wrong frames."""
    return list(_refusals(name))


def _refusals(name: str) -> Iterator[Refusal]:
    for source in (by_hand, generated):
        for row in source(name).get("faults", ()):
            message = protocol(name).by_name[row["message"]]
            wire, request = bytes.fromhex(row["wire"]), bytes.fromhex(row.get("request", ""))
            yield Refusal(row["kind"], message, wire, request, row.get("what") or row["work"])


def _case(described: Protocol, row: Mapping[str, Any]) -> Case:
    message = described.by_name[row["message"]]
    fields = {
        value.name: from_json(value, row["fields"][value.name])
        for value in message.values
        if value.name in row["fields"]
    }
    assert len(fields) == len(row["fields"]), f"{message.name} has no {set(row['fields']) - set(fields)}"
    return Case(
        message=message,
        address=row.get(described.address_name, 0) if described.address_name else 0,
        beside={
            value.name: from_json(value, row[naming.record_key(value.name)])
            for value in described.beside(message)
        },
        fields=fields,
        payload=bytes.fromhex(row["payload"]),
        wire=bytes.fromhex(row["wire"]),
        request=bytes.fromhex(row.get("request", "")),
        raw=row.get("raw", {}),
        kinds=tuple(row.get("kinds", ())),
        decode_only=row.get("decode_only", False),
    )
