"""The program loader of a virtual node (section 7.6).

Assumptions where the document is silent:

* A request with counter 0 and no program data opens a load at any time, and restarts a running one.
  So does an empty request (docs/qlink.md, 6); the codec does not distinguish them.
* A counter other than the next or that of the last piece is not acknowledged, nor is a piece before an
  opening: an acknowledged piece is a stored piece.
* A piece with the counter of the last is a repeat: acknowledged without checking its data.
* Text that is not Intel HEX is not acknowledged, nor are new pieces after it until the next opening: the
  protocol has no refusal, and a master must not assume a program that the node does not have. `fault` has the
  reason. A store made with `check=False` acknowledges it and keeps the text.
* The program is available once its end record was received; the opening of another load discards it.
"""

from __future__ import annotations

from qlinkgen.protocols.hex_image import BrokenRecord, HexImage, HexReader
from qlinkgen.protocols.qlink.facts import PIECES
from qlinkgen.protocols.qlink.statistics import NodeStatistics


class ProgramStore:
    """Takes a program in pieces and rebuilds its image.

    Attributes:
        loading: a load is open and its end record was not received.
        image: the program, None without one.
        fault: why the load failed, empty if it did not.
        text: the pieces stored since the opening, joined.
    """

    def __init__(self, statistics: NodeStatistics, *, check: bool = True) -> None:
        """Make an empty store that counts in `statistics`."""
        self.loading = False
        self.image: HexImage | None = None
        self.fault = ""
        self.text = bytearray()
        self._check = check
        self._statistics = statistics
        self._reader: HexReader | None = None
        self._last: int | None = None  # counter of the piece stored last

    def take(self, counter: int, data: bytes) -> bool:
        """Process a request. Return whether to acknowledge it."""
        if counter == 0 and not data:
            self._open()
            return True
        if self._reader is None:
            return self._refuse()
        if counter == self._last:
            self._statistics.repeated_pieces += 1
            return True
        following = 0 if self._last is None else PIECES.after(self._last)
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
        """Read text, unless it is known to be broken. Return whether to keep the piece."""
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
            # Line ends after the end record may arrive in one more piece: the image is made with each.
            self.image = HexImage(bytes(self.text), self._reader.segments, self._reader.entry)
            self.loading = False

    def _refuse(self) -> bool:
        self._statistics.refused_pieces += 1
        return False
