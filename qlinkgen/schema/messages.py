"""Second pass, messages: builds each message and checks that it fits the frame."""

from __future__ import annotations

import itertools
from collections.abc import Collection, Sequence
from collections.abc import Set as AbstractSet
from dataclasses import replace
from typing import Literal, NamedTuple, assert_never

from qlinkgen.model.fields import Field, Record, Records
from qlinkgen.model.frame import DelimitedFrame, MarkedFrame, OneFrame, PacketFrame, PartBits
from qlinkgen.model.message import Direction, Message
from qlinkgen.model.transaction import Addressing, Bus
from qlinkgen.model.types import Array, Bits, Blob, Chunk, Scalar
from qlinkgen.schema.asked import AskedBuilder
from qlinkgen.schema.fields import FieldBuilder
from qlinkgen.schema.file_base import Fact
from qlinkgen.schema.file_commands import CommandSpec, MessageSpec
from qlinkgen.schema.file_fields import Fields
from qlinkgen.schema.file_model import SchemaFile
from qlinkgen.schema.frame_values import FrameValues, frame_values
from qlinkgen.schema.notation import Divider, StatedId
from qlinkgen.schema.part_texts import fields_without_end
from qlinkgen.schema.pieces import IdBuilder
from qlinkgen.schema.report import Reporter
from qlinkgen.schema.seeds import SeedBuilder
from qlinkgen.schema.separated import check_separator, separated
from qlinkgen.schema.sides import check_side
from qlinkgen.schema.source import Path
from qlinkgen.schema.text_ids import Opener

_FRAME: Path = ("frame",)


class Written(NamedTuple):
    """A message as written.

    Attributes:
        part: request, response, or the name of a reply or message.
        number: its number.
        number_path: the place that states it.
        fields: its fields.
        path: their place.
        asked: those with a number of items from the request.
        separator: the byte between them, None if it is that of the defaults.
        way: the value of the direction, if it is not that of a request or a response.
        kind: the kind of its frame, None if nothing names one.
        inherited: its number is that of its request.
    """

    part: str
    number: StatedId
    number_path: Path
    fields: Fields
    path: Path
    asked: Collection[str] = ()
    separator: Divider | None = None
    way: str = ""
    kind: str | None = None
    inherited: bool = False


