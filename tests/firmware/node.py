"""A firmware as a station on a simulated line: the bytes of that line go through its serial port.

The line may have faults and other nodes, as with simulated slaves. An answer of the firmware is on the line
as soon as it is received; the clock of the line stops meanwhile, and a diagnostic request to a silent
firmware tells whether it has finished. So results do not depend on the speed of the machine, and silence is
certain. The firmware's own clock is real time.
"""

from __future__ import annotations

import time
from binascii import crc_hqx
from collections.abc import Callable, Iterable
from typing import Any

from qlinkgen.codecs import qlink
from qlinkgen.link import SlaveEngine
from qlinkgen.protocols.qlink.motor import MOST_DATA, echo
from qlinkgen.sim import VirtualPort
from tests.firmware.diagnostics import Counters, ProgramState
from tests.firmware.line import SILENCE, FirmwareLine, Garbage


class Summed:
    """Words or bytes with a known CRC, and perhaps a known number; equal to those with the same.

    Attributes:
        crc: CRC-16/IBM-3740 of all of them, words with the high byte first.
        item: bytes of each.
        size: their number, or None if unknown.
    """

    __hash__ = None  # type: ignore[assignment]  # as a list

    def __init__(self, crc: int, item: int, size: int | None = None) -> None:
        self.crc = crc
        self.item = item
        self.size = size

    def __eq__(self, other: object) -> bool:
        if not isinstance(other, bytes | list):
            return NotImplemented
        text = b"".join(each.to_bytes(self.item, "big") for each in other)
        return self.size in {None, len(other)} and self.crc == crc_hqx(text, 0xFFFF)

    def __repr__(self) -> str:
        return f"<{'?' if self.size is None else self.size} items with CRC {self.crc:04X}>"


class RealPauses(VirtualPort):
    """The outside's port of a line with firmware on it: a pause takes real time too."""

    def sleep(self, seconds: float) -> None:
        """Let time pass on both clocks."""
        time.sleep(seconds)
        super().sleep(seconds)


def backwards(data: bytes) -> bytes:
    """The answer of a motor that reverses its requests: the last 25 bytes, the last one first."""
    return data[::-1][:MOST_DATA]


#: Bytes that fit into the receive buffer of every port.
UNREAD = 64
#: Answers of the motor of a firmware, by the number of the motor.
MOTORS: list[Callable[[bytes], bytes]] = [echo, backwards]
#: Default settings of a node after power-up.
_USUAL: dict[str, Any] = {
    "capacity": 48,
    "rate": 1000,
    "started": False,
    "t1_delay": 1.0,
    "t2_delay": 1.0,
    "position_type": 0,
    "serial_number": 0,
    "motor_seconds": 0.05,
}


