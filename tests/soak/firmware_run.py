"""Sends a random mix to a firmware, and compares every answer and its state with a model."""

from __future__ import annotations

import random
import time
from collections import Counter, deque
from dataclasses import dataclass, field
from typing import Any, NoReturn
from zlib import crc32

from tests.firmware.firmware import FIFO, HANGS, PROGRAM_SIZE
from tests.firmware.line import FirmwareLine, Garbage
from tests.firmware.node import MOTORS, FirmwareNode
from tests.soak.firmware_model import Model, look_into
from tests.soak.firmware_traffic import ALWAYS, REQUESTS, Traffic, Unit

#: Transactions until the node is configured anew, and until its state is compared.
PHASE = 500
COMPARED = 50
#: Chance that the levels at the inputs change after a transaction.
INPUTS = 0.04
#: Path words a second of a moving motor.
FAST = 50_000
#: Bytes that may be sent after the last answer. The smallest receive buffer holds twice as many, so that a
#: request with a certain answer still fits.
UNREAD = 64
#: Response time in seconds of a motor that must not answer during the soak.
NEVER = 65.0
#: Commands that every node supports: those that carry diagnostics, and the one that is always answered.
KEPT = {"motor_request", "motor_response_poll", ALWAYS}
PROGRAM_LOAD = REQUESTS["node_program_load"].NAME
#: Number of units shown by a failure.
SHOWN = 8


class WrongAnswer(AssertionError):
    """The firmware differs from the model; the text shows the last bytes sent."""


@dataclass
class Result:
    """The result of a soak.

    Attributes:
        target: port of the firmware.
        seed: of all random numbers.
        wanted: lowest number of transactions to do.
        asked: transactions by command.
        sent: units by kind.
        answered: transactions with an answer.
        effective: disturbances that were valid requests, and answered like them.
        comparisons: number of comparisons of the whole state.
        seconds: duration.
        digest: CRC-32 of all bytes sent.
        complaint: the error, or empty.
    """

    target: str
    seed: int
    wanted: int = 0
    asked: Counter[str] = field(default_factory=Counter)
    sent: Counter[str] = field(default_factory=Counter)
    answered: int = 0
    effective: int = 0
    comparisons: int = 0
    seconds: float = 0.0
    digest: int = 0
    complaint: str = ""

    @property
    def transactions(self) -> int:
        """Intact requests to the node."""
        return self.asked.total()

    @property
    def rate(self) -> float:
        """Transactions a second."""
        return self.transactions / self.seconds if self.seconds else 0.0


