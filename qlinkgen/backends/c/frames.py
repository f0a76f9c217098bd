"""The frame of a protocol as one object: templates, values, calls, chosen by its receiver."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, assert_never

from qlinkgen.backends.c import crc, framing
from qlinkgen.backends.c.layout import Layouts
from qlinkgen.backends.c.marked import marked_view, shapes
from qlinkgen.backends.c.names import Names
from qlinkgen.backends.c.packet import packet_from_frame, packet_to_frame, packet_view, sizes_by_value
from qlinkgen.backends.c.views import judgement, parts_view
from qlinkgen.model.message import Direction
from qlinkgen.model.protocol import Protocol
from qlinkgen.plan.framing import Hunt, InStep, Marks, Rescan
from qlinkgen.plan.transparency import FrameStuffing
from qlinkgen.plan.tree import MessagePlan, Plan

Heard = Sequence[tuple[Direction, Sequence[MessagePlan]]]


@dataclass
class FrameSection:
    """What the header places for its frame."""

    plan: Plan
    view: dict[str, Any]
    check: dict[str, Any] | None
    templates: tuple[str, ...]
    receiver: str

    @property
    def rescans(self) -> bool:
        """One byte can bring several events."""
        return self.receiver == "receiver_rescan"

    @property
    def slave_only(self) -> bool:
        """There is a receiver for slaves alone: only its request tells an answer from the next one."""
        return self.plan.frame.needs_request

    @property
    def needs_ids(self) -> bool:
        """Receiving a frame needs to know the messages, so their ids come before it."""
        by_message = self.view["bare"] or self.view["needs_extent"]
        return by_message or isinstance(self.plan.frame.receiver, Marks | InStep)

    def heard(self) -> Heard:
        """Messages that are decoded, for each direction that a receiver can wait for."""
        directions = (d for d in self.plan.protocol.directions if d in self.plan.heard)
        found = [(direction, self.plan.received(direction)) for direction in directions]
        return [(direction, messages) for direction, messages in found if messages]

    def known(self, names: Names) -> dict[str, Any]:
        """What a receiver knows of the messages."""
        heard, receiver = self.heard(), self.plan.frame.receiver
        match receiver:
            case Hunt():
                return {}
            case Rescan():
                return {"judgement": judgement(self.plan, [direction for direction, _ in heard])}
            case Marks():
                return {
                    "shapes": [
                        {
                            "direction": f"{names.upper}_{direction.upper()}",
                            "messages": shapes(names, messages),
                        }
                        for direction, messages in heard
                    ]
                }
            case InStep():
                requests = [message for d, messages in heard if d == "request" for message in messages]
                return {"shapes": sizes_by_value(names, requests)}
            case _:
                assert_never(receiver)

    def to_frame(self, names: Names, address: framing.Address, message: MessagePlan) -> dict[str, Any]:
        """The function that makes a whole frame."""
        if self.slave_only:
            return packet_to_frame(names, message, self.view)
        return framing.to_frame(self.plan.frame, names, address, message)

    def from_frame(self, names: Names, message: MessagePlan) -> dict[str, Any] | None:
        """The function that takes a whole frame apart, where the frame alone does not tell its message."""
        if not self.slave_only or message.direction != "response":
            return None
        return packet_from_frame(names, message, self.view)

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


def frame_section(plan: Plan, layouts: Layouts) -> FrameSection:
    """Choose by the way frames are received."""
    receiver, check = plan.frame.receiver, plan.frame.check
    value = crc.render(check.value if check else None)
    whole = isinstance(plan.frame.transparency, FrameStuffing)
    parts = ("place", "frame_stuffed" if whole else "frame_plain", "seal", "frame_public")
    match receiver:
        case Hunt():
            return FrameSection(plan, parts_view(plan, layouts), value, parts, "receiver_streamed")
        case Rescan():
            return FrameSection(plan, parts_view(plan, layouts), value, parts, "receiver_rescan")
        case Marks():
            templates = ("place", "marked", "seal")
            return FrameSection(plan, marked_view(plan), value, templates, "receiver_marked")
        case InStep():
            return FrameSection(plan, packet_view(plan), None, ("packet",), "receiver_packet")
        case _:
            assert_never(receiver)
