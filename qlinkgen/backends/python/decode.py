"""Generates the statements that decode a message: sizes, a struct for consecutive steps, then each value."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import field
from typing import assert_never

from qlinkgen._dataclass import dataclass
from qlinkgen.backends.python import filled, floats, integers, pieces, values
from qlinkgen.backends.python.layout import WIDTH, in_hex, indented, literal, slice_of, wrapped
from qlinkgen.backends.python.names import held
from qlinkgen.backends.python.place import Place
from qlinkgen.backends.python.structs import format_of, table, tabled
from qlinkgen.model.digits import Digits
from qlinkgen.model.integer import Integer, packed_size
from qlinkgen.model.types import Characters, Enum, Flags, Float, Scalar
from qlinkgen.plan.envelope import Envelope
from qlinkgen.plan.expr import Size, Within
from qlinkgen.plan.parts import (
    AddressPart,
    AddressSlot,
    BlocksPart,
    CellPart,
    CheckPart,
    ConstantPart,
    EqualPart,
    IdPart,
    LengthPart,
    MarkPart,
    Numeric,
    Part,
    PayloadPart,
)
from qlinkgen.plan.payload import (
    BitsStep,
    BytesStep,
    Compare,
    ConstantStep,
    CountStep,
    FilledStep,
    Infer,
    ItemsStep,
    Learn,
    Member,
    PayloadPlan,
    RecordsStep,
    RecordStep,
    ReservedStep,
    RunStep,
    Sizing,
    Step,
    ValueStep,
    all_records,
    term_of,
    value_name,
)
from qlinkgen.plan.tree import MessagePlan

#: Indent of the statements of a decoder.
_INDENT = 8


@dataclass
class Row:
    """Consecutive steps of fixed size: offset, formats, and the variables that they are unpacked to."""

    start: Size
    codes: list[str] = field(default_factory=list)
    targets: list[str] = field(default_factory=list)

    @property
    def starred(self) -> bool:
        """Whether a target takes several items; an assignment can have only one of these."""
        return any(target.startswith("*") for target in self.targets)


@dataclass
class Decoder:
    """Collects the code that decodes one message.

    Attributes:
        message: the plan.
        place: the surroundings of the payload.
        title: the message in the names of its constants.
        scales: constant that converts each scaled value.
        constants: definitions that precede the class.
    """

    message: MessagePlan
    place: Place
    title: str
    scales: dict[str, str]
    constants: list[str] = field(default_factory=list)
    _rows: list[Row] = field(default_factory=list)
    _open: bool = False
    #: Bytes after the payload that have been unpacked.
    _trailed: int = 0
    _sizes: list[str] = field(default_factory=list)
    _slices: list[str] = field(default_factory=list)
    _values: list[str] = field(default_factory=list)

    def statements(self) -> list[str]:
        """Lines of the function body."""
        payload = self.message.payload
        self._tabled = tabled(payload, self.place.byteorder)
        at = Size(-self.place.header)
        for part in self.place.front:
            self._part(part, at)
            at += part.size
        header: list[str] = []
        if _has_checks(
            payload
        ):  # a wrong check value is told before a value of the frame that is out of range
            header, self._values = self._values, header
        for step in payload.steps:
            self._step(step)
        self._values += header
        at = payload.size
        for part in self._needed_back():
            self._part(part, at)
            at += part.size
            self._trailed += part.size
        taken = self._taken_rows()
        counted = [] if payload.fixed or self._tabled else self._counted()
        return [
            *(self._empty() if payload.empty_is_default else []),
            *counted,
            "message = _new(cls)",
            *taken,
            *self._sizes,
            *self._slices,
            *self._values,
            *self._absent(),
            "return message",
        ]

    def _absent(self) -> list[str]:
        """The statements that give defaults to values of parts that a frame does not have."""
        values_after = self.place.after.values if self.place.after else ()
        return [f"message.{held(each)} = {values.default(each, self.place)}" for each in values_after]

    @property
    def _bad_layout(self) -> str:
        return f"    raise {self.place.use('LayoutError')}"

    def _at(self, size: Size) -> str:
        """An offset in the payload as an index of the argument."""
        return integers.size_text(size + self.place.header)

    def _start(self, size: Size) -> list[str]:
        """The statement that assigns an offset that varies."""
        return [f"start = {self._at(size)}"] if size.terms else []

    def _from(self, size: Size) -> str:
        """An assigned offset as an index."""
        return "start" if size.terms else self._at(size)

    # Empty payload

    def _empty(self) -> list[str]:
        place, chosen = self.place, values.required_defaults(self.message.payload, self.place)
        test = f"len({place.data}) == {place.overhead}" if place.overhead else f"not {place.data}"
        lines: list[str] = []
        if place.envelope and (address := place.envelope.address):
            raw = f"{place.address}_part"
            lines = [f"{raw} = {pieces.number(place.envelope, address, place.data, skipped=place.skipped)}"]
            lines += self._address_check(address[0].part, raw, _INDENT + 4)
            chosen = [f"{place.address}={raw}", *chosen]
        elif place.address and self.message.allowed is not None:
            # The caller sets the real address.
            chosen = [f"{place.address}={self.message.message.default_address}", *chosen]
        if not place.inside:
            lines += wrapped("return cls(", chosen, ")", _INDENT + 4)
            return [f"if {test}:", *indented(lines)]
        lines += wrapped("message = cls(", chosen, ")", _INDENT + 4)
        return [f"if {test}:", *indented([*lines, *self._alone(), "return message"])]

    def _alone(self) -> list[str]:
        """The statements that read the values of a frame with an empty payload."""
        place = self.place
        assert place.envelope is not None
        reader = Decoder(self.message, place, self.title, self.scales)
        for part, member in place.envelope.values:
            seen = pieces.read(place.envelope, part, place.data, skipped=place.skipped)
            taken = integers.bits_of(part.integer, seen, member.shift, member.bits)
            reader.get_member(member, taken, self._place_of(part), place.data)
        return reader.assignments

    # Parts of the frame

    def _part(self, part: Part, at: Size) -> None:
        match part:
            case AddressPart():
                self._address(part, at)
            case CellPart() if self._is_read(part):
                self._cell(part, at)
            case LengthPart() if self.place.unique:
                # The receiver relies on this comparison of length and size.
                number = self._size(part.integer, f"{part.name}_part", at)
                self._sizes += [f"if {number} != {self._length(part)}:", self._bad_layout]
            case LengthPart() | IdPart() | ConstantPart() | CellPart() | EqualPart() | CheckPart():
                self._row(at).codes.append(f"{part.size}x")
            case BlocksPart():
                pass  # a class gets the frame without them
            case MarkPart() | PayloadPart():
                raise AssertionError(f"{part.name} is not read by a message's class")
            case _:
                assert_never(part)

    def _is_read(self, part: CellPart) -> bool:
        """Whether a part has an address or values, beside those that are read before the payload."""
        before = self.message.payload.decided_by
        return any(
            isinstance(slot, AddressSlot) or (isinstance(slot, Member) and slot not in before)
            for slot in part.slots
        )

    def _address(self, part: AddressPart, at: Size) -> None:
        number = self._get(part.integer, f"{part.name}_part", at)
        self._put_together(part.integer, number)
        self._values += self._address_check(part, number, _INDENT)
        self._values.append(f"message.{self.place.address} = {number}")

    def _cell(self, part: CellPart, at: Size) -> None:
        """Read address and values in the bits of a part."""
        whole = f"{part.name}_part"
        self._get(part.integer, whole, at)
        self._put_together(part.integer, whole)
        for slot in part.slots:
            taken = integers.bits_of(part.integer, whole, slot.shift, slot.bits)
            if isinstance(slot, AddressSlot):
                number = f"{part.name}_address"
                self._values.append(f"{number} = {taken}")
                self._values += self._address_check(part, number, _INDENT)
                self._values.append(f"message.{self.place.address} = {number}")
            elif isinstance(slot, Member) and slot not in self.message.payload.decided_by:
                self.get_member(slot, taken, self._place_of(part), self.place.data)

    def _place_of(self, part: Part) -> str:
        """The offset of a part in the argument, negative from its end."""
        envelope = self.place.envelope
        assert envelope is not None
        trails = part in envelope.back
        return str(-envelope.from_end(part) if trails else envelope.offset(part) - self.place.skipped)

    def _needed_back(self) -> Sequence[Part]:
        """Parts after the payload up to the last one with the address or a value."""
        envelope = self.place.envelope
        back = envelope.back if envelope else ()
        holding = [bits.part for bits in envelope.address] if envelope else []
        holding += [part for part, _ in envelope.values] if envelope else []
        found = [back.index(part) for part in holding if part in back]
        return back[: max(found) + 1] if found else ()

    def _length(self, part: LengthPart) -> str:
        if self.message.payload.fixed:
            return str(self.message.payload.most + part.bias)
        beyond = self.place.overhead - part.bias
        return f"len({self.place.data}) - {beyond}" if beyond else f"len({self.place.data})"

    def _address_check(self, part: Numeric, number: str, indent: int) -> list[str]:
        place = self.place
        assert place.envelope is not None
        if self.message.allowed is None:
            return []
        frame = f"_PREAMBLE + {place.data}" if place.unique else place.data
        trails = part in place.envelope.back
        offset = -place.envelope.from_end(part) if trails else place.envelope.offset(part)
        name = part.name if isinstance(part, AddressPart) else place.address
        seen = ["cls", f'"{name}"', number, str(offset), frame]
        test = f"if {integers.broken(self.message.allowed, number)}:"
        return [test, *indented(wrapped(f"raise {self.place.use('illegal')}(", seen, ")", indent + 4))]

    # Rows

    def _row(self, at: Size, *, starred: bool = False) -> Row:
        """The row that continues at an offset, or a new one."""
        if not self._open or (starred and self._rows[-1].starred):
            self._rows.append(Row(at))
            self._open = True
        return self._rows[-1]

    def _get(self, integer: Integer, local: str, at: Size, target: str = "") -> str:
        """Unpack an integer, directly to ``target`` if struct supports it. Returns the name of the number."""
        taken = integers.get(integer, local, self.place.byteorder)
        row = self._row(at)
        row.codes.append(taken.code)
        row.targets.extend(taken.targets if taken.terms else [target or local])
        return local if taken.terms or not target else target

    def _put_together(self, integer: Integer, local: str, name: str = "", offset: str = "") -> None:
        """Combine several targets to a number, and check unused bits."""
        taken = integers.get(integer, local, self.place.byteorder)
        if not taken.terms:
            return
        if isinstance(integer.text, Digits) and integer.text.plain:
            self._values.append(f"{local} = {integers.number_in(integer, local)}")
            return
        if integer.text:
            text = f"{local.removesuffix('_raw')}_text"
            self._values += [f"{text} = {local}", f"{local} = {self._number_in(integer, text)}"]
            self._refuse(f"{local} > {integer.maximum}", name, text, offset)
            return
        if integer.bcd:
            self._values.append(f"{local} = {integers.digits(integer, local)}")
            self._refuse(f"not {local}.isdecimal()", name, local, offset)
            self._values.append(f"{local} = int({local})")
            return
        self._refuse_stray(taken, name, offset)
        self._values.append(f"{local} = {' | '.join(taken.terms)}")
        if integer.byteorder is None and integer.signed:
            self._values.append(f"{local} = {integers.sign_extended(local, integer.bits)}")

    def _number_in(self, integer: Integer, text: str) -> str:
        """The number of a text, above its maximum if it is illegal."""
        assert integer.text
        if isinstance(integer.text, Digits):
            self.place.use("read_decimal" if integer.text.base == 10 else "read_hexadecimal")
        return integers.number_in(integer, text)

    def _size(self, integer: Integer, local: str, at: Size, name: str = "", offset: str = "") -> str:
        """Unpack a number for comparison with sizes, before values are checked."""
        number = self._get(integer, local, at)
        taken = integers.get(integer, local, self.place.byteorder)
        if taken.terms:
            terms = taken.terms
            if integer.byteorder is None:
                terms = integers.group_terms(integer, integers.own_bits(integer, taken.targets))
            self._sizes.append(f"{local} = {' | '.join(terms)}")
        self._refuse_stray(taken, name, offset)
        return number

    def _refuse_stray(self, taken: integers.Get, name: str, offset: str) -> None:
        for sources, mask in taken.stray:
            seen = sources[0]
            if len(sources) > 1:
                self._values.append(f"stray = {' | '.join(sources)}")
                seen = "stray"
            self._refuse(f"{seen} > 0x{mask:02X}", name, seen, offset)

    def _taken_rows(self) -> list[str]:
        """The statements that unpack the rows."""
        payload, place = self.message.payload, self.place
        rows = [row for row in self._rows if row.targets]
        alone = len(self._rows) == 1 and len(rows) == 1 and not self._slices
        lines: list[str] = []
        for number, row in enumerate(rows):
            # The number precedes the title, because the name of a message may end in a number.
            name = f"_UNPACK_{number + 1}_{self.title}" if len(rows) > 1 else f"_UNPACK_{self.title}"
            if alone and (payload.fixed or self._tabled):
                lines += self._whole(name, row)
                continue
            while row.codes[-1].endswith("x"):
                row.codes.pop()
            self.constants.append(
                f'{name} = {place.use("Struct")}("{place.prefix}{format_of(row.codes)}").unpack_from'
            )
            lines += [
                *self._start(row.start),
                *assigned_targets(row.targets, f"{name}({place.data}, {self._from(row.start)})"),
            ]
        if payload.fixed and not (alone and rows):
            size = payload.most + place.overhead
            wrong = f"len({place.data}) != {size}" if size else place.data
            return [f"if {wrong}:", self._bad_layout, *lines]
        return lines

    def _whole(self, name: str, row: Row) -> list[str]:
        """Unpack everything at once; the struct, or the table of structs, also checks the size."""
        place, run = self.place, self._tabled
        trailer = [f"{place.trailer - self._trailed}x"] if place.trailer > self._trailed else []
        text = place.prefix + format_of([*row.codes, *trailer])
        if run is None:
            self.constants.append(f'{name} = {place.use("Struct")}("{text}").unpack')
            return assigned_targets(row.targets, f"{name}({place.data})")
        fixed = self.message.payload.size.fixed + place.overhead
        key = f"{fixed} + n * {run.item_size}" if fixed else f"n * {run.item_size}"
        place.use("Struct")
        self.constants += table(name, text, "unpack", run, key)
        return assigned_targets(row.targets, f"{name}[len({place.data})]({place.data})")

    # Sizes

    def _counted(self) -> list[str]:
        """The statements that determine the number of items of each run."""
        payload, lines = self.message.payload, list[str]()
        for each in payload.sizing:
            lines += self._sizing(each)
        if not any(isinstance(each, Infer) for each in payload.sizing):
            size = integers.size_text(payload.size + self.place.overhead)
            lines += [f"if len({self.place.data}) != {size}:", self._bad_layout]
        return lines

    def _sizing(self, sizing: Sizing) -> list[str]:
        match sizing:
            case Infer():
                others = integers.size_text(sizing.others + self.place.overhead)
                left = f"len({self.place.data})"
                if others != "0":
                    left += f" - {others}" if others.isdecimal() else f" - ({others})"
                return divided(sizing.run, left, sizing.run.item_size, self._bad_layout)
            case Learn():
                run = self.message.payload.run(sizing.count.run)
                start, number = self._count(sizing.count)
                if sizing.count.term.packed:
                    items = integers.items_text(sizing.count.term, number)
                    return [*start, *divided(run, items, 1, self._bad_layout)]
                own = integers.own_bytes(sizing.count.term, number)
                return [*start, *divided(run, own, sizing.count.scale, self._bad_layout)]
            case Compare():
                start, number = self._count(sizing.count)
                return [*start, f"if {number} != {_expected(sizing.count)}:", self._bad_layout]
            case _:
                assert_never(sizing)

    def _count(self, count: CountStep) -> tuple[list[str], str]:
        """Statements that read a count, and its expression."""
        front = count.place.front

        def at(more: int) -> str:
            if front.terms:
                return f"start + {more}" if more else "start"
            return self._at(front + more)

        return self._start(front), integers.read(count.integer, self.place.data, at)

    # Steps

    def _step(self, step: Step) -> None:  # noqa: C901  # a case a step
        at = step.place.front
        match step:
            case ValueStep():
                self._value(step, at)
            case ConstantStep():
                number = self._get(step.integer, f"{step.name}_raw", at)
                self._put_together(step.integer, number, value_name(step), self._offset(step))
                for rule in step.conditions:
                    self._refuse(integers.broken(rule, number), value_name(step), number, self._offset(step))
            case ReservedStep():
                self._row(at).codes.append(f"{step.integer.size}x")
            case CountStep():
                self._count_step(step, at)
            case FilledStep():
                self._filled(step, at)
            case BitsStep():
                self._bits(step, at)
            case BytesStep():
                self._bytes(step, at)
            case ItemsStep():
                self._items(step, at)
            case RecordStep() | RecordsStep():
                self._records(step, at)
            case _:
                assert_never(step)

    def _offset(self, step: Step) -> str:
        """The offset of a step in the payload: from its beginning, negative from its end, or computed."""
        if step.place.offset is not None:
            return str(step.place.offset)
        return str(-step.place.back) if step.place.back is not None else integers.size_text(step.place.front)

    def _refuse(self, test: str, name: str, seen: str, offset: str, data: str = "") -> None:
        call = wrapped(
            f"raise {self.place.use('illegal')}(",
            ["cls", f'"{name}"', seen, offset, data or self.place.payload],
            ")",
            _INDENT + 4,
        )
        self._values += [f"if {test}:", *indented(call)]

    def _value(self, step: ValueStep, at: Size) -> None:
        raw, target = f"{step.name}_raw", f"message.{held(step)}"
        if isinstance(step.number.meaning, Float):
            self._float(step, step.number.meaning, target, at)
            return
        if (
            _is_plain(step.number)
            and not step.conditions
            and integers.letter(step.integer, self.place.byteorder)
        ):
            self._get(step.integer, raw, at, target)
            return
        self._get(step.integer, raw, at)
        self._put_together(step.integer, raw, value_name(step), self._offset(step))
        for rule in step.conditions:
            self._refuse(integers.broken(rule, raw), value_name(step), raw, self._offset(step))
        self._values += assigned(target, step.number, raw, self.scales.get(step.name, ""), self.place)

    def _float(self, step: ValueStep, kind: Float, target: str, at: Size) -> None:
        row, raw, legal = self._row(at), f"{step.name}_raw", floats.holds(kind, f"{step.name}_raw")
        number = raw if legal else target
        code = floats.letter(step.number, step.integer, self.place.byteorder)
        row.codes.append(code or f"{step.integer.size}s")
        row.targets.append(number if code else raw)
        if not code:
            taken = f'{self.place.use("unpack")}("{floats.format_of(kind, step.integer)}", {raw})'
            self._values.append(f"({number},) = {taken}")
        if legal:
            self._refuse(f"not {legal[0]}", value_name(step), raw, self._offset(step))
            self._values.append(f"{target} = {raw}")

    def _count_step(self, step: CountStep, at: Size) -> None:
        """A count has been read with the sizes, except in a payload with a single struct."""
        local, offset = f"{step.name}_raw", self._offset(step)
        if self._tabled:
            number = self._size(step.integer, local, at, step.name, offset)
            items = f"len({_items_of(self._tabled)})"
            factor = step.term.factor
            expected = f"{factor} * {items}" if factor > 1 else items
            expected = integers.plus(expected, step.term.more)
            self._sizes += [f"if {number} != {expected}:", self._bad_layout]
        elif (taken := integers.get(step.integer, local, self.place.byteorder)).stray:
            self._get(step.integer, local, at)
            self._refuse_stray(taken, step.name, offset)
        else:
            self._row(at).codes.append(f"{step.integer.size}x")

    def _filled(self, step: FilledStep, at: Size) -> None:
        raw = self._get(step.integer, f"{step.name}_raw", at)
        self._put_together(step.integer, raw, step.name, self._offset(step))
        begin, end = (self._at(each) if each.terms else self._from(each) for each in (step.begin, step.end))
        right = f"{step.name}_right"
        self._values += filled.number(step, self.place.data, begin, end, self.place)
        self._values += [f"{right} = {filled.right(step, self.place)}", f"if {raw} != {right}:"]
        seen = [
            "cls",
            f'"{step.fault}"',
            f'"{step.name}"',
            raw,
            right,
            f"offset={self._offset(step)}",
            f"payload={self.place.payload}",
        ]
        call = wrapped(f"raise {self.place.use('differing')}(", seen, ")", _INDENT + 4)
        self._values += indented(call)

    def _bits(self, step: BitsStep, at: Size) -> None:
        whole = f"{step.name}_whole"
        self._get(step.integer, whole, at)
        self._put_together(step.integer, whole, value_name(step), self._offset(step))
        for member in step.members:
            taken = integers.bits_of(step.integer, whole, member.shift, member.bits)
            self.get_member(member, taken, self._offset(step))

    def take_end(self, envelope: Envelope, part: CellPart) -> None:
        """Check and assign the values of a part after the payload of ``frame``."""
        seen = pieces.read(envelope, part, "frame")
        for member in part.values:
            taken = integers.bits_of(part.integer, seen, member.shift, member.bits)
            self.get_member(member, taken, str(-envelope.from_end(part)), "frame")

    @property
    def assignments(self) -> list[str]:
        """The statements so far that check and assign values."""
        return self._values

    def get_member(self, member: Member, taken: str, offset: str, data: str = "") -> None:
        """Check and assign the value that some bits hold."""
        raw, target = f"{member.name}_raw", f"message.{held(member)}"
        if isinstance(text := member.number.meaning, Characters):
            whole = f"({taken})" if " " in taken else taken
            self._values.append(f'{raw} = {whole}.to_bytes({text.number}, "big")')
            wrong = [f"not {raw}.isascii()", *(f"{each} in {raw}" for each in text.excluded)]
            self._refuse(" or ".join(wrong), member.name, raw, offset, data)
            self._values.append(f'{target} = {raw}.decode("ascii")')
            return
        if member.number.signed:
            taken = integers.sign_extended(f"({taken})", member.bits)
        if _is_plain(member.number) and not member.conditions:
            self._values.append(f"{target} = {taken}")
            return
        self._values.append(f"{raw} = {taken}")
        for rule in member.conditions:
            self._refuse(integers.broken(rule, raw), member.name, raw, offset, data)
        self._values += assigned(target, member.number, raw, self.scales.get(member.name, ""), self.place)

    # Runs

    def _bytes(self, step: BytesStep, at: Size) -> None:
        target = f"message.{held(step)}"
        raw = f"{step.name}_raw" if step.text or step.pad else target
        if step.fixed:
            row = self._row(at)
            row.codes.append(f"{step.length.maximum}s")
            row.targets.append(raw)
        else:
            self._slice(step, raw)
        if step.pad:
            value = raw if step.text else target
            self._values.append(f"{value} = {raw}.rstrip({literal(step.pad)})")
        if step.text:
            barred = [f"{in_hex(each)} in {raw}" for each in step.barred]
            wrong = " or ".join([f"not {raw}.isascii()", *barred])
            self._refuse(wrong, value_name(step), raw, self._offset(step))
            self._values.append(f'{target} = {raw}.decode("ascii")')

    def _slice(self, step: RunStep, target: str) -> None:
        """Assign the bytes of a run of variable size."""
        front, term, data = step.place.front, term_of(step), self.place.data
        count = integers.term_text(term)
        start = self._from(front)
        taken = slice_of(data, start, f"{start} + {count}" if start != "0" else count)
        # The argument may be a memoryview.
        value = f"bytes({taken})" if self.place.unique else taken
        self._slices += [*self._start(front), f"{target} = {value}"]
        self._open = False

    def _items(self, step: ItemsStep, at: Size) -> None:
        kind, plain = step.number.meaning, _is_plain(step.number)
        whole, target = f"message.{held(step)}", _items_of(step)
        code = floats.letter(step.number, step.item, self.place.byteorder)
        if step.packed:
            self._row_of_bits(step, target, at)
            plain = plain or step.number.meaning == "bool"
        elif code and step.fixed:
            row = self._row(at, starred=True)
            row.codes.append(f"{step.length.maximum}{code}")
            row.targets.append(f"*{target}")
        elif step is self._tabled:
            row = self._row(at, starred=True)
            row.codes.append(f"{{n}}{code}")
            row.targets.append(f"*{target}")
        elif code or isinstance(kind, Float):
            count = str(step.length.maximum) if step.fixed else f"{{{step.name}_count}}"
            text = floats.format_of(kind, step.item, count) if isinstance(kind, Float) else ""
            text = f'{"" if step.fixed else "f"}"{text or f"{self.place.prefix}{count}{code}"}"'
            taken = f"{self.place.use('unpack_from')}({text}, {self.place.data}, {self._from(at)})"
            self._slices += [*self._start(at), f"{target} = list({taken})"]
            self._open = False
        else:
            self._odd_items(step, target, at)
        rules = [integers.holds(rule, "item") for rule in step.conditions]
        for rule in floats.holds(kind, "item") if isinstance(kind, Float) else rules:
            test = f"not all({rule} for item in {target})"
            self._refuse(test, value_name(step), target, self._offset(step))
        if not plain:
            item = converted(step.number, "item", self.scales.get(step.name, ""), self.place)
            self._values.append(f"{whole} = [{item} for item in {target}]")

    def _records(self, step: RecordStep | RecordsStep, at: Size) -> None:
        place, name = self.place, held(step)
        given = [place.classes[step.record.name], place.data, self._from(at)]
        if isinstance(step, RecordStep):
            self._row(at).codes.append(f"{step.record.size}x")
            reader = "read_record"
        else:
            reader = "read_records"
            if step.fixed:
                self._row(at).codes.append(f"{step.length.maximum * step.item_size}x")
                given.append(str(step.length.maximum))
            else:
                self._open = False
                given.append(f"{step.name}_count")
        seen = ["error", "cls", f'"{name}"', self._offset(step), place.payload]
        self._values += [
            *self._start(at),
            "try:",
            f"    message.{name} = {place.use(reader)}({', '.join(given)})",
            f"except {place.use('DecodeError')} as error:",
            f"    raise {place.use('inside')}({', '.join(seen)}) from None",
        ]

    def _row_of_bits(self, step: ItemsStep, target: str, at: Size) -> None:
        """Unpack items of a few bits; bits after them are ignored."""
        raw, bits, item = f"{step.name}_raw", step.item.bits, step.item
        if step.fixed:
            size = packed_size(step.length.maximum, bits)
            row = self._row(at)
            row.codes.append(f"{size}s")
            row.targets.append(raw)
        else:
            self._slice(step, raw)
        number = str(step.length.maximum) if step.fixed else f"{step.name}_count"
        row_bits = (
            number if bits == 1 else str(step.length.maximum * bits) if step.fixed else f"{bits} * {number}"
        )
        order = "little" if step.packed == "least" else "big"
        whole = f'int.from_bytes({raw}, "{order}")'
        if step.packed == "most":
            spare = str(-step.length.maximum * bits % 8) if step.fixed else f"8 * len({raw}) - {row_bits}"
            whole += f" >> {spare}" if spare != "0" else ""
        self._values.append(f"{step.name}_whole = {whole}")
        if step.number.meaning == "bool":  # the text of binary digits is faster than shifts
            width = number if step.fixed else f"{{{number}}}"
            back = "[::-1]" if step.packed == "least" else ""
            digits = f'f"{{{step.name}_whole:0{width}b}}"{back}[:{number}]'
            self._values.append(f'message.{held(step)} = [digit == "1" for digit in {digits}]')
            return
        last = str((step.length.maximum - 1) * bits) if step.fixed else f"{row_bits} - {bits}"
        starts = f"range(0, {row_bits}, {bits})" if step.packed == "least" else f"range({last}, -1, -{bits})"
        found = f"{step.name}_whole >> at & 0x{item.mask:X}"
        if item.signed:
            found = integers.sign_extended(f"({found})", bits)
        self._values.append(f"{target} = [{found} for at in {starts}]")

    def _odd_items(self, step: ItemsStep, target: str, at: Size) -> None:
        """Unpack items that struct does not support, or not in this byte order."""
        raw, item, size = f"{step.name}_raw", step.item, step.item_size
        if step.fixed:
            row = self._row(at)
            row.codes.append(f"{step.length.maximum * size}s")
            row.targets.append(raw)
        else:
            self._slice(step, raw)
        places = f"for index in range(0, len({raw}), {size})"
        if item.bcd:
            self._refuse(f"{raw} and not {raw}.hex().isdecimal()", value_name(step), raw, self._offset(step))
        if item.text:
            number = self._number_in(item, f"{raw}[index : index + {size}]")
            self._values.append(f"{target} = [{number} {places}]")
            self._refuse(
                f"max({target}, default=0) > {item.maximum}", value_name(step), raw, self._offset(step)
            )
            return
        if item.byteorder is not None:
            number = integers.from_bytes(item, f"{raw}[index : index + {size}]")
        else:
            sources = [f"{raw}[index + {index}]" if index else f"{raw}[index]" for index in range(size)]
            for index, chunk in enumerate(item.chunks):
                if chunk.bits < 8:
                    seen = f"max({raw}[{index}::{size}], default=0)"
                    self._refuse(f"{seen} > 0x{chunk.mask:02X}", value_name(step), raw, self._offset(step))
            number = " | ".join(integers.group_terms(item, sources))
            if item.signed:
                number = integers.sign_extended(f"({number})", item.bits)
        self._values.append(f"{target} = [{number} {places}]")


def _items_of(step: ItemsStep) -> str:
    """The variable of the items as on the wire."""
    return f"message.{held(step)}" if _is_plain(step.number) else f"{step.name}_items"


def assigned(target: str, number: Scalar, raw: str, scale: str, place: Place) -> list[str]:
    """Statements that assign an attribute from a raw number."""
    if isinstance(number.meaning, Enum):
        members = f"{place.classes[number.meaning.name]}.members.get("
        return wrapped(f"{target} = {members}", [raw, raw], ")", _INDENT)
    return [f"{target} = {converted(number, raw, scale, place)}"]


def converted(number: Scalar, raw: str, scale: str, place: Place) -> str:
    """The native value of a raw number, which must be a plain name."""
    meaning, scaling = number.meaning, number.scaling
    match meaning:
        case Enum():
            return f"{place.classes[meaning.name]}.members.get({raw}, {raw})"
        case "bool":
            return f"{raw} == 1"
        case Characters():
            raise AssertionError("a text is not converted from a number")
        case Flags() | Float() | None:
            pass
        case _:
            assert_never(meaning)
    if scaling is None:
        return raw
    if number.number == "decimal":
        return f"{scale}.value({raw})"
    product = raw if scaling.factor == 1 else f"{raw} * {scaling.factor}"
    total = f"{product} {'+' if scaling.bias > 0 else '-'} {abs(scaling.bias)}" if scaling.bias else product
    if scaling.divisor == 1:
        return total
    return f"{f'({total})' if scaling.bias else total} / {scaling.divisor}"


def _is_plain(number: Scalar) -> bool:
    """Whether the attribute holds the raw number."""
    match number.meaning:
        case Flags() | None:
            return number.scaling is None
        case Float():
            return True
        case Enum() | Characters() | "bool":
            return False
        case _:
            assert_never(number.meaning)


def _expected(count: CountStep) -> str:
    return integers.term_text(count.term)


def divided(run: RunStep, number: str, unit: int, otherwise: str) -> list[str]:
    """Statements that derive the count of a run from a number of units and check it."""
    count, odd = f"{run.name}_count", ""
    bounds = integers.broken(Within(run.length.minimum, run.length.maximum), count)
    if unit > 1:
        odd = f"{run.name}_odd or "
        first = f"{count}, {run.name}_odd = divmod({number}, {unit})"
    else:
        first = f"{count} = {number}"
    return [first, f"if {odd}{bounds}:", otherwise]


def assigned_targets(targets: Sequence[str], call: str) -> list[str]:
    """The statement that assigns what a call returns to several targets."""
    if len(targets) == 1:
        return [f"({targets[0]},) = {call}"]
    line = f"{', '.join(targets)} = {call}"
    if _INDENT + len(line) <= WIDTH:
        return [line]
    return ["(", *(f"    {target}," for target in targets), f") = {call}"]


def _has_checks(payload: PayloadPlan) -> bool:
    """Whether a payload, or a record in it, has check values."""
    return any(each.filled_in for each in (payload, *(one.payload for one in all_records((payload,)))))
