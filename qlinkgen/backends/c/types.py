"""C types of numbers: named types with their conversions, and plain types."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Mapping
from functools import cached_property
from typing import assert_never

from qlinkgen._dataclass import dataclass
from qlinkgen.backends import c_text
from qlinkgen.backends.c.constants import constant_type
from qlinkgen.backends.c.names import Names, bracketed, is_wide, scalar_literal, scalar_type
from qlinkgen.model.types import Enum, Flags, Scalar
from qlinkgen.plan.payload import (
    BytesStep,
    ItemsStep,
    Member,
    RecordsStep,
    RecordStep,
    ValueStep,
    all_records,
)
from qlinkgen.plan.tree import Plan


@dataclass(frozen=True, slots=True, kw_only=True)
class Scale:
    """The numbers of a conversion, and the name of the rounding function."""

    factor: str
    bias: str
    divisor: str
    helper: str
    minimum: str
    maximum: str


@dataclass(frozen=True, slots=True)
class Kind:
    """A named type, or a scaled value of a type without a name.

    Attributes:
        stem: prefix of its functions and its C type.
        title: text of its comment.
        number: the scalar of raw values.
        named: whether it has its own C type.
    """

    stem: str
    title: str
    number: Scalar
    named: bool

    @property
    def plain(self) -> str:
        """The plain C type of a raw value."""
        return scalar_type(self.number)

    @property
    def type(self) -> str:
        """The C type of a raw value."""
        return f"{self.stem}_t" if self.named else self.plain

    @property
    def constant(self) -> str:
        """Prefix of its macros."""
        return self.stem.upper()

    @property
    def scale(self) -> Scale | None:
        """Its conversion, None without scaling."""
        number = self.number
        if number.scaling is None:
            return None
        return Scale(
            factor=_whole(number.scaling.factor),
            bias=_whole(number.scaling.bias),
            divisor=_whole(number.scaling.divisor),
            helper=self.plain.removesuffix("_t"),
            minimum=scalar_literal(number, number.minimum),
            maximum=scalar_literal(number, number.maximum),
        )


class Types:
    """The C types of the numbers of one header."""

    def __init__(self, plan: Plan, names: Names) -> None:
        """Use the selected messages of the plan."""
        self._plan = plan
        self._names = names

    @cached_property
    def named(self) -> Mapping[str, Kind]:
        """The named types, by name, in order of first use.

        Fields may narrow a type; the most frequent variant becomes the C type.
        """
        found: dict[str, Counter[Scalar]] = {}
        beside = (member.number for member in self._plan.beside.values())
        for number in (*beside, *self.numbers()):
            if (
                number.type_name
                and not is_wide(number)
                and not isinstance(number.meaning, Enum | Flags)
                and number.meaning != "bool"
            ):
                found.setdefault(number.type_name, Counter())[_kept(number)] += 1
        return {name: self._kind(name, counts.most_common(1)[0][0]) for name, counts in found.items()}

    def of(self, number: Scalar) -> str:
        """The C type of a struct member."""
        plain, meaning = scalar_type(number), number.meaning
        if is_wide(number):
            return f"{self._names.prefix}_int128_t"
        if isinstance(meaning, Enum | Flags):
            return (
                f"{self._names.prefix}_{self._names.constants(meaning)}_t"
                if plain == constant_type(meaning)
                else plain
            )
        kind = self.named.get(number.type_name)
        return kind.type if kind and kind.plain == plain else plain

    def conversions(self, owner: str, value: str, number: Scalar) -> Kind | None:
        """The conversion of a scaled value: that of its type, or its own if it differs.

        ``owner`` is the prefix of names of the message or record.
        """
        if number.scaling is None:
            return None
        kind = self.named.get(number.type_name)
        if kind and kind.number == _kept(number):
            return kind
        return Kind(f"{owner}_{value}", _title(value, number), number, named=False)

    def _kind(self, name: str, number: Scalar) -> Kind:
        title = _title(name, number) if number.scaling else f"in {number.unit}" if number.unit else ""
        title = c_text.comment_line(f"Type {name}{': ' if title else ''}{title}")
        return Kind(f"{self._names.prefix}_{self._names.type_stem(name)}", title, number, named=True)

    def numbers(self) -> Iterator[Scalar]:
        """The numbers of all values."""
        payloads = [message.payload for message in self._plan.messages]
        payloads += [record.payload for record in all_records(payloads)]
        for each in (each for payload in payloads for each in payload.settable):
            match each:
                case ValueStep() | Member() | ItemsStep():
                    yield each.number
                case BytesStep() | RecordStep() | RecordsStep():
                    pass
                case _:
                    assert_never(each)


def _kept(number: Scalar) -> Scalar:
    """The properties that conversions depend on."""
    return Scalar(
        bits=number.bits, signed=number.signed, chunks=(), minimum=number.minimum, maximum=number.maximum,
        scaling=number.scaling, unit=number.unit,
    )  # fmt: skip


def _title(name: str, number: Scalar) -> str:
    return c_text.comment_line(f"{name} = (raw * FACTOR + BIAS) / DIVISOR {number.unit}".rstrip())


def _whole(value: int) -> str:
    """An integer constant of the smallest type that holds it on all platforms."""
    size = abs(value).bit_length()
    suffix = "" if size < 16 else "L" if size < 32 else "LL" if size < 64 else "ULL"
    return bracketed(f"{value}{suffix}")
