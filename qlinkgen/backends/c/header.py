"""One protocol's header: the render model of every section, in the order in which they stand."""

from __future__ import annotations

from typing import Any

import jinja2

from qlinkgen.backends import c_text
from qlinkgen.backends.base import Options, banner
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
from qlinkgen.model.message import Direction, Message
from qlinkgen.model.naming import snake
from qlinkgen.model.protocol import Protocol
from qlinkgen.model.transaction import Command
from qlinkgen.plan import plan_of
from qlinkgen.plan.payload import BytesStep


class Header:
    """Collects the sections of one header."""

    def __init__(self, protocol: Protocol, options: Options, templates: jinja2.Environment) -> None:
        """What is kept is decided once, here."""
        self._protocol = protocol
        self._plan = plan_of(protocol, options)
        self._options = options
        self._templates = templates
        self._names = Names(protocol)
        self._layouts = Layouts(protocol.name)
        self._types = Types(self._plan, self._names)
        self._writer = MessageWriter(self._names, self._layouts, self._types)
        self._kept = tuple(message for message in protocol.messages if self._wanted(message))
        self._present = {message.name for message in self._kept}
        self._section = frame_section(protocol, self._layouts)
        self._address = framing.address_of(protocol, self._section.view["address"])

    def text(self) -> str:
        """The whole header."""
        sections = [
            self._check_value(),
            self._place("frame_common", f=self._section.view),
            *self._directions(),
            *[self._frame_part(name) for name in self._section.templates],
            *[self._message(message) for message in self._kept],
            *self._checks(),
            *[self._frame_part(name) for name in self._receivers()],
            self._dispatch(),
        ]
        return tidy(self._place("header", **self._head(), body="".join(sections)))

    # What is kept

    def _wanted(self, message: Message) -> bool:
        only, command = self._options.only, self._names.command_of(message)
        return not only or message.name in only or (command is not None and command.name in only)

    def _encoded(self, message: Message) -> bool:
        return self._sent_by(message) in ("both", self._options.role) or self._options.role == "both"

    def _decoded(self, message: Message) -> bool:
        sender = self._sent_by(message)
        return self._options.role == "both" or sender == "both" or sender != self._options.role

    @staticmethod
    def _sent_by(message: Message) -> str:
        return {"request": "master", "response": "slave", "message": "both"}[message.direction]

    def _received(self) -> list[tuple[Direction, tuple[Message, ...]]]:
        """Messages that are decoded, for each direction that a receiver can wait for."""
        found: list[tuple[Direction, tuple[Message, ...]]] = []
        for direction in self._protocol.directions:
            if self._options.role != "both" and direction == self._section.left_out(self._options.role):
                continue
            messages = tuple(m for m in self._protocol.received(direction) if m.name in self._present)
            if messages:
                found.append((direction, messages))
        return found

    # Sections

    def _place(self, template: str, **values: Any) -> str:
        return self._templates.get_template(f"templates/{template}.h.j2").render(
            p=self._names.prefix, P=self._names.upper, **values
        )

    def _frame_part(self, template: str) -> str:
        shapes = self._section.groups(self._names, self._received())
        view = {
            **self._section.view,
            "address_groups": self._address_groups(),
            "wide": any(map(framing.is_wide, self._kept)),
        }
        return self._place(template, f=view, crc=self._section.check, shapes=shapes, unused=self._unheard())

    def _address_groups(self) -> list[framing.AddressGroup]:
        """Sets of addresses that the messages which are encoded may have."""
        groups = (framing.address_group(m, self._address) for m in self._kept if self._encoded(m))
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
        received = [(f"{names.upper}_{direction.upper()}", m) for direction, m in self._received()]
        texts = ["\n", *(self._id_constant(message) for message in self._kept)]
        unheard = self._unheard()
        if view["reports_runs"]:
            address = self._address
            checks = [(d, framing.checks(names, address, messages)) for d, messages in received]
            admits = [{"direction": d, "messages": messages} for d, messages in checks]
            limited = any(message["admits"] for _, messages in checks for message in messages)
            unused = [*unheard, *([view["address"]] if view["address"] and not limited else [])]
            texts.append(self._place("admit", f=view, admits=admits, unused=unused))
        if view["needs_extent"]:
            plans = self._plan.by_name
            sizes_known = [
                {"direction": d, "messages": extents(names, [plans[m.name] for m in heard], self._layouts)}
                for d, heard in received
            ]
            texts.append(self._place("extent", f=view, extents=sizes_known, unused=unheard))
        return texts

    def _unheard(self) -> list[str]:
        """Parameters that tell one message from another, where none is received."""
        view = self._section.view
        return [] if self._received() else [*(["direction"] if view["needs_direction"] else []), view["id"]]

    def _id_constant(self, message: Message) -> str:
        return f"#define {self._names.constant(message)}_ID 0x{message.id:02X}\n"

    def _message(self, message: Message) -> str:
        view = self._writer.render(self._plan.by_name[message.name])
        view["early_id"] = self._section.needs_ids
        if self._encoded(message):
            view["to_frame"] = self._section.to_frame(self._names, self._address, message)
        if self._decoded(message):
            view["from_frame"] = self._section.from_frame(self._names, message)
        return self._place("message", m=view)

    def _checks(self) -> list[str]:
        if not self._section.has_checks:
            return []
        checks = [
            {"direction": direction, "messages": framing.checks(self._names, self._address, messages)}
            for direction, messages in self._received()
        ]
        return [self._place("checks", checks=checks, f=self._section.view)]

    def _receivers(self) -> tuple[str, ...]:
        """Packets have a receiver for slaves alone."""
        return () if self._options.role == "master" and self._section.slave_only else self._section.receivers

    def _dispatch(self) -> str:
        ring = self._protocol.directions == ("message",)
        commands: tuple[Command, ...] = tuple(
            c for c in self._protocol.commands if c.request.name in self._present
        )
        slave = [] if ring or self._options.role == "master" else self._slave()
        master = (
            []
            if self._options.role == "slave" and not ring
            else dispatch.master_entries(self._names, self._address, self._kept)
        )
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
            "max_wire_size": max(
                sizes.protocol_max_wire_size(protocol), self._section.view.get("max_wire", 0)
            ),
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
