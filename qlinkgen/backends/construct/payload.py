"""From the fields of a message to the constructor calls of its payload."""

from __future__ import annotations

from decimal import Decimal

from qlinkgen.backends.construct.tree import Call, Named, Node, Power, Ref, Sequence, Table
from qlinkgen.model.message import Field, Message
from qlinkgen.model.types import Array, Bits, Blob, Chunk, Enum, Flags, Scalar
from qlinkgen.model.values import native_from_raw

#: Bytes of the integers that construct has a name for.
_NAMED_SIZES = (1, 2, 3, 4, 8)


def fields(message: Message) -> tuple[Node, ...]:
    """The members of a message's payload, in wire order."""
    return tuple(Named(field.name, _field(message, field), _doc(field)) for field in message.fields)


def integer(chunks: tuple[Chunk, ...], *, signed: bool = False) -> Node:
    """The integer of construct that has these bytes, or Groups where it has none."""
    size = len(chunks)
    orders = {
        tuple(Chunk(8 * index, 8) for index in range(size)): "l",
        tuple(Chunk(8 * index, 8) for index in reversed(range(size))): "b",
    }
    order = orders.get(chunks)
    sign = "s" if signed else "u"
    if order is None:
        pairs = tuple((chunk.shift, chunk.bits) for chunk in chunks)
        return Call("Groups", pairs, (("signed", True),) if signed else ())
    if size in _NAMED_SIZES:
        return Ref(f"Int{8 * size}{sign}{order}")
    flags = {"signed": signed, "swapped": order == "l"}
    return Call("BytesInteger", (size,), tuple((key, True) for key, value in flags.items() if value))


def _field(message: Message, field: Field) -> Node:
    kind = field.type
    if isinstance(kind, Bits):
        members = (Named(each.name, _bit_field(each.shift, each.type), each.doc) for each in kind.members)
        return Call("BitFields", (integer(kind.container.chunks), *members))
    if isinstance(kind, Scalar):
        return _scalar(message, kind)
    return _items(message, field, kind)


def _scalar(message: Message, scalar: Scalar) -> Node:
    raw = integer(scalar.chunks, signed=scalar.signed)
    if scalar.constant:
        return Call("Const", (scalar.default, raw))
    if scalar.reserved and scalar.byteorder is None:  # bits between the groups are ignored too
        data = bytes(scalar.default >> chunk.shift & chunk.mask for chunk in scalar.chunks)
        return Call("Rebuild", (Call("Bytes", (scalar.size,)), data))
    if scalar.reserved:
        return Call("Rebuild", (raw, scalar.default))
    if scalar.counts:
        target = next(field for field in message.fields if field.name == scalar.counts)
        assert isinstance(target.type, Blob | Array)
        step = target.type.item_size if scalar.counts_unit == "bytes" else 1
        return Call("Count", (_ranged(raw, scalar), scalar.counts, *((step,) if step > 1 else ())))
    return _value(raw, scalar)


def _bit_field(shift: int, scalar: Scalar) -> Node:
    signed = (("signed", True),) if scalar.signed else ()
    return _value(Call("Bits", (shift, shift + scalar.bits - 1), signed), scalar)


def _value(raw: Node, scalar: Scalar) -> Node:
    """An integer with everything that makes it the native value, and its default."""
    node = _ranged(raw, scalar)
    if isinstance(scalar.meaning, Flags) and scalar.meaning.reserved_zero:
        node = Call("Flagged", (node, scalar.meaning.mask))
    if scalar.meaning == "bool":
        node = Call("Boolean", (node,))
    if scaling := scalar.scaling:
        settings = {"factor": (scaling.factor, 1), "bias": (scaling.bias, 0), "divisor": (scaling.divisor, 1)}
        kwargs = tuple((key, _steps(value)) for key, (value, usual) in settings.items() if value != usual)
        node = Call("Scaled", (node,), kwargs + ((("exact", True),) if scalar.number == "decimal" else ()))
    default = native_from_raw(scalar, scalar.default)
    assert isinstance(default, int | float | Decimal)
    return Call(
        "Default", (node, Call("Decimal", (str(default),)) if isinstance(default, Decimal) else default)
    )


def _steps(number: int) -> Node:
    """Fractions of fixed point numbers are read as powers of two."""
    is_power = number >= 1 << 10 and number.bit_count() == 1
    return Power(number.bit_length() - 1) if is_power else number


def _ranged(raw: Node, scalar: Scalar) -> Node:
    return raw if scalar.full_range else Call("Ranged", (raw, scalar.minimum, scalar.maximum))


def _items(message: Message, field: Field, kind: Blob | Array) -> Node:
    length = kind.length
    kwargs: tuple[tuple[str, Node], ...] = ()
    if length.counted_by:
        kwargs = (("count", length.counted_by),)
    elif not length.fixed:
        kwargs = _behind(message, field)
    if isinstance(kind, Array):
        item = _ranged(integer(kind.item.chunks, signed=kind.item.signed), kind.item)
        return Call(
            "Default", (Call("Items", (item, length.minimum, length.maximum), kwargs), Sequence(kind.default))
        )
    node = Call("Characters" if kind.text else "Octets", (length.minimum, length.maximum), kwargs)
    return Call("Default", (node, kind.default.decode("ascii") if kind.text else kind.default))


def _behind(message: Message, field: Field) -> tuple[tuple[str, Node], ...]:
    """What follows a field that takes the rest: fixed bytes, and counts with the size of an item."""
    behind = message.fields[message.fields.index(field) + 1 :]
    found: list[tuple[str, Node]] = []
    if tail := sum(each.max_size for each in behind if each.fixed):
        found.append(("tail", tail))
    sizes: list[tuple[str, Node]] = [
        (each.type.length.counted_by, each.type.item_size)
        for each in behind
        if isinstance(each.type, Blob | Array) and not each.fixed
    ]
    return (*found, ("counted", Table(tuple(sizes)))) if sizes else tuple(found)


def _doc(field: Field) -> str:
    """What stands beside a field: its unit, its purpose, and a warning."""
    kind = field.type
    words = [kind.unit] if isinstance(kind, Scalar) and kind.unit else []
    if isinstance(kind, Scalar) and isinstance(kind.meaning, Enum | Flags):
        words.append(kind.meaning.name)
    words += [field.doc] if field.doc else []
    return ": ".join(words) + ("" if field.confirmed else " (not confirmed)")
