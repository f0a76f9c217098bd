"""Takes the inserted bytes out of a frame, and keeps where every byte stood on the wire."""

from __future__ import annotations

from collections.abc import Sequence

from qlinkgen.cli.anatomy import Anatomy, Byte, counted, raw_of
from qlinkgen.model.frame import DelimitedFrame, Part


class Unstuffer:
    """Hands out the parts of a frame one after the other."""

    def __init__(self, frame: DelimitedFrame, anatomy: Anatomy, body: Sequence[Byte]) -> None:
        """``body`` is everything behind the preamble."""
        self._frame, self._anatomy = frame, anatomy
        self._body = list(body)
        self._position = 0
        self._recent = b""
        #: Bytes that parts asked for and that were not there.
        self.missing = 0
        #: An inserted byte is wrong: what follows may be shifted, and a check value over it says nothing.
        self.faulty = False
        #: A new preamble stands inside the frame: nothing behind it belongs to it.
        self._aborted = False

    def take(self, part: Part, size: int) -> tuple[list[Byte], bytes]:
        """``size`` bytes of a part without stuffing, and the same bytes as they stood on the wire."""
        start = self._position
        if self._counted_stuffed(part):
            found = self._stuffed_run(size)
        else:
            found = []
            stuffed = self._is_stuffed(part)
            while len(found) < size and self._position < len(self._body) and not self._aborted:
                found.append(self._next())
                if stuffed:
                    self._remember(found[-1])
                else:
                    self._recent = b""
            if self._aborted:
                found = [byte for byte in found if byte.offset < self._body[self._position].offset]
            self.missing += size - len(found)
        return found, raw_of(self._body[start : self._position])

    def left(self) -> int:
        """Bytes that are left, without the inserted ones (as far as the marks can be told)."""
        rest = raw_of(self._body[self._position :])
        stuffing = self._frame.stuffing
        if stuffing is None or stuffing.before_checksum:
            return len(rest)
        return len(rest) - rest.count(stuffing.after + bytes((stuffing.insert,)))

    def finish(self) -> None:
        """What stands behind the frame."""
        rest = self._body[self._position :]
        if rest:
            self._anatomy.row(rest, "(behind the frame)", "not part of it")
            self._anatomy.notes.append(
                f"{counted(len(rest))} behind the frame; `qlinkgen decode` takes whole streams"
            )

    def _counted_stuffed(self, part: Part) -> bool:
        """The payload alone is stuffed and the length counts what is sent."""
        stuffing = self._frame.stuffing
        return stuffing is not None and stuffing.before_checksum and part.role == "payload"

    def _is_stuffed(self, part: Part) -> bool:
        stuffing = self._frame.stuffing
        return stuffing is not None and not stuffing.before_checksum and part.name not in stuffing.exempt

    def _stuffed_run(self, size: int) -> list[Byte]:
        end = min(self._position + size, len(self._body))
        self.missing += size - (end - self._position)
        found: list[Byte] = []
        self._recent = b""
        while self._position < end:
            found.append(self._next())
            self._remember(found[-1], end)
        return found

    def _next(self) -> Byte:
        byte = self._body[self._position]
        self._position += 1
        return byte

    def _remember(self, byte: Byte, end: int | None = None) -> None:
        """Take the inserted byte that must follow a stuffed one."""
        stuffing = self._frame.stuffing
        assert stuffing is not None
        self._recent = (self._recent + bytes((byte.value,)))[-len(stuffing.after) :]
        limit = len(self._body) if end is None else end
        if self._recent != stuffing.after:
            return
        self._recent = b""
        if self._position >= limit:
            return  # the end of the frame or of the capture: the inserted byte may come later
        follower = self._body[self._position]
        if follower.value == stuffing.insert:
            self._anatomy.row([self._next()], "(stuffing)", f"inserted behind {stuffing.after.hex(' ')}")
        elif self._frame.unique_preamble and follower.value == stuffing.after[0]:
            cause = "the sender was interrupted or bytes were lost: this frame is cut off"
            self._anatomy.wrong(f"a new preamble begins at offset {byte.offset}, inside the frame", cause)
            self._position -= 1
            self._aborted = True
        else:
            seen = f"{stuffing.after.hex(' ')} at offset {byte.offset} is followed by {follower.value:02x}"
            self.faulty = True
            cause = "the sender does not stuff, or a byte was lost or changed"
            self._anatomy.wrong(f"{seen}; behind it must be {stuffing.insert:02x}", cause)
