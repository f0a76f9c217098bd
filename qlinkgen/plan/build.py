"""Builds the plan of a protocol from its model."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import assert_never

from qlinkgen.model.frame import Frame, FrameKinds
from qlinkgen.model.message import Direction, Message
from qlinkgen.model.protocol import Protocol
from qlinkgen.plan import select
from qlinkgen.plan.envelope import Envelope
from qlinkgen.plan.expr import OneOf, Within
from qlinkgen.plan.framing import FramePlan, frame_plans
from qlinkgen.plan.parts import (
    AddressPart,
    BlocksPart,
    CellPart,
    CheckPart,
    ConstantPart,
    EqualPart,
    IdPart,
    LengthPart,
    MarkPart,
    Part,
    PayloadPart,
)
from qlinkgen.plan.planning import payload_plan
from qlinkgen.plan.select import Options
from qlinkgen.plan.transparency import Coded, FrameStuffing, PayloadStuffing, Plain, SevenBit
from qlinkgen.plan.tree import MessagePlan, Plan, shortest


def plan_of(protocol: Protocol, options: Options | None = None) -> Plan:
    """Plan a protocol for an output."""
    options = options or Options()
    messages = select.kept(protocol, options)
    frames = _with_texts(frame_plans(protocol.frame), protocol)
    names = {message.name for message in messages}
    beside = [member.number for frame in frames.values() for member in frame.values.values()]
    used = select.named(messages, beside)
    return Plan(
        protocol=protocol,
        role=options.role,
        frames=frames,
        messages=tuple(
            _message(
                _carrying(protocol.frame, frames[message.direction], message),
                message,
                options,
                asked=protocol.is_asked(message),
            )
            for message in messages
        ),
        commands=tuple(command for command in protocol.commands if command.request.name in names),
        enums=tuple(each for each in protocol.enums if not options.only or each.name in used),
        flags=tuple(each for each in protocol.flags if not options.only or each.name in used),
        received_directions=select.received_directions(protocol, options.role),
    )


def _with_texts(frames: Mapping[Direction, FramePlan], protocol: Protocol) -> Mapping[Direction, FramePlan]:
    """The frames with the ids that their payloads begin with."""
    texts = {each.id: each.text for each in protocol.messages if each.text is not None}
    if not texts:
        return frames
    ids = tuple(texts[number] for number in sorted(texts))
    shared = {id(each): replace(each, texts=ids) for each in frames.values()}
    return {direction: shared[id(each)] for direction, each in frames.items()}


def _carrying(stated: Frame, frame: FramePlan, message: Message) -> tuple[FramePlan, ...]:
    """The kinds of frame that carry a message, the shortest first."""
    if not isinstance(stated, FrameKinds):
        return (frame,)
    names = {each.title for each in stated.carrying(message.id)}
    kinds = [each for each in frame.kinds if each.name in names]
    return tuple(sorted(kinds, key=lambda each: each.envelope.payload.most))


def _message(
    frames: tuple[FramePlan, ...], message: Message, options: Options, *, asked: bool
) -> MessagePlan:
    frame = frames[-1]
    envelope = frame.with_check(checked=message.checksum).fixing(dict(message.settled))
    beside = (member for _, member in envelope.values)
    payload = payload_plan(message, frame.envelope.payload.trim, beside)
    size = envelope.overhead + payload.most
    if len(frames) > 1:
        # A payload of the greatest size need not be in the longest frame.
        sizes = {payload.most, *(each.max_payload for each in frames)}
        inside = [each for each in sizes if payload.least <= each <= payload.most]
        size = max(each + shortest(frames, each).envelope.overhead for each in inside)
    size += envelope.blocks.added(payload.most) if envelope.blocks else 0
    return MessagePlan(
        message=message,
        payload=payload,
        frames=frames,
        envelope=envelope,
        allowed=OneOf(tuple(Within(*each) for each in message.addresses)) if message.addresses else None,
        frame_size=size,
        wire_size=size + max(_growth(each, _own(each, envelope), message) for each in frames),
        encoded=select.encoded(message, options.role),
        decoded=select.decoded(message, options.role),
        asked=asked,
    )


def _own(frame: FramePlan, envelope: Envelope) -> Envelope:
    """The parts of one of several kinds, or those of the message."""
    return frame.envelope if frame.name else envelope


def _growth(frame: FramePlan, envelope: Envelope, message: Message) -> int:
    """Maximum number of bytes that transparency adds to a frame of the message."""
    transparency = frame.transparency
    match transparency:
        case Plain() | SevenBit():
            return 0
        case PayloadStuffing():
            return transparency.rule.growth(message.max_size)
        case Coded():
            size = envelope.overhead + message.max_size
            return transparency.most_frame(size) - size
        case FrameStuffing():
            parts = envelope.between(transparency.front, transparency.back)
            return transparency.rule.growth(sum(_stuffable(each, message, transparency) for each in parts))
        case _:
            assert_never(transparency)


def _stuffable(part: Part, message: Message, stuffing: FrameStuffing) -> int:
    """Maximum number of bytes of a part that need stuffing; the range of a value rules many out."""
    after = stuffing.rule.after
    if len(after) > 1:
        return message.max_size if isinstance(part, PayloadPart) else part.size
    mark = after[0]
    match part:
        case PayloadPart():
            return message.max_size
        case ConstantPart():
            return part.size
        case LengthPart(size=1):
            return int(part.number(message.min_size) <= mark <= part.number(message.max_size))
        case IdPart(size=1):
            return int(message.id == mark)
        case AddressPart(size=1) if not part.digits:
            return int(any(first <= mark <= last for first, last in message.addresses))
        case LengthPart() | IdPart() | AddressPart() | CellPart() | EqualPart() | CheckPart() | MarkPart():
            return part.size
        case BlocksPart():
            raise AssertionError("a stuffed payload has no check values of blocks")
        case _:
            assert_never(part)
