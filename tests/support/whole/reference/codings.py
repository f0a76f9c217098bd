"""Codings of runs of bytes, one byte at a time."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from tests.support.whole.reference.notation import Doc, octets
from tests.support.whole.reference.values import Wrong


class Coding:
    """One mapping of `coding`."""

    def __init__(self, spec: Doc) -> None:
        """Read the mapping."""
        self.kind = next(key for key in _KINDS if key in spec)
        self.given = {key: value for key, value in spec.items() if key != "over"}

    def begins_pair(self, byte: int, other: int) -> bool:
        """Whether a byte begins pairs when coded, none of them with the other byte."""
        if self.kind == "insert":
            return octets(self.given["after"]) == bytes([byte]) and octets(self.given["insert"])[0] != other
        if self.kind != "replace":
            return False
        pairs = self._pairs().values()
        return all(pair[0] == byte and pair[1] != other for pair in pairs) and byte != other

    def most(self, size: int) -> int:
        """Maximum size of so many bytes when coded."""
        if self.kind == "cobs":
            return size + size // 254 + 1
        if self.kind == "insert":
            return size + size // len(octets(self.given["after"]))
        return size if self.kind == "add" else 2 * size

    def encode(self, data: bytes) -> bytes:
        """The coded bytes."""
        if self.kind == "cobs":
            return _cobs(data)
        if self.kind == "insert":
            return _inserted(data, octets(self.given["after"]), octets(self.given["insert"]))
        return b"".join(self._sent(byte) for byte in data)

    def _sent(self, byte: int) -> bytes:
        if self.kind == "digits":
            return b"%02X" % byte
        if self.kind == "pair":
            return bytes([byte, 255 - byte])
        if self.kind == "add":
            return bytes([(byte + octets(self.given["add"])[0]) % 256])
        return self._pairs().get(byte, bytes([byte]))

    def _pairs(self) -> Mapping[int, bytes]:
        """Bytes that are sent as two."""
        if self.kind == "replace":
            return {octets(key)[0]: octets(value) for key, value in self.given["replace"].items()}
        escape, mask = octets(self.given["escape"]), octets(self.given["xor"])[0]
        return {octets(each)[0]: escape + bytes([octets(each)[0] ^ mask]) for each in self.given["of"]}

    def decode(self, sent: bytes) -> bytes:
        """The decoded bytes. Raises Wrong."""
        if self.kind == "cobs":
            return _uncobs(sent)
        if self.kind == "insert":
            return _uninserted(sent, octets(self.given["after"]), octets(self.given["insert"]))
        plain, rest = b"", sent
        while rest:
            byte, size = self._taken(rest)
            plain, rest = plain + bytes([byte]), rest[size:]
        return plain

    def goes_on(self, sent: bytes) -> bool:
        """Whether one more byte is needed for the first decoded one."""
        if len(sent) > 1 or self.kind == "add":
            return False
        if self.kind == "digits":
            return sent in map(bytes, zip(b"0123456789ABCDEFabcdef", strict=True))
        return self.kind == "pair" or sent == next(iter(self._pairs().values()))[:1]

    def _taken(self, sent: bytes) -> tuple[int, int]:
        """The first byte, and how many represent it."""
        if self.kind == "add":
            return (sent[0] - octets(self.given["add"])[0]) % 256, 1
        if self.kind == "digits":
            if len(sent) < 2 or not set(sent[:2]) <= set(b"0123456789ABCDEFabcdef"):
                raise Wrong("stuffing")
            return int(sent[:2].decode(), 16), 2
        if self.kind == "pair":
            if len(sent) < 2 or sent[0] + sent[1] != 255:
                raise Wrong("stuffing")
            return sent[0], 2
        escape = next(iter(self._pairs().values()))[:1]
        if sent[:1] != escape:
            return sent[0], 1
        if self.kind == "escape" and len(sent) > 1 and sent[1:2] != escape:
            return sent[1] ^ octets(self.given["xor"])[0], 2
        for byte, pair in self._pairs().items():
            if self.kind == "replace" and sent[:2] == pair:
                return byte, 2
        raise Wrong("stuffing")


_KINDS = ("escape", "replace", "insert", "cobs", "digits", "pair", "add")


def codings(spec: Any) -> Sequence[Coding]:
    """The codings of a frame, in the order in which they are applied."""
    specs = spec if isinstance(spec, list) else [spec] if spec else []
    return [Coding(each) for each in specs]


def _cobs(data: bytes) -> bytes:
    coded, block = b"", b""
    for index, byte in enumerate(data):
        if byte:
            block += bytes([byte])
        if byte == 0:
            coded, block = coded + bytes([len(block) + 1]) + block, b""
        elif len(block) == 254:
            coded, block = coded + b"\xff" + block, b""
            if index == len(data) - 1:
                return coded
    return coded + bytes([len(block) + 1]) + block


def _uncobs(sent: bytes) -> bytes:
    plain, at, zero = b"", 0, False
    while at < len(sent):
        plain += b"\0" if zero else b""
        end = at + sent[at]
        if sent[at] == 0 or end > len(sent) or 0 in sent[at:end]:
            raise Wrong("stuffing")
        plain += sent[at + 1 : end]
        zero, at = sent[at] < 255, end
    return plain


def _inserted(data: bytes, after: bytes, insert: bytes) -> bytes:
    sent, run = b"", b""
    for byte in data:
        sent, run = sent + bytes([byte]), run + bytes([byte])
        if run.endswith(after):
            sent, run = sent + insert, b""
    return sent


def _uninserted(sent: bytes, after: bytes, insert: bytes) -> bytes:
    plain, run, at = b"", b"", 0
    while at < len(sent):
        plain, run, at = plain + sent[at : at + 1], run + sent[at : at + 1], at + 1
        if run.endswith(after):
            if sent[at : at + 1] != insert:
                raise Wrong("stuffing")
            run, at = b"", at + 1
    return plain
