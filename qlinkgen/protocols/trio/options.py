"""Keyword arguments of ring nodes, passed to `RingNode` and to the clients."""

from __future__ import annotations

from qlinkgen.bus.options import RingEngineOptions
from qlinkgen.link.ring import RingCodec
from qlinkgen.transport.ring import OnEvent


class RingOptions(RingEngineOptions, total=False):
    """Options of `RingNode` except its speed."""

    codec: RingCodec


class NodeOptions(RingOptions, total=False):
    """Options of `RingNode`; `baud` is by default that of the port."""

    baud: int | None


class KeypadOptions(NodeOptions, total=False):
    """Options of a keypad, including rows and columns of its display."""

    rows: int
    columns: int


class ClientOptions(RingOptions, total=False):
    """Options of `open` of a passive node."""

    on_event: OnEvent | None


class CoordinatorClientOptions(ClientOptions, total=False):
    """Options of `open` of a Motion Coordinator."""

    tx_timeout: float


class KeypadClientOptions(ClientOptions, total=False):
    """Options of `open` of a keypad."""

    rows: int
    columns: int
