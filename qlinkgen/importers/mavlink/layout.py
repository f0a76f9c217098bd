"""The order of fields on the wire, and the checksum of a definition."""

from __future__ import annotations

from qlinkgen.importers.mavlink.dialect import SIZES, FieldOf, MessageOf
from qlinkgen.model.checksum import find


def wire_order(message: MessageOf, *, extensions: bool) -> list[FieldOf]:
    """The fields in wire order: by the size of an item, largest first; extensions after them as listed."""
    base = [each for each in message.fields if not each.extension]
    base.sort(key=lambda each: -SIZES[each.type])
    return [*base, *(each for each in message.fields if each.extension and extensions)]


def crc_extra(message: MessageOf) -> int:
    """The seed of the check value: a checksum of the names and types of a message, without extensions."""
    text = bytearray(f"{message.name} ".encode())
    for each in wire_order(message, extensions=False):
        text += f"{each.type} {each.name} ".encode()
        if each.count:
            text.append(each.count & 0xFF)
    value = find("crc-16/mcrf4xx").compute(bytes(text))
    return (value & 0xFF) ^ (value >> 8)
