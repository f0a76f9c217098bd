"""The master of a protocol in C: a header beside that of its codec.

It is the C form of `qlinkgen.link.master`, for requests with one answer or none. What differs between
protocols are functions for each command, in `master_asks`; the rest is one template.
"""

from __future__ import annotations

from qlinkgen._dataclass import dataclass
from qlinkgen.backends import c_text
from qlinkgen.backends.base import Outputs, banner
from qlinkgen.backends.c.describe import WIDTH
from qlinkgen.backends.c.frames import FrameSection, frame_section
from qlinkgen.backends.c.layout import Layouts
from qlinkgen.backends.c.master_asks import Asks, AskView, Unasked
from qlinkgen.backends.c.names import Names
from qlinkgen.backends.c.tidy import tidy
from qlinkgen.backends.c.views import PartsView
from qlinkgen.backends.templates import environment
from qlinkgen.errors import GenerationError
from qlinkgen.model.naming import file_stem
from qlinkgen.model.protocol import Protocol
from qlinkgen.plan import Options, plan_of
from qlinkgen.plan.tree import Plan

#: Byte times after which a line counts as quiet, as in `qlinkgen.link.timing`.
QUIET_BYTES = 3


@dataclass(frozen=True, slots=True, kw_only=True)
class BusView:
    """What the master knows about the line and the frames.

    Attributes:
        longest: bits of the longest frame with a command.
        quiet: bits of the silence after a failed attempt.
        direction: the argument with which a receiver expects answers, "" without one.
        broadcast: the condition that a request is to all nodes, "" where none is.
        silence: only a silence ends a frame.
        idle: receivers need a silence between two frames, whatever ends one.
        pending: the condition that an inserted byte may follow the frame just received, "" where none can.
        rescans: one byte can produce several events.
        checked: the function that checks the contents of an answer.
    """

    address: str
    address_type: str
    id_type: str
    id: str
    parts: bool
    longest: int
    quiet: int
    byte: int
    direction: str
    broadcast: str
    silence: bool
    idle: bool
    pending: str
    rescans: bool
    checked: str


def generate(protocol: Protocol, options: Options) -> Outputs:
    """The master of a protocol.

    Raises:
        GenerationError: the protocol has frames or transactions for which there is none in C.
    """
    plan = plan_of(protocol, options)
    section = frame_section(plan, Layouts(protocol.name))
    reason = why_not(plan, section)
    if reason:
        raise GenerationError(f"{protocol.schema_file}: no master in C: {reason}")
    names = Names(protocol)
    found = list(Asks(plan, names, section))
    asks = [each for each in found if isinstance(each, AskView)]
    if not asks:
        reasons = "; ".join(f"{each.name}: {each.reason}" for each in found if isinstance(each, Unasked))
        raise GenerationError(f"{protocol.schema_file}: no master in C: no command fits it: {reasons}")
    text = (
        environment("qlinkgen.backends.c")
        .get_template("templates/master.h.j2")
        .render(
            P=names.upper,
            p=names.prefix,
            banner=[piece for line in banner(protocol) for piece in c_text.comment(line, WIDTH)],
            codec=f"{file_stem(protocol.name)}.h",
            bus=bus_view(plan, names, section),
            asks=asks,
            left=[each for each in found if isinstance(each, Unasked)],
            example=next((each for each in asks if each.response), asks[0]),
        )
    )
    return {f"c/{file_stem(protocol.name)}_master.h": tidy(text)}


def why_not(plan: Plan, section: FrameSection) -> str:
    """Why a protocol has none, with what helps; "" if it has one."""
    protocol = plan.protocol
    if plan.role == "slave":
        return "role slave leaves it out; use --role both or --role master"
    if not plan.commands:
        return "the schema has no commands; add them, or use the codec header alone"
    if protocol.both_ask:
        return "both sides of the link ask; use the dispatcher of the codec header and keep the deadlines"
    if section.slave_only:
        return "packets are split by their requests; use the functions of the codec header"
    if plan.asked or any(each.turned for each in plan.messages):
        return "only their request or turn tells some answers apart; use the dispatcher of the codec header"
    if plan.frame.idle is not None and plan.frame.idle.broken:
        return "each frame begins with a break; use the dispatcher of the codec header"
    if protocol.counter is not None or protocol.master is not None:
        return "its frames have a counter or the number of the master; use the dispatcher of the codec header"
    return ""


def bus_view(plan: Plan, names: Names, section: FrameSection) -> BusView:
    """The view of the line."""
    protocol, view, idle = plan.protocol, section.view, plan.frame.idle
    bits = protocol.bus.bits_per_byte
    messages = [plan.by_name[message.name] for command in plan.commands for message in command.messages]
    return BusView(
        address=view.address,
        address_type=view.address_type,
        id_type=view.id_type,
        id=view.id,
        parts=view.has_values,
        longest=max(each.wire_size for each in messages) * bits,
        quiet=QUIET_BYTES * bits,
        byte=bits,
        direction=f", {names.upper}_RESPONSE" if view.needs_direction else "",
        broadcast=f"job->{view.address} == {names.upper}_BROADCAST"
        if view.address and protocol.bus.broadcast is not None
        else "",
        silence=idle is not None and idle.alone,
        idle=idle is not None,
        pending=_pending(section, names.upper),
        rescans=section.rescans,
        checked=f"{names.prefix}_response_check",
    )


def _pending(section: FrameSection, upper: str) -> str:
    if section.receiver == "receiver_streamed":
        return f"bus->receiver.state == {upper}_FIRST_"
    parts = section.views.get("parts")
    late = section.rescans and isinstance(parts, PartsView) and parts.late_insert
    return "bus->receiver.due >= 0" if late else ""


__all__ = ["generate", "why_not"]
