"""Inputs and outputs of a virtual node: 24 of each, and the delays from input 1 to output 1 (section 7.1).

Bit 0 is number 1. Assumptions where the document is silent:

* Output 1 follows input 1: T1 after it went high, T2 after it went low. Only the last edge counts: a pulse
  shorter than T1 never reaches output 1. The delay in force when the edge comes holds for it.
* A master may write output 1 as well. The last change wins; a write does not cancel a pending change.
* A reset clears the outputs and cancels that change. The inputs are wires and keep their levels.
"""

from __future__ import annotations

from qlinkgen.protocols.qlink.arguments import whole
from qlinkgen.protocols.qlink.facts import LINES

#: Bytes of the inputs, and of the outputs.
_BYTES = (LINES.bit_length() + 7) // 8


class IoImage:
    """24 inputs and 24 outputs. Time is an argument.

    Attributes:
        outputs: bit 0 is output 1.
    """

    def __init__(self) -> None:
        self.outputs = 0
        self._inputs = 0
        self._change: tuple[float, int] | None = None

    @property
    def inputs(self) -> int:
        """Bit 0 is input 1."""
        return self._inputs

    def power_up(self, value: int) -> None:
        """Set the initial levels of the inputs, without an edge.

        Raises:
            ValueError: `value` is out of range.
        """
        self._inputs = whole("inputs", value, 0, LINES)

    def set_inputs(self, value: int, now: float, t1: float, t2: float) -> None:
        """Set the levels of the inputs.

        Args:
            value: bit 0 is input 1.
            now: when, in seconds.
            t1: seconds until output 1 goes high after input 1 went high.
            t2: seconds until output 1 goes low after input 1 went low.

        Raises:
            ValueError: `value` is out of range.
        """
        level = whole("inputs", value, 0, LINES) & 1
        self.advance(now)
        if level != self._inputs & 1:
            self._change = (now + (t1 if level else t2), level)
        self._inputs = value
        self.advance(now)

    def advance(self, now: float) -> None:
        """Apply a due change of output 1."""
        if self._change is not None and now >= self._change[0]:
            self.outputs = self.outputs & ~1 | self._change[1]
            self._change = None

    def write(self, value: int, mask: int = LINES) -> None:
        """Set the outputs under the mask; the others keep their levels."""
        self.outputs = (self.outputs & ~mask | value & mask) & LINES

    def clear(self) -> None:
        """Clear the outputs, and cancel a pending change of output 1."""
        self.outputs = 0
        self._change = None

    def read_bytes(self, size: int, offset: int) -> bytes:
        """Return bytes of the inputs, byte 0 first; 0 for missing ones (docs/qlink.md, 14)."""
        return self._inputs.to_bytes(_BYTES, "little")[offset : offset + size].ljust(size, b"\0")

    def write_bytes(self, offset: int, data: bytes) -> None:
        """Write bytes of the outputs, byte 0 first; missing ones are ignored."""
        kept = data[: max(0, _BYTES - offset)]
        shift = 8 * offset
        self.write(int.from_bytes(kept, "little") << shift, ((1 << 8 * len(kept)) - 1) << shift)
