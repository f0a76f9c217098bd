"""Every 16-bit algorithm of the catalogue, in every form, gives its check value."""

from __future__ import annotations

import subprocess
from collections.abc import Callable
from pathlib import Path

import pytest

from qlinkgen.backends import c
from qlinkgen.backends.base import Options
from qlinkgen.backends.c.names import storage
from qlinkgen.model.checksum import SUMS, Algorithm, catalogue, find, stated
from qlinkgen.schema import loads
from tests.c.test_compile import header, run
from tests.support.cdriver import Driver, build

PROGRAM = """
#include "qlink.h"
#include <stdio.h>
int main(void)
{
    const uint8_t digits[] = {'1', '2', '3', '4', '5', '6', '7', '8', '9'};
    uint16_t value = qlink_check_start();
    for (unsigned index = 0; index < 9u; ++index) { value = qlink_check_update(value, digits[index]); }
    printf("%04x", (unsigned)qlink_check_finish(value));
    return 0;
}
"""
GENERATED = find("crc-16/ibm-3740")


def macro(algorithm: Algorithm) -> str:
    return "QLINK_" + algorithm.name.upper().replace("/", "_").replace("-", "_")


def compiled(tmp_path: Path, compiler: str, algorithm: str, form: str) -> subprocess.CompletedProcess[str]:
    (tmp_path / "check.c").write_text(PROGRAM)
    flags = ["-std=c99", "-Wall", "-Wextra", "-Wconversion", "-Wundef", "-Werror", f"-DQLINK_CRC={algorithm}"]
    command = [
        compiler,
        *flags,
        *([f"-DQLINK_CRC_FORM=QLINK_CRC_FORM_{form}"] if form else []),
        str(tmp_path / "check.c"),
        "-o",
        str(tmp_path / "check"),
    ]
    return subprocess.run(command, capture_output=True, text=True, timeout=120, check=False)


@pytest.mark.parametrize("form", ["", "LOOP", "NIBBLE", "TABLE", "FOLD"])
def test_check_values(form: str, tmp_path: Path, require_tool: Callable[..., str]) -> None:
    compiler = require_tool("gcc", package="gcc")
    assert isinstance(GENERATED, Algorithm)
    header("qlink", tmp_path)
    assert len(catalogue(16)) == 31
    for algorithm in catalogue(16):
        done = compiled(tmp_path, compiler, macro(algorithm), form)
        if form == "TABLE" and (algorithm.poly, algorithm.refin) != (GENERATED.poly, GENERATED.refin):
            assert done.returncode != 0
            assert "select QLINK_CRC_FORM_NIBBLE, or generate with --set crc=NAME" in done.stderr
            continue
        if form == "FOLD" and algorithm.poly != 0x1021:
            assert done.returncode != 0
            assert "select QLINK_CRC_FORM_NIBBLE" in done.stderr
            continue
        assert done.returncode == 0, done.stderr
        assert run(tmp_path / "check") == f"{algorithm.check:04x}", algorithm.name


@pytest.mark.parametrize("choice", ["BOGUS", "QLINK_CRC_16_XMODEMM", "", "1", "0x1021u"])
@pytest.mark.parametrize("tool", ["gcc", "clang"])
def test_an_unknown_algorithm_is_named(
    tool: str, choice: str, tmp_path: Path, require_tool: Callable[..., str]
) -> None:
    header("qlink", tmp_path)
    done = compiled(tmp_path, require_tool(tool, package=tool), choice, "NIBBLE")
    assert done.returncode != 0
    errors = [line for line in done.stderr.splitlines() if "error:" in line]
    assert len(errors) == 1, done.stderr
    assert "QLINK_CRC is neither an algorithm of this header, such as QLINK_CRC_16_IBM_3740," in errors[0]


