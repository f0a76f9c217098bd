"""Parts of a frame that only some frames have, as expressions."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace

from qlinkgen.backends.python import pieces
from qlinkgen.backends.python.layout import literal
from qlinkgen.backends.python.names import attribute
from qlinkgen.backends.python.varied import condition
from qlinkgen.model.condition import Test
from qlinkgen.plan.conditional import Conditional, Selector
from qlinkgen.plan.envelope import Envelope


@dataclass(frozen=True)
class ConditionalView:
    """Parts directly before the payload, or at the end, that only some frames have.

    Attributes:
        place: "before" or "after", with which the name of its function ends.
        names: attributes of messages for their values, or the name of a length, for texts.
        holds_values: they hold values, not a length.
        test: statements of a function that tells from ``head`` whether a frame has them.
        size: their bytes.
        initial: these bytes where a frame does not have them.
    """

    place: str
    names: str
    holds_values: bool
    test: list[str]
    size: int
    initial: str


def conditional_view(envelope: Envelope, place: str) -> ConditionalView | None:
    """The view of the parts before the payload or at the end, None if each frame has them."""
    found = envelope.before if place == "before" else envelope.after
    if found is None:
        return None
    names = [attribute(member.name) for member in found.values] or [each.name for each in found.parts]
    listed = f"{', '.join(names[:-1])} and {names[-1]}" if len(names) > 1 else names[0]
    return ConditionalView(
        place=place,
        names=listed,
        holds_values=found.length is None,
        test=list(_tests(envelope, found)),
        size=found.size,
        initial=literal(found.initial),
    )


def _tests(envelope: Envelope, found: Conditional) -> Iterator[str]:
    for each in found.selectors:
        yield f"number = {_number(envelope, each)}"
        test = replace(each.test, value="number")
        if each is found.selectors[-1]:
            yield f"return {condition((test,), '{}')}"
        else:
            yield f"if {condition((_opposite(test),), '{}')}:"
            yield "    return False"


def _number(envelope: Envelope, selector: Selector) -> str:
    """The bits of a header that a condition is about."""
    whole = pieces.read(envelope, selector.part, "head")
    if selector.bits == selector.part.integer.bits:
        return whole
    shifted = f"{whole} >> {selector.shift}" if selector.shift else whole
    return f"{shifted} & 0x{selector.mask:X}"


def _opposite(test: Test) -> Test:
    return replace(test, negated=not test.negated)
