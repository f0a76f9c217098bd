"""Errors of a ring node; port and node remain usable."""

from __future__ import annotations

from qlinkgen.errors import LinkError


class NoRoom(LinkError, TimeoutError):
    """The transmit buffer stayed full: NETSTAT bit 0 is set, nothing was sent."""


class NothingCame(LinkError, TimeoutError):
    """A wait timed out."""
