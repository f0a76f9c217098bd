"""The plan for people: frames part by part, messages step by step."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from qlinkgen.cli.tables import Table
from qlinkgen.plan.describe import (
    part_text,
    span_text,
)
from qlinkgen.plan.framing import CheckPart, Envelope, FramePlan, PayloadPart
from qlinkgen.plan.tree import Plan


def envelopes(plan: Plan) -> Sequence[tuple[str, Envelope]]:
    """Envelopes that differ, with their titles."""
    directions = plan.protocol.directions
    if len({plan.frame.envelopes[each] for each in directions}) == 1:
        return [("Frame", plan.frame.envelopes[directions[0]])]
    return [(f"Frame of a {each}", plan.frame.envelopes[each]) for each in directions]


def parts_table(
    frame: FramePlan, envelope: Envelope, title: str, sections: Mapping[str, str], *, coverage: bool = False
) -> Table:
    """The parts of a frame; ``coverage`` adds which of them the check value covers."""
    columns = ["offset", "part", "bytes", "covered", "holds", "section"]
    table = Table(columns, title, frozenset({"offset", "bytes"}))
    for index, part in enumerate(envelope.parts):
        after = index > envelope.payload_at
        chained = frame.needs_request and frame.check is not None and not isinstance(part, CheckPart)
        table.add(
            f"{envelope.offset(part)}{'+n' if after else ''}",
            part.name,
            span_text(part.least, part.most) if isinstance(part, PayloadPart) else part.size,
            "yes" if coverage and (envelope.covered(part) or chained) else "",
            part_text(part, frame),
            sections.get(part.name, ""),
        )
    return table
