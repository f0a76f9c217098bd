"""What two-wire RS485 adapters do: hand back to the computer what it has just sent."""

from __future__ import annotations

from typing import Literal

EchoMode = Literal["auto", "expect", "none"]

#: Sent once to find out whether there is an echo. Receivers that hunt for a frame's beginning pass over it.
PROBE = b"\x00\x00"
#: Bytes of noise, as of an adapter that turns round, behind which the probe is still known.
NOISE = 2
#: An adapter may hold back the echoes of some broadcasts; of more than these the oldest is given up.
OUTSTANDING = 8
#: As many bytes of a frame's head or tail are no noise: what follows them is not the frame's echo.
PARTIAL = 4


class EchoCanceller:
    """Takes back out of the received bytes what was sent.

    An echo that begins as it should is taken out byte by byte. Where something else comes, all of it is left
    in the stream: a decoder finds an intact answer behind it, and `is_own` tells that answer from the frame
    that was sent, which some commands' answers equal to the last bit.

    Attributes:
        mode: `expect` or `none`; `auto` until a probe has shown which of them is right.
        active: an echo is outstanding, or broken.
        broken: something else came back than was sent.
    """

    __slots__ = ("_frames", "_heard", "_seen", "active", "broken", "mode")

    def __init__(self, mode: EchoMode) -> None:
        if mode not in ("auto", "expect", "none"):
            raise ValueError(f'echo: {mode!r} was given; there are "auto", "expect" and "none"')
        self.mode: EchoMode = mode
        self.active = False
        self.broken = False
        #: What was sent and has not come back, oldest first: echoes may come after the next frame is sent.
        self._frames: list[bytes] = []
        self._seen = 0
        #: After a break: what came in place of the echo.
        self._heard = b""

    def sent(self, frame: bytes) -> bool:
        """These bytes are on their way and will come back; returns whether an older echo is given up."""
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
        """What was sent and has not come back yet."""
        return b"".join(self._frames)[self._seen :]

    def forget(self) -> None:
        """Whatever comes from now on is no echo."""
        self.active = self.broken = False
        self._frames = []
        self._seen = 0
        self._heard = b""

    def cancel(self, data: bytes) -> bytes:
        """Return received bytes without the echo in front of them."""
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
        """Whether a frame, or the beginning of one, that was found behind a broken echo is what was sent."""
        for index, frame in enumerate(self._frames):
            begun = frame.startswith(raw)
            if begun and len(raw) < len(frame) - 1:  # an inserted byte at the end is not part of a fault
                return True
            if not begun:
                if len(raw) > PARTIAL and frame.startswith(raw[:-1]):  # the last byte is another frame's
                    return True
                continue
            before, _, behind = self._heard.partition(raw)
            if PARTIAL <= len(before) < len(frame) and (frame.startswith(before) or frame.endswith(before)):
                return False
            del self._frames[: index + 1]
            self._heard = behind
            if not self._frames:  # it did come back, behind some noise
                self.forget()
            return True
        return False
