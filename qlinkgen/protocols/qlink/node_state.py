"""State of a virtual node, and its behaviour over time."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from math import isfinite

from qlinkgen.codecs import qlink
from qlinkgen.codecs.qlink import PositionType
from qlinkgen.protocols.hex_image import HexImage
from qlinkgen.protocols.qlink.arguments import known, positive, whole
from qlinkgen.protocols.qlink.facts import INFO, LINES, LONGEST_DELAY, NODES, POSITION_TYPES
from qlinkgen.protocols.qlink.io_image import IoImage
from qlinkgen.protocols.qlink.motor import MotorRequests, echo
from qlinkgen.protocols.qlink.path_fifo import PathFifo, signed_word
from qlinkgen.protocols.qlink.program_store import ProgramStore
from qlinkgen.protocols.qlink.statistics import NodeStatistics, PathRecord

#: Seconds by which a time may precede the last one: threads and drivers read the clock in any order.
_DISORDER = 1.0


class NodeState:
    """The state of a virtual node, without its commands.

    Times are seconds of any clock, the same one for all calls of a node. An earlier time than the last counts
    as the last, up to a second. A node has no lock: use it from one thread at a time.

    Attributes:
        number: node number, 1..16; node_setup changes it.
        t1_delay: seconds from input 1 going high to output 1 going high.
        t2_delay: seconds from input 1 going low to output 1 going low.
        position_type: how it reads the position of its motor.
        version: major and minor number of the firmware.
        product_id: product, 0..65535.
        serial_number: 0..4294967295.
        unsupported: commands that it does not answer.
        silent_repeats: it does not answer a repeated motion.
        io: inputs and outputs.
        path: FIFO and motor.
        motor: requests passed to the motor.
        store: program loader.
        statistics: counts.
        record: every queued path word with its time, None unless requested.
        now: latest time passed in, None before the first.
    """

    def __init__(
        self,
        number: int = 1,
        *,
        capacity: int = 48,
        rate: float = 1000.0,
        displacement: Callable[[int], int] = signed_word,
        started: bool = False,
        t1_delay: float = 1.0,
        t2_delay: float = 1.0,
        position_type: PositionType | int = PositionType.NONE,
        version: tuple[int, int] = (1, 0),
        product_id: int = 0,
        serial_number: int = 0,
        motor: Callable[[bytes], bytes] = echo,
        motor_seconds: float = 0.05,
        check_program: bool = True,
        unsupported: Iterable[str] = (),
        silent_repeats: bool = False,
        record: bool = False,
    ) -> None:
        """Make a node as after power-up.

        Args:
            number: node number, 1..16.
            capacity: path words that its FIFO holds, 0..255.
            rate: path words per second that its motor consumes; 0 for one that never moves.
            displacement: returns the displacement of a path word, in encoder counts.
            started: whether it consumes path words without a node_start, after a reset too.
            t1_delay: as in node_setup, 0..25.5 s.
            t2_delay: as in node_setup, 0..25.5 s.
            position_type: as in node_setup.
            version: major and minor number of the firmware, 0..255 each.
            product_id: product, 0..65535.
            serial_number: 0..4294967295.
            motor: returns the motor's answer to a motor_request, 0..25 bytes.
            motor_seconds: time until a motor_request is completed.
            check_program: whether it stops acknowledging a program load that is not Intel HEX.
            unsupported: names of commands that it does not answer.
            silent_repeats: whether it does not answer a motion with the number of the last one.
            record: whether to keep every path word.

        Raises:
            ValueError: an argument is out of range, or a command is unknown.
        """
        self.number = whole("number", number, NODES[0], NODES[-1])
        self.t1_delay = positive("t1_delay", t1_delay, "s", LONGEST_DELAY)
        self.t2_delay = positive("t2_delay", t2_delay, "s", LONGEST_DELAY)
        self.position_type = whole("position_type", position_type, 0, INFO["position_type"])
        self.version = (
            whole("version[0]", version[0], 0, INFO["version_major"]),
            whole("version[1]", version[1], 0, INFO["version_minor"]),
        )
        self.product_id = whole("product_id", product_id, 0, INFO["product_id"])
        self.serial_number = whole("serial_number", serial_number, 0, INFO["serial_number"])
        self.unsupported = known("unsupported", unsupported, qlink.COMMANDS)
        self.silent_repeats = silent_repeats
        self.statistics = NodeStatistics()
        self.io = IoImage()
        self.path = PathFifo(capacity, rate, displacement, started=started)
        self.motor = MotorRequests(motor, motor_seconds)
        self.store = ProgramStore(self.statistics, check=check_program)
        self.record = PathRecord() if record else None
        self.now: float | None = None
        self._started = started

    @property
    def inputs(self) -> int:
        """The 24 inputs, bit 0 is input 1.

        Setting them takes effect at the latest time passed in. Before the first, it sets the levels at
        power-up, without an edge of input 1.
        """
        return self.io.inputs

    @inputs.setter
    def inputs(self, value: int) -> None:
        if self.now is None:
            self.io.power_up(value)
        else:
            self.set_inputs(value, self.now)

    def set_inputs(self, value: int, now: float) -> None:
        """Set the levels of the inputs.

        Args:
            value: bit 0 is input 1, 0..0xFFFFFF.
            now: time in seconds.

        Raises:
            ValueError: `value` is out of range, or `now` precedes the last time by more than a second.
        """
        self.io.set_inputs(value, self.advance(now), self.t1_delay, self.t2_delay)

    @property
    def outputs(self) -> int:
        """The 24 outputs at the latest time passed in; bit 0 is output 1."""
        return self.io.outputs

    @outputs.setter
    def outputs(self, value: int) -> None:
        self.io.write(whole("outputs", value, 0, LINES))

    @property
    def position(self) -> int:
        """Position of the motor, whether or not the node reports it."""
        return self.path.position

    @property
    def position_valid(self) -> bool:
        """Whether the node knows the position: its position type is one that the document names."""
        return self.position_type in POSITION_TYPES

    @property
    def running(self) -> bool:
        """Whether the motor is moving along the path."""
        return self.path.running

    @property
    def program(self) -> HexImage | None:
        """The loaded program, once its end record was received."""
        return self.store.image

    def advance(self, now: float) -> float:
        """Advance the node to `now`. Return the effective time.

        Raises:
            ValueError: `now` is not finite, or more than a second before the last time.
        """
        if self.now is not None and now <= self.now:
            if self.now - now > _DISORDER:
                raise ValueError(
                    f"now={now!r} is before {self.now!r}; take all times of a node from one monotonic clock"
                )
            return self.now
        if not isfinite(now):
            raise ValueError(f"now={now!r} must be a finite number of seconds")
        self.now = now
        self.io.advance(now)
        self.path.advance(now)
        return now

    def reset(self) -> None:
        """Return to the state after power-up, except for the state that a reset keeps."""
        self.path.clear()
        self.path.started = self._started
        self.io.clear()
        self.motor.forget()
