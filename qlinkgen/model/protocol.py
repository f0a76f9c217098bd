"""The root of the model."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from functools import cached_property
from typing import assert_never

from qlinkgen._dataclass import dataclass
from qlinkgen.model.fields import Value
from qlinkgen.model.frame import DelimitedFrame, Frame, FrameKinds, MarkedFrame, PacketFrame, PartBits
from qlinkgen.model.message import Direction, Example, Message
from qlinkgen.model.texts import Text, without_texts
from qlinkgen.model.transaction import Bus, Command, Exchange, Reply, Unknown, exchanges_of
from qlinkgen.model.types import ByteOrder, Enum, Flags


@dataclass(frozen=True)
class Protocol:
    """A protocol as described by its schema, validated, with all derived numbers.

    ``commands`` are the transactions, ``messages`` all messages of all directions in schema order.
    """

    name: str
    title: Text
    revision: Text
    source: Text
    doc: Text
    byteorder: ByteOrder
    enums: tuple[Enum, ...]
    flags: tuple[Flags, ...]
    frame: Frame
    bus: Bus
    commands: tuple[Command, ...]
    messages: tuple[Message, ...]
    #: SHA-256 of the schema text with normalised line ends, 12 hex digits; appears in every generated banner.
    schema_hash: str
    #: File name of the schema, without its folder.
    schema_file: Text
    #: The version of the protocol that was chosen, "" for the newest one.
    version: Text = ""
    #: False after `without_texts`.
    texts: bool = True
    examples: tuple[Example, ...] = ()
    #: What a slave replies to a request with an unknown number, None if it is silent.
    to_unknown: Unknown | None = None
    #: The schema that it includes, relative to its own, "" for none.
    includes: str = ""

    @property
    def both_ask(self) -> bool:
        """Whether both sides of a link send requests."""
        return any(command.asker != "first" for command in self.commands)

    def without_texts(self) -> Protocol:
        """The protocol without free text, so that generated code contains only names and numbers.

        Back-ends then print text on the wire, such as the default of a field, as numbers.
        """
        file = f"{self.name}.yaml"
        return replace(without_texts(self), title=self.name, schema_file=file, texts=False)

    @cached_property
    def by_name(self) -> dict[str, Message]:
        """Messages by full name ("motion.request", "keypad_mode")."""
        return {message.name: message for message in self.messages}

    def message(self, name: str) -> Message:
        """The message with a full name; the name of a command gives its request. Raises KeyError."""
        return self.by_name.get(f"{name}.request") or self.by_name[name]

    def received(self, direction: Direction) -> tuple[Message, ...]:
        """Messages that a decoder for a direction accepts, those that both sides send included."""
        return tuple(
            m for m in self.messages if m.direction in (direction, "message") and not self.is_asked(m)
        )

    @cached_property
    def carrier(self) -> Message | None:
        """The message that carries answers which only their request tells apart, None without any."""
        return next((each for each in self.messages if each.carries), None)

    def is_turned(self, message: Message) -> bool:
        """Whether only its turn in a dialogue tells a message."""
        return isinstance(self.frame, FrameKinds) and self.frame.is_turned(message.id)

    def is_asked(self, message: Message) -> bool:
        """Whether only its request tells a message from others."""
        carrier = self.carrier
        same = carrier is not None and message.direction == "response" and message.id == carrier.id
        return same and message is not carrier

    @property
    def directions(self) -> tuple[Direction, ...]:
        """Directions in use: ("request", "response") or ("message",)."""
        used = {message.direction for message in self.messages}
        return ("message",) if used == {"message"} else ("request", "response")

    @property
    def address_name(self) -> str | None:
        """Name of the frame's address ("node", "address"), None if there is none."""
        match self.frame:
            case MarkedFrame():
                return self.frame.address_name
            case DelimitedFrame() | FrameKinds():
                return self.frame.address.name if self.frame.address else None
            case PacketFrame():
                return None
            case _:
                assert_never(self.frame)

    @property
    def frame_values(self) -> tuple[Value, ...]:
        """Values of every frame, beside those of its message."""
        return self.frame.values if isinstance(self.frame, DelimitedFrame | FrameKinds) else ()

    def beside(self, message: Message) -> tuple[Value, ...]:
        """Values of the frame of a message."""
        frame: Frame = self.frame
        if isinstance(frame, FrameKinds):
            frame = frame.carrying(message.id)[0].frame
        return frame.towards(message.direction).values if isinstance(frame, DelimitedFrame) else ()

    @property
    def counter(self) -> PartBits | None:
        """The counter among the values of frames, None if there is none."""
        return self.frame.counter if isinstance(self.frame, DelimitedFrame | FrameKinds) else None

    @property
    def restarts(self) -> bool:
        """Whether the counter begins anew after some commands."""
        return any(command.restart is not None for command in self.commands)

    def counts(self, message: Message) -> bool:
        """Whether the counter counts a message."""
        frame, counter = self.frame, self.counter
        if not isinstance(frame, DelimitedFrame | FrameKinds) or counter is None:
            return False
        return frame.counts(message.id) and any(each.name == counter.name for each in self.beside(message))

    def keeps(self, command: Command) -> bool:
        """Whether a slave keeps its answer to a command, for a request with the same number."""
        counting = self.counter.counting if self.counter else None
        if counting is None or not counting.again or not self.counts(command.request):
            return False
        return command.response is not None and command.many is None and not command.steps

    @property
    def master(self) -> PartBits | None:
        """The number of the master among the values of frames, None if there is none."""
        return self.frame.master if isinstance(self.frame, DelimitedFrame) else None

    @property
    def repeated(self) -> tuple[str, ...]:
        """Values of frames that answers repeat."""
        return self.frame.repeated if isinstance(self.frame, DelimitedFrame | FrameKinds) else ()

    @property
    def part_sections(self) -> dict[str, str]:
        """Sections of the document that describe parts of the frame, by part."""
        frames = [self.frame] if isinstance(self.frame, DelimitedFrame) else []
        if isinstance(self.frame, FrameKinds):
            frames = [each.frame for each in self.frame.kinds]
        return {part.name: part.section for frame in frames for part in frame.parts}

    def command_of(self, message: Message) -> Command | None:
        """The transaction of a message, None if it has none."""
        return next((command for command in self.commands if message in command.messages), None)

    @cached_property
    def replies(self) -> Mapping[str, Reply]:
        """Answers other than responses, and responses that may refuse, by the full name of their message."""
        return {reply.message.name: reply for command in self.commands for reply in command.meant}

    @cached_property
    def exchanges(self) -> Mapping[str, Exchange]:
        """What the master sends in transactions, by the full name of the message."""
        return {each.sent.name: each for each in exchanges_of(self.commands)}
