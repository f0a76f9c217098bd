"""Numbers as text, and messages of texts between separators.

Copied next to the modules that need it, unchanged.
"""

from __future__ import annotations

import math
import re
import struct
from collections.abc import Sequence
from fractions import Fraction
from typing import Any, BinaryIO

from construct import (
    Adapter,
    Bytes,
    Construct,
    Container,
    Default,
    IntegerError,
    RangeError,
    Rebuild,
    Renamed,
    StringError,
    ValidationError,
    Validator,
    stream_read,
    stream_read_entire,
    stream_write,
)

from ._fields import Count, Message, Row, TextField, Values, _innermost

_DECIMAL = re.compile(rb"[+-]?([0-9]*)\.?([0-9]*)\Z")
_REAL = re.compile(rb"[+-]?(?=\.?[0-9])([0-9]*)\.?([0-9]*)(?:[Ee]([+-]?[0-9]+))?\Z")
_HEXADECIMAL = re.compile(rb"[0-9A-Fa-f]+\Z")


class Letters(Adapter):
    """An integer of the characters of a text, the first of which is its most significant byte."""

    def __init__(self, subcon: Construct, size: int, excluded: bytes = b"") -> None:
        super().__init__(subcon)
        self.size = size
        self.excluded = excluded

    def _checked(self, text: bytes, path: str) -> bytes:
        if len(text) != self.size or not text.isascii() or {*text} & {*self.excluded}:
            message = f"{text!r} is not {self.size} legal characters"
            raise ValidationError(message, path=path)
        return text

    def _decode(self, obj: int, context: Container, path: str) -> str:
        return self._checked(obj.to_bytes(self.size, "big"), path).decode("ascii")

    def _encode(self, obj: str, context: Container, path: str) -> int:
        text = obj.encode("ascii", "replace") if obj.isascii() else b""
        return int.from_bytes(self._checked(text, path), "big")


class TextNumber(Construct):
    """An integer from low to high as text of ``least`` to ``most`` characters.

    ``point`` digits follow the decimal point. One that is ``spaced`` begins with
    spaces. One that is ``plain`` has digits alone. One of variable size is all
    bytes, which the Message limits.
    """

    def __init__(
        self,
        base: int,
        least: int,
        most: int,
        *,
        low: int,
        high: int,
        point: int = 0,
        spaced: bool = False,
        plain: bool = False,
    ) -> None:
        super().__init__()
        self.base = base
        self.least = least
        self.most = most
        self.low = low
        self.high = high
        self.point = point
        self.spaced = spaced
        self.plain = plain

    def _parse(self, stream: BinaryIO, context: Container, path: str) -> int:
        if self.least == self.most:
            text = stream_read(stream, self.most, path)
        else:
            text = stream_read_entire(stream, path)
        number = self._number(text)
        if number is None or not self.low <= number <= self.high:
            raise ValidationError(f"{text!r} is not a number in range", path=path)
        return number

    def _number(self, text: bytes) -> int | None:
        if self.base == 16:
            return int(text, 16) if _HEXADECIMAL.match(text) else None
        if self.plain:
            return int(text) if text.isdigit() else None
        text = text.lstrip(b" ") if self.spaced else text
        found = _DECIMAL.match(text)
        if found is None or (self.low >= 0 and text[:1] in (b"+", b"-")):
            return None
        whole, fraction = found[1], found[2]
        if not whole + fraction or fraction[self.point :].strip(b"0"):
            return None
        digits = whole + fraction[: self.point].ljust(self.point, b"0")
        number = int(digits or b"0")
        return -number if text[:1] == b"-" else number

    def _build(
        self, obj: object, stream: BinaryIO, context: Container, path: str
    ) -> object:
        if not isinstance(obj, int) or not self.low <= obj <= self.high:
            raise IntegerError(f"{obj!r} is not in range", path=path)
        if self.base == 16:
            text = f"{obj:0{self.least}X}"
        else:
            sign, digits = "-" * (obj < 0), f"{abs(obj):0{self.point + 1}d}"
            if self.point:
                digits = f"{digits[: -self.point]}.{digits[-self.point :]}"
            if not self.spaced:
                digits = digits.rjust(self.least - len(sign), "0")
            text = (sign + digits).rjust(self.least)
        stream_write(stream, text.encode(), len(text), path)
        return obj

    def _sizeof(self, context: Container, path: str) -> int:
        return self.most


class Word(Construct):
    """One of several words: an integer, the place of the word.

    One of variable size is all bytes, which the Message limits.
    """

    def __init__(self, *words: bytes, folded: bool = False) -> None:
        super().__init__()
        self.words = words
        # Letters of either case are parsed.
        self.folded = folded
        self.minimum = min(map(len, words))
        self.maximum = max(map(len, words))

    def _parse(self, stream: BinaryIO, context: Container, path: str) -> int:
        if self.minimum == self.maximum:
            text = stream_read(stream, self.maximum, path)
        else:
            text = stream_read_entire(stream, path)
        words = self.words
        if self.folded:
            words, text = tuple(each.upper() for each in words), text.upper()
        if text not in words:
            raise ValidationError(f"{text!r} is not one of the words", path=path)
        return words.index(text)

    def _build(
        self, obj: object, stream: BinaryIO, context: Container, path: str
    ) -> object:
        if not isinstance(obj, int) or not 0 <= obj < len(self.words):
            raise IntegerError(f"{obj!r} is not the number of a word", path=path)
        text = self.words[obj]
        stream_write(stream, text, len(text), path)
        return obj

    def _sizeof(self, context: Container, path: str) -> int:
        return self.maximum


