"""Second pass, compound types: byte strings, text, arrays, bit fields."""

from __future__ import annotations

from typing import Literal

from qlinkgen.model.types import Array, BitField, Bits, Blob, Enum, Float, Length, Scalar
from qlinkgen.schema.constants import integer_range
from qlinkgen.schema.file_fields import BitSpec, FieldSpec
from qlinkgen.schema.kinds import MAX_PAYLOAD
from qlinkgen.schema.location import Location
from qlinkgen.schema.notation import TypeText, byte_string, shown, whole_range
from qlinkgen.schema.numbers import defaulted, quantified
from qlinkgen.schema.scalars import Meaning, ScalarBuilder

_NUMBER_KEYS = (
    "byteorder",
    "groups",
    "parts",
    "scale",
    "offset",
    "range",
    "raw_range",
    "counts",
    "bits",
    "packed",
    "as",
    "algorithm",
    "equals",
)
_WHOLE_KEYS = ("const", "reserved", "counts", "bits", "algorithm", "equals")
_CONTAINER_KEYS = (
    "packed",
    "as",
    "scale",
    "offset",
    "range",
    "raw_range",
    "default",
    "const",
    "reserved",
    "counts",
    "unit",
    "algorithm",
    "equals",
)


#: Maximum number of bits in a row: an index of a bit is a size_t of C, which may have 16 bits.
_MAX_BITS_IN_A_ROW = 0xFFF8


