"""The same bytes on a big-endian machine; size, stack and time on small ones, and the page about them."""

from __future__ import annotations

import random
from collections.abc import Callable
from pathlib import Path
from typing import NoReturn

import pytest

from benchmarks.firmware_answers import replies, requests
from benchmarks.firmware_budget import (
    answer_goal,
    broken,
    complaints,
    core_goals,
    each_message,
    receiver_goal,
)
from benchmarks.firmware_build import AVR, CORTEX_M0, HEADERS, TARGETS, Target, Workshop
from benchmarks.firmware_cycles import SIMAVR, build_simulator, frame
from benchmarks.firmware_measure import measure
from benchmarks.firmware_page import PAGE, renewed, tables, written
from benchmarks.firmware_size import buffers, core, messages
from benchmarks.firmware_stack import CallGraph, UnknownDepth
from qlinkgen.plan import plan_of
from tests.c.conftest import PROTOCOLS, protocol_of
from tests.support import agreement
from tests.support.cdriver import Driver, build, raw_text
from tests.support.random_raw import damaged, random_address, random_values

Tool = Callable[..., str]
Missing = Callable[..., NoReturn]


@pytest.mark.parametrize("name", PROTOCOLS)
def test_big_endian_agrees(
    name: str, tmp_path: Path, drivers: Callable[[str], Driver], require_tool: Tool
) -> None:
    compiler = require_tool("s390x-linux-gnu-gcc", package="gcc-s390x-linux-gnu")
    emulator = require_tool("qemu-s390x", package="qemu-user")
    protocol, rng = protocol_of(name), random.Random(name)
    program = build(protocol, tmp_path, compiler, ("-O0", "-std=c99", "-static"))
    with Driver(emulator, program) as big:
        for message in protocol.messages:
            address = random_address(message, rng) if protocol.address_name else "10203040"
            raws = random_values(message, rng)
            values = [raw_text(value, raw) for value, raw in zip(message.values, raws, strict=True)]
            encoded = drivers(name).ask("encode", message.name, address, *values)
            assert big.ask("encode", message.name, address, *values) == encoded
            wire = encoded.split()[2]
            words = (wire, address) if name == "mc1231a" else (wire,)
            assert big.ask("decode", message.name, *words) == drivers(name).ask(
                "decode", message.name, *words
            )
        direction, plan = protocol.directions[0], plan_of(protocol)
        for _ in range(20):
            frames = [agreement.wire(plan, rng.choice(plan.received(direction)), rng) for _ in range(3)]
            stream = damaged(b"".join(frames), rng, b"\xa5\x00\xff")
            assert big.ask("stream", direction, stream.hex()) == drivers(name).ask(
                "stream", direction, stream.hex()
            )


def require(require_tool: Tool, missing_tool: Missing, *targets: Target) -> None:
    """The compilers, and the simulator for AVR programs."""
    for target in targets:
        require_tool(f"{target.prefix}-gcc", package=target.package)
    require_tool("gcc", package="gcc")
    require_tool("make", package="make")
    if AVR in targets and not SIMAVR.exists():
        missing_tool("simavr's library", package="libsimavr-dev")


def test_budget_and_page(require_tool: Tool, missing_tool: Missing) -> None:
    # One test, because the 150 measured programs are built once.
    require(require_tool, missing_tool, *TARGETS)
    measured = measure()
    assert complaints(measured) == []
    slave, seen = measured.slaves["atmega328p"], measured.run.stack
    assert (
        0.7 * slave.main < seen <= slave.main + slave.interrupt
    )  # the interrupt seldom hits the deepest place
    standing, new = written(PAGE.read_text("utf-8")), tables(measured)
    assert standing.keys() == {*new, "peers", "library"}
    if standing["tools"] != new["tools"]:
        pytest.skip(
            f"docs/firmware.md is of other compilers than {new['tools']} Its figures are not compared"
        )
    new["peers"] = renewed(standing["peers"], measured)
    stale = [name for name, table in new.items() if table != standing[name]]
    assert not stale, "run python -m benchmarks.firmware --write"


