"""Diagnostics of the example firmware: motor requests that begin with 7E D1 are for the node.

examples/firmware/qlink_node/diagnostics.c is the other side.
"""

from __future__ import annotations

import struct
from collections.abc import Callable, Iterable
from enum import IntEnum
from typing import NamedTuple

from qlinkgen.codecs import qlink

MARK = b"\x7e\xd1"
#: First byte of an answer that refuses the operation in its second byte.
REFUSED = 0xFF
#: Most bytes of the program in one answer.
MOST_BYTES = 24


class Op(IntEnum):
    """Operations."""

    COUNTERS = 1
    MORE_COUNTERS = 2
    PROGRAM = 3
    PROGRAM_BYTES = 4
    WORDS = 5
    INPUTS = 6
    STATE = 7
    CONFIGURE = 8
    POSITION = 9
    ENABLE = 10
    MOTOR = 11


class ProgramState(IntEnum):
    """The progress of a load."""

    NONE = 0
    LOADING = 1
    THERE = 2
    FAULT = 3


class Counters(NamedTuple):
    """The counters of `NodeStatistics` that the firmware keeps."""

    requests: int
    motions: int
    duplicates: int
    words: int
    overruns: int
    jumps: int
    syncs: int
    repeated_syncs: int
    missed_syncs: int
    motor_requests: int
    replaced_motor_requests: int
    refused_presets: int
    resets: int
    program_loads: int
    program_pieces: int
    repeated_pieces: int
    refused_pieces: int


class Program(NamedTuple):
    """A load of a program: `size` in memory, `crc` of its text since the opening."""

    state: ProgramState
    size: int
    crc: int


class State(NamedTuple):
    """The state of the node; `lost` counts bytes lost because its receive buffer was full."""

    outputs: int
    inputs: int
    position: int
    waiting: int
    started: bool
    running: bool
    milliseconds: int
    lost: int


_FIRST = struct.Struct(">3HI2H")
_SECOND = struct.Struct(">2HI4H")
_PROGRAM = struct.Struct(">4HBHH")
_WORDS = struct.Struct(">HI")
_STATE = struct.Struct(">3s3siBBBIH")


class Diagnostics:
    """Reads and sets the state of a node; every call takes effect at once.

    Args:
        exchange: sends the data of a motor request and returns that of the following poll.
    """

    def __init__(self, exchange: Callable[[bytes], bytes]) -> None:
        self._exchange = exchange

    def _ask(self, op: Op, arguments: bytes = b"") -> bytes:
        answer = self._exchange(MARK + bytes((op,)) + arguments)
        if answer[:1] != bytes((op,)):
            raise AssertionError(f"{op.name} {arguments.hex(' ')} was refused: {answer.hex(' ')}")
        return answer[1:]

    def counters(self) -> Counters:
        """Return all counters."""
        first = _FIRST.unpack(self._ask(Op.COUNTERS))
        second = _SECOND.unpack(self._ask(Op.MORE_COUNTERS))
        third = _PROGRAM.unpack(self._ask(Op.PROGRAM))
        return Counters(*first, *second, *third[:4])

    def program(self) -> Program:
        """Return the state of the load."""
        state, size, crc = _PROGRAM.unpack(self._ask(Op.PROGRAM))[4:]
        return Program(ProgramState(state), size, crc)

    def program_bytes(self, size: int, start: int = 0) -> bytes:
        """Return bytes of the program's image."""
        pieces = []
        for offset in range(start, start + size, MOST_BYTES):
            count = min(MOST_BYTES, start + size - offset)
            pieces.append(self._ask(Op.PROGRAM_BYTES, struct.pack(">HB", offset, count)))
        return b"".join(pieces)

    def words(self) -> tuple[int, int]:
        """Return CRC and number of all path words queued since power-up."""
        crc, count = _WORDS.unpack(self._ask(Op.WORDS))
        return crc, count

    def force_inputs(self, inputs: int, *, power_up: bool) -> None:
        """Put levels on the inputs: as they were at power-up, or as an edge now."""
        self._ask(Op.INPUTS, inputs.to_bytes(3, "big") + bytes((power_up,)))

    def state(self) -> State:
        """Return the state of the node."""
        outputs, inputs, *rest = _STATE.unpack(self._ask(Op.STATE))
        position, waiting, started, running, milliseconds, lost = rest
        return State(
            int.from_bytes(outputs, "big"),
            int.from_bytes(inputs, "big"),
            position,
            waiting,
            bool(started),
            bool(running),
            milliseconds,
            lost,
        )

    def configure(
        self,
        *,
        capacity: int,
        rate: int,
        started: bool,
        t1_delay: float,
        t2_delay: float,
        position_type: int,
        serial_number: int,
        number: int,
        motor_seconds: float,
    ) -> None:
        """Put the node in the state after power-up with these settings; see `VirtualNode` for each."""
        tenths = (round(10 * t1_delay), round(10 * t2_delay))
        head = struct.pack(">BIB", capacity, rate, started)
        tail = struct.pack(
            ">BBBIBH", *tenths, position_type, serial_number, number, round(1000 * motor_seconds)
        )
        self._ask(Op.CONFIGURE, head + tail)

    def set_position(self, position: int) -> None:
        """Set the position of the motor."""
        self._ask(Op.POSITION, struct.pack(">i", position))

    def disable(self, commands: Iterable[str]) -> None:
        """Remove these commands from the dispatch table, and add all others."""
        names = list(qlink.COMMANDS)
        gone = {names.index(command) for command in commands}
        mask = sum(1 << bit for bit in range(len(names)) if bit not in gone)
        self._ask(Op.ENABLE, mask.to_bytes(4, "big"))

    def choose_motor(self, motor: int) -> None:
        """0: it answers with the request. 1: with the request backwards."""
        self._ask(Op.MOTOR, bytes((motor,)))
