"""One schema through lint, every target and both compilers, compared with the reference."""

from __future__ import annotations

import contextlib
import functools
import random
import re
import signal
import subprocess
import tempfile
import traceback
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from types import FrameType

from qlinkgen.backends import c, construct, python
from qlinkgen.backends.base import Options, Outputs
from qlinkgen.cli import kits
from qlinkgen.cli.targets import TARGETS
from qlinkgen.errors import GenerationError
from qlinkgen.model.message import Direction
from qlinkgen.model.naming import file_stem
from qlinkgen.model.protocol import Protocol
from qlinkgen.plan import plan_of
from qlinkgen.plan.select import Role
from qlinkgen.schema import loads
from tests.support.cdriver import WARNINGS, Driver, build
from tests.support.whole import chance, schemas
from tests.support.whole.reference import Reference, Seen, Wrong
from tests.support.whole.reference.frames import Frame
from tests.support.whole.reference.kinds import Kinds
from tests.support.whole.reference.layouts import Message
from tests.support.whole.reference.special import Packets
from tests.support.whole.targets import (
    ConstructTarget,
    CTarget,
    Heard,
    InterpreterTarget,
    PythonTarget,
    Target,
    compiled,
    printed_codec,
    printed_structures,
)

#: Limits in seconds: processor time of one schema, real time of a compiled program.
SECONDS = 120
#: Compilers and language standards; `every` adds the later ones.
_STRICT = (("gcc", "-std=c99"), ("clang", "-std=c99"))
_EVERY = (
    *_STRICT,
    *(("gcc", "-std=c11"), ("clang", "-std=c11")),
    *(("g++", "-xc++", "-std=c++17"), ("clang++", "-xc++", "-std=c++17")),
)
#: Maximum number of differences in streams of one output that are minimised and reported.
_MOST = 3
#: Targets without vectors, which take long.
_QUICK = ("python", "bus", "c", "construct")
_PLAIN = ("-O0", "-std=c99")
#: The optimiser could remove errors that a sanitizer should find, and takes three times as long.
_CHECKED = ("-O0", "-g1", "-std=c99", "-fsanitize=address,undefined", "-fno-sanitize-recover=all")


@dataclass(frozen=True)
class Effort:
    """The number of trials of one schema."""

    messages: int = 6
    streams: int = 12
    #: One in this number of schemas is compiled with sanitizers, and all whose receivers add up counts.
    sanitized: int = 4
    #: C is generated but not compiled.
    uncompiled: bool = False
    #: Every compiler and standard checks every header, both C compilers build the kit, Python has each role.
    every: bool = False


@dataclass(frozen=True, slots=True)
class Difference:
    """A difference between an output and the reference."""

    stage: str
    who: str
    #: Equal for differences with the same cause.
    cause: str
    detail: str


@dataclass
class Outcome:
    """The result of one schema."""

    seed: int
    hostile: bool
    text: str
    traits: str = ""
    refused: tuple[str, ...] = ()
    differences: list[Difference] = field(default_factory=list)
    messages: int = 0
    frames: int = 0
    streams: int = 0
    compared: int = 0

    def report(self) -> str:
        """A report that allows it to be reproduced."""
        lines = [f"seed {self.seed}{' hostile' if self.hostile else ''} ({self.traits})"]
        lines += [f"- {each.stage}, {each.who}: {each.detail}" for each in self.differences]
        return "\n".join([*lines, self.text])


def run(seed: int, *, hostile: bool = False, effort: Effort | None = None) -> Outcome:
    """The trial of the schema of a seed."""
    return run_text(schemas.generate(seed, hostile=hostile), seed, hostile=hostile, effort=effort)


def run_text(text: str, seed: int = 0, *, hostile: bool = False, effort: Effort | None = None) -> Outcome:
    """The trial of any schema; `seed` draws its messages and streams."""
    outcome = Outcome(seed, hostile, text)
    with tempfile.TemporaryDirectory() as folder, _limited():
        trial = _Trial(outcome, Path(folder), effort or Effort())
        trial.guard("trial", "any", trial.run)
    return outcome


