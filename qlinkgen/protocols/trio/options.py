"""What the nodes of a ring may be given, by name: all of it is handed on to `RingNode` and to the clients."""

from __future__ import annotations

from typing import TypedDict

from qlinkgen.link.ring import RingCodec
from qlinkgen.transport.ring import OnEvent


class RingOptions(TypedDict, total=False):
    """Options of `RingNode` beside its speed."""

    codec: RingCodec
    cut_through: bool
    patience: float
    room: int


class NodeOptions(RingOptions, total=False):
    """Options of `RingNode`; `baud` is that of the port unless given."""

    baud: int | None


class KeypadOptions(NodeOptions, total=False):
    """Options of a keypad: rows and columns of its display too."""

    rows: int
    columns: int


class FaceOptions(RingOptions, total=False):
    """What the client of a passive node is opened with."""

    on_event: OnEvent | None


class CoordinatorFaceOptions(FaceOptions, total=False):
    """What the client of a Motion Coordinator is opened with."""

    tx_timeout: float


class KeypadFaceOptions(FaceOptions, total=False):
    """What the client of a keypad is opened with."""

    rows: int
    columns: int
