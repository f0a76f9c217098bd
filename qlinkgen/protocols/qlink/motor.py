"""Requests to the motor of a virtual node, in the motor's own protocol (sections 7.8 and 7.9)."""

from __future__ import annotations

from collections.abc import Callable

from qlinkgen.codecs import qlink
from qlinkgen.protocols.qlink.arguments import positive

#: Data bytes of an answer, without the completion.
MOST_DATA = qlink.MotorResponsePollResponse.MAX_SIZE - 1


def echo(data: bytes) -> bytes:
    """Return the answer of a virtual motor: the request, truncated to the answer of a poll."""
    return data[:MOST_DATA]


class MotorRequests:
    """The pending request of the motor; a newer one replaces it.

    The function of the motor is called on the request; its answer is available after the configured time.
    """

    def __init__(self, motor: Callable[[bytes], bytes] = echo, seconds: float = 0.05) -> None:
        """Set the function and the time of the answers.

        Args:
            motor: returns the answer to a request, 0..25 bytes.
            seconds: time until a request is completed.

        Raises:
            ValueError: `seconds` is negative or not finite.
        """
        self._motor = motor
        self._seconds = positive("motor_seconds", seconds, "seconds")
        self._answer: tuple[float, int, bytes] | None = None

    def take(self, code: int, data: bytes, now: float) -> bool:
        """Pass a request to the motor. Return whether it replaced an uncompleted one.

        Args:
            code: command number for the completion.
            data: data of the request.
            now: time in seconds.

        Raises:
            ValueError: the motor's function returned more than 25 bytes.
        """
        answer = bytes(self._motor(data))
        if len(answer) > MOST_DATA:
            raise ValueError(f"the motor's function returned {len(answer)} bytes; at most {MOST_DATA} fit")
        replaced = self._answer is not None and now < self._answer[0]
        self._answer = (now + self._seconds, code, answer)
        return replaced

    def poll(self, now: float) -> tuple[int, bytes]:
        """Return command number and answer of the completed request; 0 and b"" without one."""
        if self._answer is None or now < self._answer[0]:
            return 0, b""
        return self._answer[1:]

    def forget(self) -> None:
        """Drop the request and its answer."""
        self._answer = None
