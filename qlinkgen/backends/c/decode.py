"""The statements that read a message's payload: nothing is read that is not there, all is checked."""

from __future__ import annotations

from dataclasses import dataclass, field

from qlinkgen.backends.c import checks
from qlinkgen.backends.c.encode import count_member
from qlinkgen.backends.c.layout import Layouts, pointer
from qlinkgen.backends.c.names import count_type, unsigned, unsigned_type
from qlinkgen.errors import GenerationError
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
    _place: str = "payload"
    _offset: int = 0
    _counted: set[str] = field(default_factory=set)
    _moved: bool = False

    def statements(self) -> list[str]:
        """Lines of the function's body, behind the declarations."""
        self._check_size()
        for each in self.message.fields:
            self._read(each)
        if len(self.message.variable) > 1:
            self._refuse(["rest != 0u"], "LENGTH")
        return self.lines

    @property
    def uses_pointer(self) -> bool:
        """A running pointer is needed."""
        return self._moved

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
            self._refuse([f"size != {message.max_size}u"], "LENGTH")
            return
        terms = [f"size < {message.min_size}u"] if message.min_size else []
        self._refuse([*terms, f"size > {message.max_size}u"], "LENGTH")
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
        if misfit := self.layouts.misfit(scalar, self._place, self._offset):
            self._refuse([misfit], "RANGE")
        value = self.layouts.get(scalar, self._place, self._offset)
        self._offset += scalar.size
        return value

    def _read_scalar(self, each: Field, scalar: Scalar) -> None:
        if scalar.reserved:
            self._offset += scalar.size
        elif scalar.counts:
            self._read_count(scalar)
        elif scalar.constant:
            self._refuse([f"{self._get(scalar)} != {checks.constant_bits(scalar)}"], "RANGE")
        elif scalar.meaning == "bool":
            value = self._get(scalar)
            self._refuse([f"{value} > 1u"], "RANGE")
            self.lines.append(f"message->{each.name} = {value} != 0u;")
        else:
            self._assign(f"message->{each.name}", scalar, self._get(scalar))

    def _assign(self, target: str, scalar: Scalar, raw: str, indent: str = "") -> None:
        self.lines.append(f"{indent}{target} = {checks.from_unsigned(scalar, raw)};")
        self._refuse(checks.refused_when_received(scalar, target), "RANGE", indent)

    def _read_count(self, scalar: Scalar) -> None:
        counted = next(each for each in self.message.fields if each.name == scalar.counts)
        assert isinstance(counted.type, Array | Blob)
        value, name, length = self._get(scalar), counted.name, counted.type.length
        scale = counted.type.item_size if scalar.counts_unit == "bytes" else 1
        if length.fixed:
            self._refuse([f"{value} != {unsigned(length.maximum * scale, scalar.bits)}"], "LENGTH")
        elif name in self._counted:
            expected = f"{scale}u * {name}_count" if scale > 1 else f"{name}_count"
            self._refuse([f"{value} != {expected}"], "LENGTH")
        else:
            self._bound_count(name, value, scalar, counted.type, scale)

    def _bound_count(self, name: str, value: str, scalar: Scalar, kind: Array | Blob, scale: int) -> None:
        self._counted.add(name)
        if scale > 1:
            self._refuse([f"{value} % {scale}u != 0u"], "LENGTH")
        count, most = f"{value} / {scale}u" if scale > 1 else value, kind.length.maximum
        terms = [f"{name}_count < {kind.length.minimum}u"] if kind.length.minimum else []
        if scalar.bits > 16:  # more than a size_t may hold
            self._refuse([f"{value} > {unsigned(most * scale, scalar.bits)}"], "LENGTH")
            count = f"(size_t)({count})"
        elif most * scale < scalar.natural_maximum:
            terms.append(f"{name}_count > {most}u")
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
            count = f"{kind.length.maximum}u"
        else:
            self._take_share(each, kind)
            count = f"{each.name}_count"
            member = count_type(kind.length.maximum)
            self.lines.append(f"message->{count_member(each)} = ({member}){count};")
        if kind.length.fixed and kind.item_size == 1 and isinstance(kind, Blob):
            index = f"{self._offset}u + index" if self._offset else "index"
            source = f"{self._place}[{index}]"
            self.lines += _loop(count, [f"message->{each.name}[index] = {source};"])
            self._offset += kind.length.maximum
        else:
            self._move_to_end()
            self._read_items(each, kind, count)
        if isinstance(kind, Blob) and kind.text:
            self._refuse([f"!{self.prefix}_is_text_(message->{each.name}, {count})"], "RANGE")

    def _read_items(self, each: Field, kind: Array | Blob, count: str) -> None:
        outer, self.lines = self.lines, []
        if isinstance(kind, Blob):
            self.lines.append(f"message->{each.name}[index] = at[0];")
        else:
            if misfit := self.layouts.misfit(kind.item, "at", 0):
                self._refuse([misfit], "RANGE")
            self._assign(f"message->{each.name}[index]", kind.item, self.layouts.get(kind.item, "at", 0))
        self.lines.append(f"at += {kind.item_size};")
        self.lines = outer + _loop(count, self.lines)

    def _take_share(self, each: Field, kind: Array | Blob) -> None:
        """Find how many items there are, and take their bytes from the rest."""
        least, step = kind.length.minimum * kind.item_size, kind.item_size
        counted, alone = each.name in self._counted, len(self.message.variable) == 1
        share = f"{step}u * {each.name}_count" if step > 1 else f"{each.name}_count"
        if alone:
            left = _less("size", self.message.min_size - least)
            if counted:
                self._refuse([f"{share} != {left}"], "LENGTH")
            else:  # bounded by the size of the message
                self._count_items(each, left, step)
            return
        if not counted:
            self._measure(each, kind)
        share = _less(share, least)
        self._refuse([f"{share} > rest"], "LENGTH")
        self.lines.append(f"rest -= {share};")

    def _count_items(self, each: Field, left: str, step: int) -> None:
        if step > 1:
            left = f"({left})" if " " in left else left
            self._refuse([f"{left} % {step}u != 0u"], "LENGTH")
            left = f"{left} / {step}u"
        self.lines.append(f"{each.name}_count = {left};")

    def _measure(self, each: Field, kind: Array | Blob) -> None:
        later = self._later_shares(each)
        if later:
            self._refuse([f"{' + '.join(later)} > rest"], "LENGTH")
        left = f"(rest - ({' + '.join(later)}))" if later else "rest"
        if kind.item_size > 1:
            self._refuse([f"{left} % {kind.item_size}u != 0u"], "LENGTH")
            left = f"{left} / {kind.item_size}u"
        least = kind.length.minimum
        self.lines.append(
            f"{each.name}_count = {left} + {least}u;" if least else f"{each.name}_count = {left};"
        )
        self._refuse([f"{each.name}_count > {kind.length.maximum}u"], "LENGTH")

    def _later_shares(self, each: Field) -> list[str]:
        behind = self.message.variable[self.message.variable.index(each) + 1 :]
        shares = []
        for other in behind:
            assert isinstance(other.type, Array | Blob)
            if other.name not in self._counted:
                what = f"{self.message.name}: the count of {other.name} stands behind the open {each.name}"
                raise GenerationError(f"{what}, so no decoder can find it; move it in front")
            least = other.type.length.minimum * other.type.item_size
            share = f"{other.type.item_size}u * {other.name}_count"
            shares.append(f"({share} - {least}u)" if least else share)
        return shares

    def _move_to_end(self) -> None:
        if self._place == "payload":
            self.lines.append(f"at = {pointer('payload', self._offset)};")
            self._place = "at"
        elif self._offset:
            self.lines.append(f"at += {self._offset};")
        self._offset = 0
        self._moved = True


def _less(value: str, number: int) -> str:
    return f"{value} - {number}u" if number else value


def _loop(count: str, body: list[str]) -> list[str]:
    return [f"for (size_t index = 0; index < {count}; ++index) {{", *(f"    {line}" for line in body), "}"]


def _taken(shift: int, scalar: Scalar, bits: int) -> str:
    mask = unsigned((1 << scalar.bits) - 1, bits, hexadecimal=True)
    moved = f"(bits >> {shift})" if shift else "bits"
    taken = f"({moved} & {mask})"
    return taken if scalar.meaning == "bool" or scalar.signed else f"({unsigned_type(scalar.bits)}){taken}"
