"""Generates the statements of payloads of texts between separators."""

from __future__ import annotations

from typing import assert_never

from qlinkgen._dataclass import dataclass
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
from qlinkgen.plan.payload import (
    BytesStep,
    ConstantStep,
    CountStep,
    ItemsStep,
    PayloadPlan,
    ReservedStep,
    ValueStep,
)
from qlinkgen.plan.separated import (
    TextStep,
    characters,
    counts_of,
    greatest_texts,
    most_texts,
    needed,
    needed_steps,
    skipped,
    text_steps,
    texts_behind,
)


def size_lines(payload: PayloadPlan, layouts: Layouts) -> list[str]:
    """Body of the function that returns the size of the payload of a struct."""
    steps = text_steps(payload)
    least = max(1, needed_steps(payload) + payload.leading)
    empty = skipped(payload)
    lines = [f"size_t size = {least - 1 - (empty is not None)}U;"]
    for index, step in enumerate(steps, int(payload.leading)):
        own = (
            _list_size(step, layouts, separators=step is empty)
            if isinstance(step, ItemsStep)
            else [f"size += {_size(step, payload, layouts)};"]
        )
        if index >= least:
            # The separators before it, of which those before the last field needed are counted.
            own.insert(0, f"after = {index - least + 1}U;")
        guard = isinstance(step, ItemsStep) and not step.length.minimum and step is not empty
        lines += _if(f"message->{step.name}_count > 0U", own) if guard else _guarded(step, own)
    if not any("message->" in line for line in lines):
        lines.append("(void)message;")
    if least == len(steps) + payload.leading:
        return [*lines, "return size;"]
    return [lines[0], "size_t after = 0U;", *lines[1:], "return size + after;"]


def _list_size(step: ItemsStep, layouts: Layouts, *, separators: bool) -> list[str]:
    """Statements that add the size of a list: with a separator for each item, or for each but the last."""
    count = f"{step.length.maximum}U" if step.fixed else f"message->{step.name}_count"
    value = checks.as_unsigned(step.number, f"message->{naming.member(step.name)}[index]")
    digits = _digits(step.item)
    one = f"{digits.most}U" if digits.fixed else layouts.text("size", step.item, digits, value)
    return [
        f"size += (size_t){count}{'' if separators else ' - 1U'};",
        *loop(count, [f"size += {one};"], count_type(step.length.maximum)),
    ]


def constant_size(payload: PayloadPlan) -> int:
    """The size of a payload without values."""
    steps = [step for step in payload.steps if isinstance(step, ConstantStep | ReservedStep)]
    return sum(len(step.integer.pack(step.value)) for step in steps) + most_texts(payload) - 1


def _size(step: TextStep, payload: PayloadPlan, layouts: Layouts) -> str:
    """The number of characters of a text in a struct."""
    match step:
        case ConstantStep() | ReservedStep():
            return f"{len(step.integer.pack(step.value))}U"
        case BytesStep() if step.fixed:
            return f"{step.length.maximum}U"
        case BytesStep():
            return f"(size_t)message->{step.name}_{step.quantity}"
        case ValueStep() | CountStep():
            digits = _digits(step.integer)
            if digits.fixed:
                return f"{digits.most}U"
            return layouts.text("size", step.integer, digits, _value(step, payload))
        case ItemsStep():
            raise AssertionError(f"{step.name} has a size for each item")
        case _:
            assert_never(step)


def _if(condition: str, lines: list[str]) -> list[str]:
    return [f"if ({condition}) {{", *(f"    {line}" for line in lines), "}"]


def _value(step: ValueStep | CountStep, payload: PayloadPlan) -> str:
    if isinstance(step, CountStep):
        return f"message->{step.run}_{payload.run(step.run).quantity}"
    return checks.as_unsigned(step.number, f"message->{naming.member(step.name)}")


def _guarded(step: TextStep, lines: list[str]) -> list[str]:
    """Statements for a text that may be absent."""
    if step.presence is None or not lines:
        return lines
    return _if(f"message->has_{step.presence.field}", lines)


