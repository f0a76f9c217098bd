"""The serial line to a running firmware, byte for byte, without a master's runtime between."""

from __future__ import annotations

import time
from collections import deque
from typing import TypeVar

from qlinkgen.codecs import qlink
from qlinkgen.transport import Port
from tests.firmware.diagnostics import MARK, Diagnostics, Op
from tests.firmware.firmware import HANGS

M = TypeVar("M", bound=qlink.Message)
#: Seconds of silence after which it is worth asking whether an answer will come at all.
SILENCE = 0.03
#: Seconds until a firmware that does not answer yet is asked again.
UP = 0.1


class Garbage(AssertionError):
    """The firmware has sent something that is no answer of the protocol, byte for byte."""


class Answers:
    """Cuts what a node sends into answers, and takes nothing but whole ones."""

    def __init__(self) -> None:
        self._decoder = qlink.StreamDecoder("response")
        self._frames: deque[bytes] = deque()
        self._raw = b""

    def feed(self, data: bytes) -> list[bytes]:
        """Return the frames that are complete now.

        Raises:
            Garbage: a byte that belongs to no answer, or one that is missing.
        """
        self._raw += data
        for event in self._decoder.feed(data):
            if isinstance(event, qlink.Fault):
                raise Garbage(f"{self._raw.hex(' ')} was sent: {event}")
            self._frames.append(event.to_frame())
        whole = []
        # An answer is told with its checksum; the byte inserted behind one that ends in A5 is waited for.
        while self._frames and len(self._frames[0]) <= len(self._raw):
            frame = self._frames.popleft()
            if not self._raw.startswith(frame):
                raise Garbage(f"{self._raw.hex(' ')} was sent; the answer in it is {frame.hex(' ')}")
            self._raw = self._raw[len(frame) :]
            whole.append(frame)
        return whole


class FirmwareLine:
    """Sends to a firmware, and gives its answers one by one.

    Attributes:
        port: where it is.
        broken: it has sent garbage or does not answer: it is of no more use.
        number: node number under which it is asked for diagnostics.
        diagnostics: looks inside, at once and past any bus.
    """

    def __init__(self, port: Port) -> None:
        self.number = 1
        self.diagnostics = Diagnostics(self._exchange)
        self.port = port
        self.broken = False
        self._answers = Answers()
        self._whole: deque[bytes] = deque()

    def write(self, data: bytes) -> None:
        """Send, whatever it is."""
        self.port.write(data)

    def next_answer(self, timeout: float) -> bytes | None:
        """Return the next answer that has come or comes within `timeout` seconds, None where none does.

        Raises:
            Garbage: what has come is no answer.
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
        """Ask until there is an answer: what comes while the firmware still sets up its chip is lost.

        Raises:
            Garbage: it never comes up.
        """
        end = time.monotonic() + HANGS
        ping = qlink.LoopBackRequest(node=self.number, data=b"up?").to_frame()
        self.write(ping)
        while self.next_answer(UP) is None:
            if time.monotonic() > end:
                self.broken = True
                raise Garbage(f"node {self.number} has not come up in {HANGS:.0f} s")
            self.write(ping)
        self.settled()  # the answers to the others

    def settled(self) -> list[bytes]:
        """Return the answers that were still to come for all that was sent.

        Requests are handled in their order: what has not come before the answer to a diagnostic request will
        never come, however slow this machine is.
        """
        late, _ = self._exchange_behind(MARK + bytes((Op.STATE,)))
        return late

    def _exchange(self, data: bytes) -> bytes:
        late, answer = self._exchange_behind(data)
        if late:
            self.broken = True
            raise Garbage(f"{[frame.hex(' ') for frame in late]} were sent, and nobody had asked")
        return answer

    def _exchange_behind(self, data: bytes) -> tuple[list[bytes], bytes]:
        """Make a diagnostic request; return what else came before its answer, and its answer."""
        came: list[bytes] = []
        self.write(qlink.MotorRequestRequest(node=self.number, motor_data=data).to_frame())
        self._collect(came, qlink.MotorRequestResponse)
        self.write(qlink.MotorResponsePollRequest(node=self.number).to_frame())
        told = self._collect(came, qlink.MotorResponsePollResponse)
        # The last two belong to this; a request of the same kinds just before may have let this run ahead.
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
