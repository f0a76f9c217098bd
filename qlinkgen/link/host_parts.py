"""Parts of a host with a state of their own: the awaited answer, unread answers, and a resynchronisation."""

from __future__ import annotations

from qlinkgen.link.codec import Framed
from qlinkgen.link.host_rules import Asked, HostRules
from qlinkgen.link.host_timing import ROUNDS, SILENT_ROUNDS


class Awaited:
    """The answer that a host waits for: so many bytes, since a packet has no length.

    Attributes:
        asked: the request: that of the transaction, a context, or the proof.
        check: its checksum is read.
        listening: bytes are awaited.
        need: number of bytes.
        data: bytes received so far.
        deadline: time until which they arrive.
    """

    __slots__ = ("asked", "check", "data", "deadline", "listening", "need")

    def __init__(self, asked: Asked) -> None:
        self.asked = asked
        self.check = True
        self.listening = False
        self.need = 0
        self.data = b""
        self.deadline = 0.0

    def listen(self, need: int, deadline: float) -> None:
        """Wait for a number of bytes."""
        self.listening = True
        self.need = need
        self.data = b""
        self.deadline = deadline

    def stop(self) -> None:
        """Wait no longer, and discard the bytes."""
        self.listening = False
        self.data = b""

    def ask(self, asked: Asked, deadline: float, *, check: bool) -> None:
        """Wait for the answer to a request."""
        command = asked.command
        self.asked = asked
        self.check = check
        self.listen(command.payload + command.check_size if check else command.payload, deadline)

    def late(self, now: float) -> bool:
        """Whether the answer is not complete in time."""
        return self.listening and now >= self.deadline


class Unread:
    """The outgoing line, and the answers that are discarded when they arrive.

    Attributes:
        owed: pending bytes to be discarded.
        until: time until which they arrive.
    """

    __slots__ = ("_byte_time", "_free_at", "owed", "until")

    def __init__(self, byte_time: float) -> None:
        self._byte_time = byte_time
        self._free_at = 0.0  #: when all sent bytes have been transmitted
        self.owed = 0
        self.until = 0.0

    def line_up(self, asked: Asked, now: float) -> float:
        """Send a request; return the deadline of its answer, after all bytes still being sent and owed."""
        begin = max(now, self._free_at)
        self._free_at = begin + len(asked.frame) * self._byte_time
        return begin + asked.command.answer_time + self.owed * self._byte_time

    def owe(self, size: int, until: float) -> None:
        """Expect bytes to discard."""
        self.owed += size
        self.until = until

    def overdue(self, now: float) -> bool:
        """Whether bytes to discard have not arrived in time."""
        return self.owed > 0 and now > self.until

    def discard(self, data: bytes) -> bytes:
        """Return received bytes without those to be discarded."""
        skipped = min(self.owed, len(data))
        self.owed -= skipped
        return data[skipped:]


class WayBack:
    """Progress of a resynchronisation.

    Attributes:
        fill: the fill byte.
        rounds: failed rounds of this transaction.
        silent: failed rounds without any received byte.
        heard: bytes were received in this round.
        fills: fill bytes sent in this round.
        completed: the fill bytes have completed a packet.
    """

    __slots__ = ("_rules", "completed", "fill", "fills", "heard", "rounds", "silent")

    def __init__(self, rules: HostRules) -> None:
        self._rules = rules
        self.fill = rules.fill
        self.rounds = 0
        self.silent = 0
        self.heard = False
        self.fills = 0
        self.completed = False

    def begin(self) -> None:
        """Begin a transaction."""
        self.rounds = self.silent = 0

    def begin_round(self) -> None:
        """Begin a round."""
        self.heard = False
        self.fills = 0
        self.completed = False

    def lose_round(self) -> bool:
        """Count a failed round; return whether there is another one."""
        self.rounds += 1
        self.silent += not self.heard
        return self.rounds < ROUNDS and self.silent < SILENT_ROUNDS

    def choose_fill(self, pending: type[Framed] | None) -> None:
        """Choose the byte that does the least harm as the rest of a pending request."""
        fill = self._rules.fill
        self.fill = fill if pending is None else self._rules.fills.get(pending, fill)

    def next_fill(self) -> bytes:
        """Count a fill byte and return it."""
        self.fills += 1
        return bytes((self.fill,))

    def filled(self, answer: bytes) -> None:
        """Note whether the last fill byte was answered like the end of a packet."""
        self.completed = bool(answer) and answer != self._rules.refusal
