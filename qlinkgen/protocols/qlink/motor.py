"""The motor's own protocol behind a virtual node: requests passed through (sections 7.8 and 7.9)."""

from __future__ import annotations

from collections.abc import Callable

from qlinkgen.codecs import qlink
from qlinkgen.protocols.qlink.arguments import positive

#: Bytes that fit into an answer beside the completion.
MOST_DATA = qlink.MotorResponsePollResponse.MAX_SIZE - 1


def echo(data: bytes) -> bytes:
    """Return what a virtual motor answers: the request, as far as it fits into a poll's answer."""
    return data[:MOST_DATA]


class MotorRequests:
    """One request at a time is with the motor; a newer one takes the place of the older.

    The function of the motor is called when the request comes; its answer shows when the time has passed.
    """

    def __init__(self, motor: Callable[[bytes], bytes] = echo, seconds: float = 0.05) -> None:
        """Set how the motor answers.

        Args:
            motor: gives the answer to a request, 0..25 bytes.
            seconds: time until a request is completed.

        Raises:
            ValueError: `seconds` is negative or not finite.
        """
        self._motor = motor
        self._seconds = positive("motor_seconds", seconds, "seconds")
        self._answer: tuple[float, int, bytes] | None = None

    def take(self, code: int, data: bytes, now: float) -> bool:
        """Pass a request on. Returns whether it took the place of one that was not completed.

        Args:
            code: command number that the completion will show.
            data: what the motor is asked.
            now: when, in seconds.

        Raises:
            ValueError: the motor's function gave more than 25 bytes.
        """
        answer = bytes(self._motor(data))
        if len(answer) > MOST_DATA:
            raise ValueError(f"the motor's function gave {len(answer)} bytes: return at most {MOST_DATA}")
        replaced = self._answer is not None and now < self._answer[0]
        self._answer = (now + self._seconds, code, answer)
        return replaced

    def poll(self, now: float) -> tuple[int, bytes]:
        """Return command number and answer of the completed request; 0 and nothing while there is none."""
        if self._answer is None or now < self._answer[0]:
            return 0, b""
        return self._answer[1:]

    def forget(self) -> None:
        """Drop the request and its answer."""
        self._answer = None
