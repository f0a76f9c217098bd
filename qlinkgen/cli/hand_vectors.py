"""The vectors that people worked out for the shipped protocols: whether a schema still fits them."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from pathlib import Path
from types import ModuleType
from typing import Any

import yaml

from qlinkgen._resources import schemas_dir
from qlinkgen.cli.boundary import Failure
from qlinkgen.cli.codec import build, load_codec
from qlinkgen.cli.common import find_message
from qlinkgen.model.naming import record_key
from qlinkgen.model.protocol import Protocol

_Loader = getattr(yaml, "CSafeLoader", yaml.SafeLoader)


def file_of(protocol: Protocol) -> Path:
    """Where the vectors of a shipped protocol are, if it has some."""
    return schemas_dir() / "vectors" / f"{protocol.name}.yaml"


def read(protocol: Protocol) -> Mapping[str, Any]:
    """The vectors of a shipped protocol."""
    found: Mapping[str, Any] = yaml.load(file_of(protocol).read_text("utf-8"), _Loader)
    return found


def misfits(protocol: Protocol) -> list[str]:
    """The vectors that do not fit a shipped protocol, a line each with its place and the reason."""
    file = file_of(protocol)
    if not file.is_file():
        return []
    shown = file.relative_to(Path.cwd()) if file.is_relative_to(Path.cwd()) else file
    return [f"{shown}:{line}: this vector no longer fits: {why}" for line, why in _misfits(protocol)]


def _misfits(protocol: Protocol) -> Iterator[tuple[int, str]]:
    codec = load_codec(protocol)
    lines = _lines(yaml.compose(file_of(protocol).read_text("utf-8"), _Loader))
    found = read(protocol)
    for kind, misfit in (("vectors", _misfit), ("faults", _fault_misfit)):
        for line, row in zip(lines.get(kind, ()), found.get(kind, ()), strict=True):
            try:
                why = misfit(protocol, codec, row)
            except Failure as error:
                why = error.text
            except codec.CodecError as error:
                why = str(error)
            if why:
                yield line, why


def _lines(document: yaml.Node | None) -> dict[str, list[int]]:
    """The line of each item in the lists of the document."""
    pairs = document.value if isinstance(document, yaml.MappingNode) else []
    return {
        key.value: [item.start_mark.line + 1 for item in value.value]
        for key, value in pairs
        if isinstance(value, yaml.SequenceNode)
    }


def _misfit(protocol: Protocol, codec: ModuleType, row: Mapping[str, Any]) -> str:
    """Why a vector does not fit, "" if it does."""
    message = find_message(protocol, row["message"])
    name = protocol.address_name
    key = record_key(name) if name else ""
    if wrong := [each for each in ("node", "address") if each in row and each != key]:
        return f"frames have no {wrong[0]}"
    built = build(codec, message, row["fields"], {name: row[key]} if name and key in row else {})
    request = [codec.decode_request(bytes.fromhex(row["request"]))] if "request" in row else []
    payload, wire = bytes.fromhex(row["payload"]), bytes.fromhex(row["wire"])
    if row.get("decode_only"):
        found = _decode(codec, message.direction, wire, request)
        return "" if found == built else f"its bytes are {found}"
    for what, made, expected in (
        ("payload", built.to_bytes(), payload),
        ("frame", built.to_frame(*request), wire),
    ):
        if made != expected:
            return f"its {what} is {made.hex(' ').upper()} now"
    return ""


def _fault_misfit(protocol: Protocol, codec: ModuleType, row: Mapping[str, Any]) -> str:
    message = find_message(protocol, row["message"])
    request = [codec.decode_request(bytes.fromhex(row["request"]))] if "request" in row else []
    try:
        _decode(codec, message.direction, bytes.fromhex(row["wire"]), request)
    except codec.DecodeError as error:
        return "" if error.kind == row["kind"] else f"it is refused as {error.kind} now: {error}"
    return "it is a right frame now"


def _decode(codec: ModuleType, direction: str, wire: bytes, request: list[Any]) -> Any:
    suffix = "" if direction == "message" else f"_{direction}"
    return getattr(codec, f"decode{suffix}")(wire, *request)
