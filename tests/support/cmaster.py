"""The master in C with the interface of `MasterEngine`, so that the tests of the one try the other."""

from __future__ import annotations

import ctypes
import functools
import subprocess
import tempfile
import weakref
from collections import deque
from pathlib import Path
from typing import Any

from qlinkgen.backends import c
from qlinkgen.backends.base import Options
from qlinkgen.backends.c import master
from qlinkgen.errors import BadReply, Collision, LinkError, NoReply, Refused
from qlinkgen.link.codec import Fault, Framed, address_of, cut, is_message, reason_of
from qlinkgen.link.counters import LinkCounters
from qlinkgen.link.events import Answered, Damaged, Event, Failed, Sent, Stray, TimedOut
from qlinkgen.link.timing import Timing
from qlinkgen.link.transaction import Reply, settled
from qlinkgen.model.naming import snake
from qlinkgen.model.protocol import Protocol
from tests.support.cdriver import WARNINGS
from tests.support.cmaster_source import asks_of, source

#: The clock of the master wraps while the first transactions run.
BEFORE_WRAP = (1 << 32) - 30_000
WRAP = 1 << 32
#: Outcomes by their numbers in the header, and the errors of the engine.
IDLE, WAITING, DONE, REFUSED, NO_REPLY, BAD_REPLY, COLLISION, BUSY, INVALID, ABORTED = range(10)
ERRORS: dict[int, type[LinkError]] = {
    NO_REPLY: NoReply, BAD_REPLY: BadReply, COLLISION: Collision, BUSY: BadReply
}  # fmt: skip
#: Counters in the order of the struct.
COUNTERS = (
    "requests", "repeats", "answers", "timeouts", "failures", "refusals", "damaged", "strays", "late",
    "collisions", "partial_echoes", "missing_echoes",
)  # fmt: skip
FLAGS = (
    "-std=c99",
    "-O1",
    "-g1",
    *WARNINGS,
    "-Wno-unused-function",
    "-Wno-missing-prototypes",
    "-fPIC",
    "-shared",
)


@functools.cache
def _folder() -> Path:
    folder = tempfile.TemporaryDirectory(prefix="cmaster-")
    weakref.finalize(_folder, folder.cleanup)
    return Path(folder.name)


def write(protocol: Protocol, folder: Path) -> Path:
    """Write the headers of a protocol and the program around its master; return the latter."""
    options = Options()
    for outputs in (c.generate(protocol, options), master.generate(protocol, options)):
        for path, text in outputs.items():
            (folder / Path(path).name).write_text(text, "utf-8")
    program = folder / f"{protocol.name}_world.c"
    program.write_text(source(protocol), "utf-8")
    return program


_LIBRARIES: dict[str, ctypes.CDLL] = {}


def library(protocol: Protocol) -> ctypes.CDLL:
    """The compiled master of a protocol."""
    key = f"{protocol.name}-{protocol.schema_hash}"
    if key not in _LIBRARIES:
        folder = _folder() / key
        folder.mkdir()
        _LIBRARIES[key] = _compiled(write(protocol, folder))
    return _LIBRARIES[key]


