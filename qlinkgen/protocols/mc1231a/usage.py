"""Usage of a host: selection of checksums, and warnings of unconfirmed commands."""

from __future__ import annotations

import difflib
import warnings
from collections.abc import Collection
from typing import Literal

from qlinkgen.codecs import mc1231a
from qlinkgen.link.host import HostEngine
from qlinkgen.link.host_timing import HostTiming
from qlinkgen.link.transaction import Packet
from qlinkgen.protocols.mc1231a.facts import RULES
from qlinkgen.transport.conversation import host_slack
from qlinkgen.transport.port import Ability, Port

#: Commands whose checksum is read: all, none, or those listed.
Checksum = Literal["always", "never"] | Collection[str]


class UnconfirmedCommand(UserWarning):
    """Use of a command that no source confirms: verify it on the chip."""


class Usage:
    """Remembers the unconfirmed commands used, so that each is warned of once."""

    def __init__(self) -> None:
        self._weak = {each.request: each for each in mc1231a.COMMANDS.values() if not each.confirmed}

    def note(self, request: mc1231a.Message) -> None:
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


def packet(request: mc1231a.Message, context: mc1231a.Request | None) -> Packet:
    """Return the packet of a request. Raises TypeError for a response."""
    if not isinstance(request, mc1231a.Request):
        raise TypeError(f"{type(request).__name__} is not a request of this protocol")
    return Packet(request, context)


def make_engine(
    port: Port, *, checksum: Checksum, attempts: int, slack: float | None, forgets: float
) -> HostEngine:
    """Return the engine of a host on a port."""
    timing = HostTiming.for_host(
        mc1231a,
        baud=port.baud,
        host_slack=host_slack(port) if slack is None else slack,
        paced=port.capabilities.paced is Ability.YES,
        attempts=attempts,
        forgets=forgets,
    )
    return HostEngine(mc1231a, timing, RULES, checked=_checked(checksum))


def _checked(checksum: Checksum) -> Collection[str]:
    """Return the names of the commands whose checksum is read."""
    if isinstance(checksum, str):
        if checksum not in {"always", "never"}:
            raise ValueError(f"checksum must be 'always', 'never' or names of commands, not {checksum!r}")
        return mc1231a.COMMANDS if checksum == "always" else ()
    for name in checksum:
        if name not in mc1231a.COMMANDS:
            close = difflib.get_close_matches(name, mc1231a.COMMANDS, 1)
            hint = f"did you mean {close[0]}?" if close else "see `qlinkgen show mc1231a`"
            raise ValueError(f"checksum: unknown command {name!r}; {hint}")
    return frozenset(checksum)
