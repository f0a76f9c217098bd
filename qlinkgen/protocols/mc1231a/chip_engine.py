"""The chip's end of the serial link: packets out of bytes, checksums behind answers.

The link carries the bytes of the parallel port in the same order. The words to be read and the checksum are
sent as soon as a packet is complete, whether or not the host wants them.
"""

from __future__ import annotations

from qlinkgen.codecs import mc1231a
from qlinkgen.protocols.mc1231a.chip import ChipSet

_REFUSAL = b"\0\0"


class ChipCounters:
    """What the chip's end of the link has seen.

    Attributes:
        packets: packets that were carried out.
        illegal: command bytes that are no commands, and commands that the chip set does not know.
        out_of_range: packets with a value that the command does not allow; they change nothing.
        forgotten: packets that were begun and then forgotten.
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
    """Carries out the packets that come, and answers; driven like `qlinkgen.link.SlaveEngine`.

    Attributes:
        chip: the chip set.
        counters: what was seen.
        record: packets that were carried out, if they are kept.
    """

    def __init__(
        self, chip: ChipSet, *, forgets: float = 0.0, turnaround: float = 0.0, record: bool = False
    ) -> None:
        """Make the chip's end of a link.

        Args:
            chip: the chip set.
            forgets: seconds of silence within a packet after which it is forgotten; 0: never. The sources
                know no such rule, so there is none unless asked for.
            turnaround: seconds from the end of a packet to its answer.
            record: keep every packet that was carried out.
        """
        for name, seconds in (("forgets", forgets), ("turnaround", turnaround)):
            if not 0 <= seconds < float("inf"):
                raise ValueError(f"{name}: {seconds} s was given; a time is not negative, and ends")
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
        """Take bytes that the host has sent."""
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
            self._answer += _checked(packet, b"")  # what a host reads is in no packet with a value
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
        """Return when an answer is due, None where none waits."""
        return self._due if self._answer else None


def _checked(packet: bytes, payload: bytes) -> bytes:
    """A payload and the checksum over the whole packet."""
    words = packet[1:] + payload
    total = packet[0] + sum(words[0::2]) * 256 + sum(words[1::2])
    return payload + (total & 0xFFFF).to_bytes(2, "big")
