"""Generates the statements of messages of texts between separators."""

from __future__ import annotations

from typing import assert_never

from qlinkgen._dataclass import dataclass
from qlinkgen.backends.python import floats, integers
from qlinkgen.backends.python.decode import assigned, assigned_targets, converted
from qlinkgen.backends.python.layout import in_hex, indented, literal, wrapped
from qlinkgen.backends.python.names import attribute
from qlinkgen.backends.python.walked import WalkedDecoder, WalkedEncoder
from qlinkgen.model.integer import Integer
from qlinkgen.model.types import Float
from qlinkgen.plan.expr import Size, Within
from qlinkgen.plan.payload import BytesStep, ConstantStep, CountStep, ItemsStep, ReservedStep, ValueStep
from qlinkgen.plan.separated import (
    TextStep,
    characters,
    counts_of,
    greatest_texts,
    most_texts,
    needed,
    needed_steps,
    open_list,
    skipped,
    text_steps,
    texts_behind,
)

#: Bits of a single-precision number.
_SINGLE = 32


@dataclass
class SeparatedEncoder(WalkedEncoder):
    """Collects the code that encodes one message text by text."""

    def statements(self, name: str) -> list[str]:
        """Statements that assign the bytes to the local ``name``, or return them if it is empty."""
        self._tabled = None
        payload, lines = self.message.payload, list[str]()
        for step in text_steps(payload):
            lines += self._text(step)
        empty = skipped(payload)
        texts = ['b""'] if payload.leading else []
        texts += (f"*{step.name}_texts" if step is empty else f"{step.name}_text" for step in payload.steps)
        separator, least = literal(payload.separator), max(1, needed_steps(payload) + payload.leading)
        if len(texts) == 1:
            return [*lines, f"data = {texts[0]}", *self._framed(name)]
        cut = [f"while len(texts) > {least} and not texts[-1]:", "    texts.pop()"]
        cut = cut if least < len(texts) else []
        return [
            *lines,
            *wrapped("texts = [", texts, "]", 8),
            *cut,
            f"data = {separator}.join(texts)",
            *self._framed(name),
        ]

    def _text(self, step: TextStep) -> list[str]:
        local, source = f"{step.name}_text", f"self.{attribute(step.name)}"
        match step:
            case ConstantStep() | ReservedStep():
                return [f"{local} = {literal(step.integer.pack(step.value))}"]
            case CountStep():
                number = f"len(self.{attribute(step.run)})"
                return [f"{local} = {integers.to_bytes(step.integer, number)}"]
            case ItemsStep():
                return [*self._list(step), *self._flushed(), self._joined(step)]
            case BytesStep():
                raw = self._octets(step)
                least, most = characters(step)
                self._terms.append(integers.holds(Within(least, most), f"len({raw})"))
                text = raw
            case ValueStep():
                raw = f"{step.name}_raw"
                if isinstance(kind := step.number.meaning, Float):
                    self._terms += floats.holds(kind, source)
                    text = f"{self.place.use('real')}({source}, {kind.bits == _SINGLE})"
                    return self._absent_or([*self._flushed(), f"{local} = {text}"], step, local)
                if step.number.scaling is not None:
                    self._lines.append(f"{raw} = {self.scales[step.name]}.raw({source})")
                else:
                    self._indexed(step)
                self._use_text(step.integer)
                text = integers.to_bytes(step.integer, raw)
            case _:
                assert_never(step)
        return self._absent_or([*self._flushed(), f"{local} = {text}"], step, local)

    @staticmethod
    def _absent_or(lines: list[str], step: TextStep, local: str) -> list[str]:
        """The statements of a text; none if it is absent."""
        if step.presence is None:
            return lines
        return [f'{local} = b""', f"if self.{attribute(step.name)} is not None:", *indented(lines)]

    def _list(self, step: ItemsStep) -> list[str]:
        """Statements that assign the numbers of a list; adds their conditions."""
        source = f"self.{attribute(step.name)}"
        item = f"{self.place.use('index')}(item)"
        if step.number.scaling is not None:
            item = f"{self.scales[step.name]}.raw(item)"
        self._terms.append(integers.holds(Within(step.length.minimum, step.length.maximum), f"len({source})"))
        legal = (integers.holds(rule, "item") for rule in step.limits)
        self._terms += [f"all({each} for item in {step.name}_raw)" for each in legal]
        return [f"{step.name}_raw = [{item} for item in {source}]"]

    def _joined(self, step: ItemsStep) -> str:
        self._use_text(step.item)
        texts = f"[{integers.to_bytes(step.item, 'item')} for item in {step.name}_raw]"
        if step is skipped(self.message.payload):
            return f"{step.name}_texts = {texts}"
        return f"{step.name}_text = {literal(step.between)}.join({texts})"


