"""The expected answers and state of a firmware: a virtual node that receives the same bytes."""

from __future__ import annotations

from binascii import crc_hqx
from collections.abc import Iterable
from dataclasses import dataclass, field, fields
from typing import Any

from qlinkgen.codecs import qlink
from qlinkgen.link import SlaveEngine
from qlinkgen.protocols.hex_image import BrokenRecord, HexReader
from qlinkgen.protocols.qlink import VirtualNode
from qlinkgen.protocols.qlink.program_store import ProgramStore
from tests.firmware.diagnostics import Counters, Diagnostics, ProgramState

#: Seconds that pass for the model while the soak waits until the firmware is at rest.
REST = 10.0
_INIT = 0xFFFF


class SmallReader(HexReader):
    """Reads programs for a memory of `size` bytes from address 0 on."""

    def __init__(self, size: int) -> None:
        super().__init__()
        self._size = size

    def _store(self, offset: int, data: bytes) -> None:
        if data and self._base + offset + len(data) > self._size:
            raise BrokenRecord(f"{len(data)} bytes at {self._base + offset:#x}; there are {self._size}")
        super()._store(offset, data)


class SmallStore(ProgramStore):
    """A program store of `size` bytes."""

    def __init__(self, node: VirtualNode, size: int) -> None:
        super().__init__(node.statistics)
        self._size = size

    def _open(self) -> None:
        super()._open()
        self._reader = SmallReader(self._size)

    @property
    def state(self) -> ProgramState:
        """The progress of the load."""
        if self._reader is None:
            return ProgramState.NONE
        if self.fault:
            return ProgramState.FAULT
        return ProgramState.LOADING if self.image is None else ProgramState.THERE


@dataclass(frozen=True)
class Look:
    """The internal state of a node, as far as nodes with different clocks can be compared."""

    counters: Counters
    words: tuple[int, int]
    program: tuple[ProgramState, int]
    memory: tuple[tuple[int, bytes], ...]
    outputs: int
    inputs: int
    position: int
    waiting: int
    started: bool
    running: bool
    milliseconds: int = field(compare=False)
    lost: int

    def differences(self, other: Look) -> list[str]:
        """Return the differences as text."""
        return [
            f"{name}: {mine}, must be {theirs}"
            for name in (each.name for each in fields(self) if each.compare)
            if (mine := getattr(self, name)) != (theirs := getattr(other, name))
        ]


def look_into(inside: Diagnostics, places: Iterable[tuple[int, int]]) -> Look:
    """Read the state of a firmware; of the program's memory, `places` (address, size)."""
    program, state = inside.program(), inside.state()
    return Look(
        inside.counters(),
        inside.words(),
        (program.state, program.crc),
        tuple((start, inside.program_bytes(size, start)) for start, size in places),
        *state,
    )


class Model:
    """A virtual node at the end of a line.

    Attributes:
        node: the node.
        requests: requests to the node on the line.
    """

    def __init__(self, program_size: int, **settings: Any) -> None:
        """Begin in the state after power-up, with the settings of `VirtualNode`."""
        self.node = VirtualNode(record=True, **settings)
        self.node.store = self._store = SmallStore(self.node, program_size)
        self._engine = SlaveEngine(qlink, self.node)
        self._now = 0.0

    @property
    def requests(self) -> int:
        """Requests to the node on the line."""
        return self.node.statistics.requests

    @property
    def motion_counter(self) -> int | None:
        """Counter of the motion taken last."""
        return self.node._motion_counter  # known to a master too

    @property
    def places(self) -> list[tuple[int, int]]:
        """Address and size of all pieces of the loaded program in memory."""
        image = self.node.program
        return [(start, len(data)) for start, data in image.segments] if image is not None else []

    def hear(self, data: bytes) -> bytes:
        """Return the answer to these bytes, b"" if there is none."""
        self._engine.receive(data, self._now)
        due = self._engine.next_timer()
        return b"" if due is None else self._engine.bytes_to_send(due)

    def rest(self) -> None:
        """Let time pass until the motor is at rest, if it can be."""
        self._now += REST
        self.node.advance(self._now)

    def set_inputs(self, inputs: int) -> None:
        """Put levels on the inputs."""
        self.node.set_inputs(inputs, self._now)

    def look(self) -> Look:
        """Read its state."""
        node, counts = self.node, self.node.statistics
        words = node.record.words if node.record is not None else []
        image = node.program
        return Look(
            Counters(*(getattr(counts, name) for name in Counters._fields)),
            (crc_hqx(b"".join(word.to_bytes(2, "big") for word in words), _INIT), len(words)),
            (self._store.state, crc_hqx(bytes(self._store.text), _INIT)),
            image.segments if image is not None else (),
            node.outputs,
            node.inputs,
            node.position,
            node.path.waiting,
            node.path.started,
            node.running,
            0,
            0,
        )