# Code inserted into a header, the text before it, and the figure that must exceed the budget.
GROWTH = "static volatile uint8_t grown; " + "grown = (uint8_t)(grown + 1u); " * 20
BLOWN = {
    "receiver": ("qlink", "uint8_t position = receiver->position;", GROWTH, "one message"),
    "encode": ("qlink", "head[2] = node;", GROWTH, "one message"),
    "stack": ("qlink", "head[2] = node;", "volatile uint8_t deep[60]; deep[size] = 0u;", "stack"),
    "message": ("trio", "message->offset = payload[0];", GROWTH, "keypad_offset"),
    "ram": ("trio", "typedef struct trio_receiver {", "uint8_t spare[40];", "RAM to receive"),
}


@pytest.mark.parametrize("part", BLOWN)
def test_growth_breaks_the_budget(
    part: str, tmp_path: Path, require_tool: Tool, missing_tool: Missing
) -> None:
    require(require_tool, missing_tool, AVR)
    name, place, growth, noticed = BLOWN[part]
    text = (HEADERS / f"{name}.h").read_text("utf-8")
    assert text.count(place) == 1, f"the header has changed: {place}"
    (tmp_path / f"{name}.h").write_text(text.replace(place, f"{place} {growth}"))
    shop = Workshop(tmp_path, tmp_path)
    if name == "qlink":
        goals = core_goals(AVR, core(shop, AVR, "FOLD"))
    else:
        goals = each_message(AVR, name, messages(shop, AVR, name, framed=False))
        goals.append(receiver_goal(AVR, name, buffers(shop, AVR, name)))
    assert [goal for goal in goals if broken(goal) and goal.what.endswith(noticed)]


@pytest.mark.parametrize("form", ["LOOP", "FOLD"])
def test_a_late_answer_breaks_the_budget(
    form: str, tmp_path: Path, require_tool: Tool, missing_tool: Missing
) -> None:
    require(require_tool, missing_tool, AVR)
    options = f"-UQLINK_CRC_FORM -DQLINK_CRC_FORM=QLINK_CRC_FORM_{form}"
    asked = {name: requests()[name] for name in ("node_setup", "loop_back")}
    seen = replies(Workshop(tmp_path), asked, options)
    assert broken(answer_goal(seen)) == (form == "LOOP")
    assert seen.late == (["loop_back"] if form == "LOOP" else [])


@pytest.mark.parametrize("number", [1, 3])
def test_the_stack_is_as_deep_as_computed(
    number: int, tmp_path: Path, require_tool: Tool, missing_tool: Missing
) -> None:
    require(require_tool, missing_tool, AVR)
    shop = Workshop(tmp_path)
    seen = frame(shop, build_simulator(shop, "run_cycles"), "LOOP", number)
    graph = CallGraph(AVR, tmp_path / f"avr-cycles-LOOP-{number}" / "program.elf")
    assert (seen.receive_stack, seen.encode_stack) == (graph.depth("receive"), graph.depth("encode"))


SOURCES = {
    "recursion": "__attribute__((noinline)) int f(int n) { return n != 0 ? f(n - 1) * port + 1 : port; }",
    "calls through a pointer": "int (*volatile to)(int); int f(int n) { return to(n) + 1; }",
    "stack frame of variable size": "int f(int n) "
    "{ volatile char a[n]; a[n / 2] = 1; return a[port] + port; }",
}


@pytest.mark.parametrize("target", [CORTEX_M0, AVR], ids=lambda target: target.name)
@pytest.mark.parametrize("reason", SOURCES)
def test_an_unbounded_stack_has_no_figure(
    reason: str, target: Target, tmp_path: Path, require_tool: Tool
) -> None:
    require_tool(f"{target.prefix}-gcc", package=target.package)
    text = f"volatile int port; {SOURCES[reason]} int main(void) {{ return f(port); }}"
    (tmp_path / "program.c").write_text(text)
    program = Workshop(tmp_path).link(target, "unbounded", tmp_path / "program.c", ["-w"])
    with pytest.raises(UnknownDepth, match=reason):
        CallGraph(target, program).depth("main")
