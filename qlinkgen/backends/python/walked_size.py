"""Generates the statements that find the size of a walked payload in a frame without a length."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

from qlinkgen.backends.python import integers
from qlinkgen.backends.python.decode import divided
from qlinkgen.backends.python.layout import indented, literal
from qlinkgen.backends.python.varied import condition
from qlinkgen.model.condition import Test
from qlinkgen.model.integer import Integer
from qlinkgen.plan.expr import Within
from qlinkgen.plan.payload import (
    BitsStep,
    CountStep,
    PayloadPlan,
    RecordsStep,
    RecordStep,
    RunStep,
    Segment,
    Step,
    ValueStep,
    by_choice,
    deciding,
    holders,
    nested,
    renamed,
    renamed_tests,
)


def walked_measure_lines(payload: PayloadPlan) -> list[str]:
    """Body of the method that finds the size of a walked payload from its beginning, see `measure_lines`.

    ``size`` is that of the payload as far as it is known, ``start`` the offset of the next segment, and
    ``read`` the end of the last number that decides: where a payload turns out to be too long.
    """
    bounded = any(segment.records for segment in payload.segments)
    measure = _Measure(payload.most if bounded else None)
    lines = measure.lines(payload.segments, ())
    if bounded:
        most = [f"if size > {payload.most}:", "    return -read"]
        return [f"size = {payload.least}", "read = start = at", *lines, *most, "return size"]
    return [f"size = {payload.least}", "start = at", *_without_last_start(lines), "return size"]


class _Measure:
    """Collects the statements, those of records inside of others with other locals."""

    def __init__(self, most: int | None, depth: int = 0) -> None:
        """``most``: size of the payload that counts can exceed; the end of numbers that decide is noted."""
        self._most = most
        self._depth = depth

    def lines(self, segments: Sequence[Segment], last: Sequence[Test]) -> list[str]:
        """The statements for a message or record; ``last`` tests values of a record."""
        self._tested = {test.value for test in (*deciding(segments), *last)}
        self._known = set[tuple[str, bool]]()
        self._steps = [step for each in segments for step in each.steps]
        absent = (each for each in holders(self._steps) if each.presence and each.name in self._tested)
        lines = [f"{each.name}_raw = 0" for each in absent]
        for segment, cases in by_choice(segments):
            if segment.counted:
                size = integers.bytes_of(segment.slot)
                lines += [f"size += {size}", f"start += {size}"]
                continue
            for each in cases or (segment,):
                own, presence = self._segment(each), each.presence
                lines += (
                    own if presence is None else [f"if {condition(presence.when, '{}_raw')}:", *indented(own)]
                )
        return lines

    def _segment(self, segment: Segment) -> list[str]:
        if segment.records is not None:
            return self._records(segment.records, present=segment.presence is None)
        decided = [line for step in segment.steps for line in self._decided(step)]
        run = segment.run
        if run is not None and segment.terminator:
            return self._sought(run, segment)
        if run is None:
            size = str(segment.size)
            # Known before its bytes are read, which a receiver of stuffed frames takes only as far as needed.
            return [*([f"size += {size}"] if segment.presence else []), *decided, f"start += {size}"]
        size = more = times(run)
        if segment.presence is None and run.length.minimum:
            more = f"{size} - {run.item_size * run.length.minimum}"
        return [*decided, f"size += {more}", f"start += {size}"]

    def _sought(self, run: RunStep, segment: Segment) -> list[str]:
        """The statements that look for the terminator of bytes, all of which is needed until it is there."""
        least, most = run.length.minimum, run.length.maximum
        return [
            *([f"size += {least + 1}"] if segment.presence else []),
            f"end = data.find({literal(segment.terminator)}, start, start + {most + 1})",
            "if end < 0:",
            f"    if len(data) > start + {most}:",
            f"        return -(start + {most + 1})",
            *([f"    if len(data) - at >= {self._most}:", "        return -len(data)"] if self._most else []),
            "    return max(size, len(data) + 1 - at)",
            *([f"if end < start + {least}:", "    return -(end + 1)"] if least else []),
            *(["read = end + 1"] if self._most else []),
            f"size += end - start{f' - {least}' if least else ''}",
            "start = end + 1",
        ]

    def _records(self, step: RecordStep | RecordsStep, *, present: bool) -> list[str]:
        """The statements for walked records; some of them are in the minimum of what is ``present``."""
        own, suffix = step.record.payload, nested(self._depth + 1)
        if isinstance(step, RecordStep):
            more = [] if present else [f"size += {own.least}"]
            inner = _Measure(self._most, self._depth + 1)
            return [*more, *inner.lines(renamed(step.record.segments, suffix), ())]
        counted = step.length.minimum if present else 0
        if (step.name, True) in self._known:
            more = [f"size += {integers.bytes_of(step.name)} - {counted * own.least}"]
            return [*more, f"start += {integers.bytes_of(step.name)}"]
        last = renamed_tests(step.last, suffix)
        inner = _Measure(self._most, self._depth + 1)
        lines = [f"size += {own.least}"]
        if counted:
            lines = [f"if index{suffix} >= {counted}:", f"    size += {own.least}"]
        lines += inner.lines(renamed(step.record.segments, suffix), last)
        if last:
            lines += [f"if {condition(last, '{}_raw')}:", "    break"]
        number = str(step.length.maximum) if step.fixed or last else f"{step.name}_count"
        index = f"index{suffix}" if counted else "_"
        loop = [f"for {index} in range({number}):", *indented(lines)]
        return [*loop, "else:", "    return -read"] if last else loop

    def _decided(self, step: Step) -> Iterable[str]:
        """The statements that read a step which decides later sizes."""
        names = {each.name for each in holders((step,))} & self._tested
        if (step.run, step.sized) in self._known if isinstance(step, CountStep) else not names:
            return
        assert isinstance(step, ValueStep | BitsStep | CountStep)
        front = step.place.front.fixed

        def at(more: int) -> str:
            return f"start + {front + more}" if front + more else "start"

        end = at(step.integer.size)
        if self._most:
            yield f"if {end} - at > {self._most}:"
            yield "    return -read"
        yield f"if len(data) < {end}:"
        yield "    return size"
        if self._most:
            yield f"read = {end}"
        number = integers.read(step.integer, "data", at)
        if isinstance(step, ValueStep):
            yield f"{step.name}_raw = {_number(step.integer, number)}"
        elif isinstance(step, BitsStep):
            yield f"{step.name}_whole = {number}"
            for member in step.members:
                if member.name in self._tested:
                    taken = f"{step.name}_whole >> {member.shift} & 0x{(1 << member.bits) - 1:X}"
                    signed = member.number.signed
                    yield f"{member.name}_raw = " + (
                        integers.sign_extended(f"({taken})", member.bits) if signed else taken
                    )
        else:
            self._known.add((step.run, step.sized))
            yield from self._count(step, number, f"    return -({end})")

    def _count(self, step: CountStep, number: str, otherwise: str) -> Iterable[str]:
        if step.sized:
            yield from sized_lines(step, number, otherwise)
            return
        run = next(each for each in self._steps if isinstance(each, RunStep) and each.name == step.run)
        yield from divided(run, integers.own_bytes(step.term, number), step.scale, otherwise)


def sized_lines(step: CountStep, number: str, otherwise: str) -> list[str]:
    """The statements that take the bytes of walked records from a count, and check them."""
    more, size = step.term.more, integers.bytes_of(step.run)
    bounds = Within(step.bounds.low - more, step.bounds.high - more)
    first = f"{size} = {integers.own_bytes(step.term, number)}"
    return [first, f"if {integers.broken(bounds, size)}:", otherwise]


def times(run: RunStep) -> str:
    """The size of a run as an expression."""
    count = f"{run.name}_count"
    return f"{run.item_size} * {count}" if run.item_size > 1 else count


def _number(integer: Integer, read: str) -> str:
    """A number that was read: without unused bits, and with its sign."""
    if integer.size == 1 and integer.bits < 8:
        read = f"{read} & 0x{integer.mask:X}"
    if integer.signed and (integer.size == 1 or integer.byteorder is None):
        return integers.sign_extended(f"({read})", integer.bits)
    return read


def _without_last_start(lines: list[str]) -> list[str]:
    while lines and lines[-1].lstrip().startswith("start += ") and not lines[-1].startswith(" "):
        lines = lines[:-1]
    return lines
