"""Generates the statements of messages in which fields may be absent: straight code with a running offset."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import field

from qlinkgen._dataclass import dataclass
from qlinkgen.backends.python import integers, pieces
from qlinkgen.backends.python.decode import Decoder, assigned_targets, divided
from qlinkgen.backends.python.encode import Encoder, Row
from qlinkgen.backends.python.layout import indented, literal
from qlinkgen.backends.python.names import attribute, held, source_of
from qlinkgen.backends.python.structs import format_of
from qlinkgen.backends.python.values import condition_text
from qlinkgen.backends.python.varied import condition, is_sized, octets_of, of_attribute, read_lines
from qlinkgen.backends.python.walked_size import sized_lines, times
from qlinkgen.plan.expr import Size, Within
from qlinkgen.plan.parts import LengthPart
from qlinkgen.plan.payload import (
    BytesStep,
    CountStep,
    Presence,
    RecordsStep,
    RecordStep,
    RunStep,
    Segment,
    Step,
    complete,
)


@dataclass
class WalkedEncoder(Encoder):
    """Collects the code that encodes one message segment by segment."""

    _packed: int = 0

    def statements(self, name: str) -> list[str]:
        """Statements that assign the bytes to the local ``name``, or return them if it is empty."""
        self._tabled = None
        runs = (run for run in self.message.payload.runs if not (run.presence and run.presence.slot))
        lines = [line for run in runs for line in self._counted(run)]
        for segment, cases in self.message.payload.by_choice:
            lines += self._ahead(cases) if segment.counted else []
        lines.append('data = b""')
        before = ""
        for segment, cases in self.message.payload.by_choice:
            if cases:
                lines += [f"data += {segment.slot}_octets"] if segment.counted else self._choice(cases)
                continue
            lines += self._segment(segment, before)
            if segment.presence is not None and segment.presence.optional:
                # The bits of an integer have values of their own, which are given or absent together.
                before = next((each.name for each in segment.settable), before)
        if any(segment.records for segment in self.message.payload.segments):
            wrong = f"    raise {self.place.use('OutOfRange')}"
            lines += [f"if len(data) > {self.message.payload.most}:", wrong]
        return [*lines, *self._framed(name)]

    def _flushed(self) -> list[str]:
        """The statements collected so far."""
        lines = [*self._lines, *self._guard(), *self._late]
        for piece in self._pieces:
            lines += self._piece(piece, [], "data += ")
        self._lines, self._terms, self._late, self._pieces = [], [], [], []
        return lines

    def _counted(self, run: RunStep) -> list[str]:
        """The statements that count a run, and check its number of items."""
        source = source_of(run)
        if isinstance(run, BytesStep):
            source = self._octets(run)
        self._lines.append(f"{run.name}_count = len({source})")
        bounds = Within(run.length.minimum, run.length.maximum)
        self._terms.append(integers.holds(bounds, f"{run.name}_count"))
        if isinstance(run, BytesStep) and run.terminator:
            self._terms.append(f"{literal(run.terminator)} not in {source}")
        absent = [f"{run.name}_count = 0"]
        if is_sized(self.message.payload, run.name):
            assert isinstance(run, RecordsStep)
            octets, size = f"{run.name}_octets", integers.bytes_of(run.name)
            self._late += [f"{octets} = {octets_of(run, self.place)}", f"{size} = len({octets})"]
            absent.append(f"{size} = 0")
        lines = self._flushed()
        if run.presence is None or run.presence.slot:
            return lines
        given = f"if self.{held(run)} is not None:"
        return [*absent, given, *indented(lines)]

    def _segment(self, segment: Segment, before: str) -> list[str]:
        for step in segment.steps:
            self._step(step)
        lines = self._flushed()
        presence = segment.presence
        if presence is None:
            return lines
        values = [held(each) for each in segment.settable]
        if presence.optional:
            given = f"if self.{values[0]} is not None:"
            skipped = (
                [f"if self.{attribute(before)} is None:", *self._raised(presence, values[0])]
                if before
                else []
            )
            return [given, *indented([*skipped, *lines])]
        missing = [
            line for each in values for line in self._misplaced(presence, each, f"self.{each} is None")
        ]
        surplus = [
            line for each in values for line in self._misplaced(presence, each, f"self.{each} is not None")
        ]
        test = condition([of_attribute(each) for each in presence.when], "self.{}")
        found = [f"if {test}:", *indented([*missing, *lines])]
        return [*found, "else:", *indented(surplus)] if surplus else found

    def _ahead(self, cases: Sequence[Segment]) -> list[str]:
        """The statements that encode a choice before the count of its bytes."""
        octets, size = f"{cases[0].slot}_octets", integers.bytes_of(cases[0].slot)
        return ['data = b""', *self._choice(cases), f"{octets} = data", f"{size} = len({octets})"]

    def _choice(self, cases: Sequence[Segment]) -> list[str]:
        """The statements of the cases of a choice."""
        first = cases[0].steps[0]
        # each case checks the type of its own value.
        lines, word = [f"{source_of(first)}: Any = self.{held(first)}"], "if"
        for segment in cases:
            (step,), presence = segment.steps, segment.presence
            assert presence is not None
            body = self._misplaced(presence, held(step), self._unfit(step))
            body += [] if segment.run is None else self._counted(segment.run)
            self._step(step)
            test = condition([of_attribute(each) for each in presence.when], "self.{}")
            lines += [f"{word} {test}:", *indented([*body, *self._flushed()])]
            word = "elif"
        if not complete(cases):
            given = f'self, "{held(first)}", "{_tested(cases)} is that of a case with a value"'
            lines += [
                f"elif {source_of(first)} is not None:",
                f"    raise {self.place.use('misplaced')}({given})",
            ]
        return lines

    def _unfit(self, step: Step) -> str:
        """The test for a value that cannot be that of the case; struct finds most of the others."""
        name = source_of(step)
        if isinstance(step, RecordStep):
            return f"not isinstance({name}, {self.place.classes[step.record.name]})"
        return f"{name} is None"

    def _misplaced(self, presence: Presence, value: str, wrong: str) -> list[str]:
        """Refuse a value if a test holds."""
        return [f"if {wrong}:", *self._raised(presence, value)]

    def _raised(self, presence: Presence, value: str) -> list[str]:
        given = f'self, "{value}", "{condition_text(presence)}"'
        return [f"    raise {self.place.use('misplaced')}({given})"]

    def _framed(self, name: str) -> list[str]:
        if not self.place.front and not self.place.back:
            return [f"{name} = data" if name else "return data"]
        for part in self.place.front:
            self._part(part)
        head, self._pieces = self._pieces, []
        for part in self.place.back:
            self._part(part)
        tail, lines = self._pieces, [*self._lines, *self._guard()]
        lines += self._piece(head[0], [], f"{name} = ") if head else [f'{name} = b""']
        lines.append(f"{name} += data")
        for piece in tail:
            lines += self._piece(piece, [], f"{name} += ")
        return lines

    def _size(self, part: LengthPart) -> str:
        return f"len(data) + {part.bias}" if part.bias else "len(data)"

    def _call(self, row: Row, rows: list[Row], before: str) -> list[str]:  # noqa: ARG002 - as in the base
        self._packed += 1
        name = f"_PACK_{self._packed}_{self.title}"
        text = self.place.prefix + format_of(row.codes)
        self.constants.append(f'{name} = {self.place.use("Struct")}("{text}").pack')
        return [f"{before}{name}({', '.join(row.arguments)})"]


@dataclass
class WalkedDecoder(Decoder):
    """Collects the code that decodes one message segment by segment."""

    _unpacked: int = 0
    #: Offsets count from the local ``at``.
    _walking: bool = False
    #: The local with the offset that a segment extends to at most.
    _end: str = "end"
    _counted_runs: set[tuple[str, bool]] = field(default_factory=set)

    def statements(self) -> list[str]:
        """Lines of the function body."""
        place = self.place
        decided = self._decided()
        unpacked, header = self._front()
        lines = ["message = _new(cls)", *decided, *unpacked]
        end = f"len({place.data}) - {place.trailer}" if place.trailer else f"len({place.data})"
        lines += [f"at = {place.header}", f"end = {end}"]
        self._walking = True
        for segment, cases in self.message.payload.by_choice:
            lines += self._choice(cases) if cases else self._segment(segment)
        lines += ["if at != end:", self._bad_layout]
        at = Size()
        for part in self._needed_back():
            self._part(part, at)
            at += part.size
        return [*lines, *header, *self._flushed(), *self._absent(), "return message"]

    def _decided(self) -> list[str]:
        """Statements that check and assign the values of the frame that conditions test."""
        place, envelope = self.place, self.place.envelope
        for part, member in envelope.values if envelope else ():
            if envelope and member in self.message.payload.decided_by:
                seen = pieces.read(envelope, part, place.data, skipped=place.skipped)
                taken = integers.bits_of(part.integer, seen, member.shift, member.bits)
                self.get_member(member, taken, self._place_of(part), place.data)
        lines, self._values = self._values, []
        return lines

    def _front(self) -> tuple[list[str], list[str]]:
        """Statements that unpack the header, and those that check and assign its values, which come last."""
        self._tabled = None
        at = Size(-self.place.header)
        for part in self.place.front:
            self._part(part, at)
            at += part.size
        header, self._values = self._values, []
        return self._flushed(), header

    def _segment(self, segment: Segment) -> list[str]:
        run = segment.run
        lines = [] if run is None else self._measured(run, segment)
        if segment.records is not None:
            at = self._offset(segment.steps[0])
            lines = read_lines(segment, self.message.payload, self.place, at, self._end)
        else:
            size = str(segment.size) if run is None else times(run)
            if segment.terminator:
                size += " + 1"
            elif run is None or segment.rest is None:
                lines += [f"if {self._end} - at < {size}:", self._bad_layout]
            for step in segment.steps:
                self._step(step)
            lines += [*self._flushed(), f"at += {size}"]
        presence = segment.presence
        if presence is None or presence.slot:
            return lines
        test = "at < end"
        if not presence.optional:
            test = condition([of_attribute(each) for each in presence.when], "message.{}")
        absent = [f"message.{held(each)} = None" for each in segment.settable]
        found = [f"if {test}:", *indented(lines)]
        return [*found, "else:", *indented(absent)] if absent else found

    def _choice(self, cases: Sequence[Segment]) -> list[str]:
        """The statements of the cases of a choice."""
        if cases[0].counted:
            slot = cases[0].slot
            self._end = f"{slot}_end"
            begun = f"{self._end} = at + {integers.bytes_of(slot)}"
            limit = [begun, f"if {self._end} > end:", self._bad_layout]
            lines = [*limit, *self._cases(cases), f"if at != {self._end}:", self._bad_layout]
            self._end = "end"
            return lines
        return self._cases(cases)

    def _cases(self, cases: Sequence[Segment]) -> list[str]:
        found: list[tuple[list[str], list[str]]] = []
        for segment in cases:
            assert segment.presence is not None
            test = condition([of_attribute(each) for each in segment.presence.when], "message.{}")
            body = self._segment(segment)
            if found and found[-1][1] == body:
                found[-1][0].append(test)
            else:
                found.append(([test], body))
        lines, word = list[str](), "if"
        for tests, body in found:
            lines += [f"{word} {' or '.join(tests)}:", *indented(body)]
            word = "elif"
        return [*lines, "else:", f"    message.{held(cases[0].steps[0])} = None"]

    def _measured(self, run: RunStep, segment: Segment) -> list[str]:
        """The statements that count a run which takes the rest, or ends with a terminator."""
        if segment.terminator:
            count, data = f"{run.name}_count", f"bytes({self.place.data}[at:{self._end}])"
            bounds = Within(run.length.minimum, run.length.maximum)
            found = f"{count} = {data}.find({literal(segment.terminator)})"
            return [found, f"if {integers.broken(bounds, count)}:", self._bad_layout]
        if segment.rest is None:
            return []
        rest = integers.size_text(segment.rest)
        left = f"{self._end} - at"
        if rest != "0":
            left += f" - ({rest})" if " " in rest else f" - {rest}"
        return divided(run, left, run.item_size, self._bad_layout)

    def _flushed(self) -> list[str]:
        """The statements collected so far: unpack the rows, then check and assign values."""
        lines: list[str] = []
        for row in self._rows:
            while row.codes and row.codes[-1].endswith("x"):
                row.codes.pop()
            if row.targets:
                self._unpacked += 1
                name = f"_UNPACK_{self._unpacked}_{self.title}"
                text = self.place.prefix + format_of(row.codes)
                self.constants.append(f'{name} = {self.place.use("Struct")}("{text}").unpack_from')
                lines += assigned_targets(row.targets, f"{name}({self.place.data}, {self._from(row.start)})")
        lines += [*self._sizes, *self._slices, *self._values]
        self._rows, self._sizes, self._slices, self._values = [], [], [], []
        self._open = False
        return lines

    def _from(self, size: Size) -> str:
        if not self._walking:
            return super()._from(size)
        return f"at + {size.fixed}" if size.fixed else "at"

    def _offset(self, step: Step) -> str:
        more = step.place.front.fixed - self.place.header
        return f"at + {more}" if more > 0 else f"at - {-more}" if more else "at"

    def _count_step(self, step: CountStep, at: Size) -> None:
        number = self._get(step.integer, f"{step.name}_raw", at)
        self._put_together(step.integer, number, step.name, self._offset(step))
        if (step.run, step.sized) in self._counted_runs:
            self._values += [f"if {number} != {integers.count_text(step)}:", self._bad_layout]
            return
        self._counted_runs.add((step.run, step.sized))
        if step.sized:
            self._values += sized_lines(step, number, self._bad_layout)
            return
        run, own = self.message.payload.run(step.run), integers.own_bytes(step.term, number)
        self._values += divided(run, own, step.scale, self._bad_layout)


def _tested(cases: Sequence[Segment]) -> str:
    """The attribute that selects a case."""
    presence = cases[0].presence
    assert presence is not None
    return attribute(presence.choosing.value)


class VariedDecoder(WalkedDecoder):
    """Collects the code that decodes a record of variable size, at an offset of a payload."""

    def statements(self) -> list[str]:
        """Lines of the function body."""
        self._tabled = None
        self._walking = True
        lines = ["start = at", "message = _new(cls)"]
        for segment, cases in self.message.payload.by_choice:
            lines += self._choice(cases) if cases else self._segment(segment)
        used = any("start" in line for line in lines[1:])
        return [*lines[0 if used else 1 :], "return message, at"]

    def _offset(self, step: Step) -> str:
        more = step.place.front.fixed
        return f"at + {more} - start" if more else "at - start"
