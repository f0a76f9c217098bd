"""Schemas whose names are given words: many in most slots, one a schema where there is but one."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

Data = dict[str, Any]

_CRC: Data = {"role": "checksum", "type": "u16", "algorithm": "crc-16/ibm-3740"}
_PARTS: Data = {
    "p0": {"role": "constant", "value": "A5 A5"},
    "p1": {"role": "length", "type": "u8", "counts": ["p4"]},
    "p2": {"role": "message", "type": "u8"},
    "p3": {"role": "address", "type": "u8"},
    "p4": {"role": "payload", "size": "0..200"},
    "p5": {**_CRC, "over": ["p1", "p2", "p3", "p4"]},
}
_STUFFING: Data = {"after": 0xA5, "insert": 0, "exempt": ["p0"]}
_MARKED: Data = {
    "marker": 0x80,
    "header": {"address": "3..6", "message": "0..2"},
    "end": 0,
    "payload": "0..200",
    "checksum": {**_CRC, "over": ["payload"], "sent": ["0..6", "8..14"]},
}
_PACKET: Data = {
    "p0": {"role": "message", "type": "u8"},
    "p1": {"role": "payload", "size": "0..200"},
    "p2": {"role": "checksum", "type": "u16", "algorithm": "sum16", "words": 1, "rejected": 0},
}


@dataclass(frozen=True)
class Frame:
    """A kind of frame and the bus it is for; its parts are called `p0` and so on."""

    data: Data
    bus: Data
    parts: int
    ids: int = 256
    seven: bool = False


_BUS = {"kind": "master_slave", "nodes": "1..16", "broadcast": 0}
FRAMES: Mapping[str, Frame] = {
    "streamed": Frame({"parts": _PARTS, "stuffing": _STUFFING}, _BUS, 6),
    "rescanned": Frame({"parts": _PARTS}, _BUS, 6),
    "packet": Frame({"packet": _PACKET}, {"kind": "host"}, 3),
    "marked": Frame({"marked": _MARKED}, {"kind": "ring", "nodes": "1..15"}, 0, ids=7, seven=True),
}


def base(frame: str, protocol: str = "sample", parts: Sequence[str] = ()) -> Data:
    """A schema without messages; parts that get no word keep their names."""
    found = FRAMES[frame]
    names = {f"p{index}": name for index, name in enumerate(parts)}
    return {
        "qlinkgen": 1,
        "protocol": {"name": protocol, "revision": "1", "source": "Made up"},
        **({"groups": {"bits": 7, "first": "least"}} if found.seven else {}),
        "frame": _renamed(found.data, names),
        "bus": found.bus,
    }


def _renamed(data: Any, names: Mapping[str, str]) -> Any:
    if isinstance(data, dict):
        return {names.get(key, key): _renamed(each, names) for key, each in data.items()}
    if isinstance(data, list):
        return [_renamed(each, names) for each in data]
    return names.get(data, data) if isinstance(data, str) else data


def _numbers(words: Sequence[str]) -> Data:
    return {word: number for number, word in enumerate(words)}


def single(frame: str, protocol: str, parts: Sequence[str]) -> Data:
    """A schema with words for its protocol and the parts of its frame, and fields called like the parts."""
    data = {**base(frame, protocol, parts), "defaults": _defaults(frame)}
    own = [each for index, each in enumerate(parts) if index != 3]
    first = {each: {"type": "i16", "scale": "1/10"} for each in own}
    second = {each: {"type": "u24" if index % 2 else "u8[2]"} for index, each in enumerate(own)}
    return {**data, "commands": {"first": {"id": 1, "request": first, "response": second}}}


def _defaults(frame: str) -> Data:
    where = "node" if FRAMES[frame].bus.get("nodes") else "none"
    return {"addressing": where, "repeat": "safe"}


def _kinds(frame: str) -> Sequence[Data]:
    """A field of each kind, the last of variable size where the frame has a length."""
    if FRAMES[frame].seven:
        return ({"type": "u7"}, {"type": "i14", "scale": "1/10"}, {"type": "text[0..2]"})
    return (
        {"type": "u8"},
        {"type": "i16", "scale": "1/10"},
        {"type": "u24"},
        {"type": "u8[2]"},
        {"type": "text[2]"},
        {"type": "u16[2]" if frame == "packet" else "u16[0..2]"},
    )


def _fields(frame: str, words: Sequence[str], first: int) -> Data:
    """Fields of every kind, called like the words after the first one."""
    kinds = _kinds(frame)
    turned = [*words[first:], *words[:first]]
    return {word: kinds[(first + index) % len(kinds)] for index, word in enumerate(turned[: len(kinds)])}


def _bits(words: Sequence[str], first: int) -> Data:
    return {word: {"at": bit} for bit, word in enumerate([*words[first:], *words[:first]][1:9])}


GROUPS = ("enums", "flags", "types")
#: Types that every schema has: the only words that lint refuses, and only as names of types.
BUILT_IN = ("bool", "bytes", "text")


def _type(word: str) -> str:
    return f"{word}_own" if word in BUILT_IN else word


def crowd(frame: str, group: str, words: Sequence[str]) -> Data:
    """A schema with a type, its members, a command or message, fields and an attribute for each word."""
    data = base(frame)
    kind = "u7" if FRAMES[frame].seven else "u8"
    most = {"enums": 12, "flags": 7}.get(group, 0)
    turned = [[*words[index:], *words[:index]] for index in range(len(words))]
    data[group] = {
        _type(word): {"type": kind, "values": {each: n for n, each in enumerate(others[:most])}}
        if most
        else {"type": kind, "scale": f"1/{10 + len(others)}"}
        for word, others in zip(words, turned, strict=True)
    }
    kept = words[: FRAMES[frame].ids - 1]
    if FRAMES[frame].seven or (group == "flags" and frame != "packet"):
        data["messages"] = {
            word: {
                "id": index + 1,
                "fields": _fields(frame, words, index + 1) | {word: {"type": _type(word)}},
            }
            | ({} if FRAMES[frame].seven else {"direction": ("request", "response")[index % 2]})
            for index, word in enumerate(kept)
        }
        return data
    data["commands"] = {
        word: {
            "id": index + 1,
            "request": {word: {"type": _type(word)}, "whole_": {"type": "u16", "bits": _bits(words, index)}},
            "response": _fields(frame, words, index),
        }
        for index, word in enumerate(kept)
    }
    attributes = {word: {"values": [word]} for word in words}
    return {
        **data,
        "attributes": attributes,
        "defaults": {**_defaults(frame), "attributes": {word: word for word in words}},
    }
