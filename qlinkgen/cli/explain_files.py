"""What ``qlinkgen explain`` looks for in captures: the first bad frame, or the first difference of two."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import zip_longest
from types import ModuleType
from typing import NamedTuple

from qlinkgen.cli.capture_input import Capture
from qlinkgen.cli.capture_options import CaptureOptions, complain
from qlinkgen.cli.conversations import PacketWire
from qlinkgen.cli.decode import message_record
from qlinkgen.cli.decoder import Decoder
from qlinkgen.cli.streams import Bad, Event
from qlinkgen.cli.traffic import Place, framed
from qlinkgen.model.message import Direction
from qlinkgen.model.protocol import Protocol
from qlinkgen.plan.framing import frame_plan


class Found(NamedTuple):
    """A frame of a capture."""

    #: Its bytes on the wire.
    data: bytes
    #: What is known of its direction.
    direction: Direction | None
    #: The request before it, where its meaning depends on that.
    request: bytes | None
    #: Its number, from 1, and its place in the file.
    text: str
    bad: bool
    #: What is compared: its values, or its bytes if it is bad.
    values: object


class Frames:
    """The frames of a file, each with its request."""

    def __init__(self, protocol: Protocol, codec: ModuleType, capture: CaptureOptions, name: str) -> None:
        """Read the file as `decode` does."""
        self._protocol, self._name = protocol, name
        self._file = Capture(protocol, Decoder(protocol, codec, None, None, None, capture.baud), capture)
        self._paired = frame_plan(protocol.frame).needs_request
        self._wire = PacketWire(protocol) if self._paired else framed
        self.count = 0

    def __iter__(self) -> Iterator[Found]:
        request: bytes | None = None
        for event, place in self._file.frames(self._name):
            self.count += 1
            found = self._found(event, place, request)
            if self._paired:
                request = found.data if found.direction == "request" else None
            yield found
        complain(self._name, self._file.problems)

    def _found(self, event: Event, place: Place, request: bytes | None) -> Found:
        text = f"{self._name}: frame {self.count}, offset {place.offset}"
        if place.at is not None:
            text += f", time {place.at // 10**9}.{place.at % 10**9:09d}"
        if isinstance(event, Bad):
            return Found(event.raw, None, request, text, bad=True, values=event.raw)
        direction = self._protocol.by_name[event.NAME].direction
        known = None if direction == "message" else direction
        data = self._wire(event)
        asked = request if known == "response" else None
        return Found(data, known, asked, text, bad=False, values=message_record(self._protocol, event))


def first_bad(frames: Frames) -> Found | None:
    """Return the first frame that is bad, None if all are good."""
    return next((each for each in frames if each.bad), None)


def first_difference(one: Frames, other: Frames) -> tuple[Found | None, Found | None] | None:
    """Return the frames with the same number that differ first; None without any."""
    for left, right in zip_longest(one, other):
        if left is None or right is None or left.values != right.values:
            return left, right
    return None
