"""The root of a plan."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from functools import cached_property
from typing import get_args

from qlinkgen._dataclass import dataclass
from qlinkgen.model.fields import Layout, layouts_of
from qlinkgen.model.message import Direction, Message
from qlinkgen.model.protocol import Protocol
from qlinkgen.model.transaction import Command
from qlinkgen.model.types import Enum, Flags, Scalar
from qlinkgen.model.words import Words
from qlinkgen.plan.envelope import Envelope
from qlinkgen.plan.expr import OneOf
from qlinkgen.plan.framing import FramePlan
from qlinkgen.plan.payload import Member, PayloadPlan
from qlinkgen.plan.select import Role
from qlinkgen.plan.text_ids import TextIds, text_ids

_DIRECTIONS: tuple[Direction, ...] = get_args(Direction)


def shortest(frames: Sequence[FramePlan], size: int) -> FramePlan:
    """The first kind of frame with room for a payload of a size, else the last."""
    return next((each for each in frames if each.holds(size)), frames[-1])


@dataclass(frozen=True, eq=False)
class MessagePlan:
    """A message: its description in the document, and the steps of its payload.

    Attributes:
        message: names, numbers and texts, as the document states them.
        payload: the steps; equal layouts compare equal.
        frames: the kinds of frame that may carry it, the shortest first.
        envelope: the parts of its longest frame, without the check value if the message has none.
        allowed: addresses that it may carry, None if the frame has no address.
        frame_size: maximum size of its frame before stuffing.
        wire_size: maximum size on the wire.
        encoded: whether the role of the plan sends it.
        decoded: whether the role of the plan receives it.
        asked: whether only its request tells it from other answers, which the carrier carries.
    """

    message: Message
    payload: PayloadPlan
    frames: tuple[FramePlan, ...]
    envelope: Envelope
    allowed: OneOf | None
    frame_size: int
    wire_size: int
    encoded: bool
    decoded: bool
    asked: bool

    @property
    def name(self) -> str:
        """Full name ("motion.request", "keypad_mode")."""
        return self.message.name

    @property
    def id(self) -> int:
        """Number of the message in the frame."""
        return self.message.id

    @property
    def direction(self) -> Direction:
        """Whether the master or the slave sends it, or both."""
        return self.message.direction

    @property
    def number(self) -> int:
        """Its number in its frame, without that of the family of kinds."""
        return self.message.id - self.frames[-1].base

    @property
    def least_frame(self) -> int:
        """Minimum size of its frame before stuffing."""
        return self.envelope_in(self.frame_for(self.payload.least)).least_overhead + self.payload.least

    @property
    def most_frame(self) -> int:
        """Size of its frame around the longest payload, before stuffing."""
        return self.envelope_in(self.frame_for(self.payload.most)).overhead + self.payload.most

    def frame_for(self, size: int) -> FramePlan:
        """The shortest kind of frame for a payload of a size; the longest if none has room for it."""
        return shortest(self.frames, size)

    def envelope_in(self, frame: FramePlan) -> Envelope:
        """The parts of its frame of a kind."""
        own = self.message.settled
        return self.envelope if frame is self.frames[-1] else frame.envelope.fixing(dict(own))

    @property
    def turned(self) -> bool:
        """Whether only its turn in a dialogue tells it, so its frame is its payload."""
        return bool(self.frames) and self.frames[-1].turned

    @property
    def checked(self) -> bool:
        """Whether it has a check value."""
        return self.envelope.check is not None


@dataclass(frozen=True, eq=False)
class Plan:
    """A protocol, reduced to the messages of an output.

    Attributes:
        protocol: names, texts and transactions, as the document states them.
        role: the role that the output is for.
        frames: the frame around each message, by direction; directions with the same frame share one object.
        messages: the selected messages, in schema order.
        commands: transactions whose request is selected; the response may not be in ``messages``.
        enums: enums used by selected messages; all enums if no message is left out.
        flags: likewise for flags.
        received_directions: directions that the role receives.
    """

    protocol: Protocol
    role: Role
    frames: Mapping[Direction, FramePlan]
    messages: tuple[MessagePlan, ...]
    commands: tuple[Command, ...]
    enums: tuple[Enum, ...]
    flags: tuple[Flags, ...]
    received_directions: tuple[Direction, ...]

    @property
    def frame(self) -> FramePlan:
        """The frame of responses, or all kinds of frame; in most protocols every direction has the same."""
        return self.frames["message" if self.frames["message"].kinds else "response"]

    @property
    def directed(self) -> bool:
        """Whether parts of the only frame are in one direction alone, though both are found alike."""
        several = bool(self.frame.kinds)
        return self.frames["request"] is not self.frame and not self.frame.needs_request and not several

    @property
    def parted(self) -> bool:
        """Whether some kinds of frame go one direction alone."""
        return any(each.only for each in self.frame.kinds)

    def around(self, direction: Direction) -> FramePlan:
        """The frame of a direction, or all kinds of frame: its address and values are those of functions."""
        return self.frame if self.frame.kinds else self.frames[direction]

    @property
    def ways(self) -> Mapping[str, Plan]:
        """The plans of each kind of frame, by the direction whose frames it is; "" if both have the same."""
        if not self.directed:
            return {"": self}
        found: dict[str, Plan] = {}
        for each in ("request", "response"):
            found[each] = replace(self, frames=dict.fromkeys(self.frames, self.frames[each]))
        return found

    @cached_property
    def beside(self) -> Mapping[str, Member]:
        """The values of frames of any direction, by name."""
        return {**self.frames["request"].values, **self.frame.values}

    @cached_property
    def layouts(self) -> tuple[Layout, ...]:
        """The records of the selected messages, each before those that contain it."""
        return layouts_of(field for each in self.messages for field in each.message.fields)

    @cached_property
    def by_name(self) -> Mapping[str, MessagePlan]:
        """Messages by full name."""
        return {message.name: message for message in self.messages}

    def message(self, name: str) -> MessagePlan:
        """The message with a full name; the name of a command gives its request. Raises KeyError."""
        return self.by_name.get(f"{name}.request") or self.by_name[name]

    def received(self, direction: Direction) -> tuple[MessagePlan, ...]:
        """Messages that a decoder for a direction accepts, those that both sides send included."""
        return self._received[direction]

    @cached_property
    def _received(self) -> Mapping[Direction, tuple[MessagePlan, ...]]:
        told = [each for each in self.messages if not each.asked and not each.turned]
        return {
            direction: tuple(each for each in told if each.direction in (direction, "message"))
            for direction in _DIRECTIONS
        }

    @property
    def turned(self) -> tuple[MessagePlan, ...]:
        """Messages that only their turn in a dialogue tells."""
        return tuple(each for each in self.messages if each.turned)

    @cached_property
    def asked(self) -> Mapping[str, tuple[MessagePlan, ...]]:
        """Answers that only their request tells apart, by its name: the response first, then other replies.

        The first one whose payload is valid is the answer.
        """
        found = {}
        for command in self.commands:
            answers = [self.by_name.get(each.name) for each in command.messages[1:]]
            asked = tuple(each for each in answers if each is not None and each.asked)
            if asked:
                found[command.request.name] = asked
        return found

    def turn_of(self, message: MessagePlan) -> tuple[int, int]:
        """Bytes of a turned message without a list that an earlier frame counts, and bits of an item of that.

        Both are 0 if the message gives its size itself.
        """
        for command in self.protocol.commands:
            if command.sizes and command.response is message.message:
                ((name, _),) = command.sizes
                listed = next(each for each in message.message.fields if each.name == name)
                return message.message.min_size - listed.min_size, listed.item_bits
        return 0, 0

    def is_first(self, message: MessagePlan) -> bool:
        """Whether a message is the answer to its request whenever its payload is valid."""
        return any(answers[0].name == message.name for answers in self.asked.values())

    @cached_property
    def carrier(self) -> MessagePlan | None:
        """The message that carries them, None if there are none."""
        return next((each for each in self.messages if each.message.carries), None)

    def texts(self, direction: Direction) -> TextIds | None:
        """The ids that payloads of a direction begin with, None if other parts hold ids."""
        return text_ids(each.message for each in self.received(direction))

    @property
    def id_words(self) -> tuple[Words, ...]:
        """The ids of the selected messages as words of their payloads, each once."""
        firsts = (each.message.fields[0].type for each in self.messages if each.message.opened)
        found = {each.text for each in firsts if isinstance(each, Scalar) and isinstance(each.text, Words)}
        return tuple(sorted(found, key=lambda each: each.enum))

    def known(self, direction: Direction) -> Mapping[int, MessagePlan]:
        """Messages that a decoder for a direction accepts, by number."""
        return self._known[direction]

    @cached_property
    def _known(self) -> Mapping[Direction, Mapping[int, MessagePlan]]:
        # Decoders look each frame up in it.
        return {each: {message.id: message for message in self.received(each)} for each in _DIRECTIONS}

    def direction_of(self, message: MessagePlan) -> Direction:
        """The direction that a decoder of the message has to be set to."""
        return self.received_directions[0] if message.direction == "message" else message.direction

    @property
    def max_wire_size(self) -> int:
        """Maximum size of a selected message on the wire."""
        return max((message.wire_size for message in self.messages), default=0)
