"""One protocol's header: the render model of every section, in the order in which they stand."""

from __future__ import annotations

from typing import Any

import jinja2

from qlinkgen.backends import c_text
from qlinkgen.backends.base import banner
from qlinkgen.backends.c import dispatch, framing
from qlinkgen.backends.c.constants import enum_views, limits
from qlinkgen.backends.c.describe import WIDTH
from qlinkgen.backends.c.example import example_lines, option_lines
from qlinkgen.backends.c.extents import extents
from qlinkgen.backends.c.frames import FrameSection, frame_section
from qlinkgen.backends.c.layout import Layouts
from qlinkgen.backends.c.messages import MessageWriter, nearest_helpers
from qlinkgen.backends.c.names import Names
from qlinkgen.backends.c.tidy import tidy
from qlinkgen.backends.c.types import Types
from qlinkgen.model import sizes
from qlinkgen.model.message import Message
from qlinkgen.model.naming import snake
from qlinkgen.plan.payload import BytesStep
from qlinkgen.plan.tree import MessagePlan, Plan


class Header:
    """Collects the sections of one header."""

    def __init__(self, plan: Plan, templates: jinja2.Environment) -> None:
        """The plan has what is kept."""
        self._plan = plan
        self._protocol = plan.protocol
        self._templates = templates
        self._names = Names(plan.protocol)
        self._layouts = Layouts(plan.protocol.name)
        self._types = Types(plan, self._names)
        self._writer = MessageWriter(self._names, self._layouts, self._types)
        self._kept = tuple(each.message for each in plan.messages)
        self._section = frame_section(plan, self._layouts)
        self._address = framing.address_of(plan.frame, self._section.view["address"])

    def text(self) -> str:
        """The whole header."""
        sections = [
            self._check_value(),
            self._place("frame_common", f=self._section.view),
            *self._directions(),
            *[self._frame_part(name) for name in self._section.templates],
            *[self._message(message) for message in self._plan.messages],
            *self._checks(),
            *self._receiver(),
            self._dispatch(),
        ]
        return tidy(self._place("header", **self._head(), body="".join(sections)))

    # Sections

    def _place(self, template: str, **values: Any) -> str:
        return self._templates.get_template(f"templates/{template}.h.j2").render(
            p=self._names.prefix, P=self._names.upper, **values
        )

    def _frame_part(self, template: str) -> str:
        view = {
            **self._section.view,
            "address_groups": self._address_groups(),
            "wide": any(map(framing.is_wide, self._kept)),
            **self._section.known(self._names),
        }
        return self._place(template, f=view, crc=self._section.check, unused=self._unheard())

    def _address_groups(self) -> list[framing.AddressGroup]:
        """Sets of addresses that the messages which are encoded may have."""
        groups = (framing.address_group(m, self._address) for m in self._plan.messages if m.encoded)
        return list(dict.fromkeys(group for group in groups if group))

    def _check_value(self) -> str:
        check = self._section.check
        if check is None:
            return ""
        return "\n" + self._place("crc" if check["is_crc"] else "sum", crc=check)

    def _directions(self) -> list[str]:
        """What a receiver has to know of the messages before it can find the end of a frame."""
        if not self._section.needs_ids:
            return []
        names, view = self._names, self._section.view
        received = [(f"{names.upper}_{direction.upper()}", m) for direction, m in self._section.heard()]
        texts = ["\n", *(self._id_constant(message) for message in self._kept)]
        unheard = self._unheard()
        if view["bare"]:
            address = self._address
            checks = [(d, framing.checks(names, address, messages)) for d, messages in received]
            admits = [{"direction": d, "messages": messages} for d, messages in checks]
            limited = any(message["admits"] for _, messages in checks for message in messages)
            unused = [*unheard, *([view["address"]] if view["address"] and not limited else [])]
            texts.append(self._place("admit", f=view, admits=admits, unused=unused))
        if view["needs_extent"]:
            sizes_known = [
                {"direction": d, "messages": extents(names, heard, self._layouts)} for d, heard in received
            ]
            texts.append(self._place("extent", f=view, extents=sizes_known, unused=unheard))
        return texts

    def _unheard(self) -> list[str]:
        """Parameters that tell one message from another, where none is received."""
        view = self._section.view
        return (
            [] if self._section.heard() else [*(["direction"] if view["needs_direction"] else []), view["id"]]
        )

    def _id_constant(self, message: Message) -> str:
        return f"#define {self._names.constant(message)}_ID 0x{message.id:02X}\n"

    def _message(self, message: MessagePlan) -> str:
        view = self._writer.render(message)
        view["early_id"] = self._section.needs_ids
        if message.encoded:
            view["to_frame"] = self._section.to_frame(self._names, self._address, message)
        if message.decoded:
            view["from_frame"] = self._section.from_frame(self._names, message)
        return self._place("message", m=view)

    def _checks(self) -> list[str]:
        checks = [
            {"direction": direction, "messages": framing.checks(self._names, self._address, messages)}
            for direction, messages in self._section.heard()
        ]
        return [self._place("checks", checks=checks, f=self._section.view)]

    def _receiver(self) -> list[str]:
        """Packets have a receiver for slaves alone."""
        if self._plan.role == "master" and self._section.slave_only:
            return []
        return [self._frame_part(self._section.receiver)]

    def _dispatch(self) -> str:
        ring = self._protocol.directions == ("message",)
        commands, role = self._plan.commands, self._plan.role
        slave = [] if ring or role == "master" else self._slave()
        told = role != "slave" or ring
        master = dispatch.master_entries(self._names, self._address, self._plan.messages) if told else []
        transactions = dispatch.transactions(self._protocol, self._names.upper, commands)
        view = {**self._section.view, **self._section.dispatch_view(self._protocol, self._names.upper)}
        answered = next((c for c in commands if c.response is not None), None)
        view["example_command"] = snake(answered.name).upper() if answered else ""
        if self._section.slave_only:
            master = []
        groups = self._section.slave_groups(slave, self._names.prefix)
        return self._place(
            "dispatch", f=view, slave=slave, slave_groups=groups, master=master, transactions=transactions
        )

    def _slave(self) -> list[dict[str, Any]]:
        entries = dispatch.slave_entries(self._names, self._kept)
        return [{**entry, **self._section.slave_entry(entry, self._names.upper)} for entry in entries]

    def _head(self) -> dict[str, Any]:
        protocol, runs = self._protocol, self._byte_runs()
        return {
            "banner": [piece for line in banner(protocol) for piece in c_text.comment(line, WIDTH)],
            "about": c_text.comment(protocol.doc, WIDTH),
            "options": option_lines(self._names.upper, self._section.check),
            "example": example_lines(self._plan, self._names, self._section),
            "max_wire_size": max(sizes.protocol_max_wire_size(protocol), self._section.view["max_wire"]),
            "limits": limits(protocol, self._kept),
            "enums": enum_views(protocol, self._names),
            "helpers": self._layouts.helpers(),
            "has_text": any(run.text for run in runs),
            "has_bytes": bool(runs),
            "has_table": bool(self._section.check and self._section.check["is_crc"]),
            "extended": sorted(self._layouts.extended),
            "nearest": nearest_helpers(self._types, self._plan.messages),
            "types": list(self._types.named.values()),
        }

    def _byte_runs(self) -> list[BytesStep]:
        steps = (step for message in self._plan.messages for step in message.payload.steps)
        return [step for step in steps if isinstance(step, BytesStep)]


__all__ = ["FrameSection", "Header"]
