"""The chip's end of the serial link: decodes packets, and sends answers with checksums.

The link carries the bytes of the parallel port in the same order. The words to read and the checksum are sent
as soon as a packet is complete, whether or not the host reads them.
"""

from __future__ import annotations

from qlinkgen.codecs import mc1231a
from qlinkgen.protocols.mc1231a.chip import ChipSet

_REFUSAL = b"\0\0"


class ChipCounters:
    """Counts of packets.

    Attributes:
        packets: executed packets.
        illegal: invalid command bytes, and commands unknown to the chip set.
        out_of_range: packets with an invalid value, which have no effect.
        forgotten: incomplete packets discarded after a silence.
    """

    __slots__ = ("forgotten", "illegal", "out_of_range", "packets")

    def __init__(self) -> None:
        self.packets = 0
        self.illegal = 0
        self.out_of_range = 0
        self.forgotten = 0

    def __repr__(self) -> str:
        return f"ChipCounters({', '.join(f'{name}={getattr(self, name)!r}' for name in self.__slots__)})"


class ChipEngine:
    """Executes received packets, and answers; used like `qlinkgen.link.SlaveEngine`.

    Attributes:
        chip: the chip set.
        counters: counts of packets.
        record: executed packets, if recorded.
    """

    def __init__(
        self, chip: ChipSet, *, forgets: float = 0.0, turnaround: float = 0.0, record: bool = False
    ) -> None:
        """Make the chip's end of a link.

        Args:
            chip: the chip set.
            forgets: seconds of silence within a packet after which it is discarded; 0, the default: never,
                since the sources mention no such timeout.
            turnaround: seconds from the end of a packet to its answer.
            record: keep every executed packet.
        """
        for name, seconds in (("forgets", forgets), ("turnaround", turnaround)):
            if not 0 <= seconds < float("inf"):
                raise ValueError(f"{name} must be 0 s or more and finite, not {seconds}")
        self.chip = chip
        self.counters = ChipCounters()
        self.record: list[bytes] | None = [] if record else None
        commands = mc1231a.COMMANDS.values()
        self._requests: dict[int, type[mc1231a.Request]] = {each.id: each.request for each in commands}
        self._answer_sizes = {each.id: each.response.MAX_SIZE for each in commands if each.response}
        self._forgets = forgets
        self._turnaround = turnaround
        self._buffer = b""
        self._last = 0.0
        self._answer = b""
        self._due = 0.0

    def receive(self, data: bytes, now: float) -> None:
        """Process bytes of the host."""
        if self._buffer and self._forgets and now - self._last > self._forgets:
            self.counters.forgotten += 1
            self._buffer = b""
        self._last = now
        buffer = self._buffer + data
        at = 0
        while at < len(buffer):
            request = self._requests.get(buffer[at])
            size = 1 + request.MAX_SIZE if request is not None else 1
            if at + size > len(buffer):
                break
            self._carry_out(request, buffer[at : at + size], now)
            at += size
        self._buffer = buffer[at:]

    def _carry_out(self, request: type[mc1231a.Request] | None, packet: bytes, now: float) -> None:
        if not self._answer:
            self._due = now + self._turnaround
        if request is None or not self.chip.knows(request):
            self.counters.illegal += 1
            self._answer += bytes(self._answer_sizes.get(packet[0], 0)) + _REFUSAL
            return
        try:
            message = request.from_bytes(packet[1:])
        except mc1231a.DecodeError:
            self.counters.out_of_range += 1
            self._answer += _checked(packet, b"")  # packets with a value have no words to read
            return
        self.counters.packets += 1
        if self.record is not None:
            self.record.append(packet)
        self._answer += _checked(packet, self.chip.handle(message, now).to_bytes())

    def bytes_to_send(self, now: float) -> bytes:
        """Return the answers that are due."""
        answer = self._answer
        if not answer or now < self._due:
            return b""
        self._answer = b""
        return answer

    def next_timer(self) -> float | None:
        """Return when an answer is due, None without one."""
        return self._due if self._answer else None


def _checked(packet: bytes, payload: bytes) -> bytes:
    """Return a payload with the checksum over the whole packet."""
    words = packet[1:] + payload
    total = packet[0] + sum(words[0::2]) * 256 + sum(words[1::2])
    return payload + (total & 0xFFFF).to_bytes(2, "big")
