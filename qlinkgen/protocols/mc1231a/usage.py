"""How a host is used: which checksums it reads, and which weak commands somebody has sent."""

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

#: Whose checksum is read: that of every command, of none, or of those that are named.
Checksum = Literal["always", "never"] | Collection[str]


class UnconfirmedCommand(UserWarning):
    """A command is used of which no source was seen: check at the chip before trusting it."""


class Usage:
    """Remembers which commands of weak sources were used, so that each is warned of once."""

    def __init__(self) -> None:
        self._weak = {each.request: each for each in mc1231a.COMMANDS.values() if not each.confirmed}

    def note(self, request: mc1231a.Message) -> None:
        """Warn if this is the first use of such a command; the caller of our caller's caller is shown."""
        if self._weak:
            command = self._weak.pop(type(request), None)
            if command is not None:
                warnings.warn(
                    f"{command.name} (code 0x{command.id:02X}) is unconfirmed: its code, words or direction "
                    "were not seen in a source; check at the chip before trusting it",
                    UnconfirmedCommand,
                    stacklevel=4,
                )


def packet(request: mc1231a.Message, context: mc1231a.Request | None) -> Packet:
    """Return a request as an engine takes it. Raises TypeError for a response."""
    if not isinstance(request, mc1231a.Request):
        raise TypeError(f"{type(request).__name__} was given; a request of this protocol is needed")
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
            raise ValueError(f'checksum: {checksum!r} was given; give "always", "never" or names of commands')
        return mc1231a.COMMANDS if checksum == "always" else ()
    for name in checksum:
        if name not in mc1231a.COMMANDS:
            close = difflib.get_close_matches(name, mc1231a.COMMANDS, 1)
            hint = f"did you mean {close[0]}?" if close else "see `qlinkgen show mc1231a`"
            raise ValueError(f"checksum: there is no command {name!r}; {hint}")
    return frozenset(checksum)