@dataclass
class SeparatedDecoder(WalkedDecoder):
    """Collects the code that decodes one message text by text."""

    def statements(self) -> list[str]:
        """Lines of the function body."""
        place, payload = self.place, self.message.payload
        steps, least = text_steps(payload), needed(payload)
        unpacked, header = self._front()
        lines = ["message = _new(cls)", *unpacked]
        start = str(place.header) if place.header else ""
        end = f"-{place.trailer}" if place.trailer else ""
        data = f"{place.data}[{start}:{end}]" if start or end else place.data
        lines.append(
            f"texts = {f'bytes({data})' if place.unique else data}.split({literal(payload.separator)})"
        )
        most = most_texts(payload)
        wrong = integers.broken(Within(least, most), "len(texts)")
        wrong += " or texts[0]" if payload.leading else ""
        lines += [f"if {wrong}:", self._bad_layout]
        opened = open_list(payload)
        whole = most - (opened.length.maximum if opened else 0)
        if least < whole:
            lines.append(f'texts += [b""] * ({whole} - len(texts))')
        lists = any(isinstance(step, ItemsStep) for step in steps)
        if not lists:
            names = [f"{step.name}_text" for step in steps]
            lines += assigned_targets(names, "texts[1:]" if payload.leading else "texts")
        index, after = int(payload.leading), texts_behind(payload)
        for step in steps:
            if isinstance(step, ItemsStep):
                lines += self._items_between(step, index)
            else:
                lines += [f"{step.name}_text = texts[{index}]"] if lists else []
                lines += self._text(step, self._text_start(index) if index else "0")
            # Behind an open list, texts are counted from the last one.
            index = -after if step is opened else index + greatest_texts(step)
        at, behind = Size(), self._needed_back()
        if behind:
            lines.append(f"at = len({place.data}) - {place.trailer}")
            self._walking = True
        for part in behind:
            self._part(part, at)
            at += part.size
        return [*lines, *header, *self._flushed(), *self._absent(), "return message"]

    def _text_start(self, index: int, more: str = "") -> str:
        """The offset of a text, which is counted from the last one if the index is negative."""
        counted = f"{index}" if index >= 0 else f"len(texts) - {-index}"
        return f"{self.place.use('start_of')}(texts, {counted}{more})"

    def _items_between(self, step: ItemsStep, start: int) -> list[str]:
        """Statements that decode a list, item by item."""
        local, target = f"{step.name}_texts", f"message.{attribute(step.name)}"
        behind = texts_behind(self.message.payload)
        stop = start + step.length.maximum if step.fixed else -behind
        head = [f"{local} = texts[{start or ''}:{stop or ''}]"]
        if not step.length.minimum and not behind:
            head += [f'if {local} == [b""]:', f"    {local} = []"]
        text, raw = f"{step.name}_text", f"{step.name}_raw"
        least, most = characters(step)
        self._values.append(f"{raw} = {self._number_in(step.item, text)}")
        at = self._text_start(start, " + at")
        name = attribute(step.name)
        self._refuse(f"{raw} > {step.item.maximum}", name, text, at)
        for rule in step.conditions:
            self._refuse(integers.broken(rule, raw), name, raw, at)
        item = converted(step.number, raw, self.scales.get(step.name, ""), self.place)
        body = [
            f"if {integers.broken(Within(least, most), f'len({text})')}:",
            self._bad_layout,
            *self._flushed(),
            *wrapped(f"{target}.append(", [item], ")", 12),
        ]
        lines = [*head, f"{target} = []", f"for at, {text} in enumerate({local}):", *indented(body)]
        for count in counts_of(self.message.payload, step):
            lines += [f"if {count.name}_raw != len({local}):", self._bad_layout]
        return lines

    def _text(self, step: TextStep, offset: str) -> list[str]:
        local, target = f"{step.name}_text", f"message.{attribute(step.name)}"
        least, most = characters(step)
        test = integers.broken(Within(least, most), f"len({local})")
        lines = [f"if {test}:", self._bad_layout]
        match step:
            case ReservedStep():
                return lines
            case ConstantStep() | CountStep():
                raw = self._read(step.integer, step.name, offset)
                for rule in () if isinstance(step, CountStep) else step.conditions:
                    self._refuse(integers.broken(rule, raw), step.name, raw, offset)
            case ValueStep() if isinstance(kind := step.number.meaning, Float):
                self._real(step, kind, target, offset)
            case ValueStep():
                raw = self._read(step.integer, step.name, offset)
                for rule in step.conditions:
                    self._refuse(integers.broken(rule, raw), step.name, raw, offset)
                scale = self.scales.get(step.name, "")
                self._values += assigned(target, step.number, raw, scale, self.place)
            case BytesStep():
                barred = [f"{in_hex(each)} in {local}" for each in step.excluded if each != self._separator]
                self._refuse(" or ".join([f"not {local}.isascii()", *barred]), step.name, local, offset)
                self._values.append(f'{target} = {local}.decode("ascii")')
            case ItemsStep():
                raise AssertionError(f"{step.name} is decoded item by item")
            case _:
                assert_never(step)
        lines += self._flushed()
        if step.presence is None:
            return lines
        return [f"if {local}:", *indented(lines), "else:", f"    {target} = None"]

    def _real(self, step: ValueStep, kind: Float, target: str, offset: str) -> None:
        """Read a floating-point number."""
        raw, text = f"{step.name}_raw", f"{step.name}_text"
        self._values.append(f"{raw} = {self.place.use('read_real')}({text}, {kind.bits == _SINGLE})")
        for rule in floats.holds(kind, raw):
            self._refuse(f"not {rule}", step.name, text, offset)
        self._values.append(f"{target} = {raw}")

    @property
    def _separator(self) -> int:
        return self.message.payload.separator[0]

    def _read(self, integer: Integer, name: str, offset: str) -> str:
        """Read a number; a text without one is illegal."""
        raw = f"{name}_raw"
        self._values.append(f"{raw} = {self._number_in(integer, f'{name}_text')}")
        self._refuse(f"{raw} > {integer.maximum}", name, f"{name}_text", offset)
        return raw