@contextlib.contextmanager
def _limited() -> Iterator[None]:
    """Raise after a time limit, so that a hanging trial counts as a difference."""

    def expired(number: int, frame: FrameType | None) -> None:
        raise TimeoutError(f"no result after {SECONDS} seconds of processor time")

    before = signal.signal(signal.SIGPROF, expired)
    signal.setitimer(signal.ITIMER_PROF, SECONDS)
    try:
        yield
    finally:
        signal.setitimer(signal.ITIMER_PROF, 0)
        signal.signal(signal.SIGPROF, before)


class _Failed(Exception):
    """A tool failed; the text is its output."""


class _Trial:
    def __init__(self, outcome: Outcome, folder: Path, effort: Effort) -> None:
        self.outcome, self.folder, self.effort = outcome, folder, effort
        self.rng = random.Random(f"trial {outcome.seed}")
        self.targets: list[Target] = []

    def run(self) -> None:
        protocol, faults = loads(self.outcome.text, "whole.yaml")
        self.outcome.refused = tuple(sorted({each.rule for each in faults if each.severity == "error"}))
        if self.outcome.refused:
            return
        assert protocol is not None
        self.reference = Reference(self.outcome.text)
        self.outcome.traits = traits(self.reference)
        self.mark = chance.mark(self.reference)
        with contextlib.ExitStack() as programs:
            self._make(protocol, programs)
            self._messages()
            self._streams()

    # Differences

    def found(self, stage: str, who: str, cause: str, detail: str) -> None:
        """Record a difference, one of each kind."""
        difference = Difference(stage, who, cause, detail)
        if all(
            (stage, who, cause) != (each.stage, each.who, each.cause) for each in self.outcome.differences
        ):
            self.outcome.differences.append(difference)

    def guard(self, stage: str, who: str, action: Callable[[], None]) -> bool:
        """Run a step; any exception is a difference."""
        try:
            action()
        except _Failed as failed:
            self.found(stage, who, _common(str(failed)), str(failed))
        except Exception as error:  # noqa: BLE001 - crashes of any kind are findings
            last = traceback.extract_tb(error.__traceback__)[-1]
            where = f"{Path(last.filename).name}:{last.name}"
            detail = f"{type(error).__name__}: {error} at {where}"
            self.found(stage, who, _common(f"{type(error).__name__} at {where}: {error}"), detail[:600])
        else:
            return True
        return False

    # Building

    def _make(self, protocol: Protocol, programs: contextlib.ExitStack) -> None:
        made: dict[str, Outputs] = {}
        for name in _QUICK if self.effort.uncompiled else TARGETS:
            self.guard("generate", name, partial(_generate, name, protocol, made))
        for path, text in (each for outputs in made.values() for each in outputs.items()):
            (self.folder / Path(path).name).write_text(text, "utf-8")
            if path.endswith(".py"):
                self.guard("parse", Path(path).parent.name, partial(_parse, text, path))
        self.targets.append(InterpreterTarget(self.reference, plan_of(protocol)))
        self.guard("load", "python in memory", partial(_load, protocol))
        some = _selections(protocol)
        for options in some if self.effort.every else some[self.outcome.seed % len(some) :][:1]:
            self.guard("load", f"python {options.role} {options.only}", partial(_load, protocol, options))
        if made.keys() >= {"python", "bus"}:
            codec = partial(printed_codec, {**made["python"], **made["bus"]}, self.folder)
            self.guard("load", "python", lambda: self.targets.append(PythonTarget(self.reference, codec())))
        self.guard("load", "construct", lambda: self._construct("construct", construct.live(protocol)))
        if "construct" in made:
            source = partial(printed_structures, made["construct"], self.folder)
            self.guard("load", "construct source", lambda: self._construct("construct source", source()))
        header = self.folder / f"{file_stem(protocol.name)}.h"
        if not self.effort.uncompiled and header.exists() and self._compile(header):
            self._roles(protocol)
            self.guard("driver", "c", lambda: self._driver(protocol, programs))

    def _construct(self, name: str, live: construct.Live) -> None:
        self.targets.append(ConstructTarget(self.reference, name, live))

    def _driver(self, protocol: Protocol, programs: contextlib.ExitStack) -> None:
        frame = self.reference.frame
        frames = frame.frames.values() if isinstance(frame, Kinds) else [frame]
        counts = any(isinstance(each, Frame) and "length" not in each.by_role for each in frames)
        checked = counts or self.outcome.seed % self.effort.sanitized == 0
        folder = self.folder / "driver"
        folder.mkdir()
        try:
            compiler = "clang" if self.outcome.seed % 2 else "gcc"
            program = build(protocol, folder, compiler, _CHECKED if checked else _PLAIN)
        except subprocess.CalledProcessError as error:
            raise _Failed(f"the driver does not compile ({error.returncode})") from None
        driver = programs.enter_context(Driver("timeout", str(10 * SECONDS), program))
        self.targets.append(CTarget(self.reference, driver))

    def _compile(self, header: Path) -> bool:
        """Compile strictly; returns whether it succeeds."""
        clean = self._strict(header, _EVERY if self.effort.every else _STRICT)
        kit = self.folder / f"{header.stem}_conformance.c"
        if kit.exists():
            for compiler in ("gcc", "clang") if self.effort.every else ("gcc",):
                self._kit(kit, compiler)
        if clean:
            return True
        unit = str(header.with_name("strict.c"))
        done = subprocess.run(["gcc", *_PLAIN, "-fsyntax-only", unit], capture_output=True, check=False)
        return done.returncode == 0

    def _strict(self, header: Path, compilers: Sequence[tuple[str, ...]]) -> bool:
        """Check the syntax strictly; returns whether all compilers accept it without warnings."""
        unit = header.with_name("strict.c")
        unit.write_text(f'#include "{header.name}"\nint main(void) {{ return 0; }}\n', "utf-8")
        clean = [
            self.guard("compile", " ".join(words), partial(_tool, *words, "-fsyntax-only", *WARNINGS, unit))
            for words in compilers
        ]
        return all(clean)

    def _roles(self, protocol: Protocol) -> None:
        """The headers for one role."""
        roles: tuple[Role, ...] = ("slave", "master")
        for role in roles:
            folder = self.folder / role
            folder.mkdir()
            self.guard("generate", f"c {role}", partial(_header_of, protocol, role, folder))
            for header in folder.glob("*.h"):
                self._strict(header, (*_STRICT, _EVERY[-2]) if self.effort.every else _STRICT[:1])

    def _kit(self, kit: Path, compiler: str) -> None:
        """Compile strictly and run, even with warnings, to find more differences."""
        program = self.folder / f"kit-{compiler}"
        command = (compiler, *_PLAIN, "-DCONFORMANCE_STDIO=1", kit, "-o", program)
        strict = self.guard("compile", f"kit {compiler}", partial(_tool, *command, *WARNINGS))
        if (
            strict
            or subprocess.run(list(map(str, command)), capture_output=True, check=False).returncode == 0
        ):
            self.guard("run", f"kit {compiler}", lambda: _kit(program))

    # Messages

    def _messages(self) -> None:
        for message in self.reference.messages:
            for _ in range(self.effort.messages):
                self._message(message)

    def _message(self, message: Message) -> None:
        self.outcome.messages += 1
        given = chance.values(message, self.rng, self.mark)
        place, request = chance.address(message, self.rng), chance.request(self.reference, message, self.rng)
        payload, wire = self.reference.encode(message.name, given, place, request)
        covered = request if isinstance(self.reference.frame, Packets) else b""
        wrong = chance.wrong_frames(self.reference, message, payload, wire, self.rng, request=request)
        for target in list(self.targets):
            about = f"{message.name} {given} at {place}"
            encode = partial(target.encode, message, given, place, covered)
            self._same("encode", target, about, lambda: (payload, wire), encode)
        for frame in (wire, *wrong):
            self._decoded(message, frame, request)

    def _decoded(self, message: Message, wire: bytes, request: bytes) -> None:
        self.outcome.frames += 1
        try:
            expected: Seen | Wrong = self.reference.decode_as(message, wire, request)
        except Wrong as wrong:
            expected = wrong
        asked = self.reference.by_name[expected.name] if isinstance(expected, Seen) else message
        if isinstance(expected, Wrong) and (told := self.reference.asking(message)):
            # A fault is that of the first answer to the request.
            asked = told[self.reference.decode("request", request).name][0]

        def right() -> Seen:
            if isinstance(expected, Wrong):
                raise expected
            return expected

        about = f"{asked.name} {wire.hex(' ')}{' after ' + request.hex(' ') if request else ''}"
        for target in list(self.targets):
            self._same("decode", target, about, right, partial(target.decode, asked, wire, request))

    def _same(
        self, stage: str, target: Target, about: str, right: Callable[[], object], seen: Callable[[], object]
    ) -> None:
        self.outcome.compared += 1
        if target not in self.targets:
            return
        expected, found = _result(right), _result(seen)
        if expected != found:
            crashed = isinstance(found, str) and not found.startswith("refused")
            cause = _common(str(found)) if crashed else _manner(expected, found)
            self.found(stage, target.name, cause, f"{about}: {_shown(found)} instead of {_shown(expected)}")
            if crashed and isinstance(target, CTarget):
                self.targets.remove(target)

    # Streams

    def _streams(self) -> None:
        for direction in self.reference.directions:
            if isinstance(self.reference.frame, Packets) and direction == "response":
                self._answers()
                continue
            known = list(self.reference.known(direction).values())
            frames = [frame for each in known for frame in self._frames(each)]
            if not frames:
                continue
            alphabet = b"".join(frame[:4] + frame[-2:] for frame in frames) + bytes([self.mark, 0])
            frame = self.reference.frame
            one = isinstance(frame, Frame) and frame.silent
            for _ in range(self.effort.streams):
                made = chance.between if one and self.rng.random() < 0.8 else chance.stream
                self._stream(direction, made(frames, alphabet, self.rng))

    def _answers(self) -> None:
        """Streams of expected packets."""
        known = list(self.reference.known("response").values())
        for _ in range(self.effort.streams if known else 0):
            asked, data = [], b""
            for message in self.rng.choices(known, k=self.rng.randint(1, 4)):
                asked.append(chance.request(self.reference, message, self.rng))
                given = chance.values(message, self.rng, self.mark)
                data += self.reference.encode(message.name, given, request=asked[-1])[1]
            self._stream("response", chance.damaged(data, data[:4], self.rng), tuple(asked))

    def _frames(self, message: Message) -> list[bytes]:
        """The shortest of several frames, to save time; some with wrong contents, or a frame as payload.

        Where ids are received in any case, some with letters of the other case.
        """
        frames: list[bytes] = []
        odd: list[bytes] = []
        nested: list[bytes] = []
        for _ in range(5):
            given, place = chance.values(message, self.rng, self.mark), chance.address(message, self.rng)
            payload, wire = self.reference.encode(message.name, given, place)
            frames.append(wire)
            odd += chance.wrapped(self.reference, message, payload, place, self.rng)
            if chance.fits(self.reference, wire):
                nested.append(self.reference.wrap(message.name, wire, place))
        few = sorted(frames, key=len)[:2]
        frame = self.reference.frame
        cased = [wire.swapcase() for wire in few] if isinstance(frame, Frame) and frame.any_case else []
        return [*few, *cased, *sorted(odd, key=len)[:1], *sorted(nested, key=len)[:1]]

    def _stream(self, direction: Direction, data: bytes, asked: tuple[bytes, ...] = ()) -> None:
        self.outcome.streams += 1
        seed = self.rng.random()
        for target in list(self.targets):
            if isinstance(target, PythonTarget):
                whole = partial(_python_stream, target, direction, asked)
                self._heard(target, direction, data, "stream", whole)
                cut = partial(_cut_stream, target, direction, asked, seed)
                self._heard(target, direction, data, "cut stream", cut)
            elif isinstance(target, CTarget) and not asked:
                self._heard(target, direction, data, "stream", partial(_c_stream, target, direction))
            elif isinstance(target, InterpreterTarget):
                whole = partial(_plan_stream, target, direction, asked)
                self._heard(target, direction, data, "stream", whole)

    def _heard(
        self, target: Target, direction: Direction, data: bytes, stage: str, compare: Callable[[bytes], str]
    ) -> None:
        self.outcome.compared += 1
        if target not in self.targets:
            return
        try:
            difference = compare(data)
        except Exception as error:  # noqa: BLE001 - see guard
            self.found(
                stage, target.name, _common(f"{type(error).__name__}: {error}"), f"{data.hex(' ')}: {error!r}"
            )
            self.targets.remove(target)
            return
        if not difference:
            return
        cause = f"{difference.partition(';')[0]} [{self.outcome.traits}]"
        seen = [
            each.cause for each in self.outcome.differences if (each.stage, each.who) == (stage, target.name)
        ]
        if cause in seen or len(seen) == _MOST:
            return
        least = chance.smallest(
            data, lambda shorter: compare(shorter).partition(";")[0] == difference.partition(";")[0]
        )
        self.found(stage, target.name, cause, f"{direction} {least.hex(' ')}: {compare(least)}")


