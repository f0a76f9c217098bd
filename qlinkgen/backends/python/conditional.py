"""Parts of a frame that only some frames have, as expressions."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace

from qlinkgen._dataclass import dataclass
from qlinkgen.backends.python import integers, pieces, values
from qlinkgen.backends.python.check_views import PlacedCheck
from qlinkgen.backends.python.decode import Decoder
from qlinkgen.backends.python.encode import Encoder
from qlinkgen.backends.python.frame_checks import placed
from qlinkgen.backends.python.layout import listing, literal
from qlinkgen.backends.python.names import attribute, held, natural
from qlinkgen.backends.python.place import Place
from qlinkgen.backends.python.varied import condition
from qlinkgen.model.condition import Test
from qlinkgen.model.types import Scalar
from qlinkgen.plan.conditional import Conditional, Selector
from qlinkgen.plan.envelope import Envelope
from qlinkgen.plan.parts import CellPart
from qlinkgen.plan.tree import MessagePlan


@dataclass(frozen=True)
class ConditionalView:
    """Parts directly before the payload, or at the end, that only some frames have.

    Attributes:
        names: attributes of messages for their values, or the name of a length, for texts.
        holds_values: they hold values, not a length.
        test: statements of a function that tells from ``head`` whether a frame has them.
        size: their bytes.
        initial: these bytes where a frame does not have them.
    """

    names: str
    holds_values: bool
    test: Sequence[str]
    size: int
    initial: str


@dataclass(frozen=True)
class AfterView(ConditionalView):
    """Parts at the end.

    Attributes:
        met: the same as an expression.
        met_in_buffer: the same for a header at ``start`` in ``buf``; "" if that takes ``head``.
        values: the values in them.
        octets: statements of a method that returns their bytes, with zeros for check values.
        taken: statements of a method that sets the values from the end of ``frame``.
        checks: the check values among them.
        tests: conditions for wrong constants in ``frame`` if it has the parts.
    """

    met: str
    met_in_buffer: str
    values: Sequence[AfterValue]
    octets: Sequence[str]
    taken: Sequence[str]
    checks: Sequence[PlacedCheck]
    tests: Sequence[str]

    @property
    def needed(self) -> str:
        """The expression for whether ``frame`` has them, or its message has other values than without them.

        Identity is faster than a comparison, and enough: `octets` tells equal values.
        """
        tests = [f"self.{each.name} is not {each.constant}" for each in self.values]
        return " or ".join([self.met.replace("head", "frame"), *tests])

    def slots(self, address: str = "") -> list[str]:
        """The statement for the slots of the values, and of an address."""
        names = sorted([*filter(None, [address]), *(each.name for each in self.values)], key=natural)
        return listing("__slots__ = (", [f'"{name}"' for name in names], ")", 4)


@dataclass(frozen=True)
class AfterValue:
    """A value in parts at the end: its attribute and type, and the constant with its default."""

    name: str
    annotation: str
    default: str

    @property
    def constant(self) -> str:
        """The name of the constant."""
        return f"_NO_{self.name.upper()}"


def before_view(envelope: Envelope) -> ConditionalView | None:
    """The view of the parts before the payload, None if each frame has them."""
    return ConditionalView(*_facts(envelope, envelope.before)) if envelope.before else None


def after_view(
    envelope: Envelope, message: MessagePlan, place: Place, scale: Callable[[str, Scalar], str]
) -> AfterView | None:
    """The view of the parts at the end, None if each frame has them; ``message`` is one that has them."""
    found = envelope.after
    if found is None:
        return None
    cells = [part for part in found.parts if isinstance(part, CellPart)]
    scales = {each.name: scale(each.name, each.number) for each in found.values if each.number.scaling}
    encoder, decoder = Encoder(message, place, "", "", scales), Decoder(message, place, "", scales)
    octets = [
        encoder.octets(part) if isinstance(part, CellPart) else literal(packed)
        for part, packed in zip(found.parts, found.packed, strict=True)
    ]
    for part in cells:
        decoder.take_end(envelope, part)
    first = len(envelope.checks) + 1
    taken = [line.replace("message.", "self.") for line in decoder.assignments]
    return AfterView(
        *_facts(envelope, found),
        met=_met(envelope, found, "head") or "_has_after(head)",
        met_in_buffer=_met(envelope, found, *pieces.BUFFER),
        values=[
            AfterValue(held(each), values.annotation((each,), place), values.default(each, place))
            for each in found.values
        ],
        octets=[*encoder.checks, f"return {' + '.join(octets)}"],
        taken=["cls = type(self)", *taken] if any("illegal(" in line for line in taken) else taken,
        checks=[
            placed(envelope, part, f"_{number}", early=False)
            for number, part in enumerate(found.checks, first)
        ],
        tests=[test for part in found.parts for test in pieces.tail_tests(envelope, part)],
    )


def _facts(envelope: Envelope, found: Conditional) -> tuple[str, bool, Sequence[str], int, str]:
    """The first attributes of a view."""
    held = {part.name for part in found.parts if isinstance(part, CellPart)}
    names = [attribute(member.name) for member in found.values]
    names += [part.name for part in found.parts if part.name not in held]
    listed = f"{', '.join(names[:-1])} and {names[-1]}" if len(names) > 1 else names[0]
    tests = list(_tests(envelope, found))
    return listed, found.length is None, tests, found.size, literal(found.initial)


def _met(envelope: Envelope, found: Conditional, source: str, base: str = "") -> str:
    """The condition as an expression without a call, "" unless it is a simple one about one byte."""
    selector = found.selectors[0]
    test = condition((replace(selector.test, value="number"),), "{}")
    simple = test.count("number") == 1 and " or " not in test and " and " not in test
    if len(found.selectors) > 1 or selector.part.size > 1 or not simple:
        return ""
    return test.replace("number", _number(envelope, selector, source, base))


def _tests(envelope: Envelope, found: Conditional) -> Iterator[str]:
    for each in found.selectors:
        yield f"number = {_number(envelope, each, 'head')}"
        test = replace(each.test, value="number")
        if each is found.selectors[-1]:
            yield f"return {condition((test,), '{}')}"
        else:
            yield f"if {condition((_opposite(test),), '{}')}:"
            yield "    return False"


def _number(envelope: Envelope, selector: Selector, source: str, base: str = "") -> str:
    """The bits of a header that a condition is about."""
    whole = pieces.read(envelope, selector.part, source, base)
    return integers.bits_of(selector.part.integer, whole, selector.shift, selector.bits)


def _opposite(test: Test) -> Test:
    return replace(test, negated=not test.negated)
