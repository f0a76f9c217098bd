"""Generates the statements of payloads of texts between separators."""

from __future__ import annotations

from dataclasses import dataclass
from typing import assert_never

from qlinkgen.backends.c import checks
from qlinkgen.backends.c.decode import Decoder, other_than
from qlinkgen.backends.c.encode import Encoder, loop
from qlinkgen.backends.c.layout import Layouts
from qlinkgen.backends.c.names import count_type, unsigned
from qlinkgen.backends.c.sizes import local, local_size
from qlinkgen.model import naming
from qlinkgen.model.integer import Integer, TextForm
from qlinkgen.model.words import Words
from qlinkgen.plan.expr import Within
from qlinkgen.plan.payload import BytesStep, ConstantStep, PayloadPlan, ReservedStep, ValueStep
from qlinkgen.plan.separated import TextStep, characters, most_texts, needed, text_steps


def size_lines(payload: PayloadPlan, layouts: Layouts) -> list[str]:
    """Body of the function that returns the size of the payload of a struct."""
    least = needed(payload)
    lines = [f"size_t size = {least - 1}U;"]
    for index, step in enumerate(text_steps(payload), int(payload.leading)):
        own = [f"size += {_size(step, layouts)};"]
        if index >= least:
            # The separators before it, of which those before the last field needed are counted.
            own.insert(0, f"after = {index - least + 1}U;")
        lines += _guarded(step, own)
    if not any("message->" in line for line in lines):
        lines.append("(void)message;")
    if least == most_texts(payload):
        return [*lines, "return size;"]
    return [lines[0], "size_t after = 0U;", *lines[1:], "return size + after;"]


def constant_size(payload: PayloadPlan) -> int:
    """The size of a payload without values."""
    steps = [step for step in payload.steps if isinstance(step, ConstantStep | ReservedStep)]
    return sum(len(step.integer.pack(step.value)) for step in steps) + most_texts(payload) - 1


def _size(step: TextStep, layouts: Layouts) -> str:
    """The number of characters of a text in a struct."""
    match step:
        case ConstantStep() | ReservedStep():
            return f"{len(step.integer.pack(step.value))}U"
        case BytesStep() if step.fixed:
            return f"{step.length.maximum}U"
        case BytesStep():
            return f"(size_t)message->{step.name}_{step.quantity}"
        case ValueStep():
            digits = _digits(step.integer)
            if digits.fixed:
                return f"{digits.most}U"
            return layouts.text("size", step.integer, digits, _value(step))
        case _:
            assert_never(step)


def _value(step: ValueStep) -> str:
    return checks.as_unsigned(step.number, f"message->{naming.member(step.name)}")


def _guarded(step: TextStep, lines: list[str]) -> list[str]:
    """Statements for a text that may be absent."""
    if step.presence is None or not lines:
        return lines
    return [f"if (message->has_{step.presence.field}) {{", *(f"    {line}" for line in lines), "}"]


def _digits(integer: Integer) -> TextForm:
    assert integer.text is not None
    return integer.text


@dataclass
class SeparatedEncoder(Encoder):
    """Collects the statements that encode one message text by text."""

    function: str = ""

    def statements(self) -> list[str]:
        """Lines of the function body, without the last one."""
        steps, separator = text_steps(self.payload), unsigned(self.payload.separator[0], 8, hexadecimal=True)
        lines = [
            f"const {count_type(run.length.maximum)} {local(run.name)} = message->{run.name}_{run.quantity};"
            for run in self.payload.runs
        ]
        size = (
            f"{self.function}_size_(message)" if self.payload.settable else f"{constant_size(self.payload)}U"
        )
        lines += [
            f"const size_t size = {size};",
            *(["size_t left = size;"] if most_texts(self.payload) > 1 else []),
            "",
        ]
        for step in steps:
            self._check_text(step)
            lines += _guarded(step, self._flushed())
        self._refuse(["capacity < size"], "CAPACITY")
        lines += self._flushed()
        for index, step in enumerate(steps):
            if index or self.payload.leading:
                onward = ["++payload;", *(["--left;"] if step is not steps[-1] else [])]
                put = [f"payload[0] = {separator};", *onward]
                lines += ["if (left > 0U) {", *(f"    {line}" for line in put), "}"]
            lines += _guarded(step, self._text(step, last=step is steps[-1]))
        return lines

    def _flushed(self) -> list[str]:
        lines, self.lines = self.lines, []
        return lines

    def _check_text(self, step: TextStep) -> None:
        if isinstance(step, BytesStep):
            if not step.fixed:
                held = Within(0, (1 << int(count_type(step.length.maximum)[4:-2])) - 1)
                self._refuse(
                    checks.broken([self.payload.sendable(step)], local(step.name), held, 16), "LENGTH"
                )
            self._check(step)
            octets, count = f"message->{naming.member(step.name)}", self._number_of(step)
            barred = [self.layouts.has_octet(octets, count, each) for each in step.excluded]
            self._refuse(barred, "RANGE")
        else:
            self._check(step)

    def _text(self, step: TextStep, *, last: bool) -> list[str]:
        """Statements that write a text; the pointer is moved on unless it is the ``last``."""

        def onward(size: str) -> list[str]:
            return [] if last else [f"payload += {size};", f"left -= {size};"]

        if isinstance(step, ConstantStep | ReservedStep):
            octets = step.integer.pack(step.value)
            lines = [
                f"payload[{index}] = {unsigned(octet, 8, hexadecimal=True)};"
                for index, octet in enumerate(octets)
            ]
            return [*lines, *onward(f"{len(octets)}U")]
        if isinstance(step, BytesStep):
            name, count = naming.member(step.name), self._number_of(step)
            lines = loop(
                count, [f"payload[index] = message->{name}[index];"], count_type(step.length.maximum)
            )
            return [*lines, *onward(count if step.fixed else local_size(step.name))]
        digits = _digits(step.integer)
        if digits.fixed:
            put = self.layouts.text("put", step.integer, digits, "payload", f"{digits.most}U", _value(step))
            return [f"{put};", *onward(f"{digits.most}U")]
        put = self.layouts.text("put", step.integer, digits, "payload", "length", _value(step))
        if last and isinstance(digits, Words):
            return [f"{put};"]
        return ["{", f"    const size_t length = {_size(step, self.layouts)};", f"    {put};",
                *(f"    {line}" for line in onward("length")), "}"]  # fmt: skip


