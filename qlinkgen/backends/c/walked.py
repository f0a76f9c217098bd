"""Generates the statements of payloads in which fields may be absent: a walk with a moving pointer."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass, field

from qlinkgen.backends.c import checks
from qlinkgen.backends.c.conditions import condition, numbers_of
from qlinkgen.backends.c.decode import Decoder
from qlinkgen.backends.c.encode import Encoder
from qlinkgen.backends.c.members import count_of
from qlinkgen.backends.c.names import count_type, grouped, unsigned
from qlinkgen.backends.c.sizes import local, local_size, size_text, term_text
from qlinkgen.model import naming
from qlinkgen.model.types import Scalar
from qlinkgen.plan.expr import Size, Within
from qlinkgen.plan.payload import CountStep, PayloadPlan, Presence, RunStep, Segment, Step, holders


def has_member(segment: Segment) -> str:
    """The struct member that tells whether a segment is present, "" if it has none."""
    presence = segment.presence
    return f"has_{presence.field}" if presence and not presence.slot and holders(segment.steps) else ""


def _in_struct(name: str) -> str:
    return f"message->{naming.member(name)}"


def size_lines(payload: PayloadPlan) -> list[str]:
    """Body of the function that returns the size of the payload of a struct."""
    numbers = numbers_of(payload)
    always = sum(each.size or 0 for each in payload.segments if each.presence is None)
    lines = [f"size_t size = {always}U;"]
    for segment in payload.segments:
        if segment.presence is None and segment.size is not None:
            continue
        more = f"{segment.size}U" if segment.size is not None else _struct_size(segment)
        lines += _guarded(_sent(segment.presence, numbers), [f"size += {more};"])
    return [*lines, "return size;"]


def _struct_size(segment: Segment) -> str:
    run = segment.run
    assert run is not None
    count = f"(size_t)message->{count_of(run)}"
    if segment.terminator:
        return f"{count} + 1U"
    return f"{run.item_size}U * {count}" if run.item_size > 1 else count


def _sent(presence: Presence | None, numbers: dict[str, Scalar]) -> str:
    """The condition under which a segment is sent, "" if it always is."""
    if presence is None:
        return ""
    if presence.optional:
        return f"message->has_{presence.field}"
    return condition(presence.when, numbers, _in_struct)


def _guarded(test: str, lines: Iterable[str]) -> list[str]:
    if not test:
        return list(lines)
    inner = [f"    {line}" for line in lines]
    return [f"if ({test}) {{", *inner, "}"] if inner else []


@dataclass
class WalkedEncoder(Encoder):
    """Collects the statements that encode one message segment by segment."""

    function: str = ""

    def statements(self) -> list[str]:
        """Lines of the function body, without the last one."""
        lines: list[str] = []
        for run in self.payload.runs:
            kind = count_type(run.length.maximum)
            # A member of a union is read only where its case is sent.
            case = run.presence is not None and run.presence.slot
            lines.append(
                f"{kind} {local(run.name)} = 0U;"
                if case
                else f"const {kind} {local(run.name)} = message->{count_of(run)};"
            )
        lines += [f"const size_t size = {self.function}_size_(message);", ""]
        lines += self._checks()
        self._refuse(["capacity < size"], "CAPACITY")
        lines += self._flushed()
        last = self.payload.segments[-1]
        for segment in self.payload.segments:
            for step in segment.steps:
                self._write(step)
            if segment is not last:
                self.lines.append(f"payload += {_length(segment, local_size)};")
            lines += self._if_sent(segment)
        return lines

    def _if_sent(self, segment: Segment) -> list[str]:
        """The statements collected so far, for a segment that is sent."""
        return _guarded(_sent(segment.presence, numbers_of(self.payload)), self._flushed())

    def _checks(self) -> list[str]:
        """Statements that check numbers of items, then values."""
        lines: list[str] = []
        for segment in self.payload.segments:
            run = segment.run
            if run is not None:
                if run.presence is not None and run.presence.slot:
                    self.lines.append(f"{local(run.name)} = message->{count_of(run)};")
                held = Within(0, (1 << int(count_type(run.length.maximum)[4:-2])) - 1)
                bounds = self.payload.sendable(run)
                self._refuse(checks.broken([bounds], local(run.name), held, 16), "LENGTH")
                lines += self._if_sent(segment)
        before = ""
        for segment in self.payload.segments:
            if segment.presence is not None and segment.presence.optional:
                if before:
                    self._refuse([f"message->{has_member(segment)} && !message->{before}"], "RANGE")
                    lines += self._flushed()
                before = has_member(segment)
            for step in segment.steps:
                self._check(step)
            lines += self._if_sent(segment)
        return lines

    def _flushed(self) -> list[str]:
        lines, self.lines = self.lines, []
        return lines


def _length(segment: Segment, count: Callable[[str], str]) -> str:
    run = segment.run
    if run is None:
        return f"{segment.size}U"
    if segment.terminator:
        return f"{count(run.name)} + 1U"
    return f"{run.item_size}U * {count(run.name)}" if run.item_size > 1 else count(run.name)


@dataclass
class WalkedDecoder(Decoder):
    """Collects the statements that decode one message segment by segment."""

    init: str = ""
    counted: set[str] = field(default_factory=set)

    def statements(self) -> list[str]:
        """Lines of the function body, without the last one."""
        numbers = numbers_of(self.payload)
        self.reads = True
        kind = self.init.removesuffix("_INIT").lower()
        lines = [f"const {kind}_t defaults = {self.init};"]
        lines += [f"size_t {local(run.name)} = 0U;" for run in self.payload.runs]
        lines.append("*message = defaults;")
        for segment in self.payload.segments:
            lines += self._segment(segment, numbers)
        self.refuse(["size != 0U"], "LENGTH")
        return [*lines, *self._flushed()]

    def _flushed(self) -> list[str]:
        lines, self.lines = self.lines, []
        return lines

    def _segment(self, segment: Segment, numbers: dict[str, Scalar]) -> list[str]:
        run = segment.run
        if run is not None and segment.terminator:
            self._find_end(run, segment.terminator[0])
        elif run is not None and segment.rest is not None:
            self._infer_rest(run, segment.rest)
        else:
            self.refuse([f"size < {_length(segment, local)}"], "LENGTH")
        for step in segment.steps:
            self._read(step)
        self.lines += [f"payload += {_length(segment, local)};", f"size -= {_length(segment, local)};"]
        inner, presence = self._flushed(), segment.presence
        if presence is None:
            return inner
        test = "size > 0U" if presence.optional else condition(presence.when, numbers, _in_struct)
        member = has_member(segment)
        if not member:
            return _guarded(test, inner)
        return [f"message->{member} = {test};", *_guarded(f"message->{member}", inner)]

    def _find_end(self, run: RunStep, terminator: int) -> None:
        """Find the terminator of a text."""
        length, name = run.length, local(run.name)
        end = unsigned(terminator, 8, hexadecimal=True)
        self.lines += [
            f"while (({name} < size) && ({name} <= {length.maximum}U) && (payload[{name}] != {end})) {{",
            f"    ++{name};",
            "}",
        ]
        low = [f"{name} < {length.minimum}U"] if length.minimum else []
        self.refuse([f"{name} == size", *low, f"{name} > {length.maximum}U"], "LENGTH")

    def _infer_rest(self, run: RunStep, after: Size) -> None:
        length, name = run.length, local(run.name)
        rest = grouped(size_text(after, local))
        self.refuse([f"size < {rest}"] if rest != "0U" else [], "LENGTH")
        left = f"size - {rest}" if rest != "0U" else "size"
        if run.item_size > 1:
            left = grouped(left)
            self.refuse([f"({left} % {run.item_size}U) != 0U"], "LENGTH")
            left = f"{left} / {run.item_size}U"
        self.lines.append(f"{name} = {left};")
        low = [f"{name} < {length.minimum}U"] if length.minimum else []
        self.refuse([*low, f"{name} > {length.maximum}U"], "LENGTH")

    def _read(self, step: Step) -> None:
        if not isinstance(step, CountStep):
            super()._read(step)
            return
        self._get(step.place, step.integer)
        number = self.number(step)
        if step.run in self.counted:
            items = term_text(step.term, local(step.run))
            own = Within(0, step.integer.maximum)
            negative = checks.broken([own], number, Within(0, step.integer.mask), step.integer.bits)
            self.refuse([f"{number} != {items}", *negative], "LENGTH")
        else:
            self.counted.add(step.run)
            self.take(step, number)
