"""Renders a whole module from the views of its parts."""

from __future__ import annotations

import re
import textwrap
from collections.abc import Mapping, Sequence
from dataclasses import replace

from qlinkgen._dataclass import dataclass
from qlinkgen.backends import python_text
from qlinkgen.backends.base import banner
from qlinkgen.backends.python import frames, tables
from qlinkgen.backends.python.classes import ClassBuilder, ClassModel
from qlinkgen.backends.python.conditional import after_view
from qlinkgen.backends.python.fitted import fitted
from qlinkgen.backends.python.frame_checks import maker_of
from qlinkgen.backends.python.frame_directions import (
    DecodedDirection,
    UnknownView,
    decoded_directions,
    unknown_view,
)
from qlinkgen.backends.python.frame_views import MarkedView, PacketView, PartsView, UniqueView
from qlinkgen.backends.python.kinds import AnyView, KindsView, Maker, kinds_view
from qlinkgen.backends.python.layout import WIDTH, wrapped
from qlinkgen.backends.python.names import by_kind, class_name, imported
from qlinkgen.backends.python.place import Place, place_of
from qlinkgen.backends.python.sections import Sections, templates
from qlinkgen.backends.python.ways import Ways
from qlinkgen.model.texts import one_line
from qlinkgen.model.types import Enum, Flags
from qlinkgen.plan.coding import Digits
from qlinkgen.plan.hosts import host_of
from qlinkgen.plan.transparency import Coded
from qlinkgen.plan.tree import Plan

#: Names of the support module that every module re-exports.
_PUBLIC = ("Bus", "CodecError", "Command", "Counters", "DecodeError", "EncodeError", "Fault")
#: Names of struct and of other modules; all others are imported from the support module.
_STRUCT = ("Struct", "pack", "unpack", "unpack_from")
_RECORD = "BaseRecord"
_VARIED_RECORD = "VariedRecord"
#: Modules that are written only where used, in the order of their names.
_SHARED: Mapping[str, Sequence[str]] = {
    "_checks": (
        "Checksum",
        "adler",
        "carried",
        "crc",
        "find_crc",
        "fletcher",
        "sum_of",
        "wrong_check",
        "xor_of",
    ),
    "_digits": ("BetweenRule", "decimal", "read_decimal", "read_hexadecimal", "start_of"),
    "_filled": ("differing",),
    "_proofs": ("Proof", "ProvenCommand"),
    "_rchoices": ("ChoiceRule",),
    "_reach": ("EachOf", "UntilStopped"),
    "_reals": ("read_real", "real"),
    "_records": (_RECORD, "RecordRule", "RecordsRule", "inside", "read_record", "read_records"),
    "_rules": ("FloatRule", "ListRule", "PaddedRule", "WithoutRule"),
    "_rvaried": (
        *("EndedRule", "OpenRule", _VARIED_RECORD),
        *("read_counted", "read_ended", "read_filled", "read_one"),
    ),
    "_rwalks": ("MaybeRule", "Misplaced", "NEW", "misplaced"),
}
_ELSEWHERE = {"Decimal", "index", *_STRUCT, *(name for names in _SHARED.values() for name in names)}


def render(plan: Plan, *, laid_out: bool = True) -> str:
    """The text of a protocol's module; code that is only executed need not be laid out."""
    text = Module(plan).text()
    return _tidy(text) if laid_out else text


@dataclass(frozen=True)
class MessageRow:
    """An entry of the table of messages."""

    message: str
    name: str


@dataclass(frozen=True)
class Imports:
    """The imports of a module."""

    struct: Sequence[str]
    struct_error: bool
    binascii: bool
    decimal: bool
    index: bool
    modules: Mapping[str, Sequence[str]]
    callable: bool
    typing: Sequence[str]


@dataclass(frozen=True, kw_only=True)
class ModuleView:
    """The variables of the templates of a module; `f` is its frame."""

    f: AnyView
    decoded_directions: Sequence[DecodedDirection]
    direction_type: str
    direction_default: str
    asked: Sequence[str]
    carrier: str
    unknown: UnknownView | None
    stream_decoder: Sequence[str]
    doc: Sequence[str]
    enums: Sequence[tables.ConstantsModel]
    flags: Sequence[tables.ConstantsModel]
    messages: Sequence[MessageRow]
    bus: Sequence[str]
    resync: Sequence[str]
    commands: Sequence[Sequence[str]]
    records: Sequence[MessageRow]
    scales: Sequence[str]
    classes: str
    public: Sequence[str]
    imports: Imports
    directed: bool
    quick: bool
    announced: bool
    frames_with: Mapping[str, str]


