"""Explains frames whose header and end are marked by a bit."""

from __future__ import annotations

from collections.abc import Sequence

from qlinkgen.cli import describe
from qlinkgen.cli.anatomy import Anatomy, Byte, PayloadReader, at, counted, nearest_id, raw_of
from qlinkgen.cli.crc_search import coverages, explain_mismatch
from qlinkgen.model.frame import MarkedFrame
from qlinkgen.model.message import Message
from qlinkgen.model.protocol import Protocol


def explain_marked(protocol: Protocol, data: bytes) -> Anatomy:
    """Put every byte of one frame to its part, and say what is wrong."""
    frame = protocol.frame
    assert isinstance(frame, MarkedFrame)
    return _Reader(protocol, frame).read(at(data))


class _Reader:
    def __init__(self, protocol: Protocol, frame: MarkedFrame) -> None:
        self._protocol, self._frame = protocol, frame
        self._anatomy = Anatomy()
        self._messages = {message.id: message for message in protocol.messages}

    def read(self, data: list[Byte]) -> Anatomy:
        start = next((index for index, byte in enumerate(data) if self._is_header(byte)), None)
        if start is None:
            self._no_header(data)
            return self._anatomy
        self._noise(data[:start])
        header, rest = data[start], data[start + 1 :]
        size = next((index for index, byte in enumerate(rest) if self._is_marked(byte)), len(rest))
        message = self._header(header)
        self._payload(message, header, rest[:size])
        self._end(header, rest[size:])
        where = f"{self._frame.address_name} {self._address(header)}"
        self._anatomy.title = f"{message.name if message else 'unknown message'}, {where}"
        return self._anatomy

    def _is_marked(self, byte: Byte) -> bool:
        return bool(byte.value & self._frame.marker)

    def _is_header(self, byte: Byte) -> bool:
        return self._is_marked(byte) and self._id(byte) != self._frame.end_id

    def _id(self, byte: Byte) -> int:
        return byte.value >> self._frame.id_bits.shift & self._frame.id_bits.mask

    def _address(self, byte: Byte) -> int:
        return byte.value >> self._frame.address_bits.shift & self._frame.address_bits.mask

    def _no_header(self, data: Sequence[Byte]) -> None:
        marker = self._frame.marker
        self._anatomy.title = "no frame"
        self._anatomy.row(data, "(noise)", "outside of any frame", wrong=True)
        rule = f"there is no header: no byte with 0x{marker:02X} set and {self._frame.id_name} other than "
        cause = "the capture began late, or the header was lost"
        self._anatomy.wrong(f"{rule}{self._frame.end_id}", cause)

    def _noise(self, data: Sequence[Byte]) -> None:
        self._anatomy.row(data, "(noise)", "before the header", wrong=True)
        if data:
            cause = "the header of the frame that they belong to was lost"
            self._anatomy.wrong(f"{counted(len(data))} before the header, outside of any frame", cause)

    def _header(self, byte: Byte) -> Message | None:
        address, number = self._address(byte), self._id(byte)
        message = self._messages.get(number)
        fine = address != 0 and message is not None
        names = self._frame.address_name, self._frame.id_name
        shown = f"{names[0]} {address}, {names[1]} {number}{f' ({message.name})' if message else ''}"
        self._anatomy.row([byte], "header", shown, wrong=not fine)
        if message is None:
            near = nearest_id(number, self._protocol.messages)
            cause = f"the nearest known is {near.name}, {near.id}" if near else ""
            self._anatomy.wrong(f"{names[1]} {number} is unknown", cause)
        elif not any(first <= address <= last for first, last in message.addresses):
            cause = "nobody has this address; a node that should have taken the frame has sent it on"
            allowed = describe.addresses_text(message)
            self._anatomy.wrong(f"{names[0]} is {address}; {message.name} has {allowed}", cause)
        return message

    def _payload(self, message: Message | None, header: Byte, data: list[Byte]) -> None:
        if message is None:
            self._anatomy.row(data, "payload", "payload of an unknown message")
            return
        checksum = self._frame.checksum if message.checksum else None
        behind = len(checksum.chunks) if checksum else 0
        size = len(data) - behind
        if not message.min_size <= size <= message.max_size:
            sizes = describe.span_text(message.min_size + behind, message.max_size + behind)
            what = f"{message.name} has {sizes}{' with its checksum' if behind else ''}"
            self._anatomy.wrong(
                f"{counted(len(data))} between header and end; {what}", "bytes were lost or added"
            )
            behind = 0 if size < message.min_size else behind
        payload = data[: len(data) - behind]
        PayloadReader(self._anatomy, message).read(payload)
        if checksum and behind:
            self._checksum(header, payload, data[len(payload) :])

    def _checksum(self, header: Byte, payload: list[Byte], data: list[Byte]) -> None:
        checksum = self._frame.checksum
        assert checksum is not None
        received = sum(
            (byte.value & c.mask) << c.shift for byte, c in zip(data, checksum.chunks, strict=True)
        )
        expected = checksum.algorithm.compute(raw_of(payload)) & checksum.mask
        if received == expected:
            self._anatomy.row(data, "checksum", f"0x{received:04X}, right (the bits that are sent)")
            return
        self._anatomy.row(data, "checksum", f"0x{received:04X}, computed 0x{expected:04X}", wrong=True)
        parts = {"header": raw_of([header]), "payload": raw_of(payload)}
        own = [(byte.offset, byte.value) for byte in payload]
        cause = explain_mismatch(checksum, received, coverages(parts, checksum.over, None), own)
        name = checksum.algorithm.name
        self._anatomy.wrong(
            f"checksum is 0x{received:04X}, but {name} over payload gives 0x{expected:04X}", cause
        )

    def _end(self, header: Byte, rest: Sequence[Byte]) -> None:
        if not rest:
            self._anatomy.wrong("there is no end byte", "the capture was cut, or bytes were lost")
            return
        end = rest[0]
        name, address = self._frame.address_name, self._address(end)
        if self._is_header(end):
            self._anatomy.row(rest, "(next frame)", "a header inside the frame", wrong=True)
            rule = f"a header stands at offset {end.offset}, before the end of the frame"
            self._anatomy.wrong(rule, "the end byte was lost, or two nodes sent at once")
            return
        wrong = address != self._address(header)
        self._anatomy.row([end], "end", f"{name} {address}", wrong=wrong)
        if wrong:
            cause = "a node counted down one of the two alone, or the end belongs to another frame"
            self._anatomy.wrong(f"the end has {name} {address}, the header {self._address(header)}", cause)
        if rest[1:]:
            self._anatomy.row(rest[1:], "(behind the frame)", "not part of it")
            self._anatomy.notes.append(
                f"{counted(len(rest) - 1)} behind the frame; `qlinkgen decode` takes whole streams"
            )
