"""The functions of a master in C for each command: how it asks, and what a received frame means to it."""

from __future__ import annotations

from collections.abc import Iterator

from qlinkgen._dataclass import dataclass
from qlinkgen.backends.c import framing
from qlinkgen.backends.c.dispatch import bits_of, items_said, microseconds_of
from qlinkgen.backends.c.frames import FrameSection
from qlinkgen.backends.c.names import Names, is_wide, literal, unsigned
from qlinkgen.backends.c.settled import assigned
from qlinkgen.model.fields import Value
from qlinkgen.model.message import Message
from qlinkgen.model.naming import member, snake
from qlinkgen.model.transaction import Allowance, Bus, Command, Proof, Reply
from qlinkgen.model.types import Array, Blob, Characters, Scalar
from qlinkgen.plan.tree import MessagePlan, Plan


@dataclass(frozen=True, slots=True)
class Unasked:
    """A command that the master does not have, and why."""

    name: str
    reason: str


@dataclass(frozen=True, slots=True)
class Span:
    """A time: bits at the speed of the line, and microseconds."""

    bits: str
    us: str


@dataclass(frozen=True, slots=True, kw_only=True)
class AnswerView:
    """A message that may answer a request.

    Attributes:
        kept: it is the response, which the caller gets.
        right: statements that clear ``right`` if it does not repeat what it should.
        reads: they read the request.
        reduced: statements after them, about rows of bits.
        cases: conditions on what it means, with the meaning; ``means`` otherwise.
        within: time from a reply that announces the answer, None for that of the response.
        after: time from a reply that asks for the request once more.
    """

    expected: framing.Expected
    kept: bool
    right: list[str]
    reads: bool
    reduced: list[str]
    cases: list[tuple[str, str]]
    means: str
    within: Span | None
    after: Span | None

    @property
    def again(self) -> bool:
        """Whether it may ask for the request once more."""
        return "AGAIN" in (self.means, *(means for _, means in self.cases))


@dataclass(frozen=True, slots=True, kw_only=True)
class AskView:
    """A command: its names, its times and its answers.

    Attributes:
        name: the command in names of functions.
        request: type of the request, "" without values.
        response: type of the response, "" without values.
        encode: arguments of the function that makes the frame, before the buffer.
        settled: statements for the values of its frame that are always the same.
        most: bits of the longest answer.
        allowance: time for the slave to begin its answer, or to handle a request without one.
    """

    name: str
    doc: str
    function: str
    request: str
    response: str
    addressed: bool
    answered: bool
    to_all: bool
    safe: bool
    answers_broadcast: bool
    encode: str
    settled: list[str]
    most: int
    allowance: Span
    response_id: str
    answers: list[AnswerView]

    @property
    def compares_job(self) -> bool:
        """Whether an answer is compared with the address or other values of the frame of the request."""
        return any("job->" in line for each in self.answers for line in each.right)

    @property
    def reads(self) -> bool:
        """Whether the meaning of an answer depends on the request."""
        return any(each.reads for each in self.answers)

    @property
    def refusing(self) -> bool:
        """Whether the time after a reply depends on it."""
        return any(each.within or each.again for each in self.answers)


