"""The serial line to a running firmware, byte for byte, without a master's runtime."""

from __future__ import annotations

import time
from collections import deque
from typing import TypeVar

from qlinkgen.codecs import qlink
from qlinkgen.transport import Port
from tests.firmware.diagnostics import MARK, Diagnostics, Op
from tests.firmware.firmware import HANGS

M = TypeVar("M", bound=qlink.Message)
#: Seconds of silence after which the tests check whether an answer will follow.
SILENCE = 0.03
#: Seconds between requests to a firmware that does not answer yet.
UP = 0.1


class Garbage(AssertionError):
    """The firmware has sent bytes that are not an exact answer of the protocol."""


class Answers:
    """Splits the bytes of a node into answers, and accepts only whole ones."""

    def __init__(self) -> None:
        self._decoder = qlink.StreamDecoder("response")
        self._frames: deque[bytes] = deque()
        self._raw = b""

    def feed(self, data: bytes) -> list[bytes]:
        """Return the frames complete by now.

        Raises:
            Garbage: a byte outside an answer, or a missing byte.
        """
        self._raw += data
        for event in self._decoder.feed(data):
            if isinstance(event, qlink.Fault):
                raise Garbage(f"{self._raw.hex(' ')} was sent: {event}")
            self._frames.append(event.to_frame())
        whole = []
        # An answer is decoded at its checksum; wait for the byte inserted after one that ends in A5.
        while self._frames and len(self._frames[0]) <= len(self._raw):
            frame = self._frames.popleft()
            if not self._raw.startswith(frame):
                raise Garbage(f"{self._raw.hex(' ')} was sent; it contains the answer {frame.hex(' ')}")
            self._raw = self._raw[len(frame) :]
            whole.append(frame)
        return whole


class FirmwareLine:
    """Sends to a firmware, and returns its answers one by one.

    Attributes:
        port: its port.
        broken: it has sent garbage or does not answer, and cannot be used any more.
        number: node number for diagnostics.
        diagnostics: reads its state, directly and without a bus.
    """

    def __init__(self, port: Port) -> None:
        self.number = 1
        self.diagnostics = Diagnostics(self._exchange)
        self.port = port
        self.broken = False
        self._answers = Answers()
        self._whole: deque[bytes] = deque()

    def write(self, data: bytes) -> None:
        """Send any bytes."""
        self.port.write(data)

    def next_answer(self, timeout: float) -> bytes | None:
        """Return the next answer received within `timeout` seconds, or None.

        Raises:
            Garbage: the bytes received are not an answer.
        """
        end = time.monotonic() + timeout
        while not self._whole:
            data = self.port.read(max(0.0, end - time.monotonic()))
            if not data:
                return None
            try:
                self._whole.extend(self._answers.feed(data))
            except Garbage:
                self.broken = True
                raise
        return self._whole.popleft()

    def wait_until_up(self) -> None:
        """Send requests until there is an answer: bytes are lost while the firmware still sets up its chip.

        Raises:
            Garbage: it does not answer.
        """
        end = time.monotonic() + HANGS
        ping = qlink.LoopBackRequest(node=self.number, data=b"up?").to_frame()
        self.write(ping)
        while self.next_answer(UP) is None:
            if time.monotonic() > end:
                self.broken = True
                raise Garbage(f"node {self.number} has not answered in {HANGS:.0f} s")
            self.write(ping)
        self.settled()  # the answers to the other requests

    def settled(self) -> list[bytes]:
        """Return the outstanding answers to all requests sent.

        Requests are handled in order: an answer not received before that to a diagnostic request will not
        follow, however slow this machine is.
        """
        late, _ = self._exchange_behind(MARK + bytes((Op.STATE,)))
        return late

    def _exchange(self, data: bytes) -> bytes:
        late, answer = self._exchange_behind(data)
        if late:
            self.broken = True
            raise Garbage(f"{[frame.hex(' ') for frame in late]} were sent without a request")
        return answer

    def _exchange_behind(self, data: bytes) -> tuple[list[bytes], bytes]:
        """Make a diagnostic request; return the other frames before its answer, and its answer."""
        came: list[bytes] = []
        self.write(qlink.MotorRequestRequest(node=self.number, motor_data=data).to_frame())
        self._collect(came, qlink.MotorRequestResponse)
        self.write(qlink.MotorResponsePollRequest(node=self.number).to_frame())
        told = self._collect(came, qlink.MotorResponsePollResponse)
        # The last two belong to this request; answers of the same kinds to an earlier one may have ended it
        # early.
        late = came[:-2]
        return late, bytes(told.motor_data)

    def _collect(self, came: list[bytes], wanted: type[M]) -> M:
        while (frame := self.next_answer(HANGS)) is not None:
            came.append(frame)
            message = qlink.decode_response(frame)
            if isinstance(message, wanted):
                return message
        self.broken = True
        raise Garbage(f"node {self.number} did not answer a diagnostic request in {HANGS:.0f} s")