class Module:
    """Collects the variables of the templates."""

    def __init__(self, plan: Plan) -> None:
        """Prepare the parts common to all templates."""
        self.plan = plan
        self.place: Place = place_of(plan)
        self.builder = ClassBuilder(plan, self.place)

    def text(self) -> str:
        """The module's text, not laid out."""
        plan, models = self.plan, self.builder.build()
        sizes = sorted({each.body_size for each in models if each.body_size is not None})
        title = one_line(plan.protocol.title)
        make = Maker(self.place, self.builder.scale)
        views: Mapping[str, AnyView] = {
            way: _view(each, title, sizes, make) for way, each in plan.ways.items()
        }
        view = views[list(views)[-1]]
        sections = Sections(views, plan.received_directions, _based(plan), bool(plan.beside))
        decoded = decoded_directions(plan, sections.ways)
        quoted = [f'"{each.direction}"' for each in decoded]
        module = ModuleView(
            f=view,
            decoded_directions=decoded,
            direction_type=f"Literal[{', '.join(quoted)}]",
            direction_default=f" = {quoted[0]}" if len(quoted) == 1 else "",
            asked=_asked(plan),
            unknown=unknown_view(plan),
            carrier=class_name(plan.carrier) if plan.carrier else "",
            stream_decoder=_stream_decoder(quoted),
            doc=self._doc(),
            enums=[tables.enum_model(each, self.place.classes[each.name]) for each in plan.enums],
            flags=[tables.flags_model(each, self.place.classes[each.name]) for each in plan.flags],
            messages=[MessageRow(each.name, class_name(each)) for each in plan.messages],
            bus=tables.bus(plan.protocol.bus),
            resync=tables.resync(plan),
            commands=tables.command_rows(plan, self.place),
            records=[MessageRow(each.name, self.place.classes[each.name]) for each in plan.layouts],
            scales=[*self.builder.scales, *self._field_checks(), *tables.word_tables(plan)],
            classes=self._classes(models, views, sections.ways),
            public=self._public(view, decoded),
            imports=self._imports(list(views.values()), models),
            directed=plan.directed,
            quick=all(isinstance(each, PartsView) and each.quick for each in views.values()),
            announced=all(isinstance(each, PartsView) and each.announced for each in views.values()),
            frames_with={way: sections.ways.of("_frame_with", way) for way in views},
        )
        asked = replace(module, f=views.get("request", view))
        refusing = sections.ways.of(_placed("unknown.j2", asked), "request")
        template = view.decoder if isinstance(view, PartsView) else view.template
        decoder = _placed(f"{template}_decoder.j2", module, search=sections.search, refusing=refusing).strip()
        return _placed("module.j2", module, frame=sections.frame, decoder=decoder)

    def _field_checks(self) -> list[str]:
        """Definitions of the algorithms of check values in payloads; complete once the classes are built."""
        lines: list[str] = []
        for algorithm in self.place.checks:
            maker, arguments = maker_of(algorithm)
            lines += wrapped(f"{self.place.check(algorithm)} = {self.place.use(maker)}(", arguments, ")", 0)
        return lines

    def _doc(self) -> list[str]:
        protocol = self.plan.protocol
        title, *others = map(one_line, banner(protocol))
        about = one_line(f"{protocol.doc} Source: {protocol.source}.")
        opening = textwrap.wrap(f"{title}: messages, frames and transactions.", WIDTH - 4)
        banner_lines = [line for other in others for line in textwrap.wrap(other, WIDTH)]
        return python_text.docstring([*opening, "", *textwrap.wrap(about, WIDTH), "", *banner_lines])

    def _classes(self, models: Sequence[ClassModel], views: Mapping[str, AnyView], ways: Ways) -> str:
        template = templates().get_template("templates/class.j2")
        common = list(views.values())[-1]
        framed = self.place.envelope is not None
        texts = []
        for each in models:
            record = each.base in (_RECORD, _VARIED_RECORD)
            whole = framed and not record
            kind = "record" if record else "whole frame as sent" if whole else "payload"
            text = template.render(
                each=each,
                wrap=self._wrap(each, views.get(each.way, common)) if each.has_codec and whole else [],
                encoder="to_frame" if whole else "to_bytes",
                encoder_doc=f"The {'bytes of the ' * (kind == 'record')}{kind}. Raises EncodeError.",
                data=self.place.data if whole else "payload",
                varied=each.base == _VARIED_RECORD,
            )
            texts.append(ways.of(text, each.way))
        return "".join(texts).strip("\n")

    @staticmethod
    def _wrap(each: ClassModel, view: AnyView) -> list[str]:
        match view:
            case UniqueView():
                return frames.wrap_lines(view, each.body_size)
            case PartsView():
                return frames.finish_lines(view)
            case MarkedView() | PacketView() | KindsView():
                return []

    # Names

    def _imports(self, views: Sequence[AnyView], models: Sequence[ClassModel]) -> Imports:
        """Imports used by the classes and by the templates of the frame."""
        plan, used = self.plan, {*self.place.used, *_PUBLIC, "BaseMessage", "as_bytes", "wrong_size"}
        used |= {"OpenEnum", "named"} if plan.enums else set()
        used |= {tables.many_class(each.many) for each in plan.commands if each.many}
        used |= {"OtherReply"} if any(each.meant for each in plan.commands) else set()
        used |= (
            {"REFUSALS", "settled"} if any(each.has_codec and each.refusable for each in models) else set()
        )
        used |= {"Misplaced"} if any(each.walked for each in models) else set()
        typing = {"ClassVar", "Literal", "Self"}
        typing |= {"Final"} if plan.flags else set()
        view = views[-1]
        typing |= {"Any"} if "ChoiceRule" in used else set()
        check = None if isinstance(view, PacketView) else view.check
        if check is not None:
            used |= {"Checksum", check.maker, *(["wrong_check"] if _has_late_check(views) else [])}
            used |= {"find_crc"} if check.selectable else set()
        used |= _check_makers(views)
        match view:
            case UniqueView():
                used |= {"UNREAD", "UNREADABLE", *(["Struct"] if view.whole_sizes else [])}
                typing |= {"Any"}
            case PartsView():
                used |= {"wrong_check", view.blocks.view.maker} if view.blocks else set()
                used |= {"UNREAD"} if view.quick else set()
                used |= {"REFUSALS", "settled"} if _has_after(views) else set()
            case MarkedView():
                used |= {"Marking", "illegal", "index", "refused"}
            case PacketView():
                used |= {"short_of", *(["Resync"] if host_of(plan) else [])}
            case KindsView():
                used |= {"Checksum", "wrong_check", *view.makers} if view.makers else set()
                used |= {"illegal", "refused"} if view.address or view.settled else set()
                used |= {
                    *(["index"] if view.address else []),
                    *(["REFUSALS", "settled"] if view.values else []),
                }
        seeds = isinstance(view, PartsView) and view.seeds
        held = self.plan.directed and bool(self.plan.beside)
        if isinstance(view, UniqueView | PartsView) and not view.address and not seeds and not held:
            typing -= set() if plan.enums else {"ClassVar"}
        if isinstance(view, PacketView) and not plan.enums:
            typing -= {"ClassVar"}
        shared = {module: used & {*names} for module, names in _SHARED.items()}
        shared["_support"] = used - _ELSEWHERE
        return Imports(
            struct=[name for name in _STRUCT if name in used],
            struct_error=True,
            binascii=_has_digits(plan),
            decimal="Decimal" in used,
            index="index" in used,
            modules={module: sorted(names, key=imported) for module, names in shared.items() if names},
            callable=isinstance(view, UniqueView | KindsView),
            typing=sorted(typing),
        )

    def _public(self, view: AnyView, decoded: Sequence[DecodedDirection]) -> list[str]:
        names = [class_name(message) for message in self.plan.messages]
        constants: list[Enum | Flags] = [*self.plan.enums, *self.plan.flags]
        names += [self.place.classes[each.name] for each in (*constants, *self.plan.layouts)]
        names += ["RECORDS"] if self.plan.layouts else []
        names += [tables.many_class(each.many) for each in self.plan.commands if each.many]
        names += ["OtherReply"] if any(each.meant for each in self.plan.commands) else []
        names += ["BUS", "COMMANDS", "MESSAGES", "Message", "StreamDecoder", *_PUBLIC]
        names += [each.function for each in decoded]
        names += ["answer_unknown"] if unknown_view(self.plan) else []
        names += ["answer_to"] if _asked(self.plan) else []
        match view:
            case PacketView():
                names += ["Request", "Response", "decode_request", "decode_response"]
                names += ["RESYNC", "Resync"] if host_of(self.plan) else []
            case MarkedView():
                names += ["MARKING", "Marking"]
            case KindsView():
                pass
            case UniqueView() | PartsView():
                names += ["BREAK" if view.broken else "IDLE"] if view.idle else []
                silent = isinstance(view, PartsView) and view.silent and not view.broken
                names += ["IDLE_ALONE"] if silent else []
        if not isinstance(view, PacketView):
            names += ["encode", *(["Codec"] if view.check and view.check.selectable else [])]
        return sorted(set(names), key=by_kind)


