"""The statements that write a message's payload: checks first, then bytes in wire order."""

from __future__ import annotations

from dataclasses import dataclass, field

from qlinkgen.backends.c import checks
from qlinkgen.backends.c.layout import Layouts, pointer
from qlinkgen.backends.c.names import count_type, unsigned, unsigned_type
from qlinkgen.model.message import Field, Message
from qlinkgen.model.types import Array, Bits, Blob, Scalar


def size_terms(message: Message) -> str:
    """The size of a message's payload as an expression on its struct."""
    fixed = sum(each.max_size for each in message.fields if each.fixed)
    terms = [f"{fixed}u"] if fixed else []
    for each in message.variable:
        assert isinstance(each.type, Array | Blob)
        count = count_member(each)
        terms.append(
            f"{each.type.item_size}u * (size_t)message->{count}"
            if each.type.item_size > 1
            else f"(size_t)message->{count}"
        )
    return " + ".join(terms)


def count_member(each: Field) -> str:
    """The struct member that holds how much of a field of variable size there is."""
    return f"{each.name}_count" if isinstance(each.type, Array) else f"{each.name}_size"


@dataclass
class Encoder:
    """Collects the statements for one message."""

    message: Message
    prefix: str
    layouts: Layouts
    lines: list[str] = field(default_factory=list)
    _place: str = "payload"
    _offset: int = 0
    _open: bool = False

    def statements(self) -> list[str]:
        """Lines of the function's body, behind the declarations."""
        for each in self.message.fields:
            self._check(each)
        self._check_capacity()
        for each in self.message.fields:
            self._write(each)
        return self.lines

    def _refuse(self, terms: list[str], status: str) -> None:
        if terms:
            upper = self.prefix.upper()
            self.lines += [f"if ({checks.condition(terms)}) {{", f"    return {upper}_ERROR_{status};", "}"]

    def _check_capacity(self) -> None:
        if self.message.max_size == 0:
            self.lines.append("(void)payload;")
        self.lines.append(
            f"if (capacity < {'size' if self.message.variable else f'{self.message.max_size}u'}) {{"
        )
        self.lines += [f"    return {self.prefix.upper()}_ERROR_CAPACITY;", "}"]

    # Checks

    def _check(self, each: Field) -> None:
        kind = each.type
        if isinstance(kind, Scalar):
            if kind.settable:
                self._refuse(checks.refused_before_sending(kind, f"message->{each.name}"), "RANGE")
        elif isinstance(kind, Bits):
            for member in kind.members:
                if member.type.settable:
                    self._refuse(
                        checks.refused_before_sending(member.type, f"message->{member.name}"), "RANGE"
                    )
        else:
            self._check_count(each, kind)
            self._check_items(each, kind)

    def _check_count(self, each: Field, kind: Array | Blob) -> None:
        if kind.length.fixed:
            return
        member, length = f"message->{count_member(each)}", kind.length
        holds = {"uint8_t": 0xFF, "uint16_t": 0xFFFF}.get(count_type(length.maximum))
        terms = [f"{member} < {length.minimum}u"] if length.minimum else []
        terms += [f"{member} > {length.maximum}u"] if length.maximum != holds else []
        self._refuse(terms, "LENGTH")

    def _check_items(self, each: Field, kind: Array | Blob) -> None:
        count = str(kind.length.maximum) + "u" if kind.length.fixed else f"message->{count_member(each)}"
        if isinstance(kind, Blob):
            if kind.text:
                self._refuse([f"!{self.prefix}_is_text_(message->{each.name}, {count})"], "RANGE")
            return
        terms = checks.refused_before_sending(kind.item, f"message->{each.name}[index]")
        if terms:
            self.lines.append(f"for (size_t index = 0; index < {count}; ++index) {{")
            start = len(self.lines)
            self._refuse(terms, "RANGE")
            self.lines[start:] = [f"    {line}" for line in self.lines[start:]]
            self.lines.append("}")

    # Bytes

    def _write(self, each: Field) -> None:
        kind = each.type
        if isinstance(kind, Scalar):
            self._put(kind, self._value(each, kind))
        elif isinstance(kind, Bits):
            self._write_bits(kind)
        elif isinstance(kind, Blob):
            self._write_run(each, kind, [f"at[index] = message->{each.name}[index];"])
        else:
            value = checks.as_unsigned(kind.item, f"message->{each.name}[index]")
            self._write_run(each, kind, [self.layouts.put(kind.item, "at", 0, value)])

    def _put(self, scalar: Scalar, value: str) -> None:
        self.lines.append(self.layouts.put(scalar, self._place, self._offset, value))
        self._offset += scalar.size

    def _value(self, each: Field, scalar: Scalar) -> str:
        if scalar.counts:
            return self._count(scalar)
        if not scalar.settable:
            return checks.constant_bits(scalar)
        return checks.as_unsigned(scalar, f"message->{each.name}")

    def _count(self, scalar: Scalar) -> str:
        counted = next(each for each in self.message.fields if each.name == scalar.counts)
        assert isinstance(counted.type, Array | Blob)
        kind, member = unsigned_type(scalar.bits), f"message->{count_member(counted)}"
        scale = counted.type.item_size if scalar.counts_unit == "bytes" else 1
        if counted.type.length.fixed:
            return unsigned(counted.type.length.maximum * scale, scalar.bits)
        return f"({kind})({member} * {scale}u)" if scale > 1 else f"({kind}){member}"

    def _write_bits(self, kind: Bits) -> None:
        unsigned_kind = unsigned_type(kind.container.bits)
        self.lines.append("{")
        preset = sum((m.type.default << m.shift) & m.mask for m in kind.members if not m.type.settable)
        self.lines.append(
            f"    {unsigned_kind} bits = {unsigned(preset, kind.container.bits, hexadecimal=True)};"
        )
        for member in kind.members:
            if member.type.settable:
                bits = _in_place(member.type, member.shift, f"message->{member.name}", kind.container.bits)
                self.lines.append(f"    bits = ({unsigned_kind})(bits | {bits});")
        self.lines.append("    " + self.layouts.put(kind.container, self._place, self._offset, "bits"))
        self.lines.append("}")
        self._offset += kind.size

    def _write_run(self, each: Field, kind: Array | Blob, body: list[str]) -> None:
        fixed, step = kind.length.fixed, kind.item_size
        count = f"{kind.length.maximum}u" if fixed else f"message->{count_member(each)}"
        if fixed and step == 1:
            index = f"{self._offset}u + index" if self._offset else "index"
            statement = (
                body[0]
                .replace("at[index]", f"{self._place}[{index}]")
                .replace("at[0]", f"{self._place}[{index}]")
            )
            self.lines += [f"for (size_t index = 0; index < {count}; ++index) {{", f"    {statement}", "}"]
            self._offset += kind.length.maximum
            return
        self._move_to_end()
        self.lines.append(f"for (size_t index = 0; index < {count}; ++index) {{")
        self.lines += (
            [f"    {line}" for line in body] if step > 1 else [f"    {body[0].replace('at[index]', 'at[0]')}"]
        )
        self.lines += ["    at += 1;" if step == 1 else f"    at += {step};", "}"]

    def _move_to_end(self) -> None:
        if self._place == "payload":
            self.lines.append(f"at = {pointer('payload', self._offset)};")
            self._place = "at"
        elif self._offset:
            self.lines.append(f"at += {self._offset};")
        self._offset = 0
        self._open = True

    @property
    def uses_pointer(self) -> bool:
        """A running pointer is needed."""
        return self._open


def _in_place(scalar: Scalar, shift: int, value: str, bits: int) -> str:
    kind = unsigned_type(bits)
    mask = unsigned((1 << scalar.bits) - 1, bits, hexadecimal=True)
    if scalar.meaning == "bool":
        return f"({value} ? {unsigned(1 << shift, bits, hexadecimal=True)} : 0u)"
    taken = f"(({kind}){value} & {mask})"
    return f"({kind})({taken} << {shift})" if shift else taken
