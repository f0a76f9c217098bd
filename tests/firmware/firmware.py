"""The example firmware, built and running: each port as a process with a serial line.

Without pytest, since the soak uses it as well.
"""

from __future__ import annotations

import contextlib
import os
import re
import select
import shutil
import subprocess
import time
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from types import TracebackType
from typing import IO, Self

from tests.support.sharing import locked

ROOT = Path(__file__).resolve().parents[2]
SOURCES = ROOT / "examples" / "firmware"
#: Seconds without a reaction after which a program counts as hanging.
HANGS = 30.0
#: The line with the path of the serial line: QEMU adds words around it.
_PATH = re.compile(rb"(/dev/[\w/.-]+)[^\n]*\n")
# Options of an outer make must not affect make in the tests.
_OUTER_MAKE = {"MAKEFLAGS", "MAKELEVEL", "MFLAGS"}
#: Capacity of the tests' node in words: the largest value of a byte.
FIFO = 255
#: Size of its program memory in bytes, which fits every port.
PROGRAM_SIZE = 512
_NODE = f"-DNODE_DIAGNOSTICS=1 -DNODE_FIFO={FIFO} -DNODE_PROGRAM_SIZE={PROGRAM_SIZE}"


@dataclass(frozen=True)
class Target:
    """One port of the firmware, and the tools to build and run it.

    Attributes:
        name: folder of the port.
        tools: (program, Debian package) needed in addition to make.
        headers: (header, compiler that uses it, Debian package).
        goals: goals for make.
        command: the command to run the program; {build} is the folder of the build, {program} the program.
        options: for the compiler, when the node is built for tests.
        pinned: run it on one processor only. QEMU's threads exchange every byte, which costs twice as much
            between two processors and can be many times as slow.
    """

    name: str
    tools: tuple[tuple[str, str], ...]
    headers: tuple[tuple[str, str, str], ...] = ()
    goals: tuple[str, ...] = ("program",)
    command: tuple[str, ...] = ("{program}",)
    options: str = _NODE
    pinned: bool = False


_ARM = (("arm-none-eabi-gcc", "gcc-arm-none-eabi"), ("qemu-system-arm", "qemu-system-arm"))
_NEWLIB = (("string.h", "arm-none-eabi-gcc", "libnewlib-arm-none-eabi"),)
_QEMU = ("qemu-system-arm", "-display", "none", "-monitor", "none", "-serial", "pty")
TARGETS = {
    target.name: target
    for target in (
        Target("posix", (("cc", "gcc"),)),
        Target(
            "lm3s6965evb",
            _ARM,
            _NEWLIB,
            command=(*_QEMU, "-M", "lm3s6965evb", "-kernel", "{program}"),
            pinned=True,
        ),
        Target(
            "microbit",
            _ARM,
            _NEWLIB,
            command=(*_QEMU, "-M", "microbit", "-kernel", "{program}"),
            pinned=True,
        ),
        Target(
            "atmega328p",
            (("avr-gcc", "gcc-avr"), ("cc", "gcc")),
            (("avr/io.h", "avr-gcc", "avr-libc"), ("simavr/sim_avr.h", "cc", "libsimavr-dev")),
            goals=("program", "simulator"),
            command=("{build}/run_simavr", "{program}"),
            # A baud rate for a crystal of 18.432 MHz: simulated bytes take time.
            options=f"{_NODE} -DBOARD_BAUD=1152000",
        ),
    )
}


class BuildFailed(Exception):
    """make has failed; the text is its output."""


def build(target: str, app: str, folder: Path, options: str = "") -> Path:
    """Build an application for a port, once for all processes with the same folder.

    Args:
        target: name of the port.
        app: "qlink_node" or "trio_keypad".
        folder: of the results; never the source tree.
        options: for the compiler, such as "-DNODE_FIFO=128".

    Returns:
        The program.

    Raises:
        BuildFailed: with the output of make.
    """
    folder.mkdir(parents=True, exist_ok=True)
    program = folder / (f"{target}-{app}" if target == "posix" else f"{target}-{app}.elf")
    verdict = folder / f"{target}-{app}.log"
    settings = (f"PORT={target}", f"APP={app}", f"BUILD={folder}", f"CPPFLAGS={options}")
    with locked(folder / f"{target}.lock"):
        if not verdict.exists():
            run = subprocess.run(
                ["make", "-C", str(SOURCES), *settings, *TARGETS[target].goals],
                env={name: value for name, value in os.environ.items() if name not in _OUTER_MAKE},
                stdout=subprocess.PIPE,
                stderr=subprocess.STDOUT,
                text=True,
                check=False,
            )
            verdict.write_text(f"{run.returncode}\n{run.stdout}")
    status, _, said = verdict.read_text().partition("\n")
    if status != "0" or not program.exists():
        raise BuildFailed(f"make PORT={target} APP={app} ended with {status}, program {program}:\n{said}")
    return program


