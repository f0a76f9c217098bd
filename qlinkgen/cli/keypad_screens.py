"""Shows the displays of keypads: redrawn on a terminal, otherwise as lines of JSON."""

from __future__ import annotations

import json
from collections.abc import Mapping

import click

from qlinkgen.protocols.trio.display import Display


class JsonScreens:
    """Prints a display as one JSON object when it has changed, and then stayed the same for a look."""

    def __init__(self, displays: Mapping[int, Display]) -> None:
        """Show the displays of keypads by address."""
        self._displays = displays
        self._shown = {number: [""] * each.rows for number, each in displays.items()}
        self._seen = dict(self._shown)

    def show(self, at: float, *, last: bool = False) -> None:
        """Look at the displays; at the last look, a display that is still changing is printed as well."""
        for number, display in self._displays.items():
            lines = display.lines
            settled = last or lines == self._seen[number]
            self._seen[number] = lines
            if settled and lines != self._shown[number]:
                self._shown[number] = lines
                click.echo(json.dumps({"at": round(at, 3), "address": number, "display": lines}))


class DrawnScreens:
    """Draws the displays on a terminal, over their last state.

    Attributes:
        chosen: address of the keypad that the keyboard belongs to.
    """

    def __init__(self, displays: Mapping[int, Display], chosen: int, keys: str) -> None:
        """Draw the displays of keypads by address, and a line that explains the keys."""
        self._displays = displays
        self._keys = keys
        self._drawn: list[str] = []
        self.chosen = chosen

    def show(self, at: float, *, last: bool = False) -> None:  # noqa: ARG002  # as JsonScreens
        """Draw the displays if they have changed."""
        rows = self._rows()
        if rows != self._drawn:
            up = f"\x1b[{len(self._drawn)}A" if self._drawn else ""
            click.echo(up + "".join(f"\r{row}\x1b[K\n" for row in rows), nl=False, color=True)
            self._drawn = rows

    def leave(self) -> None:
        """Leave what is drawn as it is, because text has been printed below, and draw the next state anew."""
        self._drawn = []

    def _rows(self) -> list[str]:
        rows = []
        for number, display in self._displays.items():
            mark = ">" if number == self.chosen and len(self._displays) > 1 else " "
            edge = f"   +{'-' * display.columns}+"
            rows += [f"{mark} address {number}", edge]
            rows += [f"   |{line:{display.columns}}|" for line in display.lines]
            rows.append(edge)
        return [*rows, self._keys]
