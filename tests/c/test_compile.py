"""Every header compiles without warnings with every compiler, in every form, for every kind of target."""

from __future__ import annotations

import subprocess
from collections.abc import Callable
from pathlib import Path
from typing import Literal

import pytest

from qlinkgen.backends import c
from qlinkgen.backends.base import Options
from tests.c.conftest import PROTOCOLS, protocol_of
from tests.support.cdriver import WARNINGS

ROLES: tuple[Literal["both", "master", "slave"], ...] = ("both", "slave", "master")
HOSTS = ["gcc", "clang"]
LANGUAGES = ["c99", "c11", "c++17"]
ARM = ("arm-none-eabi-gcc", "gcc-arm-none-eabi", "-mthumb")
TARGETS = [
    pytest.param(("avr-gcc", "gcc-avr", "-mmcu=atmega328p"), id="avr"),
    pytest.param((*ARM, "-mcpu=cortex-m0"), id="cortex-m0"),
    pytest.param((*ARM, "-mcpu=cortex-m3"), id="cortex-m3"),
    pytest.param(("s390x-linux-gnu-gcc", "gcc-s390x-linux-gnu"), id="s390x"),
]


def forms(name: str) -> list[list[str]]:
    upper = name.upper()
    everything = [f"-D{upper}_ENABLE_FLOAT=1", f"-D{upper}_ENABLE_NAMES=1"]
    return [
        [],
        [f"-D{upper}_CRC_FORM={upper}_CRC_FORM_NIBBLE", *everything],
        [f"-D{upper}_CRC_FORM={upper}_CRC_FORM_TABLE"],
        [f"-D{upper}_CRC_FORM={upper}_CRC_FORM_LOOP"],
    ]


def header(name: str, folder: Path, options: Options | None = None) -> str:
    (text,) = c.generate(protocol_of(name), options or Options()).values()
    (folder / f"{name}.h").write_text(text, "utf-8")
    return text


def run(*command: str | Path) -> str:
    done = subprocess.run(
        [str(word) for word in command], capture_output=True, text=True, timeout=300, check=False
    )
    assert done.returncode == 0, done.stderr[:4000]
    return done.stdout


def includes(name: str, folder: Path, times: int = 2) -> Path:
    file = folder / f"use_{name}.c"
    file.write_text(f'#include "{name}.h"\n' * times + "int used(void);\nint used(void) { return 0; }\n")
    return file


def compile_only(*command: str | Path) -> None:
    run(*command, *WARNINGS, "-o", "/dev/null", "-c")


def language_flags(language: str) -> tuple[str, ...]:
    return ("-x", "c++" if "++" in language else "c", f"-std={language}")


@pytest.mark.parametrize("language", LANGUAGES)
@pytest.mark.parametrize("compiler", HOSTS)
@pytest.mark.parametrize("name", PROTOCOLS)
def test_hosts(
    name: str, compiler: str, language: str, tmp_path: Path, require_tool: Callable[..., str]
) -> None:
    program = require_tool(compiler, package=compiler)
    header(name, tmp_path)
    file = includes(name, tmp_path)
    for defines in forms(name):
        compile_only(program, *language_flags(language), "-O1", *defines, file)


@pytest.mark.parametrize("target", TARGETS)
@pytest.mark.parametrize("name", PROTOCOLS)
def test_targets(
    name: str, target: tuple[str, ...], tmp_path: Path, require_tool: Callable[..., str]
) -> None:
    compiler, package, *flags = target
    program = require_tool(compiler, package=package)
    header(name, tmp_path)
    file = includes(name, tmp_path)
    for defines in forms(name):
        compile_only(program, *flags, "-std=c99", "-Os", *defines, file)


