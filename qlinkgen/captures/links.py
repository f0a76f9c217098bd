"""What packets of a recording hold besides the bytes of a serial line, by their link type."""

from __future__ import annotations

from qlinkgen.captures.pcapng import USER0, Direction
from qlinkgen.captures.records import Problems, Record

#: The meaning of packets of 16 link types is agreed on by their users: here, bytes of the line.
_USER = range(USER0, USER0 + 16)
#: Packets of the serial tap of a substation controller: twelve bytes precede those of the line.
_RTAC = 250
_RTAC_HEADER = 12
_RTAC_WAYS: dict[int, Direction] = {1: "sent", 3: "sent", 2: "received", 4: "received"}


class Line:
    """Takes the bytes of the line from the packets of a port."""

    def __init__(self, link_type: int, problems: Problems) -> None:
        """Note a problem if packets of this link type may hold more than the bytes of a line."""
        self._rtac = link_type == _RTAC
        if link_type not in _USER and not self._rtac:
            problems.add(
                0,
                f"link type {link_type} is not one of serial lines ({USER0} to {_USER[-1]}); "
                "its packets are read whole",
            )

    def record(self, packet: Record) -> Record:
        """Return what a packet holds of the line."""
        if not self._rtac or len(packet.data) < _RTAC_HEADER:
            return packet
        way = _RTAC_WAYS.get(packet.data[8])
        return packet._replace(data=packet.data[_RTAC_HEADER:], direction=way or packet.direction)