def build_length(text: TypeText, item_bits: int, payload_max: int, location: Location) -> Length | None:
    """The number of items from the brackets of a type; without a number, up to the size of the payload."""
    if text.count is None or not text.count.strip():
        return Length(0, 8 * payload_max // item_bits)
    try:
        first, last = whole_range(text.count)
    except ValueError:
        hint = "write a number or a range, like [4] or [0..12]"
        if text.count.strip().startswith("request."):
            hint += "; only fields that a response lists itself have sizes from the request"
        location.fault("unknown-type", "type", f"{shown(text.count)} is not a count", hint)
        return None
    if last == 0:
        location.fault(
            "bad-array",
            "type",
            f"{text.base}[{text.count}] is always empty",
            "remove the field, or raise the count",
        )
        return None
    if last * item_bits > 8 * MAX_PAYLOAD:
        what = f"{text.base}[{text.count}] has up to {last * item_bits // 8} bytes"
        location.fault("payload-too-long", "type", what, f"use at most {MAX_PAYLOAD}")
        return None
    return Length(first, last)


def build_blob(spec: FieldSpec, text: TypeText, payload_max: int, location: Location) -> Blob | None:
    """A byte string or text."""
    location.reject(spec, (*_NUMBER_KEYS, "unit", "reserved"), text.base)
    if spec.const is not None:
        location.key_fault(
            "not-applicable",
            "const",
            f"'const' has no effect on {text.base}",
            "use an integer, or an enum of one word",
        )
    length = build_length(text, 8, payload_max, location)
    if length is None:
        return None
    if spec.terminator is not None:
        return _terminated(spec, spec.terminator, text, length, location)
    if spec.pad is not None:
        return _padded(spec, spec.pad, text, length, location)
    default = _blob_default(spec, text, length, location)
    fill = b" " if text.base == "text" else b"\0"
    required = spec.default is None and length.minimum > 0
    return Blob(text.base == "text", length, default.ljust(length.minimum, fill), required=required)


def _terminated(
    spec: FieldSpec, terminator: bytes, text: TypeText, length: Length, location: Location
) -> Blob:
    """Bytes or text of variable size that a byte ends."""
    whole = text.base == "text"

    def wrong(what: str, hint: str) -> None:
        location.key_fault("bad-terminated", "terminator", what, hint)

    if spec.pad is not None:
        wrong(f"{'a text is' if whole else 'bytes are'} padded or terminated", "remove one of both")
    elif not (text.count or "").strip():
        wrong(
            f"the {text.base} {'has' if whole else 'have'} no greatest size",
            f"write one, like {text.base}[0..16]",
        )
    elif length.fixed:
        what = f"{text.base} of constant size has no end of its own"
        wrong(what, f"write {text.base}[0..{length.maximum}], or pad")
    if whole and (len(terminator) != 1 or terminator > b"\x7f"):
        wrong("the terminator is not one 7-bit character", "write one, like 00 or 0D")
    elif len(terminator) != 1:
        wrong("the terminator is not one byte", "write one, like 00")
    default = _blob_default(spec, text, length, location)
    if terminator in default:
        wrong("the default contains the terminator", "use other characters")
    fills = (b" ", b"_") if whole else (b"\0", b"\1")
    fill = fills[terminator == fills[0]]
    required = spec.default is None and length.minimum > 0
    return Blob(
        whole, length, default.ljust(length.minimum, fill), b"", terminator[:1], terminator[:1], required
    )


def _padded(spec: FieldSpec, pad: bytes, text: TypeText, length: Length, location: Location) -> Blob:
    """Bytes or text whose value may be shorter than its constant size."""
    if not length.fixed:
        hint = f"write a constant size, like {text.base}[16]"
        location.key_fault(
            "not-applicable", "pad", f"'pad' has no effect on {text.base} of variable size", hint
        )
    if len(pad) != 1 or (text.base == "text" and pad > b"\x7f"):
        what = "the pad is not one 7-bit character" if text.base == "text" else "the pad is not one byte"
        location.fault("bad-value", "pad", what, "write one, like 00 or 20")
    default = _blob_default(spec, text, Length(0, length.maximum), location)
    return Blob(text.base == "text", length, default.rstrip(pad[:1]), pad[:1])


def _blob_default(spec: FieldSpec, text: TypeText, length: Length, location: Location) -> bytes:
    if spec.default is None:
        return b""
    is_text = text.base == "text"
    try:
        default = str(spec.default).encode("ascii") if is_text else _bytes(spec.default)
    except UnicodeEncodeError:
        what = f"{shown(spec.default)} is not ASCII text"
        location.fault("bad-value", "default", what, "use 7-bit characters")
        return b""
    except ValueError as error:
        what, _, hint = str(error).partition("; ")
        location.fault("bad-value", "default", what, hint)
        return b""
    if not length.minimum <= len(default) <= length.maximum:
        what = f"the default has {len(default)} bytes"
        location.fault("value-does-not-fit", "default", what, f"it must fit {text.base}[{text.count or ''}]")
        return b""
    return default


def _bytes(value: object) -> bytes:
    return b"" if value == "" else byte_string(value)


def build_array(
    item: Scalar, spec: FieldSpec, text: TypeText, payload_max: int, location: Location
) -> Array | None:
    """An array; ``item`` has the default of each item, which is that of its named type if it has one."""
    for key in _WHOLE_KEYS:
        if getattr(spec, key) in (None, False):
            continue
        if key in location.written:
            hint = "define a type with these bits, and write an array of it" if key == "bits" else "remove it"
            location.reject(spec, (key,), "an array", hint)
        else:
            what = f"the items of an array cannot have '{key}', as their type has"
            hint = "write the brackets at the field" if key == "bits" else "use a field for each"
            location.fault("bad-array", "type", what, hint)
    length = build_length(text, item.bits if spec.packed else 8 * item.size, payload_max, location)
    if length is None:
        return None
    given = isinstance(spec.default, list) or "default" in location.written
    default = _array_default(spec.default, item, length, location) if given else ()
    required = spec.default is None and length.minimum > 0
    if spec.packed and length.maximum * item.bits > _MAX_BITS_IN_A_ROW:
        what = f"{length.maximum} items of {item.bits} bits are too many in a row"
        location.fault("payload-too-long", "type", what, f"use at most {_MAX_BITS_IN_A_ROW // item.bits}")
        return None
    filled = default + (item.default,) * (length.minimum - len(default))
    return Array(item, length, filled, spec.packed, required)


def _array_default(given: object, item: Scalar, length: Length, location: Location) -> tuple[int, ...]:
    if not isinstance(given, list):
        location.fault("wrong-type", "default", f"{shown(given)} is not a list", "write a list, like [1, 2]")
        return ()
    if len(given) > length.maximum:
        what = f"the default has {len(given)} items"
        location.fault("value-does-not-fit", "default", what, f"write at most {length.maximum}")
        return ()
    return tuple(defaulted(item, value, "default", location).default for value in given)


def build_bits(spec: FieldSpec, container: Scalar, scalars: ScalarBuilder, location: Location) -> Bits:
    """An integer divided into bit fields."""
    location.reject(
        spec, _CONTAINER_KEYS, "an integer with bits", "put it on one of the bit fields, or remove it"
    )
    if container.meaning is not None or container.scaling is not None:
        location.fault("not-applicable", "type", "only plain integers can have bits", "use u8, u16 and so on")
    members: list[BitField] = []
    for name, bit in (spec.bits or {}).items():
        place = location.inner("bits", name, written=bit.model_fields_set)
        first, last = bit.at
        if last >= container.bits:
            place.fault(
                "bits-do-not-fit", "", f"{name} extends to bit {last}", f"use bits 0..{container.bits - 1}"
            )
            continue
        mask = (1 << (last + 1)) - (1 << first)
        if other := next((member.name for member in members if member.mask & mask), None):
            place.fault("bits-overlap", "", f"{name} overlaps {other}", "use different bits")
        scalar = bit_scalar(bit, last + 1 - first, scalars, place)
        if scalar is not None:
            members.append(BitField(name, first, scalar, bit.doc))
    if not members:
        location.report.taint(location.path)
    return Bits(container, tuple(members))


def bit_scalar(spec: BitSpec, width: int, scalars: ScalarBuilder, location: Location) -> Scalar | None:
    """The number in bits of an integer; None if its type is unknown."""
    meaning = _bit_meaning(spec, width, scalars, location)
    if isinstance(meaning, str) and meaning != "bool":
        return None
    if meaning is not None and spec.signed:
        location.reject(spec, ("signed",), "a named value")
    low, high = integer_range(width, signed=spec.signed)
    scalar = Scalar(
        bits=width, signed=spec.signed, chunks=(), minimum=low, maximum=high, meaning=meaning, unit=spec.unit
    )
    scalar = quantified(scalar, spec, "a named value", location)
    return defaulted(scalar, spec.default, "default", location)


def _bit_meaning(
    spec: BitSpec, width: int, scalars: ScalarBuilder, location: Location
) -> Meaning | Literal["unknown"]:
    if spec.type is None:
        numeric = spec.scale is not None or spec.offset is not None or spec.signed
        return "bool" if width == 1 and not numeric else None
    plain = scalars.named(spec.type, location)
    if plain is None:
        return "unknown"
    if plain.meaning is None or isinstance(plain.meaning, Float):
        hint = "omit type, and write signed: true for a signed number"
        location.fault("not-applicable", "type", f"'{spec.type}' is not the type of a bit field", hint)
        return "unknown"
    if plain.meaning == "bool":
        if width > 1:
            location.fault("bits-do-not-fit", "", f"bool has one bit, not {width}", "use at: with one bit")
        return "bool"
    if isinstance(plain.meaning, Enum) and plain.meaning.words is not None:
        location.fault("not-applicable", "type", f"{spec.type} is sent as text", "use an enum of numbers")
        return "unknown"
    if isinstance(plain.meaning, Enum) and any(member.value < 0 for member in plain.meaning.members):
        what = f"{spec.type} has negative values, which a bit field cannot hold"
        location.fault("bits-do-not-fit", "", what, "use signed: true without a type, or numbers from 0")
    elif not plain.fits(width):
        location.fault("bits-do-not-fit", "", f"{spec.type} does not fit {width} bits", "widen the bit field")
    return plain.meaning