@pytest.mark.parametrize("role", ["master", "slave"])
@pytest.mark.parametrize("name", PROTOCOLS)
def test_roles(
    name: str, role: Literal["master", "slave"], tmp_path: Path, require_tool: Callable[..., str]
) -> None:
    program = require_tool("gcc", package="gcc")
    text = header(name, tmp_path, Options(role=role))
    compile_only(program, "-std=c99", "-O1", includes(name, tmp_path))
    if protocol_of(name).directions == ("request", "response"):
        assert ("_slave_dispatch(" in text) == (role == "slave")
    for message in protocol_of(name).messages:
        sent = {"request": "master", "response": "slave", "message": role}[message.direction] == role
        assert (
            f"{name}_{message.name.replace('.', '_')}_to_frame(" in text or message.name == "keypad_mode"
        ) == sent


def test_only_selected_messages(tmp_path: Path, require_tool: Callable[..., str]) -> None:
    program = require_tool("gcc", package="gcc")
    text = header("qlink", tmp_path, Options(role="slave", only=("motion", "node_start")))
    compile_only(program, "-std=c99", "-O1", includes("qlink", tmp_path))
    assert "qlink_motion_request_decode(" in text
    assert "qlink_motion_request_encode(" not in text
    assert "loop_back" not in text


@pytest.mark.parametrize("language", LANGUAGES)
@pytest.mark.parametrize("name", PROTOCOLS)
def test_the_example_compiles(
    name: str, language: str, tmp_path: Path, require_tool: Callable[..., str]
) -> None:
    program, example = require_tool("gcc", package="gcc"), tmp_path / "example.c"
    for role in ROLES:
        text = header(name, tmp_path, Options(role=role))
        comment = text[text.index("Example:") : text.index("*/")].splitlines()[2:]
        example.write_text("\n".join(line.removeprefix(" *").removeprefix(" ") for line in comment) + "\n")
        compile_only(program, *language_flags(language), example)


TABLE_USER = """
#define QLINK_CRC_FORM QLINK_CRC_FORM_TABLE
#define QLINK_CRC_SHARED_TABLE
#include "qlink.h"
uint16_t check_@(uint8_t byte);
uint16_t check_@(uint8_t byte) { return qlink_check_update(qlink_check_start(), byte); }
"""


def test_two_files_of_one_program_share_a_table(tmp_path: Path, require_tool: Callable[..., str]) -> None:
    program = require_tool("gcc", package="gcc")
    header("qlink", tmp_path)
    (tmp_path / "a.c").write_text("#define QLINK_CRC_DEFINE_TABLE" + TABLE_USER.replace("@", "a"))
    (tmp_path / "b.c").write_text(TABLE_USER.replace("@", "b"))
    declared = "unsigned short check_a(unsigned char); unsigned short check_b(unsigned char);\n"
    (tmp_path / "main.c").write_text(declared + "int main(void) { return check_a(7) != check_b(7); }\n")
    files = [tmp_path / f"{name}.c" for name in ("a", "b", "main")]
    run(program, "-std=c99", *WARNINGS, *files, "-o", tmp_path / "program")
    run(tmp_path / "program")
    assert run("nm", tmp_path / "program").count("qlink_crc_table") == 1


RECEIVER_USER = """
#include "qlink.h"
int use(qlink_receiver_t *receiver);
int use(qlink_receiver_t *receiver) { return qlink_receive(receiver, 1); }
"""


def test_no_table_is_emitted_unless_chosen(tmp_path: Path, require_tool: Callable[..., str]) -> None:
    program, use = require_tool("gcc", package="gcc"), tmp_path / "use.c"
    header("qlink", tmp_path)
    use.write_text(RECEIVER_USER)
    for form, tables in (("LOOP", 0), ("NIBBLE", 1), ("TABLE", 1)):
        define = f"-DQLINK_CRC_FORM=QLINK_CRC_FORM_{form}"
        run(program, "-std=c99", "-O1", define, "-c", use, "-o", tmp_path / "use.o")
        assert run("nm", tmp_path / "use.o").count("crc_table") == tables
