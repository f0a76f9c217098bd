"""The Trio keypad of the example firmware without a board, with the time set by the test."""

from __future__ import annotations

import re
import subprocess
from collections.abc import Callable
from pathlib import Path

import pytest

from qlinkgen.codecs import trio
from qlinkgen.link.ring import PATIENCE
from qlinkgen.protocols.trio.display import COLUMNS, ROWS
from qlinkgen.protocols.trio.facts import KEY_UP
from tests.firmware.firmware import SOURCES

#: Scans the keys for each line of input: <inputs> <milliseconds>.
LOOKING = """
#include <stdio.h>
#include "board.h"
#include "keypad.h"
static keypad_t keypad;
void board_send(const uint8_t *bytes, size_t size)
{
    for (size_t index = 0u; index < size; ++index) {
        (void)printf("%02x", bytes[index]);
    }
}
int main(void)
{
    unsigned inputs, now;
    keypad_start(&keypad);
    keypad.offset = 1u;
    keypad.mode = TRIO_KEYPAD_MODE_ON_OFF;
    while (scanf("%x %u", &inputs, &now) == 2) {
        keypad_look(&keypad, inputs, now);
    }
    (void)printf("%u ", keypad.lost_keys);
    while (ring_transmit(&keypad.ring)) {
    }
    return 0;
}
"""


@pytest.fixture(scope="module")
def looking(require_tool: Callable[..., str], tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The program `LOOKING`, with a queue for ten keys."""
    folder = tmp_path_factory.mktemp("looking")
    (folder / "main.c").write_text(LOOKING)
    app, headers = SOURCES / "trio_keypad", SOURCES.parents[1] / "generated" / "c"
    sources = [folder / "main.c", *(app / name for name in ("keypad.c", "ring.c", "display.c"))]
    compiler = require_tool("cc", package="gcc")
    options = [
        "-std=c99",
        "-DKEYPAD_DIAGNOSTICS=0",
        "-DKEYPAD_QUEUE=30",
        f"-I{app}",
        f"-I{SOURCES}",
        f"-I{headers}",
    ]
    subprocess.run([compiler, *options, *map(str, sources), "-o", str(folder / "looking")], check=True)
    return folder / "looking"


@pytest.mark.parametrize(
    ("looks", "keys", "lost"),
    [
        ([(0, 0), (1, 10), (1, 20)], [0], 0),
        ([(0, 0), (1, 10), (0, 20), (1, 30), (1, 40), (1, 50)], [0], 0),
        ([(0, 0), (1, 10), (1, 19)], [], 0),
        ([(0, 0), (0x800002, 10), (0x800003, 20), (1, 30), (1, 40)], [1, 23, 0, 1 + KEY_UP, 23 + KEY_UP], 0),
        ([(1, 0), (1, 10), (1, 20), (0, 30), (0, 40), (1, 50), (1, 60)], [KEY_UP, 0], 0),
        ([(0, 2**32 - 5), (1, 5), (1, 15)], [0], 0),
        ([(0, 0), (0xFFFFFF, 10), (0xFFFFFF, 20)], list(range(10)), 14),
    ],
    ids=["pressed", "bounces", "too early", "several", "down from the start", "clock wraps", "too many"],
)
def test_a_key_counts_when_two_looks_agree(
    looking: Path, looks: list[tuple[int, int]], keys: list[int], lost: int
) -> None:
    said = "".join(f"{inputs:x} {now}\n" for inputs, now in looks)
    run = subprocess.run([looking], input=said, capture_output=True, text=True, check=True)
    sent = [trio.CharacterTransfer(address=1, characters=chr(key)).to_frame().hex() for key in keys]
    assert run.stdout == f"{lost} {''.join(sent)}"


def test_numbers_that_the_header_of_the_protocol_does_not_have() -> None:
    folder, marking = SOURCES / "trio_keypad", trio.MARKING
    defined = {
        name: int(value, 0)
        for file in ("ring.h", "options.h", "keypad.c")
        for name, value in re.findall(r"#define (\w+) (0x\w+|\d+)u", (folder / file).read_text())
    }
    assert defined["RING_MARKER"] == marking.marker
    assert defined["RING_ADDRESS"] == marking.address_mask << marking.address_shift
    assert defined["RING_ONE_HOP"] == 1 << marking.address_shift
    assert defined["RING_TYPE"] == marking.id_mask << marking.id_shift
    assert marking.end == 0
    assert (defined["KEYPAD_ROWS"], defined["KEYPAD_COLUMNS"]) == (ROWS, COLUMNS)
    assert defined["KEYPAD_PATIENCE"] == PATIENCE * 1000
    assert defined["KEY_UP"] == KEY_UP
