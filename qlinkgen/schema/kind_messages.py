"""Second pass, messages of several kinds of frame: builds each message for the frames that carry it."""

from __future__ import annotations

from typing import Literal

from qlinkgen.model.frame import Frame, FrameKinds, PartBits
from qlinkgen.model.message import Direction, Message
from qlinkgen.model.transaction import Addressing, Bus
from qlinkgen.schema.fields import FieldBuilder
from qlinkgen.schema.file_base import Fact
from qlinkgen.schema.file_commands import CommandSpec, MessageSpec
from qlinkgen.schema.file_model import SchemaFile
from qlinkgen.schema.frame_kinds import family_frame
from qlinkgen.schema.frames import payload_bounds
from qlinkgen.schema.kind_names import message_kind, named_kinds
from qlinkgen.schema.messages import MessageBuilder, Written, sent_by
from qlinkgen.schema.report import Reporter, listed
from qlinkgen.schema.source import Path
from qlinkgen.schema.types import TypeBuilder


class KindMessages:
    """Builds messages, each with the builder of the family of kinds that carries it."""

    def __init__(
        self, file: SchemaFile, report: Reporter, types: TypeBuilder, kinds: FrameKinds, bus: Bus
    ) -> None:
        """``types`` are those of fields."""
        self._file = file
        self._report = report
        self._kinds = kinds
        self.places: dict[str, Path] = {}
        self.id_places: dict[str, Path] = {}
        self._builders: dict[int, MessageBuilder] = {}
        named = {kind for kind, _ in named_kinds(file)}
        #: The family of each kind that messages name, None for all others, by the direction that it goes.
        self._families: dict[str | None, dict[str | None, int]] = {}
        for each in kinds.kinds:
            name = each.name if each.name in named else None
            self._families.setdefault(name, {})[each.only] = each.family
        for family in sorted({each.family for each in kinds.kinds}):
            frame = family_frame(kinds, family)
            fields = FieldBuilder(file, report, types, frame.payload.max_size)
            builder = MessageBuilder(
                file, report, fields, frame, bus, base=kinds.base(family), turned=frame.is_payload
            )
            builder.places, builder.id_places = self.places, self.id_places
            self._builders[family] = builder

    @property
    def addressed(self) -> bool:
        """Whether any kind has an address."""
        return self._kinds.address is not None

    def turned(self, message: Message) -> bool:
        """Whether only its turn tells a message."""
        return self._kinds.is_turned(message.id)

    @property
    def numbered(self) -> tuple[str, ...]:
        """Counters of the frame that answers repeat."""
        return next((each.numbered for each in self._builders.values() if each.numbered), ())

    @property
    def ways(self) -> PartBits | None:
        """Values of the direction: kinds have none."""
        return None

    def directed(
        self, name: str, spec: CommandSpec, layout: Written, *, addressing: Addressing, section: str
    ) -> Message:
        """Request or response of a command."""
        direction: Direction = "request" if layout.part == "request" else "response"
        return self._of(layout.kind, ("commands", name), direction, f"{name}.{direction}").directed(
            name, spec, layout, addressing=addressing, section=section
        )

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
        return self._of(layout.kind, layout.path, direction, layout.part).reply(
            command, spec, layout, addressing=addressing, direction=direction
        )

    def single(self, name: str, spec: MessageSpec) -> Message:
        """A message without a response."""
        direction = sent_by(self._file, spec)
        kind = message_kind(self._file, spec.frame)
        return self._of(kind, ("messages", name), direction, name).single(name, spec)

    def _of(self, kind: str | None, path: Path, direction: Direction, whose: str) -> MessageBuilder:
        """The builder of the messages of a kind that go a direction; ``whose`` is the name of one."""
        found = self._families.get(kind, {})
        family = found.get(direction, found.get(None))
        if kind is None and not found:
            what = f"{path[-1]} does not name the kind of its frame"
            hint = f"add frame: {listed([each for each in self._families if each], 'or')}"
            self._report.error("bad-kinds", path, what, hint, of_key=True, absent=True)
        elif found and family is None:
            only = listed([str(each) for each in found], "or")
            what = f"{whose} is a {direction}, but frames of its kind are only {only}s"
            hint = "let it name another kind"
            if direction == "message":
                what = f"{whose} has no direction, which its frame states"
                hint = f"add direction: {only}"
            self._report.error("bad-kinds", path, what, hint, of_key=True)
        return self._builders[next(iter(found.values()), 0) if family is None else family]


AnyMessages = MessageBuilder | KindMessages


def message_builder(
    file: SchemaFile, report: Reporter, types: TypeBuilder, frame: Frame | None, bus: Bus
) -> AnyMessages:
    """The builder of the messages of a file; ``frame`` is None if it could not be built."""
    if isinstance(frame, FrameKinds):
        return KindMessages(file, report, types, frame, bus)
    fields = FieldBuilder(file, report, types, payload_bounds(file)[1])
    return MessageBuilder(file, report, fields, frame, bus)
