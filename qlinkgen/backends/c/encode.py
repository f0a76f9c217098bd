"""The statements that write a message's payload: checks first, then bytes in wire order."""

from __future__ import annotations

from dataclasses import dataclass, field

from qlinkgen.backends.c import checks
from qlinkgen.backends.c.layout import Layouts
from qlinkgen.backends.c.names import count_type, unsigned, unsigned_type
from qlinkgen.model.message import Field, Message
from qlinkgen.model.types import Array, Bits, Blob, Scalar


def size_terms(message: Message, struct: str = "") -> str:
    """The size of a payload as an expression on its counts; ``struct`` is what they are members of."""
    fixed = sum(each.max_size for each in message.fields if each.fixed)
    terms = [f"{fixed}U"] if fixed else []
    for each in message.variable:
        assert isinstance(each.type, Array | Blob)
        count = count_member(each)
        terms.append(
            f"({each.type.item_size}U * (size_t){struct}{count})"
            if each.type.item_size > 1
            else f"(size_t){struct}{count}"
        )
    return " + ".join(terms)


def count_member(each: Field) -> str:
    """The struct member that holds how much of a field of variable size there is."""
    return f"{each.name}_count" if isinstance(each.type, Array) else f"{each.name}_size"


@dataclass
class Cursor:
    """The place in a payload that was come to; behind a field of variable size ``at`` holds it."""

    offset: int = 0
    moved: bool = False

    def index(self, further: str = "") -> str:
        """The place as an index; ``further`` is added to it."""
        terms = ["at"] if self.moved else []
        terms += [f"{self.offset}U" if terms or further else str(self.offset)] if self.offset else []
        return " + ".join([*terms, *([further] if further else [])]) or "0"

    def pass_over(self, size: str) -> str:
        """The statement that takes the place behind a field of variable size."""
        fixed = f"{self.offset}U + " if self.offset else ""
        operator = "+=" if self.moved else "="
        self.offset, self.moved = 0, True
        return f"at {operator} {fixed}{size};"


@dataclass
class Encoder:
    """Collects the statements for one message; counts are read from the struct once."""

    message: Message
    prefix: str
    layouts: Layouts
    lines: list[str] = field(default_factory=list)
    _cursor: Cursor = field(default_factory=Cursor)

    @property
    def counts(self) -> list[str]:
        """Declarations of the counts of fields of variable size."""
        counts = [
            (count_type(each.type.length.maximum), count_member(each))
            for each in self.message.variable
            if isinstance(each.type, Array | Blob)
        ]
        return [f"const {kind} {name} = message->{name};" for kind, name in counts]

    @property
    def uses_place(self) -> bool:
        """A field stands behind one of variable size."""
        return self._cursor.moved

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
            f"if (capacity < {'size' if self.message.variable else f'{self.message.max_size}U'}) {{"
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
        member, length = count_member(each), kind.length
        holds = {"uint8_t": 0xFF, "uint16_t": 0xFFFF}.get(count_type(length.maximum))
        terms = [f"{member} < {length.minimum}U"] if length.minimum else []
        terms += [f"{member} > {length.maximum}U"] if length.maximum != holds else []
        self._refuse(terms, "LENGTH")

    def _check_items(self, each: Field, kind: Array | Blob) -> None:
        count = self._count_of(each, kind)
        if isinstance(kind, Blob):
            if kind.text:
                self._refuse([f"!{self.prefix}_is_text_(message->{each.name}, {count})"], "RANGE")
            return
        terms = checks.refused_before_sending(kind.item, f"message->{each.name}[index]")
        if terms:
            outer, self.lines = self.lines, []
            self._refuse(terms, "RANGE")
            self.lines = outer + loop(count, self.lines, count_type(kind.length.maximum))

    # Bytes

    def _write(self, each: Field) -> None:
        kind = each.type
        if isinstance(kind, Scalar):
            self._put(kind, self._value(each, kind))
        elif isinstance(kind, Bits):
            self._write_bits(kind)
        else:
            self._write_items(each, kind)

    def _put(self, scalar: Scalar, value: str) -> None:
        self.lines.append(self.layouts.put(scalar, "payload", self._cursor.index(), value))
        self._cursor.offset += scalar.size

    def _value(self, each: Field, scalar: Scalar) -> str:
        if scalar.counts:
            return self._count(scalar)
        if not scalar.settable:
            return checks.constant_bits(scalar)
        return checks.as_unsigned(scalar, f"message->{each.name}")

    def _count(self, scalar: Scalar) -> str:
        counted = next(each for each in self.message.fields if each.name == scalar.counts)
        assert isinstance(counted.type, Array | Blob)
        kind, member = unsigned_type(scalar.bits), count_member(counted)
        scale = counted.type.item_size if scalar.counts_unit == "bytes" else 1
        if counted.type.length.fixed:
            return unsigned(counted.type.length.maximum * scale, scalar.bits)
        return f"({kind})({member} * {scale}U)" if scale > 1 else f"({kind}){member}"

    def _write_bits(self, kind: Bits) -> None:
        unsigned_kind, bits = unsigned_type(kind.container.bits), kind.container.bits
        preset = sum((m.type.default << m.shift) & m.mask for m in kind.members if not m.type.settable)
        terms = [
            _in_place(m.type, m.shift, f"message->{m.name}", bits) for m in kind.members if m.type.settable
        ]
        terms += [unsigned(preset, bits, hexadecimal=True)] if preset or not terms else []
        value = terms[0] if len(terms) == 1 else f"({unsigned_kind})({' | '.join(terms)})"
        self.lines.append(self.layouts.put(kind.container, "payload", self._cursor.index(), value))
        self._cursor.offset += kind.size

    def _write_items(self, each: Field, kind: Array | Blob) -> None:
        count, step, item = self._count_of(each, kind), kind.item_size, f"message->{each.name}[index]"
        index = self._cursor.index("index" if step == 1 else f"({step}U * index)")
        if isinstance(kind, Blob):
            statement = f"payload[{index}] = {item};"
        else:
            statement = self.layouts.put(kind.item, "payload", index, checks.as_unsigned(kind.item, item))
        self.lines += loop(count, [statement], count_type(kind.length.maximum))
        if kind.length.fixed:
            self._cursor.offset += kind.length.maximum * kind.item_size
        elif each is not self.message.fields[-1]:
            self.lines.append(
                self._cursor.pass_over(f"({step}U * (size_t){count})" if step > 1 else f"(size_t){count}")
            )

    @staticmethod
    def _count_of(each: Field, kind: Array | Blob) -> str:
        return f"{kind.length.maximum}U" if kind.length.fixed else count_member(each)


def loop(count: str, body: list[str], kind: str = "size_t") -> list[str]:
    """Statements for each item of a field."""
    return [f"for ({kind} index = 0U; index < {count}; ++index) {{", *(f"    {line}" for line in body), "}"]


def _in_place(scalar: Scalar, shift: int, value: str, bits: int) -> str:
    kind = unsigned_type(bits)
    mask = unsigned((1 << scalar.bits) - 1, bits, hexadecimal=True)
    if scalar.meaning == "bool":
        return f"({value} ? {unsigned(1 << shift, bits, hexadecimal=True)} : {unsigned(0, bits)})"
    if scalar.signed and kind != unsigned_type(scalar.bits):
        value = f"({unsigned_type(scalar.bits)}){value}"  # no sign is extended
    taken = f"({kind})(({kind}){value} & {mask})"
    return f"({kind})({taken} << {shift})" if shift else taken
