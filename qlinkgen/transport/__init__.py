"""Ports: byte streams over serial lines, ptys and memory.

`open_port` opens a device or URL, `open_pty` makes a port for another program to open, `memory_pair` connects
two ends in this process. All are a `Port`, and raise the `PortError` family of `qlinkgen.errors`.
"""

from qlinkgen.transport.memory import MemoryPort, memory_pair, memory_ring
from qlinkgen.transport.opening import open_port
from qlinkgen.transport.port import Ability, Capabilities, Port
from qlinkgen.transport.pty import PtyPort, open_pty
from qlinkgen.transport.reopening import ReopeningPort
from qlinkgen.transport.serial_port import SerialPort
from qlinkgen.transport.settings import RS485Settings

__all__ = [
    "Ability",
    "Capabilities",
    "MemoryPort",
    "Port",
    "PtyPort",
    "RS485Settings",
    "ReopeningPort",
    "SerialPort",
    "memory_pair",
    "memory_ring",
    "open_port",
    "open_pty",
]
