"""What a decoder does with each field: how it is taken, what is checked, what its attribute gets."""

from __future__ import annotations

from qlinkgen.backends.python import scalars
from qlinkgen.backends.python.decode_runs import RunReader
from qlinkgen.backends.python.place import WIDTH, folded
from qlinkgen.errors import GenerationError
from qlinkgen.model.message import Field
from qlinkgen.model.types import Array, Bits, Blob, Scalar


class FieldReader(RunReader):
    """Collects the code for the fields of a message."""

    def _field(self, each: Field) -> None:
        kind = each.type
        offset = self._offset(each)
        if isinstance(kind, Scalar):
            self._scalar(each.name, kind, offset)
        elif isinstance(kind, Bits):
            self._bits(each.name, kind, offset)
        elif isinstance(kind, Blob):
            self._blob(each, kind, offset)
        else:
            self._array(each, kind, offset)

    def _get(self, scalar: Scalar, local: str, target: str = "") -> str:
        """Add an integer to the run; the expression for its number, ``target`` if it goes there at once."""
        taken = scalars.get(scalar, local, self.place.names.byteorder)
        targets = [each or target or local for each in taken.targets]
        self._run.add(taken.code, scalar.size, *targets)
        return taken.number or targets[0]

    def _grouped(self, scalar: Scalar, raw: str, name: str, number: str, offset: str) -> str:
        """Put groups of bits together and check the bits between them; other numbers stay as they are."""
        taken = scalars.get(scalar, raw, self.place.names.byteorder)
        if scalar.byteorder is not None:
            return number
        self._checks += folded(f"{raw} = ", scalars.group_terms(scalar, taken.targets), " | ")
        if scalar.signed:
            self._checks.append(f"{raw} = {scalars.sign_extended(raw, scalar.bits)}")
        if taken.checks:
            self._checks += folded("if ", taken.checks, " or ", ":")
            self._checks.append(f"    {self._illegal(name, raw, offset)}")
        return raw

    def _scalar(self, name: str, scalar: Scalar, offset: str) -> None:
        if scalar.reserved:
            self._run.add(f"{scalar.size}x", scalar.size)
            return
        raw = f"{name}_raw"
        if not scalar.settable:
            number = self._get(scalar, raw)
            if scalar.constant:
                number = self._grouped(scalar, raw, name, number, offset)
            self._expect(name, scalar, number, offset)
            return
        plain = scalars.incoming(scalar, raw, "", self.place.names)
        if (
            plain.result == raw
            and not plain.conditions
            and scalars.letter(scalar, self.place.names.byteorder)
        ):
            self._get(scalar, raw, f"message.{name}")
            return
        number = self._grouped(scalar, raw, name, self._get(scalar, raw), offset)
        self._assign(name, scalar, number, offset)

    def _assign(self, name: str, scalar: Scalar, number: str, offset: str) -> None:
        """Check a number and give its value to the attribute."""
        raw = f"{name}_raw"
        conversion = scalars.incoming(scalar, raw, self.steps.get(name, ""), self.place.names)
        if number != raw and (conversion.conditions or conversion.result != raw):
            self._checks.append(f"{raw} = {number}")
        for condition in conversion.conditions:
            self._checks += [f"if {negated(condition)}:", f"    {self._illegal(name, raw, offset)}"]
        simple = conversion.result == raw and not conversion.conditions
        self._checks.append(f"message.{name} = {number if simple else conversion.result}")

    def _bits(self, name: str, kind: Bits, offset: str) -> None:
        raw = f"{name}_raw"
        number = self._grouped(kind.container, raw, name, self._get(kind.container, raw), offset)
        if number != raw:
            self._checks.append(f"{raw} = {number}")
        for member in kind.members:
            mask = (1 << member.type.bits) - 1
            taken = f"{raw} >> {member.shift} & {mask:#x}" if member.shift else f"{raw} & {mask:#x}"
            if member.type.signed:
                taken = scalars.sign_extended(f"({taken})", member.type.bits)
            if member.type.settable:
                local = f"{member.name}_bits" if member.name == name else f"{member.name}_raw"
                self._member(member.name, member.type, taken, local, offset)
            elif member.type.constant:
                self._checks.append(f"if ({taken}) != {member.type.default}:")
                self._checks.append(f"    {self._illegal(member.name, taken, offset)}")

    def _member(self, name: str, scalar: Scalar, taken: str, local: str, offset: str) -> None:
        conversion = scalars.incoming(scalar, local, self.steps.get(name, ""), self.place.names)
        if conversion.result == local and not conversion.conditions:
            self._checks.append(f"message.{name} = {taken}")
            return
        self._checks.append(f"{local} = {taken}")
        for condition in conversion.conditions:
            self._checks += [f"if {negated(condition)}:", f"    {self._illegal(name, local, offset)}"]
        self._checks.append(f"message.{name} = {conversion.result}")

    # Constants and counts

    def _expect(self, name: str, scalar: Scalar, number: str, offset: str) -> None:
        """Check a constant or a count."""
        if scalar.constant:
            self._checks.append(f"if {_operand(number)} != {scalar.default}:")
            self._checks.append(f"    {self._illegal(name, number, offset)}")
            return
        counted = next(each for each in self.message.fields if each.name == scalar.counts)
        assert isinstance(counted.type, Array | Blob)
        scale = counted.type.item_size if scalar.counts_unit == "bytes" else 1
        count = f"{counted.name}_count"
        if counted.fixed:
            expected = str(counted.type.length.maximum * scale)
        elif len(self.message.variable) > 1 and counted.name not in self._known:
            self._learn(counted, number, scale)
            return
        else:
            if self._by_size(counted):
                count = f"len(message.{counted.name})"
            expected = count if scale == 1 else f"{count} * {scale}"
        # The items may be in a later run than their count.
        after = self._late if self._by_size(counted) else self._run.after
        after += [f"if {_operand(number)} != {expected}:", "    raise Misfit"]

    def _learn(self, counted: Field, number: str, scale: int) -> None:
        """The first count of a field says how long it is."""
        self._known.add(counted.name)
        assert isinstance(counted.type, Array | Blob)
        length, count, odd = counted.type.length, f"{counted.name}_count", ""
        if scale > 1:
            self._run.after.append(f"{count}, {counted.name}_odd = divmod({number}, {scale})")
            odd = f"{counted.name}_odd or "
        else:
            self._run.after.append(f"{count} = {number}")
        self._run.after += [
            f"if {odd}not {length.minimum} <= {count} <= {length.maximum}:",
            "    raise Misfit",
        ]

    # Fields of several items

    def _blob(self, each: Field, kind: Blob, offset: str) -> None:
        raw = f"{each.name}_raw" if kind.text else f"message.{each.name}"
        if kind.length.fixed:
            self._run.add(f"{kind.length.maximum}s", kind.length.maximum, raw)
        else:
            self._slice(each, kind, raw)
        if kind.text:
            self._checks += [f"if not {raw}.isascii():", f"    {self._illegal(each.name, raw, offset)}"]
            self._checks.append(f'message.{each.name} = {raw}.decode("ascii")')

    def _slice(self, each: Field, kind: Blob | Array, target: str) -> None:
        """Take the bytes of a field of variable size, and move on behind it."""
        self._flush()
        self._share(each, kind)
        start, item = self._start(), kind.item_size
        count = f"{each.name}_count" if item == 1 else f"{each.name}_count * {item}"
        if self._moved:
            self.lines.append(f"start, end = end, end + {count}")
            start = "start"
        else:
            self.lines.append(f"end = {start} + {count}" if start != "0" else f"end = {count}")
        taken = f"{self.place.data}[{start} : end]"
        # What comes straight from the caller may be a memoryview.
        self.lines.append(f"{target} = bytes({taken})" if self.place.unique else f"{target} = {taken}")
        self._moved = True

    def _share(self, each: Field, kind: Blob | Array) -> None:
        if len(self.message.variable) < 2:
            return
        item, least, count = kind.item_size, kind.length.minimum, f"{each.name}_count"
        if each.name not in self._known:
            self._measure_open(each, kind)
        share = f"{count} * {item}" if item > 1 else count
        self.lines.append(f"rest -= {share}" + (f" - {least * item}" if least else ""))
        self._misfit("rest < 0")

    def _measure_open(self, each: Field, kind: Blob | Array) -> None:
        """The field without a count takes what the counted ones behind it leave."""
        behind = self.message.variable[self.message.variable.index(each) + 1 :]
        left = "rest"
        for other in behind:
            assert isinstance(other.type, Array | Blob)
            if other.name not in self._known:
                what = f"the count of {other.name} stands behind the open end of {each.name}"
                hint = "so no decoder can find it; move it in front"
                raise GenerationError(f"{self.message.name}: {what}, {hint}")
            item, least = other.type.item_size, other.type.length.minimum
            share = f"{other.name}_count * {item}" if item > 1 else f"{other.name}_count"
            left += f" - ({share} - {least * item})" if least else f" - {share}"
        item, least, most = kind.item_size, kind.length.minimum, kind.length.maximum
        count, odd = f"{each.name}_count", ""
        more = f" + {least * item}" if least else ""
        if item > 1:
            self.lines.append(f"{count}, {each.name}_odd = divmod({left}{more}, {item})")
            odd = f"{each.name}_odd or "
        else:
            self.lines.append(f"{count} = {left}{more}")
        self._misfit(f"{odd}not {least} <= {count} <= {most}")

    def _array(self, each: Field, kind: Array, offset: str) -> None:
        code = scalars.letter(kind.item, self.place.names.byteorder)
        if self._struct_items(kind):
            if any(target.startswith("*") for target in self._run.targets):
                self._flush()  # one target of an assignment can take several items
            count = str(kind.length.maximum) if kind.length.fixed else "{n}"
            size = kind.length.maximum * kind.item_size if kind.length.fixed else 0
            self._run.add(f"{count}{code}", size, f"*message.{each.name}")
            if not kind.length.fixed:
                self._run.items = each
            return
        raw = f"{each.name}_raw"
        if kind.length.fixed:
            self._run.add(
                f"{kind.length.maximum * kind.item_size}s", kind.length.maximum * kind.item_size, raw
            )
        else:
            self._slice(each, kind, raw)
        self._odd_items(each, kind, raw, offset)

    def _odd_items(self, each: Field, kind: Array, raw: str, offset: str) -> None:
        """Items that struct does not know, or not in this byte order."""
        item, size = kind.item, kind.item_size
        places = f"for index in range(0, len({raw}), {size})"
        if item.byteorder is not None:
            number = scalars.from_bytes(item, f"{raw}[index : index + {size}]")
        else:
            sources = tuple(f"{raw}[index + {index}]" if index else f"{raw}[index]" for index in range(size))
            unused = " or ".join(scalars.unused_bits(item, sources))
            if unused:
                self._checks.append(f"if any({unused} {places}):")
                self._checks.append(f"    {self._illegal(each.name, raw, offset)}")
            number = scalars.from_groups(item, sources)
        line = f"message.{each.name} = [{number} {places}]"
        if len(line) > WIDTH - 8:
            self._checks += [f"message.{each.name} = [", f"    {number}", f"    {places}", "]"]
        else:
            self._checks.append(line)


def negated(condition: str) -> str:
    """The condition turned round."""
    if " == " in condition and "<=" not in condition and " or " not in condition:
        return condition.replace(" == ", " != ")
    return f"not {condition}"


def _operand(number: str) -> str:
    return number if number.isidentifier() or number.endswith(")") else f"({number})"