def _based(plan: Plan) -> tuple[str, ...]:
    """The directions whose messages have a base class: those with messages, and requests, which it tells."""
    sent = {"request", *(message.direction for message in plan.messages)}
    return tuple(way for way in plan.ways if way and way in sent)


def _view(plan: Plan, title: str, sizes: Sequence[int], make: Maker) -> AnyView:
    if plan.frame.kinds:
        return kinds_view(plan, title, make)
    view = frames.view_of(plan, title, sizes)
    if not isinstance(view, PartsView):
        return view
    after = after_view(plan.frame.envelope, plan.messages[0], make.place, make.scale)
    return replace(view, after=after)


def _asked(plan: Plan) -> list[str]:
    """The rows of the table of answers that only their request tells apart; none without a decoder."""
    if "response" not in plan.received_directions:
        return []
    return [
        f"{class_name(plan.message(request))}: {tables.tuple_of([class_name(each) for each in answers])}"
        for request, answers in plan.asked.items()
    ]


def _stream_decoder(directions: Sequence[str]) -> list[str]:
    """The signature of the method that creates a stream decoder."""
    default = f" = {directions[0]}" if len(directions) == 1 else ""
    argument = f"direction: Literal[{', '.join(directions)}]{default}"
    line = f"def StreamDecoder(self, {argument}) -> StreamDecoder:"
    if len(line) + 4 <= WIDTH:
        return [line]
    return ["def StreamDecoder(", f"    self, {argument}", ") -> StreamDecoder:"]


