"""Explains packets: a request, and the response if its bytes follow."""

from __future__ import annotations

from collections.abc import Mapping

from qlinkgen.cli.anatomy import Anatomy, Byte, PayloadReader, at, counted, nearest_id, raw_of
from qlinkgen.cli.conversations import are_requests
from qlinkgen.model.frame import PacketFrame
from qlinkgen.model.message import Message
from qlinkgen.model.protocol import Protocol


def explain_packet(protocol: Protocol, data: bytes, request: bytes | None) -> Anatomy:
    """Put every byte to its part; with ``request`` the data is its response alone."""
    frame = protocol.frame
    assert isinstance(frame, PacketFrame)
    reader = _Reader(protocol, frame)
    if request is None:
        return reader.exchange(at(data))
    return reader.answer_to(request, at(data))


_ASK = "give the request with --request then"


class _Reader:
    def __init__(self, protocol: Protocol, frame: PacketFrame) -> None:
        self._protocol, self._frame = protocol, frame
        self._anatomy = Anatomy()
        self._by_id: Mapping[int, Message] = {message.id: message for message in protocol.received("request")}

    def exchange(self, data: list[Byte]) -> Anatomy:
        """A request and what follows it."""
        message = self._request(data)
        if message is None:
            return self._anatomy
        rest = data[1 + message.max_size :]
        if rest:
            self._response(message, raw_of(data[: 1 + message.max_size]), rest, alone=False)
        return self._anatomy

    def answer_to(self, request: bytes, data: list[Byte]) -> Anatomy:
        """The bytes that came back."""
        message = self._by_id.get(request[0]) if request else None
        if message is None or len(request) != 1 + message.max_size:
            self._anatomy.title = "response to an unknown request"
            self._anatomy.wrong(
                f"--request {request.hex()} is no request", "give command byte and words of one packet"
            )
            return self._anatomy
        self._anatomy.title = message.command
        self._response(message, request, data, alone=True)
        return self._anatomy

    def _request(self, data: list[Byte]) -> Message | None:
        name = self._frame.id_name
        message = self._by_id.get(data[0].value)
        if message is None:
            near = nearest_id(data[0].value, list(self._by_id.values()))
            self._anatomy.title = "unknown request"
            self._anatomy.row(data[:1], name, "unknown", wrong=True)
            self._anatomy.row(data[1:], "(behind it)", "cannot be told apart")
            cause = f"the nearest known is {near.command}, 0x{near.id:02X}" if near else ""
            self._anatomy.wrong(f"{name} 0x{data[0].value:02X} is unknown", cause)
            return None
        self._anatomy.title = message.command
        self._anatomy.row(data[:1], name, message.name)
        payload = data[1 : 1 + message.max_size]
        PayloadReader(self._anatomy, message).read(payload)
        if len(payload) < message.max_size:
            rule = f"{counted(len(payload))} behind {name}; {message.name} has {message.max_size}"
            self._anatomy.wrong(rule, "the capture was cut, or bytes were lost")
            return None
        return message

    def _response(self, asked: Message, request: bytes, data: list[Byte], *, alone: bool) -> None:
        command = self._protocol.command_of(asked)
        answer = command.response if command else None
        checksum = self._frame.checksum
        if answer is None or checksum is None:
            self._anatomy.row(data, "(next packet)", f"nothing answers {asked.command}")
            return
        if not alone and len(data) == answer.max_size and are_requests(self._protocol, raw_of(data)):
            self._anatomy.row(data, "(next packet)", "`qlinkgen decode` takes whole conversations")
            self._anatomy.notes.append(f"it may also be an answer without its check value: {_ASK}")
            return
        payload, behind = data[: answer.max_size], data[answer.max_size :]
        PayloadReader(self._anatomy, answer).read(payload)
        size = len(checksum.chunks)
        if len(payload) < answer.max_size:
            rule = f"{counted(len(data))} came back; {answer.name} has {answer.max_size}, and {size} of check"
            self._anatomy.wrong(rule, "the capture was cut, or bytes were lost")
        elif not behind:
            self._anatomy.notes.append("the check value was not read; reading it is optional")
        elif len(behind) < size:
            self._anatomy.row(behind, self._frame.checksum_name, "cut off", wrong=True)
            self._anatomy.wrong(
                f"{len(behind)} of {size} bytes of the check value are there", "the capture was cut"
            )
        else:
            self._check(request, raw_of(payload), behind[:size])
            self._anatomy.row(behind[size:], "(next packet)", "`qlinkgen decode` takes whole conversations")

    def _check(self, request: bytes, answer: bytes, data: list[Byte]) -> None:
        checksum = self._frame.checksum
        assert checksum is not None
        name, rejected = self._frame.checksum_name, self._frame.rejected
        received = sum(
            (byte.value & c.mask) << c.shift for byte, c in zip(data, checksum.chunks, strict=True)
        )
        expected = self._sum(request, answer)
        if received == expected:
            self._anatomy.row(data, name, f"0x{received:04X}, right")
            return
        self._anatomy.row(data, name, f"0x{received:04X}, computed 0x{expected:04X}", wrong=True)
        if received == rejected:
            cause = "the device does not know the command, or does not take it now"
            self._anatomy.wrong(f"{name} is {rejected}: the command was refused as illegal", cause)
            return
        rule = f"{name} is 0x{received:04X}, {self._frame.id_name} and all words add up to 0x{expected:04X}"
        self._anatomy.wrong(rule, self._cause(request, answer, received))

    def _sum(self, request: bytes, answer: bytes) -> int:
        checksum, size = self._frame.checksum, self._frame.word_size
        assert checksum is not None
        runs = (request[1:], answer)
        words = [run[start : start + size] for run in runs for start in range(0, len(run), size)]
        return (
            checksum.algorithm.compute([request[0], *(int.from_bytes(word, "big") for word in words)])
            & checksum.mask
        )

    def _cause(self, request: bytes, answer: bytes, received: int) -> str:
        """Other ways to sum that give the received value."""
        no_id = bytes(1) + request[1:]
        readings = {
            f"the sum of the words without {self._frame.id_name}": self._sum(no_id, answer),
            "the sum of the response's words alone": self._sum(bytes(1), answer),
            "the sum of the request alone": self._sum(request, b""),
            "the sum of single bytes": sum(request + answer) & 0xFFFF,
        }
        expected = self._sum(request, answer)
        swapped = int.from_bytes(received.to_bytes(2, "big"), "little") if received < 1 << 16 else received
        if swapped == expected:
            return "its bytes came the other way round"
        fitting = [text for text, value in readings.items() if value == received]
        if fitting:
            return f"it would fit as {fitting[0]}: the device may compute it so"
        if (received ^ expected).bit_count() == 1:
            return "one bit was flipped on the wire"
        return "bytes were corrupted or lost, or these bytes answer another request"
