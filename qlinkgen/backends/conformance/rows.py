"""Vectors as the kit holds them: the values of the C struct as bytes, and the frame."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from decimal import Decimal
from typing import Any

from qlinkgen.backends.conformance.sources import Header, Sources
from qlinkgen.model.message import Message, Value
from qlinkgen.model.naming import record_key
from qlinkgen.model.types import Array, Blob, Scalar
from qlinkgen.model.values import Native, default_of, from_json, raw_from_native
from qlinkgen.plan import Plan


@dataclass(frozen=True, slots=True)
class Right:
    """A frame as it should be. ``values`` are those of the struct, numbers with the high byte first."""

    message: Message
    kinds: tuple[str, ...]
    address: int
    values: bytes
    payload: bytes
    wire: bytes
    request: bytes = b""
    #: It is understood, but never sent.
    decode_only: bool = False
    #: Where it comes from, for a vector that was worked out by hand.
    source: str = ""

    @property
    def by_hand(self) -> bool:
        """People worked it out; what is generated is of a kind."""
        return not self.kinds


@dataclass(frozen=True, slots=True)
class Wrong:
    """A frame that is refused, and why."""

    message: Message
    kind: str
    what: str
    wire: bytes
    request: bytes = b""
    #: Where it comes from, for a vector that was worked out by hand.
    source: str = ""

    @property
    def by_hand(self) -> bool:
        """People worked it out; what is generated says what is wrong."""
        return not self.what


Row = Right | Wrong


def rows_of(plan: Plan, sources: Sources) -> dict[str, list[Row]]:
    """Every vector by the full name of its message; the wrong ones are mixed with the right ones.

    The last one of a message is right: after it nothing is left in a receiver.
    """
    right: dict[str, list[Right]] = {message.name: [] for message in plan.messages}
    wrong: dict[str, list[Wrong]] = {message.name: [] for message in plan.messages}
    for document in (sources.generated, sources.by_hand):
        for entry in document.get("vectors", ()):
            if entry["message"] in right:
                right[entry["message"]].append(_right(plan, sources.header, entry))
        for entry in document.get("faults", ()):
            if entry["message"] in wrong:
                wrong[entry["message"]].append(_wrong(plan, entry))
    return {name: _mixed(right[name], wrong[name]) for name in right}


def _mixed(right: Sequence[Right], wrong: Sequence[Wrong]) -> list[Row]:
    mixed: list[Row] = []
    for index, row in enumerate(right):
        mixed += wrong[index * len(wrong) // len(right) : (index + 1) * len(wrong) // len(right)]
        mixed.append(row)
    return mixed


def _right(plan: Plan, header: Header, entry: Mapping[str, Any]) -> Right:
    message = plan.by_name[entry["message"]].message
    by_hand = "kinds" not in entry
    return Right(
        message=message,
        kinds=() if by_hand else tuple(entry["kinds"]),
        address=entry.get(record_key(plan.frame.address), message.default_address),
        values=b"".join(_value(header, value, entry) for value in message.values),
        payload=bytes.fromhex(entry["payload"]),
        wire=bytes.fromhex(entry["wire"]),
        request=bytes.fromhex(entry.get("request", "")),
        decode_only=entry.get("decode_only", False),
        source=_source(entry) if by_hand else "",
    )


def _wrong(plan: Plan, entry: Mapping[str, Any]) -> Wrong:
    return Wrong(
        message=plan.by_name[entry["message"]].message,
        kind=entry["kind"],
        what=f"{entry['part']}: {entry['what']}" if "what" in entry else "",
        wire=bytes.fromhex(entry["wire"]),
        request=bytes.fromhex(entry.get("request", "")),
        source="" if "what" in entry else _source(entry),
    )


def _source(entry: Mapping[str, Any]) -> str:
    return ": ".join(str(entry[key]) for key in ("source", "work") if entry.get(key))


# Values


def most_values(header: Header, message: Message) -> int:
    """Most bytes that the values of a message have."""
    return sum(_most(header, value) for value in message.values)


def value_sizes(header: Header, message: Message, right: Right) -> list[int]:
    """Bytes of each value in a vector of a message."""
    sizes: list[int] = []
    for value in message.values:
        kind, at = value.type, sum(sizes)
        if isinstance(kind, Scalar):
            sizes.append(header.width(kind))
            continue
        width = header.width(kind.item) if isinstance(kind, Array) else 1
        counted = 0 if kind.length.fixed else header.count_width(kind.length.maximum)
        count = int.from_bytes(right.values[at : at + counted], "big") if counted else kind.length.maximum
        sizes.append(counted + width * count)
    return sizes


def _most(header: Header, value: Value) -> int:
    kind = value.type
    if isinstance(kind, Scalar):
        return header.width(kind)
    width = header.width(kind.item) if isinstance(kind, Array) else 1
    count = 0 if kind.length.fixed else header.count_width(kind.length.maximum)
    return count + width * kind.length.maximum


def _value(header: Header, value: Value, entry: Mapping[str, Any]) -> bytes:
    """One value: a number, or a count where it varies and the items."""
    kind, native = value.type, _native(value, entry)
    if isinstance(kind, Scalar):
        raw = entry.get("raw", {}).get(value.name)
        return number_bytes(raw_from_native(value, native) if raw is None else raw, header.width(kind))
    assert isinstance(native, bytes | str | list)
    count = b"" if kind.length.fixed else number_bytes(len(native), header.count_width(kind.length.maximum))
    if isinstance(kind, Blob):
        return count + (native.encode("ascii") if isinstance(native, str) else bytes(native))
    assert isinstance(native, list)
    return count + b"".join(number_bytes(item, header.width(kind.item)) for item in native)


def _native(value: Value, entry: Mapping[str, Any]) -> Native:
    """What the entry says, or else the default."""
    if value.name not in entry["fields"]:
        return default_of(value)
    given = entry["fields"][value.name]
    return from_json(value, Decimal(str(given)) if isinstance(given, float) else given)


def number_bytes(raw: int, width: int) -> bytes:
    """A number of a vector: its high byte first."""
    return (raw & (1 << 8 * width) - 1).to_bytes(width, "big")


def kinds_in(rows: Mapping[str, Sequence[Row]]) -> Iterator[str]:
    """Names of the kinds of generated vectors, in order of their first use."""
    yield from dict.fromkeys(
        kind for each in rows.values() for row in each if isinstance(row, Right) for kind in row.kinds
    )
