"""The frame section of a header: templates, views and functions, selected by the kind of receiver."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import field, replace
from typing import assert_never

from qlinkgen._dataclass import dataclass
from qlinkgen.backends.c import crc, framing
from qlinkgen.backends.c.checks import condition
from qlinkgen.backends.c.kinds import KindsView, kinds_views
from qlinkgen.backends.c.layout import Layouts
from qlinkgen.backends.c.marked import PLACE, MarkedView, Shapes, marked_view, shape
from qlinkgen.backends.c.names import Names
from qlinkgen.backends.c.packet import (
    PacketView,
    Sized,
    packet_from_frame,
    packet_to_frame,
    packet_view,
    sizes_by_value,
    sum_type,
)
from qlinkgen.backends.c.views import (
    FrameView,
    OtherView,
    PartsViews,
    frame_view,
    judgement,
    own_prefix,
    parts_views,
)
from qlinkgen.model.message import Direction
from qlinkgen.model.naming import member
from qlinkgen.plan.ends import Gaps, Hunt, InStep, Marks, Receiver, Rescan
from qlinkgen.plan.tree import MessagePlan, Plan

ReceivedMessages = Sequence[tuple[Direction, Sequence[MessagePlan]]]

#: Views of the templates of one kind of frame, in addition to `FrameView`.
View = OtherView | KindsView | MarkedView | PacketView | None


@dataclass(frozen=True, slots=True)
class DispatchView:
    """Properties of the frame for the dispatch template."""

    is_broadcast: str
    slave_arguments: str
    values_right: str
    repeated: list[str]
    listener: str
    listener_address: str
    listener_argument: str


@dataclass(frozen=True)
class FrameSection:
    """The frame section of a header; ``views`` are those of its templates, by name."""

    plan: Plan
    view: FrameView
    views: Mapping[str, View]
    algorithms: Sequence[crc.CheckView]
    templates: tuple[str, ...]
    receiver: str
    #: The views of the frames of each direction, if they differ.
    ways: Mapping[str, PartsViews] = field(default_factory=dict)
    #: The views of each kind of frame, if there are several.
    kinds: Mapping[str, PartsViews] = field(default_factory=dict)

    @property
    def check(self) -> crc.CheckView | None:
        """The algorithm of the main check value, None if there is none."""
        return self.algorithms[0] if self.algorithms else None

    @property
    def rescans(self) -> bool:
        """Whether one byte can produce several events."""
        return self.receiver == "receiver_rescan"

    @property
    def gaps(self) -> bool:
        """Whether only a silence ends a frame."""
        return self.receiver == "receiver_gap"

    @property
    def pending(self) -> bool:
        """Whether a byte of a frame may be due after the receiver has found the frame complete."""
        return self.plan.frame.late_insert

    @property
    def slave_only(self) -> bool:
        """Whether only slaves have a receiver, because splitting responses needs their requests."""
        return self.plan.frame.needs_request

    @property
    def needs_ids(self) -> bool:
        """Whether receiving a frame depends on message ids, which are then defined before it."""
        by_message = self.view.checks_header or self.view.sized_by_message or self.plan.frame.seeded
        return by_message or isinstance(self.plan.frame.receiver, Marks | InStep)

    @property
    def request_sum(self) -> str:
        """C type of the contribution of a request to the check value of its response, "" if there is none."""
        check = self.plan.frame.check if self.slave_only else None
        return sum_type(check) if self.slave_only and check else ""

    @property
    def reject(self) -> str:
        """The function that makes the response to an unknown request, "" if there is none."""
        check = self.plan.frame.check if self.slave_only else None
        return f"{self.plan.protocol.name}_reject_" if check and check.rejected is not None else ""

    def received(self) -> ReceivedMessages:
        """Decoded messages for each direction of a receiver."""
        directions = (d for d in self.plan.protocol.directions if d in self.plan.received_directions)
        found = [(direction, self.plan.received(direction)) for direction in directions]
        return [(direction, messages) for direction, messages in found if messages]

    @property
    def judgement(self) -> str:
        """The expression that checks the contents of a received frame."""
        return judgement(self.plan, [direction for direction, _ in self.received()])

    def shapes(self, names: Names) -> list[Shapes]:
        """Message sizes for a receiver of marked frames."""
        return [
            Shapes(f"{names.upper}_{direction.upper()}", [shape(names, message) for message in messages])
            for direction, messages in self.received()
        ]

    def sizes(self, names: Names) -> list[Sized]:
        """Request sizes for a receiver of packets."""
        requests = [message for d, messages in self.received() if d == "request" for message in messages]
        return sizes_by_value(names, requests)

    def to_frame(self, names: Names, address: framing.Address, message: MessagePlan) -> framing.Function:
        """The function that makes a whole frame."""
        if self.slave_only:
            return packet_to_frame(names, message)
        own = own_prefix(names.prefix, message.direction if self.ways else "")
        return framing.to_frame(self.plan.frames[message.direction], names, own, address, message)

    def from_frame(self, names: Names, message: MessagePlan) -> framing.Function | None:
        """The function that decodes a whole frame, if the frame does not identify its message."""
        if not self.slave_only or message.direction != "response":
            return None
        return packet_from_frame(names, message)

    @property
    def dispatch(self) -> DispatchView:
        """Properties of the frame for the dispatch template."""
        name, protocol = self.view.address, self.plan.protocol
        broadcast = protocol.bus.broadcast is not None
        refused = list(framing.address_of(self.plan, name, "request").refused)
        values = self.plan.frame.values  # of the response
        summed = f"{protocol.name}_frame_sum(frame), " if self.request_sum else ""
        return DispatchView(
            is_broadcast=f"frame->{name} == {protocol.name.upper()}_BROADCAST" if broadcast else "false",
            slave_arguments=(f"slave->{name}, " if name else summed) + ("&slave->parts, " if values else ""),
            repeated=[member(name) for name in self.plan.protocol.repeated],
            values_right=f"!({condition(refused)})" if refused else "",
            listener="listener" if protocol.directions == ("message",) else "master",
            listener_address=f", {self.view.address_type} {name}" if name else "",
            listener_argument=f", frame->{name}" if name else "",
        )


def _common(plan: Plan, ways: Mapping[str, PartsViews]) -> PartsViews:
    """The views of what the frames of all directions have in common, such as their receiver."""
    request, response = ways["request"], ways["response"]
    view = replace(
        response.f,
        body_size=max(request.f.body_size, response.f.body_size),
        max_wire=max(request.f.max_wire, response.f.max_wire),
        has_values=bool(plan.beside),
    )
    longest = f"((receiver->direction == {plan.protocol.name.upper()}_REQUEST) ? {{}} : {{}})"
    most = [request.parts.max_frame, response.parts.max_frame]
    parts = replace(
        response.parts,
        max_frame=most[0] if most[0] == most[1] else longest.format(*most),
        index_type=max((request.parts.index_type, response.parts.index_type), key=len),
    )
    return replace(response, f=view, parts=parts)


_RECEIVERS: Mapping[type[Receiver], str] = {
    Hunt: "receiver_streamed",
    Rescan: "receiver_rescan",
    Gaps: "receiver_gap",
}


def frame_section(plan: Plan, layouts: Layouts) -> FrameSection:
    """Choose by the way frames are received."""
    if plan.frame.kinds:
        several = kinds_views(plan, layouts)
        found: Mapping[str, View] = {
            "kinds": several.kinds,
            "place": several.place,
            "parts": several.parts,
            "ended": None,
            "coded": None,
            "stuffed": None,
            "crc": None,
        }
        templates: tuple[str, ...] = ("place", "kinds", "wrap", "frame_public")
        algorithms = next(iter(several.each.values())).algorithms
        return FrameSection(
            plan, several.f, found, algorithms, templates, "receiver_rescan", kinds=several.each
        )
    receiver, check = plan.frame.receiver, plan.frame.check
    match receiver:
        case Hunt() | Rescan() | Gaps():
            ways = parts_views(plan, layouts)
            views = _common(plan, ways) if plan.directed else ways[""]
            templates = (*views.templates, "wrap", "frame_public")
            kind = _RECEIVERS[type(receiver)]
            templates = (*templates[:-1], "ways", templates[-1]) if plan.directed else templates
            each = ways if plan.directed else {}
            return FrameSection(plan, views.f, views.others, views.algorithms, templates, kind, each)
        case Marks():
            value = [crc.render(check.algorithm)] if check else []
            marked: Mapping[str, View] = {
                "place": PLACE,
                "marked": marked_view(plan),
                "crc": value[0] if value else None,
            }
            view = frame_view(plan, check_optional=bool(check))
            return FrameSection(plan, view, marked, value, ("place", "marked", "wrap"), "receiver_marked")
        case InStep():
            packet = {"packet": packet_view(plan)}
            return FrameSection(plan, frame_view(plan), packet, (), ("packet",), "receiver_packet")
        case _:
            assert_never(receiver)
