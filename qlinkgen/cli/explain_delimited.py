"""Explains frames that are delimited by preamble, length or size."""

from __future__ import annotations

from collections.abc import Sequence

from qlinkgen.cli import describe
from qlinkgen.cli.anatomy import Anatomy, Byte, PayloadReader, at, counted, nearest_id, raw_of, unpack
from qlinkgen.cli.crc_search import coverages, explain_mismatch
from qlinkgen.cli.unstuffing import Unstuffer
from qlinkgen.model.frame import Checksum, DelimitedFrame, Part
from qlinkgen.model.message import Direction, Message
from qlinkgen.model.protocol import Protocol


def explain_delimited(protocol: Protocol, data: bytes, direction: Direction | None) -> Anatomy:
    """Put every byte of one frame to its part, and say what is wrong."""
    frame = protocol.frame
    assert isinstance(frame, DelimitedFrame)
    return _Reader(protocol, frame, direction).read(data)


class _Reader:
    def __init__(self, protocol: Protocol, frame: DelimitedFrame, direction: Direction | None) -> None:
        self._protocol, self._frame, self._direction = protocol, frame, direction
        self._anatomy = Anatomy()
        self._parts: dict[str, Sequence[Byte]] = {}
        self._wire: dict[str, bytes] = {}
        #: No preamble was found: what is taken for the length may be anything.
        self._astray = False

    def read(self, data: bytes) -> Anatomy:
        body = self._preamble(data)
        unstuffer = Unstuffer(self._frame, self._anatomy, body)
        self._divide(unstuffer)
        self._length(unstuffer)
        message = self._message()
        self._payload(message)
        self._addressed(message)
        self._checksum(sure=not unstuffer.faulty)
        unstuffer.finish()
        self._title(message)
        return self._anatomy

    def _preamble(self, data: bytes) -> list[Byte]:
        """What follows the preamble; the bytes before it are noise."""
        preamble, anatomy = self._frame.preamble, self._anatomy
        if not preamble:
            return at(data)
        self._wire[self._frame.parts[0].name] = preamble  # also where it was lost: a checksum may cover it
        start = data.find(preamble)
        if start < 0:
            self._astray = True
            anatomy.wrong(
                f"there is no preamble {preamble.hex(' ')}",
                "the capture began late, or a byte of the preamble was lost",
            )
            lost = 1 if data[:1] == preamble[-1:] else 0
            anatomy.row(at(data[:lost]), self._frame.parts[0].name, "rest of the preamble", wrong=True)
            return at(data[lost:], lost)
        if self._frame.unique_preamble:
            while data[start + 1 : start + 1 + len(preamble)] == preamble:
                start += 1
        anatomy.row(at(data[:start]), "(noise)", "before the preamble")
        anatomy.row(at(preamble, start), self._frame.parts[0].name, "preamble")
        return at(data[start + len(preamble) :], start + len(preamble))

    def _divide(self, unstuffer: Unstuffer) -> None:
        """Take the parts one by one; the payload's size follows from the length, or from what is left."""
        for part in self._frame.parts[1 if self._frame.preamble else 0 :]:
            size = self._payload_size(unstuffer) if part.role == "payload" else part.size
            self._parts[part.name], self._wire[part.name] = unstuffer.take(part, size)
            self._part_row(part)

    def _payload_size(self, unstuffer: Unstuffer) -> int:
        behind = sum(part.size for part in self._frame.parts) - self._frame.header_size
        length = self._value("length")
        if length is None:
            return max(0, unstuffer.left() - behind)
        return max(0, length - self._frame.length_bias)

    def _value(self, role: str) -> int | None:
        """The integer of a part, None if it is not in the frame or not whole."""
        for part in self._frame.parts:
            if part.role == role and part.scalar is not None:
                data = raw_of(self._parts.get(part.name, ()))
                return unpack(part.scalar, data) if len(data) == part.size else None
        return None

    def _part_row(self, part: Part) -> None:
        data = self._parts[part.name]
        if part.role in ("payload", "checksum"):
            return
        short = len(data) < part.size
        if part.role == "constant":
            fine = raw_of(data) == part.constant
            self._anatomy.row(
                data, part.name, "" if fine else f"must be {part.constant.hex(' ')}", wrong=not fine
            )
            if not fine:
                self._anatomy.wrong(
                    f"{part.name} is {raw_of(data).hex(' ') or 'not there'}, not {part.constant.hex(' ')}"
                )
            return
        assert part.scalar is not None
        value = "" if short else self._part_text(part, unpack(part.scalar, raw_of(data)))
        self._anatomy.row(data, part.name, value, wrong=short)

    def _part_text(self, part: Part, value: int) -> str:
        if part.role != "message":
            return str(value)
        names = dict.fromkeys(message.command for message in self._protocol.messages if message.id == value)
        return f"0x{value:02X} ({', '.join(names) or 'unknown'})"

    def _length(self, unstuffer: Unstuffer) -> None:
        part, length = self._frame.part("length"), self._value("length")
        missing = unstuffer.missing
        if self._astray:
            return
        if part is None or length is None:
            if missing:
                self._anatomy.wrong(
                    f"the frame ends {counted(missing)} too early", "the capture was cut, or bytes were lost"
                )
            return
        bias, payload = self._frame.length_bias, self._frame.payload
        low, high = bias + payload.min_size, bias + payload.max_size
        stuffing = self._frame.stuffing
        if stuffing and stuffing.before_checksum:
            high += payload.max_size // len(stuffing.after)
        if not low <= length <= high:
            cause = "a bit of it was flipped, or what was taken for a preamble was none"
            self._anatomy.wrong(f"{part.name} is {length}, allowed are {low}..{high}", cause)
        elif missing:
            cause = "the capture was cut, bytes were lost, or the length is wrong"
            self._anatomy.wrong(
                f"{part.name} {length} announces {counted(missing)} more than there are", cause
            )

    def _message(self) -> Message | None:
        """The message that fits best; the direction follows from the payload's size where it can."""
        wanted = self._value("message")
        if wanted is None:
            return None
        size = len(self._parts[self._frame.payload.name])
        ways: Sequence[Direction] = [self._direction] if self._direction else self._protocol.directions
        found = [
            m
            for m in self._protocol.messages
            if m.id == wanted and (m.direction in ways or m.direction == "message")
        ]
        if not found:
            self._unknown(wanted, ways)
            return None
        fitting = [message for message in found if _fits(message, size)]
        if len(fitting) > 1:
            other = fitting[1].direction
            self._anatomy.notes.append(
                f"it could be {fitting[1].name} as well; --direction {other} shows that"
            )
        return (fitting or found)[0]

    def _unknown(self, wanted: int, ways: Sequence[Direction]) -> None:
        known = [message for message in self._protocol.messages if message.direction in (*ways, "message")]
        near = nearest_id(wanted, known)
        name = self._frame.part("message")
        label = name.name if name else "message id"
        cause = f"the nearest known is {near.name}, 0x{near.id:02X}" if near else ""
        self._anatomy.wrong(f"{label} 0x{wanted:02X} is unknown", cause)

    def _payload(self, message: Message | None) -> None:
        part = self._frame.payload
        data = self._parts[part.name]
        if message is None:
            self._anatomy.row(data, part.name, "payload of an unknown message")
            return
        PayloadReader(self._anatomy, message).read(data)
        if not _fits(message, len(data)):
            sizes = describe.span_text(message.min_size, message.max_size)
            length = self._value("length")
            cause = "bytes were lost or added, or the other side has another revision of the protocol"
            if length is not None and message.fixed:
                right = message.max_size + self._frame.length_bias
                cause = f"{message.name} has length {right}, this is {length}; {cause}"
            self._anatomy.wrong(f"payload of {counted(len(data))}; {message.name} has {sizes}", cause)

    def _addressed(self, message: Message | None) -> None:
        address = self._value("address")
        if message is None or address is None:
            return
        if not any(first <= address <= last for first, last in message.addresses):
            allowed = describe.addresses_text(message)
            cause = "the sender is set to a wrong address, or the message cannot be addressed so"
            self._anatomy.wrong(
                f"{self._protocol.address_name} is {address}; {message.name} has {allowed}", cause
            )

    def _checksum(self, *, sure: bool) -> None:
        part = self._frame.part("checksum")
        if part is None or part.checksum is None:
            return
        checksum, data = part.checksum, self._parts[part.name]
        if len(data) < part.size:
            self._anatomy.row(data, part.name, "cut off", wrong=True)
            return
        received = sum(
            (byte.value & c.mask) << c.shift for byte, c in zip(data, checksum.chunks, strict=True)
        )
        expected = checksum.algorithm.compute(self._own(checksum)) & checksum.mask
        width = (checksum.algorithm.width + 3) // 4
        if received == expected:
            self._anatomy.row(data, part.name, f"0x{received:0{width}X}, right")
            return
        if not sure:
            self._anatomy.row(data, part.name, f"0x{received:0{width}X}, not checked")
            return
        self._anatomy.row(
            data, part.name, f"0x{received:0{width}X}, computed 0x{expected:0{width}X}", wrong=True
        )
        rule = f"{part.name} is 0x{received:0{width}X}, but {describe.checksum_text(checksum)} gives"
        self._anatomy.wrong(f"{rule} 0x{expected:0{width}X}", self._mismatch(part, checksum, received))

    def _own(self, checksum: Checksum) -> bytes:
        """The bytes that the schema says are covered, in the form that it says."""
        stuffed = self._frame.stuffing is not None and self._frame.stuffing.before_checksum
        return b"".join(self._wire[name] if stuffed else self._bare(name) for name in checksum.over)

    def _mismatch(self, part: Part, checksum: Checksum, received: int) -> str:
        """The likely cause of a check value that does not fit."""
        bare = {each.name: self._bare(each.name) for each in self._others(part)}
        wire = {name: self._wire[name] for name in bare}
        stuffed = self._frame.stuffing is not None and self._frame.stuffing.before_checksum
        first, second = (wire, bare) if stuffed else (bare, wire)
        covered = [byte for name in checksum.over for byte in self._covered(name)]
        return explain_mismatch(checksum, received, coverages(first, checksum.over, second), covered)

    def _bare(self, name: str) -> bytes:
        return bytes(value for _, value in self._covered(name))

    def _covered(self, name: str) -> list[tuple[int, int]]:
        if self._frame.preamble and name == self._frame.parts[0].name:
            return [(index, value) for index, value in enumerate(self._frame.preamble)]
        return [(byte.offset, byte.value) for byte in self._parts[name]]

    def _others(self, checksum: Part) -> list[Part]:
        return [part for part in self._frame.parts if part.name in self._wire and part is not checksum]

    def _title(self, message: Message | None) -> None:
        address = self._value("address")
        where = "" if address is None else f", {self._protocol.address_name} {address}"
        self._anatomy.title = f"{message.name if message else 'unknown message'}{where}"


def _fits(message: Message, size: int) -> bool:
    return message.min_size <= size <= message.max_size or (size == 0 and message.empty_is_default)
