"""Frames with parts that only some of them have: values of the header decide."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import NamedTuple

from construct import Construct, ValidationError

from ._fields import Message
from ._frames import Cell, Check, DelimitedFrame, Length, Part, _Wire


class Present(NamedTuple):
    """Parts that a frame has where all tests of its header hold; ``initial`` are their bytes elsewhere.

    A test has the name of a part, the first of its bits, their mask, ranges of numbers, and whether the bits
    must be outside of them.
    """

    names: Sequence[str]
    initial: Sequence[bytes]
    tests: Sequence[tuple[str, int, int, Sequence[tuple[int, int]], bool]]

    def holds(
        self, cells: Mapping[str, bytes], integers: Mapping[str, Construct]
    ) -> bool:
        """Whether a frame with these parts in its header has them."""
        return all(
            name in cells
            and any(
                first <= integers[name].parse(cells[name]) >> shift & mask <= last
                for first, last in ranges
            )
            != negated
            for name, shift, mask, ranges, negated in self.tests
        )


class ConditionalFrame(DelimitedFrame):
    """A frame with parts before the payload, or at its end, that only some frames have."""

    def __init__(
        self,
        parts: Sequence[Part],
        messages: Sequence[Message],
        *,
        present: Sequence[Present],
        address: str = "",
        bare: bool = False,
    ) -> None:
        super().__init__(parts, messages, address=address, bare=bare)
        self.present = present
        self.lengths = {part.name for part in parts if isinstance(part, Length)}
        self.integers = {
            part.name: part.integer for part in parts if isinstance(part, Cell | Length)
        }

    def _header(
        self, part: Part, cells: Mapping[str, bytes], numbers: dict[type, int]
    ) -> None:
        if part.name not in self.lengths or part.name not in self._absent(cells):
            super()._header(part, cells, numbers)

    def _absent(self, cells: Mapping[str, bytes]) -> dict[str, bytes]:
        """The parts that a frame with these does not have, and their bytes nevertheless."""
        return {
            name: initial
            for each in self.present
            if not each.holds(cells, self.integers)
            for name, initial in zip(each.names, each.initial, strict=True)
        }

    def _settled(self, cells: dict[str, bytes]) -> dict[str, bytes]:
        absent = self._absent(cells)
        checks = {check.name for check in self.checks}
        for name, initial in absent.items():
            if cells[name] != initial and name not in {*self.lengths, *checks}:
                raise ValidationError(f"a frame with these values does not have {name}")
        return cells | dict.fromkeys(absent, b"")

    def _due(self, cells: Mapping[str, bytes]) -> Sequence[Check]:
        absent = self._absent(cells)
        return [check for check in self.checks if check.name not in absent]

    def _taken(self, source: _Wire, part: Part, cells: Mapping[str, bytes]) -> bytes:
        held = any(part.name in each.names for each in self.present)
        absent = self._absent(cells) if held else {}
        return absent.get(part.name) or super()._taken(source, part, cells)

    def _compare(
        self, check: Check, cells: Mapping[str, bytes], request: bytes
    ) -> None:
        sent = {**cells, **dict.fromkeys(self._absent(cells), b"")}
        super()._compare(check, sent, request)
