"""Sends the cases of `fuzz_cases` to a device, and judges what it does."""

from __future__ import annotations

from collections import Counter

from qlinkgen._dataclass import dataclass
from qlinkgen.cli.fuzz_cases import VALID, Case
from qlinkgen.errors import LinkError, NoReply, Refused
from qlinkgen.link.codec import Command, Framed, is_message
from qlinkgen.link.master import MasterEngine
from qlinkgen.transport.blocking import BlockingMaster

#: What a device does with a frame. The first two are right for a valid frame, refused and silent for others.
ANSWERED, REFUSED, SILENT, WRONG_ANSWER, ACCEPTED, GARBAGE = RESULTS = (
    "answered", "refused", "silent", "wrong answer", "accepted", "garbage",
)  # fmt: skip
#: Fewest requests after a case, one of which a device in order answers. A receiver that waits for the rest of
#: a cut frame takes them for it, so they have to fill the longest frame, and after that another one.
PROBES = 5


@dataclass(frozen=True, slots=True)
class Outcome:
    """What a device did with a case.

    Attributes:
        case: the frame.
        result: one of RESULTS.
        received: the bytes received for it, as far as known.
        probes: number of valid requests after it until one was answered; 0 without any, None if none was.
    """

    case: Case
    result: str
    received: bytes
    probes: int | None = 0

    @property
    def finding(self) -> str:
        """What is wrong with the device, "" if nothing is."""
        if self.probes is None:
            return "lost"
        right = (ANSWERED, REFUSED) if self.case.kind == VALID else (REFUSED, SILENT)
        return "" if self.result in right else self.result

    @property
    def slow(self) -> bool:
        """Whether the device missed requests after the case."""
        return self.probes is not None and self.probes > 1


class Tally:
    """Counts outcomes by kind of case and result."""

    def __init__(self) -> None:
        self.results: Counter[tuple[str, str]] = Counter()
        self.findings = self.slow = 0

    def add(self, outcome: Outcome) -> None:
        """Count an outcome."""
        self.results[outcome.case.kind, outcome.result] += 1
        self.findings += bool(outcome.finding)
        self.slow += outcome.slow


class Bench:
    """A device under test at a port.

    Args:
        engine: the engine of the master.
        master: performs transactions on the port.
        probe: a request that the device answers.
    """

    def __init__(self, engine: MasterEngine, master: BlockingMaster, probe: Framed) -> None:
        self._engine, self._master, self._probe = engine, master, probe
        self._codec, self._port = engine.codec, master.port
        self._most = PROBES + 2 * engine.timing.longest_frame // len(engine.codec.encode(probe))

    def is_there(self) -> bool:
        """Whether the device answers the probe."""
        return self._probes(PROBES) is not None

    def run(self, case: Case) -> Outcome:
        """Send a case, then the probe unless the case was answered."""
        command = self._codec.COMMANDS[case.command]
        result, received = self._ask(case) if case.kind == VALID else self._send(case, command)
        answered = case.kind == VALID and result in {ANSWERED, REFUSED}
        return Outcome(case, result, received, 0 if answered else self._probes(self._most))

    def _probes(self, most: int) -> int | None:
        """Send requests until one is answered; return how many."""
        for number in range(1, most + 1):
            try:
                self._master.transact(self._probe, attempts=1, trial=True)
            except Refused:
                return number
            except LinkError:
                continue
            return number
        return None

    def _ask(self, case: Case) -> tuple[str, bytes]:
        """Send a valid request as a master does."""
        try:
            self._master.transact(self._decoded(case.wire), attempts=1, trial=True)
        except Refused as error:
            return REFUSED, error.received
        except NoReply as error:
            return SILENT, error.received
        except LinkError as error:
            return WRONG_ANSWER, error.received
        return ANSWERED, b""

    def _decoded(self, wire: bytes) -> Framed:
        decoder = self._codec.StreamDecoder("request")
        return next(filter(is_message, (*decoder.feed(wire), *decoder.finish())))

    def _send(self, case: Case, command: Command) -> tuple[str, bytes]:
        """Send a faulty frame, and wait for a response that must not come."""
        port, timing = self._port, self._engine.timing
        echo = case.wire if self._engine.echoes else b""
        while port.read(0):
            pass
        port.transmit(case.wire, timing.line_break)
        end = port.now() + timing.deadline(command, len(case.wire))
        received, result = b"", SILENT
        while (left := end - port.now()) > 0 and result in {SILENT, GARBAGE}:
            data = port.read(left)
            received += data
            result = self._judge(command, received.removeprefix(echo), ended=not data)
        return result, received.removeprefix(echo)

    def _judge(self, command: Command, received: bytes, *, ended: bool) -> str:
        """Name what was received, the echo of the adapter removed."""
        decoder = self._codec.StreamDecoder("response")
        events = [*decoder.feed(received), *(decoder.finish() if ended else ())]
        for message in filter(is_message, events):
            reply = command.replies.get(type(message))
            refuses = reply is not None and reply.meaning(message) != "done"
            return REFUSED if refuses else ACCEPTED
        return GARBAGE if received else SILENT
