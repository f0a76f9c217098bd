"""The statements that read a message's payload: nothing is read that is not there, all is checked."""

from __future__ import annotations

from dataclasses import dataclass, field

from qlinkgen.backends.c import checks
from qlinkgen.backends.c.encode import Cursor, count_member, loop
from qlinkgen.backends.c.layout import Layouts, pointer
from qlinkgen.backends.c.names import count_type, grouped, unsigned, unsigned_type
from qlinkgen.model.message import Field, Message
from qlinkgen.model.types import Array, Bits, Blob, Scalar


@dataclass
class Decoder:
    """Collects the statements for one message.

    In a message with several fields of variable size, ``rest`` is how many bytes there are beyond the fewest:
    each takes its share, and none may be left. One such field alone has all that ``size`` leaves. Either way
    every fixed byte is known to be there before it is read.
    """

    message: Message
    prefix: str
    layouts: Layouts
    lines: list[str] = field(default_factory=list)
    #: Some byte of the payload is looked at.
    reads: bool = False
    _cursor: Cursor = field(default_factory=Cursor)
    _counted: set[str] = field(default_factory=set)

    def statements(self) -> list[str]:
        """Lines of the function's body, behind the declarations."""
        self._check_size()
        for each in self.message.fields:
            self._read(each)
        if len(self.message.variable) > 1:
            self._refuse(["rest != 0U"], "LENGTH")
        return self.lines

    @property
    def uses_place(self) -> bool:
        """A field stands behind one of variable size."""
        return self._cursor.moved

    @property
    def uses_rest(self) -> bool:
        """The bytes beyond the fewest are counted."""
        return len(self.message.variable) > 1

    @property
    def counters(self) -> list[str]:
        """Fields whose number of items is held in a local variable, in wire order."""
        return [each.name for each in self.message.variable]

    def _refuse(self, terms: list[str], status: str, indent: str = "") -> None:
        if terms:
            upper = self.prefix.upper()
            lines = [f"if ({checks.condition(terms)}) {{", f"    return {upper}_ERROR_{status};", "}"]
            self.lines += [indent + line for line in lines]

    def _check_size(self) -> None:
        message = self.message
        if not message.variable:
            self._refuse([f"size != {message.max_size}U"], "LENGTH")
            return
        known = 1 if message.empty_is_default else 0  # no bytes at all have been dealt with before
        terms = [f"size < {message.min_size}U"] if message.min_size > known else []
        self._refuse([*terms, f"size > {message.max_size}U"], "LENGTH")
        if self.uses_rest:
            self.lines.append(f"rest = {_less('size', message.min_size)};")

    def _read(self, each: Field) -> None:
        kind = each.type
        if isinstance(kind, Scalar):
            self._read_scalar(each, kind)
        elif isinstance(kind, Bits):
            self._read_bits(kind)
        else:
            self._read_run(each, kind)

    # Integers

    def _get(self, scalar: Scalar) -> str:
        if misfit := self.layouts.misfit(scalar, "payload", self._cursor.index()):
            self._refuse([misfit], "RANGE")
        self.reads = True
        value = self.layouts.get(scalar, "payload", self._cursor.index())
        self._cursor.offset += scalar.size
        return value

    def _read_scalar(self, each: Field, scalar: Scalar) -> None:
        if scalar.reserved:
            self._cursor.offset += scalar.size
        elif scalar.counts:
            self._read_count(scalar)
        elif scalar.constant:
            self._refuse([f"{self._get(scalar)} != {checks.constant_bits(scalar)}"], "RANGE")
        elif scalar.meaning == "bool":
            value = self._get(scalar)
            self._refuse([f"{value} > 1U"], "RANGE")
            self.lines.append(f"message->{each.name} = {value} != 0U;")
        else:
            self._assign(f"message->{each.name}", scalar, self._get(scalar))

    def _assign(self, target: str, scalar: Scalar, raw: str, indent: str = "") -> None:
        self.lines.append(f"{indent}{target} = {checks.from_unsigned(scalar, raw, self.prefix)};")
        self._refuse(checks.refused_when_received(scalar, target), "RANGE", indent)

    def _read_count(self, scalar: Scalar) -> None:
        counted = next(each for each in self.message.fields if each.name == scalar.counts)
        assert isinstance(counted.type, Array | Blob)
        value, name, length = self._get(scalar), counted.name, counted.type.length
        scale = counted.type.item_size if scalar.counts_unit == "bytes" else 1
        if length.fixed:
            self._refuse([f"{value} != {unsigned(length.maximum * scale, scalar.bits)}"], "LENGTH")
        elif name in self._counted:
            expected = f"({scale}U * {name}_count)" if scale > 1 else f"{name}_count"
            self._refuse([f"{value} != {expected}"], "LENGTH")
        else:
            self._bound_count(name, value, scalar, counted.type, scale)

    def _bound_count(self, name: str, value: str, scalar: Scalar, kind: Array | Blob, scale: int) -> None:
        self._counted.add(name)
        if scale > 1:
            self._refuse([f"({value} % {scale}U) != 0U"], "LENGTH")
        count, most = f"{value} / {scale}U" if scale > 1 else value, kind.length.maximum
        terms = [f"{name}_count < {kind.length.minimum}U"] if kind.length.minimum else []
        if scalar.bits > 16:  # more than a size_t may hold
            self._refuse([f"{value} > {unsigned(most * scale, scalar.bits)}"], "LENGTH")
            count = f"(size_t)({count})"
        elif most * scale < scalar.natural_maximum:
            terms.append(f"{name}_count > {most}U")
        self.lines.append(f"{name}_count = {count};")
        self._refuse(terms, "LENGTH")

    def _read_bits(self, kind: Bits) -> None:
        raw_type, bits = unsigned_type(kind.container.bits), kind.container.bits
        outer, self.lines = self.lines, []
        value = self._get(kind.container)
        outer += self.lines
        self.lines = [f"const {raw_type} bits = {value};"]
        for member in kind.members:
            raw = _taken(member.shift, member.type, bits)
            if member.type.settable:
                self._assign(f"message->{member.name}", member.type, raw)
            elif member.type.constant:
                expected = unsigned(
                    member.type.default & ((1 << member.type.bits) - 1), bits, hexadecimal=True
                )
                self._refuse([f"{raw} != {expected}"], "RANGE")
        self.lines = [*outer, "{", *(f"    {line}" for line in self.lines), "}"]

    # Fields of several items

    def _read_run(self, each: Field, kind: Array | Blob) -> None:
        if kind.length.fixed:
            count = f"{kind.length.maximum}U"
        else:
            self._take_share(each, kind)
            count = f"{each.name}_count"
            member = count_type(kind.length.maximum)
            self.lines.append(f"message->{count_member(each)} = ({member}){count};")
        self.reads = True
        if isinstance(kind, Blob):
            self._read_blob(each, kind, count)
        else:
            self._read_items(each, kind, count)
        if kind.length.fixed:
            self._cursor.offset += kind.length.maximum * kind.item_size
        elif self._reads_behind(each):
            step = kind.item_size
            self.lines.append(self._cursor.pass_over(f"({step}U * {count})" if step > 1 else count))

    def _reads_behind(self, each: Field) -> bool:
        """A later field is looked at: reserved bytes are not."""
        fields = self.message.fields
        later = fields[fields.index(each) + 1 :]
        return any(not (isinstance(other.type, Scalar) and other.type.reserved) for other in later)

    def _read_blob(self, each: Field, kind: Blob, count: str) -> None:
        place = pointer("payload", self._cursor.index())
        self.lines.append(f"{self.prefix}_copy_(message->{each.name}, {place}, {count});")
        if kind.text:
            self._refuse([f"!{self.prefix}_is_text_(message->{each.name}, {count})"], "RANGE")

    def _read_items(self, each: Field, kind: Array, count: str) -> None:
        outer, self.lines = self.lines, []
        index = self._cursor.index("index" if kind.item_size == 1 else f"({kind.item_size}U * index)")
        if misfit := self.layouts.misfit(kind.item, "payload", index):
            self._refuse([misfit], "RANGE")
        raw = self.layouts.get(kind.item, "payload", index)
        self._assign(f"message->{each.name}[index]", kind.item, raw)
        self.lines = outer + loop(count, self.lines)

    def _take_share(self, each: Field, kind: Array | Blob) -> None:
        """Find how many items there are, and take their bytes from the rest."""
        least, step = kind.length.minimum * kind.item_size, kind.item_size
        counted, alone = each.name in self._counted, len(self.message.variable) == 1
        share = f"({step}U * {each.name}_count)" if step > 1 else f"{each.name}_count"
        if alone:
            left = _less("size", self.message.min_size - least)
            if counted:
                self._refuse([f"{share} != {grouped(left)}"], "LENGTH")
            else:  # bounded by the size of the message
                self._count_items(each, left, step)
            return
        if not counted:
            self._measure(each, kind)
        share = _less(share, least)
        self._refuse([f"{grouped(share)} > rest"], "LENGTH")
        self.lines.append(f"rest -= {share};")

    def _count_items(self, each: Field, left: str, step: int) -> None:
        if step > 1:
            left = grouped(left)
            self._refuse([f"({left} % {step}U) != 0U"], "LENGTH")
            left = f"{left} / {step}U"
        self.lines.append(f"{each.name}_count = {left};")

    def _measure(self, each: Field, kind: Array | Blob) -> None:
        """The last field of variable size takes what the counted ones before it leave."""
        left = "rest"
        if kind.item_size > 1:
            self._refuse([f"(rest % {kind.item_size}U) != 0U"], "LENGTH")
            left = f"(rest / {kind.item_size}U)"
        least = kind.length.minimum
        self.lines.append(
            f"{each.name}_count = {left} + {least}U;" if least else f"{each.name}_count = {left};"
        )
        self._refuse([f"{each.name}_count > {kind.length.maximum}U"], "LENGTH")


def _less(value: str, number: int) -> str:
    return f"{value} - {number}U" if number else value


def _taken(shift: int, scalar: Scalar, bits: int) -> str:
    mask = unsigned((1 << scalar.bits) - 1, bits, hexadecimal=True)
    moved = f"(bits >> {shift})" if shift else "bits"
    taken = f"({moved} & {mask})"
    return taken if scalar.meaning == "bool" else f"({unsigned_type(scalar.bits)}){taken}"
