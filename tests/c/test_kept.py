"""A slave in C that answers a repeated request, told by its number, with its last answer."""

from __future__ import annotations

import subprocess
from collections.abc import Callable
from pathlib import Path

from qlinkgen.backends import c
from qlinkgen.backends.base import Options
from tests.link.test_kept import loaded
from tests.support.cdriver import WARNINGS

PROGRAM = r"""
#include "meter.h"
#include <stdio.h>

static uint8_t asked;
static bool is_silent;

static bool on_take(meter_slave_t *slave, meter_take_response_t *response)
{
    (void)slave;
    ++asked;
    response->number = asked;
    return !is_silent;
}

static bool on_reset(meter_slave_t *slave)
{
    (void)slave;
    return true;
}

int main(int count, char **words)
{
    static meter_slave_t slave;
    static meter_receiver_t receiver;
    static uint8_t wire[METER_MAX_WIRE_SIZE];
    slave.node = 3U;
    slave.take = on_take;
    slave.reset = on_reset;
    meter_receiver_init(&receiver, METER_REQUEST);
    for (int at = 1; at < count; ++at) {
        unsigned byte;
        is_silent = words[at][0] == '-';
        for (size_t place = is_silent ? 1U : 0U; sscanf(&words[at][place], "%2x", &byte) == 1; place += 2U) {
            if (meter_receive(&receiver, (uint8_t)byte) == METER_EVENT_FRAME) {
                const meter_frame_t frame = meter_receiver_frame(&receiver);
                const size_t size = meter_slave_dispatch(&slave, &frame, wire, sizeof wire);
                for (size_t index = 0; index < size; ++index) {
                    printf("%02x", (unsigned)wire[index]);
                }
                printf("\n");
            }
        }
    }
    return 0;
}
"""


def test_a_repeat_gets_the_answer_once_more(tmp_path: Path, require_tool: Callable[..., str]) -> None:
    require_tool("gcc", package="gcc")
    protocol, codec = loaded()
    for name, text in c.generate(protocol, Options()).items():
        (tmp_path / Path(name).name).write_text(text)
    (tmp_path / "main.c").write_text(PROGRAM)
    program = tmp_path / "main"
    files = ["-I", str(tmp_path), str(tmp_path / "main.c"), "-o", str(program)]
    subprocess.run(["gcc", "-O1", "-std=c99", *WARNINGS, *files], check=True)
    one, two = (codec.TakeRequest(node=3, turn=turn).to_frame().hex() for turn in (1, 0))
    reset, told = codec.ResetRequest(node=3).to_frame().hex(), codec.ResetRequest(node=255).to_frame().hex()
    number = [codec.TakeResponse(node=3, number=each).to_frame().hex() for each in range(10)]
    done = codec.ResetResponse(node=3).to_frame().hex()
    cases = [
        (one, number[1]), (one, number[1]), (two, number[2]), (two, number[2]), (one, number[3]),
        (reset, done), (one, number[4]), (told, ""), (one, number[5]), (f"-{two}", ""), (two, number[7]),
    ]  # fmt: skip
    said = subprocess.run([program, *(sent for sent, _ in cases)], check=True, capture_output=True, text=True)
    assert said.stdout.splitlines() == [answer for _, answer in cases]
