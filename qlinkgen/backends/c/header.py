"""Renders the header of a protocol: the views of all sections, in their order."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from operator import attrgetter
from typing import get_args

import jinja2

from qlinkgen._dataclass import dataclass
from qlinkgen.backends import c_text
from qlinkgen.backends.base import banner
from qlinkgen.backends.c import dispatch, framing
from qlinkgen.backends.c.boxes import boxes
from qlinkgen.backends.c.constants import EnumView, enum_views, limits
from qlinkgen.backends.c.counter import counter
from qlinkgen.backends.c.crc import CrcView, render_of_fields
from qlinkgen.backends.c.describe import WIDTH
from qlinkgen.backends.c.example import example_lines, option_lines
from qlinkgen.backends.c.forms import Helper
from qlinkgen.backends.c.frames import FrameSection, View, frame_section
from qlinkgen.backends.c.kept import kept
from qlinkgen.backends.c.layout import Layouts
from qlinkgen.backends.c.messages import Beside, MessageWriter, Rounding, nearest_helpers
from qlinkgen.backends.c.names import Names
from qlinkgen.backends.c.places import in_hex
from qlinkgen.backends.c.proofs import proof_views
from qlinkgen.backends.c.several import several
from qlinkgen.backends.c.sizes import SizeView, size_view, sized_by_message, turn_view
from qlinkgen.backends.c.stamp import stamps
from qlinkgen.backends.c.tidy import tidy
from qlinkgen.backends.c.types import Kind, Types
from qlinkgen.backends.c.views import FrameView, own_prefix
from qlinkgen.model.fields import Layout, Value
from qlinkgen.model.message import Direction, Message
from qlinkgen.model.naming import snake
from qlinkgen.model.types import Float
from qlinkgen.plan import plan_of
from qlinkgen.plan.payload import BytesStep, Member, all_records
from qlinkgen.plan.tree import MessagePlan, Plan

#: Templates about what the frames of all directions have in common.
_COMMON = ("coding", "ways", "frame_public")


@dataclass(frozen=True, slots=True, kw_only=True)
class HeadView:
    """The sections before the frame: comments, options, enums, helpers, named types."""

    banner: list[str]
    about: list[str]
    options: list[str]
    example: list[str]
    max_wire_size: int
    stamps: list[tuple[str, str]]
    limits: list[tuple[str, str]]
    enums: list[EnumView]
    helpers: list[Helper]
    has_text: bool
    has_bytes: bool
    in_flash: bool
    extended: list[int]
    nearest: list[Rounding]
    floats: list[str]
    types: list[Kind]


@dataclass(frozen=True, slots=True)
class SeedView:
    """The bytes of the attributes that a check value covers, and the messages that have them."""

    bytes: str
    size: int
    constants: list[str]


def seed_views(names: Names, messages: Sequence[MessagePlan]) -> list[SeedView]:
    """The seeds of messages; messages with one id have one entry."""
    found: dict[bytes, list[str]] = {}
    ids: set[int] = set()
    for each in messages:
        if each.id not in ids and each.message.seeds:
            ids.add(each.id)
            data = b"".join(data for _, data in each.message.seeds)
            found.setdefault(data, []).append(names.constant(each.message))
    return [SeedView(", ".join(map(in_hex, data)), len(data), names) for data, names in found.items()]


@dataclass(frozen=True, slots=True)
class Group:
    """The messages of a direction."""

    direction: str
    messages: Sequence[framing.Expected | SizeView]


class Header:
    """Collects the sections of one header."""

    def __init__(self, plan: Plan, templates: jinja2.Environment) -> None:
        """Prepare the parts common to all sections."""
        self._plan = plan
        self._protocol = plan.protocol
        self._templates = templates
        self._names = Names(plan.protocol)
        stems = {each.name: self._names.record(each.name) for each in plan.layouts}
        self._layouts = Layouts(plan.protocol.name, stems)
        self._types = Types(plan, self._names)
        self._writer = MessageWriter(self._names, self._layouts, self._types)
        self._kept = tuple(each.message for each in plan.messages)
        self._section = frame_section(plan, self._layouts)
        directions: tuple[Direction, ...] = get_args(Direction)
        name = self._section.view.address
        self._addresses = {each: framing.address_of(plan, name, each) for each in directions}
        self._wide = any(map(framing.is_wide, plan.messages))

    def text(self) -> str:
        """The whole header."""
        plan = self._plan
        sections = [
            self._check_value(),
            self._place("frame_common", f=self._section.view, beside=self._beside()),
            *self._directions(),
            *self._kinds(),
            *[text for name in self._section.templates for text in self._frame_parts(name)],
            *[self._record(layout) for layout in plan.layouts],
            *[self._message(message) for message in self._plan.messages],
            *self._checks(),
            *self._receiver(),
            *self._proofs(),
            self._dispatch(),
        ]
        body = "".join([*self._field_checks(), *sections])
        return tidy(self._place("header", head=self._head(), body=body))

    def example(self) -> list[str]:
        """The lines of the program in its head comment."""
        lines = example_lines(self._plan, self._names, self._section)
        return "\n".join(lines).split("\n")

    # Sections

    def _place(self, template: str, **views: object) -> str:
        prefix = self._names.prefix
        return self._templates.get_template(f"templates/{template}.h.j2").render(
            P=self._names.upper, **{"p": prefix, "q": prefix, "t": prefix, **views}
        )

    def _kinds(self) -> Iterator[str]:
        """The functions of each kind of frame, if there are several."""
        for kind, views in self._section.kinds.items():
            for template in views.templates:
                yield self._frame_part(template, views.f, views.others, kind)

    def _frame_parts(self, template: str) -> Iterator[str]:
        """The text of a template, for each direction if it is about what differs between their frames."""
        section = self._section
        if template in _COMMON or not section.ways:
            yield self._frame_part(template, section.view, section.views)
            return
        for way, views in section.ways.items():
            yield self._frame_part(template, views.f, views.others, way)

    def _frame_part(self, template: str, view: FrameView, views: Mapping[str, View], way: str = "") -> str:
        section, own = self._section, own_prefix(self._names.prefix, way)
        # Codings are the same in both directions, but not in each kind of frame.
        coding = own if section.kinds else self._names.prefix
        return self._place(
            template,
            q=own,
            t=coding,
            p=coding if template == "coding" else self._names.prefix,
            f=view,
            ways={each: found.f for each, found in section.ways.items()},
            unused=self._unused_arguments(),
            wide=self._wide,
            address_groups=self._address_groups(way),
            shapes=section.shapes(self._names),
            sizes=section.sizes(self._names),
            judgement=section.judgement,
            **views,
        )

    def _beside(self) -> Beside | None:
        """The struct of the values of every frame, None without any."""
        held = [(member, value) for _, member, value in self._held()]
        return self._writer.beside(held) if held else None

    def _address_groups(self, way: str) -> list[framing.AddressGroup]:
        """Sets of legal addresses of the encoded messages of a direction, or of all."""
        sent = [each for each in self._plan.messages if each.encoded and way in ("", each.direction)]
        groups = (framing.address_group(each, self._addresses[each.direction]) for each in sent)
        return list(dict.fromkeys(group for group in groups if group))

    def _check_value(self) -> str:
        return "".join(
            "\n" + self._place("crc" if isinstance(each, CrcView) else "sum", crc=each)
            for each in self._section.algorithms
        )

    def _field_checks(self) -> Iterator[str]:
        """Algorithms of check values in payloads; complete once the messages have been printed."""
        for number, algorithm in enumerate(self._layouts.checks, 1):
            view = render_of_fields(algorithm, number)
            yield "\n" + self._place("crc" if isinstance(view, CrcView) else "sum", crc=view)
            yield self._place("check_of", crc=view)

    def _directions(self) -> list[str]:
        """Ids and sizes of messages that a receiver needs to find the end of a frame."""
        if not self._section.needs_ids:
            return []
        names, view = self._names, self._section.view
        received = [(f"{names.upper}_{direction.upper()}", m) for direction, m in self._section.received()]
        texts = ["\n", *(self._id_constant(message) for message in self._kept)]
        unused = self._unused_arguments()
        if view.checks_header:
            header_checks = [Group(d, self._expected(messages)) for d, messages in received]
            limited = any(
                each.address_allowed for _, messages in received for each in self._expected(messages)
            )
            address = [] if limited or not view.address else [view.address]
            texts.append(
                self._place("header_check", f=view, header_checks=header_checks, unused=[*unused, *address])
            )
        if self._plan.frame.seeded:
            known = [Group(d, self._expected(messages)) for d, messages in received]
            seeds = seed_views(names, self._plan.messages)
            texts.append(self._place("seeds", f=view, seeds=seeds, known=known, unused=unused))
        if view.sized_by_message:
            size_groups = [
                Group(
                    d, [size_view(names, each, self._layouts) for each in messages if sized_by_message(each)]
                )
                for d, messages in received
            ]
            texts.append(self._place("payload_size", f=view, size_groups=size_groups, unused=unused))
        return texts

    def _expected(self, messages: Sequence[MessagePlan]) -> list[framing.Expected]:
        return [
            framing.expected(self._names, self._addresses[message.direction], message) for message in messages
        ]

    def _unused_arguments(self) -> list[str]:
        """Parameters that are unused if no message is received."""
        view = self._section.view
        return [] if self._section.received() else [*(["direction"] if view.needs_direction else []), view.id]

    def _id_constant(self, message: Message) -> str:
        return f"#define {self._names.constant(message)}_ID 0x{message.id:02X}\n"

    def _record(self, layout: Layout) -> str:
        return self._place("record", r=self._writer.record(layout, self._plan.messages))

    def _message(self, message: MessagePlan) -> str:
        section, names = self._section, self._names
        return self._place(
            "message",
            m=self._writer.render(message),
            early_id=section.needs_ids,
            to_frame=section.to_frame(names, self._addresses[message.direction], message)
            if message.encoded
            else None,
            from_frame=section.from_frame(names, message) if message.decoded else None,
            parts_init=self._parts_init(message),
        )

    def _parts_init(self, message: MessagePlan) -> str:
        """The initialiser of the values of its frame, "" if no value is always the same."""
        own = {each.name: each for _, each in message.envelope.values}
        held = [(own.get(name, each), value) for name, each, value in self._held()]
        return self._writer.beside(held).initialiser if message.message.settled else ""

    def _held(self) -> list[tuple[str, Member, Value]]:
        """The values of every frame, as planned and as stated."""
        held = self._plan.beside
        return [(each.name, held[each.name], each) for each in self._protocol.frame_values] if held else []

    def _checks(self) -> list[str]:
        checks = [
            Group(direction, self._expected(messages)) for direction, messages in self._section.received()
        ]
        return [self._place("checks", checks=checks, f=self._section.view)]

    def _receiver(self) -> list[str]:
        """The receiver; that of packets only for slaves."""
        if self._plan.role == "master" and self._section.slave_only:
            return []
        section = self._section
        found = [self._frame_part(section.receiver, section.view, section.views)]
        box = boxes(self._plan, self._names.upper)
        found.append(self._place("boxes", b=box, rescans=section.rescans))
        turn = turn_view(self._plan, self._names, self._layouts)
        return found + ([self._place("turn", f=section.view, turn=turn)] if turn else [])

    def _proofs(self) -> list[str]:
        """The check values of responses that cover their request."""
        found = proof_views(self._plan, self._names, self._layouts, self._section.view.address)
        return [self._place("proofs", proofs=found)] if found else []

    def _dispatch(self) -> str:
        section, commands, role = self._section, self._plan.commands, self._plan.role
        ring = self._protocol.directions == ("message",)
        listens = (role != "slave" or ring) and not section.slave_only
        slave = self._slave() if self._has_slave else []
        answered = next((c for c in commands if c.response is not None), None)
        return self._place(
            "dispatch",
            f=section.view,
            d=section.dispatch,
            pending=section.pending,
            example_command=snake(answered.name).upper() if answered else "",
            slave=slave,
            replies=self._replies(slave),
            refusal=self._refusal() if slave else None,
            slave_groups=dispatch.slave_groups(slave, self._names.prefix, refuses=self._refuses),
            master=dispatch.callbacks(self._names, self._addresses["response"], self._plan.messages)
            if listens
            else [],
            asked=dispatch.asked(self._names, self._plan),
            carrier=dispatch.carrier(self._names, self._plan),
            transactions=dispatch.transactions(self._protocol, self._names.upper, commands),
            turns=dispatch.turns(self._names, self._protocol.exchanges.values(), self._kept),
            awaited=dispatch.awaited(self._names, self._protocol.exchanges.values(), self._plan.messages),
            dialogues=dispatch.dialogues(self._names, commands) if listens else [],
            counter=counter(self._plan, self._names, section.view.id_type) if role != "slave" else None,
            before=max((each.listed for each in slave if each.listed), key=attrgetter("most"), default=None),
            kept=kept(self._plan, self._names) if slave else None,
            streams=[each.begins for each in slave if each.begins],
            several=several(self._names, commands, self._kept) if listens else [],
        )

    def _slave(self) -> list[dispatch.SlaveEntry]:
        section = self._section
        found = dispatch.slave_entries(
            self._names,
            self._kept,
            self._protocol.exchanges,
            address=section.view.address,
            values=self._plan.beside,
            reject=section.reject,
            streams=dispatch.streaming(self._names, self._plan.commands, self._kept),
        )
        return [dispatch.refusing(each, self._names.prefix) for each in found] if self._refuses else found

    @property
    def _refuses(self) -> bool:
        """Whether a slave refuses unknown requests."""
        unknown = self._protocol.to_unknown
        return unknown is not None and unknown.message.name in self._plan.by_name

    def _refusal(self) -> dispatch.Refusal | None:
        """The refusal of unknown requests, None if a slave is silent."""
        unknown = self._protocol.to_unknown
        if unknown is None or not self._refuses:
            return None
        message, view = self._plan.by_name[unknown.message.name], self._section.view
        whole = self._section.to_frame(self._names, self._addresses["response"], message)
        return dispatch.refusal(self._names, unknown, message, whole, view.id)

    def _replies(self, slave: Sequence[dispatch.SlaveEntry]) -> list[dispatch.ReplyEntry]:
        """Functions that answer in another way, if any function of the slave may."""
        used = any(entry.replies for entry in slave)
        if not used:
            return []
        return dispatch.reply_entries(self._names, self._plan, self._kept, self._section.view.address)

    def _head(self) -> HeadView:
        protocol, runs, check = self._protocol, self._byte_runs(), self._section.check
        whole = plan_of(protocol)
        return HeadView(
            banner=[piece for line in banner(protocol) for piece in c_text.comment(line, WIDTH)],
            about=c_text.comment(protocol.doc, WIDTH),
            options=option_lines(self._names.upper, check, slave=self._has_slave),
            example=self.example(),
            max_wire_size=max(whole.max_wire_size, self._section.view.max_wire),
            stamps=stamps(protocol),
            limits=limits(whole, self._plan),
            enums=enum_views(protocol, self._names),
            helpers=self._layouts.helpers(),
            has_text=any(run.text for run in runs),
            has_bytes=bool(runs) or self._copies,
            in_flash=self._in_flash,
            extended=sorted(self._layouts.extended),
            floats=self._floats(),
            nearest=nearest_helpers(self._types, self._plan.messages),
            types=list(self._types.named.values()),
        )

    @property
    def _in_flash(self) -> bool:
        """Whether tables may be in the flash of AVR: those of check values and of handlers."""
        checked = any(each.kind == "crc" for each in self._layouts.checks)
        return checked or isinstance(self._section.check, CrcView) or self._has_slave

    @property
    def _has_slave(self) -> bool:
        """Whether the header has the dispatch of a slave."""
        return self._protocol.directions != ("message",) and self._plan.role != "master"

    @property
    def _copies(self) -> bool:
        """Whether wrapping a frame copies its payload."""
        frame = self._plan.frame
        return bool(frame.kinds) or frame.envelope.payload.trim is not None

    def _floats(self) -> list[str]:
        """The types of floating-point numbers in use; f16 is converted by way of f32."""
        meanings = (each.meaning for each in self._types.numbers())
        found = {each.name for each in meanings if isinstance(each, Float)}
        return sorted(found | ({"f32"} if "f16" in found else set()))

    def _byte_runs(self) -> list[BytesStep]:
        payloads = [message.payload for message in self._plan.messages]
        payloads += [record.payload for record in all_records(payloads)]
        steps = (step for payload in payloads for step in payload.steps)
        return [step for step in steps if isinstance(step, BytesStep)]


__all__ = ["FrameSection", "Header"]