def _compiled(program: Path) -> ctypes.CDLL:
    shared = program.with_suffix(".so")
    done = subprocess.run(
        ["gcc", *FLAGS, str(program), "-o", str(shared)], capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stderr
    found = ctypes.CDLL(str(shared))
    world = ctypes.c_void_p
    found.master_new.restype = world
    for name in ("master_bytes", "master_wire"):
        getattr(found, name).restype = ctypes.POINTER(ctypes.c_uint8)
        getattr(found, name).argtypes = [world]
    found.master_counters.restype = ctypes.POINTER(ctypes.c_uint32)
    found.master_wait.restype = ctypes.c_uint32
    found.master_sent.restype = found.master_size.restype = ctypes.c_size_t
    found.master_wait.argtypes = found.master_poll.argtypes = found.master_abort.argtypes = [
        world,
        ctypes.c_uint32,
    ]
    found.master_ask.argtypes = [
        world, ctypes.c_int, ctypes.c_char_p, ctypes.c_size_t, ctypes.c_int, ctypes.c_uint32
    ]  # fmt: skip
    found.master_receive.argtypes = [world, ctypes.c_char_p, ctypes.c_size_t, ctypes.c_uint32]
    found.master_new.argtypes = [
        ctypes.c_uint32,
        ctypes.c_uint32,
        ctypes.c_int,
        ctypes.c_int,
        ctypes.c_uint32,
    ]
    for name in ("sent", "outcome", "error", "attempts", "answer", "counters"):
        getattr(found, f"master_{name}").argtypes = [world]
    return found


class CMaster:
    """A master in C.

    Attributes:
        events: events, oldest first; those of one call are in the order of their kinds.
        sent_at: when it has sent, for each transmission.
    """

    def __init__(self, protocol: Protocol, codec: Any, timing: Timing, *, echoes: bool = False) -> None:
        self.codec = codec
        self.timing = timing
        self.verbose = True
        self.frames = None
        self.events: deque[Event] = deque()
        self._c = library(protocol)
        self._numbers = {each.name: number for number, each in enumerate(asks_of(protocol))}
        slack = round(timing.host_slack * 1e6)
        made = self._c.master_new(timing.baud, slack, timing.attempts, int(echoes), BEFORE_WRAP)
        self._world = ctypes.c_void_p(made)
        self._finalize = weakref.finalize(self, ctypes.CDLL(None).free, self._world)
        self._commands = {each.request: each for each in codec.COMMANDS.values()}
        self._now = 0
        self._sent = b""
        self._request: Any = None
        self._command: Any = None
        self._started = self._sent_at = 0.0
        self._outcome: Reply | LinkError | None = None
        self._before = dict.fromkeys(COUNTERS, 0)

    @property
    def busy(self) -> bool:
        """A transaction is in progress."""
        return bool(self._c.master_outcome(self._world) == WAITING)

    @property
    def total(self) -> LinkCounters:
        """Counts of the bus."""
        found = LinkCounters()
        for name, number in self._counts().items():
            setattr(found, name, ({"any": number} if number else {}) if name == "damaged" else number)
        return found

    def start(self, request: Framed, now: float, *, attempts: int | None = None, trial: bool = False) -> None:
        """Begin a transaction."""
        assert not self.busy
        self._command = self._commands[type(request)]
        frame = self.codec.encode(request)
        self._request, self._started = request, now
        number = self._numbers[snake(self._command.name)]
        at = self._at(now)
        done = self._c.master_ask(self._world, number, frame, len(frame), attempts or 0, at)
        assert done == 0, done
        self._look(now)

    def bytes_to_send(self, now: float) -> bytes:
        """Return the bytes that the driver has to write now."""
        self._poll(now)
        data, self._sent = self._sent, b""
        return data

    def receive(self, data: bytes, now: float) -> None:
        """Process received bytes."""
        self._c.master_receive(self._world, data, len(data), self._at(now))
        self._look(now)

    def next_timer(self) -> float | None:
        """Return the time of the next call without received bytes; None if none is needed."""
        if not self.busy:
            return None
        wait = self._c.master_wait(self._world, (BEFORE_WRAP + self._now) % WRAP)
        assert wait != WRAP - 1
        return float((self._now + wait) / 1e6)

    def handle_timer(self, now: float) -> None:
        """Process expired timers."""
        self._poll(now)

    def abort(self, now: float) -> None:
        """Give up the pending transaction."""
        self._c.master_abort(self._world, self._at(now))

    def take(self) -> Reply:
        """Return the reply of the transaction that has just ended."""
        outcome, self._outcome = self._outcome, None
        return settled(outcome)

    def _at(self, now: float) -> int:
        """The time of the master: never earlier than the given one."""
        self._now = max(self._now, -int(-(now * 1e6 - 1e-3) // 1))
        return (BEFORE_WRAP + self._now) % WRAP

    def _poll(self, now: float) -> None:
        self._c.master_poll(self._world, self._at(now))
        self._look(now)

    def _counts(self) -> dict[str, int]:
        found = self._c.master_counters(self._world)
        return {name: found[index] for index, name in enumerate(COUNTERS)}

    def _look(self, now: float) -> None:
        """Find out what a call has done."""
        counts = self._counts()
        more = {name: counts[name] - self._before[name] for name in COUNTERS}
        self._before = counts
        node, request = address_of(self._request) if self._request else None, self._request
        tried = self._c.master_attempts(self._world)
        self.events += [Stray(now, request, False)] * more["strays"]
        self.events += [Damaged(now, node, None)] * more["damaged"]  # type: ignore[arg-type]
        self.events += [TimedOut(now, node, request, tried)] * more["timeouts"]
        if size := self._c.master_sent(self._world):
            self._sent += bytes(self._c.master_bytes(self._world)[:size])
            self._sent_at = now
            self.events.append(Sent(now, node, request, tried, self._sent))
        outcome = self._c.master_outcome(self._world)
        if self._request is not None and outcome not in {IDLE, WAITING}:
            self._end(outcome, now)
            self._request = None

    def _end(self, outcome: int, now: float) -> None:
        request, command, node = self._request, self._command, address_of(self._request)
        tried, elapsed = self._c.master_attempts(self._world), now - self._started
        message = self._message()
        if outcome == DONE:
            self._outcome = Reply(message, tried, elapsed, now, now - self._sent_at)
            if message is not None:
                self.events.append(Answered(now, node, request, message, tried, elapsed))
            return
        assert outcome != INVALID, self._c.master_error(self._world)
        known: Any = {"node": node, "attempts": tried, "elapsed": elapsed, "received": b""}
        if outcome == REFUSED:
            assert message is not None
            reason = reason_of(command.replies[type(message)], command, message)
            self._outcome = Refused(reason, reason=reason, reply=message, request=request, **known)
        else:
            self._outcome = ERRORS[outcome](request.NAME, **known)
        self.events.append(Failed(now, node, request, self._outcome))

    def _message(self) -> Framed | None:
        size = self._c.master_answer(self._world)
        assert size >= 0
        if not size:
            return None
        decoder = self.codec.StreamDecoder("response")
        wire = bytes(self._c.master_wire(self._world)[:size])
        found: list[Framed | Fault] = [*decoder.feed(wire), *decoder.finish()]
        message, *others = found
        assert is_message(message), message
        assert not others
        cut(self._command, self._request, message)
        return message
