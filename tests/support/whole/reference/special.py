"""Marked frames, and packets."""

from __future__ import annotations

from collections.abc import Mapping

from tests.support.whole.reference import checks
from tests.support.whole.reference.fields import Fields
from tests.support.whole.reference.frames import part_of
from tests.support.whole.reference.layouts import Message
from tests.support.whole.reference.notation import Doc, part_doc, whole_span
from tests.support.whole.reference.values import Wrong, put


class Marked:
    """Frames whose header and end have a marker bit."""

    def __init__(self, document: Doc) -> None:
        """Read the bits of the header."""
        spec, order = document["frame"]["marked"], document.get("byteorder", "big")
        self.marker: int = spec["marker"]
        self._address, self._message = (whole_span(spec["header"][key]) for key in ("address", "message"))
        self._end: int = spec["end"]
        self.most = whole_span(spec["payload"])[1]
        fields = Fields(document, 0)
        self._check = part_of("checksum", spec["checksum"], order, fields) if "checksum" in spec else None
        self.check_size = self._check.size if self._check else 0

    def _bits(self, byte: int, where: tuple[int, int]) -> int:
        return byte >> where[0] & (1 << where[1] + 1 - where[0]) - 1

    def is_end(self, byte: int) -> bool:
        """Whether the id bits are those of an end."""
        return self._bits(byte, self._message) == self._end

    def wrap(self, message: Message, payload: bytes, address: int) -> bytes:
        """The wire bytes around a payload."""
        place = self.marker | address << self._address[0]
        first, last = place | message.number << self._message[0], place | self._end << self._message[0]
        return bytes([first]) + payload + self._value(message, payload) + bytes([last])

    def _value(self, message: Message, payload: bytes) -> bytes:
        if self._check is None or not message.checked:
            return b""
        covered = payload if "payload" in self._check.spec["over"] else b""
        return put(
            self._check.pieces,
            checks.compute(self._check.spec["algorithm"], covered, self._check.spec.get("init")),
        )

    def check_ends(self, wire: bytes) -> None:
        """Check that the data is a header, bytes without the marker, and an end. Raises Wrong."""
        marks = [at for at, byte in enumerate(wire) if byte & self.marker]
        if not wire or (marks == [0] and not self.is_end(wire[0])):
            raise Wrong("truncated")
        if marks != [0, len(wire) - 1] or self.is_end(wire[0]) or not self.is_end(wire[-1]):
            raise Wrong("frame")

    def opened(self, raw: bytes, known: Mapping[int, Message]) -> tuple[Message, int, bytes]:
        """Message, address and payload between a header and an end. Raises Wrong."""
        message, address = known.get(self._bits(raw[0], self._message)), self._bits(raw[0], self._address)
        if message is None or address == 0 or self._bits(raw[-1], self._address) != address:
            raise Wrong("frame")
        end = len(raw) - 1 - (self.check_size if message.checked else 0)
        payload, sent = raw[1:end], raw[end:-1]
        least, most = message.sizes
        if not (least <= end - 1 <= most or (end == 1 and message.empty_is_default)):
            raise Wrong("frame")
        if sent != self._value(message, payload):
            raise Wrong("crc")
        return message, address, payload


class Packets:
    """Packets."""

    def __init__(self, document: Doc) -> None:
        """Read the sum."""
        parts = document["frame"]["packet"]
        order = document.get("byteorder", "big")
        found = [
            part_of(name, spec, order, Fields(document, 0))
            for name, spec in parts.items()
            if part_doc(spec)["role"] == "checksum"
        ]
        self._check = found[0] if found else None

    def size(self, message: Message) -> int:
        """Size of a packet, which is constant."""
        check = self._check.size if self._check and message.direction == "response" else 0
        return message.sizes[1] + (check if message.direction == "response" else 1)

    def wrap(self, message: Message, payload: bytes, request: bytes) -> bytes:
        """A request, or a response to one."""
        if message.direction == "request":
            return bytes([message.number]) + payload
        return payload + self._value(request, payload)

    def _value(self, request: bytes, payload: bytes) -> bytes:
        if self._check is None:
            return b""
        words, word = request[1:] + payload, self._check.spec.get("words", 1)
        units = [int.from_bytes(words[at : at + word], "big") for at in range(0, len(words), word)]
        return put(self._check.pieces, checks.compute(self._check.spec["algorithm"], [request[0], *units]))

    def opened(self, message: Message, wire: bytes, request: bytes) -> bytes:
        """The payload of a request, or of the response to one. Raises Wrong."""
        answers = message.direction == "response"
        size = self._check.size if self._check and answers else 0
        beside = size if answers else 1
        least, most = message.sizes
        if len(wire) < (0 if message.empty_is_default else least) + beside:
            raise Wrong("truncated")
        if len(wire) > most + beside:
            raise Wrong("length")
        if not answers:
            return wire[1:]
        payload, sent = wire[: len(wire) - size], wire[len(wire) - size :]
        if sent != self._value(request, payload):
            rejected = self._check.spec.get("rejected") if self._check else None
            refused = self._check and rejected is not None and sent == put(self._check.pieces, rejected)
            raise Wrong("illegal" if refused else "crc")
        return payload
