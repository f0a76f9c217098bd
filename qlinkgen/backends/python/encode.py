"""Generates the statements that encode a message: one struct for consecutive steps of fixed size."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import field
from typing import assert_never

from qlinkgen._dataclass import dataclass
from qlinkgen.backends.python import floats, integers, pieces
from qlinkgen.backends.python.filled import Filling, filling
from qlinkgen.backends.python.layout import (
    bare,
    in_hex,
    literal,
    wrapped,
)
from qlinkgen.backends.python.names import attribute, source_of
from qlinkgen.backends.python.place import Place
from qlinkgen.backends.python.structs import format_of, table, tabled
from qlinkgen.backends.python.varied import closed, ends, is_sized, octets_of
from qlinkgen.model.digits import Digits
from qlinkgen.model.integer import Integer, packed_size
from qlinkgen.model.types import Characters, Float
from qlinkgen.plan.expr import Condition, Within
from qlinkgen.plan.parts import (
    AddressPart,
    AddressSlot,
    BlocksPart,
    CellPart,
    CheckPart,
    ConstantPart,
    ConstantSlot,
    EqualPart,
    IdPart,
    IdSlot,
    LengthPart,
    MarkPart,
    Numeric,
    Part,
    PayloadPart,
    Slot,
)
from qlinkgen.plan.payload import (
    BitsStep,
    BytesStep,
    ConstantStep,
    CountStep,
    FilledStep,
    ItemsStep,
    Member,
    RecordsStep,
    RecordStep,
    ReservedStep,
    Step,
    ValueStep,
    term_of,
)
from qlinkgen.plan.tree import MessagePlan

#: Indent of the statements of an encoder inside its ``try``.
_INDENT = 12


@dataclass(eq=False)
class Row:
    """Consecutive steps of fixed size: formats and arguments; ``items`` is the run among them, if any."""

    codes: list[str] = field(default_factory=list)
    arguments: list[str] = field(default_factory=list)
    items: ItemsStep | None = None


@dataclass
class Encoder:
    """Collects the code that encodes one message.

    Attributes:
        message: the plan.
        place: the surroundings of the payload.
        title: the part of the names of constants that identifies the message.
        number: expression for its id.
        scales: constant that converts each scaled value.
        constants: definitions that precede the class.
    """

    message: MessagePlan
    place: Place
    title: str
    number: str
    scales: dict[str, str]
    constants: list[str] = field(default_factory=list)
    _lines: list[str] = field(default_factory=list)
    _terms: list[str] = field(default_factory=list)
    _late: list[str] = field(default_factory=list)
    _pieces: list[Row | Filling | str] = field(default_factory=list)
    #: The local with the bytes so far.
    _local: str = "data"

    def statements(self, name: str) -> list[str]:
        """Statements that assign the bytes to the local ``name``, or return them if it is empty."""
        self._tabled = tabled(self.message.payload, self.place.byteorder)
        self._local = name or "data"
        self._measure()
        for part in self.place.front:
            self._part(part)
        for step in self.message.payload.steps:
            self._step(step)
        for part in self.place.back:
            self._part(part)
        return [*self.checks, *self._late, *self._expression(name)]

    def put_member(self, member: Member) -> None:
        """Convert and check a value of the frame."""
        self._member(member)

    def octets(self, part: CellPart) -> str:
        """Convert and check the values of a part of the frame; the expression for its bytes."""
        number = self._part_number(part)
        self._use_text(part.integer)
        if part.integer.byteorder is None and not part.integer.text:
            self._lines.append(f"{part.name}_part = {bare(number)}")
            groups = [integers.group_out(f"{part.name}_part", chunk) for chunk in part.integer.chunks]
            return f"bytes(({', '.join(groups)}{',' if len(groups) == 1 else ''}))"
        primary = number if number.isidentifier() else f"({bare(number)})"
        return integers.to_bytes(part.integer, primary)

    @property
    def checks(self) -> list[str]:
        """The statements so far that convert and check values."""
        return [*self._lines, *self._guard()]

    def _guard(self) -> list[str]:
        """The statement that raises where a condition does not hold."""
        if not self._terms:
            return []
        holds = self._terms[0] if len(self._terms) == 1 else f"({' and '.join(self._terms)})"
        return [f"if not {holds}:", f"    raise {self.place.use('OutOfRange')}"]

    def _require(self, number: str, *rules: Condition) -> None:
        self._terms += [integers.holds(rule, number) for rule in rules]

    # Variable sizes

    def _measure(self) -> None:
        for run in self.message.payload.runs:
            source = source_of(run)
            if isinstance(run, BytesStep):
                source = self._octets(run)
            self._lines.append(f"{run.name}_count = len({source})")
            if run is not self._tabled:
                bounds = Within(run.length.minimum, run.length.maximum)
                count = f"{run.name}_count"
                self._terms.append(
                    integers.holds(bounds, count) if bounds.low else f"{count} <= {bounds.high}"
                )

    def _octets(self, run: BytesStep) -> str:
        """The bytes of a run as a local."""
        source = source_of(run)
        value = f'{source}.encode("ascii")' if run.text else f"{self.place.use('as_bytes')}({source})"
        self._lines.append(f"{run.name}_raw = {value}")
        self._terms += [f"{in_hex(each)} not in {run.name}_raw" for each in run.barred]
        return f"{run.name}_raw"

    # Parts of the frame

    def _part(self, part: Part) -> None:
        match part:
            case ConstantPart():
                self._add(f"{part.size}s", literal(part.data))
            case CheckPart():
                self._add(f"{part.size}x")
            case BlocksPart():
                pass  # added later, inside the payload
            case LengthPart():
                number = self._part_number(part)
                plain = integers.letter(part.integer, self.place.byteorder)
                self._integer(part.integer, number if plain else f"({number})")
            case IdPart():
                self._id(part)
            case AddressPart():
                self._integer(part.integer, self._addressed())
            case CellPart() if (value := self._alone(part)) is not None:
                source = f"self.{attribute(value.name)}"  # struct checks type and range
                whole = value.bits == part.integer.bits
                self._require(source, *(value.conditions if whole else value.limits))
                self._integer(part.integer, source)
            case CellPart() | EqualPart():
                self._lines.append(f"{part.name}_part = {bare(self._part_number(part))}")
                self._integer(part.integer, f"{part.name}_part")
            case MarkPart() | PayloadPart():
                raise AssertionError(f"{part.name} is not packed by a message's class")
            case _:
                assert_never(part)

    def _id(self, part: IdPart) -> None:
        if self.number == in_hex(self.message.id) and not integers.letter(part.integer, self.place.byteorder):
            self._add(f"{part.size}s", literal(part.integer.pack(self.message.id)))
        else:
            self._integer(part.integer, self.number)

    def _alone(self, part: CellPart) -> Member | None:
        """The only value of a part, if struct can pack it as that part, and nothing is derived from it."""
        followers = (each for each in (*self.place.front, *self.place.back) if isinstance(each, EqualPart))
        letter = integers.letter(part.integer, self.place.byteorder)
        match _set(part):
            case [Member(shift=0, number=number) as value] if letter:
                direct = not (
                    number.signed or number.scaling or isinstance(number.meaning, Float | Characters)
                )
                return value if direct and all(each.of is not part for each in followers) else None
            case _:
                return None

    def _size(self, part: LengthPart) -> str:
        """What a length counts, in bytes."""
        return integers.size_text(self.message.payload.size + part.bias)

    def _addressed(self) -> str:
        """The address, which must be legal."""
        number = f"self.{self.place.address}"
        if self.message.allowed is not None:
            self._require(number, self.message.allowed)
        return number

    def _part_number(self, part: Numeric) -> str:
        """The integer of a part."""
        match part:
            case LengthPart():
                size = self._size(part)
                if part.otherwise is not None:
                    return _handing(part, size)
                return f"({size}) // {part.scale}" if part.scale > 1 else size
            case IdPart():
                return self.number
            case AddressPart():
                return f"self.{self.place.address}"
            case CellPart():
                return " | ".join(map(self._slot, _set(part))) or "0"
            case EqualPart(of=CellPart()):
                return pieces.derived_part(part, f"{part.of.name}_part")
            case EqualPart():
                return pieces.derived_part(part, self._part_number(part.of))
            case _:
                assert_never(part)

    def _slot(self, slot: Slot) -> str:
        """The bits of a slot in place."""
        match slot:
            case IdSlot():
                shifted = f"{self.number} >> {slot.at}" if slot.at else self.number
                bits = f"({shifted} & 0x{(1 << slot.bits) - 1:X})"
            case AddressSlot():
                bits = self._addressed()
            case ConstantSlot():
                bits = f"0x{slot.values[0]:02X}"
            case Member():
                return self._member(slot)
            case _:
                assert_never(slot)
        return f"{bits} << {slot.shift}" if slot.shift else bits

    # Steps

    def _add(self, code: str, *arguments: str) -> None:
        if not self._pieces or not isinstance(self._pieces[-1], Row):
            self._pieces.append(Row())
        row = self._pieces[-1]
        assert isinstance(row, Row)
        row.codes.append(code)
        row.arguments.extend(arguments)

    def _integer(self, integer: Integer, number: str) -> None:
        self._use_text(integer)
        code, arguments = integers.put(integer, number, self.place.byteorder)
        self._add(code, *arguments)

    def _use_text(self, integer: Integer) -> None:
        """Import what writes the text of a number."""
        text = integer.text
        if isinstance(text, Digits) and text.point and (text.spaced or integer.minimum < 0):
            self.place.use("decimal")

    def _step(self, step: Step) -> None:  # noqa: C901  # a case a step
        match step:
            case ValueStep():
                self._value(step)
            case ConstantStep() | ReservedStep():
                self._number(step.integer, step.value)
            case CountStep():
                self._computed(step.name, step.integer, integers.count_text(step))
            case FilledStep():
                self._pieces.append(filling(step, self._local, self.place))
            case BitsStep():
                self._bits(step)
            case BytesStep():
                self._bytes(step)
            case ItemsStep():
                self._items(step)
            case RecordStep() if step.walked:
                self._pieces.append(octets_of(step, self.place))
            case RecordStep():
                name = self.place.classes[step.record.name]
                self._add(f"{step.record.size}s", f"{name}.to_bytes({source_of(step)})")
            case RecordsStep():
                self._records(step)
            case _:
                assert_never(step)

    def _number(self, integer: Integer, value: int) -> None:
        """Add a constant number, as bytes if struct has no letter for it."""
        if integers.letter(integer, self.place.byteorder):
            self._integer(integer, str(value))
        else:
            self._add(f"{integer.size}s", literal(integer.pack(value)))

    def _computed(self, name: str, integer: Integer, number: str) -> None:
        """Add an expression, as a local if struct has no letter for it."""
        if integers.letter(integer, self.place.byteorder):
            self._integer(integer, number)
            return
        self._lines.append(f"{name}_raw = {number}")
        self._require(f"{name}_raw", Within(integer.minimum, integer.maximum))
        self._integer(integer, f"{name}_raw")

    def _value(self, step: ValueStep) -> None:
        source, plain = source_of(step), integers.letter(step.integer, self.place.byteorder)
        if isinstance(step.number.meaning, Float):
            self._float(step, step.number.meaning, source)
        elif step.number.scaling is not None:
            self._lines.append(f"{step.name}_raw = {self.scales[step.name]}.raw({source})")
            self._integer(step.integer, f"{step.name}_raw")
        elif plain:  # struct checks type and range
            self._require(source, *step.conditions)
            self._integer(step.integer, source)
        else:
            self._indexed(step)
            self._integer(step.integer, f"{step.name}_raw")

    def _float(self, step: ValueStep, kind: Float, source: str) -> None:
        """Add a number, which struct converts and checks."""
        self._terms += floats.holds(kind, source)
        if code := floats.letter(step.number, step.integer, self.place.byteorder):
            self._add(code, source)
        else:
            form = floats.format_of(kind, step.integer)
            self._add(f"{step.integer.size}s", f'{self.place.use("pack")}("{form}", {source})')

    def _indexed(self, each: ValueStep | Member) -> None:
        """Assign a value to a local as an int, and check its range."""
        if isinstance(text := each.number.meaning, Characters):
            octets = f"{each.name}_octets"
            self._lines.append(f'{octets} = {source_of(each)}.encode("ascii")')
            self._lines.append(f'{each.name}_raw = int.from_bytes({octets}, "big")')
            self._terms.append(f"len({octets}) == {text.number}")
            self._terms += [f"{barred} not in {octets}" for barred in text.excluded]
            return
        self._lines.append(f"{each.name}_raw = {self.place.use('index')}({source_of(each)})")
        self._require(f"{each.name}_raw", *each.limits)

    def _bits(self, step: BitsStep) -> None:
        terms = list(map(self._member, step.members)) or ["0"]
        raw = f"{step.name}_whole"
        self._lines.append(f"{raw} = {' | '.join(terms)}")
        if step.integer.signed:  # struct packs a signed number
            self._lines.append(f"{raw} = {integers.sign_extended(raw, step.integer.bits)}")
        self._integer(step.integer, raw)

    def _member(self, member: Member) -> str:
        number = f"{member.name}_raw"
        if member.number.scaling is not None:
            source = source_of(member)
            self._lines.append(f"{number} = {self.scales[member.name]}.raw({source})")
        else:
            self._indexed(member)
        if member.number.signed:
            number = f"{number} & 0x{(1 << member.bits) - 1:X}"
            number = f"({number})" if member.shift else number
        return f"{number} << {member.shift}" if member.shift else number

    def _bytes(self, step: BytesStep) -> None:
        if step.fixed:
            raw = self._octets(step)
            self._terms.append(f"len({raw}) {'<=' if step.pad else '=='} {step.length.maximum}")
            if step.pad:
                self._terms.append(f"not {raw}.endswith({literal(step.pad)})")
            # struct fills up with zeros.
            filled = f"{raw}.ljust({step.length.maximum}, {literal(step.pad)})"
            self._add(f"{step.length.maximum}s", filled if step.pad.strip(b"\0") else raw)
        elif step.terminator:
            self._pieces.append(f"{step.name}_raw + {literal(step.terminator)}")
        else:
            self._pieces.append(f"{step.name}_raw")

    def _items(self, step: ItemsStep) -> None:
        source, kind = source_of(step), step.number.meaning
        code = floats.letter(step.number, step.item, self.place.byteorder)
        if step.fixed:
            self._terms.append(f"len({source}) == {step.length.maximum}")
        if isinstance(kind, Float):
            self._terms += [f"all({legal} for item in {source})" for legal in floats.holds(kind, "item")]
            if not code:
                count = str(step.length.maximum) if step.fixed else f"{{{step.name}_count}}"
                text = f'{"" if step.fixed else "f"}"{floats.format_of(kind, step.item, count)}"'
                data = f"{self.place.use('pack')}({text}, *{source})"
                self._add(
                    f"{step.length.maximum * step.item_size}s", data
                ) if step.fixed else self._pieces.append(data)
                return
        else:
            if step.number.scaling is not None:
                self._lines.append(
                    f"{step.name}_items = [{self.scales[step.name]}.raw(item) for item in {source}]"
                )
                source = f"{step.name}_items"
            if step.packed:
                self._row_of_bits(step, source)
                return
            if not code:
                self._odd_items(step, source)
                return
            self._terms += [
                f"all({integers.holds(rule, 'item')} for item in {source})" for rule in step.conditions
            ]
        if step.fixed:
            self._add(f"{step.length.maximum}{code}", f"*{source}")
        elif step is self._tabled:
            self._add(f"{{n}}{code}", f"*{source}")
            row = self._pieces[-1]
            assert isinstance(row, Row)
            row.items = step
        else:
            order = self.place.prefix
            self._pieces.append(f'{self.place.use("pack")}(f"{order}{{{step.name}_count}}{code}", *{source})')

    def _row_of_bits(self, step: ItemsStep, source: str) -> None:
        """Add items of a few bits: the text of their binary digits is faster than shifts."""
        bits, mask = step.item.bits, step.item.mask
        item = f"item & 0x{mask:X}" if step.item.signed else "item"
        number = str(step.length.maximum) if step.fixed else f"{step.name}_count"
        size = str(packed_size(step.length.maximum, bits)) if step.fixed else integers.bytes_of(step.name)
        if not step.fixed:
            self._lines.append(f"{size} = {integers.term_text(term_of(step))}")
        if step.number.meaning == "bool":
            # Every second digit of the bytes 00 and 01.
            self._lines.append(f"{step.name}_raw = bytes({source})")
            self._terms.append(f'not {step.name}_raw.strip(b"\\x00\\x01")')
            digits = f'{step.name}_raw{"[::-1]" if step.packed == "least" else ""}.hex()[1::2] or "0"'
        else:
            rules = step.conditions or (Within(step.item.minimum, step.item.maximum),)
            self._terms += [f"all({integers.holds(rule, 'item')} for item in {source})" for rule in rules]
            ordered = f"reversed({source})" if step.packed == "least" else source
            digits = f'"".join([f"{{{item}:0{bits}b}}" for item in {ordered}]) or "0"'
        whole = f"int({digits}, 2)"
        if step.packed == "most":
            row = f"{bits} * {number}" if bits > 1 else number
            spare = str(-step.length.maximum * bits % 8) if step.fixed else f"8 * {size} - {row}"
            whole = f"({whole} << {spare})" if spare != "0" else whole
        order = "little" if step.packed == "least" else "big"
        data = f'{whole}.to_bytes({size}, "{order}")'
        self._late.append(f"{step.name}_octets = {data}")
        if step.fixed:
            self._add(f"{size}s", f"{step.name}_octets")
        else:
            self._pieces.append(f"{step.name}_octets")

    def _odd_items(self, step: ItemsStep, source: str) -> None:
        """Add items that struct does not support, in this byte order or with these conditions."""
        local = f"{step.name}_raw"
        self._lines.append(f"{local} = [{self.place.use('index')}(item) for item in {source}]")
        rules = step.conditions or (Within(step.item.minimum, step.item.maximum),)
        for rule in rules:
            self._terms.append(f"all({integers.holds(rule, 'item')} for item in {local})")
        octets = f"{step.name}_octets"
        self._use_text(step.item)
        if step.item.byteorder is None and not step.item.text:
            groups = [integers.group_out("item", chunk) for chunk in step.item.chunks]
            data = f"bytes(({', '.join(groups)}{',' if len(groups) == 1 else ''}))"
        else:
            data = integers.to_bytes(step.item, "item")
        self._late.append(f"{octets} = [{data} for item in {local}]")
        self._pieces.append(f'b"".join({octets})')

    def _records(self, step: RecordsStep) -> None:
        source = source_of(step)
        octets = octets_of(step, self.place)
        if step.last:
            flags = f"[{ends(step)} for each in {source}]"
            self._terms.append(f"{flags} == [False] * ({step.name}_count - 1) + [True]")
        if test := closed(step):
            self._terms.append(f"all({test} for each in {source}[:-1])")
        if step.fixed:
            self._terms.append(f"len({source}) == {step.length.maximum}")
        if is_sized(self.message.payload, step.name):
            self._pieces.append(f"{step.name}_octets")
        elif step.fixed and not step.walked:
            self._add(f"{step.length.maximum * step.item_size}s", octets)
        else:
            self._pieces.append(octets)

    # The expression

    def _expression(self, name: str) -> list[str]:
        """Statements that join the pieces and assign them to ``name``, or return them if it is empty."""
        rows = [piece for piece in self._pieces if isinstance(piece, Row)]
        if not self._pieces:
            return [f'{name} = b""' if name else 'return b""']
        if len(self._pieces) == 1:
            return self._piece(self._pieces[0], rows, f"{name} = " if name else "return ")
        lines = self._piece(self._pieces[0], rows, f"{self._local} = ")
        for piece in self._pieces[1:]:
            lines += self._piece(piece, rows, f"{self._local} += ")
        return lines if name else [*lines, f"return {self._local}"]

    def _piece(self, piece: Row | Filling | str, rows: list[Row], before: str) -> list[str]:
        match piece:
            case Row():
                return self._call(piece, rows, before)
            case Filling():
                return [*piece.lines, before + piece.octets]
            case str():
                return [before + piece]
            case _:
                assert_never(piece)

    def _call(self, row: Row, rows: list[Row], before: str) -> list[str]:
        # The number precedes the title, because the name of a message may end in a number.
        name = f"_PACK_{rows.index(row) + 1}_{self.title}" if len(rows) > 1 else f"_PACK_{self.title}"
        text = self.place.prefix + format_of(row.codes)
        if row.items is None:
            self.constants.append(f'{name} = {self.place.use("Struct")}("{text}").pack')
            return wrapped(f"{before}{name}(", row.arguments, ")", _INDENT)
        self.place.use("Struct")
        self.constants += table(name, text, "pack", row.items, "n")
        return wrapped(f"{before}{name}[{row.items.name}_count](", row.arguments, ")", _INDENT)


def _set(part: CellPart) -> Sequence[Slot]:
    """The slots of a part without constant zeros."""
    return [slot for slot in part.slots if not isinstance(slot, ConstantSlot) or slot.values[0]]


def _handing(part: LengthPart, size: str) -> str:
    """The number of a length that hands over to a longer one."""
    if size.isdecimal():
        return str(part.number(int(size) - part.bias))
    return f"{size} if {size} <= {part.most} else {part.otherwise}"
