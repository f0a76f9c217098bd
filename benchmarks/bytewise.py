"""A receiver as in firmware, ported to Python: one state, one byte, one step.

It is the reference for the generated stream decoder, and shows why that one searches for whole frames
instead.
"""

from __future__ import annotations

from binascii import crc_hqx

from benchmarks.messages import RESPONSE_STRUCT

Response = tuple[int, ...]


class BytewiseReceiver:
    """Finds Q.link's frames byte by byte; returns motion.response as a tuple, a bad frame as None."""

    __slots__ = ("_body", "_escaped", "_left", "_state")

    def __init__(self) -> None:
        self._state = 0  # 0, 1: A5s seen; 2: length; 3: body
        self._left = 0
        self._escaped = False
        self._body = bytearray()

    def feed(self, chunk: bytes) -> list[Response | None]:
        """Process the next bytes of the stream."""
        found: list[Response | None] = []
        for byte in chunk:
            if self._state == 3:
                self._take(byte, found)
            elif self._state < 2:
                self._state = self._state + 1 if byte == 0xA5 else 0
            elif byte != 0xA5:
                self._begin(byte)
        return found

    def _begin(self, length: int) -> None:
        self._state = 3 if 4 <= length <= 30 else 0
        self._body = bytearray((length,))
        self._left = length
        self._escaped = False

    def _take(self, byte: int, found: list[Response | None]) -> None:
        if self._escaped:
            self._escaped = False
            if byte:
                self._state = 2 if byte == 0xA5 else 0
                found.append(None)
            return
        self._body.append(byte)
        self._left -= 1
        self._escaped = byte == 0xA5
        if not self._left:
            self._state = 1 if byte == 0xA5 else 0
            good = not crc_hqx(self._body, 0xFFFF) and self._body[1] == 0x20 and len(self._body) == 14
            found.append(RESPONSE_STRUCT.unpack_from(self._body, 3) if good else None)
