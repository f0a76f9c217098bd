"""The program loader of a virtual node (section 7.6).

What the document leaves open, and what this node does:

* A request with counter 0 and no program data opens, at any time: a load that was under way is begun again.
  So does a request with no data at all (settled question 6); the codec makes no difference between the two.
* A counter that is neither the next nor that of the last piece is not acknowledged, and neither is a piece
  before an opening: an acknowledged piece is a stored piece.
* A piece with the counter of the last is a repeat: acknowledged, and not looked at.
* Text that is no Intel HEX is not acknowledged, nor is anything new after it until the next opening: the
  protocol has no way to refuse, and a master must not believe in a program that the node does not have.
  `fault` says what was wrong. A store made with `check=False` acknowledges all the same and keeps the text.
* The program is there as soon as its end record is; the opening of another load forgets it.
"""

from __future__ import annotations

from qlinkgen.protocols.qlink.hex_image import BrokenRecord, HexImage, HexReader
from qlinkgen.protocols.qlink.statistics import NodeStatistics


class ProgramStore:
    """Takes a program in pieces and rebuilds its image.

    Attributes:
        loading: a load has been opened and its end record has not come.
        image: the program, None while there is none.
        fault: why the load was given up, empty while all is well.
        text: the pieces stored since the opening, joined.
    """

    def __init__(self, statistics: NodeStatistics, *, check: bool = True) -> None:
        """Begin empty; what happens is counted in `statistics`."""
        self.loading = False
        self.image: HexImage | None = None
        self.fault = ""
        self.text = bytearray()
        self._check = check
        self._statistics = statistics
        self._reader: HexReader | None = None
        self._last: int | None = None  # counter of the piece stored last

    def take(self, counter: int, data: bytes) -> bool:
        """Take a request. Returns whether to acknowledge it."""
        if counter == 0 and not data:
            self._open()
            return True
        if self._reader is None:
            return self._refuse()
        if counter == self._last:
            self._statistics.repeated_pieces += 1
            return True
        following = 0 if self._last is None else (self._last + 1) % 256
        if counter != following or not self._read(data):
            return self._refuse()
        self._store(counter, data)
        return True

    def _open(self) -> None:
        self._statistics.program_loads += 1
        self.loading = True
        self.image = None
        self.fault = ""
        self.text.clear()
        self._reader = HexReader()
        self._last = None

    def _read(self, data: bytes) -> bool:
        """Read text on, unless it is known as broken. Returns whether the piece is to be kept."""
        if self._reader is None or self.fault:
            return not self._check
        try:
            self._reader.feed(data)
        except BrokenRecord as fault:
            self.fault = str(fault)
            self.image = None
            self.loading = False
            return not self._check
        return True

    def _store(self, counter: int, data: bytes) -> None:
        self._statistics.program_pieces += 1
        self.text += data
        self._last = counter
        if self._reader is not None and self._reader.segments is not None and not self.fault:
            # Line ends behind the end record may come in one more piece: the image is made with each.
            self.image = HexImage(bytes(self.text), self._reader.segments, self._reader.entry)
            self.loading = False

    def _refuse(self) -> bool:
        self._statistics.refused_pieces += 1
        return False
