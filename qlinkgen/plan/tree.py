"""The root of a plan: a protocol as every back-end prints it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property

from qlinkgen.model.message import Direction, Message
from qlinkgen.model.protocol import Protocol
from qlinkgen.model.transaction import Command
from qlinkgen.model.types import Enum, Flags
from qlinkgen.plan.expr import OneOf
from qlinkgen.plan.framing import Envelope, FramePlan
from qlinkgen.plan.payload import PayloadPlan
from qlinkgen.plan.select import Role


@dataclass(frozen=True, eq=False)
class MessagePlan:
    """A message: what the document says of it, and the steps of its payload.

    Attributes:
        message: names, numbers and texts, as the document states them.
        payload: the steps; equal layouts are equal.
        envelope: the parts of its frame, without a check value where it carries none.
        allowed: addresses that it may carry, None where the frame has no address.
        frame_size: most bytes of its frame before stuffing.
        wire_size: most bytes on the wire.
        encoded: the role that the plan is for sends it.
        decoded: the role that the plan is for receives it.
    """

    message: Message
    payload: PayloadPlan
    envelope: Envelope
    allowed: OneOf | None
    frame_size: int
    wire_size: int
    encoded: bool
    decoded: bool

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
        """Who sends it."""
        return self.message.direction

    @property
    def checked(self) -> bool:
        """It carries a check value."""
        return self.envelope.check is not None


@dataclass(frozen=True, eq=False)
class Plan:
    """A protocol, less what an output leaves out.

    Attributes:
        protocol: names, texts and transactions, as the document states them.
        role: side that the output is for.
        frame: how messages travel.
        messages: those that are kept, in schema order.
        commands: transactions whose request is kept; a response that is not kept is in none of ``messages``.
        enums: those that some kept value has; all where nothing is left out.
        flags: the same for flags.
        heard: directions that the role receives.
    """

    protocol: Protocol
    role: Role
    frame: FramePlan
    messages: tuple[MessagePlan, ...]
    commands: tuple[Command, ...]
    enums: tuple[Enum, ...]
    flags: tuple[Flags, ...]
    heard: tuple[Direction, ...]

    @cached_property
    def by_name(self) -> Mapping[str, MessagePlan]:
        """Messages by full name."""
        return {message.name: message for message in self.messages}

    def message(self, name: str) -> MessagePlan:
        """Message of a full name; a command's name alone is its request. Raises KeyError."""
        return self.by_name.get(f"{name}.request") or self.by_name[name]

    def received(self, direction: Direction) -> tuple[MessagePlan, ...]:
        """Messages that a decoder for a direction accepts: its own, and those that both sides may send."""
        return tuple(m for m in self.messages if m.direction in (direction, "message"))

    def known(self, direction: Direction) -> Mapping[int, MessagePlan]:
        """Messages that a decoder for a direction accepts, by number."""
        return {message.id: message for message in self.received(direction)}

    def hears(self, message: MessagePlan) -> Direction:
        """The direction in which a decoder is told to listen for a message."""
        return self.heard[0] if message.direction == "message" else message.direction

    @property
    def max_wire_size(self) -> int:
        """Most bytes that a kept message takes on the wire."""
        return max((message.wire_size for message in self.messages), default=0)
