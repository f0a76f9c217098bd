"""The example firmware, built and running: each port as a process with a serial line.

No pytest in here: the soak uses it as well.
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
#: Seconds after which a program that ought to have said or done something hangs.
HANGS = 30.0
#: The line on which a program names its end of the serial line: QEMU puts words around the path.
_PATH = re.compile(rb"(/dev/[\w/.-]+)[^\n]*\n")
# A make that has started the tests must not tell the one in here how to work.
_OUTER_MAKE = {"MAKEFLAGS", "MAKELEVEL", "MFLAGS"}
#: Words that the node of the tests can queue: all that a byte can tell.
FIFO = 255
#: Bytes of a program that it can hold, which every port has room for.
PROGRAM_SIZE = 512
_NODE = f"-DNODE_DIAGNOSTICS=1 -DNODE_FIFO={FIFO} -DNODE_PROGRAM_SIZE={PROGRAM_SIZE}"


@dataclass(frozen=True)
class Target:
    """One port of the firmware, and what it takes to build and run it.

    Attributes:
        name: folder of the port.
        tools: (program, Debian package) of what is needed beside make.
        headers: (header, compiler that has to find it, Debian package).
        goals: what make is to make.
        command: what runs the program; {build} is the folder of the build, {program} the program.
        options: for the compiler, when the node is built for tests.
        pinned: keep it to one processor. QEMU's threads hand every byte to and fro, which costs twice as much
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
            # Of the baud rates that a crystal of 18.432 MHz has: simulated bytes take their time.
            options=f"{_NODE} -DBOARD_BAUD=1152000",
        ),
    )
}


class BuildFailed(Exception):
    """make has said no; the text is what it wrote."""


def build(target: str, app: str, folder: Path, options: str = "") -> Path:
    """Build an application for a port, once for all processes that name the same folder.

    Args:
        target: name of the port.
        app: "qlink_node" or "trio_keypad".
        folder: where the results go; never the source tree.
        options: for the compiler, such as "-DNODE_FIFO=128".

    Returns:
        The program.

    Raises:
        BuildFailed: with what make wrote.
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
    # A header of a library may include another that only a further option finds: only the first one counts.
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
        """Choose; `start` or a `with` runs it.

        Args:
            target: name of the port.
            program: as `build` has returned it.
            processor: number of the processor that it has to keep to.
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
            RuntimeError: it ended, or named no path.
        """
        with on_processor(self.processor):  # the child begins where its parent is
            self._process = subprocess.Popen(
                [*_guarded(), *self._command],
                stdin=subprocess.DEVNULL,
                stdout=subprocess.PIPE,
                stderr=subprocess.DEVNULL,
            )
        try:
            self.path = self._told_path(self._process.stdout)
            # Held open, so that nobody at the other end sees an end of the line between two users.
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
                raise RuntimeError(f"{self._command} named no serial line in {HANGS:.0f} s; it said {said!r}")
            if not (more := os.read(output.fileno(), 4096)):
                raise RuntimeError(f"{self._command} ended before it named its line; it said {said!r}")
            said += more
        return found[1].decode()

    @property
    def running(self) -> bool:
        """Whether the process is there."""
        return self._process is not None and self._process.poll() is None

    def stop(self) -> int | None:
        """End it. Returns its exit status, negative for a signal; None where it was never started."""
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
    """Return what makes a program end with the one that has started it, also where that one is killed."""
    setpriv = shutil.which("setpriv")  # of util-linux; without it `stop` alone has to do
    return (setpriv, "--pdeathsig", "KILL", "--") if setpriv else ()


@contextlib.contextmanager
def on_processor(processor: int | None) -> Iterator[None]:
    """Keep this thread to one processor meanwhile; None leaves it free."""
    if processor is None:
        yield
        return
    before = os.sched_getaffinity(0)
    os.sched_setaffinity(0, {processor})
    try:
        yield
    finally:
        os.sched_setaffinity(0, before)
