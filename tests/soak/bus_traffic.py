"""A random mix of all operations of a bus, each outcome compared with the model."""

from __future__ import annotations

import random
from collections.abc import Callable, Iterator
from contextlib import contextmanager

from qlinkgen.codecs import qlink
from qlinkgen.errors import LinkError, LoadError
from qlinkgen.protocols.qlink import Bus
from qlinkgen.transport import Ability
from tests.soak.bus_ledger import Station
from tests.soak.bus_model import Held, Mismatch

#: Numbers of the nodes, and free ones for a node to move to; the absent numbers are never used.
NUMBERS = range(1, 9)
ABSENT = range(9, 17)
#: Commands that the third node does not support.
UNSUPPORTED = ("write_read", "loop_back")


class Traffic:
    """The user of the bus.

    Attributes:
        bus: the bus in use.
        nodes: model of each node, by its number.
        failed: operations that ended in a LinkError.
    """

    def __init__(
        self, bus: Bus, nodes: dict[int, Held], stations: dict[int, Station], seed: int, *, steady: bool
    ) -> None:
        self.bus = bus
        self.nodes = nodes
        self.failed = 0
        self._stations = {id(held): stations[number] for number, held in nodes.items()}
        self._random = random.Random(f"traffic {seed}")
        self._cut_for = 0
        self._steady = steady
        self._operations: list[Callable[[int, Held], None]] = []
        weights: dict[Callable[[int, Held], None], int] = {
            self._motion: 24, self._stream: 2, self._position: 10, self._read: 10, self._write: 8,
            self._write_read: 8, self._set: 6, self._clear: 6, self._loop: 8, self._info: 6, self._setup: 3,
            self._move: 1, self._start_stop: 3, self._sync: 6, self._load: 1, self._reset: 2, self._drop: 2,
            self._again: 4, self._preset: 3, self._motor: 3, self._poll: 4, self._inputs: 4, self._absent: 1,
            self._pause: 2,
        }  # fmt: skip
        if bus.port.capabilities.paced is not Ability.YES:
            del weights[self._again]  # in real time an answer may be later than the silence before a repeat
        if steady:
            del weights[self._absent], weights[self._move]
        for operation, weight in weights.items():
            self._operations += [operation] * weight

    def step(self) -> None:
        """Do one operation on one node."""
        if not self._steady:
            self._cut()
        number = self._random.choice(sorted(self.nodes))
        self._random.choice(self._operations)(number, self.nodes[number])

    def _cut(self) -> None:
        """At times cut the cable of one node for a while, or only the wire on which it sends."""
        self._cut_for -= 1
        if self._cut_for == 0:
            self.mend()
        elif self._cut_for < -800:
            self._cut_for = self._random.randrange(20, 200)
            station = self._stations[id(self._random.choice(list(self.nodes.values())))]
            station.cut = self._random.random() < 0.5
            station.mute = not station.cut

    def mend(self) -> None:
        """Repair all cables."""
        for station in self._stations.values():
            station.cut = station.mute = False

    @contextmanager
    def _may_fail(self) -> Iterator[None]:
        try:
            yield
        except LinkError:
            self.failed += 1

    def _number(self, bits: int) -> int:
        # Many bytes of 0xA5: they are stuffed, and damage turns them into beginnings of frames.
        return self._random.choice((self._random.getrandbits(bits), 0xA5A5_A5A5 & ((1 << bits) - 1)))

    def _bytes(self, most: int) -> bytes:
        size = self._random.randint(1, most)
        return self._random.choice((self._random.randbytes(size), b"\xa5" * size))

    def finish(self) -> None:
        """Settle all doubts, and compare everything once more."""
        for number, held in self.nodes.items():
            held.space = 0
            before = self.failed
            self._motion(number, held)
            self._info(number, held)
            self._position(number, held)
            held.check()
            if self.failed != before:
                raise Mismatch(f"node {number} does not answer, although the line has no faults")

    # Path ---------------------------------------------------------------------------------------------------

    def _motion(self, number: int, held: Held) -> None:
        words = [self._number(16) for _ in range(self._random.randint(0, min(12, held.space)))]
        outputs = self._number(8)
        state = self.bus.state.motions[number]
        before = state.pending
        try:
            answer = self.bus.motion(number, outputs=outputs, segments=words)
        except LinkError:
            self.failed += 1
            after = state.pending
            if after is before:
                held.words([], before.segments if before else [])
            else:
                held.words(before.segments if before else [], after.segments if after else [])
            held.space = 0
            held.wrote_perhaps(*([before.outputs] if before else []), outputs)
            return
        held.words((before.segments if before else []) + words, [])
        held.space = answer.fifo_space
        held.wrote(outputs, 0xFF, surely=True)
        if answer.inputs != held.node.inputs & 0xFF:
            raise Mismatch(f"node {number}: {answer}, its inputs are {held.node.inputs:06x}")

    def _stream(self, number: int, held: Held) -> None:
        others = self._random.sample(sorted(self.nodes), self._random.randint(0, 2))
        numbers = dict.fromkeys([number, *others])
        words = {each: [self._number(16) for _ in range(self._random.randrange(80))] for each in numbers}
        before = {each: self.bus.state.motions[each].pending for each in numbers}
        outputs = self._number(8)
        queued = dict.fromkeys(numbers, 0)
        stream = self.bus.stream_motion(words, outputs=outputs, patience=0.1)
        try:
            for ticks, progress in enumerate(stream, start=1):
                queued[progress.node] = progress.queued
                if ticks % 50 == 0:  # a node that has missed its start would never get room
                    self.bus.node_start(0)
        except LinkError:
            self.failed += 1
        for each in numbers:
            after = self.bus.state.motions[each].pending
            earlier = before[each]
            settled = earlier.segments if earlier is not None and earlier is not after else []
            node = self.nodes[each]
            node.words(settled + words[each][: queued[each]], after.segments if after else [])
            node.space = 0
            if queued[each] and after is None:
                node.wrote(outputs, 0xFF, surely=True)
            else:
                node.wrote_perhaps(*([earlier.outputs] if earlier else []), outputs)

    def _drop(self, number: int, held: Held) -> None:
        doubtful = self._doubtful(number)
        with self._may_fail():
            self.bus.clear_fifo(number)
        if self.bus.state.motions[number].pending is None:
            held.words_dropped(doubtful)

    def _reset(self, number: int, held: Held) -> None:
        doubtful = self._doubtful(number)
        surely = False
        with self._may_fail():
            self.bus.node_reset(number)
            surely = True
        held.was_reset(surely=surely)
        if self.bus.state.motions[number].pending is None:
            held.words_dropped(doubtful)

    def _doubtful(self, number: int) -> list[int]:
        pending = self.bus.state.motions[number].pending
        return pending.segments if pending else []

    def _preset(self, number: int, held: Held) -> None:
        position = self._number(32) - 0x8000_0000
        with self._may_fail():
            self.bus.preset_motor_position(number, position=position)
            if held.node.position != position:
                raise Mismatch(f"node {number}: position {held.node.position}, must be {position}")

    def _position(self, number: int, held: Held) -> None:
        with self._may_fail():
            position = self.bus.motor_position(number).position
            if not held.node.position_valid and position:
                raise Mismatch(f"node {number}: position {position}, but it has none")

    def _start_stop(self, number: int, held: Held) -> None:
        whom = self._random.choice((0, number))
        self._random.choice((self.bus.node_start, self.bus.node_start, self.bus.node_stop))(whom)

    # Inputs and outputs -------------------------------------------------------------------------------------

    def _inputs(self, number: int, held: Held) -> None:
        held.node.inputs = self._number(24) & ~1  # input 1 would move output 1 after T1

    def _read(self, number: int, held: Held) -> None:
        size, offset = self._random.randint(1, 26), self._random.choice((0, 0, 1, 2, 3, 200))
        with self._may_fail():
            data = bytes(self.bus.read(number, size=size, offset=offset).data)
            if data != held.node.inputs.to_bytes(3, "little")[offset:][:size].ljust(size, b"\0"):
                raise Mismatch(f"node {number}: read {data.hex()}, inputs are {held.node.inputs:06x}")

    def _again(self, number: int, held: Held) -> None:
        """Repeat the same request while its answer changes: no old answer may be accepted.

        Each has one attempt, so that a late answer arrives after the call. Time is left for a copy of an
        answer: it would pass for the answer to a lost request.
        """
        for _ in range(4):
            held.node.inputs = self._number(24) & ~1
            with self._may_fail():
                reply = self.bus.transact(qlink.ReadRequest(node=number, size=3), attempts=1)
                data = bytes(reply.response.data)
                if data != held.node.inputs.to_bytes(3, "little"):
                    raise Mismatch(f"node {number}: read {data.hex()}, inputs are {held.node.inputs:06x}")
            self.bus.port.sleep(0.003)

    def _write(self, number: int, held: Held) -> None:
        offset, data = self._random.choice((0, 0, 1, 2, 3, 200)), self._bytes(25)
        surely = False
        with self._may_fail():
            self.bus.write(number, offset=offset, data=data)
            surely = True
        kept = data[: max(0, 3 - offset)]
        mask = (1 << 8 * len(kept)) - 1 << 8 * offset
        held.wrote(int.from_bytes(kept, "little") << 8 * offset, mask, surely=surely)

    def _write_read(self, number: int, held: Held) -> None:
        outputs = self._number(24)
        surely = False
        with self._may_fail():
            answer = self.bus.write_read(number, outputs=outputs)
            surely = True
            if answer.inputs != held.node.inputs or "write_read" in held.node.unsupported:
                raise Mismatch(f"node {number}: {answer}, its inputs are {held.node.inputs:06x}")
        if "write_read" not in held.node.unsupported:
            held.wrote(outputs, 0xFF_FFFF, surely=surely)

    def _set(self, number: int, held: Held) -> None:
        mask = self._number(24)
        surely = False
        with self._may_fail():
            self.bus.set_outputs(number, mask=mask)
            surely = True
        held.wrote(mask, mask, surely=surely)

    def _clear(self, number: int, held: Held) -> None:
        mask = self._number(24)
        surely = False
        with self._may_fail():
            self.bus.clear_outputs(number, mask=mask)
            surely = True
        held.wrote(0, mask, surely=surely)

    def _loop(self, number: int, held: Held) -> None:
        offset, data = self._number(8), self._bytes(25)
        with self._may_fail():
            answer = self.bus.loop_back(number, offset=offset, data=data)
            if (answer.offset, bytes(answer.data)) != (offset, data) or "loop_back" in held.node.unsupported:
                raise Mismatch(f"node {number}: {answer}, must be {offset}, {data!r}")

    # Node, motor, program -----------------------------------------------------------------------------------

    def _info(self, number: int, held: Held) -> None:
        with self._may_fail():
            held.told_info(self.bus.node_info(number))

    def _setup(self, number: int, held: Held) -> None:
        self._set_up(number, number, held)

    def _set_up(self, number: int, new: int, held: Held) -> bool:
        t1, t2, kind = (
            self._random.randrange(256) / 10,
            self._random.randrange(256) / 10,
            self._random.choice(_TYPES),
        )
        surely = False
        with self._may_fail():
            self.bus.node_setup(number, node_number=new, t1_delay=t1, t2_delay=t2, position_type=kind)
            surely = True
        held.set_up((t1, t2, int(kind)), surely=surely)
        return surely

    def _move(self, number: int, held: Held) -> None:
        """Give a node another number. Without an answer it may have either: search for it."""
        if self.bus.state.motions[number].pending is not None:
            return
        new = self._random.choice([each for each in NUMBERS if each not in self.nodes])
        moved = self._set_up(number, new, held)
        if not moved:
            self.mend()
            moved = self._find(new, number) == new
        if moved != (held.node.number == new):
            raise Mismatch(
                f"node {number}: has number {held.node.number}, must have {new if moved else number}"
            )
        if moved:
            del self.nodes[number]
            self.nodes[new] = held
            held.space = 0

    def _find(self, *numbers: int) -> int:
        for _ in range(200):
            for found in self.bus.scan(numbers):
                if not found.garbled:  # noise at a number that no node has
                    return found.node
        raise Mismatch(f"no node answers as {numbers} any more")

    def _motor(self, number: int, held: Held) -> None:
        data = self._bytes(26)
        surely = False
        with self._may_fail():
            if self._random.random() < 0.3:
                answer = self.bus.complete_motor_request(number, data)
                if answer.last_completion != 0x16 or bytes(answer.motor_data) != data[:25]:
                    raise Mismatch(f"node {number}: {answer}, must be {data[:25]!r}")
            else:
                self.bus.motor_request(number, motor_data=data)
            surely = True
        held.motor_asked(data[:25], surely=surely)

    def _poll(self, number: int, held: Held) -> None:
        with self._may_fail():
            held.told_motor(self.bus.motor_response_poll(number))

    def _load(self, number: int, held: Held) -> None:
        text = self._program()
        piece = self._random.randint(5, 25)
        loads = held.node.statistics.program_loads
        try:
            self.bus.load(number, text, piece=piece, patience=0.3)
        except LoadError as error:
            self.failed += 1
            taken = bytes(held.node.store.text)
            if loads != held.node.statistics.program_loads and not (
                text.startswith(taken) and len(taken) >= error.acknowledged
            ):
                raise Mismatch(f"node {number}: holds {taken!r} of {text!r}") from error
            return
        image = held.node.program
        if image is None or image.text != text:
            raise Mismatch(f"node {number}: holds another program than the loaded one")

    def _program(self) -> bytes:
        lines = []
        for index in range(self._random.choice((1, 3, 30))):
            record = bytes((16, *(16 * index).to_bytes(2, "big"), 0)) + self._random.randbytes(16)
            lines.append(b":%s%02X" % (record.hex().upper().encode(), -sum(record) & 0xFF))
        return b"\r\n".join([*lines, b":00000001FF", b""])

    # The bus as a whole -------------------------------------------------------------------------------------

    def _sync(self, number: int, held: Held) -> None:
        self.bus.node_sync()

    def _absent(self, number: int, held: Held) -> None:
        absent = self._random.choice(ABSENT)
        with self._may_fail():
            raise Mismatch(f"node {absent} does not exist: {self.bus.motor_position(absent)}")

    def _pause(self, number: int, held: Held) -> None:
        self.bus.port.sleep(self._random.uniform(0.0, 0.02))


_TYPES = (qlink.PositionType.NONE, qlink.PositionType.JVL_MACTALK, qlink.PositionType.METRONIX)