class TextReal(Construct):
    """A floating-point number of 32 or 64 bits as text with a decimal exponent.

    It is built with the fewest digits with which it is parsed as the same number.
    """

    minimum = 1
    maximum = 24

    def __init__(self, bits: int) -> None:
        super().__init__()
        self.form = ">f" if bits == 32 else ">d"
        # Bits of the significand, and the exponent of the last bit of the smallest numbers.
        self.size, self.last = (24, -149) if bits == 32 else (53, -1074)

    def _parse(self, stream: BinaryIO, context: Container, path: str) -> float:
        text = stream_read_entire(stream, path)
        number = self._nearest(text)
        if number is None:
            raise ValidationError(f"{text!r} is not a number in range", path=path)
        return number

    def _nearest(self, text: bytes) -> float | None:
        found = _REAL.match(text)
        if found is None:
            return None
        sign = -1.0 if text[:1] == b"-" else 1.0
        digits, exponent = int(found[1] + found[2]), int(found[3] or b"0")
        if digits == 0 or exponent < -9999:
            return sign * 0.0
        if exponent > 9999:
            return None
        value = digits * Fraction(10) ** (exponent - len(found[2]))
        width = value.numerator.bit_length() - value.denominator.bit_length()
        unit = max(self.last, width - self.size)
        steps = round(value / Fraction(2) ** unit)
        if steps >> self.size:
            unit += 1
            steps = round(value / Fraction(2) ** unit)
        try:
            number = math.ldexp(steps, unit)
            struct.pack(self.form, number)
        except OverflowError:
            return None
        return sign * number

    def _build(
        self, obj: object, stream: BinaryIO, context: Container, path: str
    ) -> object:
        if not isinstance(obj, int | float) or not math.isfinite(obj):
            raise IntegerError(f"{obj!r} is not a finite number", path=path)
        try:
            number = struct.unpack(self.form, struct.pack(self.form, obj))[0]
        except OverflowError as error:
            raise IntegerError(f"{obj!r} is too large", path=path) from error
        texts = (b"%.*E" % (after, number) for after in range(17))
        text = next(text for text in texts if self._nearest(text) == number)
        stream_write(stream, text, len(text), path)
        return obj

    def _sizeof(self, context: Container, path: str) -> int:
        return self.maximum


class TextList(Construct):
    """From ``minimum`` to ``maximum`` items between separators."""

    def __init__(
        self, item: Construct, separator: bytes, minimum: int, maximum: int
    ) -> None:
        super().__init__()
        self.item = item
        self.separator = separator
        self.minimum = minimum
        self.maximum = maximum
        self.sizes = _text_sizes(_innermost(item))

    def _parse(self, stream: BinaryIO, context: Container, path: str) -> list[object]:
        data = stream_read_entire(stream, path)
        texts = data.split(self.separator) if data else []
        if not self.minimum <= len(texts) <= self.maximum:
            raise RangeError(f"{len(texts)} items", path=path)
        least, most = self.sizes
        for text in texts:
            if not least <= len(text) <= most:
                raise RangeError(f"{text!r} has {len(text)} characters", path=path)
        return [self.item.parse(text) for text in texts]

    def _build(
        self, obj: Sequence[object], stream: BinaryIO, context: Container, path: str
    ) -> Sequence[object]:
        if not self.minimum <= len(obj) <= self.maximum:
            raise RangeError(f"{len(obj)} items", path=path)
        data = self.separator.join([self.item.build(each) for each in obj])
        stream_write(stream, data, len(data), path)
        return obj

    def _sizeof(self, context: Container, path: str) -> int:
        return self.bounds[1]

    @property
    def bounds(self) -> tuple[int, int]:
        """Minimum and maximum size."""
        least, most = self.sizes
        fewest = self.minimum * least + max(0, self.minimum - 1)
        return fewest, self.maximum * most + max(0, self.maximum - 1)


class BetweenField(TextField):
    """7-bit text without some characters."""

    def __init__(self, minimum: int, maximum: int, excluded: bytes) -> None:
        super().__init__(minimum, maximum)
        self.excluded = excluded.decode()

    def _parse(self, stream: BinaryIO, context: Container, path: str) -> str:
        return self._without(str(super()._parse(stream, context, path)), path)

    def _build(self, obj: Row, stream: BinaryIO, context: Container, path: str) -> Row:
        self._without(str(obj), path)
        built: Row = super()._build(obj, stream, context, path)
        return built

    def _without(self, text: str, path: str) -> str:
        if {*text} & {*self.excluded}:
            raise StringError(f"{text!r} has one of {self.excluded!r}", path=path)
        return text


