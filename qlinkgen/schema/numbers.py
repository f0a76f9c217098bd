"""Second pass, numbers: scale, range and default of a scalar, in raw integers."""

from __future__ import annotations

from dataclasses import replace
from decimal import Decimal
from fractions import Fraction
from typing import Protocol

from qlinkgen.model.types import DOUBLE_BITS, Enum, Flags, Float, Scalar, Scaling, Settable
from qlinkgen.schema.constants import MAX_BITS
from qlinkgen.schema.location import Location
from qlinkgen.schema.notation import Range, rational, shown
from qlinkgen.schema.report import did_you_mean, listed

Written = int | bool | Decimal | str | list[int | bool | Decimal | str]


class Quantity(Protocol):
    """Keys of fields and bit fields that describe a number."""

    @property
    def scale(self) -> Fraction | None: ...  # noqa: D102 - see FieldSpec
    @property
    def offset(self) -> Fraction | None: ...  # noqa: D102
    @property
    def unit(self) -> str | None: ...  # noqa: D102
    @property
    def range(self) -> Range | None: ...  # noqa: D102
    @property
    def raw_range(self) -> Range | None: ...  # noqa: D102


def quantified(scalar: Scalar, spec: Quantity, what: str, location: Location) -> Scalar:
    """Apply scale, offset and range of a field to a scalar."""
    if spec.scale is not None or spec.offset is not None:
        if scalar.meaning is not None:
            location.reject(spec, ("scale", "offset"), what, "remove it, or use an integer type")  # type: ignore[arg-type]
        else:
            scalar = _scaled(scalar, spec.scale, spec.offset, location)
    if isinstance(scalar.meaning, Float):
        return scalar if spec.range is None else _bounded(scalar, scalar.meaning, spec.range, location)
    if spec.range is not None:
        return _ranged(scalar, spec.range, "range", scalar.scaling, location)
    return scalar if spec.raw_range is None else _ranged(scalar, spec.raw_range, "raw_range", None, location)


def _scaled(scalar: Scalar, scale: Fraction | None, offset: Fraction | None, location: Location) -> Scalar:
    base = scalar.scaling.scale if scalar.scaling else Fraction(1)
    scaling = Scaling(base if scale is None else scale, offset or Fraction(0))
    if scaling.scale == 0:
        location.fault("bad-scale", "scale", "the scale is 0", "write the value of one step, like 1/10")
        return scalar
    scaled = replace(scalar, scaling=scaling)
    key = "scale" if scale is not None else "offset"
    if max(abs(scaling.factor), scaling.divisor, abs(scaling.bias)) >= 1 << MAX_BITS:
        hint = "use a scale and an offset of fewer digits"
        location.fault("bad-scale", key, f"the {key} requires integers of more than {MAX_BITS} bits", hint)
        return scalar
    if scaled.number == "decimal" and not _terminates(scaling.divisor):
        hint = f"use a scale like 1/10 or 1/2^16, or at most {DOUBLE_BITS} bits"
        what = f"values of {scalar.bits} bits in steps of {scaling.scale} have no finite decimal expansion"
        location.fault("inexact-scale", key, what, hint)
    return scaled


def _terminates(denominator: int) -> bool:
    for prime in (2, 5):
        while denominator % prime == 0:
            denominator //= prime
    return denominator == 1


def _ranged(scalar: Scalar, limits: Range, key: str, scaling: Scaling | None, location: Location) -> Scalar:
    ends = [limits.first, limits.last]
    if scaling is not None:
        ends = [(end - scaling.offset) / scaling.scale for end in ends]
    for written, end in zip((limits.first, limits.last), ends, strict=True):
        if end.denominator != 1:
            location.fault(
                "bad-scale", key, f"the bound {_decimal(written)} is between two steps", _step_hint(scaling)
            )
            return scalar
    low, high = sorted(int(end) for end in ends)
    if low < scalar.natural_minimum or high > scalar.natural_maximum:
        what = f"raw values of {low}..{high} do not fit {_bits(scalar)}"
        hint = f"these hold {scalar.natural_minimum}..{scalar.natural_maximum}; use a wider type"
        location.fault("range-does-not-fit", key, what, hint)
        return scalar
    return replace(scalar, minimum=low, maximum=high)


def _bounded(scalar: Scalar, kind: Float, limits: Range, location: Location) -> Scalar:
    """A floating-point number with a range; its bounds are the nearest numbers."""
    try:
        low, high = (_rounded(kind, end) for end in (limits.first, limits.last))
    except OverflowError:
        location.fault("range-does-not-fit", "range", f"a bound does not fit {kind.name}", "use a wider type")
        return scalar
    return replace(scalar, meaning=replace(kind, bounds=(low, high)))