class MessageBuilder:
    """Builds messages and checks each against the frame."""

    def __init__(
        self,
        file: SchemaFile,
        report: Reporter,
        fields: FieldBuilder,
        frame: OneFrame | None,
        bus: Bus,
        *,
        base: int = 0,
        turned: bool = False,
    ) -> None:
        """``frame`` is None if it could not be built; checks that depend on it are skipped.

        ``base`` is added to the numbers of messages, see `FrameKinds`. If ``turned``, only its turn in a
        dialogue tells a message.
        """
        self._base = base
        self._file = file
        self._report = report
        self._fields = fields
        self._frame = frame
        self._bus = bus
        self._seeds = SeedBuilder(file, report, frame)
        #: Paths of the fields and of the number of each message, by its name.
        self.places: dict[str, Path] = {}
        self.id_places: dict[str, Path] = {}
        self._ids = IdBuilder(report, frame)
        self._opener = Opener(frame, report)
        #: Numbers of messages that only their turn tells, None for others.
        self._turns = itertools.count() if turned else None
        self.asked = AskedBuilder(file, report, fields, frame)

    @property
    def addressed(self) -> bool:
        """Whether the frame has an address."""
        if isinstance(self._frame, DelimitedFrame):
            return self._frame.address is not None
        return isinstance(self._frame, MarkedFrame)

    def turned(self, message: Message) -> bool:  # noqa: ARG002  # as of several kinds of frame
        """Whether only its turn tells a message: that takes several kinds of frame."""
        return False

    @property
    def numbered(self) -> tuple[str, ...]:
        """Values of the frame that answers repeat, and of which each frame of a master has another one."""
        counter = self._frame.counter if isinstance(self._frame, DelimitedFrame) else None
        return (counter.name,) if counter and counter.name in self._echoed("response") else ()

    def directed(
        self, name: str, spec: CommandSpec, layout: Written, *, addressing: Addressing, section: str
    ) -> Message:
        """Request or response of a command."""
        direction: Direction = "request" if layout.part == "request" else "response"
        ranges, default = self._addresses(addressing, direction)
        number = self._number(layout, direction, f"{name}.{direction}")
        message = Message(
            name=f"{name}.{direction}",
            command=name,
            direction=direction,
            id=number,
            fields=self._fields_of(layout, direction),
            doc=spec.doc,
            section=section,
            confirmed=spec.confirmed,
            empty_is_default=direction == "request" and spec.empty_request == "defaults",
            echoed=self._echoed(direction),
            settled=self._settled(layout, direction),
            checksum=self._has_checksum(name),
            addresses=ranges,
            default_address=default,
            seeds=self._seeds.of_command(name, number),
            separator=self._separator(layout).byte,
            leading=self._separator(layout).before,
        )
        return self._added(message, layout)

    def _echoed(self, direction: Direction) -> tuple[str, ...]:
        """Values of the frame that an answer repeats."""
        if direction != "response" or not isinstance(self._frame, DelimitedFrame):
            return ()
        return self._frame.repeated

    def reply(
        self,
        command: str,
        spec: Fact,
        layout: Written,
        *,
        addressing: Addressing,
        direction: Literal["request", "response"] = "response",
    ) -> Message:
        """An answer other than the response, or a step; ``command`` is "" if it is that of all."""
        ranges, default = self._addresses(addressing, direction)
        name = f"{command}.{layout.part}" if command else layout.part
        number = self._number(layout, direction, name)
        message = Message(
            name=name,
            command=command or name,
            direction=direction,
            id=number,
            fields=self._fields_of(layout, direction),
            doc=spec.doc,
            section=spec.section,
            confirmed=spec.confirmed,
            echoed=self._echoed(direction),
            settled=self._settled(layout, direction),
            checksum=self._has_checksum(command or name),
            addresses=ranges,
            default_address=default,
            seeds=self._seeds.of_command(command, number),
            separator=self._separator(layout).byte,
            leading=self._separator(layout).before,
        )
        return self._added(message, layout)

    def _separator(self, layout: Written) -> Divider:
        """The separator of a message, which may be that of the defaults; none without fields."""
        usual = self._file.defaults.separator or Divider()
        return (usual if layout.separator is None else layout.separator) if layout.fields else Divider()

    def _fields_of(self, layout: Written, direction: Direction) -> tuple[Field, ...]:
        fields = self._fields.build(
            layout.fields,
            layout.path,
            layout.asked,
            divider=self._separator(layout),
            beside=self._beside(layout, direction),
        )
        separator = self._separator(layout).byte
        if not separator:
            return fields_without_end(fields, self._frame, layout.path, self._report)
        for name in layout.asked:
            what = f"the size of {name} follows from the separator after it"
            self._report.error("bad-separator", (*layout.path, name), what, "write its range", of_key=True)
        return separated(fields, separator, self._frame, layout.path, self._report)

    def _beside(self, layout: Written, direction: Direction) -> FrameValues:
        """The values of the frame of a message; they matter only where a field has a condition."""
        if not any(spec.when for spec in layout.fields.values()):
            return FrameValues()
        return frame_values(
            self._frame,
            direction,
            [name for name, _ in self._settled(layout, direction)],
            several=bool(self._file.frames),
            separated=bool(self._separator(layout).byte),
        )

    @property
    def ways(self) -> PartBits | None:
        """The part, or the bits, with the direction."""
        return self._ids.direction

    def _number(self, layout: Written, direction: Direction, name: str) -> int:
        path, command = layout.number_path, name.partition(".")[0]
        usual = path in (("commands", command, "id"), ("messages", name, "id"))
        stated = StatedId(None) if layout.inherited and not self._ids.identifies else layout.number
        whose = "" if usual else name
        if self._turns is not None:
            self._ids.number(stated, direction, path, whose)
            return self._base + next(self._turns)
        return self._base + self._ids.number(stated, direction, path, whose, way=layout.way)

    def _settled(self, layout: Written, direction: Direction) -> tuple[tuple[str, int], ...]:
        """Values of its frame that a message fixes."""
        return () if layout.inherited else self._ids.fixed(layout.number, direction, layout.number_path)

    def _added(self, message: Message, layout: Written) -> Message:
        if (text := self._ids.text(message.id)) is not None:
            message = self._opener.opened(message, text, layout.path)
        if tested := {test.value for field in message.fields for test in field.when}:
            known = self._beside(layout, message.direction).known.values()
            message = replace(message, decided_by=tuple(each for each in known if each.name in tested))
        if any(field.walked for field in message.fields):
            message = replace(message, limit=self._limits()[1])
        self.places[message.name] = layout.path
        self.id_places[message.name] = layout.number_path
        self._check(message, layout.path, frozenset(layout.asked))
        return message

    def single(self, name: str, spec: MessageSpec) -> Message:
        """A message without a response."""
        path: Path = ("messages", name, "fields")
        layout = Written(
            name, StatedId(spec.id), ("messages", name, "id"), spec.fields, path, (), spec.separator
        )
        nodes = self._bus.nodes if self.addressed else None
        direction = self._sent(name, spec)
        number = self._number(layout, direction, name)
        message = Message(
            name=name,
            command=name,
            direction=direction,
            id=number,
            fields=self._fields_of(layout, direction),
            doc=spec.doc,
            section=spec.section,
            confirmed=spec.confirmed,
            settled=self._settled(layout, direction),
            checksum=self._has_checksum(name),
            addresses=(nodes,) if nodes else (),
            default_address=nodes[0] if nodes else 0,
            seeds=self._seeds.of(name, number, spec.attributes, ("messages", name)),
            separator=self._separator(layout).byte,
            leading=self._separator(layout).before,
        )
        message = self._added(message, layout)
        if isinstance(self._frame, PacketFrame) and direction != "request":
            what = f"{name} is not the response to a request"
            hint = "add direction: request, or make it a command"
            self._report.error("bad-packet", ("messages", name), what, hint, of_key=True, absent=True)
        return message

    def carrier(self, answers: Sequence[Message]) -> Message:
        """The message that carries answers which only their request tells apart."""
        self.asked.check_name()
        path = self.id_places[answers[0].name]
        message = self.asked.carrier(answers, path)
        if (text := answers[0].text) is not None:
            message = self._opener.opened(message, text, path)
        self.places[message.name] = self.id_places[message.name] = path
        return message

    def _sent(self, name: str, spec: MessageSpec) -> Direction:
        """The direction of a message outside of commands: stated, or by the side of a link that sends it."""
        place: Path = ("messages", name, "from")
        if spec.side is not None and spec.direction is not None:
            what, needs = f"{name} has a side and a direction", (place, ("bus",))
            self._report.error("bad-link", place, what, "remove one of them", of_key=True, needs=needs)
        elif spec.side is not None:
            check_side(self._file, name, spec.side, place, self._report)
        return sent_by(self._file, spec)

    def _addresses(
        self, addressing: Addressing, direction: Direction
    ) -> tuple[tuple[tuple[int, int], ...], int]:
        """Ranges of legal addresses of a message, and its default address."""
        nodes, broadcast = self._bus.nodes, self._bus.broadcast
        if addressing == "none" or nodes is None or not self.addressed:
            return (), 0
        everybody = (broadcast, broadcast) if broadcast is not None else nodes
        if direction == "response" or addressing == "node":
            return (nodes,), nodes[0]
        if addressing == "broadcast":
            return (everybody,), everybody[0]
        return _joined((everybody, nodes)), nodes[0]

    def _has_checksum(self, name: str) -> bool:
        marked = self._file.frame.marked
        only = marked.checksum.only if marked and marked.checksum else None
        return only is None or name in only

    # Checks against the frame

    def _check(self, message: Message, path: Path, asked: AbstractSet[str]) -> None:
        if self._frame is None:
            return
        self._check_size(message, path)
        if message.separator:
            check_separator(message, self._frame, path, self._report)
        if message.empty_is_default and (why := _why_not_empty(message)):
            what = f"{message.name} has {why}, so an empty one is not all its defaults"
            self._error("bad-condition", (*path[:-1], "empty_request"), what, "remove empty_request")
        if isinstance(self._frame, DelimitedFrame) and self._frame.payload.trim is not None:
            self._check_trim(message, path)
        if isinstance(self._frame, MarkedFrame):
            for field in message.fields:
                self._check_marker(field, self._frame.marker, path)
            return
        self._check_end(message, path, asked)
        self._check_steps(message, path)
        if isinstance(self._frame, PacketFrame):
            self._check_words(message, self._frame.word_size, path)
            if message.direction == "response" and not message.max_size and not self._frame.checksum:
                what = f"{message.name} would be empty: it has neither fields nor a check value"
                self._error("bad-response", path, what, "use response: none, or add a checksum to the packet")

    def _error(self, rule: str, path: Path, what: str, hint: str) -> None:
        self._report.error(rule, path, what, hint, of_key=True, needs=(path, _FRAME))

    def _limits(self) -> tuple[int, int | None]:
        """Minimum and maximum size of payloads in the frame."""
        if isinstance(self._frame, DelimitedFrame):
            return self._frame.payload.min_size, self._frame.payload.max_size
        low = self._file.frame.marked.payload[0] if self._file.frame.marked is not None else 0
        return low, self._frame.payload_max if self._frame is not None else None

    def _check_size(self, message: Message, path: Path) -> None:
        low, high = self._limits()
        assert high is not None
        # The maximum of records of variable size is what the frame allows; others may be more.
        usual = message.usual_size if message.limit is not None else 0
        for what, size in (
            ("at least", message.min_size),
            ("up to", message.max_size),
            ("by default", usual),
        ):
            if size > high:
                hint = f"the frame allows {high}; shorten a field by {size - high}, or raise this limit"
                self._error("payload-too-long", path, f"{message.name} has {what} {size} bytes", hint)
                break
        least = 0 if message.empty_is_default else message.min_size
        if least < low:
            what = f"{message.name} can have as few as {least} bytes"
            hint = f"the frame requires {low}; lengthen a field by {low - least}, or lower this limit"
            self._error("payload-too-short", path, what, hint)
        elif not least and self._is_terminator(message):
            what = f"{message.name} can be empty, and nothing else precedes the terminator"
            self._error("payload-too-short", path, what, "add a field, or a part to the frame")

    def _is_terminator(self, message: Message) -> bool:
        """Whether an empty message is a terminator alone, perhaps after what begins the frame."""
        if not isinstance(self._frame, DelimitedFrame):
            return False
        parts = self._frame.towards(message.direction).parts
        end = next((index for index, part in enumerate(parts) if part.role == "terminator"), 0)
        first = int(parts[0].role == "constant")
        return end > 0 and not any(part.size for part in parts[first:end])

    def _check_trim(self, message: Message, path: Path) -> None:
        """Check that a receiver knows the number of zeros at the end that were not sent."""
        hint = "give it a constant size, or remove trim from the payload"
        for field in message.fields:
            if not field.fixed or field.conditional:
                what = f"the size of {field.name} varies, and zeros at the end of {message.name} are not sent"
                self._error("bad-trim", (*path, field.name), what, hint)
        if message.empty_is_default and message.max_size:
            what = f"an empty {message.name} is one of zeros, which are not sent"
            self._error("bad-trim", (*path[:-1], "empty_request"), what, "remove empty_request")

    def _check_end(self, message: Message, path: Path, asked: AbstractSet[str]) -> None:
        """Check that the fields determine the end of a frame without a length or terminator."""
        if isinstance(self._frame, DelimitedFrame) and self._frame.tells_end:
            return
        turned = self._turns is not None
        if turned and not message.min_size:
            what = f"{message.name} may have no byte, so it is over before it begins"
            self._error("no-frame-end", path, what, "give it at least one byte")
        for field in message.fields:
            if turned and field.name in asked:
                self._check_asked(message, field, asked, path)
                continue
            if field.open and not message.separator:
                neither = f"neither the frame nor {message.name} has a length"
                what = f"the end of {field.name} is unknown: {neither}"
                hint = "give it a count or a fixed size, or give the frame a length or terminator"
                if isinstance(self._frame, DelimitedFrame) and self._frame.idle:
                    hint = f"{hint}; or write alone: true at the idle line if nothing else ends a frame"
                self._error("no-frame-end", (*path, field.name), what, hint)
            if field.optional:
                what = f"{field.name} is optional, but without a length a receiver waits for it"
                hint = "give it a condition, or give the frame a length"
                self._error("no-frame-end", (*path, field.name, "optional"), what, hint)
        if message.empty_is_default and message.max_size:
            what = f"an empty {message.name} cannot be distinguished from a full one: the frame has no length"
            self._error("no-frame-end", (*path[:-1], "empty_request"), what, "remove empty_request")

    def _check_asked(self, message: Message, field: Field, asked: AbstractSet[str], path: Path) -> None:
        """Check that an earlier frame gives the size of a message."""
        varying = [each for each in message.variable if each is not field]
        odd = field.walked or field.terminated or field.conditional
        if varying or odd or message.separator or len(asked) > 1:
            what = f"the number of items of {field.name} alone does not give the size of {message.name}"
            hint = "give all other fields, and each item, constant sizes; or the kind of frame a length"
            self._error("no-frame-end", (*path, field.name), what, hint)

    def _check_steps(self, message: Message, path: Path) -> None:
        """Check that a length in steps of several bytes can state the size of the message."""
        if not isinstance(self._frame, DelimitedFrame) or (step := self._frame.length_scale) == 1:
            return
        bias = self._frame.towards(message.direction).length_bias
        hint = "add a reserved field, or reduce the scale of the length"
        sizes = {message.min_size, 0} if message.empty_is_default else {message.min_size}
        if any((size + bias) % step for size in sizes):
            what = (
                f"{message.name} has {message.min_size} bytes, which a length in steps of {step} cannot state"
            )
            self._error("bad-frame", path, what, hint)
        for field in message.variable:
            if field.walked:
                what = f"the size of {field.name} varies by any number of bytes, not by steps of {step}"
                self._error("bad-frame", (*path, field.name), what, "use records of a constant size")
                continue
            kind, change = field.type, field.max_size
            if not isinstance(kind, Scalar | Bits | Record) and not kind.length.fixed:
                change = kind.size_of(1)
            if change % step or (field.conditional and field.full_min_size % step):
                what = (
                    f"the size of {field.name} varies by less than the {step} bytes of a step of the length"
                )
                self._error("bad-frame", (*path, field.name), what, "use items of as many bytes")

    def _check_words(self, message: Message, word: int, path: Path) -> None:
        for field in message.fields:
            if not field.fixed and (field.walked or not field.open):
                what = f"{field.name} has no fixed size"
                hint = "packets have no length; give each field a fixed size"
                self._error("bad-packet", (*path, field.name), what, hint)
        if message.fixed and message.max_size % word:
            what = f"{message.name} has {message.max_size} bytes, not a multiple of the {word}-byte words"
            self._error("bad-packet", path, what, "add a reserved field, or change words of the checksum")

    def _check_marker(self, field: Field, marker: int, path: Path) -> None:
        """Check that payload bytes cannot have the marker bit."""
        if isinstance(field.type, Record | Records):
            layout = field.type.layout
            for inner in layout.fields:
                self._check_marker(inner, marker, ("types", layout.name, "fields"))
            return
        if isinstance(field.type, Blob):
            marked = not field.type.text or marker < 0x80
        elif isinstance(field.type, Scalar) and field.type.text:
            marked = marker < 0x80
        else:
            marked = any(chunk.mask & marker for chunk in _chunks(field.type))
        if marked:
            what = f"a byte of {field.name} can have the marker bit {marker:#04x}"
            hint = "send it in groups: {bits: 7, first: least}, or as text"
            self._error("marker-in-payload", (*path, field.name), what, hint)