def has_header(header: str, compiler: str) -> bool:
    """Return whether a compiler finds a header."""
    source = f"#include <{header}>\n".encode()
    # A header of a library may include others that need further options: only the first one counts.
    run = subprocess.run(
        [compiler, "-E", "-M", "-MG", "-x", "c", "-"], input=source, capture_output=True, check=False
    )
    return run.returncode == 0 and f"/{header}".encode() in run.stdout


class Firmware:
    """A running port. It ends with this process at the latest.

    Attributes:
        path: device name of its serial line, while it runs.
        processor: the only processor that it may use, None for any.
    """

    def __init__(self, target: str, program: Path, *, processor: int | None = None) -> None:
        """Choose a program; `start` or a `with` runs it.

        Args:
            target: name of the port.
            program: the result of `build`.
            processor: number of the only processor to run it on.
        """
        self.target = TARGETS[target]
        self.path = ""
        self.processor = processor
        self._command = [part.format(program=program, build=program.parent) for part in self.target.command]
        self._process: subprocess.Popen[bytes] | None = None
        self._line: int | None = None

    def start(self) -> str:
        """Run it and return the path of its serial line.

        Raises:
            RuntimeError: it ended, or did not print a path.
        """
        with on_processor(self.processor):  # the child inherits it from its parent
            self._process = subprocess.Popen(
                [*_guarded(), *self._command],
                stdin=subprocess.DEVNULL,
                stdout=subprocess.PIPE,
                stderr=subprocess.DEVNULL,
            )
        try:
            self.path = self._told_path(self._process.stdout)
            # Held open, so that the other end sees no hang-up between two users.
            self._line = os.open(self.path, os.O_RDWR | os.O_NOCTTY)
        except BaseException:
            self.stop()
            raise
        return self.path

    def _told_path(self, output: IO[bytes] | None) -> str:
        assert output is not None
        said, end = b"", time.monotonic() + HANGS
        while not (found := _PATH.search(said)):
            if not select.select([output], (), (), max(0.0, end - time.monotonic()))[0]:
                raise RuntimeError(f"{self._command} named no serial line in {HANGS:.0f} s; output: {said!r}")
            if not (more := os.read(output.fileno(), 4096)):
                raise RuntimeError(f"{self._command} ended before it named its line; output: {said!r}")
            said += more
        return found[1].decode()

    @property
    def running(self) -> bool:
        """Whether the process runs."""
        return self._process is not None and self._process.poll() is None

    def stop(self) -> int | None:
        """End it. Returns its exit status, negative for a signal; None if it was never started."""
        if self._line is not None:
            os.close(self._line)
            self._line = None
        process, self._process = self._process, None
        if process is None:
            return None
        process.terminate()
        try:
            return process.wait(HANGS)
        except subprocess.TimeoutExpired:
            process.kill()
            return process.wait()
        finally:
            if process.stdout is not None:
                process.stdout.close()

    def __enter__(self) -> Self:
        self.start()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.stop()


def _guarded() -> tuple[str, ...]:
    """Return a command prefix that ends a program with its parent, even if that is killed."""
    setpriv = shutil.which("setpriv")  # of util-linux; without it only `stop` ends the program
    return (setpriv, "--pdeathsig", "KILL", "--") if setpriv else ()


@contextlib.contextmanager
def on_processor(processor: int | None) -> Iterator[None]:
    """Run this thread on one processor meanwhile; None does not restrict it."""
    if processor is None:
        yield
        return
    before = os.sched_getaffinity(0)
    os.sched_setaffinity(0, {processor})
    try:
        yield
    finally:
        os.sched_setaffinity(0, before)
