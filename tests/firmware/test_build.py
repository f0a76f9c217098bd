"""A copy of the firmware builds with make and CMake, without Python; or reports the error."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import pytest

from qlinkgen.protocols.qlink import Bus
from tests.firmware.firmware import ROOT, SOURCES, Firmware
from tests.support.sharing import made_once

Tool = Callable[..., str]
GENERATED = ROOT / "generated" / "c"
QLINKGEN = (sys.executable, "-m", "qlinkgen")
#: Compiler and Debian package of each port, and its applications.
PORTS = {
    "posix": ("cc", "gcc", {"qlink_node", "trio_keypad"}),
    "lm3s6965evb": ("arm-none-eabi-gcc", "gcc-arm-none-eabi", {"qlink_node", "trio_keypad"}),
    "microbit": ("arm-none-eabi-gcc", "gcc-arm-none-eabi", {"qlink_node"}),
    "atmega328p": ("avr-gcc", "gcc-avr", {"qlink_node"}),
}
#: CRC options of a caller: a table, once.
TABLE = "-DQLINK_CRC_FORM=QLINK_CRC_FORM_TABLE -DQLINK_CRC_SHARED_TABLE"
# Options of an outer make, and a user's flags, must not affect make in the tests.
_OUTSIDE = {"MAKEFLAGS", "MAKELEVEL", "MFLAGS", "CFLAGS", "CPPFLAGS", "LDFLAGS", "PYTHONPATH"}
ENVIRONMENT = {name: value for name, value in os.environ.items() if name not in _OUTSIDE}


def run(*command: str | Path, **changes: str) -> subprocess.CompletedProcess[str]:
    """Run a command; both outputs are combined."""
    return subprocess.run(
        [str(part) for part in command],
        env={**ENVIRONMENT, "LC_ALL": "C", **changes},
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
        check=False,
    )


def sure(*command: str | Path, **changes: str) -> str:
    """Run a command that must succeed without a warning; return its output."""
    done = run(*command, **changes)
    assert done.returncode == 0, done.stdout
    assert "warning" not in done.stdout.lower(), done.stdout
    return done.stdout


@pytest.fixture
def copied(tmp_path: Path) -> Path:
    """The folder as a user copies it, with the headers next to the Makefile."""
    folder = tmp_path / "firmware"
    shutil.copytree(SOURCES, folder, ignore=shutil.ignore_patterns("build"))
    for header in ("qlink.h", "trio.h"):
        shutil.copy(GENERATED / header, folder)
    return folder


def path_without(folder: Path, *beginnings: str) -> str:
    """A PATH with all programs of the present one except those whose names begin with `beginnings`."""
    with made_once(folder) as first:
        programs = [path for place in ENVIRONMENT["PATH"].split(os.pathsep) for path in Path(place).glob("*")]
        for program in programs if first else ():
            link = folder / program.name
            if not program.name.startswith(beginnings) and not link.is_symlink():
                link.symlink_to(program)
    assert shutil.which("make", path=str(folder))
    return str(folder)


@pytest.fixture
def without_python(shared: Path) -> str:
    """A PATH with all programs except Python and qlinkgen."""
    path = path_without(shared / "without-python", "python", "pip", "qlinkgen", "pypy")
    assert not shutil.which("python3", path=path)
    return path


@pytest.fixture
def only_the_host(shared: Path) -> str:
    """A PATH without compilers for other processors."""
    return path_without(shared / "host-alone", "avr-", "arm-none-eabi-")


def programs(folder: Path) -> set[str]:
    """Names of the programs in a folder, as applications of a port."""
    names = (path.name.removesuffix(".elf") for path in folder.glob("*-*") if path.is_file())
    return {name.partition("-")[2] for name in names if name.partition("-")[0] in PORTS}


@pytest.mark.parametrize("port", PORTS)
def test_make_needs_no_python(port: str, copied: Path, without_python: str, require_tool: Tool) -> None:
    compiler, package, apps = PORTS[port]
    require_tool(compiler, package=package)
    said = sure("make", "-C", copied, f"PORT={port}", f"CRC={TABLE}", "apps", PATH=without_python)
    assert programs(copied / "build") == apps
    assert "-Wconversion" in said
    assert "-Werror" in said
    assert TABLE in said
    again = sure("make", "-C", copied, f"PORT={port}", f"CRC={TABLE}", "apps", PATH=without_python)
    assert compiler not in again


@pytest.mark.parametrize("port", PORTS)
def test_cmake_needs_no_python(port: str, copied: Path, without_python: str, require_tool: Tool) -> None:
    compiler, package, apps = PORTS[port]
    require_tool(compiler, package=package)
    require_tool("cmake", package="cmake")
    build = copied / "build"
    sure("cmake", "-S", copied, "-B", build, f"-DPORT={port}", PATH=without_python)
    said = sure("cmake", "--build", build, "--verbose", PATH=without_python)
    assert programs(build) == apps
    assert "-Wconversion" in said
    assert "-Werror" in said
    assert " -c " not in sure("cmake", "--build", build, "--verbose", PATH=without_python)


def test_clang_builds_it_too(copied: Path, require_tool: Tool) -> None:
    clang = require_tool("clang", package="clang")
    sure("make", "-C", copied, f"CC={clang}", "PORT=posix", "apps")


def test_all_are_all_ports(copied: Path, require_tool: Tool) -> None:
    for compiler, package, _ in PORTS.values():
        require_tool(compiler, package=package)
    planned = sure("make", "-n", "-C", copied, "all")
    for port, (_, _, apps) in PORTS.items():
        for app in apps:
            assert f"-o build/{port}-{app}" in planned


def test_all_leaves_out_ports_without_a_compiler_and_tells(
    copied: Path, only_the_host: str, require_tool: Tool
) -> None:
    require_tool("cc", package="gcc")
    said = sure("make", "-C", copied, "all", PATH=only_the_host)
    assert programs(copied / "build") == {"qlink_node", "trio_keypad"}
    assert "make: atmega328p left out, no compiler avr-gcc: see atmega328p/README.md" in said
    for port in ("lm3s6965evb", "microbit"):
        assert f"make: {port} left out, no compiler arm-none-eabi-gcc: see {port}/README.md" in said


def test_all_fails_where_something_does_not_compile(
    copied: Path, only_the_host: str, require_tool: Tool
) -> None:
    require_tool("cc", package="gcc")
    with (copied / "posix" / "board.c").open("a") as file:
        file.write("#error broken\n")
    done = run("make", "-C", copied, "all", PATH=only_the_host)
    assert done.returncode != 0
    assert "#error broken" in done.stdout


def test_all_without_a_header_leaves_out_its_application(copied: Path, require_tool: Tool) -> None:
    require_tool("cc", package="gcc")
    require_tool("cmake", package="cmake")
    (copied / "trio.h").unlink()
    planned = sure("make", "-n", "-C", copied, "all")
    assert "build/posix-qlink_node" in planned
    assert "build/posix-trio_keypad" not in planned
    assert "make: trio_keypad on posix left out, no trio.h" in planned
    sure("cmake", "-S", copied, "-B", copied / "build")
    planned = sure("cmake", "--build", copied / "build", "--target", "help")
    assert "posix-qlink_node" in planned
    assert "posix-trio_keypad" not in planned


def test_in_the_repository_the_committed_headers_serve(tmp_path: Path) -> None:
    assert "-I../../generated/c" in sure("make", "-n", "-C", SOURCES, f"BUILD={tmp_path}", "CC=true")


def test_a_change_builds_anew_what_it_concerns(copied: Path, require_tool: Tool) -> None:
    require_tool("cc", package="gcc")
    make = ("make", "-C", copied)
    files = len([*(copied / "qlink_node").glob("*.c")]) + 1
    assert sure(*make, "CFLAGS=-O0").count(" -c ") == files
    assert " -c " not in sure(*make, "CFLAGS=-O0")
    assert sure(*make, "CFLAGS=-O0", "CPPFLAGS=-DNODE_FIFO=7").count(" -c ") == files
    (copied / "qlink_node" / "motor.c").touch()
    assert sure(*make, "CFLAGS=-O0", "CPPFLAGS=-DNODE_FIFO=7").count(" -c ") == 1
    (copied / "qlink.h").touch()
    assert sure(*make, "CFLAGS=-O0", "CPPFLAGS=-DNODE_FIFO=7").count(" -c ") > 1


OPTIONS = {
    "NUMBER": 7,
    "T1_TENTHS": 3,
    "T2_TENTHS": 255,
    "POSITION_TYPE": 2,
    "VERSION_MAJOR": 2,
    "VERSION_MINOR": 9,
    "PRODUCT": 65535,
    "SERIAL": 4294967295,
    "FIFO": 9,
    "STARTED": 1,
    "RATE": 0,
    "MOTOR_MS": 0,
}


def test_options_do_what_they_say(copied: Path, require_tool: Tool) -> None:
    require_tool("cc", package="gcc")
    flags = " ".join(f"-DNODE_{name}={value}" for name, value in OPTIONS.items())
    sure("make", "-C", copied, f"CPPFLAGS={flags}")
    with (
        Firmware("posix", copied / "build" / "posix-qlink_node") as firmware,
        Bus.open(firmware.path, slack=10.0, echo="none") as bus,
    ):
        node = bus.node(7)
        told = node.node_info()
        assert (told.version_major, told.version_minor, told.product_id) == (2, 9, 65535)
        assert (told.t1_delay, told.t2_delay, told.serial_number) == (0.3, 25.5, 4294967295)
        moving = node.motion(segments=[1, 2])
        assert (moving.fifo_space, moving.motor_status) == (7, 3)  # started, and words wait at rate 0
        node.motor_request(motor_data=b"\x7e\xd1\x07")  # no diagnostics: it goes to the motor
        assert node.motor_response_poll().motor_data == b"\x7e\xd1\x07"


def test_a_header_for_slaves_is_enough(copied: Path, tmp_path: Path, require_tool: Tool) -> None:
    require_tool("cc", package="gcc")
    folder = tmp_path / "made"
    sure(
        *QLINKGEN, "generate", "qlink", "--target", "c", "--role", "slave", "-o", folder, PYTHONPATH=str(ROOT)
    )
    (copied / "qlink.h").unlink()
    (copied / "trio.h").unlink()
    said = sure("make", "-C", copied, f"HEADERS={folder / 'c'}")
    assert f"-I{folder / 'c'}" in said


WRONG = {
    "port": ("", "PORT=moon: no moon/port.mk; ports: atmega328p ", ("PORT=moon",)),
    "app": ("", "APP=radio does not run on posix; applications: qlink_node trio_keypad", ("APP=radio",)),
    "app of another port": ("", "does not run on microbit", ("PORT=microbit", "APP=trio_keypad")),
    "header": ("", "no qlink.h: copy it next to this Makefile, or set HEADERS=folder", ("HEADERS=/nowhere",)),
    "no header at all": ("", "no qlink.h and no trio.h", ("all", "HEADERS=/nowhere")),
    "compiler": ("", "no compiler sdcc-of-old for posix: see posix/README.md", ("CC=sdcc-of-old",)),
    "long FIFO": ("cc gcc", "NODE_FIFO must be 1 to 255", ("CPPFLAGS=-DNODE_FIFO=256",)),
    "no FIFO": ("cc gcc", "NODE_FIFO must be 1 to 255", ("CPPFLAGS=-DNODE_FIFO=0",)),
    "program": ("cc gcc", "NODE_PROGRAM_SIZE must be", ("CPPFLAGS=-DNODE_PROGRAM_SIZE=65536",)),
    "baud": (
        "avr-gcc gcc-avr",
        "BOARD_BAUD cannot be made from F_CPU within 2 %",
        ("PORT=atmega328p", "F_CPU=16000000UL"),
    ),
    "crystal too slow": (
        "avr-gcc gcc-avr",
        "BOARD_BAUD cannot be made",
        ("PORT=atmega328p", "F_CPU=750000UL"),
    ),
    "crystal far too slow": (
        "avr-gcc gcc-avr",
        "BOARD_BAUD cannot be made",
        ("PORT=atmega328p", "F_CPU=400000UL"),
    ),
    "RAM": (
        "avr-gcc gcc-avr",
        "not within region `data'",
        ("PORT=atmega328p", "CPPFLAGS=-DNODE_PROGRAM_SIZE=1200"),
    ),
}


@pytest.mark.parametrize("case", WRONG)
def test_make_says_what_is_wrong(case: str, copied: Path, require_tool: Tool) -> None:
    needed, expected, arguments = WRONG[case]
    if needed:
        compiler, package = needed.split()
        require_tool(compiler, package=package)
    done = run("make", "-C", copied, *arguments)
    assert done.returncode != 0
    assert expected in done.stdout
    assert not programs(copied / "build")


@pytest.mark.parametrize(
    ("arguments", "expected"),
    [
        (("-DPORT=moon",), "PORT=moon: no moon/port.mk; ports:"),
        (("-DHEADERS=/nowhere",), "copy qlink.h next to CMakeLists.txt, or set -DHEADERS=folder"),
    ],
)
def test_cmake_says_what_is_wrong(
    arguments: tuple[str, ...], expected: str, copied: Path, require_tool: Tool
) -> None:
    require_tool("cmake", package="cmake")
    require_tool("cc", package="gcc")
    done = run("cmake", "-S", copied, "-B", copied / "build", *arguments)
    assert done.returncode != 0
    assert expected in " ".join(done.stdout.split())


def test_cmake_keeps_a_folder_to_one_port(copied: Path, require_tool: Tool) -> None:
    require_tool("cmake", package="cmake")
    require_tool("cc", package="gcc")
    configure = ("cmake", "-S", copied, "-B", copied / "build")
    sure(*configure)
    done = run(*configure, "-DPORT=microbit")
    assert done.returncode != 0
    said = " ".join(done.stdout.split())
    assert "PORT=microbit, but" in said
    assert "is configured for PORT=posix" in said
    assert "use another folder (-B), or delete this one" in said
    sure(*configure, "-DPORT=posix")


@pytest.mark.parametrize("baud", [9600, 19200])
@pytest.mark.parametrize("port", PORTS)
def test_slow_lines(port: str, baud: int, copied: Path, require_tool: Tool) -> None:
    compiler, package, apps = PORTS[port]
    require_tool(compiler, package=package)
    for app in apps:
        objects = f"build/{port}-{app}.o"
        goals = (f"{objects}/{port}/board.o", f"{objects}/{app}/main.o")
        sure("make", "-C", copied, f"PORT={port}", f"APP={app}", f"CPPFLAGS=-DBOARD_BAUD={baud}", *goals)


@pytest.mark.parametrize(
    ("crystal", "baud"),
    [("18432000UL", 2304000), ("14745600UL", 1843200), ("16000000UL", 38400), ("8000000UL", 1200)],
)
def test_rates_that_the_crystal_can_make(crystal: str, baud: int, copied: Path, require_tool: Tool) -> None:
    require_tool("avr-gcc", package="gcc-avr")
    board = "build/atmega328p-qlink_node.o/atmega328p/board.o"
    sure("make", "-C", copied, "PORT=atmega328p", f"F_CPU={crystal}", f"CPPFLAGS=-DBOARD_BAUD={baud}", board)