def _chunks(kind: Scalar | Bits | Array) -> tuple[Chunk, ...]:
    match kind:
        case Bits():
            return kind.container.chunks
        case Array():
            return kind.item.chunks
        case Scalar():
            return kind.chunks
        case _:
            assert_never(kind)


def _joined(ranges: tuple[tuple[int, int], ...]) -> tuple[tuple[int, int], ...]:
    """Merge adjacent ranges."""
    joined: list[tuple[int, int]] = []
    for first, last in sorted(ranges):
        if joined and first <= joined[-1][1] + 1:
            joined[-1] = (joined[-1][0], max(last, joined[-1][1]))
        else:
            joined.append((first, last))
    return tuple(joined)


def _why_not_empty(message: Message) -> str:
    """What a message has so that an empty payload is not all its defaults, "" if nothing."""
    if any(field.conditional for field in message.fields):
        return "fields that may be absent"
    if any(field.terminated for field in message.fields):
        return "a terminator"
    return "records of variable size" if any(field.walked for field in message.fields) else ""


def sent_by(file: SchemaFile, spec: MessageSpec) -> Direction:
    """The direction of a message outside of commands: stated, or by the side of a link that sends it."""
    if spec.side is None:
        return spec.direction or "message"
    return "response" if spec.side in (file.bus.sides or [])[1:] else "request"
