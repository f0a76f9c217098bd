"""The statements that turn a message into bytes: one struct for each run of fields of fixed size."""

from __future__ import annotations

from dataclasses import dataclass, field

from qlinkgen.backends.python import scalars
from qlinkgen.backends.python.place import (
    Place,
    folded,
    in_ranges,
    indented,
    items_span,
    joined_format,
    literal,
    wrapped,
)
from qlinkgen.model.frame import Part
from qlinkgen.model.message import Field, Message
from qlinkgen.model.types import Array, Bits, Blob, Scalar

#: Up to so many items there is a struct for each count; beyond, the format is made when it is needed.
MANY_ITEMS = 128


@dataclass
class Run:
    """Fields of fixed size in a row: formats and arguments; ``items`` is the array among them, if any."""

    codes: list[str] = field(default_factory=list)
    arguments: list[str] = field(default_factory=list)
    items: Array | None = None

    def format(self, prefix: str) -> str:
        """Format of the struct, with {n} for the number of items."""
        return prefix + joined_format(self.codes)


@dataclass
class Encoder:
    """Collects the code that encodes one message.

    Attributes:
        body: expression for the encoded bytes, over one or several lines.
        constants: definitions that stand in front of the class.
    """

    message: Message
    place: Place
    title: str
    number: str
    steps: dict[str, str]
    lines: list[str] = field(default_factory=list)
    conditions: list[str] = field(default_factory=list)
    constants: list[str] = field(default_factory=list)
    _pieces: list[Run | str] = field(default_factory=lambda: [Run()])

    def statements(self, before: str) -> list[str]:
        """Lines that compute the bytes; ``before`` is what stands before the expression, like ``return``."""
        self._measure()
        for part in self.place.front:
            self._part(part)
        for each in self.message.fields:
            self._field(each)
        for part in self.place.back:
            self._part(part)
        guard = []
        if self.conditions:
            guard = [*wrapped_condition(self.conditions), "    raise OutOfRange"]
        return [*self.lines, *guard, *self._expression(before)]

    # Sizes of what is variable

    def _measure(self) -> None:
        for each in self.message.variable:
            kind = each.type
            assert isinstance(kind, Array | Blob)
            source = f"self.{each.name}"
            if isinstance(kind, Blob):
                source = f"{each.name}_raw"
                self.lines.append(f"{source} = {_octets(kind, each.name)}")
            self.lines.append(f"{each.name}_count = len({source})")
            if not self._by_count(each):
                low, high = kind.length.minimum, kind.length.maximum
                count = f"{each.name}_count"
                self.conditions.append(f"{count} <= {high}" if not low else f"{low} <= {count} <= {high}")

    def _by_count(self, each: Field) -> bool:
        """There is a struct for each number of items, and none for an illegal one."""
        kind = each.type
        return isinstance(kind, Array) and self._struct_items(kind) and kind.length.maximum <= MANY_ITEMS

    def _struct_items(self, kind: Array) -> bool:
        alone = len(self.message.variable) == 1
        return bool(scalars.letter(kind.item, self.place.names.byteorder)) and (alone or kind.length.fixed)

    def _payload_size(self, bias: int) -> str:
        fixed = bias + sum(each.max_size for each in self.message.fields if each.fixed)
        terms = [str(fixed)] if fixed or not self.message.variable else []
        for each in self.message.variable:
            assert isinstance(each.type, Array | Blob)
            item = each.type.item_size
            terms.append(f"{each.name}_count" if item == 1 else f"{item} * {each.name}_count")
        return " + ".join(terms)

    # Parts of the frame

    def _part(self, part: Part) -> None:
        if part.role == "constant":
            self._add(f"{len(part.constant)}s", literal(part.constant))
        elif part.role == "checksum":
            self._add(f"{part.size}x")
        else:
            assert part.scalar is not None
            number = {"length": "", "message": self.number, "address": f"self.{part.name}"}[part.role]
            if part.role == "length":
                assert self.place.frame is not None
                number = self._payload_size(self.place.frame.length_bias)
            if part.role == "address":
                self.conditions.append(in_ranges(number, self.message.addresses))
            self._scalar(part.scalar, number)

    # Fields

    def _add(self, code: str, *arguments: str) -> None:
        run = self._pieces[-1]
        if isinstance(run, str):
            run = Run()
            self._pieces.append(run)
        run.codes.append(code)
        run.arguments.extend(arguments)

    def _scalar(self, scalar: Scalar, number: str) -> None:
        code, arguments = scalars.put(scalar, number, self.place.names.byteorder)
        self._add(code, *arguments)

    def _field(self, each: Field) -> None:
        kind = each.type
        if isinstance(kind, Scalar):
            self._value(each.name, kind)
        elif isinstance(kind, Bits):
            self._bits(each.name, kind)
        elif isinstance(kind, Blob):
            self._blob(each, kind)
        else:
            self._array(each, kind)

    def _value(self, name: str, scalar: Scalar) -> None:
        if scalar.counts:
            self._count(scalar)
        elif not scalar.settable:
            self._scalar(scalar, str(scalar.default))
        else:
            self._scalar(scalar, self._outgoing(name, scalar, in_struct=True))

    def _outgoing(self, name: str, scalar: Scalar, *, in_struct: bool) -> str:
        """The number of an attribute, checked as far as struct will not."""
        packed = in_struct and scalar.byteorder is not None
        steps = self.steps.get(name, "")
        conversion = scalars.outgoing(scalar, f"self.{name}", f"{name}_raw", steps, packed=packed)
        self.lines.extend(conversion.lines)
        self.conditions.extend(conversion.conditions)
        return conversion.result

    def _count(self, scalar: Scalar) -> None:
        counted = next(each for each in self.message.fields if each.name == scalar.counts)
        assert isinstance(counted.type, Array | Blob)
        scale = counted.type.item_size if scalar.counts_unit == "bytes" else 1
        if counted.fixed:
            self._scalar(scalar, str(counted.type.length.maximum * scale))
        else:
            count = f"{counted.name}_count"
            self._scalar(scalar, count if scale == 1 else f"{count} * {scale}")

    def _bits(self, name: str, kind: Bits) -> None:
        terms = []
        for member in kind.members:
            if member.type.settable:
                number = self._outgoing(member.name, member.type, in_struct=False)
                mask = (1 << member.type.bits) - 1
                number = f"({number} & {mask:#x})" if member.type.signed else number
            else:
                number = str(member.type.default & ((1 << member.type.bits) - 1))
            terms.append(f"{number} << {member.shift}" if member.shift else number)
        self.lines += folded(f"{name}_raw = ", terms, " | ")
        container = kind.container
        raw = f"{name}_raw"
        if container.signed:  # bits have no sign; only the way out of the struct has
            raw = scalars.sign_extended(raw, container.bits)
        self._scalar(container, raw)

    def _blob(self, each: Field, kind: Blob) -> None:
        raw = f"{each.name}_raw"
        if not kind.length.fixed:
            self._pieces.append(raw)
            return
        self.lines.append(f"{raw} = {_octets(kind, each.name)}")
        self.conditions.append(f"len({raw}) == {kind.length.maximum}")
        self._add(f"{kind.length.maximum}s", raw)

    def _array(self, each: Field, kind: Array) -> None:
        source = f"self.{each.name}"
        code = scalars.letter(kind.item, self.place.names.byteorder)
        if kind.length.fixed:
            self.conditions.append(f"len({source}) == {kind.length.maximum}")
        if not self._struct_items(kind):
            self._odd_items(each, kind)
            return
        self._add(f"{kind.length.maximum}{code}" if kind.length.fixed else f"{{n}}{code}", f"*{source}")
        if not kind.length.fixed:
            run = self._pieces[-1]
            assert isinstance(run, Run)
            run.items = kind

    def _odd_items(self, each: Field, kind: Array) -> None:
        """Items that struct does not know, or not in this byte order."""
        source, item = f"self.{each.name}", kind.item
        if item.byteorder is None:
            self.conditions.append(f"all({scalars.within('item', item)} for item in {source})")
            _, groups = scalars.put(item, "item", self.place.names.byteorder)
            self._pieces.append(f"bytes([byte for item in {source} for byte in ({', '.join(groups)},)])")
        else:
            self._pieces.append(f'b"".join([{scalars.to_bytes(item, "item")} for item in {source}])')

    # The expression

    def _expression(self, before: str) -> list[str]:
        runs = [piece for piece in self._pieces if isinstance(piece, Run) and piece.codes]
        pieces: list[list[str]] = []
        for piece in self._pieces:
            if isinstance(piece, str):
                pieces.append([piece])
            elif piece.codes:
                pieces.append(
                    self._call(piece, runs.index(piece) + 1 if len(runs) > 1 else 0, len(before) + 9)
                )
        if not pieces:
            return [f'{before}b""']
        return _joined(before, pieces)

    def _call(self, run: Run, index: int, indent: int) -> list[str]:
        name = f"_PACK_{self.title}" + (f"_{index}" if index else "")
        text = run.format(self.place.names.prefix)
        if run.items is None:
            self.constants.append(f'{name} = Struct("{text}").pack')
            return wrapped(f"{name}(", run.arguments, ")", indent)
        counted = next(each for each in self.message.variable if each.type is run.items)
        length = run.items.length
        if length.maximum > MANY_ITEMS:
            fixed = text.replace("{n}", f"{{{counted.name}_count}}")
            return wrapped("pack(", [f'f"{fixed}"', *run.arguments], ")", indent)
        span = items_span(length)
        self.constants.append(f'{name} = {{n: Struct(f"{text}").pack for n in {span}}}')
        return wrapped(f"{name}[{counted.name}_count](", run.arguments, ")", indent)


def _octets(kind: Blob, name: str) -> str:
    return f'self.{name}.encode("ascii")' if kind.text else f"as_bytes(self.{name})"


def _joined(before: str, pieces: list[list[str]]) -> list[str]:
    if len(pieces) == 1:
        return [before + pieces[0][0], *pieces[0][1:]]
    if all(len(piece) == 1 for piece in pieces):
        line = before + " + ".join(piece[0] for piece in pieces)
        if len(line) <= 94:
            return [line]
    lines = [f"{before}("]
    for index, piece in enumerate(pieces):
        lines += indented([("+ " if index else "") + piece[0], *piece[1:]])
    return [*lines, ")"]


def wrapped_condition(conditions: list[str]) -> list[str]:
    """``if not (all of them):`` over as many lines as it takes."""
    if len(conditions) == 1:
        only = conditions[0]
        if " == " in only and " <= " not in only and " or " not in only:
            return [f"if {only.replace(' == ', ' != ')}:"]
        return [f"if not {only}:"]
    return folded("if not ", conditions, " and ", ":", always=True)
