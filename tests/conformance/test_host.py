"""The kit on the host: it contains every vector, and all tests pass."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Callable
from pathlib import Path
from typing import Literal

import pytest

from qlinkgen.backends.base import Options
from qlinkgen.backends.conformance import streams
from qlinkgen.model.frame import PacketFrame
from qlinkgen.model.message import Direction, Message
from qlinkgen.plan import Plan, plan_of
from tests.conformance import kits
from tests.conformance.conftest import Write
from tests.proof import cases

#: The sanitizer stops the program at undefined behaviour; three kinds of frame have addresses checked.
UNDEFINED = ("-O0", "-std=c11", "-fsanitize=undefined", "-fno-sanitize-recover=all")
ADDRESSES = (*UNDEFINED, "-fsanitize=address")
RUNS = [
    *(
        pytest.param(name, "clang", ADDRESSES, id=f"{name}-addresses")
        for name in ("qlink", "trio", "dynamixel")
    ),
    *(pytest.param(name, "clang", UNDEFINED, id=name) for name in ("mc1231a", "modbus_rtu", "kitchen_sink")),
    pytest.param("qlink", "gcc", ("-O0", "-std=c99"), id="qlink-gcc"),
    pytest.param("trio", "gcc", ("-O1", "-std=c99"), id="trio-gcc"),
    pytest.param("trio", "g++", ("-O0", "-std=c++17"), id="trio-g++"),
    pytest.param("modbus_rtu", "clang++", ("-O0", "-std=c++17"), id="modbus_rtu-clang++"),
]


def direction_of(plan: Plan, message: Message) -> Direction:
    """The direction in which a message is received."""
    return plan.direction_of(plan.message(message.name))


def vectors_of(name: str) -> Counter[str]:
    """The expected number of tests of each verb, counted from the vectors."""
    protocol, good, wrong = cases.protocol(name), cases.cases(name), cases.refusals(name)
    packets = isinstance(protocol.frame, PacketFrame)
    ring = protocol.directions == ("message",)
    counts: Counter[str] = Counter()
    counts["encode"] = sum(not case.decode_only for case in good)
    counts["decode"] = len(good) + len(wrong)
    plan = plan_of(protocol)
    heard = [case.message for case in good]
    heard += [
        each.message for each in wrong if streams.fed(plan, direction_of(plan, each.message), each.wire)
    ]
    counts["receive"] = sum(not (packets and message.direction == "response") for message in heard)
    out_of_range = [row.message for row in wrong if row.kind == "range"]
    asked = [case.message for case in good if case.kinds] + out_of_range
    counts["ask"] = 0 if ring else sum(message.direction != "response" for message in asked)
    told = [case.message for case in good] + out_of_range
    counts["tell"] = 0 if packets else sum(message.direction != "request" for message in told)
    return +counts


def test_the_vectors_are_counted_from_somewhere() -> None:
    assert vectors_of("qlink")["encode"] > 200
    assert set(vectors_of("qlink")) == {"encode", "decode", "receive", "ask", "tell"}
    assert set(vectors_of("trio")) == {"encode", "decode", "receive", "tell"}
    assert set(vectors_of("mc1231a")) == {"encode", "decode", "receive", "ask"}


@pytest.mark.parametrize(("name", "compiler", "flags"), RUNS)
def test_every_vector_is_there_and_fine(
    name: str,
    compiler: str,
    flags: tuple[str, ...],
    *,
    kit: Write,
    tmp_path: Path,
    require_tool: Callable[..., str],
) -> None:
    program = require_tool(compiler, package=compiler.replace("clang++", "clang"))
    language = ("-x", "c++") if compiler.endswith("++") else ()
    report = kits.ran(kits.compiled(tmp_path / "kit", program, *flags, kits.STDIO, *language, kit(name)))
    report.check()
    check_values = [each for each in report.names if each.startswith("check value ")]
    assert len(check_values) == (name != "mc1231a")
    counted = report.by_verb
    for line in check_values:
        counted[line.rsplit(" ", 1)[1]] -= 1
    del counted["refuse"]  # of values that no vector has
    assert +counted == vectors_of(name)
    assert {each.split(" ")[0] for each in report.names} - {"check"} == {
        message.name for message in cases.protocol(name).messages
    }


def test_in_another_form_of_the_header(kit: Write, tmp_path: Path, require_tool: Callable[..., str]) -> None:
    options = ["-DTRIO_CRC_FORM=TRIO_CRC_FORM_TABLE", "-DTRIO_ENABLE_FLOAT=1", "-DTRIO_ENABLE_NAMES=1"]
    program = require_tool("gcc", package="gcc")
    kits.ran(kits.compiled(tmp_path / "kit", program, "-std=c99", *options, kits.STDIO, kit("trio"))).check()


def test_parts_are_the_whole(kit: Write, tmp_path: Path, require_tool: Callable[..., str]) -> None:
    """Without a response no test is lost; tests of a response need its request in the same part."""
    program = require_tool("clang", package="clang")
    names = [message.name for message in cases.protocol("modbus_rtu").messages]
    for end, lost in (("read_input_registers.response", set()), ("read_input_registers.request", {"ask"})):
        found: Counter[str] = Counter()
        cut = names.index(end)
        for first, last in ((0, cut), (cut + 1, len(names) - 1)):
            part = (f"-DCONFORMANCE_FIRST={first}", f"-DCONFORMANCE_LAST={last}")
            file = kits.compiled(tmp_path / "kit", program, "-std=c99", *part, kits.STDIO, kit("modbus_rtu"))
            report = kits.ran(file)
            report.check()
            found += report.by_verb
        assert set(vectors_of("modbus_rtu") - found) == lost


def test_dispatching_can_be_left_out(kit: Write, tmp_path: Path, require_tool: Callable[..., str]) -> None:
    program = require_tool("clang", package="clang")
    options = ("-std=c99", "-DCONFORMANCE_DISPATCH=0", kits.STDIO)
    report = kits.ran(kits.compiled(tmp_path / "kit", program, *options, kit("modbus_rtu")))
    report.check()
    assert set(report.by_verb) >= {"encode", "decode", "receive"}
    assert not {"ask", "tell"} & set(report.by_verb)


def test_an_unknown_part_is_refused(kit: Write, require_tool: Callable[..., str]) -> None:
    with pytest.raises(AssertionError, match=r"must be messages of 0\.\.34"):
        kits.compiled(
            Path("/dev/null"), require_tool("gcc", package="gcc"), "-DCONFORMANCE_LAST=35", kit("qlink")
        )


@pytest.mark.parametrize("role", ["slave", "master"])
@pytest.mark.parametrize("name", ["modbus_rtu", "mc1231a"])
def test_a_role_has_the_vectors_of_its_side(
    name: str, role: Literal["slave", "master"], tmp_path: Path, require_tool: Callable[..., str]
) -> None:
    program = require_tool("clang", package="clang")
    only = ("set_pos", "get_pos", "update") if name == "mc1231a" else ()
    file = kits.write(name, tmp_path, Options(role=role, only=only))
    report = kits.ran(kits.compiled(tmp_path / "kit", program, "-std=c99", kits.STDIO, file))
    report.check()
    messages = [m for m in cases.protocol(name).messages if not only or m.command in only]
    sent, heard = ("response", "request") if role == "slave" else ("request", "response")
    for verb, direction in (("encode", sent), ("decode", heard)):
        found = {each.split(" ")[0] for each in report.names if each.endswith(f" {verb}")}
        assert found == {message.name for message in messages if message.direction == direction}
    assert ("ask" in report.by_verb) == (role == "slave")
    assert ("tell" in report.by_verb) == (role == "master" and name != "mc1231a")


def test_messages_left_out_have_no_vectors(tmp_path: Path, require_tool: Callable[..., str]) -> None:
    file = kits.write("qlink", tmp_path, Options(role="slave", only=("motion", "node_start")))
    program = require_tool("gcc", package="gcc")
    report = kits.ran(kits.compiled(tmp_path / "kit", program, "-std=c99", kits.STDIO, file))
    report.check()
    names = {"motion.request", "motion.response", "node_start.request"}
    assert {each.split(" ")[0] for each in report.names} - {"check"} == names
    assert set(re.findall(r"^/\* [0-9]+: (\S+) \*/$", file.read_text(), re.MULTILINE)) == names


def test_it_needs_nothing_but_the_header(
    kit: Write, tmp_path: Path, require_tool: Callable[..., str]
) -> None:
    """Functions that the compiler calls do not count as a library."""
    gcc, nm = require_tool("gcc", package="gcc"), require_tool("nm", package="binutils")
    for name in cases.SHIPPED:
        text = kit(name).read_text()
        included = re.findall(r"^#include (\S+)", text, re.MULTILINE)
        assert included == [f'"{name}.h"', "<avr/pgmspace.h>", "<stdio.h>"]
    kits.compiled(tmp_path / "kit.o", gcc, "-std=c99", "-Os", "-ffreestanding", "-c", kit("trio"))
    missing = set(re.findall(r"U (\S+)", kits.output(nm, "-u", tmp_path / "kit.o")))
    assert missing - {"_GLOBAL_OFFSET_TABLE_", "__stack_chk_fail"} <= {"conformance_put", "memcpy", "memset"}
    assert "conformance_put" in missing


def test_it_can_be_called(kit: Write, tmp_path: Path, require_tool: Callable[..., str]) -> None:
    """Two kits in one program, whose main calls each of them twice."""
    user = tmp_path / "user.c"
    user.write_text(
        "#include <stdio.h>\nvoid conformance_put(char character);\nint trio_conformance(void);\n"
        "int modbus_rtu_conformance(void);\n"
        "void conformance_put(char character) { (void)putchar(character); }\n"
        "int main(void) { int first = trio_conformance(); (void)modbus_rtu_conformance();\n"
        "    return first + trio_conformance(); }\n"
    )
    files = [user, kit("trio"), kit("modbus_rtu")]
    program = require_tool("clang", package="clang")
    kits.compiled(tmp_path / "kits", program, "-std=c99", "-DCONFORMANCE_MAIN=0", *files)
    text = kits.output(tmp_path / "kits")
    first, second, third = ("TAP version 14" + part for part in text.split("TAP version 14")[1:])
    assert first == third
    for part in (first, second):
        report = kits.report(int("\nnot ok" in part), part)
        report.check()
