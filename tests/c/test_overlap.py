"""The slave of the example in a header never answers while bytes of its request are still to come."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import pytest

from qlinkgen.backends import c
from qlinkgen.backends.base import Options
from qlinkgen.plan import plan_of
from qlinkgen.plan.ends import Hunt, Rescan
from qlinkgen.schema import loads
from tests.c.conftest import protocol_of
from tests.c.test_compile import run
from tests.support.cdriver import WARNINGS

#: Bytes are inserted after each 7E, and a frame may begin with one that is data.
RESCANNED = """\
qlinkgen: 1
protocol: {name: lamp, title: Lamp, revision: "1", source: this test, doc: A lamp}
frame:
  parts:
    start: 5A
    node: {role: address, type: u8}
    code: {role: message, type: u8}
    length: {type: u8, counts: [data]}
    data: {role: payload, size: 0..8}
    crc: {type: u16, algorithm: crc-16/xmodem, over: [node, code, data]}
  coding: {insert: 00, after: 7E, over: [node, code, length, data, crc]}
bus: {kind: master_slave, nodes: 1..9}
defaults: {addressing: node, repeat: safe}
commands:
  motion: {id: 0x20, request: {counter: u8, place: u32}, response: {counter: u8}}
"""

#: The same beside another kind of frame.
KINDS = """\
qlinkgen: 1
protocol: {name: lamps, title: Lamps, revision: "1", source: this test, doc: Lamps}
frames:
  usual:
    parts:
      start: 7E 7E
      node: {role: address, type: u8}
      code: {role: message, type: u8}
      length: {type: u8, counts: [data]}
      data: {role: payload, size: 0..8}
      crc: {type: u16, algorithm: crc-16/xmodem, over: [node, code, data]}
    coding: {insert: 00, after: 7E, over: [node, code, length, data, crc]}
  short:
    parts:
      begin: C3
      node: {role: address, type: u8}
      code: {role: message, type: u8}
      sum: {type: u8, algorithm: sum8, over: [node, code]}
bus: {kind: master_slave, nodes: 1..9}
defaults: {addressing: node, repeat: safe}
commands:
  motion: {id: 0x20, frame: usual, request: {counter: u8, place: u32}, response: {counter: u8}}
messages:
  tick: {id: 1, frame: short, direction: request, fields: {}}
"""

#: The master sends a request byte after byte; an answer before its last byte is an overlap. Then each request
#: that ends with an inserted byte loses it, and is repeated.
LINE = """
#include <stdio.h>

static size_t due;
static unsigned overlaps, answers;

void board_send(const uint8_t *bytes, size_t size)
{
    (void)bytes;
    (void)size;
    overlaps += (due > 0U) ? 1U : 0U;
    ++answers;
}

static void send(const uint8_t *wire, size_t size, size_t lost)
{
    for (size_t at = 0U; at + lost < size; ++at) {
        due = size - lost - 1U - at;
        board_received(wire[at]);
    }
}

int main(void)
{
    uint8_t wire[@P@_MAX_WIRE_SIZE];
    uint32_t chance = 1U;
    unsigned lost = 0U;
    board_start();
    for (unsigned number = 0U; number < REQUESTS; ++number) {
        @p@_motion_request_t request = @P@_MOTION_REQUEST_INIT;
        int size;
        chance = chance * 1664525U + 1013904223U;
        request.counter = (uint8_t)(chance >> 24);
        SET(request, chance);
        size = @p@_motion_request_to_frame(&request, 1U, wire, sizeof wire);
        if (size < 0) {
            return 1;
        }
        send(wire, (size_t)size, 0U);
        if (wire[size - 2] == AFTER && wire[size - 1] == 0U) {
            const unsigned before = answers;
            send(wire, (size_t)size, 1U);
            lost += (answers == before) ? 1U : 0U;
            send(wire, (size_t)size, 0U);
            answers -= (answers == before + 1U) ? 1U : 0U;
        }
    }
    printf("%u overlaps, %u answers, %s", overlaps, answers, (lost > 0U) ? "some lost" : "none lost");
    return 0;
}
"""
REQUESTS = 100_000


@pytest.mark.parametrize("name", ["qlink", "lamp", "lamps"])
def test_the_example_waits_for_the_last_byte(
    name: str, tmp_path: Path, require_tool: Callable[..., str]
) -> None:
    text = {"lamp": RESCANNED, "lamps": KINDS}.get(name)
    protocol, faults = (protocol_of(name), ()) if text is None else loads(text, f"{name}.yaml")
    assert protocol, faults
    assert isinstance(plan_of(protocol).frame.receiver, Hunt if name == "qlink" else Rescan)
    (text,) = c.generate(protocol, Options()).values()
    (tmp_path / f"{name}.h").write_text(text)
    comment = text[text.index("Example:") : text.index("*/")].splitlines()[2:]
    example = "\n".join(line.removeprefix(" *").removeprefix(" ") for line in comment) + "\n"
    (tmp_path / "line.c").write_text(example + LINE.replace("@p@", name).replace("@P@", name.upper()))
    segments = (
        "(r).segments_count = 2U, (r).segments[0] = (uint16_t)(n), (r).segments[1] = (uint16_t)((n) >> 16)"
    )
    place = segments if name == "qlink" else "(r).place = (n)"
    defined = [f"-DREQUESTS={REQUESTS}U", f"-DSET(r,n)={place}", f"-DAFTER={165 if name == 'qlink' else 126}"]
    command = [require_tool("gcc", package="gcc"), "-std=c99", "-O1", *defined]
    run(*command, *WARNINGS, tmp_path / "line.c", "-o", tmp_path / "line")
    assert run(tmp_path / "line") == f"0 overlaps, {REQUESTS} answers, some lost"
