"""The text display of a membrane keypad.

The document does not describe it. It supports the characters that its examples use:

=================  ====================================================================================
characters         effect
=================  ====================================================================================
12                 clears the display; the cursor goes home
14                 the cursor goes home, to the upper left
20                 the cursor becomes invisible
27, 72, p          the cursor goes to place p: row p // columns, column p % columns
13 and 10          start of the row, and next row
32 to 126          is written at the cursor, which advances; after the last place it wraps to the first
=================  ====================================================================================

Other characters are ignored and counted. A sequence may be spread over messages.
"""

from __future__ import annotations

ROWS, COLUMNS = 4, 20
_CLEAR, _HOME, _HIDE, _ESCAPE = "\x0c", "\x0e", "\x14", "\x1b"


class Display:
    """The display of a keypad.

    Attributes:
        rows: number of rows.
        columns: characters in a row.
        place: position of the cursor, 0 being the upper left.
        cursor_visible: the cursor is visible.
        ignored: number of ignored characters.
    """

    def __init__(self, rows: int = ROWS, columns: int = COLUMNS) -> None:
        """Make an empty display.

        Raises:
            ValueError: it has no places, or more than a seven-bit character can address.
        """
        if rows < 1 or columns < 1 or rows * columns > 128:
            raise ValueError(f"rows, columns: {rows} and {columns} were given; a display has 1 to 128 places")
        self.rows = rows
        self.columns = columns
        self.reset()

    def reset(self) -> None:
        """Clear everything, as when the keypad is switched on."""
        self._cells = [" "] * (self.rows * self.columns)
        self._escape = ""  # an incomplete sequence
        self.place = 0
        self.cursor_visible = True
        self.ignored = 0

    def feed(self, text: str) -> None:
        """Take characters."""
        for character in text:
            if self._escape:
                self._sequence(character)
            elif " " <= character <= "~":
                self._cells[self.place] = character
                self._move(self.place + 1)
            else:
                self._control(character)

    def _control(self, character: str) -> None:
        if character == _CLEAR:
            self._cells = [" "] * len(self._cells)
            self.place = 0
        elif character == _HOME:
            self.place = 0
        elif character == _HIDE:
            self.cursor_visible = False
        elif character == _ESCAPE:
            self._escape = character
        elif character == "\r":
            self.place -= self.place % self.columns
        elif character == "\n":
            self._move(self.place + self.columns)
        else:
            self.ignored += 1

    def _sequence(self, character: str) -> None:
        if len(self._escape) == 1 and character == "H":
            self._escape += character
            return
        if len(self._escape) == 2 and ord(character) < len(self._cells):
            self.place = ord(character)
        else:
            self.ignored += 1
        self._escape = ""

    def _move(self, place: int) -> None:
        self.place = place % len(self._cells)

    @property
    def lines(self) -> list[str]:
        """Rows from the top, without trailing blanks."""
        cells = "".join(self._cells)
        return [cells[at : at + self.columns].rstrip() for at in range(0, len(cells), self.columns)]

    @property
    def text(self) -> str:
        """All rows, one per line."""
        return "\n".join(self.lines)
