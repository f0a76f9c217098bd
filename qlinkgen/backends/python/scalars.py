"""One integer in Python: how it gets into a struct and out of it, and what its value is.

The two sides are kept apart: transport knows bytes (byte order, odd widths, groups of bits), conversion knows
meaning (range, scale, enum, truth).
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

from qlinkgen.model.types import ByteOrder, Chunk, Enum, Flags, Scalar

#: struct's letters for whole numbers by size; lower case is signed.
_LETTERS = {1: "B", 2: "H", 4: "I", 8: "Q"}


@dataclass(frozen=True)
class Get:
    """How an integer is taken from a struct.

    Attributes:
        code: format of its bytes.
        targets: what the struct is unpacked into; "" stands for the place where the number goes.
        checks: conditions under which the bytes are no such number.
        number: the number made of the targets, "" where the only target is the number itself.
    """

    code: str
    targets: tuple[str, ...] = ("",)
    checks: tuple[str, ...] = ()
    number: str = ""


@dataclass(frozen=True)
class Conversion:
    """What is done with a value before it is packed, or after it was unpacked.

    Attributes:
        lines: statements that come first.
        conditions: what must hold.
        result: the expression that is packed, or assigned to the attribute.
    """

    result: str
    lines: tuple[str, ...] = ()
    conditions: tuple[str, ...] = ()


@dataclass(frozen=True)
class Names:
    """Names in the generated module that a scalar's code uses.

    Attributes:
        prefix: byte order of the module's structs, ">" or "<".
        enums: class of each enum.
        steps: constant of each scaled field, filled while fields are lowered.
    """

    prefix: str
    enums: Mapping[str, str] = field(default_factory=dict)

    @property
    def byteorder(self) -> ByteOrder:
        """Byte order of the module's structs."""
        return "big" if self.prefix == ">" else "little"


def letter(scalar: Scalar, byteorder: ByteOrder) -> str:
    """The format letter, "" where struct has none for this integer in this byte order."""
    known = _LETTERS.get(scalar.size, "")
    if not known or scalar.bits != 8 * scalar.size:
        return ""
    if scalar.size > 1 and scalar.byteorder != byteorder:
        return ""
    if scalar.size == 1 and scalar.byteorder is None:
        return ""
    return known.lower() if scalar.signed else known


def put(scalar: Scalar, number: str, byteorder: ByteOrder) -> tuple[str, tuple[str, ...]]:
    """Format and arguments that pack a number; groups use it once a byte, so it should be a plain name."""
    if code := letter(scalar, byteorder):
        return code, (number,)
    if scalar.byteorder is not None:
        return f"{scalar.size}s", (to_bytes(scalar, number),)
    return "B" * scalar.size, tuple(_group_out(number, chunk) for chunk in scalar.chunks)


def to_bytes(scalar: Scalar, number: str) -> str:
    """The bytes of an integer that struct does not know; OverflowError tells that it does not fit."""
    signed = ", signed=True" if scalar.signed else ""
    plain = number.replace("_", "").replace(".", "").isidentifier()
    return f'{number if plain else f"({number})"}.to_bytes({scalar.size}, "{scalar.byteorder}"{signed})'


def from_bytes(scalar: Scalar, data: str) -> str:
    """The integer in some bytes."""
    signed = ", signed=True" if scalar.signed else ""
    return f'int.from_bytes({data}, "{scalar.byteorder}"{signed})'


def get(scalar: Scalar, local: str, byteorder: ByteOrder) -> Get:
    """How a number is unpacked; ``local`` begins the names of the variables that this takes."""
    if code := letter(scalar, byteorder):
        return Get(code)
    if scalar.byteorder is not None:
        return Get(f"{scalar.size}s", (local,), number=from_bytes(scalar, local))
    targets = tuple(f"{local}_{index}" for index in range(scalar.size))
    return Get("B" * scalar.size, targets, unused_bits(scalar, targets), from_groups(scalar, targets))


