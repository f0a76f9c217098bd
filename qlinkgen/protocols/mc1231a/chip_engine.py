"""The chip's end of the serial link, which carries the bytes of the parallel port in the same order."""

from __future__ import annotations

from qlinkgen.codecs import mc1231a
from qlinkgen.link.codec import Fault, Framed
from qlinkgen.link.device import DeviceEngine
from qlinkgen.protocols.mc1231a.chip import ChipSet


class ChipEngine(DeviceEngine):
    """Executes the packets of a chip set. A packet with a value has no words to read.

    Attributes:
        chip: the chip set.
        record: executed packets, if recorded.
    """

    def __init__(
        self, chip: ChipSet, *, forgets: float = 0.0, turnaround: float = 0.0, record: bool = False
    ) -> None:
        """Make the chip's end of a link.

        Args:
            chip: the chip set.
            forgets: as for `DeviceEngine`; 0 by default, since the sources mention no such timeout.
            turnaround: as for `DeviceEngine`.
            record: keep every executed packet.
        """
        super().__init__(mc1231a, chip, forgets=forgets, turnaround=turnaround)
        self.chip = chip
        self._names = {command.id: name for name, command in mc1231a.COMMANDS.items()}
        self.record: list[bytes] | None = [] if record else None

    def _carry_out(self, request: Framed, now: float) -> None:
        executed = self.counters.packets
        super()._carry_out(request, now)
        if self.record is not None and self.counters.packets > executed:
            self.record.append(request.to_frame())

    def _refuse(self, fault: Fault, now: float) -> None:
        if self._names.get(fault.raw[0]) in self.chip.illegal:  # whatever its words are
            self._reject(fault.raw, now)
        else:
            super()._refuse(fault, now)

    def _unfit(self, packet: bytes) -> bytes:
        """The right checksum: the chip set drops the value without a word."""
        total = packet[0] + sum(packet[1::2]) * 256 + sum(packet[2::2])
        return (total & 0xFFFF).to_bytes(2, "big")