class FirmwareNode:
    """The engine of a station whose node is a firmware, and access to the state of that node.

    Attributes:
        engine: to be attached to a line.
        capacity: of its FIFO in words.
        heard: requests to it, in order.
        mute: number of answers to be lost from now on.
        deaf: number of requests to be lost from now on.
    """

    def __init__(
        self,
        line: FirmwareLine,
        number: int = 1,
        *,
        motor: Callable[[bytes], bytes] = echo,
        unsupported: Iterable[str] = (),
        **settings: Any,
    ) -> None:
        """Put the firmware in the state after power-up.

        Args:
            line: the line to it.
            number: node number, 1..16.
            motor: one of `MOTORS`.
            unsupported: commands that it does not answer.
            settings: others of `VirtualNode`, as far as `Diagnostics.configure` supports them.
        """
        self._line = line
        self._inside = line.diagnostics
        self._unsupported = frozenset(unsupported)
        self.heard: list[qlink.Message] = []
        self.mute = self.deaf = 0
        given = {**_USUAL, **settings}
        self.capacity: int = given["capacity"]
        self._inside.configure(number=number, **{**given, "rate": int(given["rate"])})
        line.number = number
        self._inside.disable(self._unsupported)
        self._inside.choose_motor(MOTORS.index(motor))
        self._inside.force_inputs(0, power_up=True)  # replaces the pins of the board
        self.engine = FirmwareEngine(line, self)

    @property
    def number(self) -> int:
        """Node number."""
        return self._line.number

    @number.setter
    def number(self, value: int) -> None:
        self._line.number = value

    # The station --------------------------------------------------------------------------------------------

    def handle(self, request: qlink.Message, now: float) -> qlink.Message | None:
        """Let the firmware handle a request; see `VirtualNode.handle`."""
        if self.deaf:
            self.deaf -= 1
            self.engine.lose()
            return None
        self.engine.pass_on()
        self.heard.append(request)
        response = self._answer_to(request)
        if response is not None:
            self.engine.answered()
        if isinstance(response, qlink.NodeSetupResponse):
            self.number = response.node
        if response is not None and self.mute:
            self.mute -= 1
            return None
        return response

    def _answer_to(self, request: qlink.Message) -> qlink.Message | None:
        command = qlink.COMMANDS[request.NAME.partition(".")[0]]
        if command.response is None:
            return None  # an unexpected answer is found before the next one
        frame = self._line.next_answer(SILENCE)
        if frame is None:
            frame = next(iter(self._line.settled()), None)
        if frame is None:
            return None
        answer = qlink.decode_response(frame)
        if type(answer) is not command.response:
            self._line.broken = True
            raise Garbage(f"{request} was answered with {answer}")
        return answer

    # A look inside ------------------------------------------------------------------------------------------

    @property
    def words(self) -> Summed:
        """Words queued so far."""
        crc, count = self._inside.words()
        return Summed(crc, 2, count)

    @property
    def loaded(self) -> Summed | None:
        """Text of the loaded program, from its end record on."""
        program = self._inside.program()
        return Summed(program.crc, 1) if program.state is ProgramState.THERE else None

    @property
    def stored(self) -> int:
        """Size of the program in memory."""
        return self._inside.program().size

    def memory(self, size: int) -> bytes:
        """Return bytes of the program from address 0 on."""
        return self._inside.program_bytes(size)

    @property
    def statistics(self) -> Counters:
        """Its counters."""
        return self._inside.counters()

    @property
    def waiting(self) -> int:
        """Words in the FIFO."""
        return self._inside.state().waiting

    @property
    def started(self) -> bool:
        """Whether the motor consumes words."""
        return self._inside.state().started

    @property
    def outputs(self) -> int:
        """The 24 outputs."""
        return self._inside.state().outputs

    @property
    def position(self) -> int:
        """Position of the motor."""
        return self._inside.state().position

    @position.setter
    def position(self, value: int) -> None:
        self._inside.set_position(value)

    @property
    def inputs(self) -> int:
        """The 24 inputs; before the first byte on the line, setting them sets the levels at power-up."""
        return self._inside.state().inputs

    @inputs.setter
    def inputs(self, value: int) -> None:
        self._inside.force_inputs(value, power_up=not self.heard)

    def switch_input_1(self, level: int) -> float:
        """Put a level on input 1 and none on the others. Returns a time not later than this."""
        before = self.clock()
        self._inside.force_inputs(level, power_up=False)
        return before

    def clock(self) -> float:
        """Return seconds of the firmware's own clock."""
        return self._inside.state().milliseconds / 1000

    def check(self) -> None:
        """Check for unexpected answers and lost bytes.

        Raises:
            AssertionError: the firmware has sent too much, or has lost bytes.
        """
        lost = self._inside.state().lost
        assert lost == 0, f"the firmware has lost {lost} bytes"


class FirmwareEngine(SlaveEngine):
    """Passes all bytes on the line to the firmware as well."""

    def __init__(self, line: FirmwareLine, node: FirmwareNode) -> None:
        super().__init__(qlink, node)
        self._line = line
        self._passing = b""
        self._unread = 0  # most bytes that the firmware may not have read yet

    def receive(self, data: bytes, now: float) -> None:
        """Take bytes that are on the line."""
        ends = self._ends
        self._passing = data
        super().receive(data, now)
        self.pass_on()
        if self._unread > UNREAD and self._ends > ends:
            self._wait()

    def _wait(self) -> None:
        """Wait for the firmware: no baud rate slows down the bytes of others, and its buffer is small."""
        self._line.diagnostics.state()
        self._unread = 0

    @property
    def _ends(self) -> int:
        """Number of ended frames. A diagnostic request after the end of one does not split another."""
        return self.counters.foreign + sum(self.counters.damaged.values())

    def pass_on(self) -> None:
        """Send the firmware all bytes received and not passed on yet."""
        if self._passing:
            self._line.write(self._passing)
            self._unread += len(self._passing)
            self._passing = b""

    def lose(self) -> None:
        """Drop the bytes not passed on yet."""
        self._passing = b""

    def answered(self) -> None:
        """It has read all bytes before its answer."""
        self._unread = 0
