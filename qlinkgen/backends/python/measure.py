"""How long a message is that no length announces: its own counts tell."""

from __future__ import annotations

from qlinkgen.backends.python import scalars
from qlinkgen.errors import GenerationError
from qlinkgen.model.message import Field, Message
from qlinkgen.model.types import Array, Blob, Scalar


def measure_lines(message: Message) -> list[str]:
    """Body of the method that finds the size of a payload from its beginning; empty where it never varies."""
    if not message.variable:
        return []
    lines = [f"size = {message.min_size}"]
    place, fixed = "at", 0
    for each in message.fields:
        kind = each.type
        if isinstance(kind, Scalar) and kind.counts and _first_count(message, each):
            lines += _count(message, kind, f"{place} + {fixed}" if fixed else place)
        if each.fixed:
            fixed += each.max_size
            continue
        assert isinstance(kind, Array | Blob)
        if not kind.length.counted_by:
            what = f"{message.name}: {each.name} takes the rest of a payload whose end nothing announces"
            raise GenerationError(f"{what}; give it a count, or the frame a length")
        share = _share(message, each, kind)
        lines.append(f"end = {place} + {fixed} + {share}" if fixed else f"end = {place} + {share}")
        place, fixed = "end", 0
    return [*(lines[:-1] if lines[-1].startswith("end = ") else lines), "return size"]


def _share(message: Message, each: Field, kind: Array | Blob) -> str:
    """Bytes of a counted field."""
    count = next(other.type for other in message.fields if other.name == kind.length.counted_by)
    assert isinstance(count, Scalar)
    if count.counts_unit == "bytes" or kind.item_size == 1:
        return f"{each.name}_{count.counts_unit}"
    return f"{each.name}_items * {kind.item_size}"


def _first_count(message: Message, each: Field) -> bool:
    assert isinstance(each.type, Scalar)
    counted = next(other for other in message.fields if other.name == each.type.counts)
    return (
        not counted.fixed
        and isinstance(counted.type, Array | Blob)
        and counted.type.length.counted_by == each.name
    )


def _count(message: Message, scalar: Scalar, start: str) -> list[str]:
    counted = next(other for other in message.fields if other.name == scalar.counts)
    assert isinstance(counted.type, Array | Blob)
    length, item = counted.type.length, counted.type.item_size
    scale = item if scalar.counts_unit == "bytes" else 1
    item //= scale
    least, most = length.minimum * scale, length.maximum * scale
    count = f"{counted.name}_{scalar.counts_unit}"
    number = f"{count} = {_number(scalar, start)}"
    odd = f"{count} % {scale} or " if scale > 1 else ""
    more = f"({count} - {least})" if least else count
    return [
        f"if len(data) < {_plus(start, scalar.size)}:",
        "    return size",
        number,
        f"if {odd}not {least} <= {count} <= {most}:",
        "    return -1",
        f"size += {more} * {item}" if item > 1 else f"size += {more}",
    ]


def _number(scalar: Scalar, start: str) -> str:
    if scalar.byteorder is not None:
        if scalar.size == 1:
            return f"data[{start}]"
        return scalars.from_bytes(scalar, f"data[{start} : {_plus(start, scalar.size)}]")
    sources = tuple(f"data[{_plus(start, index)}]" for index in range(scalar.size))
    number = scalars.from_groups(scalar, sources)
    return f"({number})"


def _plus(start: str, more: int) -> str:
    base, _, number = start.partition(" + ")
    total = int(number or 0) + more
    return f"{base} + {total}" if total else base
