"""Schemas as data, with chosen words as names."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Literal

from qlinkgen.model.protocol import Protocol
from qlinkgen.schema import loads

Json = str | int | Sequence["Json"] | Mapping[str, "Json"]
Fields = Mapping[str, Json]

#: Default names of the parts of a frame.
PLAIN_PARTS = ("zz_start", "zz_length", "zz_id", "zz_to", "zz_data", "zz_check")


def frame(
    parts: Sequence[str], *, stuffed: bool = False, length: bool = True, check: str = "crc-16/modbus"
) -> Json:
    """A frame of six parts with these names: start, length, id, address, payload, check."""
    start, size, number, to, data, total = parts
    counted: Mapping[str, Json] = (
        {size: {"role": "length", "type": "u16", "counts": [data]}} if length else {}
    )
    framed: dict[str, Json] = {
        start: {"role": "constant", "value": "DC DC" if stuffed else "DC"},
        **counted,
        number: {"role": "message", "type": "u16"},
        to: {"role": "address", "type": "u8"},
        data: {"role": "payload", "size": "0..2000"},
        total: {
            "role": "checksum",
            "type": "u16",
            "algorithm": check,
            "over": [number, to, data],
        },
    }
    made: dict[str, Json] = {"parts": framed}
    if stuffed:
        made["stuffing"] = {"after": 0xDC, "insert": 0, "exempt": [start]}
    return made


def packet(parts: Sequence[str]) -> Json:
    """A packet of three of these parts."""
    _, _, number, _, data, check = parts
    total: Json = {"role": "checksum", "type": "u16", "algorithm": "sum16", "words": 1}
    return {
        "packet": {
            number: {"role": "message", "type": "u8"},
            data: {"role": "payload", "size": "0..64"},
            check: total,
        }
    }


def numbered(words: Sequence[str]) -> Json:
    """The words with numbers from 0."""
    return {word: number for number, word in enumerate(words)}


@dataclass
class Document:
    """A schema; sections that are not given have the minimum that is required."""

    name: str = "plain"
    frame: Json = field(default_factory=lambda: frame(PLAIN_PARTS))
    kind: Literal["master_slave", "host"] = "master_slave"
    enums: Mapping[str, Sequence[str]] = field(default_factory=dict)
    flags: Mapping[str, Sequence[str]] = field(default_factory=dict)
    types: Sequence[str] = ()
    attributes: Sequence[str] = ()
    commands: Mapping[str, tuple[Fields, Fields]] = field(default_factory=dict)
    messages: Mapping[str, Fields] = field(default_factory=dict)

    def text(self) -> str:
        """The file; JSON is YAML."""
        addressed = self.kind == "master_slave"
        head = {"name": self.name, "title": "Words", "revision": "1", "source": "tests", "doc": "Names."}
        nodes: dict[str, Json] = {"nodes": "1..31", "broadcast": 0} if addressed else {}
        addressing: dict[str, Json] = {"addressing": "either"} if addressed else {}
        number = iter(range(1, 0x10000))
        made: dict[str, Json] = {
            "qlinkgen": 1,
            "protocol": head,
            "byteorder": "big",
            "frame": self.frame,
            "bus": {"kind": self.kind, "baud": 9600, "response_within": "20 bytes", **nodes},
            "defaults": {"repeat": "safe", **addressing},
            "commands": {
                name: {"id": next(number), "doc": "Asks.", "request": asked, "response": told}
                for name, (asked, told) in self.commands.items()
            },
        }
        if self.enums:
            made["enums"] = {
                name: {
                    "type": "u16",
                    "doc": "Named.",
                    "values": {word: number for number, word in enumerate(words)},
                }
                for name, words in self.enums.items()
            }
        if self.flags:
            made["flags"] = {
                name: {
                    "type": "u64",
                    "doc": "Bits.",
                    "values": {word: number for number, word in enumerate(words)},
                }
                for name, words in self.flags.items()
            }
        if self.types:
            made["types"] = {name: {"type": "u16", "scale": "1/10"} for name in self.types}
        if self.attributes:
            made["attributes"] = {name: ["yes", "no"] for name in self.attributes}
        if self.messages:
            made["messages"] = {
                name: {"id": next(number), "doc": "Tells.", "direction": "request", "fields": told}
                for name, told in self.messages.items()
            }
        return json.dumps(made)

    def protocol(self) -> Protocol:
        """The protocol; fails if lint reports anything."""
        made, faults = loads(self.text(), f"{self.name}.yaml")
        assert not faults, "\n".join(map(str, faults[:20]))
        assert made is not None
        return made
