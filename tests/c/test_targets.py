"""The same bytes on a big-endian machine, and the size on small ones."""

from __future__ import annotations

import random
import re
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import pytest

from tests.c.conftest import PROTOCOLS, protocol_of
from tests.c.test_compile import header, run
from tests.c.test_receiver import wire_of
from tests.support.cdriver import Driver, build, raw_text
from tests.support.random_raw import damaged, random_address, random_values


@pytest.mark.parametrize("name", PROTOCOLS)
def test_big_endian_agrees(
    name: str, tmp_path: Path, drivers: Callable[[str], Driver], require_tool: Callable[..., str]
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
        direction = protocol.directions[0]
        for _ in range(20):
            frames = [wire_of(big, protocol, rng.choice(protocol.received(direction)), rng) for _ in range(3)]
            stream = damaged(b"".join(frames), rng, b"\xa5\x00\xff")
            assert big.ask("stream", direction, stream.hex()) == drivers(name).ask(
                "stream", direction, stream.hex()
            )


CORE = Path(__file__).parent / "programs" / "core.c"


@dataclass(frozen=True)
class Budget:
    """Most bytes of text of receiver, decoder, encoder, bitwise CRC and one message; most bytes of stack."""

    prefix: str
    package: str
    flags: tuple[str, ...]
    text: int
    stack: int


ARM_FLAGS = ("-mcpu=cortex-m0", "-mthumb", "--specs=nano.specs", "--specs=nosys.specs")
BUDGETS = [
    pytest.param(Budget("arm-none-eabi", "gcc-arm-none-eabi", ARM_FLAGS, 450, 64), id="cortex-m0"),
    pytest.param(Budget("avr", "gcc-avr", ("-mmcu=atmega328p",), 550, 32), id="avr"),
]
SLACK = 1.1
RECEIVER_FITS = "sizeof(qlink_receiver_t) <= 10u + QLINK_MAX_PAYLOAD_SIZE"


@pytest.mark.parametrize("budget", BUDGETS)
def test_size(budget: Budget, tmp_path: Path, require_tool: Callable[..., str]) -> None:
    compiler = require_tool(f"{budget.prefix}-gcc", package=budget.package)
    measure = require_tool(f"{budget.prefix}-size", package=budget.package)
    header("qlink", tmp_path)
    options = ("-std=c99", "-Os", "-ffunction-sections", "-fdata-sections", "-Wl,--gc-sections", "-w")
    common, sizes = (compiler, *budget.flags, *options, f"-I{tmp_path}"), []
    for define in ("-DCORE", "-DEMPTY"):
        run(*common, define, CORE, "-o", tmp_path / "core.elf")
        sizes.append(int(run(measure, tmp_path / "core.elf").splitlines()[1].split()[0]))
    run(*common, "-DCORE", "-fstack-usage", "-c", CORE, "-o", tmp_path / "core.o")
    stack = {
        name: int(size)
        for name, size in re.findall(r":(\w+)(?:\.\S+)?\t(\d+)\t", (tmp_path / "core.su").read_text())
    }
    used = sizes[0] - sizes[1]
    print(f"{budget.prefix}: {used} bytes of text, stack {stack}")
    assert used <= budget.text * SLACK
    assert sum(stack.values()) <= budget.stack * SLACK
    (tmp_path / "ram.c").write_text(f'#include "qlink.h"\ntypedef char fits[({RECEIVER_FITS}) ? 1 : -1];\n')
    run(*common, "-c", tmp_path / "ram.c", "-o", "/dev/null")
