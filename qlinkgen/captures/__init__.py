"""Recordings of serial lines as pcapng files, which Wireshark opens as well.

`Writer` appends packets to a file, `read_pcapng` returns those of a file; `qlinkgen.captures.recording`
writes the frames of buses.
"""

from qlinkgen.captures.pcapng import Direction, Interface, Packet
from qlinkgen.captures.reader import Reader, read_pcapng
from qlinkgen.captures.writer import Writer

__all__ = ["Direction", "Interface", "Packet", "Reader", "Writer", "read_pcapng"]