def _generate(name: str, protocol: Protocol, made: dict[str, Outputs]) -> None:
    if name == "conformance" and "vectors" in made:  # which it would make again
        (text,) = made["vectors"].values()
        made[name] = kits.of_vectors(protocol, Options(), text)
        return
    try:
        made[name] = TARGETS[name].load()(protocol, Options())
    except GenerationError:
        if name != "master":  # which has limits of its own, and names them
            raise


def _header_of(protocol: Protocol, role: Role, folder: Path) -> None:
    for path, text in c.generate(protocol, Options(role=role)).items():
        (folder / Path(path).name).write_text(text, "utf-8")


def _load(protocol: Protocol, options: Options | None = None) -> None:
    python.load(protocol, options)


def _selections(protocol: Protocol) -> Sequence[Options]:
    """Each role, and one message."""
    return Options(role="slave"), Options(role="master"), Options(only=(protocol.messages[0].name,))


def _parse(text: str, path: str) -> None:
    """Compile, as the import of the module does."""
    compiled(text.encode(), Path(path).name)


def _tool(*words: object) -> None:
    done = subprocess.run(
        [str(word) for word in words], capture_output=True, text=True, timeout=10 * SECONDS, check=False
    )
    if done.returncode:
        errors = [line for line in done.stderr.splitlines() if "error:" in line]
        raise _Failed(
            " | ".join(line.partition("error:")[2].strip() for line in errors[:3]) or done.stderr[:300]
        )


