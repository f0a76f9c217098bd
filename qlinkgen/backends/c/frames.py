"""The frame of a protocol as one object, whatever its kind: templates, values, calls."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from qlinkgen.backends.c import crc, delimited_view, framing
from qlinkgen.backends.c.delimited import DelimitedWriter
from qlinkgen.backends.c.layout import Layouts
from qlinkgen.backends.c.marked import marked_view, shapes
from qlinkgen.backends.c.names import Names
from qlinkgen.backends.c.packet import packet_from_frame, packet_view, sizes_by_value
from qlinkgen.model.frame import DelimitedFrame, MarkedFrame, PacketFrame
from qlinkgen.model.message import Direction, Message
from qlinkgen.model.protocol import Protocol


@dataclass
class FrameSection:
    """What the header places for its frame."""

    protocol: Protocol
    view: dict[str, Any]
    check: dict[str, Any] | None
    templates: tuple[str, ...]
    receivers: tuple[str, ...]
    #: There is a receiver for slaves alone (packets: an answer cannot be told from the next one).
    slave_only: bool = False
    has_checks: bool = True

    @property
    def rescans(self) -> bool:
        """One byte can bring several events."""
        return "receiver_rescan" in self.receivers

    @property
    def needs_ids(self) -> bool:
        """Receiving a frame needs to know the messages, so their ids stand in front of them."""
        view = self.view
        early = view["reports_runs"] or view["needs_extent"]
        return early or not isinstance(self.protocol.frame, DelimitedFrame)

    def groups(
        self, names: Names, received: list[tuple[Direction, tuple[Message, ...]]]
    ) -> list[dict[str, Any]]:
        """What a receiver knows of the messages, for each direction."""
        frame, upper = self.protocol.frame, names.upper
        if isinstance(frame, PacketFrame):
            return [group for d, m in received if d == "request" for group in sizes_by_value(names, m)]
        if not isinstance(frame, MarkedFrame):
            return []
        return [
            {"direction": f"{upper}_{d.upper()}", "messages": shapes(names, m, frame)} for d, m in received
        ]

    def to_frame(self, names: Names, address: framing.Address, message: Message) -> dict[str, Any]:
        """The function that makes a whole frame."""
        found = framing.to_frame(self.protocol, names, address, message)
        return {
            **found,
            "parameters": found["parameters"].replace("{sum_type}", self.view.get("sum_type", "")),
        }

    def from_frame(self, names: Names, message: Message) -> dict[str, Any] | None:
        """The function that takes a whole frame apart, where the frame alone does not tell its message."""
        if not self.slave_only or message.direction != "response":
            return None
        return packet_from_frame(names, message, self.view)

    def left_out(self, role: str) -> str:
        """The direction that a role never receives."""
        return {"slave": "response", "master": "request"}[role]

    def dispatch_view(self, protocol: Protocol, upper: str) -> dict[str, Any]:
        """What the dispatch template needs of the frame."""
        name, ring = self.view["address"], protocol.directions == ("message",)
        return {
            "is_broadcast": f"frame->{name} == {upper}_BROADCAST"
            if protocol.bus.broadcast is not None
            else "false",
            "slave_arguments": f"slave->{name}, " if name else self.view.get("slave_arguments", ""),
            "unknown_answer": self.view.get("unknown_answer", "0"),
            "listener": "listener" if ring else "master",
            "listener_title": "Listener" if ring else "Master",
            "listener_address": f", {self.view['address_type']} {name}" if name else "",
            "listener_argument": f", frame->{name}" if name else "",
        }

    def slave_entry(self, entry: dict[str, Any], upper: str) -> dict[str, Any]:
        """Conditions of one command of a slave."""
        has_address = bool(self.view["address"])
        target = "&request, " if entry["has_struct"] else ""
        call = f"{entry['function']}_decode({target}frame->payload, frame->size)"
        reject = self.view.get("reject") if entry["answered"] else ""
        size = f"{entry['answer_constant']}_MIN_SIZE"
        return {
            "unsupported": f"{reject}({size}, wire, capacity)" if reject else "0",
            "writes": entry["answered"],
            "own": has_address and entry["refuses_broadcast"],
            "broadcast_only": has_address and entry["broadcast_only"],
            "right": f"{call} == {upper}_OK" if entry["has_bytes"] else "frame->size == 0U",
            "unless_silent": " && !slave->broadcast" if has_address and entry["silent_broadcast"] else "",
        }

    def slave_groups(self, entries: list[dict[str, Any]], prefix: str) -> list[dict[str, Any]]:
        """Commands by whom they may go to; the last group passes on what it does not have."""
        own = [entry for entry in entries if entry["own"]]
        others = [entry for entry in entries if not entry["own"]]
        unknown = self.view.get("unknown_answer", "0")
        if not own:
            writes = any(entry["writes"] for entry in entries)
            group = {"name": "any", "text": "All requests.", "entries": entries, "otherwise": unknown}
            return [{**group, "writes": writes}]
        call = f"{prefix}_handle_own_(slave, frame, wire, capacity)"
        first = {"name": "own", "text": "Requests that go to one node.", "entries": own, "otherwise": unknown}
        first["writes"] = any(entry["writes"] for entry in own)
        rest = "Requests that all nodes may get; the others must not be broadcast."
        second = {"name": "any", "text": rest, "entries": others}
        return [first, {**second, "writes": True, "otherwise": f"slave->broadcast ? {unknown} : {call}"}]


def frame_section(protocol: Protocol, layouts: Layouts) -> FrameSection:
    """Choose by the kind of frame."""
    frame = protocol.frame
    if isinstance(frame, DelimitedFrame):
        return _delimited(protocol, frame, layouts)
    check = crc.render(frame.checksum)
    if isinstance(frame, MarkedFrame):
        view = marked_view(protocol, frame)
        return FrameSection(protocol, view, check, ("place", "marked", "seal"), ("receiver_marked",))
    view = packet_view(protocol, frame)
    return FrameSection(protocol, view, None, ("packet",), ("receiver_packet",), slave_only=True)


def _delimited(protocol: Protocol, frame: DelimitedFrame, layouts: Layouts) -> FrameSection:
    writer = DelimitedWriter(protocol, frame, layouts)
    view = delimited_view.render(protocol, frame, writer)
    part = frame.part("checksum")
    check = crc.render(part.checksum if part else None)
    own = "frame_stuffed" if writer.stuffed_whole else "frame_plain"
    receiver = "receiver_streamed" if writer.streamed else "receiver_rescan"
    return FrameSection(protocol, view, check, ("place", own, "seal", "frame_public"), (receiver,))