def _tidy(text: str) -> str:
    """Remove trailing blanks, and limit consecutive empty lines to two."""
    text = re.sub(r"[ \t]+$", "", text, flags=re.MULTILINE)
    return fitted(re.sub(r"\n{4,}", "\n\n\n", text).rstrip("\n") + "\n")


def _placed(template: str, module: ModuleView, **parts: str) -> str:
    """Render a template; ``parts`` are texts rendered from others."""
    return templates().get_template(f"templates/{template}").render(vars(module), **parts)


def _check_makers(views: Sequence[AnyView]) -> set[str]:
    """What the check values of frames use."""
    parts = [each for each in views if isinstance(each, PartsView)]
    late = [check for each in parts for check in (each.after.checks if each.after else ())]
    makers = {check.view.maker for each in parts for check in each.checks}
    return makers | ({"wrong_check", *(check.view.maker for check in late)} if late else set())


def _has_digits(plan: Plan) -> bool:
    codings = [each.transparency for each in plan.frame.every]
    stages = [stage for each in codings if isinstance(each, Coded) for stage in each.stages]
    return any(isinstance(stage, Digits) for stage in stages)


def _has_after(views: Sequence[AnyView]) -> bool:
    """Whether frames end with parts that only some have, with values in them."""
    return any(isinstance(each, PartsView) and each.after and each.after.values for each in views)


def _has_late_check(views: Sequence[AnyView]) -> bool:
    """Whether a check value is compared with the whole frame, not before its payload is there."""
    parts = [each for each in views if isinstance(each, PartsView)]
    return not parts or any(not check.early for each in parts for check in each.checks)
