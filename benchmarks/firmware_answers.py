"""Response times of the AVR slave of examples/firmware in simavr, with its motor at rest and moving."""

from __future__ import annotations

import itertools
import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import cast

from benchmarks.firmware_build import AVR, Workshop, clock, run
from benchmarks.firmware_cycles import build_simulator
from benchmarks.firmware_slave import program
from qlinkgen.codecs import qlink

BAUD = cast(int, qlink.BUS.baud)  # the schema has one
TICK = 1000  # interrupts of the slave's clock in a second
PHASES = 64  # parts of a tick in which each request ends once
RATE = 1000  # path words per second, the default of a build

_LINE = re.compile(r"(\d+) (\d+) ([0-9a-f]+|-)")
_A5 = 0xA5  # costs two bytes on the line
_WORDS = [_A5 << 8 | _A5] * 12  # the most in a motion


class Unexpected(Exception):
    """An answer, or its time, makes the measurement invalid."""


def requests() -> dict[str, qlink.Message]:
    """The longest request of each answered command, with bytes to be stuffed if that takes time.

    In the order of sending: the motor has completed its request when it is polled.
    """
    return {
        "node_setup": qlink.NodeSetupRequest(
            node=1, node_number=1, position_type=qlink.PositionType.JVL_MACTALK
        ),
        "motor_request": qlink.MotorRequestRequest(node=1, motor_data=bytes([_A5] * 26)),
        "node_info": qlink.NodeInfoRequest(node=1),
        "motor_position": qlink.MotorPositionRequest(node=1),
        "motor_response_poll": qlink.MotorResponsePollRequest(node=1),
        "motion": qlink.MotionRequest(node=1, counter=_A5, outputs=_A5, segments=_WORDS),
        "clear_fifo": qlink.ClearFifoRequest(node=1),
        "preset_motor_position": qlink.PresetMotorPositionRequest(node=1, position=-0x5A5A5A5B),
        "read": qlink.ReadRequest(node=1, size=25),
        "write": qlink.WriteRequest(node=1, data=bytes([_A5] * 25)),
        "write_read": qlink.WriteReadRequest(node=1, outputs=0xA5A5A5),
        "set_outputs": qlink.SetOutputsRequest(node=1, mask=0xA5A5A5),
        "clear_outputs": qlink.ClearOutputsRequest(node=1, mask=0xA5A5A5),
        "loop_back": qlink.LoopBackRequest(node=1, data=bytes([_A5] * 25)),
        "node_program_load": qlink.NodeProgramLoadRequest(node=1),
        "node_reset": qlink.NodeResetRequest(node=1),
    }


# The requests before each request: the motor at rest, or moving with words for longer than the request takes.
REST: Sequence[qlink.Message] = (qlink.NodeStopRequest(node=1), qlink.ClearFifoRequest(node=1))
PATH = qlink.MotionRequest(node=1, counter=_A5 - 1, segments=[1] * len(_WORDS))
MOVING: Sequence[qlink.Message] = (qlink.NodeStartRequest(node=1), qlink.ClearFifoRequest(node=1), PATH)
REFUSED_MOVING = "preset_motor_position"


@dataclass(frozen=True)
class Reply:
    """Longest time from a request's last byte to the first byte of the answer, and its limit.

    Attributes:
        rest: cycles with the motor at rest.
        moving: cycles with the motor moving; None if the slave does not answer then.
        allowed_us: microseconds, from the schema.
    """

    rest: int
    moving: int | None
    allowed_us: int

    @property
    def us(self) -> float:
        """The longer of both in microseconds."""
        return 1e6 * max(self.rest, self.moving or 0) / clock()


@dataclass(frozen=True)
class Run:
    """Result of a run of the AVR slave in simavr: its slowest replies, and the bytes of stack in use."""

    replies: Mapping[str, Reply]
    stack: int

    @property
    def slowest(self) -> str:
        """The command whose answer takes the largest share of its limit."""
        return max(self.replies, key=lambda name: self.replies[name].us / self.replies[name].allowed_us)

    @property
    def late(self) -> list[str]:
        """The commands whose answer exceeds its limit."""
        return [name for name, reply in self.replies.items() if reply.us > reply.allowed_us]


