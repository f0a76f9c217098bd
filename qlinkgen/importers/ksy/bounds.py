"""Gives fields of unknown size a bound where a message has several: together they must fit the payload."""

from __future__ import annotations

import re
from collections.abc import Container, Mapping, Sequence
from dataclasses import replace

from qlinkgen.importers.document import Field, Message, Record

_SIZED = re.compile(r"(?P<base>\w+?)(?:\[(?P<count>\d*)\])?")
_NUMBER = re.compile(r"[uif](?P<bits>\d+)")


def bounded(message: Message, sizes: Mapping[str, int], varying: Container[str], largest: int) -> Message:
    """A message whose fields fit a payload; the same one if nothing in it needs a bound.

    Args:
        message: The message.
        sizes: Bytes of each record and enum by name.
        varying: Records of variable size.
        largest: Bytes of the largest payload.
    """
    unknown = [each for each in message.fields if _is_unknown(each)]
    if len(unknown) < 2 and not any("last" in each.keys or _base(each) in varying for each in unknown):
        return message
    share = max(0, largest - size_of(message.fields, sizes)) // len(unknown)
    return replace(message, fields=tuple(_bound(each, sizes, share) for each in message.fields))


def limited(record: Record, sizes: Mapping[str, int], largest: int) -> Record:
    """A record in which each field of variable size has a bound, so that it may be an item of an array."""
    return replace(record, fields=tuple(_bound(each, sizes, largest) for each in record.fields))


def varies(fields: Sequence[Field], varying: Container[str]) -> bool:
    """Whether the size of fields varies."""
    return any(
        each.keys.keys() & {"if", "optional", "switch"} or ".." in each.type or _base(each) in varying
        for each in fields
    )


def _base(field: Field) -> str:
    return field.type.partition("[")[0]


def _is_unknown(field: Field) -> bool:
    return field.type in ("bytes", "text") or field.type.endswith("[]")


def _bound(field: Field, sizes: Mapping[str, int], share: int) -> Field:
    if not _is_unknown(field):
        return field
    base = field.type.removesuffix("[]")
    least = 1 if "last" in field.keys else 0
    return replace(field, type=f"{base}[{least}..{max(least, share // max(1, _item(base, sizes)))}]")


def size_of(fields: Sequence[Field], sizes: Mapping[str, int]) -> int:
    """Bytes of fields; those of unknown size have none."""
    total = 0
    for each in fields:
        found = _SIZED.fullmatch(each.type)
        if found is not None and not _is_unknown(each):
            total += _item(found["base"], sizes) * int(found["count"] or 1)
    return total


def _item(base: str, sizes: Mapping[str, int]) -> int:
    if base in ("bytes", "text", "bool"):
        return 1
    found = _NUMBER.fullmatch(base)
    return int(found["bits"]) // 8 if found and base not in sizes else sizes.get(base, 0)
