"""Warnings of unconfirmed commands."""

from __future__ import annotations

import warnings

from qlinkgen.codecs import mc1231a
from qlinkgen.link.codec import Framed


class UnconfirmedCommand(UserWarning):
    """Use of a command that no source confirms: verify it on the chip."""


class Usage:
    """Remembers the unconfirmed commands used, so that each is warned of once."""

    def __init__(self) -> None:
        self._weak: dict[type[Framed], mc1231a.Command] = {
            each.request: each for each in mc1231a.COMMANDS.values() if not each.confirmed
        }

    def note(self, request: Framed) -> None:
        """Warn at the first use of such a command, with the location of the user's call."""
        if self._weak:
            command = self._weak.pop(type(request), None)
            if command is not None:
                warnings.warn(
                    f"{command.name} (code 0x{command.id:02X}) is unconfirmed: its code, words or direction "
                    "are not confirmed by a source; verify it on the chip",
                    UnconfirmedCommand,
                    stacklevel=4,
                )