@dataclass(frozen=True)
class Heard:
    """One request of a run: the cycle that completed it, cycles until the answer began, and the answer."""

    complete: int
    cycles: int
    answer: qlink.Message | None


def replies(shop: Workshop, asked: Mapping[str, qlink.Message] | None = None, options: str = "") -> Run:
    """Slowest answers of the AVR slave, interrupts and main loop included.

    All of `requests`, or those in `asked`; of a slave built with the default options and `options`.
    """
    asked = requests() if asked is None else asked
    moving_asked = {name: request for name, request in asked.items() if name != REFUSED_MOVING}
    scenes = [(*REST, each) for each in asked.values()] + [(*MOVING, each) for each in moving_asked.values()]
    lines = _run(shop, scenes, options)
    heard = (_heard(match) for match in map(_LINE.fullmatch, lines) if match)  # simavr prints other lines too
    rest = {name: _slowest(name, heard, REST) for name in asked}
    moving = {name: _slowest(name, heard, MOVING) for name in moving_asked}
    limits = {name: f"QLINK_RESPONSE_US({name.upper()}, {BAUD}ul)" for name in asked}
    allowed = shop.values(AVR, "qlink.h", limits)
    found = {name: Reply(rest[name], moving.get(name), allowed[name]) for name in asked}
    return Run(found, int(lines[-1].removeprefix("stack ")))


def _run(shop: Workshop, scenes: Sequence[Sequence[qlink.Message]], options: str) -> list[str]:
    simulate = build_simulator(shop, "run_answer")
    words = ["+".join(each.to_frame().hex() for each in scene) for scene in scenes]
    slave = program(shop, "atmega328p", options)
    return run(simulate, slave, clock(), PHASES, *words).splitlines()


def _heard(line: re.Match[str]) -> Heard:
    complete, cycles, answer = line.groups()
    message = None if answer == "-" else qlink.decode_response(bytes.fromhex(answer))
    return Heard(int(complete), int(cycles), message)


def _slowest(name: str, heard: Iterator[Heard], before: Sequence[qlink.Message]) -> int:
    """Cycles of the slowest answer to one request, of all phases; consumes the next lines of the run."""
    plays = [list(itertools.islice(heard, len(before) + 1)) for _ in range(PHASES)]
    for *prepared, last in plays:
        _check_answer(name, last)
        if before is MOVING:
            _check_motion(name, prepared[-1], last)
    _check_phases(name, [last.complete for *_, last in plays])
    return max(last.cycles for *_, last in plays)


def _check_answer(name: str, heard: Heard) -> None:
    message = heard.answer
    if type(message) is not qlink.COMMANDS[name].response:
        raise Unexpected(f"{name} was answered by {message}")
    if isinstance(message, qlink.MotorResponsePollResponse) and message.motor_data != bytes([_A5] * 25):
        raise Unexpected(f"the motor has not completed its request, or another one: {message}")


def _check_motion(name: str, motion: Heard, last: Heard) -> None:
    """Check that the motor has begun, and that words are left when the request is complete."""
    message = motion.answer
    if not isinstance(message, qlink.MotionResponse) or not message.motor_status & qlink.MotorStatus.RUNNING:
        raise Unexpected(f"the motor does not move before {name}: {message}")
    if (last.complete - motion.complete) * RATE >= (len(PATH.segments) - 1) * clock():
        raise Unexpected(f"the motor may have no words left when {name} is complete")


def _check_phases(name: str, complete: Sequence[int]) -> None:
    """Check that the ends of the requests cover a tick; the work of the slave before moves them a little."""
    period = clock() / TICK
    places = sorted(cycle % period for cycle in complete)
    gaps = [later - earlier for earlier, later in itertools.pairwise([*places, places[0] + period])]
    if max(gaps) >= 4 * period / PHASES:
        raise Unexpected(f"{name} was not asked in all parts of a tick: a gap of {max(gaps):.0f} cycles")