def _kit(program: Path) -> None:
    done = subprocess.run([str(program)], capture_output=True, text=True, timeout=10 * SECONDS, check=False)
    lines = done.stdout.splitlines()
    failed = [line for line in lines if line.startswith("not ok")]
    planned = int(next((line for line in lines if line.startswith("1..")), "1..0").removeprefix("1.."))
    passed = sum(line.startswith("ok ") for line in lines)
    if done.returncode or failed or passed != planned:
        raise _Failed(f"{passed} of {planned} pass: {' | '.join(failed[:3]) or done.stderr[:200]}")


def _result(action: Callable[[], object]) -> object:
    try:
        return action()
    except Wrong as wrong:
        return f"refused: {wrong.kind}"
    except Exception as error:  # noqa: BLE001 - see guard
        last = traceback.extract_tb(error.__traceback__)[-1]
        return f"{type(error).__name__} at {last.name}: {error}"[:300]


def _shown(result: object) -> str:
    if isinstance(result, tuple):
        return " ".join(each.hex(" ") or "-" for each in result)
    return str(result)


def _manner(expected: object, found: object) -> str:
    if not isinstance(found, str):
        return "accepts invalid input" if isinstance(expected, str) else "other values"
    return f"{found} instead of {expected}" if isinstance(expected, str) else "refuses valid input"


