"""The statements that turn bytes into a message: sizes first, one struct for each run, then every check."""

from __future__ import annotations

from qlinkgen.backends.python import scalars, values
from qlinkgen.backends.python.decode_fields import FieldReader, negated
from qlinkgen.backends.python.place import in_ranges
from qlinkgen.model.frame import Part
from qlinkgen.model.message import Field
from qlinkgen.model.types import Array, Blob


class Decoder(FieldReader):
    """Collects the code that decodes one message.

    A message with one field of variable size takes its size from the payload's, one with several follows
    their counts: ``rest`` is then how many bytes there are beyond the fewest, and each field takes its share.
    """

    def statements(self) -> list[str]:
        """Lines of the function's body."""
        if self.message.empty_is_default:
            self._take_empty()
        self._check_size()
        self.lines.append("message = _new(cls)")
        self._head()
        for each in self.message.fields:
            self._field(each)
        self._is_last = True
        self._flush()
        if len(self.message.variable) > 1:
            self._misfit("rest")
        return [*self.lines, *self._late, *self._checks, "return message"]

    # Sizes

    def _take_empty(self) -> None:
        place = self.place
        part = place.frame.part("address") if place.frame else None
        if place.frame is None or part is None or part.scalar is None:
            self.lines += ["if not payload:", f"    return cls({', '.join(self._chosen())})"]
            return
        start = place.frame.offset(part.name) - (place.frame.header_size - place.header)
        data = f"{place.data}[{start} : {start + part.size}]"
        self.lines.append(f"if len({place.data}) == {place.overhead}:")
        self.lines.append(f"    {part.name} = {scalars.from_bytes(part.scalar, data)}")
        self.lines.append(f"    if {negated(in_ranges(part.name, self.message.addresses))}:")
        self.lines.append(f"        {self._bad_address(part.name)}")
        arguments = [f"{part.name}={part.name}", *self._chosen()]
        self.lines.append(f"    return cls({', '.join(arguments)})")

    def _chosen(self) -> list[str]:
        """Arguments for what has no default in the class."""
        required = [value for value in self.message.values if value.required]
        return [f"{value.name}={values.default(value, self.place)}" for value in required]

    def _check_size(self) -> None:
        message, overhead, size = self.message, self.place.overhead, f"len({self.place.data})"
        low, high = message.min_size + overhead, message.max_size + overhead
        if len(message.variable) > 1:
            self.lines.append(f"rest = {size} - {low}" if low else f"rest = {size}")
            self._misfit(f"not 0 <= rest <= {high - low}")
        elif message.variable and not self._by_size(message.variable[0]):
            self._count_by_size(message.variable[0], size, low)
        elif not message.variable and self._several_runs():
            self._misfit(f"{size} != {low}")

    def _several_runs(self) -> bool:
        """No single struct holds the whole message, so none refuses what is longer."""
        arrays = [each.type for each in self.message.fields if isinstance(each.type, Array)]
        return sum(map(self._struct_items, arrays)) > 1

    def _count_by_size(self, each: Field, size: str, low: int) -> None:
        kind = each.type
        assert isinstance(kind, Array | Blob)
        least, most, item = kind.length.minimum, kind.length.maximum, kind.item_size
        fixed = low - least * item
        number = f"{size} - {fixed}" if fixed else size
        count, odd = f"{each.name}_count", ""
        if item > 1:
            self.lines.append(f"{count}, {each.name}_odd = divmod({number}, {item})")
            odd = f"{each.name}_odd or "
        else:
            self.lines.append(f"{count} = {number}")
        self._misfit(f"{odd}not {least} <= {count} <= {most}")

    # The frame in front of the payload

    def _head(self) -> None:
        frame = self.place.frame
        if frame is None:
            return
        for part in frame.parts[1:] if self.place.unique else frame.parts:
            if part.role == "payload":
                break
            if part.role == "address":
                self._address(part)
            elif part.role == "length" and self.place.unique:
                self._length(part)
            else:
                self._run.add(f"{part.size}x", part.size)

    def _length(self, part: Part) -> None:
        """Nobody but the reader compares the length of a frame with its size."""
        assert part.scalar is not None
        assert self.place.frame is not None
        number = self._get(part.scalar, part.name)
        bias = self.place.frame.length_bias
        expected = f"len({self.place.data}) - {self.place.overhead - bias}"
        if not self.message.variable:
            expected = str(self.message.max_size + bias)
        self._run.after += [f"if {number} != {expected}:", "    raise Misfit"]

    def _address(self, part: Part) -> None:
        assert part.scalar is not None
        number = self._get(part.scalar, part.name)
        if not number.isidentifier():
            self._checks.append(f"{part.name} = {number}")
        self._checks.append(f"if {negated(in_ranges(part.name, self.message.addresses))}:")
        self._checks.append(f"    {self._bad_address(part.name)}")
        self._checks.append(f"message.{part.name} = {part.name}")

    def _bad_address(self, name: str) -> str:
        assert self.place.frame is not None
        frame = f"_PREAMBLE + {self.place.data}" if self.place.unique else self.place.data
        return f'raise illegal(cls, "{name}", {name}, {self.place.frame.offset(name)}, {frame})'
