"""The hand-written vectors of the shipped protocols, and the check whether a schema still matches them."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from functools import partial
from pathlib import Path
from types import ModuleType
from typing import Literal, NotRequired, TypedDict, cast

import yaml

from qlinkgen._resources import schemas_dir
from qlinkgen.cli.boundary import Failure
from qlinkgen.cli.codec import MessageObject, build, load_codec
from qlinkgen.cli.common import find_message
from qlinkgen.model.naming import record_key
from qlinkgen.model.protocol import Protocol
from qlinkgen.model.values import Json
from qlinkgen.plan.framing import frame_plan

_ADDRESSES: tuple[Literal["node"], Literal["address"]] = ("node", "address")
_Loader = getattr(yaml, "CSafeLoader", yaml.SafeLoader)


class _Given(TypedDict):
    message: str
    wire: str  # hex, like all bytes here
    request: NotRequired[str]


class Vector(_Given):
    """A message and its bytes."""

    fields: dict[str, Json]
    payload: str
    node: NotRequired[int]
    address: NotRequired[int]
    decode_only: NotRequired[bool]


class BadVector(_Given):
    """Bytes that must be refused."""

    kind: str


class Vectors(TypedDict, total=False):
    """A file of vectors."""

    vectors: list[Vector]
    faults: list[BadVector]


def file_of(protocol: Protocol) -> Path:
    """Return the path of the vectors of a shipped protocol, which may not exist."""
    return schemas_dir() / "vectors" / f"{protocol.name}.yaml"


def read(protocol: Protocol) -> Vectors:
    """Read the vectors of a shipped protocol."""
    found: Vectors = yaml.load(file_of(protocol).read_text("utf-8"), _Loader)
    return found


def mismatches(protocol: Protocol) -> list[str]:
    """Return the vectors that do not match a shipped protocol, one line each with place and reason."""
    file = file_of(protocol)
    if not file.is_file():
        return []
    shown = file.relative_to(Path.cwd()) if file.is_relative_to(Path.cwd()) else file
    return [f"{shown}:{line}: this vector no longer matches: {why}" for line, why in _mismatches(protocol)]


def _mismatches(protocol: Protocol) -> Iterator[tuple[int, str]]:
    codec = load_codec(protocol)
    lines = _lines(yaml.compose(file_of(protocol).read_text("utf-8"), _Loader))
    found = read(protocol)
    checks = [
        *(partial(_mismatch, protocol, codec, row) for row in found.get("vectors", ())),
        *(partial(_fault_mismatch, protocol, codec, row) for row in found.get("faults", ())),
    ]
    places = (*lines.get("vectors", ()), *lines.get("faults", ()))
    for line, check in zip(places, checks, strict=True):
        try:
            why = check()
        except Failure as error:
            why = error.text
        except codec.CodecError as error:
            why = str(error)
        if why:
            yield line, why


def _lines(document: yaml.Node | None) -> dict[str, list[int]]:
    """Return the line of each item in the lists of the document."""
    pairs = document.value if isinstance(document, yaml.MappingNode) else []
    return {
        key.value: [item.start_mark.line + 1 for item in value.value]
        for key, value in pairs
        if isinstance(value, yaml.SequenceNode)
    }


def _mismatch(protocol: Protocol, codec: ModuleType, row: Vector) -> str:
    """Return why a vector does not match, "" if it does."""
    message = find_message(protocol, row["message"])
    name = protocol.address_name
    key = record_key(name) if name else ""
    addresses: dict[str, int] = {each: row[each] for each in _ADDRESSES if each in row}
    if wrong := [each for each in addresses if each != key]:
        return f"frames have no {wrong[0]}"
    given = {name: addresses[key]} if name and key in addresses else {}
    keys = {value.name: record_key(value.name) for value in protocol.beside(message)}
    every = cast(Mapping[str, Json], row)  # its other keys depend on the frame
    beside = {name: every[key] for name, key in keys.items() if key in every}
    built = build(codec, message, {**beside, **row["fields"]}, given, protocol.beside(message))
    request = [codec.decode_request(bytes.fromhex(row["request"]))] if "request" in row else []
    payload, wire = bytes.fromhex(row["payload"]), bytes.fromhex(row["wire"])
    packets = frame_plan(protocol.frame).needs_request
    if row.get("decode_only"):
        found = _decode(codec, message.direction, wire, request)
        return "" if found == built else f"its bytes are {found}"
    for what, made, expected in (
        ("payload", built.to_bytes(), payload),
        ("frame", built.to_frame(*(request if packets else ())), wire),
    ):
        if made != expected:
            return f"its {what} is {made.hex(' ').upper()} now"
    return ""


def _fault_mismatch(protocol: Protocol, codec: ModuleType, row: BadVector) -> str:
    message = find_message(protocol, row["message"])
    request = [codec.decode_request(bytes.fromhex(row["request"]))] if "request" in row else []
    try:
        _decode(codec, message.direction, bytes.fromhex(row["wire"]), request)
    except codec.DecodeError as error:
        return "" if error.kind == row["kind"] else f"it is now refused as {error.kind}: {error}"
    return "it is now a valid frame"


def _decode(codec: ModuleType, direction: str, wire: bytes, request: list[MessageObject]) -> MessageObject:
    suffix = "" if direction == "message" else f"_{direction}"
    found: MessageObject = getattr(codec, f"decode{suffix}")(wire, *request)
    return found
