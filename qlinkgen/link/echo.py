"""Cancels the echo of two-wire RS485 adapters, which receive their own transmissions."""

from __future__ import annotations

from typing import Literal

EchoMode = Literal["auto", "expect", "none"]

#: Sent once to detect an echo. Receivers that hunt for a preamble skip it.
PROBE = b"\x00\x00"
#: Most bytes of noise before the probe, such as from an adapter that switches direction.
NOISE = 2
#: Most outstanding echoes, since an adapter may delay those of some broadcasts; then the oldest is dropped.
OUTSTANDING = 8
#: As many bytes of a frame's head or tail are a partial echo, not noise; the frame itself does not follow.
PARTIAL = 4


class EchoCanceller:
    """Removes sent bytes from the received ones.

    A correct echo is removed byte by byte. If other bytes arrive, all of them stay in the stream: a decoder
    finds an intact answer after them, and `is_own` distinguishes it from the sent frame, which may be equal
    to the answer of some commands.

    Attributes:
        mode: `expect` or `none`; `auto` until a probe has determined which.
        active: an echo is outstanding or broken.
        broken: the received bytes differ from the sent ones.
    """

    __slots__ = ("_frames", "_heard", "_seen", "active", "broken", "mode")

    def __init__(self, mode: EchoMode) -> None:
        if mode not in ("auto", "expect", "none"):
            raise ValueError(f"echo must be 'auto', 'expect' or 'none', not {mode!r}")
        self.mode: EchoMode = mode
        self.active = False
        self.broken = False
        #: Outstanding frames, oldest first: echoes may arrive after the next frame is sent.
        self._frames: list[bytes] = []
        self._seen = 0
        #: The bytes received in place of a broken echo.
        self._heard = b""

    def sent(self, frame: bytes) -> bool:
        """Expect the echo of these bytes; return whether an older echo is dropped."""
        if self.broken:
            self.forget()
        self.active = True
        self._frames.append(frame)
        if len(self._frames) <= OUTSTANDING:
            return False
        del self._frames[0]
        self._seen = 0
        return True

    @property
    def outstanding(self) -> bytes:
        """The sent bytes whose echo is outstanding."""
        return b"".join(self._frames)[self._seen :]

    def forget(self) -> None:
        """Expect no echo any more."""
        self.active = self.broken = False
        self._frames = []
        self._seen = 0
        self._heard = b""

    def cancel(self, data: bytes) -> bytes:
        """Return received bytes without a leading echo."""
        if self.broken:
            self._heard += data
            return data
        frames = self._frames
        while frames and data:
            frame, seen = frames[0], self._seen
            size = min(len(frame) - seen, len(data))
            if data[:size] != frame[seen : seen + size]:
                self.broken = True
                self._seen = 0
                self._heard = frame[:seen] + data
                return self._heard
            data = data[size:]
            self._seen += size
            if self._seen == len(frame):
                del frames[0]
                self._seen = 0
        self.active = bool(frames)
        return data

    def is_own(self, raw: bytes) -> bool:
        """Whether a frame or the beginning of one, found after a broken echo, is the sent one."""
        for index, frame in enumerate(self._frames):
            begun = frame.startswith(raw)
            if begun and len(raw) < len(frame) - 1:  # an inserted byte at the end is not part of a fault
                return True
            if not begun:
                if len(raw) > PARTIAL and frame.startswith(raw[:-1]):  # the last byte is of another frame
                    return True
                continue
            before, _, behind = self._heard.partition(raw)
            if PARTIAL <= len(before) < len(frame) and (frame.startswith(before) or frame.endswith(before)):
                return False
            del self._frames[: index + 1]
            self._heard = behind
            if not self._frames:  # the echo was complete, after some noise
                self.forget()
            return True
        return False


class EchoProbe:
    """Detects whether the port echoes, by sending two bytes once.

    Attributes:
        until: time at which the probe counts as not echoed; 0 before it is sent.
    """

    __slots__ = ("_heard", "until")

    def __init__(self) -> None:
        self.until = 0.0
        self._heard = b""

    def send(self, until: float) -> bytes:
        """Return the bytes to send, whose echo arrives until then."""
        self.until = until
        self._heard = b""
        return PROBE

    def echoed(self, data: bytes) -> bool:
        """Whether these bytes complete the probe, which may lose its first byte, or follow noise."""
        heard = self._heard = self._heard + data
        return heard[:1] == PROBE[:1] or 0 < heard.find(PROBE) <= NOISE
