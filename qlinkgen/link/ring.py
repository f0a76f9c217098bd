"""One node of a ring: takes its messages, forwards the others, and sends its own in between.

The engine does no input or output and has no clock. A driver calls it with `now` from its own clock::

    node.receive(data, now)  # bytes from the previous node
    node.handle_timer(now)  # at next_timer()
    port.write(node.bytes_to_send(now))

A message is for this node if the address in its header is 1. Others are forwarded with the address
decremented in the header and in the end byte; the payload is not checked. With cut-through, the default, each
byte is forwarded on reception, so a node delays a message by one byte time. `cut_through=False` stores a
message until its end, and forwards only intact ones; each node then delays it by its whole length.

**A message that turns out broken after its head was forwarded** is terminated by an end byte with the address
0. No header has that address, so the next node sees an end that does not match, drops the message, reports a
frame error, and terminates it in the same way for its successor: the receiver drops it, each node on the way
reports it, and the line is free for the next message immediately. A message is broken by an end byte with
another address than the header, a header before the end, more bytes than any message has, or silence for
longer than `patience`. Only the receiver checks the payload.

States and transitions:

=========  ===========================================  ==================================================
state      meaning                                      transitions
=========  ===========================================  ==================================================
closed     between messages                             header -> taking, passing or blocking; with
                                                        address 0, or another byte -> hunting
taking     in a message for this node                   end byte -> closed; silence, length -> hunting;
                                                        header -> the state of the new message
passing    in a message for another node                the same
blocking   in a message for another node, while this    the same
           node does not forward
hunting    in bytes after a reported fault              header -> as from closed
=========  ===========================================  ==================================================
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Mapping
from typing import Any, Protocol

from qlinkgen.link.codec import Bus, Encoder, Framed, Message
from qlinkgen.link.ring_events import (
    Blocked,
    Broken,
    CommsError,
    NetStat,
    Passed,
    Queued,
    RingCounters,
    RingEvent,
    StatusRaised,
    Taken,
)

#: Most events that are kept if the driver does not remove them.
EVENTS_KEPT = 4096
#: Default size of the transmit buffer: four messages of full length.
ROOM = 1040
#: Default silence in seconds after which an incomplete message is broken. Far longer than the operating
#: system suspends a program, which looks the same.
PATIENCE = 0.5

CLOSED = "closed"
TAKING = "taking"
PASSING = "passing"
BLOCKING = "blocking"
HUNTING = "hunting"
_OPEN = frozenset({TAKING, PASSING, BLOCKING})


class Marking(Protocol):
    """Layout of header and end byte; see the class of that name in the support module."""

    marker: int
    address_shift: int
    address_mask: int
    id_shift: int
    id_mask: int
    end: int
    most: int


class RingCodec(Encoder, Protocol):
    """A generated module with marked frames, such as `qlinkgen.codecs.trio`."""

    @property
    def BUS(self) -> Bus:  # noqa: N802  # as the generated module has it
        """Nodes and speed of the line."""
        ...

    @property
    def MARKING(self) -> Marking:  # noqa: N802
        """Layout of header and end byte."""
        ...

    @property
    def MESSAGES(self) -> Mapping[str, type[Message]]:  # noqa: N802
        """Messages by name."""
        ...

    @property
    def DecodeError(self) -> type[Exception]:  # noqa: N802
        """The error of `decode`."""
        ...

    @property
    def decode(self) -> Callable[[bytes], Framed]:
        """Return the message of a frame."""
        ...


class RingNode:
    """The engine of one node.

    Attributes:
        codec: the generated module of the protocol.
        cut_through: messages are forwarded while being received.
        passes: messages to others are forwarded; otherwise they are dropped and counted.
        netstat: errors since it was set to 0.
        commserror: the same in more detail.
        counters: counts of messages and faults.
        events: events, oldest first; the driver removes them.
        verbose: also report each message, not only faults.
    """

    def __init__(
        self,
        codec: RingCodec,
        on_message: Callable[[Any, float], object] | None = None,  # Any: a message of the codec's own class
        *,
        cut_through: bool = True,
        baud: int | None = None,
        patience: float = PATIENCE,
        room: int = ROOM,
    ) -> None:
        """Make a node as just switched on.

        Args:
            codec: the generated module of the protocol.
            on_message: called with each message to this node and the time.
            cut_through: forward messages while receiving them, not only when they are complete.
            baud: speed of a paced line. An own message then begins only when the transmitter has sent
                everything before it, so that it delays forwarded messages as little as possible.
            patience: seconds of silence inside a message after which it is broken.
            room: size of the transmit buffer in bytes.

        Raises:
            ValueError: a number is out of range.
        """
        marking = codec.MARKING
        if baud is not None and baud <= 0:
            raise ValueError(f"baud must be bits per second, or None for an unpaced line, not {baud}")
        if not 0 < patience < float("inf"):
            raise ValueError(f"patience must be above 0 s and finite, not {patience}")
        if room < marking.most + 2:
            raise ValueError(f"room must be {marking.most + 2} or more, the longest message, not {room}")
        self.codec = codec
        self.cut_through = cut_through
        self.passes = True
        self.netstat = NetStat(0)
        self.commserror = CommsError(0)
        self.counters = RingCounters()
        self.events: deque[RingEvent] = deque(maxlen=EVENTS_KEPT)
        self.verbose = False
        self._on_message = on_message
        self._patience = patience
        self._room = room
        self._byte_time = codec.BUS.bits_per_byte / baud if baud else 0.0
        self._marker = marking.marker
        self._marks = bytes(byte & marking.marker for byte in range(256))
        self._most = marking.most
        self._known = {message.ID << marking.id_shift for message in codec.MESSAGES.values()}
        self._id_mask = marking.id_mask << marking.id_shift
        self._end_bits = marking.end << marking.id_shift
        self._address_bits = marking.address_mask << marking.address_shift
        self._one = 1 << marking.address_shift
        self._last = float("-inf")
        self._free = float("-inf")
        self.reset()

    def reset(self) -> None:
        """Discard messages being received or sent, as by switching off. Counters and status are kept."""
        self._state = CLOSED
        self._held = bytearray()  # the message being received, from its header on
        self._out = bytearray()  # bytes to forward
        self._queue: deque[bytes] = deque()  # own messages
        self._queued = 0
        self._asked = float("-inf")  # when the first of them came

    # receiving

    def receive(self, data: bytes, now: float) -> None:
        """Process bytes from the previous node; the last one was received at `now`."""
        self._last = now
        marks = data.translate(self._marks)
        position = 0
        while (mark := marks.find(self._marker, position)) >= 0:
            if mark > position:
                self._payload(data[position:mark], now)
            self._mark(data[mark], now)
            position = mark + 1
        if position < len(data):
            self._payload(data[position:], now)

    def _payload(self, piece: bytes, now: float) -> None:
        state = self._state
        if state == HUNTING:
            self.counters.skipped += len(piece)
        elif state == CLOSED:
            self._fault("frame", piece, "payload bytes outside a message", now)
            self._state = HUNTING
        else:
            self._held += piece
            if len(self._held) > self._most + 1:
                self._break("frame", f"more than {self._most} bytes between header and end", now)
                self._state = HUNTING
            elif state == PASSING and self.cut_through:
                self._out += piece

    def _mark(self, byte: int, now: float) -> None:
        """Process a header or an end byte."""
        state = self._state
        if byte & self._id_mask != self._end_bits:
            if state in _OPEN:
                self._break("frame", "a new message begins inside the message", now)
            self._begin(byte, now)
        elif state in _OPEN:
            self._held.append(byte)
            self._state = CLOSED
            if (byte ^ self._held[0]) & self._address_bits:
                self._break("frame", "the end byte has another address than the header", now, state)
            elif state == PASSING:
                self._passed(byte, now)
            elif state == TAKING:
                self._take(now)
        elif state == HUNTING:
            self.counters.skipped += 1
        else:
            self._fault("frame", bytes((byte,)), "an end byte outside a message", now)
            self._state = HUNTING

    def _begin(self, header: int, now: float) -> None:
        address = header & self._address_bits
        self._held = bytearray((header,))
        if address > self._one:
            self._state = PASSING if self.passes else BLOCKING
            if not self.passes:
                self.counters.blocked += 1
                self.events.append(Blocked(now, header))
            elif self.cut_through:
                self._out.append(header - self._one)
        elif address:
            self._state = TAKING
        else:
            self._fault("frame", bytes((header,)), "a header with address 0, which no message has", now)
            self._state = HUNTING

    def _passed(self, end: int, now: float) -> None:
        held = self._held
        if not self.cut_through:
            self._out.append(held[0] - self._one)
            self._out += held[1:-1]
        self._out.append(end - self._one)
        self.counters.passed += 1
        if self.verbose:
            self.events.append(Passed(now, bytes(held)))

    def _take(self, now: float) -> None:
        frame = bytes(self._held)
        try:
            message = self.codec.decode(frame)
        except self.codec.DecodeError as error:
            self._fault(self._kind(frame, error), frame, str(error), now)
            return
        self.counters.taken += 1
        if self.verbose:
            self.events.append(Taken(now, message, frame))
        if self._on_message is not None:
            self._on_message(message, now)

    def _kind(self, frame: bytes, error: Exception) -> str:
        return str(getattr(error, "kind", "frame")) if frame[0] & self._id_mask in self._known else "unknown"

    # faults

    def _break(self, kind: str, text: str, now: float, state: str = "") -> None:
        """Report the current message as broken, and terminate it for the following nodes."""
        begun = (state or self._state) == PASSING and self.cut_through
        if begun:
            self._out.append(self._marker | self._end_bits)
            self.counters.cut_short += 1
        self._fault(kind, bytes(self._held), text, now, cut_short=begun)

    def _fault(self, kind: str, raw: bytes, text: str, now: float, *, cut_short: bool = False) -> None:
        faults = self.counters.faults
        faults[kind] = faults.get(kind, 0) + 1
        self.events.append(Broken(now, kind, raw, text, cut_short))
        if cut_short:
            self.commserror |= CommsError.TX_STRUCTURE
        if kind != "crc":
            self.commserror |= CommsError.RX_STRUCTURE
        self.raise_status(NetStat.RX_CRC if kind == "crc" else NetStat.RX_FRAME, now)

    def raise_status(self, bit: NetStat, now: float) -> None:
        """Set a bit of the network status."""
        if not self.netstat & bit:
            self.netstat |= bit
            self.events.append(StatusRaised(now, bit))

    # sending

    def send(self, message: Message, now: float) -> bool:
        """Put an own message into the transmit buffer; return False if it is full.

        Raises:
            EncodeError: of the generated module; the buffer is unchanged.
        """
        frame = self.codec.encode(message)
        if self._queued + len(frame) > self._room:
            return False
        if not self._queue:
            self._asked = now
        self._queue.append(frame)
        self._queued += len(frame)
        if self.verbose:
            self.events.append(Queued(now, message))
        return True

    def refuse(self, now: float) -> None:
        """Count an own message discarded because the buffer is full, and set the status."""
        self.counters.refused += 1
        self.raise_status(NetStat.TX_TIMEOUT, now)

    @property
    def idle(self) -> bool:
        """Whether nothing is to be sent and no message is being forwarded."""
        return not self._queue and not self._out and self._state != PASSING

    def bytes_to_send(self, now: float) -> bytes:
        """Return the bytes for the next node: first forwarded ones, then own messages."""
        self.handle_timer(now)
        data = bytes(self._out)
        if data:
            self._out.clear()
            self.counters.passed_bytes += len(data)
        if self._queue and not self._sending_on:
            if not self._byte_time:
                data += self._own(len(self._queue))
            elif not data and now >= self._free:
                data = self._own(1)
        if data and self._byte_time:
            self._free = max(self._free, now) + len(data) * self._byte_time
        return data

    def _own(self, count: int) -> bytes:
        """Take a number of messages out of the transmit buffer."""
        data = b"".join(self._queue.popleft() for _ in range(count))
        self._queued -= len(data)
        self.counters.sent += count
        return data

    @property
    def _sending_on(self) -> bool:
        return self._state == PASSING and self.cut_through

    # time

    def next_timer(self) -> float | None:
        """Return when to send bytes or to give up a message, None if neither is pending."""
        if self._out:
            return self._last
        open_until = self._last + self._patience if self._state in _OPEN else None
        if self._queue and not self._sending_on:
            due = max(self._asked, self._free)
            return due if open_until is None else min(due, open_until)
        return open_until

    def handle_timer(self, now: float) -> None:
        """Break a message after too long a silence."""
        if self._state in _OPEN and now >= self._last + self._patience:
            self._break("truncated", f"no byte for {self._patience:g} s inside a message", now)
            self._state = HUNTING
