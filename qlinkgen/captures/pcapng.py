"""What reader and writer of pcapng have in common: numbers of blocks and options, packets, interfaces.

A file is a sequence of blocks: type and length, a body of whole words of 32 bits, the length again. A section
header begins a section and tells its byte order. Interface descriptions follow, each of which numbers a port,
and packets, which name the number of their interface. Options are pairs of a code and bytes at the end of a
body.
"""

from __future__ import annotations

from typing import Final, Literal, NamedTuple

#: Types of blocks.
SECTION: Final = 0x0A0D0D0A
INTERFACE: Final = 1
PACKET: Final = 6
#: The first word of the body of a section header, in the byte order of the section.
MAGIC: Final = 0x1A2B3C4D
#: Type, and both lengths.
FRAME: Final = 12

#: Codes of options.
END: Final = 0
COMMENT: Final = 1
#: Of section headers.
PROGRAM: Final = 4
#: Of interface descriptions.
NAME, SPEED, RESOLUTION, OFFSET = 2, 8, 9, 14
#: Of packets.
FLAGS: Final = 2

#: The link type of packets whose meaning the user decides, DLT_USER0.
USER0: Final = 147

#: Longest block in bytes: no frame of a serial line is near it, and a longer one would fill the memory.
MOST: Final = 16 << 20

Direction = Literal["received", "sent"]
#: The lowest two bits of the flags of a packet.
DIRECTIONS: Final[dict[Direction, int]] = {"received": 1, "sent": 2}


class Interface(NamedTuple):
    """A port of a recording."""

    name: str
    #: The number of what its packets hold; `USER0` in recordings made here.
    link_type: int
    comments: tuple[str, ...] = ()
    #: Bits per second, None if it is not stated.
    speed: int | None = None


class Packet(NamedTuple):
    """One frame, or bytes that are none."""

    #: Nanoseconds since 1970-01-01 00:00 UTC.
    at: int
    data: bytes
    interface: Interface
    #: As seen from the interface; None if it is not stated.
    direction: Direction | None = None
    comments: tuple[str, ...] = ()