class Soak:
    """One firmware under test.

    Attributes:
        result: the result so far.
    """

    # What belongs to the settings of a phase.
    _model: Model
    _traffic: Traffic
    _moves: bool

    def __init__(self, target: str, line: FirmwareLine, seed: int) -> None:
        self.result = Result(target, seed)
        self._line = line
        self._random = random.Random(f"firmware {seed}")
        self._shown: deque[Unit] = deque(maxlen=SHOWN)
        self._unread = 0

    def run(self, transactions: int) -> Result:
        """Do at least `transactions`.

        Raises:
            WrongAnswer: at the first difference.
        """
        began, self.result.wanted = time.monotonic(), transactions
        try:
            while self.result.transactions < transactions:
                self._configure()
                self._phase(min(PHASE, transactions - self.result.transactions))
        except Garbage as found:
            self._fail(str(found))
        self.result.seconds = time.monotonic() - began
        return self.result

    def _configure(self) -> None:
        """Put firmware and model in the state after power-up, with new settings."""
        chance = self._random
        delays, number, motor = chance.random() < 0.5, chance.randint(1, 16), chance.choice(MOTORS)
        gone = chance.sample([each for each in REQUESTS if each not in KEPT], chance.choice((0, 0, 1, 3)))
        settings = self._settings(delays=delays)
        self._moves = settings["rate"] > 0
        self._traffic = Traffic(chance, PROGRAM_SIZE, delays=delays)
        FirmwareNode(self._line, number, motor=motor, unsupported=gone, **settings)
        # Events later than the end of the soak must not occur in the model either when its time jumps.
        settings["motor_seconds"] *= 1e9
        self._model = Model(PROGRAM_SIZE, number=number, motor=motor, unsupported=gone, **settings)

    def _settings(self, *, delays: bool) -> dict[str, Any]:
        chance = self._random
        return {
            "capacity": chance.choice((1, 5, 12, 48, FIFO)),
            "rate": chance.choice((0, 0, FAST)),
            "started": chance.random() < 0.3,
            "t1_delay": 25.5 * delays,
            "t2_delay": 12.3 * delays,
            "position_type": chance.randrange(4),
            "serial_number": chance.choice((0, 0xA5A5A5A5, chance.getrandbits(32))),
            "motor_seconds": chance.choice((0.0, NEVER)),
        }

    def _phase(self, transactions: int) -> None:
        """Do `transactions` with the same settings."""
        end, compared = self.result.transactions + transactions, self.result.transactions
        while self.result.transactions < end:
            for unit in self._traffic.disturbances(self._model.node):
                if self._unread + len(unit.data) <= UNREAD:
                    self._send(unit)
            answered = self._send(self._request())
            if answered and self._random.random() < INPUTS:
                self._set_inputs()
            if answered and self.result.transactions >= compared + COMPARED:
                compared = self.result.transactions
                self._compare()
        self._send(self._traffic.always(self._model.node))
        self._compare()

    def _request(self) -> Unit:
        unit = self._traffic.request(self._model.node, self._model.motion_counter)
        if self._unread + len(unit.data) <= UNREAD:
            return unit
        return self._traffic.always(self._model.node)

    def _send(self, unit: Unit) -> bool:
        """Send it and check the answer. Returns whether there was one."""
        model, result = self._model, self.result
        before = model.requests
        expected = model.hear(unit.data)
        self._count(unit, model.requests - before)
        self._line.write(unit.data)
        self._unread += len(unit.data)
        if expected:
            self._check_answer(expected)
            result.answered += unit.kind == "request"
        self._line.number = model.node.number
        if unit.name == PROGRAM_LOAD and unit.kind == "request":
            self._traffic.loader.told(acknowledged=bool(expected))
        if self._moves and model.node.running:
            self._rest()
        return bool(expected)

    def _count(self, unit: Unit, requests: int) -> None:
        result = self.result
        self._shown.append(unit)
        result.digest = crc32(unit.data, result.digest)
        result.sent[unit.kind] += 1
        if unit.kind == "request":
            result.asked[unit.name.partition(".")[0]] += 1
            if requests != 1:
                self._fail("the codec does not recognise the intact request sent last")
        else:
            result.effective += requests

    def _check_answer(self, expected: bytes) -> None:
        answer = self._line.next_answer(HANGS)
        if answer is None:
            self._fail(f"no answer in {HANGS:.0f} s; {expected.hex(' ')} was due")
        if answer != expected:
            self._fail(f"the answer was {answer.hex(' ')}; {expected.hex(' ')} was due")
        self._unread = 0

    def _set_inputs(self) -> None:
        node, inputs = self._model.node, self._random.getrandbits(24)
        if node.t1_delay or node.t2_delay:
            inputs = inputs & ~1 | node.inputs & 1  # no running delay: the two clocks differ
        self._line.diagnostics.force_inputs(inputs, power_up=False)
        self._model.set_inputs(inputs)

    def _rest(self) -> None:
        """Wait until the motor has finished its words."""
        end = time.monotonic() + HANGS
        while self._line.diagnostics.state().running:
            if time.monotonic() > end:
                self._fail(f"the motor still runs after {HANGS:.0f} s")
        self._model.rest()
        self._unread = 0

    def _compare(self) -> None:
        self.result.comparisons += 1
        found = look_into(self._line.diagnostics, self._model.places)
        if differences := found.differences(self._model.look()):
            self._fail("; ".join(differences))

    def _fail(self, text: str) -> NoReturn:
        self._line.broken = True
        sent = "\n".join(f"  {unit}" for unit in self._shown)
        raise WrongAnswer(
            f"{self.result.target}, seed {self.result.seed}, after {self.result.transactions} transactions: "
            f"{text}\nThe last units sent, newest last:\n{sent}"
        )