def unused_bits(scalar: Scalar, sources: tuple[str, ...]) -> tuple[str, ...]:
    """Conditions that are true where a wire byte has bits that are not the integer's; one for each mask."""
    by_mask: dict[int, list[str]] = {}
    for source, chunk in zip(sources, scalar.chunks, strict=True):
        if chunk.bits < 8:
            by_mask.setdefault(chunk.mask, []).append(source)
    return tuple(f"{' | '.join(group)} > 0x{mask:02X}" for mask, group in by_mask.items())


def from_groups(scalar: Scalar, sources: tuple[str, ...]) -> str:
    """The integer of groups of bits, each in the low bits of one source."""
    number = " | ".join(group_terms(scalar, sources))
    return sign_extended(f"({number})", scalar.bits) if scalar.signed else number


def group_terms(scalar: Scalar, sources: tuple[str, ...]) -> tuple[str, ...]:
    """The groups of an integer, each shifted to its place."""
    return tuple(_shifted(source, chunk.shift) for source, chunk in zip(sources, scalar.chunks, strict=True))


def sign_extended(number: str, bits: int) -> str:
    """A number of some bits as two's complement."""
    sign = f"{1 << (bits - 1):#x}"
    return f"({number} ^ {sign}) - {sign}"


def _shifted(source: str, shift: int) -> str:
    return f"{source} << {shift}" if shift else source


def _group_out(number: str, chunk: Chunk) -> str:
    return (
        f"{number} >> {chunk.shift} & 0x{chunk.mask:02X}" if chunk.shift else f"{number} & 0x{chunk.mask:02X}"
    )


def outgoing(scalar: Scalar, attribute: str, local: str, steps: str, *, packed: bool) -> Conversion:
    """From the attribute to the number on the wire.

    ``packed``: the number goes to struct or `to_bytes`, which refuse what is not an integer and what does not
    fit, so only a range inside of that is checked here. Otherwise there is arithmetic, for which it has to be
    an int: other integers, like those of numpy, lose bits that are shifted.
    """
    if scalar.scaling is not None:
        return Conversion(local, (f"{local} = {steps}.raw({attribute})",))
    number = attribute if packed else local
    conditions = []
    if isinstance(scalar.meaning, Flags) and scalar.meaning.reserved_zero:
        conditions.append(f"{number} & ~{scalar.meaning.mask:#x} == 0")
    if not scalar.full_range or not packed:
        conditions.append(within(number, scalar))
    return Conversion(number, () if packed else (f"{local} = index({attribute})",), tuple(conditions))


def within(number: str, scalar: Scalar) -> str:
    """The condition that a number is in the scalar's range."""
    return (
        f"{number} == {scalar.minimum}"
        if scalar.minimum == scalar.maximum
        else (f"{scalar.minimum} <= {number} <= {scalar.maximum}")
    )


def incoming(scalar: Scalar, raw: str, steps: str, names: Names) -> Conversion:
    """From the number on the wire to the value of the attribute; conditions are those of a legal number."""
    conditions = [] if scalar.full_range else [within(raw, scalar)]
    if isinstance(scalar.meaning, Flags) and scalar.meaning.reserved_zero:
        conditions.append(f"{raw} & ~{scalar.meaning.mask:#x} == 0")
    return Conversion(_value(scalar, raw, steps, names), (), tuple(conditions))


def _value(scalar: Scalar, raw: str, steps: str, names: Names) -> str:
    if isinstance(scalar.meaning, Enum):
        return f"{names.enums[scalar.meaning.name]}.members.get({raw}, {raw})"
    if scalar.meaning == "bool":
        return f"{raw} == 1"
    if scalar.scaling is None:
        return raw
    if scalar.number == "decimal":
        return f"{steps}.value({raw})"
    scaling = scalar.scaling
    product = raw if scaling.factor == 1 else f"{raw} * {scaling.factor}"
    total = f"{product} {'+' if scaling.bias > 0 else '-'} {abs(scaling.bias)}" if scaling.bias else product
    if scaling.divisor == 1:
        return total
    return f"({total}) / {scaling.divisor}" if scaling.bias else f"{total} / {scaling.divisor}"
