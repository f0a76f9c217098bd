"""Prints the plan: the parts of frames and the steps of messages."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from qlinkgen.cli.tables import Table, heading, paragraph
from qlinkgen.plan.describe import (
    bytes_text,
    condition_text,
    end_text,
    id_text,
    kind_text,
    must_text,
    part_text,
    receiver_text,
    segment_text,
    size_text,
    sizing_text,
    span_text,
    term_text,
    transparency_text,
    type_text,
)
from qlinkgen.plan.envelope import Envelope
from qlinkgen.plan.framing import FramePlan
from qlinkgen.plan.parts import CheckPart, Part, PayloadPart
from qlinkgen.plan.payload import (
    BitsStep,
    BytesStep,
    ItemsStep,
    PayloadPlan,
    RecordsStep,
    RecordStep,
    Step,
    full_size,
    least_size,
    term_of,
)
from qlinkgen.plan.separated import TextStep, characters, most_texts, needed
from qlinkgen.plan.tree import MessagePlan, Plan


def envelopes(plan: Plan) -> Sequence[tuple[str, Envelope]]:
    """Return the distinct envelopes, with their titles."""
    directions = plan.protocol.directions
    if plan.frame.kinds:
        return [(f"Frame {each.name}", each.envelope) for each in plan.frame.kinds]
    if len({plan.frames[each].envelope for each in directions}) == 1:
        return [("Frame", plan.frames[directions[0]].envelope)]
    return [(f"Frame of a {each}", plan.frames[each].envelope) for each in directions]


def parts_table(
    frame: FramePlan, envelope: Envelope, title: str, sections: Mapping[str, str], *, coverage: bool = False
) -> Table:
    """Return the parts of a frame; ``coverage`` adds which of them the check value covers."""
    columns = ["offset", "part", "bytes", "covered", "holds", "section"]
    table = Table(columns, title, frozenset({"offset", "bytes"}))
    for index, part in enumerate(envelope.parts):
        after = index > envelope.payload_at
        table.add(
            f"{envelope.offset(part)}{'+n' if after else ''}",
            part.name,
            span_text(part.least, part.most) if isinstance(part, PayloadPart) else part.size,
            _covered(frame, envelope, part) if coverage else "",
            part_text(part, frame),
            sections.get(part.name, ""),
        )
    return table


def _covered(frame: FramePlan, envelope: Envelope, part: Part) -> str:
    """Return the check values that cover a part; "yes" if there is only one."""
    if frame.needs_request and frame.check is not None:
        return "" if isinstance(part, CheckPart) else "yes"
    checks = (*envelope.checks, *envelope.conditional_checks)
    names = [each.name for each in checks if part.name in each.check.over]
    return ", ".join(names) if len(checks) > 1 else "yes" if names else ""


def show_frame_plan(plan: Plan) -> None:
    """Print how frames are built and found, and the sizes of all messages."""
    frame, protocol = plan.frame, plan.protocol
    heading(f"Plan of {protocol.name}, revision {protocol.revision}")
    for title, envelope in envelopes(plan):
        parts_table(frame, envelope, title, {}, coverage=True).show()
    strategy, reason = receiver_text(frame)
    ends = [f"End of {each.name}: {end_text(each)}" for each in frame.kinds]
    paragraph(
        [
            f"Sent: {transparency_text(frame)}",
            *(ends or [f"End: {end_text(frame)}"]),
            f"Receiver: {strategy}; {reason}",
        ]
    )
    columns = ["id", "message", "payload", "frame", "on the wire", "check value"]
    right = frozenset({"payload", "frame", "on the wire"})
    table = Table(columns, "Messages (bytes; `on the wire` with everything inserted)", right)
    for message in plan.messages:
        payload = message.payload
        table.add(
            id_text(frame, message.id),
            message.name,
            span_text(payload.least, payload.most),
            span_text(message.least_frame, message.frame_size),
            message.wire_size,
            "yes" if message.checked else "no",
        )
    table.show()


def show_message_plan(plan: Plan, message: MessagePlan) -> None:
    """Print the steps of a message."""
    payload = message.payload
    heading(f"Plan of {message.name}, id {id_text(plan.frame, message.id)}")
    lines = [f"payload {bytes_text(payload.least, payload.most)}"]
    if payload.empty_is_default:
        lines.append("an empty payload means every field at its default")
    if message.allowed:
        lines.append(f"{plan.frame.address} must be {condition_text(message.allowed)}")
    paragraph(lines)
    sizes = [f"{index}. {sizing_text(each)}" for index, each in enumerate(payload.sizing, 1)]
    if sizes:
        heading("Sizes, in this order")
        paragraph([*sizes, f"{len(sizes) + 1}. the payload has {size_text(payload.size)} bytes"])
    if payload.separator:
        least, most = needed(payload) - payload.leading, most_texts(payload) - payload.leading
        place = "after" if payload.leading else "divided by"
        texts = f"{span_text(least, most)} texts, {place} {payload.separator.decode()!r}"
        heading("Texts")
        paragraph([texts, "an absent field is empty; at the end it is left out"] if least < most else [texts])
    elif payload.walked:
        heading("Walked in this order")
        walk = [f"{index}. {segment_text(each)}" for index, each in enumerate(payload.segments, 1)]
        paragraph([*walk, f"{len(walk) + 1}. no bytes are left"])
    _steps("Steps", payload)
    for record in payload.records:
        _steps(f"Steps of a record {record.name}", record.payload)


def _steps(title: str, payload: PayloadPlan) -> None:
    columns = ["offset", "from end", "bytes", "step", "kind", "type", "must be"]
    table = Table(columns, title, frozenset({"offset", "from end", "bytes"}))
    moving = [step for segment in payload.segments[1:] for step in segment.steps]
    moving += payload.steps[1:] if payload.separator else []
    for step in payload.steps:
        back = "" if step.place.back is None else step.place.back
        table.add(
            "..." if step in moving else size_text(step.place.front), back, _bytes(step, payload), step.name,
            kind_text(step), type_text(step), must_text(step),
        )  # fmt: skip
        for member in step.members if isinstance(step, BitsStep) else ():
            bits = span_text(member.shift, member.shift + member.bits - 1)
            kind, must = kind_text(member), must_text(member)
            table.add(f".{bits}", "", "", member.name, kind, type_text(member), must)
    table.show()


def _bytes(step: Step, payload: PayloadPlan) -> str:
    """Return the size of a step in bytes."""
    if payload.separator and isinstance(step, TextStep):
        return span_text(*characters(step))
    if isinstance(step, RecordStep | RecordsStep) and step.walked:
        return span_text(least_size(step), full_size(step))
    if isinstance(step, BytesStep | ItemsStep | RecordsStep) and not step.fixed:
        return term_text(term_of(step))
    return str(least_size(step))