# Consecutive comparisons of a stream need these two.
@functools.lru_cache(maxsize=4)
def _right(
    reference: Reference, direction: Direction, data: bytes, asked: tuple[bytes, ...]
) -> Sequence[Heard]:
    return [Heard.of(event) for event in reference.events(direction, data, asked)]


@functools.lru_cache(maxsize=4)
def _single(
    target: PythonTarget, direction: Direction, data: bytes, asked: tuple[bytes, ...]
) -> Sequence[Sequence[Heard]]:
    """The events of each byte, and of the end."""
    return target.events(direction, [bytes([byte]) for byte in data], asked)


def _python_stream(target: PythonTarget, direction: Direction, asked: tuple[bytes, ...], data: bytes) -> str:
    found = _single(target, direction, data, asked)
    expected = _right(target.reference, direction, data, asked)
    return _unlike(expected, [event for events in found for event in events])


def _plan_stream(
    target: InterpreterTarget, direction: Direction, asked: tuple[bytes, ...], data: bytes
) -> str:
    expected = _right(target.reference, direction, data, asked)
    return _unlike(expected, target.events(direction, data, asked))


def _c_stream(target: CTarget, direction: Direction, data: bytes) -> str:
    bare = [
        Heard(each.at, each.kind, each.name, each.address, each.values)
        for each in _right(target.reference, direction, data, ())
        if target.finishes or each.at < len(data)
    ]
    return _unlike(bare, target.events(direction, data))