#: Statements that pass a text and the separator after it.
_ONWARD = [
    "payload += length;",
    "size -= length;",
    "if (size > 0U) {",
    "    ++payload;",
    "    --size;",
    "}",
]


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
            *(["size_t left = size;"] if len(steps) + self.payload.leading > 1 else []),
            "",
        ]
        for step in steps:
            self._check_text(step)
            lines += _guarded(step, self._flushed())
        self._refuse(["capacity < size"], "CAPACITY")
        lines += self._flushed()
        empty = skipped(self.payload)
        has_items = f"{local(empty.name)} > 0U" if empty else ""
        for index, step in enumerate(steps):
            onward = ["++payload;", *(["--left;"] if step is not steps[-1] else [])]
            put = [f"payload[0] = {separator};", *onward] if index or self.payload.leading else []
            text = _guarded(step, self._text(step, last=step is steps[-1]))
            if step is empty:
                lines += _if(has_items, [*put, *text]) if put else text
                continue
            first_text = index == 1 and steps[0] is empty and not self.payload.leading
            lines += [*(_if(has_items if first_text else "left > 0U", put) if put else []), *text]
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
            return
        if isinstance(step, ItemsStep) and not step.fixed:
            held = Within(0, (1 << int(count_type(step.length.maximum)[4:-2])) - 1)
            self._refuse(checks.broken([self.payload.sendable(step)], local(step.name), held, 16), "LENGTH")
        self._check(step)

    def _text(self, step: TextStep, *, last: bool) -> list[str]:
        """Statements that write a text; the pointer is moved on unless it is the ``last``."""

        def onward(size: str) -> list[str]:
            return [] if last else [f"payload += {size};", f"left -= {size};"]

        if isinstance(step, ItemsStep):
            return self._list(step, last=last)
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
            put = self.layouts.text(
                "put", step.integer, digits, "payload", f"{digits.most}U", _value(step, self.payload)
            )
            return [f"{put};", *onward(f"{digits.most}U")]
        put = self.layouts.text("put", step.integer, digits, "payload", "length", _value(step, self.payload))
        if last and isinstance(digits, Words):
            return [f"{put};"]
        return ["{", f"    const size_t length = {_size(step, self.payload, self.layouts)};", f"    {put};",
                *(f"    {line}" for line in onward("length")), "}"]  # fmt: skip

    def _list(self, step: ItemsStep, *, last: bool) -> list[str]:
        """Statements that write a list with the separators in it."""
        separator = unsigned(step.between[0], 8, hexadecimal=True)
        value = checks.as_unsigned(step.number, f"message->{naming.member(step.name)}[index]")
        digits, lines = _digits(step.item), list[str]()
        size = f"{digits.most}U"
        if not digits.fixed:
            size = "length"
            lines.append(f"const size_t length = {self.layouts.text('size', step.item, digits, value)};")
        lines.append(f"{self.layouts.text('put', step.item, digits, 'payload', size, value)};")
        lines += [f"payload += {size};", *([] if last else [f"left -= {size};"])]
        put = [f"payload[0] = {separator};", "++payload;", *([] if last else ["--left;"])]
        return self._loop(step, [*(_if("index > 0U", put) if step.length.maximum > 1 else []), *lines])


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
        before = int(plan.leading)
        for step in steps:
            before += greatest_texts(step)
            if isinstance(step, ItemsStep):
                lines += self._list(step, before - greatest_texts(step))
                continue
            lines.append(f"length = {prefix}_text_size_(payload, size, {separator});")
            self._text(step)
            inner = self._flushed()
            if step.presence is not None:
                has = f"has_{step.presence.field}"
                lines.append(f"message->{has} = length > 0U;")
            lines += _guarded(step, inner)
            lines += _ONWARD if step is not steps[-1] else []
        self.reads = True
        return lines

    def _list(self, step: ItemsStep, before: int) -> list[str]:
        """Statements that read a list item by item, after so many other texts."""
        separator = unsigned(step.between[0], 8, hexadecimal=True)
        count, head = f"{step.length.maximum}U", list[str]()
        behind = texts_behind(self.payload)
        if not step.fixed and behind:
            count = "count"
            head = [
                f"const size_t count = texts - {before + behind}U;",
                f"message->{step.name}_count = ({count_type(step.length.maximum)})count;",
            ]
        elif not step.fixed:
            count = "count"
            left = f"(texts > {before}U) ? (texts - {before}U) : 0U" if before else "texts"
            head = (
                [f"size_t count = {left};"] if not step.length.minimum else [f"const size_t count = {left};"]
            )
            head += _if("(count == 1U) && (size == 0U)", ["count = 0U;"]) if not step.length.minimum else []
            head.append(f"message->{step.name}_count = ({count_type(step.length.maximum)})count;")
        least, most = characters(step)
        wrong = [f"length != {most}U"] if least == most else [f"length < {least}U", f"length > {most}U"]
        self.refuse(wrong, "LENGTH")
        target = f"message->{naming.member(step.name)}[index]"
        self._assign(target, step.number, self._number(step.item))
        body = [f"length = {self.layouts.cells()}_text_size_(payload, size, {separator});", *self._flushed()]
        lines = [*head, *loop(count, [*body, *_ONWARD])]
        told = [f"{each.name}_told != (uint64_t){count}" for each in counts_of(self.payload, step)]
        self.refuse(told, "LENGTH")
        lines += self._flushed()
        return lines if step.fixed else ["{", *(f"    {line}" for line in lines), "}"]

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
            case CountStep():
                number = self._number(step.integer)
                self.lines.append(f"const uint64_t {step.name}_told = (uint64_t){number};")
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
            case ItemsStep():
                raise AssertionError(f"{step.name} is read item by item")
            case _:
                assert_never(step)

    def _number(self, integer: Integer) -> str:
        """The bits of a number; adds the check that there is one."""
        digits = _digits(integer)
        self.refuse([self.layouts.wrong(integer, digits, "payload", "length")], "RANGE")
        return self.layouts.read(integer, digits, "payload", "length")
