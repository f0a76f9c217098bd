"""What is valid for a number: a constant, several of them, or a range."""

from __future__ import annotations

from qlinkgen.importers import cells
from qlinkgen.importers.document import Notation, Value, hexadecimal
from qlinkgen.importers.ksy.tree import Attribute, Node


def valid(
    attribute: Attribute, limits: tuple[int, int] | None, *, in_frame: bool = False
) -> dict[str, Value]:
    """The key for what `valid` states; none, with a note, if a schema cannot state it.

    Args:
        attribute: The field.
        limits: Least and greatest value of its type, None if it is not an integer.
        in_frame: It is a part of a frame, which may have several constants.
    """
    node = attribute.node.get("valid")
    if node is None:
        return {}
    if (one := number(node.get("eq") or node)) is not None:
        return {"const": hexadecimal(one) if one > 9 else one}
    several = [each for each in map(number, node.listing("any-of")) if each is not None]
    if several and len(several) == len(list(node.listing("any-of"))):
        if len(several) == 1 or in_frame:
            return {"const": [*several] if len(several) > 1 else several[0]}
        if sorted(set(several)) == list(range(min(several), max(several) + 1)):
            return {"range": Notation(f"{min(several)}..{max(several)}")}
    ends = [cells.integer(node.text(key)) for key in ("min", "max")]
    if limits and any(each is not None for each in ends):
        low, high = (limit if end is None else end for end, limit in zip(ends, limits, strict=True))
        if low <= high:
            return {"range": Notation(f"{low}..{high}")}
    node.notes.add(node.line, f"what is valid for {attribute.id[:60]} is left out: not a number or range")
    return {}


def number(node: Node) -> int | None:
    """The whole number of a node, None if it is something else."""
    return node.value if isinstance(node.value, int) and not isinstance(node.value, bool) else None
