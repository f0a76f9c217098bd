"""Clock cycles on an ATmega328P, counted by simavr: receiving a byte, encoding a frame, a slave's answer."""

from __future__ import annotations

import itertools
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

from benchmarks.firmware_build import AVR, PROGRAMS, ToolMissing, Workshop, clock, run, tool
from benchmarks.firmware_size import CRC_FORMS

SIMAVR = Path("/usr/include/simavr/sim_avr.h")

# The marks of benchmarks/firmware/cycles.c, and the values of its FRAME.
_BEGIN, _END, _FRAME_END, _ENCODE_BEGIN, _ENCODE_END, _ANSWER_BEGIN, _ANSWER_END, _WRONG = range(1, 9)
FRAMES = {
    "motion.response": 0,
    "motion.response, all stuffed": 1,
    "motion.request of 12 words": 2,
    "motion.request of 12 words, all stuffed": 3,
}
ANSWERS = {"plain": 4, "stuffed": 5}
_MARK = 1  # cycles of the marking instruction


@dataclass(frozen=True)
class Mark:
    """A mark of the program: the clock, the stack pointer, and its lowest value since the last mark."""

    number: int
    cycle: int
    stack: int
    lowest: int


@dataclass(frozen=True)
class Frame:
    """Cycles for one frame: encoding it, and each call that receives a byte of it."""

    encode: int
    receive: tuple[int, ...]
    encode_stack: int
    receive_stack: int


@dataclass(frozen=True)
class Answer:
    """Cycles from the call with a request's last byte until the first byte of the answer is ready to send."""

    last_byte: int
    dispatch: int

    @property
    def total(self) -> int:
        """The sum of both."""
        return self.last_byte + self.dispatch


@dataclass(frozen=True)
class Cycles:
    """The cycles with one form of the CRC."""

    frames: dict[str, Frame]
    answers: dict[str, Answer]

    @property
    def worst_call(self) -> int:
        """The longest call for one byte of any frame."""
        return max(max(frame.receive) for frame in self.frames.values())


def build_simulator(shop: Workshop, name: str) -> Path:
    """Build run_cycles or run_answer; ToolMissing without simavr's library."""
    if not SIMAVR.exists():
        raise ToolMissing("simavr's library is not installed (apt install libsimavr-dev)")
    program, source = shop.folder / name, PROGRAMS / f"{name}.c"
    run(tool("gcc", "gcc"), "-O2", "-w", f"-I{SIMAVR.parent}", source, "-o", program, "-lsimavr")
    return program


def cycles(shop: Workshop, simulate: Path, form: str) -> Cycles:
    """Run every frame and every answer with one form of the CRC."""
    return Cycles(
        {name: frame(shop, simulate, form, number) for name, number in FRAMES.items()},
        {name: _answer(marks(shop, simulate, form, number)) for name, number in ANSWERS.items()},
    )


def all_forms(shop: Workshop) -> dict[str, Cycles]:
    """Every form of the CRC."""
    simulate = build_simulator(shop, "run_cycles")
    return {form: cycles(shop, simulate, form) for form in CRC_FORMS}


def marks(shop: Workshop, simulate: Path, form: str, frame: int) -> list[Mark]:
    """The marks of one run; RuntimeError if it did not receive its frame."""
    options = [f"-DQLINK_CRC_FORM=QLINK_CRC_FORM_{form}", f"-DFRAME={frame}"]
    program = shop.link(AVR, f"cycles-{form}-{frame}", PROGRAMS / "cycles.c", options)
    lines = run(simulate, program, clock()).splitlines()
    found = [Mark(*map(int, line.split())) for line in lines if line[:1].isdigit()]
    numbers = [mark.number for mark in found]
    if numbers.count(_FRAME_END) != 1 or _WRONG in numbers:
        raise RuntimeError(f"{program}: the frame was not received, or not answered: marks {numbers}")
    return found


def _spans(found: list[Mark], begin: int, end: int) -> Iterator[tuple[int, int]]:
    """Cycles and bytes of stack between each pair of marks."""
    for first, second in itertools.pairwise(found):
        if (first.number, second.number) == (begin, end):
            yield second.cycle - first.cycle - _MARK, first.stack - second.lowest


def frame(shop: Workshop, simulate: Path, form: str, number: int) -> Frame:
    """Run one of FRAMES with one form of the CRC."""
    found = marks(shop, simulate, form, number)
    ((encode, encode_stack),) = _spans(found, _ENCODE_BEGIN, _ENCODE_END)
    calls = list(_spans(found, _BEGIN, _END))
    return Frame(encode, tuple(call for call, _ in calls), encode_stack, max(stack for _, stack in calls))


def _answer(found: list[Mark]) -> Answer:
    *_, (last, _) = _spans(found, _BEGIN, _END)
    ((dispatch, _),) = _spans(found, _ANSWER_BEGIN, _ANSWER_END)
    return Answer(last, dispatch)
