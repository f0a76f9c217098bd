"""Options for firmware: handlers in flash, commands left out, interrupt and main loop apart, SDCC."""

from __future__ import annotations

import re
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import pytest

from qlinkgen.backends import c
from qlinkgen.backends.base import Options
from qlinkgen.backends.c.stamp import stamps
from tests.c.conftest import protocol_of
from tests.c.test_compile import ARM, compile_only, header, run
from tests.c.test_dispatch import PROGRAMS, SANITIZED
from tests.support.cdriver import WARNINGS

CONST = "-DQLINK_CONST_HANDLERS=1"


@pytest.mark.parametrize("define", ["-DQLINK_CONST_HANDLERS=0", CONST])
def test_options_of_a_slave(define: str, tmp_path: Path, require_tool: Callable[..., str]) -> None:
    compiler, program = require_tool("gcc", package="gcc"), tmp_path / "test"
    header("qlink", tmp_path)
    source = PROGRAMS / "options_qlink.c"
    run(compiler, "-std=c99", "-g", define, *WARNINGS, *SANITIZED, "-I", tmp_path, source, "-o", program)
    run(program)


HANDLERS = """
#include "qlink.h"
static bool on_reset(qlink_slave_t *slave) { return slave->node != 0U; }
#if QLINK_CONST_HANDLERS
static const qlink_slave_handlers_t table QLINK_HANDLERS_STORAGE = { .node_reset = on_reset };
qlink_slave_t slave = { .node = 1U, .handlers = &table };
#else
qlink_slave_t slave = { .node = 1U, .node_reset = on_reset };
#endif
size_t handle(const qlink_frame_t *frame, uint8_t *wire);
size_t handle(const qlink_frame_t *frame, uint8_t *wire)
{
    return qlink_slave_dispatch(&slave, frame, wire, QLINK_MAX_WIRE_SIZE);
}
"""
SIZES = re.compile(r"^ *(\d+)\t *(\d+)\t *(\d+)\t", re.MULTILINE)


@pytest.mark.parametrize(
    "target",
    [
        pytest.param(("avr-gcc", "gcc-avr", "-mmcu=atmega328p"), id="avr"),
        pytest.param((*ARM, "-mcpu=cortex-m0"), id="cortex-m0"),
    ],
)
def test_const_handlers_leave_ram_and_left_out_commands_leave_flash(
    target: tuple[str, ...], tmp_path: Path, require_tool: Callable[..., str]
) -> None:
    compiler, package, *flags = target
    program, size_of = require_tool(compiler, package=package), compiler.replace("-gcc", "-size")
    header("qlink", tmp_path)
    (tmp_path / "use.c").write_text(HANDLERS)
    left_out = [f"-DQLINK_WITHOUT_{each}" for each in ("MOTION", "LOOP_BACK", "READ", "WRITE", "WRITE_READ")]
    found = []
    for defines in ([], [CONST], [CONST, *left_out]):
        made = tmp_path / "use.o"
        compile_only(program, *flags, "-std=c99", "-Os", *defines, tmp_path / "use.c")
        run(program, *flags, "-std=c99", "-Os", *defines, "-c", tmp_path / "use.c", "-o", made)
        (sizes,) = SIZES.findall(run(size_of, made))
        found.append([int(each) for each in sizes])
    (plain_text, *plain_ram), (const_text, *const_ram), (least_text, *_) = found
    assert sum(const_ram) < 20 < sum(plain_ram)
    assert least_text < const_text - 300
    assert const_text < plain_text + 450  # the table has moved there, and is read on AVR by its instruction


def test_a_command_that_is_left_out_is_rejected_like_one_without_a_function(
    tmp_path: Path, require_tool: Callable[..., str]
) -> None:
    """In MC1231A a slave answers an unknown command with zeros."""
    compiler = require_tool("gcc", package="gcc")
    header("mc1231a", tmp_path)
    (tmp_path / "use.c").write_text(
        '#include "mc1231a.h"\n'
        "int main(void)\n{\n"
        "    static mc1231a_slave_t slave;\n"
        "    uint8_t wire[MC1231A_MAX_WIRE_SIZE];\n"
        "    const mc1231a_frame_t frame = { .id = MC1231A_GET_VRSN_REQUEST_ID, "
        ".size = 0U, .payload = wire };\n"
        "    return (int)mc1231a_slave_dispatch(&slave, &frame, wire, sizeof wire);\n}\n"
    )
    answers = []
    for define in ("-DPLAIN", "-DMC1231A_WITHOUT_GET_VRSN"):
        run(compiler, "-std=c99", *WARNINGS, define, tmp_path / "use.c", "-o", tmp_path / "use")
        answers.append(run("sh", "-c", f"{tmp_path / 'use'}; echo $?"))
    assert answers[0] == answers[1] != "0\n"


def test_sdcc_compiles_a_slave_and_a_listener(tmp_path: Path, require_tool: Callable[..., str]) -> None:
    """For STM8; SDCC keeps unused functions, so a header for it has the messages in use alone."""
    program = require_tool("sdcc", package="sdcc")
    (slave,) = c.generate(protocol_of("qlink"), Options(role="slave", only=("motion", "node_sync"))).values()
    (tmp_path / "qlink.h").write_text(slave)
    header("trio", tmp_path)
    for name in ("qlink", "trio"):
        use = tmp_path / f"use_{name}.c"
        use.write_text(f'#include "{name}.h"\nint main(void) {{ return 0; }}\n')
        quiet = ("--disable-warning", "110", "--disable-warning", "126")  # on constant conditions
        made = tmp_path / f"{name}.rel"
        run(program, "-mstm8", "--std-c99", "--Werror", *quiet, "-I", tmp_path, "-c", use, "-o", made)
        assert made.stat().st_size > 0


def test_text_of_a_schema_stays_in_its_string() -> None:
    found = dict(stamps(replace(protocol_of("qlink"), revision='1"\\ ?/*é')))
    assert found["SCHEMA_REVISION"] == '"1\\042\\134 \\077\\057\\052\\303\\251"'
    assert re.fullmatch("0x[0-9A-F]{8}UL", found["SCHEMA_HASH"])