def test_an_algorithm_of_ones_own(tmp_path: Path, require_tool: Callable[..., str]) -> None:
    compiler = require_tool("gcc", package="gcc")
    header("qlink", tmp_path)
    done = compiled(tmp_path, compiler, "(0x8005u, 0xFFFFu, 1, 0x0000u)", "NIBBLE")
    assert done.returncode == 0, done.stderr
    assert run(tmp_path / "check") == "4b37"


SUM = """\
qlinkgen: 1
protocol: {name: tank, title: Tank, revision: "1", source: Example, doc: A tank}
frame:
  parts:
    start: AA
    code: {role: message, type: u8}
    length: {type: u8, counts: [data]}
    data: {role: payload, size: 0..8}
    check: {type: u@width@, algorithm: @algorithm@, over: [data]}
bus: {kind: master_slave}
messages:
  log: {id: 1, fields: {note: "bytes[0..8]"}}
"""
OTHERS = {
    **{each.name: each for each in SUMS},
    "{width: 16, poly: 0x8005, init: 0x1234, refin: true, refout: false, xorout: 0x55AA}": stated(
        16, 0x8005, 0x1234, refin=True, refout=False, xorout=0x55AA
    ),
    "{width: 24, poly: 0x5D6DCB, refout: true}": stated(24, 0x5D6DCB, 0, refin=False, refout=True, xorout=0),
    "{width: 8, poly: 0x2F, init: 0x11}": stated(8, 0x2F, 0x11, refin=False, refout=False, xorout=0),
}


@pytest.mark.parametrize("text", OTHERS)
def test_sums_and_crcs_by_their_parameters(
    text: str, tmp_path: Path, require_tool: Callable[..., str]
) -> None:
    compiler = require_tool("gcc", package="gcc")
    algorithm = OTHERS[text]
    schema = SUM.replace("@width@", str(algorithm.width)).replace("@algorithm@", text)
    protocol, faults = loads(schema, "tank.yaml")
    assert protocol, faults
    (tmp_path / "tank.h").write_text(c.generate(protocol, Options())["c/tank.h"])
    program = PROGRAM.replace("qlink", "tank").replace(
        "uint16_t", f"uint{max(8, storage(algorithm.width))}_t"
    )
    program = program.replace('"%04x", (unsigned)', '"%08lx", (unsigned long)')
    (tmp_path / "check.c").write_text(program)
    flags = ["-std=c99", "-Wall", "-Wextra", "-Wconversion", "-Werror"]
    command = [compiler, *flags, str(tmp_path / "check.c"), "-o", str(tmp_path / "check")]
    subprocess.run(command, check=True, timeout=120)
    assert run(tmp_path / "check") == f"{algorithm.check:08x}"


KINDS = """\
qlinkgen: 1
protocol: {name: tank, title: Tank, revision: "1", source: Example, doc: A tank}
frames:
  blocks:
    parts:
      start: 05 64
      length: {type: u8, counts: data}
      code: {role: message, type: u8}
      data: {role: payload, size: 0..40}
      sums: {type: u8, algorithm: sum8, over: [data], every: 16 bytes}
  whole:
    parts:
      start: 55 FF
      length: {type: u8, counts: data}
      code: {role: message, type: u8}
      data: {role: payload, size: 0..40}
      crc: {type: u16, algorithm: crc-16/modbus, over: [length, code, data]}
bus: {kind: master_slave}
messages:
  log: {frame: blocks, id: 1, direction: request, fields: {note: "bytes[0..40]"}}
  state: {frame: whole, id: 2, direction: request, fields: {level: u16}}
"""


def test_the_main_algorithm_of_kinds_is_that_of_a_whole_frame(
    tmp_path: Path, require_tool: Callable[..., str]
) -> None:
    """It is the one with functions for programs, also where the first kind has values of blocks alone."""
    protocol, faults = loads(KINDS, "tank.yaml")
    assert protocol is not None, faults
    with Driver(build(protocol, tmp_path, require_tool("gcc", package="gcc"))) as driver:
        assert driver.ask("check", b"123456789".hex()) == f"ok {0x4B37}"