@dataclass
class SeparatedDecoder(Decoder):
    """Collects the statements that decode one message text by text."""

    init: str = ""

    def statements(self) -> list[str]:
        """Lines of the function body, without the last one."""
        steps, plan = text_steps(self.payload), self.payload
        separator = unsigned(plan.separator[0], 8, hexadecimal=True)
        lines = []
        if plan.settable:
            kind = self.init.removesuffix("_INIT").lower()
            lines = [f"const {kind}_t defaults = {self.init};"]
        prefix = self.layouts.cells()
        lines += [f"const size_t texts = {prefix}_texts_(payload, size, {separator});", "size_t length = 0U;"]
        lines += ["*message = defaults;"] if plan.settable else []
        least, most = needed(plan), most_texts(plan)
        wrong = [f"texts != {most}U"] if least == most else [f"texts < {least}U", f"texts > {most}U"]
        self.refuse(wrong if least > 1 or least == most else wrong[1:], "LENGTH")
        lines += self._flushed()
        if plan.leading:
            lines += self._led(separator)
        for step in steps:
            lines.append(f"length = {prefix}_text_size_(payload, size, {separator});")
            self._text(step)
            inner = self._flushed()
            if step.presence is not None:
                has = f"has_{step.presence.field}"
                lines.append(f"message->{has} = length > 0U;")
            lines += _guarded(step, inner)
            if step is not steps[-1]:
                lines += [
                    "payload += length;",
                    "size -= length;",
                    "if (size > 0U) {",
                    "    ++payload;",
                    "    --size;",
                    "}",
                ]
        self.reads = True
        return lines

    def _led(self, separator: str) -> list[str]:
        """Statements that pass the separator before the first text."""
        upper = self.layouts.prefix.upper()
        refused = checks.refusal([f"payload[0] != {separator}"], f"{upper}_ERROR_LENGTH")
        inner = [*refused, "++payload;", "--size;"]
        return ["if (size > 0U) {", *(f"    {line}" for line in inner), "}"]

    def _flushed(self) -> list[str]:
        lines, self.lines = self.lines, []
        return lines

    def _text(self, step: TextStep) -> None:
        least, most = characters(step)
        wrong = [f"length != {most}U"] if least == most else [f"length < {least}U", f"length > {most}U"]
        self.refuse(wrong if least else wrong[1:], "LENGTH")
        target = f"message->{naming.member(step.name)}"
        match step:
            case ReservedStep():
                pass
            case ConstantStep():
                self.refuse([other_than(step, self._number(step.integer))], "RANGE")
            case ValueStep():
                self._assign(target, step.number, self._number(step.integer))
            case BytesStep():
                if not step.fixed:
                    kind = count_type(step.length.maximum)
                    self.lines.append(f"message->{step.name}_{step.quantity} = ({kind})length;")
                prefix = self.layouts.prefix
                self.lines.append(f"{prefix}_copy_({target}, payload, length);")
                barred = [each for each in step.excluded if each != self.payload.separator[0]]
                terms = [f"!{prefix}_is_text_({target}, length)"]
                terms += [self.layouts.has_octet(target, "length", each) for each in barred]
                self.refuse(terms, "RANGE")
            case _:
                assert_never(step)

    def _number(self, integer: Integer) -> str:
        """The bits of a number; adds the check that there is one."""
        digits = _digits(integer)
        self.refuse([self.layouts.wrong(integer, digits, "payload", "length")], "RANGE")
        return self.layouts.read(integer, digits, "payload", "length")
