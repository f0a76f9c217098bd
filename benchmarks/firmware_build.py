"""Programs for small chips: compile, link, and read the result with the binary tools."""

from __future__ import annotations

import functools
import re
import shutil
import subprocess
import tempfile
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from pathlib import Path
from typing import TypeVar

T = TypeVar("T")

ROOT = Path(__file__).resolve().parent.parent
PROGRAMS = ROOT / "benchmarks" / "firmware"
HEADERS = ROOT / "generated" / "c"
EXAMPLES = ROOT / "examples" / "firmware"
OPTIONS = ("-std=c99", "-Os", "-ffunction-sections", "-fdata-sections", "-Wl,--gc-sections")
_NANO = ("--specs=nano.specs", "--specs=nosys.specs")


class ToolMissing(Exception):
    """A missing program of the host; the text says what to install."""


@dataclass(frozen=True)
class Target:
    """A chip, the compiler for it, and the Debian package of the compiler."""

    name: str
    title: str
    prefix: str
    package: str
    flags: tuple[str, ...]
    call: int  # bytes that a call instruction puts on the stack

    def tool(self, name: str) -> str:
        """The path of a tool: gcc, size, nm, objdump."""
        return tool(f"{self.prefix}-{name}", self.package)

    def version(self) -> str:
        """Name and version of the compiler, for the page."""
        return f"{self.prefix}-gcc {run(self.tool('gcc'), '-dumpfullversion', '-dumpversion').strip()}"


CORTEX_M0 = Target(
    "cortex-m0",
    "Cortex-M0",
    "arm-none-eabi",
    "gcc-arm-none-eabi",
    ("-mcpu=cortex-m0", "-mthumb", *_NANO),
    0,
)
CORTEX_M3 = Target(
    "cortex-m3",
    "Cortex-M3",
    "arm-none-eabi",
    "gcc-arm-none-eabi",
    ("-mcpu=cortex-m3", "-mthumb", *_NANO),
    0,
)
AVR = Target("avr", "AVR", "avr", "gcc-avr", ("-mmcu=atmega328p",), 2)
TARGETS = (CORTEX_M0, AVR)


@functools.cache
def clock() -> int:
    """Clock of the ATmega328P in hertz, from the default of its port."""
    place = EXAMPLES / "atmega328p" / "port.mk"
    if (match := re.search(r"^F_CPU \?= (\d+)", place.read_text("utf-8"), re.MULTILINE)) is None:
        raise ValueError(f"{place} has no line 'F_CPU ?= HERTZ'; add it")
    return int(match[1])


def tool(name: str, package: str) -> str:
    """The path of a program; ToolMissing names the package to install."""
    if (path := shutil.which(name)) is None:
        raise ToolMissing(f"{name} is not installed (apt install {package})")
    return path


def run(*command: object, folder: Path | None = None, environment: Mapping[str, str] | None = None) -> str:
    """Run a command and return its output; the error of a failed one contains it."""
    words = [str(word) for word in command]
    done = subprocess.run(words, capture_output=True, text=True, check=False, cwd=folder, env=environment)
    if done.returncode:
        raise RuntimeError(f"{' '.join(words)}:\n{done.stderr}{done.stdout}")
    return done.stdout


@dataclass(frozen=True)
class Size:
    """Size of a program in bytes: code and constants, initialised and cleared variables."""

    text: int
    data: int
    bss: int

    @property
    def flash(self) -> int:
        """Bytes of flash, including the values of initialised variables."""
        return self.text + self.data

    @property
    def ram(self) -> int:
        """Bytes of RAM without the stack."""
        return self.data + self.bss

    def __sub__(self, other: Size) -> Size:
        """The difference to another program."""
        return Size(self.text - other.text, self.data - other.data, self.bss - other.bss)


def size_of(target: Target, program: Path) -> Size:
    """The sections of a linked program."""
    text, data, bss, *_ = run(target.tool("size"), program).splitlines()[1].split()
    return Size(int(text), int(data), int(bss))


class Workshop:
    """A folder to build in, and the folder of the included headers."""

    def __init__(self, folder: Path, headers: Path = HEADERS) -> None:
        """Build in `folder`, with the generated headers in `headers`."""
        self.folder = folder
        self.headers = headers

    def link(self, target: Target, name: str, source: Path, options: Sequence[str] = ()) -> Path:
        """Compile a source file, or object, to a program; writes stack usage next to it."""
        place = self._place(target, name)
        run(*self._compiler(target), *options, source, "-o", "program.elf", folder=place)
        return place / "program.elf"

    def compile(self, target: Target, name: str, source: Path) -> Path:
        """Compile a source file to an object, the input of `link`."""
        place = self._place(target, name)
        run(*self._compiler(target), "-c", source, "-o", "program.o", folder=place)
        return place / "program.o"

    def _compiler(self, target: Target) -> tuple[str, ...]:
        return (target.tool("gcc"), *target.flags, *OPTIONS, "-fstack-usage", f"-I{self.headers}")

    def _place(self, target: Target, name: str) -> Path:
        place = self.folder / f"{target.name}-{name}"
        place.mkdir(exist_ok=True)
        return place

    def size(self, target: Target, name: str, source: Path, options: Sequence[str] = ()) -> Size:
        """Link a program and return its size."""
        return size_of(target, self.link(target, name, source, options))

    def values(self, target: Target, header: str, expressions: Mapping[str, str]) -> dict[str, int]:
        """Values of constant expressions over a header, by the target's compiler.

        Each becomes the size of an array in an object file, printed by nm: nothing has to run.
        """
        lines = [f"char {name}[{expression}];" for name, expression in expressions.items()]
        source = self.folder / f"values-{target.name}.c"
        source.write_text("\n".join([f'#include "{header}"', *lines]) + "\n")
        place = source.with_suffix(".o")
        run(target.tool("gcc"), *target.flags, "-std=c99", f"-I{self.headers}", "-c", source, "-o", place)
        symbols = re.findall(r"^\S+ (\S+) \w (\w+)$", run(target.tool("nm"), "-S", place), re.MULTILINE)
        sizes = {name: int(size, 16) for size, name in symbols}
        return {name: sizes[name] for name in expressions}


def in_parallel(work: Mapping[str, Callable[[], T]]) -> dict[str, T]:
    """Run several builds at once, in threads that wait for their compilers."""
    with ThreadPoolExecutor(2) as pool:
        started = {name: pool.submit(each) for name, each in work.items()}
        return {name: each.result() for name, each in started.items()}


def temporary() -> tempfile.TemporaryDirectory[str]:
    """A temporary folder to build in."""
    return tempfile.TemporaryDirectory(prefix="qlinkgen-firmware-")
