"""Second pass, addresses: checks the nodes of the bus against the address of the frame."""

from __future__ import annotations

from typing import assert_never, get_args

from qlinkgen.model.frame import (
    DelimitedFrame,
    Direction,
    Frame,
    FrameKinds,
    MarkedFrame,
    PacketFrame,
    PartBits,
)
from qlinkgen.model.transaction import Bus
from qlinkgen.schema.report import Reporter

_NEEDS = (("bus",), ("frame",))


def check_addresses(frame: Frame | None, bus: Bus, master: int | None, report: Reporter) -> None:
    """Check nodes, broadcast address and number of the master against the frame and each other."""
    if frame is None:
        return
    parties = _parties(frame)
    if master is not None and not any(each.party == "master" for each in parties):
        what = "'master' has no effect: no part of the frame has its number"
        hint = "remove it, or add parts with role: destination and role: source"
        report.error("bad-party", ("bus", "master"), what, hint, of_key=True, needs=_NEEDS)
    highest = _highest(frame)
    on_link = [(1 << each.bits) - 1 for each in parties if each.party != "master"]
    if highest is None and on_link:
        highest = min(on_link)
    elif highest is not None and bus.nodes is None:
        what = "the frame has an address, but the bus has no nodes"
        report.error("bad-addressing", ("bus",), what, "add nodes: 1..16", of_key=True, needs=_NEEDS)
        return
    if highest is None or bus.nodes is None:
        _check_unused(bus, report)
        return
    if bus.nodes[1] > highest:
        what = f"node {bus.nodes[1]} does not fit the frame's address"
        report.error("address-does-not-fit", ("bus", "nodes"), what, f"use 0..{highest}", needs=_NEEDS)
    if isinstance(frame, MarkedFrame) and bus.nodes[0] == 0:
        what = "node address 0 is not allowed in a marked frame"
        report.error("bad-addressing", ("bus", "nodes"), what, "begin the nodes at 1", needs=_NEEDS)
    called = frame.towards("request").address if isinstance(frame, DelimitedFrame) else None
    _check_broadcast(bus, bus.nodes, called.most if called else highest, report)


def _highest(frame: Frame) -> int | None:
    """Highest address, None if the frame has no address."""
    match frame:
        case MarkedFrame():
            return frame.address_bits.mask
        case DelimitedFrame():
            found = [frame.towards(each).address for each in get_args(Direction)]
            return min((each.most for each in found if each), default=None)
        case FrameKinds():
            return frame.address.most if frame.address else None
        case PacketFrame():
            return None
        case _:
            assert_never(frame)


def _parties(frame: Frame) -> list[PartBits]:
    """The numbers of parties among the values of a frame."""
    if not isinstance(frame, DelimitedFrame):
        return []
    return [bits for part in frame.parts for bits in part.bits if bits.party]


def _check_unused(bus: Bus, report: Reporter) -> None:
    for key, value in (("nodes", bus.nodes), ("broadcast", bus.broadcast)):
        if value is not None:
            what = f"'{key}' has no effect: the frame has no address"
            hint = "remove it, or add a part with role: address"
            report.error("bad-addressing", ("bus", key), what, hint, of_key=True, needs=_NEEDS)


def _check_broadcast(bus: Bus, nodes: tuple[int, int], highest: int, report: Reporter) -> None:
    if bus.broadcast is None:
        return
    if bus.broadcast > highest:
        what = f"broadcast address {bus.broadcast} does not fit the frame's address"
        report.error("address-does-not-fit", ("bus", "broadcast"), what, f"use 0..{highest}", needs=_NEEDS)
    if nodes[0] <= bus.broadcast <= nodes[1]:
        what = f"broadcast address {bus.broadcast} is also the address of a node"
        hint = f"use one outside {nodes[0]}..{nodes[1]}"
        report.error("bad-addressing", ("bus", "broadcast"), what, hint, needs=_NEEDS)
