"""Test vectors: for every message a few choices of values and their bytes, and frames wrong in one way each.

Which values is decided here and in `choice`, what is wrong in `faults`. The bytes come from a `Reference`: an
argument, as back-ends do not know each other, ``generate(protocol, options, construct.live(protocol))``.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any

from qlinkgen.backends.base import Options, Outputs, banner
from qlinkgen.backends.vectors import choice, faults, writer
from qlinkgen.backends.vectors.choice import Chance, Raw
from qlinkgen.backends.vectors.reference import Good, Reference
from qlinkgen.model.frame import PacketFrame
from qlinkgen.model.message import Direction, Message
from qlinkgen.model.protocol import Protocol
from qlinkgen.model.types import Scalar
from qlinkgen.model.values import to_json

__all__ = ["KINDS", "Reference", "generate"]

#: Kinds of vectors that every message has. Kinds that come to the same bytes share a line.
KINDS = ("defaults", "minimum", "maximum", "a5", "random1", "random2")


def generate(protocol: Protocol, options: Options, reference: Reference) -> Outputs:
    """The vectors of a protocol: path below the output folder to text."""
    vectors = _Vectors(protocol, reference)
    kept = [
        each
        for each in protocol.messages
        if not options.only or {each.name, each.command} & set(options.only)
    ]
    good = {message.name: vectors.of(message) for message in kept}
    head = {
        "about": banner(protocol),
        "protocol": protocol.name,
    }
    rows = (row for message in kept for row in vectors.rows(message, good[message.name]))
    text = writer.document(head, {"vectors": rows, "faults": _faults(protocol, reference, kept, good)})
    return {f"vectors/{protocol.name}.json": text}


def _faults(
    protocol: Protocol, reference: Reference, messages: list[Message], good: Mapping[str, Mapping[str, Good]]
) -> Iterator[Mapping[str, Any]]:
    begun: set[Direction] = set()
    for message in messages:
        vectors = good[message.name]
        if message.direction not in begun:
            begun.add(message.direction)
            yield from (bad.entry() for bad in faults.of_protocol(protocol, reference, vectors))
        yield from (bad.entry() for bad in faults.of_message(protocol, reference, vectors))


class _Vectors:
    """Makes the vectors of one protocol's messages."""

    def __init__(self, protocol: Protocol, reference: Reference) -> None:
        self._protocol = protocol
        self._reference = reference
        self._packets = isinstance(protocol.frame, PacketFrame)
        #: Requests already made, for the responses of packets.
        self._requests: dict[tuple[str, str], bytes] = {}

    def of(self, message: Message) -> dict[str, Good]:
        """The vectors of a message by kind."""
        return {kind: self._one(message, kind) for kind in KINDS}

    def _one(self, message: Message, kind: str) -> Good:
        chance = Chance(f"{self._protocol.name} {message.name} {kind}")
        raws = _raws(message, kind, chance)
        address = _address(message, kind, chance)
        request = self._request(message, kind)
        payload = self._reference.payload(message.name, choice.natives(message, raws))
        wire = self._reference.seal(message.name, payload, address or 0, request)
        if self._packets and message.direction == "request":
            self._requests[message.command, kind] = wire
        return Good(message, address, raws, payload, wire, request)

    def _request(self, message: Message, kind: str) -> bytes:
        if not self._packets or message.direction != "response":
            return b""
        if (message.command, kind) not in self._requests:
            self._one(self._protocol.message(f"{message.command}.request"), kind)
        return self._requests[message.command, kind]

    def rows(self, message: Message, vectors: Mapping[str, Good]) -> Iterator[Mapping[str, Any]]:
        """The lines of a message in the file; equal frames are one."""
        kinds: dict[tuple[bytes, bytes], list[str]] = {}
        for kind, good in vectors.items():
            kinds.setdefault((good.request, good.wire), []).append(kind)
        for same in kinds.values():
            yield self._row(message, same, vectors[same[0]])

    def _row(self, message: Message, kinds: list[str], good: Good) -> Mapping[str, Any]:
        row: dict[str, Any] = {"message": message.name, "kinds": kinds}
        if good.address is not None and self._protocol.address_name:
            row[self._protocol.address_name] = good.address
        row |= _values(message, good)
        if good.request:
            row["request"] = good.request.hex()
        return row | {"payload": good.payload.hex(), "wire": good.wire.hex()}


def _values(message: Message, good: Good) -> Mapping[str, Any]:
    """Values as a decoder prints them, and the integers on the wire of those that differ from them."""
    fields, raw = {}, {}
    for value in message.values:
        shown = to_json(value, choice.native(value, good.values[value.name]))
        fields[value.name] = shown
        if isinstance(value.type, Scalar) and (type(shown) is not int or shown != good.values[value.name]):
            raw[value.name] = good.values[value.name]
    return {"fields": fields} | ({"raw": raw} if raw else {})


def _raws(message: Message, kind: str, chance: Chance) -> dict[str, Raw]:
    if kind == "defaults":
        return {value.name: choice.default(value) for value in message.values}
    rules = {"minimum": choice.MINIMUM, "maximum": choice.MAXIMUM, "a5": choice.A5}
    rule = rules.get(kind) or choice.random(chance)
    return {value.name: rule.raw(value) for value in message.values}


def _address(message: Message, kind: str, chance: Chance) -> int | None:
    if not message.addresses:
        return None
    first, last = message.addresses[0][0], message.addresses[-1][1]
    if kind.startswith("random"):
        return chance.between(*message.addresses[chance.between(0, len(message.addresses) - 1)])
    return {"minimum": first, "maximum": last}.get(kind, message.default_address)
