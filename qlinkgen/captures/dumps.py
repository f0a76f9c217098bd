"""Dumps of files with addresses: of xxd, ``hexdump``, ``hexdump -C`` and ``od -t x1``."""

from __future__ import annotations

import re
from collections.abc import Iterator
from typing import BinaryIO, NamedTuple

from qlinkgen.captures.lines import lines
from qlinkgen.captures.records import Problems, Record

#: xxd: address, colon, groups of digits, two spaces and the characters.
_XXD = re.compile(r"([0-9a-f]{4,16}):\s+((?:[0-9a-f]{2,32} ?)+?)(?:\s+\s.*)?\s*$", re.IGNORECASE)
#: hexdump -C and od -t x1z: bytes, and the characters between bars or angles.
_BYTES = re.compile(r"([0-9a-f]{6,16})((?:\s{1,2}[0-9a-f]{2}(?![0-9a-f]))+)\s*(?:\|.*|>.*)?$", re.IGNORECASE)
#: hexdump: words of 16 bits, of which the machine of today stores the low byte first.
_WORDS = re.compile(r"([0-9a-f]{7})((?:\s+[0-9a-f]{4}(?![0-9a-f]))+)\s*$", re.IGNORECASE)
#: The last line of hexdump and od is the address of the end.
_END = re.compile(r"([0-9a-f]{6,16})\s*$", re.IGNORECASE)
_AGAIN = "*"
#: Most bytes that a line of an asterisk may repeat.
_MOST_REPEATED = 1 << 28


class _Row(NamedTuple):
    address: str
    data: bytes
    #: Words of 16 bits, of which the last may be half.
    words: bool


def is_dump(text: str) -> bool:
    """Whether a line is one of a dump with an address."""
    return text == _AGAIN or _row(text) is not None


def read_dump(file: BinaryIO, problems: Problems) -> Iterator[Record]:
    """Return a record for each line; an asterisk repeats the line before it."""
    dump = _Dump(problems)
    for line in lines(file, problems):
        yield from dump.take(line.offset, line.text)
    yield from dump.rest()


class _Dump:
    """Joins lines by their addresses."""

    def __init__(self, problems: Problems) -> None:
        self._problems = problems
        self._base = 0  # of addresses: 16, 8 or 10; 0 is not known
        self._first: _Row | None = None  # with which the base is found
        self._next = 0  # the address that is expected
        self._last: Record | None = None  # the last line, held back because the end may cut it
        self._again = False

    def take(self, offset: int, text: str) -> Iterator[Record]:
        if text.strip() == _AGAIN:
            self._again = True
        elif row := _row(text):
            yield from self._joined(offset, row)
        elif end := _END.match(text):
            yield from self._ended(end[1])
        elif text.strip():
            self._problems.add(offset, f"'{_cut(text)}' is not a line of a dump; it is passed over")

    def rest(self) -> Iterator[Record]:
        if self._last is not None:
            yield self._last
            self._last = None

    def _joined(self, offset: int, row: _Row) -> Iterator[Record]:
        if self._last is None:
            self._first = row
        else:
            self._find_base(row.address)
        if self._last is not None:
            at = self._number(row.address)
            if self._again:
                yield from self._repeated(at)
            elif at != self._next:
                self._problems.add(
                    offset, f"address {row.address} follows {self._next} bytes; bytes are missing or doubled"
                )
            yield from self.rest()
            self._next = at + len(row.data)
        self._again = False
        self._last = Record(row.data, offset)

    def _repeated(self, end: int) -> Iterator[Record]:
        assert self._last is not None
        size = len(self._last.data)
        missing = end - self._next
        if not size or not 0 < missing <= _MOST_REPEATED:
            self._problems.add(self._last.offset, "a line * does not fill a whole number of lines")
            return
        for _ in range(missing // size):
            yield self._last
        self._next = end

    def _ended(self, address: str) -> Iterator[Record]:
        """Take the address of the end: half a word of the last line may be filled up."""
        if self._last is None:
            return
        self._find_base(address)
        end = self._number(address)
        if self._again:
            yield from self._repeated(end)
            self._again = False
        elif end == self._next - 1:
            self._last = self._last._replace(data=self._last.data[:-1])
        elif end != self._next:
            self._problems.add(self._last.offset, f"the end has address {address} after {self._next} bytes")
        yield from self.rest()

    def _find_base(self, after: str) -> None:
        """Find the base of addresses by that of the second line."""
        if not self._base and self._first is not None:
            self._base = _usual(self._first) if self._again else _base(self._first, after)
            self._next = self._number(self._first.address) + len(self._first.data)

    def _number(self, address: str) -> int:
        try:
            return int(address, self._base)
        except ValueError:  # a digit that the base does not have
            return int(address, 16)


def _row(text: str) -> _Row | None:
    text = text.rstrip()
    if found := _XXD.match(text):
        digits = found[2].replace(" ", "")
        return _Row(found[1], bytes.fromhex(digits), words=False) if len(digits) % 2 == 0 else None
    if found := _WORDS.match(text):
        words = bytes.fromhex("".join(found[2].split()))
        swapped = bytes(each for at in range(0, len(words), 2) for each in (words[at + 1], words[at]))
        return _Row(found[1], swapped, words=True)
    if found := _BYTES.match(text):
        return _Row(found[1], bytes.fromhex("".join(found[2].split())), words=False)
    return None


def _usual(row: _Row) -> int:
    """Return the base of addresses with so many digits: od writes seven, and those are octal."""
    return 8 if len(row.address) == 7 and not row.words else 16


def _base(first: _Row, after: str) -> int:
    """Return the base in which the address after a line is the next one; 16 if none fits."""
    for base in (16, 8, 10):
        try:
            apart = int(after, base) - int(first.address, base)
        except ValueError:
            continue
        if apart in (len(first.data), len(first.data) - first.words):
            return base
    return _usual(first)


def _cut(text: str) -> str:
    return text if len(text) <= 40 else f"{text[:36]}..."