class Asks:
    """The commands of a protocol, as far as a master in C has them."""

    def __init__(self, plan: Plan, names: Names, section: FrameSection) -> None:
        self._plan = plan
        self._names = names
        self._section = section
        self._address = section.view.address
        self._answering = framing.address_of(plan, self._address, "response")
        self._asking = framing.address_of(plan, self._address, "request")

    def __iter__(self) -> Iterator[AskView | Unasked]:
        for command in self._plan.commands:
            reason = self._lacks(command)
            yield Unasked(command.name, reason) if reason else self._view(command)

    def _lacks(self, command: Command) -> str:
        """Why the master does not have a command, "" if it has."""
        if command.steps:
            return "a dialogue of several frames"
        if command.many is not None:
            return "several answers"
        if command.proof is not None:
            return "a check value over the request in the answer"
        for message in command.answers:
            for value, of in self._repeated(command, message):
                if not self._comparable(command, value, of):
                    return f"{message.name}: {value.name} repeats what C cannot compare"
        return ""

    def _repeated(self, command: Command, answer: Message) -> Iterator[tuple[Value, str | int]]:
        found = command.repeated(answer)
        values = {each.name: each for each in (*answer.values, *self._plan.protocol.beside(answer))}
        for name, of in found.items():
            assert not isinstance(of, Proof)
            yield values[name], of

    def _comparable(self, command: Command, value: Value, of: str | int) -> bool:
        asked = {each.name: each for each in command.request.values}
        values = [value, *([asked[of]] if isinstance(of, str) and of in asked else [])]
        if any(each.field.conditional for each in values):
            return False
        kinds = [each.type for each in values]
        if all(isinstance(kind, Blob) for kind in kinds):
            return True
        if all(isinstance(kind, Array) and isinstance(kind.item, Scalar) for kind in kinds):
            return True
        return all(
            isinstance(kind, Scalar) and not is_wide(kind) and not isinstance(kind.meaning, Characters)
            for kind in kinds
        )

    def _view(self, command: Command) -> AskView:
        names, plan, request = self._names, self._plan, command.request
        planned = [plan.by_name[each.name] for each in command.answers]
        response, bus = command.response, plan.protocol.bus
        allowed = plan.by_name[request.name].allowed
        most = bus.bits_per_byte * max((each.wire_size for each in planned), default=0)
        struct = "request, " if request.values else ""
        addressed = bool(self._address) and not (
            command.addressing == "broadcast" and allowed is not None and len(allowed.ranges) == 1
        )
        return AskView(
            name=snake(command.name),
            doc=command.name,
            function=names.function(request),
            request=f"{names.function(request)}_t" if request.values else "",
            response=f"{names.function(response)}_t" if response and response.values else "",
            addressed=addressed,
            answered=response is not None,
            to_all=command.addressing == "broadcast",
            safe=command.repeat.safe and response is not None,
            answers_broadcast=command.addressing == "answered_broadcast",
            encode=struct
            + (f"job->{self._address}, " if self._address else "")
            + ("&job->parts, " if self._asking.values_type else ""),
            settled=assigned(request, plan.beside, "job->parts."),
            most=most,
            allowance=_span(command.response_within, bus),
            response_id=f"{names.constant(response)}_ID" if response else "0U",
            answers=[self._answer(command, each) for each in planned],
        )

    def _answer(self, command: Command, planned: MessagePlan) -> AnswerView:
        message = planned.message
        reply = next((each for each in command.meant if each.message is message), None)
        compared = [
            line for value, of in self._repeated(command, message) for line in self._same(command, value, of)
        ]
        kept = message is command.response
        checked, reduced = self._sizes(command) if kept else ([], [])
        lines = [*compared, *checked]
        return AnswerView(
            expected=framing.expected(self._names, self._answering, planned),
            kept=kept,
            right=lines,
            reads=any("request->" in line for line in (*lines, *reduced)),
            reduced=reduced,
            cases=list(self._cases(reply, message)) if reply else [],
            means=reply.means.upper() if reply else "DONE",
            within=_span(reply.within, self._plan.protocol.bus) if reply and reply.within else None,
            after=_span(reply.after, self._plan.protocol.bus)
            if reply and reply.after != Allowance()
            else None,
        )

    def _cases(self, reply: Reply, message: Message) -> Iterator[tuple[str, str]]:
        kinds = {each.name: each for each in (*message.values, *self._plan.protocol.beside(message))}
        for case in reply.cases:
            kind = kinds[reply.switch].type
            assert isinstance(kind, Scalar)
            place, bits, signed = self._in_answer(kinds[reply.switch]), kind.bits, kind.signed
            if kind.meaning == "bool":
                yield (place if case.first else f"!{place}"), case.means.upper()
            elif case.first == case.last:
                yield f"{place} == {literal(case.first, bits, signed=signed)}", case.means.upper()
            else:
                least = (
                    [f"({place} >= {literal(case.first, bits, signed=signed)})"]
                    if case.first or signed
                    else []
                )
                bounds = [*least, f"({place} <= {literal(case.last, bits, signed=signed)})"]
                yield " && ".join(bounds), case.means.upper()

    def _same(self, command: Command, value: Value, of: str | int) -> Iterator[str]:
        """Statements that compare a value of an answer with what it repeats."""
        place, asked = self._in_answer(value), {each.name: each for each in command.request.values}
        if isinstance(value.type, Scalar):
            if isinstance(of, int):
                other = literal(of, value.type.bits, signed=value.type.signed)
            elif of in asked:
                other = f"request->{member(of)}"
            elif of == self._plan.protocol.address_name:
                other = f"job->{self._address}"
            else:
                other = f"job->parts.{member(of)}"
            yield f"right = right && ({place} == {other});"
            return
        assert isinstance(of, str)
        told, wanted = _count(value, "message."), _count(asked[of], "request->")
        yield f"right = right && ({told} == {wanted});"
        yield f"for (size_t index = 0U; right && (index < {told}); ++index) {{"
        yield f"    right = {place}[index] == request->{member(of)}[index];"
        yield "}"

    def _in_answer(self, value: Value) -> str:
        beside = self._plan.beside
        return (
            f"frame->parts.{member(value.name)}" if value.name in beside else f"message.{member(value.name)}"
        )

    def _sizes(self, command: Command) -> tuple[list[str], list[str]]:
        """Statements that compare numbers of items with those asked for, and that reduce rows of bits."""
        checked, reduced = list[str](), list[str]()
        assert command.response is not None
        fields = {each.name: each for each in command.response.fields}
        numbers = {each.name: each.type for each in command.request.values}
        for name, asked in command.sizes:
            field, number = fields[name], items_said(numbers[asked], f"request->{member(asked)}")
            count = f"message.{name}_{field.quantity}" if not field.fixed else unsigned(field.most, 32)
            if isinstance(field.type, Array) and field.type.whole:
                bits = field.type.item.bits
                rows = f"((((({bits}U * (size_t){number}) + 7U) / 8U) * 8U) / {bits}U)"
                checked.append(f"right = right && (({count} == {number}) || ({count} == {rows}));")
                reduced.append(f"{count} = {number};")
            else:
                checked.append(f"right = right && ({count} == {number});")
        return checked, reduced


def _count(value: Value, owner: str) -> str:
    """The number of items of an array, or of bytes."""
    field = value.field
    return f"{field.most}U" if field.fixed else f"{owner}{field.name}_{field.quantity}"


def _span(time: Allowance, bus: Bus) -> Span:
    return Span(f"{bits_of(time, bus)}UL", f"{microseconds_of(time)}UL")


__all__ = ["AnswerView", "AskView", "Asks", "Span", "Unasked"]
