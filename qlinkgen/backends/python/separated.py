"""Generates the statements of messages of texts between separators."""

from __future__ import annotations

from dataclasses import dataclass
from typing import assert_never

from qlinkgen.backends.python import integers
from qlinkgen.backends.python.decode import assigned, assigned_targets
from qlinkgen.backends.python.layout import indented, literal, wrapped
from qlinkgen.backends.python.names import attribute
from qlinkgen.backends.python.walked import WalkedDecoder, WalkedEncoder
from qlinkgen.model.integer import Integer
from qlinkgen.plan.expr import Size, Within
from qlinkgen.plan.payload import BytesStep, ConstantStep, ReservedStep, ValueStep
from qlinkgen.plan.separated import TextStep, characters, most_texts, needed, text_steps


@dataclass
class SeparatedEncoder(WalkedEncoder):
    """Collects the code that encodes one message text by text."""

    def statements(self, name: str) -> list[str]:
        """Statements that assign the bytes to the local ``name``, or return them if it is empty."""
        self._tabled = None
        payload, lines = self.message.payload, list[str]()
        for step in text_steps(payload):
            lines += self._text(step)
        texts = [*(['b""'] if payload.leading else []), *(f"{step.name}_text" for step in payload.steps)]
        separator, least = literal(payload.separator), needed(payload)
        if len(texts) == 1 == least:
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
            case BytesStep():
                raw = self._octets(step)
                least, most = characters(step)
                self._terms.append(integers.holds(Within(least, most), f"len({raw})"))
                self._terms += [f"{literal(bytes((each,)))} not in {raw}" for each in step.excluded]
                text = raw
            case ValueStep():
                raw = f"{step.name}_raw"
                if step.number.scaling is not None:
                    self._lines.append(f"{raw} = {self.scales[step.name]}.raw({source})")
                else:
                    self._indexed(step)
                self._use_text(step.integer)
                text = integers.to_bytes(step.integer, raw)
            case _:
                assert_never(step)
        lines = [*self._flushed(), f"{local} = {text}"]
        if step.presence is None:
            return lines
        return [f'{local} = b""', f"if {source} is not None:", *indented(lines)]


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
        if least < most:
            lines.append(f'texts += [b""] * ({most} - len(texts))')
        names = [f"{step.name}_text" for step in steps]
        lines += assigned_targets(names, "texts[1:]" if payload.leading else "texts")
        for index, step in enumerate(steps, int(payload.leading)):
            lines += self._text(step, f"{place.use('start_of')}(texts, {index})" if index else "0")
        at, behind = Size(), self._needed_back()
        if behind:
            lines.append(f"at = len({place.data}) - {place.trailer}")
            self._walking = True
        for part in behind:
            self._part(part, at)
            at += part.size
        return [*lines, *header, *self._flushed(), *self._absent(), "return message"]

    def _text(self, step: TextStep, offset: str) -> list[str]:
        local, target = f"{step.name}_text", f"message.{attribute(step.name)}"
        least, most = characters(step)
        test = integers.broken(Within(least, most), f"len({local})")
        lines = [f"if {test}:", self._bad_layout]
        match step:
            case ReservedStep():
                return lines
            case ConstantStep():
                raw = self._read(step.integer, step.name, offset)
                for rule in step.conditions:
                    self._refuse(integers.broken(rule, raw), step.name, raw, offset)
            case ValueStep():
                raw = self._read(step.integer, step.name, offset)
                for rule in step.conditions:
                    self._refuse(integers.broken(rule, raw), step.name, raw, offset)
                scale = self.scales.get(step.name, "")
                self._values += assigned(target, step.number, raw, scale, self.place)
            case BytesStep():
                barred = [
                    f"{literal(bytes((each,)))} in {local}"
                    for each in step.excluded
                    if each != self._separator
                ]
                self._refuse(" or ".join([f"not {local}.isascii()", *barred]), step.name, local, offset)
                self._values.append(f'{target} = {local}.decode("ascii")')
            case _:
                assert_never(step)
        lines += self._flushed()
        if step.presence is None:
            return lines
        return [f"if {local}:", *indented(lines), "else:", f"    {target} = None"]

    @property
    def _separator(self) -> int:
        return self.message.payload.separator[0]

    def _read(self, integer: Integer, name: str, offset: str) -> str:
        """Read a number; a text without one is illegal."""
        raw = f"{name}_raw"
        self._values.append(f"{raw} = {self._number_in(integer, f'{name}_text')}")
        self._refuse(f"{raw} > {integer.maximum}", name, f"{name}_text", offset)
        return raw