class Separated(Message):
    """A message of texts between separators, or with a ``leading`` one before each.

    Those of ``optional``, names and whether they are sent by default, may be absent: empty, or None.
    """

    def __init__(
        self,
        name: str,
        message_id: int,
        *fields: Renamed,
        separator: bytes,
        leading: bool = False,
        optional: Sequence[tuple[str, bool]] = (),
        **settings: Any,  # those of a Message
    ) -> None:
        super().__init__(name, message_id, *fields, **settings)
        self.separator = separator
        self.leading = leading
        self.optional = {field for field, _ in optional}
        self.defaults.update({field: None for field, given in optional if not given})
        needed = [
            i
            for i, each in enumerate(fields, 1)
            if each.name not in self.optional and _counts(each)[0]
        ]
        self.needed = max(needed, default=1)
        sizes = [_sizes(each) for each in fields]
        # The list whose items take the texts that other fields leave, and their number.
        counts = [_counts(each) for each in fields]
        opened = [i for i, (low, high) in enumerate(counts) if low < high]
        self.opened = opened[0] if opened else len(fields)
        self.behind = sum(high for _, high in counts[self.opened + 1 :])
        skipped = self.behind > 0 and not counts[self.opened][0]
        kept = sizes[: self.needed]
        absent = [each.name in self.optional for each in fields]
        least = sum(
            0 if none else low for none, (low, _) in zip(absent, kept, strict=False)
        )
        if leading and not needed:
            self.needed = 0
        between = 0 if leading else 1
        self.least = least + max(0, self.needed - between - skipped)
        self.most = sum(high for _, high in sizes) + len(sizes) - between

    def _parse(self, stream: BinaryIO, context: Container, path: str) -> Container:
        texts = stream_read_entire(stream, path).split(self.separator)
        if self.leading and texts.pop(0):
            raise RangeError(f"no separator begins {self.name}", path=path)
        texts = self._by_field(texts, path)
        values, told = Container(), dict[str, int]()
        for field, text in zip(self.fields, texts, strict=True):
            if not text and field.name in self.optional:
                values[field.name] = None
                continue
            least, most = _sizes(field)
            if not least <= len(text) <= most:
                raise RangeError(f"{field.name} has {len(text)} characters", path=path)
            if _is_ignored(field):
                continue
            found = field.parse(text, number=len(text))
            if isinstance(field.subcon, Default):
                values[field.name] = found
            if isinstance(field.subcon, Count):
                told[field.subcon.of] = found
            if field.name in told and told[field.name] != len(found):
                wrong = f"{told[field.name]} is not the number of {field.name}"
                raise RangeError(wrong, path=path)
        return values

    def _by_field(self, texts: list[bytes], path: str) -> list[bytes]:
        """The texts of each field, those of a list with their separators."""
        most = sum(_counts(field)[1] for field in self.fields)
        needed = sum(_counts(field)[0] for field in self.fields[: self.needed])
        if not max(needed, 1 - self.leading) <= len(texts) <= most:
            raise RangeError(f"{len(texts)} texts in {self.name}", path=path)
        cells = []
        for i, field in enumerate(self.fields):
            number = min(_counts(field)[1], len(texts))
            if i == self.opened and self.behind:
                number = len(texts) - self.behind
                if texts[:number] == [b""]:
                    raise RangeError(f"{field.name} has an empty item", path=path)
            cells.append(self.separator.join(texts[:number]))
            del texts[:number]
        return cells

    def _build(
        self, obj: Values, stream: BinaryIO, context: Container, path: str
    ) -> Values:
        values = self._initial(obj, path)
        values.update(obj)
        texts = [self._text(field, values, path) for field in self.fields]
        while len(texts) > self.needed and not texts[-1]:
            texts.pop()
        if self.behind and not texts[self.opened]:
            del texts[self.opened]
        data = self.separator.join([b""] * self.leading + texts)
        stream_write(stream, data, len(data), path)
        return obj

    def _text(self, field: Renamed, values: Container, path: str) -> bytes:
        if field.name in self.optional and values[field.name] is None:
            return b""
        return self._written(field, values.get(field.name), values, path)


def _is_ignored(field: Renamed) -> bool:
    """Whether it may be anything when received; one of several constants may not."""
    rebuilt = field.subcon
    return isinstance(rebuilt, Rebuild) and not isinstance(rebuilt.subcon, Validator)


def _counts(field: Renamed) -> tuple[int, int]:
    """Minimum and maximum number of texts of a field that is present."""
    subcon = _innermost(field)
    if isinstance(subcon, TextList):
        return subcon.minimum, subcon.maximum
    return 1, 1


def _sizes(field: Renamed) -> tuple[int, int]:
    """Minimum and maximum number of characters that are received."""
    subcon = _innermost(field)
    return subcon.bounds if isinstance(subcon, TextList) else _text_sizes(subcon)


def _text_sizes(subcon: Construct) -> tuple[int, int]:
    if isinstance(subcon, TextNumber):
        return subcon.least if subcon.least == subcon.most else 1, subcon.most
    if isinstance(subcon, Bytes):
        return subcon.length, subcon.length
    return subcon.minimum, subcon.maximum
