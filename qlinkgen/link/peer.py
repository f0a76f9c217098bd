"""One side of a link whose sides both ask: a master and a slave that share one port.

Both directions of the link may be in use at once. Each half has a receiver; what one of them takes, the other
passes over. Requests and answers have different numbers, which the schema ensures.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Mapping, Sequence
from typing import Literal

from qlinkgen.link.codec import Codec, DecoderCounters, Fault, Framed, is_message
from qlinkgen.link.counters import LinkCounters
from qlinkgen.link.events import Event, Frame
from qlinkgen.link.master import MasterEngine
from qlinkgen.link.slave import Node, SlaveEngine
from qlinkgen.link.timing import Timing
from qlinkgen.link.transaction import Accepts, Question, Reply

#: Faults of one receiver that are kept until the other one has seen them.
_KEPT = 16


class Half:
    """The receiver of one half.

    Bytes that are nothing for it may be a frame for the other one: a fault counts when both have found it.
    """

    def __init__(self, codec: Codec, direction: Literal["request", "response"], seen: deque[int]) -> None:
        """Both halves share ``seen``, the offsets of faults that one of them has found."""
        self._decoder = codec.StreamDecoder(direction)
        self._seen = seen
        #: Number of bytes of its frames so far.
        self.taken = 0
        #: The line was idle before the next bytes, so a frame that is not whole never will be.
        self.idle = False

    @property
    def counters(self) -> DecoderCounters:
        """Counts so far."""
        return self._decoder.counters

    def feed(self, data: bytes, /) -> Sequence[Framed | Fault]:
        """Take the next bytes of the stream; return the events that they complete."""
        before = self._decoder.finish() if self.idle else ()
        self.idle = False
        return self._known([*before, *self._decoder.feed(data)])

    def finish(self) -> Sequence[Framed | Fault]:
        """Do nothing: a frame of the other side may be arriving while this one sends."""
        return ()

    def _known(self, events: Sequence[Framed | Fault]) -> Sequence[Framed | Fault]:
        found: list[Framed | Fault] = []
        for event in events:
            if is_message(event):
                self.taken += len(event.to_frame())
            elif event.offset in self._seen:
                self._seen.remove(event.offset)
            else:
                self._seen.append(event.offset)
                continue
            found.append(event)
        return found


class PeerEngine:
    """One side of a link: it asks, and answers the requests of the other side.

    It is driven like a `MasterEngine`, by the same drivers, and like a `SlaveEngine` by `serve`.

    Attributes:
        master: the half that asks.
        slave: the half that answers.
        events: events of the half that asks, oldest first; the driver removes them.
    """

    def __init__(
        self,
        codec: Codec,
        timing: Timing,
        node: Node,
        *,
        accepts: Mapping[str, Accepts] | None = None,
        turnaround: float = 0.0,
    ) -> None:
        """Make one side of a link.

        Args:
            codec: the generated module of the protocol.
            timing: all deadlines.
            node: what answers the requests of the other side, such as the handlers of a generated bus module.
            accepts: additional matching rules, as of a `MasterEngine`.
            turnaround: seconds from a request to its answer.
        """
        seen = deque[int](maxlen=_KEPT)
        self._halves = Half(codec, "request", seen), Half(codec, "response", seen)
        asked, answered = self._halves
        self.slave = SlaveEngine(codec, node, turnaround=turnaround, baud=timing.baud, decoder=asked)
        self.master = MasterEngine(codec, timing, accepts=accepts, decoder=answered)
        self.events: deque[Event] = self.master.events
        self.slave.numbering = self.master.numbering
        self._heard_at = 0.0
        #: Received bytes that are not known to be frames, and when the line would be quiet without them.
        self._open = 0
        self._calm = 0.0

    # What a driver calls ------------------------------------------------------------------------------------

    @property
    def codec(self) -> Codec:
        """The generated module of the protocol."""
        return self.master.codec

    @property
    def timing(self) -> Timing:
        """All deadlines."""
        return self.master.timing

    @property
    def verbose(self) -> bool:
        """Also report each request and answer, not only irregularities."""
        return self.master.verbose

    @verbose.setter
    def verbose(self, value: bool) -> None:
        self.master.verbose = value

    @property
    def frames(self) -> deque[Frame] | None:
        """Each frame of both halves, oldest first, which the driver removes; None: not kept."""
        return self.master.frames

    @frames.setter
    def frames(self, value: deque[Frame] | None) -> None:
        self.master.frames = self.slave.frames = value

    @property
    def break_time(self) -> float:
        """Seconds of the break that a driver sends before each frame, 0 for none."""
        return self.master.break_time

    @property
    def busy(self) -> bool:
        """A transaction that this side has begun is in progress."""
        return self.master.busy

    @property
    def total(self) -> LinkCounters:
        """Counts of the half that asks; those of the other one are in `slave`."""
        whole = self.master.total
        whole.skipped = min(half.counters.skipped for half in self._halves)
        return whole

    def start(
        self, request: Question, now: float, *, attempts: int | None = None, trial: bool = False
    ) -> None:
        """Begin a transaction; see `MasterEngine.start`."""
        if self.codec.BUS.first_node is not None:
            self.master.own.number = self.slave.node.number
        self.master.start(request, now, attempts=attempts, trial=trial)

    def receive(self, data: bytes, now: float) -> None:
        """Process received bytes."""
        asked, answered = self._halves
        line = self.master.line
        if now - self._heard_at > line.quiet:
            asked.idle = answered.idle = True
            self._open = 0
        self._heard_at = now
        if not self._open:
            self._calm = line.quiet_at
        before = asked.taken, answered.taken
        self.slave.receive(data, now)
        self.master.receive(data, now)
        if answered.taken != before[1]:
            self._calm = line.quiet_at
        taken = asked.taken + answered.taken - sum(before)
        self._open = max(0, self._open + len(data) - taken)  # both may take a message
        if not self._open:  # a late answer is not among requests, which do not disturb the wait for silence
            line.quiet_at = self._calm

    def answer(self, request: Framed, response: Framed | Sequence[Framed], now: float) -> bool:
        """Send the answer to a request that its handler did not answer; see `SlaveEngine.answer`."""
        return self.slave.answer(request, response, now)

    def bytes_to_send(self, now: float) -> bytes:
        """Return the bytes that the driver has to write now."""
        return self.slave.bytes_to_send(now) + self.master.bytes_to_send(now)

    def next_timer(self) -> float | None:
        """Return the time of the next call without received bytes; None if none is needed."""
        timers = [timer for each in (self.slave, self.master) if (timer := each.next_timer()) is not None]
        return min(timers, default=None)

    def handle_timer(self, now: float) -> None:
        """Process expired timers."""
        self.master.handle_timer(now)

    def take(self) -> Reply:
        """Return the reply of the transaction that has just ended; see `MasterEngine.take`."""
        return self.master.take()

    def abort(self, now: float) -> None:
        """Give up the pending transaction; an answer that still arrives is a stray."""
        self.master.abort(now)
