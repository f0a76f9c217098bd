"""Texts of programs, correct and broken, and the requests that load them."""

from __future__ import annotations

import random
from collections.abc import Callable

from qlinkgen.codecs import qlink

RECORD = 16
DATA, END, SEGMENT, SEGMENT_ENTRY, LINEAR, LINEAR_ENTRY = range(6)


def record(kind: int, offset: int, data: bytes, *, error: int = 0) -> bytes:
    """Return one Intel HEX record without its line end; `error` is added to the checksum."""
    body = bytes((len(data), offset >> 8, offset & 0xFF, kind)) + data
    return b":" + (body + bytes((error - sum(body) & 0xFF,))).hex().upper().encode()


class Texts:
    """Makes programs for a node that holds `size` bytes from address 0 on."""

    def __init__(self, chance: random.Random, size: int) -> None:
        self._random = chance
        self._size = size
        self._spoilers: tuple[Callable[[list[bytes]], None], ...] = (
            self._wrong_checksum,
            self._no_digit,
            self._unknown_type,
            self._overlap,
            self._outside,
            self._wrong_size,
            self._text_between,
            self._after_the_end,
            self._after_the_end,  # listed twice: it needs all of the text before it loaded
        )

    def right(self) -> bytes:
        """Return a program that fits."""
        return self._joined(self._records())

    def broken(self) -> bytes:
        """Return a text that a node must reject."""
        records = self._records()[-self._random.randint(1, 3) :]  # a short one, so that its fault is reached
        self._random.choice(self._spoilers)(records)
        return self._joined(records)

    def _records(self) -> list[bytes]:
        chance, base = self._random, 0
        lines = []
        for slot in chance.sample(range(self._size // RECORD), chance.randint(1, 3)):
            address = RECORD * slot
            if chance.random() < 0.2:
                base = RECORD * chance.randint(0, slot)
                lines.append(record(SEGMENT, 0, (base >> 4).to_bytes(2, "big")))
            elif base > address or chance.random() < 0.1:
                base = 0
                lines.append(record(LINEAR, 0, bytes(2)))
            # The last byte of the slot, and so that of the memory, is in many of them.
            size = chance.choice((1, RECORD, chance.randint(1, RECORD)))
            first = address + (RECORD - size if chance.random() < 0.5 else 0)
            lines.append(record(DATA, first - base, self._bytes(size)))
        if chance.random() < 0.3:
            lines.append(record(chance.choice((SEGMENT_ENTRY, LINEAR_ENTRY)), 0, self._bytes(4)))
        return [*lines, record(END, 0, b"")]

    def _joined(self, records: list[bytes]) -> bytes:
        end = self._random.choice((b"\r\n", b"\n", b" \t"))
        text = b"".join(line + end for line in records)
        return text.lower() if self._random.random() < 0.2 else text

    def _bytes(self, size: int) -> bytes:
        return self._random.choice((self._random.randbytes(size), b"\xa5" * size, bytes(size)))

    def _insert(self, records: list[bytes], line: bytes) -> None:
        records.insert(self._random.randrange(len(records)), line)

    def _wrong_checksum(self, records: list[bytes]) -> None:
        self._insert(records, record(DATA, 0, b"", error=self._random.randint(1, 255)))

    def _no_digit(self, records: list[bytes]) -> None:
        line = bytearray(record(LINEAR_ENTRY, 0, bytes(4)))
        line[self._random.randrange(1, len(line))] = self._random.choice(b"G:/@`g \n")
        self._insert(records, bytes(line))

    def _unknown_type(self, records: list[bytes]) -> None:
        self._insert(records, record(self._random.randint(6, 255), 0, b""))

    def _overlap(self, records: list[bytes]) -> None:
        self._insert(records, record(LINEAR, 0, bytes(2)) + record(DATA, 8, bytes(4)))
        self._insert(records, record(LINEAR, 0, bytes(2)) + record(DATA, self._random.choice((8, 11)), b"\1"))

    def _outside(self, records: list[bytes]) -> None:
        size = self._random.randint(1, 8)
        inside = self._random.choice((size - 1, self._random.randrange(size)))
        line = record(LINEAR, 0, bytes(2)) + record(DATA, self._size - inside, bytes(size))
        if self._random.random() < 0.3:
            high = self._random.choice((1, 0x8000, 0xFFFF)).to_bytes(2, "big")
            line = record(LINEAR, 0, high) + record(DATA, self._random.choice((0, 0xFFFF)), b"\1")
        self._insert(records, line)

    def _wrong_size(self, records: list[bytes]) -> None:
        kind, size = self._random.choice(((END, 1), (SEGMENT, 1), (LINEAR, 4), (LINEAR_ENTRY, 3)))
        self._insert(records, record(kind, 0, bytes(size)))

    def _text_between(self, records: list[bytes]) -> None:
        self._insert(records, self._random.choice((b"x", b"0", b"\0", b"\xa5\xa5")))

    def _after_the_end(self, records: list[bytes]) -> None:
        records.append(self._random.choice((b":", b"x", record(DATA, 0, b"\1"))))


class Loader:
    """Loads one program after the other, sometimes with errors in the sequence."""

    def __init__(self, chance: random.Random, size: int) -> None:
        self._random = chance
        self._texts = Texts(chance, size)
        self._text = b""
        self._at = 0
        self._counter = 0
        self._refusals = 0
        self._pending = (0, 0)

    def request(self, node: int) -> qlink.Message:
        """Return the next request."""
        chance = self._random.random()
        piece = self._text[self._at : self._at + self._random.choice((1, 7, 24, 25))]
        self._pending = (0, 0)
        if not piece or self._refusals > 2 or chance < 0.01:
            return self._opening(node)
        if chance < 0.1 and self._at:
            return qlink.NodeProgramLoadRequest(
                node=node, counter=(self._counter - 1) % 256, program_data=piece
            )
        if chance < 0.15:
            away = self._random.choice((1, 2, 128, 254, 254 if self._at else 255))
            wrong = (self._counter + away) % 256
            return qlink.NodeProgramLoadRequest(node=node, counter=wrong, program_data=piece)
        self._pending = (len(piece), 1)
        return qlink.NodeProgramLoadRequest(node=node, counter=self._counter, program_data=piece)

    def _opening(self, node: int) -> qlink.Message:
        self._text = self._texts.right() if self._random.random() < 0.5 else self._texts.broken()
        self._at = self._counter = self._refusals = 0
        return qlink.NodeProgramLoadRequest(node=node)

    def told(self, *, acknowledged: bool) -> None:
        """Take the result of the last request."""
        if acknowledged:
            self._at += self._pending[0]
            self._counter = (self._counter + self._pending[1]) % 256
        else:
            self._refusals += 1