def _cut_stream(
    target: PythonTarget, direction: Direction, asked: tuple[bytes, ...], seed: float, data: bytes
) -> str:
    """The events of a piece are those of its single bytes; the end of the stream is the last piece."""
    cut = chance.pieces(data, random.Random(seed))
    single = _single(target, direction, data, asked)
    end = 0
    sizes = [*map(len, cut), 1]
    for size, events in zip(sizes, target.events(direction, cut, asked), strict=True):
        expected = [event for each in single[end : end + size] for event in each]
        end += size
        if [_timeless(each) for each in events] != [_timeless(each) for each in expected]:
            kinds = [each.kind for each in events], [each.kind for each in expected]
            return f"depends on the cuts; {[each.hex(' ') for each in cut]}: {kinds[0]} instead of {kinds[1]}"
    return ""


def _timeless(event: Heard) -> tuple[object, ...]:
    return event.kind, event.name, event.address, event.values, event.place


def _unlike(expected: Sequence[Heard], found: Sequence[Heard]) -> str:
    """The difference of two lists of events; the text before the semicolon is its kind."""
    for right, seen in zip(expected, found, strict=False):
        if right == seen:
            continue
        if right.kind != seen.kind:
            return f"{seen.kind} for {right.kind}; {seen} instead of {right}"
        if _timeless(right) == _timeless(seen):
            return f"{'late' if seen.at > right.at else 'early'} {seen.kind}; {seen} instead of {right}"
        what = "place" if right.place != seen.place else "values"
        return f"other {what} of {seen.kind}; {seen} instead of {right}"
    if len(found) > len(expected):
        return f"{found[len(expected)].kind} for nothing; {found[len(expected)]}"
    return f"no {expected[len(found)].kind}; {expected[len(found)]}" if len(expected) > len(found) else ""


def traits(reference: Reference) -> str:
    """A short description of a frame."""
    frame = reference.frame
    if isinstance(frame, Kinds):
        ends = ("length" if "length" in each.by_role else "counts" for each in frame.frames.values())
        return f"kinds {' '.join(ends)}"
    if not isinstance(frame, Frame):
        return type(frame).__name__.lower()
    words = ["hunt" if frame.unique else "search", "bare" if frame.bare else "lead"]
    found = {"silent": frame.silent, "ended": frame.terminator, "length": "length" in frame.by_role}
    words.append(next((name for name, ends_it in found.items() if ends_it), "counts"))
    words += [each.kind for each in frame.codings]
    words += [] if "checksum" in frame.by_role else ["unchecked"]
    words += ["end"] if frame.parts[-1].role == "constant" else []
    if frame.stuffing:
        words.append("stuffed payload" if frame.stuffing.payload_alone else "stuffed")
    return " ".join(words)


def _common(text: str) -> str:
    """A text without the parts that differ in every schema."""
    text = re.sub(r"'[^']*'|‘[^’]*’|\"[^\"]*\"", "_", text.splitlines()[0] if text else "")
    return re.sub(r"\b0x[0-9a-f]+\b|\d+", "N", text)[:120]
