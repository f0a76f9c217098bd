"""One node of a ring: takes its messages, sends the others on, and sends its own in between.

The engine does no input or output and knows no clock. A driver does this, with `now` from its own clock::

    node.receive(data, now)  # what has come from the node before
    node.handle_timer(now)  # when next_timer() has come
    port.write(node.bytes_to_send(now))

A message is known to be for this node as soon as its header is there: the address in it is 1. Every other one
goes to the next node with the address one lower, in the header and in the end byte; what stands between is
not looked at. With cut-through, which is the default, a byte is sent on when it has come, so a node delays a
message by one byte time. `cut_through=False` keeps a message until its end has come and sends nothing on that
is broken; each node then delays it by its whole length.

**What becomes of a message that turns out broken after its head was sent on.** It is ended there and then by
an end byte with the address 0. That is the address of no header, so the node behind sees an end that does not
belong to the message, drops it, tells a frame error, and ends it in the same way for the node behind itself:
the receiver drops it, each node on the way knows, and the line is free for the next message at once. Broken
are: an end byte with another address than the header, a header before the end, more bytes than any message
has, and silence for longer than `patience`. The payload is judged by the receiver alone.

States, and what leads from one to the next:

=========  ===========================================  ==================================================
state      meaning                                      left by
=========  ===========================================  ==================================================
closed     no message is under way                      header -> taking, passing or blocking, or hunting
                                                        where its address is 0; other byte: -> hunting
taking     a message for this node                      end byte -> closed; silence, length -> hunting;
                                                        header -> the state of the new message
passing    a message for another one                    the same
blocking   a message for another one, while nothing     the same
           may be sent through this node
hunting    bytes behind a fault that was told           header -> as from closed
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
    NetStat,
    Passed,
    Queued,
    RingCounters,
    RingEvent,
    StatusRaised,
    Taken,
)

#: Events that are kept for one who does not fetch them.
EVENTS_KEPT = 4096
#: Bytes that the transmit buffer holds, unless told otherwise: four messages of full length.
ROOM = 1040
#: Seconds of silence inside a message after which it is given up, unless told otherwise. Far more than the
#: operating system ever stops a program for, since that looks the same.
PATIENCE = 0.5

CLOSED = "closed"
TAKING = "taking"
PASSING = "passing"
BLOCKING = "blocking"
HUNTING = "hunting"
_OPEN = frozenset({TAKING, PASSING, BLOCKING})


class Marking(Protocol):
    """Where header and end byte hold what; see the class of that name beside a generated module."""

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
        """Who is on the line, and how fast it is."""
        ...

    @property
    def MARKING(self) -> Marking:  # noqa: N802
        """Where header and end byte hold what."""
        ...

    @property
    def MESSAGES(self) -> Mapping[str, type[Message]]:  # noqa: N802
        """Messages by name."""
        ...

    @property
    def DecodeError(self) -> type[Exception]:  # noqa: N802
        """What `decode` raises."""
        ...

    @property
    def decode(self) -> Callable[[bytes], Framed]:
        """Return the message of a frame."""
        ...


class RingNode:
    """The engine of one node.

    Attributes:
        codec: the generated module of the protocol.
        cut_through: messages are sent on while they still come.
        passes: messages to others are sent on at all; otherwise they are dropped and counted.
        netstat: what has gone wrong since somebody has set it to 0.
        counters: what it has seen.
        events: what happened, oldest first; the driver takes them out.
        verbose: events tell of each message too, not only of what went wrong.
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
        """Make a node that has just been switched on.

        Args:
            codec: the generated module of the protocol.
            on_message: called with each message to this node and the time.
            cut_through: send messages on while they still come, not only when they are complete.
            baud: speed of the line where bytes take their time. An own message then begins only when the
                transmitter has sent everything before it, so that it never holds up more than it must.
            patience: seconds of silence inside a message after which it is given up.
            room: bytes that the transmit buffer holds.

        Raises:
            ValueError: a number is out of its range.
        """
        marking = codec.MARKING
        if baud is not None and baud <= 0:
            raise ValueError(f"baud: {baud} was given; give bits a second, or None where bytes take no time")
        if not 0 < patience < float("inf"):
            raise ValueError(f"patience: {patience} s was given; give seconds above 0 that end")
        if room < marking.most + 2:
            raise ValueError(f"room: {room} was given; a message takes up to {marking.most + 2} bytes")
        self.codec = codec
        self.cut_through = cut_through
        self.passes = True
        self.netstat = NetStat(0)
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
        """Forget what is under way, as when the node is switched off. Counters and status stay."""
        self._state = CLOSED
        self._held = bytearray()  # the message under way, from its header on, as it came
        self._out = bytearray()  # to be sent on
        self._queue: deque[bytes] = deque()  # own messages
        self._queued = 0
        self._asked = float("-inf")  # when the first of them came

    # receiving

    def receive(self, data: bytes, now: float) -> None:
        """Take bytes from the node before; the last one came at `now`."""
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
        """Take a header or an end byte."""
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
        """The message under way is broken: tell it, and the nodes behind as well."""
        begun = (state or self._state) == PASSING and self.cut_through
        if begun:
            self._out.append(self._marker | self._end_bits)
            self.counters.cut_short += 1
        self._fault(kind, bytes(self._held), text, now, cut_short=begun)

    def _fault(self, kind: str, raw: bytes, text: str, now: float, *, cut_short: bool = False) -> None:
        faults = self.counters.faults
        faults[kind] = faults.get(kind, 0) + 1
        self.events.append(Broken(now, kind, raw, text, cut_short))
        self.raise_status(NetStat.RX_CRC if kind == "crc" else NetStat.RX_FRAME, now)

    def raise_status(self, bit: NetStat, now: float) -> None:
        """Set a bit of the network status."""
        if not self.netstat & bit:
            self.netstat |= bit
            self.events.append(StatusRaised(now, bit))

    # sending

    def send(self, message: Message, now: float) -> bool:
        """Put an own message into the transmit buffer; False where it has no room, and was not taken.

        Raises:
            EncodeError: of the generated module; nothing was put anywhere.
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
        """An own message is given up, since it found no room: count it, and set the status."""
        self.counters.refused += 1
        self.raise_status(NetStat.TX_TIMEOUT, now)

    @property
    def idle(self) -> bool:
        """Nothing waits to be sent, and no message is being sent on."""
        return not self._queue and not self._out and self._state != PASSING

    def bytes_to_send(self, now: float) -> bytes:
        """Return what goes to the next node now: first what is sent on, then own messages."""
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
        """Take so many messages out of the transmit buffer."""
        data = b"".join(self._queue.popleft() for _ in range(count))
        self._queued -= len(data)
        self.counters.sent += count
        return data

    @property
    def _sending_on(self) -> bool:
        return self._state == PASSING and self.cut_through

    # time

    def next_timer(self) -> float | None:
        """Return when something is to be sent or given up, None where nothing is under way."""
        if self._out:
            return self._last
        open_until = self._last + self._patience if self._state in _OPEN else None
        if self._queue and not self._sending_on:
            due = max(self._asked, self._free)
            return due if open_until is None else min(due, open_until)
        return open_until

    def handle_timer(self, now: float) -> None:
        """Give up a message that does not go on."""
        if self._state in _OPEN and now >= self._last + self._patience:
            self._break("truncated", f"no byte for {self._patience:g} s inside a message", now)
            self._state = HUNTING
