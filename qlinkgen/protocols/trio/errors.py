"""Errors of a node of the ring; the port stays in order, and the node goes on."""

from __future__ import annotations

from qlinkgen.errors import LinkError


class NoRoom(LinkError, TimeoutError):
    """A message found no room in the transmit buffer in time: NETSTAT bit 0 is set, nothing was sent."""


class NothingCame(LinkError, TimeoutError):
    """What was waited for did not come in time."""