def _rounded(kind: Float, number: Fraction) -> float:
    """The nearest number that the type holds; 0.0 for -0.0. Raises OverflowError."""
    return kind.value(kind.raw(float(number))) + 0.0


def _bits(scalar: Scalar) -> str:
    return f"{scalar.bits} {'signed' if scalar.signed else 'unsigned'} bits"


def _decimal(number: Fraction) -> str:
    """A number as probably written in the file."""
    if number.denominator == 1 or not _terminates(number.denominator):
        return str(number)
    return str(Decimal(number.numerator) / Decimal(number.denominator))


def _step_hint(scaling: Scaling | None) -> str:
    if scaling is None:
        return "use whole numbers"
    return f"use a multiple of {scaling.scale}" + (f" above {scaling.offset}" if scaling.offset else "")


def defaulted(scalar: Scalar, value: Written | None, key: str, location: Location) -> Scalar:
    """Apply the default or constant of a field to a scalar; without one, the number nearest to 0."""
    if isinstance(scalar.meaning, Float):
        return _float_default(scalar, scalar.meaning, value, key, location)
    if value is None:
        nearest = min(max(0, scalar.minimum), scalar.maximum)
        return replace(scalar, default=nearest, role=Settable(required=nearest != 0))
    raw = _raw(scalar, value, key, location)
    if raw is None:
        return scalar
    if not scalar.natural_minimum <= raw <= scalar.natural_maximum:
        held = f"{scalar.natural_minimum}..{scalar.natural_maximum}"
        hint = f"these hold {held}; use a wider type or another number"
        what = f"{shown(value)} does not fit {_bits(scalar)}"
        location.fault("value-does-not-fit", key, what, hint)
        return scalar
    if not scalar.minimum <= raw <= scalar.maximum:
        low, high = sorted((scalar.physical(scalar.minimum), scalar.physical(scalar.maximum)))
        location.fault("default-out-of-range", key, f"{shown(value)} is out of range", f"use {low}..{high}")
        return scalar
    if isinstance(scalar.meaning, Flags) and scalar.meaning.reserved_zero and raw & ~scalar.meaning.mask:
        hint = f"use only the named bits {scalar.meaning.mask:#x}"
        location.fault(
            "default-out-of-range", key, f"{shown(value)} sets reserved bits of {scalar.meaning.name}", hint
        )
        return scalar
    return replace(scalar, default=raw)


def _float_default(
    scalar: Scalar, kind: Float, value: Written | None, key: str, location: Location
) -> Scalar:
    """Like `defaulted`, for a floating-point number: the nearest number that the type holds."""
    if value is None:
        low, high = kind.bounds or (0.0, 0.0)
        nearest = min(max(0.0, low), high)
        return replace(scalar, default=kind.raw(nearest), role=Settable(required=nearest != 0))
    if isinstance(value, str) and value in ("nan", "inf", "-inf"):
        number = float(value)
    else:
        try:
            number = _rounded(kind, rational(value))
        except ValueError:
            hint = "write a number, nan, inf or -inf"
            location.fault("wrong-type", key, f"{shown(value)} is not a number", hint)
            return scalar
        except OverflowError:
            what = f"{shown(value)} does not fit {kind.name}"
            location.fault("value-does-not-fit", key, what, "use a wider type or another number")
            return scalar
    if not kind.allows(number):
        low, high = kind.bounds or (0.0, 0.0)
        location.fault("default-out-of-range", key, f"{shown(value)} is out of range", f"use {low}..{high}")
        return scalar
    return replace(scalar, default=kind.raw(number))


def _raw(scalar: Scalar, value: Written, key: str, location: Location) -> int | None:
    """The raw integer of a default or constant."""
    if isinstance(scalar.meaning, Enum) and (isinstance(value, str) or scalar.meaning.words is not None):
        return _named(scalar.meaning, str(value), key, location)
    if scalar.meaning == "bool" and isinstance(value, bool):
        return int(value)
    if isinstance(value, bool) or not isinstance(value, int | Decimal):
        needed = "true or false" if scalar.meaning == "bool" else "a number"
        location.fault("wrong-type", key, f"{shown(value)} is not {needed}", f"write {needed}")
        return None
    steps = Fraction(value)
    if scalar.scaling is not None:
        steps = (steps - scalar.scaling.offset) / scalar.scaling.scale
    if steps.denominator != 1:
        location.fault("bad-scale", key, f"{value} is between two steps", _step_hint(scalar.scaling))
        return None
    return int(steps)


def _named(enum: Enum, name: str, key: str, location: Location) -> int | None:
    names = {member.name: member.value for member in enum.members}
    if name in names:
        return names[name]
    from_enum = (("enums", enum.name), location.path)
    hint = did_you_mean(name, names, f"it has {listed(names)}")
    location.report.error(
        "bad-value", location.place(key), f"{enum.name} has no {shown(name)}", hint, needs=from_enum
    )
    return None
