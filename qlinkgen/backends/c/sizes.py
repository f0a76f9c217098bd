"""Sizes and numbers of items, and the derivation of the size of a payload from its counts."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import field

from qlinkgen._dataclass import dataclass
from qlinkgen.backends.c.checks import broken, refusal
from qlinkgen.backends.c.layout import Layouts
from qlinkgen.backends.c.members import count_of
from qlinkgen.backends.c.names import Names, grouped
from qlinkgen.backends.c.walked_size import walked_size_lines
from qlinkgen.model.message import Message
from qlinkgen.plan.ends import ByMessage
from qlinkgen.plan.expr import Size, Term, Within
from qlinkgen.plan.payload import CountStep, Learn, PayloadPlan, Place
from qlinkgen.plan.planning import payload_plan
from qlinkgen.plan.tree import MessagePlan, Plan

#: Prints the number of items of a run as a size_t.
Count = Callable[[str], str]


def sized_by_message(message: MessagePlan) -> bool:
    """Whether a receiver derives the size of its payload from its counts."""
    return any(isinstance(each.end, ByMessage) for each in message.frames)


def size_text(size: Size, count: Count) -> str:
    """A size as an expression; ``count`` prints the number of items of a run as a size_t."""
    terms = [f"{size.fixed}U"] if size.fixed or not size.terms else []
    return " + ".join([*terms, *(term_text(term, count(term.run)) for term in size.terms)])


def term_text(term: Term, number: str) -> str:
    """The size of a run of so many items."""
    product = f"({term.factor}U * {number})" if term.factor > 1 else number
    product = f"(({product} + 7U) / 8U)" if term.packed else product
    return plus(product, term.more)


def plus(number: str, more: int) -> str:
    """A number plus a constant."""
    return f"({number} {'+' if more > 0 else '-'} {abs(more)}U)" if more else number


def _items_text(term: Term, size: str) -> str:
    """The number of items of a row in so many bytes."""
    times, by = term.per_byte
    size = plus(size, -term.more)
    number = f"(size_t){grouped(size)}"
    number = f"({number} * {times}U)" if times > 1 else number
    return f"{number} / {by}U" if by > 1 else number


def size_terms(message: Message, struct: str) -> str:
    """The size of a payload as an expression; ``struct`` is the prefix of its counts."""
    plan = payload_plan(message)
    members = {run.name: f"(size_t){struct}{count_of(run)}" for run in plan.runs}
    return size_text(plan.size, members.__getitem__)


def local(run: str) -> str:
    """The variable with the number of items of a run."""
    return f"{run}_count"


def local_size(run: str) -> str:
    """The variable of `local`, converted to size_t."""
    return f"(size_t){run}_count"


def index_of(place: Place, count: Count, further: str = "") -> str:
    """The offset of a step as an index, from the beginning or, if that varies, from the end."""
    if place.front.terms and place.back is not None:
        at = f"size - {place.back}U"
    else:
        at = size_text(place.front, count)
    if not further:
        return at if place.front.terms else str(place.front.fixed)
    return further if at == "0U" else f"{at} + {further}"


@dataclass
class Learner:
    """Collects the statements that read the numbers of items of runs from counts."""

    payload: PayloadPlan
    layouts: Layouts
    lines: list[str] = field(default_factory=list)
    #: Runs whose number of items is a local variable.
    known: list[str] = field(default_factory=list)

    def refuse(self, terms: list[str], status: str) -> None:
        """Add a statement that returns an error if a term holds."""
        self.lines += refusal(terms, f"{self.layouts.prefix.upper()}_ERROR_{status}")

    def number(self, count: CountStep) -> str:
        """The value of a count."""
        return self.layouts.peek(count.integer, "payload", index_of(count.place, local))

    def learn(self, count: CountStep) -> None:
        """Declare the number of items of the run and check it."""
        self.take(count, self.number(count), "const size_t ")

    def take(self, count: CountStep, number: str, kind: str = "") -> None:
        """Assign the number of items of the run and check it; ``kind`` declares it."""
        integer, wide, more = count.integer, count.integer.bits > 16, count.term.more
        held, bounds = Within(0, integer.mask), count.bounds  # negative numbers are outside of them
        early = (
            wide or count.term.packed or more != 0
        )  # may exceed a size_t, or be less than the bytes beside
        if early:
            self.refuse(broken([bounds], number, held, integer.bits), "LENGTH")
        number = _items_text(count.term, number) if count.term.packed else plus(number, -more)
        if not count.term.packed and count.scale > 1:
            self.refuse([f"({number} % {count.scale}U) != 0U"], "LENGTH")
            number, held = f"{number} / {count.scale}U", Within(0, integer.mask // count.scale)
            bounds = Within(bounds.low // count.scale, bounds.high // count.scale)
        if wide and not count.term.packed:
            number = f"(size_t){grouped(number)}"
        self.lines.append(f"{kind}{local(count.run)} = {number};")
        if not early:
            self.refuse(broken([bounds], local(count.run), held, 16), "LENGTH")
        self.known.append(count.run)

    def take_sized(self, count: CountStep, number: str, held: Within) -> None:
        """Assign the bytes of records that are read one by one, and check them."""
        self.refuse(broken([count.bounds], number, held, count.integer.bits), "LENGTH")
        number = f"{number} - {count.term.more}U" if count.term.more else number
        kind = "(size_t)" if count.integer.bits > 16 else ""
        self.lines.append(f"{count.run}_bytes = {kind}{grouped(number) if kind else number};")

    @property
    def least(self) -> str:
        """Minimum size of the payload with the known counts."""
        return size_text(self.payload.least_of(self.known), local)


@dataclass(frozen=True, slots=True)
class SizeView:
    """The statements that find the size of a message."""

    constant: str
    lines: list[str]


def size_view(names: Names, message: MessagePlan, layouts: Layouts) -> SizeView:
    """The view of a message for the template."""
    return SizeView(names.constant(message.message), _statements(Learner(message.payload, layouts)))


@dataclass(frozen=True, slots=True)
class TurnView:
    """The messages that only their turn tells: the size of the largest, and those that give their size."""

    most: int
    sizes: list[SizeView]


def turn_view(plan: Plan, names: Names, layouts: Layouts) -> TurnView | None:
    """The view of the messages that only their turn tells; None if none are received."""
    received = [each for each in plan.turned if each.decoded]
    if not received:
        return None
    told = [each for each in received if plan.turn_of(each) == (0, 0)]
    return TurnView(
        max(each.payload.most for each in received), [size_view(names, each, layouts) for each in told]
    )


def _statements(learner: Learner) -> list[str]:
    """Lines of the case, which end with a return."""
    upper = learner.layouts.prefix.upper()
    ok, truncated = f"{upper}_OK", f"{upper}_ERROR_TRUNCATED"
    if learner.payload.walked:
        return walked_size_lines(learner)
    learner.lines.append(f"*size = {learner.payload.least}U;")
    for each in learner.payload.sizing:
        if isinstance(each, Learn):
            end = size_text(each.count.place.front + each.count.integer.size, local)
            learner.refuse([f"available < {grouped(end)}"], "TRUNCATED")
            learner.learn(each.count)
            learner.lines.append(f"*size = {learner.least};")
    if not learner.known:
        return [*learner.lines, f"return {ok};"]
    enough = f"return (available < *size) ? {truncated} : {ok};"
    return ["{", *(f"    {line}" for line in [*learner.lines, enough]), "}"]
