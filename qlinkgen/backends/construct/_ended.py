"""Frames that a terminator or a silence ends, and codings that keep a terminator from occurring before.

Codings apply one after the other to the bytes of the parts ``over``; decoding goes the other way.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from typing import NamedTuple

from construct import Container

from ._fields import Message
from ._frames import (
    Address,
    Constant,
    DelimitedFrame,
    Frame,
    FrameError,
    Id,
    Length,
    Part,
    Payload,
    Sending,
    Stuffing,
    _allowed,
    _size,
    _Wire,
)


class Escape(NamedTuple):
    """A byte that must not occur is sent as ``escape`` and a second byte.

    With ``mask``, the second byte is any byte XOR mask.
    """

    escape: int
    codes: Sequence[tuple[int, int]]
    mask: int = 0

    def add(self, data: bytes) -> bytes:
        """The coded bytes."""
        codes = {byte: bytes([self.escape, second]) for byte, second in self.codes}
        return b"".join(codes.get(byte, bytes([byte])) for byte in data)

    def size(self, byte: int) -> int:
        """Number of coded bytes, of which this is the first."""
        return 1 + (byte == self.escape)

    def remove(self, data: bytes) -> bytes:
        """The decoded bytes."""
        head, *rest = data.split(bytes([self.escape]))
        plain = {second: byte for byte, second in self.codes}
        for run in rest:
            second = run[0] if run else self.escape
            if not run or (not self.mask and second not in plain):
                raise FrameError("stuffing", f"wrong byte after {self.escape:02x}")
            head += (
                bytes([second ^ self.mask if self.mask else plain[second]]) + run[1:]
            )
        return head


class Cobs(NamedTuple):
    """Consistent overhead byte stuffing."""

    def add(self, data: bytes) -> bytes:
        """The coded bytes."""
        coded, runs = b"", data.split(b"\0")
        for index, run in enumerate(runs):
            blocks = [run[at : at + 254] for at in range(0, len(run), 254)] or [b""]
            if len(blocks[-1]) == 254 and index < len(runs) - 1:
                blocks.append(b"")  # a full block does not imply a zero
            coded += b"".join(bytes([len(block) + 1]) + block for block in blocks)
        return coded

    def remove(self, data: bytes) -> bytes:
        """The decoded bytes."""
        plain, at = b"", 0
        while at < len(data):
            size = data[at]
            run = data[at + 1 : at + size]
            if size == 0 or len(run) != size - 1 or 0 in run:
                raise FrameError("stuffing", f"wrong code at {at}")
            at += size
            plain += run + (b"\0" if size < 255 and at < len(data) else b"")
        return plain


class Digits(NamedTuple):
    """Each byte is two hexadecimal digits."""

    def add(self, data: bytes) -> bytes:
        """The coded bytes."""
        return data.hex().upper().encode()

    def size(self, byte: int) -> int:
        """Number of coded bytes, of which this is the first."""
        return 2 if byte in b"0123456789ABCDEFabcdef" else 1

    def remove(self, data: bytes) -> bytes:
        """The decoded bytes."""
        if len(data) % 2 or not all(byte in b"0123456789ABCDEFabcdef" for byte in data):
            raise FrameError("stuffing", f"{data!r} are not pairs of digits")
        return bytes.fromhex(data.decode())


class Pair(NamedTuple):
    """Each byte is followed by its complement."""

    def add(self, data: bytes) -> bytes:
        """The coded bytes."""
        return bytes(each for byte in data for each in (byte, byte ^ 0xFF))

    def size(self, byte: int) -> int:
        """Number of coded bytes, of which this is the first."""
        del byte
        return 2

    def remove(self, data: bytes) -> bytes:
        """The decoded bytes."""
        if self.add(data[::2]) != data:
            raise FrameError("stuffing", "a byte is not followed by its complement")
        return data[::2]


class Add(NamedTuple):
    """A number is added to each byte.

    As a stuffing it applies to the payload alone, before length and check value are computed.
    """

    number: int
    over: Sequence[str] = ()

    def add(self, data: bytes) -> bytes:
        """The coded bytes."""
        return bytes((byte + self.number) % 256 for byte in data)

    def size(self, byte: int) -> int:
        """Number of coded bytes, of which this is the first."""
        del byte
        return 1

    def remove(self, data: bytes) -> bytes:
        """The decoded bytes."""
        return bytes((byte - self.number) % 256 for byte in data)


Coding = Escape | Stuffing | Cobs | Digits | Pair | Add
#: Codings of each byte on its own.
Bytewise = Escape | Digits | Pair | Add


class _Region(NamedTuple):
    """The parts of a frame that are coded: all but its first ``front`` and last ``back`` bytes."""

    front: int
    back: int

    @classmethod
    def of(cls, parts: Sequence[Part], over: Sequence[str]) -> _Region:
        """The region of the parts ``over``."""
        names = [part.name for part in parts]
        sizes = [_size(part) for part in parts]
        first, last = names.index(over[0]), names.index(over[-1])
        return cls(sum(sizes[:first]), sum(sizes[last + 1 :]))

    def coded(self, plain: bytes, codings: Iterable[Coding]) -> bytes:
        """A frame as sent."""
        end = len(plain) - self.back
        inner = plain[self.front : end]
        for coding in codings:
            inner = coding.add(inner)
        return plain[: self.front] + inner + plain[end:]


class EndedFrame(Frame):
    """A frame that its part ``end`` ends, which does not occur before; it has at most ``most`` bytes.

    Without ``end``, a silence ends it: all bytes are one frame.

    Its payload has at least ``least`` bytes. With ``paired``, the first byte of the end also begins pairs.

    With ``bare`` it does not begin with a constant, so an unknown id or an illegal address is detected first.
    """

    def __init__(
        self,
        parts: Sequence[Part],
        messages: Iterable[Message],
        *,
        end: str = "",
        most: int,
        over: Sequence[str],
        least: int = 0,
        coding: Sequence[Coding] = (),
        address: str = "",
        bare: bool = False,
        paired: bool = False,
    ) -> None:
        super().__init__(parts, messages, address=address, bare=bare)
        names = [part.name for part in parts]
        sizes = [_size(part) for part in parts]
        self.end = parts[names.index(end)] if end else None
        self.most = most
        self.paired = paired
        self.least = least
        self.coding = coding
        self.region = _Region.of(parts, over)
        self.closing = sum(sizes[names.index(end) :]) if end else 0
        self.sizes = dict(zip(names, sizes, strict=True))

    def _wrap(self, sending: Sending) -> bytes:
        return self.region.coded(super()._wrap(sending), self.coding)

    def _frame(self, wire: bytes, request: bytes) -> Container:
        del request
        end = self._end(wire)
        cells = self._cells(wire[:end])
        payload = cells[self.payload.name]
        numbers: dict[type, int] = {}
        found: dict[str, bytes] = {}
        self._identify(found, numbers)
        for part in self.parts:
            cell = found[part.name] = cells[part.name]
            self._refuse(part, found)
            if (
                isinstance(part, Length)
                and part.integer.parse(cell) * part.scale != len(payload) + part.bias
            ):
                raise FrameError(
                    "length", f"{part.name} does not count {len(payload)} bytes"
                )
            known = len(numbers)
            self._identify(found, numbers)
            if len(numbers) > known and self.payload.name not in found:
                self._check_begin(numbers)
        if len(wire) != end:
            raise FrameError("length", f"{len(wire) - end} bytes follow the frame")
        return self._judged(cells, numbers[Id], payload, numbers.get(Address, 0))

    def _check_begin(self, numbers: Mapping[type, int]) -> None:
        if self.bare and not self.texts and Id in numbers:
            message = self._known(numbers[Id])
            if Address in numbers and not _allowed(message, numbers[Address]):
                raise FrameError(
                    "range", f"{message.name} cannot have address {numbers[Address]}"
                )

    def _end(self, wire: bytes) -> int:
        """Offset of the end of the frame."""
        first, last = self.parts[0], self.end
        lead = first.data if isinstance(first, Constant) else b""
        if last is None:
            return self._silent(wire, lead)
        assert isinstance(last, Constant)
        if not lead.startswith(wire[: len(lead)]):
            raise FrameError("frame", f"the frame does not begin with {lead.hex()}")
        limit = self.most - self.closing + len(last.data)
        stop = self._stop(wire, len(lead), limit, last.data)
        if stop == len(lead) or (stop < 0 and len(wire) >= limit):
            raise FrameError("length", f"{last.name} is not after 1 to {limit} bytes")
        if stop < 0 or len(wire) < stop + self.closing:
            raise FrameError("truncated", f"incomplete frame of {len(wire)} bytes")
        return stop + self.closing

    def _silent(self, wire: bytes, lead: bytes) -> int:
        """The end of the bytes between two silences."""
        if not wire:
            raise FrameError("truncated", "no bytes")
        if not lead.startswith(wire[: len(lead)]):
            raise FrameError("frame", f"the frame does not begin with {lead.hex()}")
        if not len(lead) <= len(wire) <= self.most:
            raise FrameError("length", f"frame of {len(wire)} bytes")
        return len(wire)

    def _stop(self, wire: bytes, at: int, limit: int, end: bytes) -> int:
        """Offset of the terminator, -1 if there is none."""
        while at + len(end) <= min(limit, len(wire)):
            if wire[at : at + len(end)] == end:
                return at
            at += 2 if self.paired and wire[at] == end[0] else 1
        return -1

    def _cells(self, wire: bytes) -> dict[str, bytes]:
        """The decoded bytes of each part."""
        front, end = self.region.front, len(wire) - self.region.back
        plain = wire
        if front < end:
            inner = wire[front:end]
            for coding in reversed(self.coding):
                inner = coding.remove(inner)
            plain = wire[:front] + inner + wire[end:]
        size = len(plain) - sum(self.sizes.values())
        if not self.least <= size <= self.payload.most:
            text = (
                f"payload of {size} bytes, expected {self.least} to {self.payload.most}"
            )
            raise FrameError("length", text)
        cells, at = {}, 0
        for part in self.parts:
            stop = at + (size if isinstance(part, Payload) else self.sizes[part.name])
            cells[part.name], at = plain[at:stop], stop
        return cells


class _CodedWire(_Wire):
    """Decodes the bytes of the parts ``over`` as it reads them."""

    def __init__(self, data: bytes, coding: Bytewise, over: Sequence[str]) -> None:
        super().__init__(data, None, hunt=False)
        self.coding = coding
        self.over = over

    def take(self, part: Part, size: int) -> bytes:
        """See _Wire."""
        if part.name not in self.over:
            return super().take(part, size)
        return b"".join(self._decoded() for _ in range(size))

    def _decoded(self) -> bytes:
        first = self._byte()
        more = range(1, self.coding.size(first[0]))
        return self.coding.remove(first + b"".join(self._byte() for _ in more))


class CodedFrame(DelimitedFrame):
    """A delimited frame whose parts ``over`` are sent in a ``coding``."""

    def __init__(
        self,
        parts: Sequence[Part],
        messages: Iterable[Message],
        *,
        coding: Bytewise,
        over: Sequence[str],
        address: str = "",
        bare: bool = False,
    ) -> None:
        super().__init__(parts, messages, address=address, bare=bare)
        self.coding = coding
        self.over = over
        self.region = _Region.of(parts, over)

    def _wire(self, data: bytes) -> _Wire:
        return _CodedWire(data, self.coding, self.over)

    def _wrap(self, sending: Sending) -> bytes:
        return self.region.coded(super()._wrap(sending), [self.coding])
