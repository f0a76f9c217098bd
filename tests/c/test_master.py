"""The master in C: what there is of it, that it compiles, and many transactions on a bad line.

What it does on a line is in tests/bus: the behaviours of every bus, also tried on the master in C.
"""

from __future__ import annotations

import re
from collections.abc import Callable
from pathlib import Path

import pytest

from qlinkgen.backends.base import Options
from qlinkgen.backends.c import master
from qlinkgen.errors import GenerationError
from tests.c.conftest import protocol_of
from tests.c.test_compile import (
    HOSTS,
    LANGUAGES,
    TARGETS,
    compile_only,
    header,
    includes,
    language_flags,
    run,
)
from tests.conformance import emulators, kits

PROTOCOLS = ("qlink", "modbus_rtu")
SOAK = Path(__file__).parent / "programs" / "master_soak.c"
HOST_MAIN = """
#include <stdio.h>
void conformance_put(char character);
int qlink_conformance(void);
void conformance_put(char character) { putchar(character); }
int main(void) { return qlink_conformance(); }
"""
SANITIZED = ("-O1", "-g", "-fsanitize=address,undefined", "-fno-sanitize-recover=all")


def write(name: str, folder: Path, options: Options | None = None) -> str:
    """Write the header of a master, and that of its codec; return the former."""
    header(name, folder, options)
    (text,) = master.generate(protocol_of(name), options or Options()).values()
    (folder / f"{name}_master.h").write_text(text, "utf-8")
    return text


@pytest.mark.parametrize("language", LANGUAGES)
@pytest.mark.parametrize("compiler", HOSTS)
@pytest.mark.parametrize("name", PROTOCOLS)
def test_hosts(
    name: str, compiler: str, language: str, tmp_path: Path, require_tool: Callable[..., str]
) -> None:
    program = require_tool(compiler, package=compiler)
    write(name, tmp_path)
    compile_only(program, *language_flags(language), "-O1", includes(f"{name}_master", tmp_path))


@pytest.mark.parametrize("target", TARGETS)
def test_targets(target: tuple[str, ...], tmp_path: Path, require_tool: Callable[..., str]) -> None:
    program = require_tool(target[0], package=target[1])
    write("modbus_rtu", tmp_path, Options(role="master"))
    compile_only(program, *target[2:], "-std=c99", "-Os", includes("modbus_rtu_master", tmp_path))


@pytest.mark.parametrize(
    ("name", "options", "reason"),
    [
        ("trio", Options(), "the schema has no commands; add them, or use the codec header alone"),
        ("mc1231a", Options(), "packets are split by their requests; use the functions of the codec header"),
        ("qlink", Options(role="slave"), "role slave leaves it out; use --role both or --role master"),
    ],
)
def test_where_there_is_none_the_reason_is_told(name: str, options: Options, reason: str) -> None:
    with pytest.raises(GenerationError, match=re.escape(f"{name}.yaml: no master in C: {reason}")):
        master.generate(protocol_of(name), options)


def soak(
    folder: Path, compiler: str, transactions: int, change: tuple[str, str] | None = None
) -> kits.Report:
    """The report of so many transactions on this machine, perhaps with a fault in the master."""
    text = write("qlink", folder)
    if change is not None:
        assert change[0] in text
        (folder / "qlink_master.h").write_text(text.replace(*change), "utf-8")
    (folder / "main.c").write_text(HOST_MAIN)
    flags = ("-std=c99", *SANITIZED, f"-DTRANSACTIONS={transactions}UL", "-I", folder)
    run(compiler, *flags, SOAK, folder / "main.c", "-o", folder / "soak")
    return kits.ran(folder / "soak")


def test_no_wrong_answer_on_a_bad_line(tmp_path: Path, require_tool: Callable[..., str]) -> None:
    """A hundred thousand transactions with faults in 5 % of the transmissions of both sides."""
    report = soak(tmp_path, require_tool("gcc", package="gcc"), 100_000)
    assert (report.status, report.planned, report.failed) == (0, 5, ())


def test_no_wrong_answer_on_a_cortex_m0(tmp_path: Path, require_tool: Callable[..., str]) -> None:
    """Twenty thousand transactions, of code for a Cortex-M0."""
    write("qlink", tmp_path)
    flags = (f"-I{tmp_path}", "-mcpu=cortex-m0", "-DTRANSACTIONS=20000UL")
    report = emulators.cortex_m3("qlink", SOAK, tmp_path, require_tool, "-Os", *flags)
    assert (report.status, report.planned, report.failed) == (0, 5, ())


FAULTS = {
    "no quiet line before a repeat": ("    bus->suspect = true;", "    bus->suspect = false;"),
    "answers of any node": ("return (frame->node == job->node)", "return true || (frame->node == job->node)"),
    "no look at the deadline": ("qlink_reached_(now, bus->deadline)", "(now == 7U)"),
    "a request that ends before the line is free": (
        "bus->free_at = now + on_wire + after;",
        "bus->free_at = now;",
    ),
}


@pytest.mark.parametrize("fault", FAULTS)
def test_the_soak_notices(fault: str, tmp_path: Path, require_tool: Callable[..., str]) -> None:
    report = soak(tmp_path, require_tool("gcc", package="gcc"), 20_000, FAULTS[fault])
    assert report.failed
