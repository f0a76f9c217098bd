"""Check values of responses that cover the request: a slave in C, and the function that computes them."""

from __future__ import annotations

import subprocess
from collections.abc import Callable
from pathlib import Path
from typing import Literal

import pytest

from qlinkgen.backends import c
from qlinkgen.backends.base import Options
from qlinkgen.model.checksum import find
from tests.link.test_proofs import loaded
from tests.support.cdriver import WARNINGS

PROGRAM = r"""
#include "claw.h"
#include <stdio.h>

static bool on_speed(claw_slave_t *slave, claw_speed_response_t *response)
{
    (void)slave;
    response->speed = -2;
    response->status = 7U;
    return true;
}

static bool on_name(claw_slave_t *slave, const claw_name_request_t *request, claw_name_response_t *response)
{
    (void)slave;
    (void)request;
    response->text_size = 3U;
    for (uint8_t index = 0U; index < 3U; ++index) {
        response->text[index] = (uint8_t)('a' + index);
    }
    return true;
}

int main(int count, char **asked)
{
    static claw_slave_t slave;
    static claw_receiver_t receiver;
    static uint8_t wire[CLAW_MAX_WIRE_SIZE];
    slave.node = 0x81U;
    slave.speed = on_speed;
    slave.name = on_name;
    claw_receiver_init(&receiver, CLAW_REQUEST);
    for (int at = 1; at < count; ++at) {
        unsigned byte;
        for (size_t place = 0; sscanf(&asked[at][place], "%2x", &byte) == 1; place += 2U) {
            if (claw_receive(&receiver, (uint8_t)byte) == CLAW_EVENT_FRAME) {
                const claw_frame_t frame = claw_receiver_frame(&receiver);
                const size_t size = claw_slave_dispatch(&slave, &frame, wire, sizeof wire);
                claw_speed_response_t told;
                claw_turn_t turn;
                claw_frame_t answer;
                for (size_t index = 0; index < size; ++index) {
                    printf("%02x", (unsigned)wire[index]);
                }
                claw_turn_init(&turn); /* as a master that has sent `speed` */
                for (size_t index = 0; index < size; ++index) {
                    if (claw_turn_receive(&turn, CLAW_SPEED_RESPONSE_ID, 0U, wire[index], &answer) ==
                            CLAW_EVENT_FRAME &&
                        claw_speed_response_decode(&told, answer.payload, answer.size) == CLAW_OK) {
                        const uint16_t right = claw_speed_response_check(&frame, answer.payload, answer.size);
                        printf(" %d", told.crc == right);
                    }
                }
                printf("\n");
            }
        }
    }
    return 0;
}
"""


def with_check(request: str, answer: str) -> str:
    """An answer with the check value over pieces of the request."""
    covered = bytes.fromhex(request + answer)
    return answer + find("crc-16/xmodem").compute(covered).to_bytes(2, "big").hex()


def test_a_slave_gives_a_response_its_check_value(tmp_path: Path, require_tool: Callable[..., str]) -> None:
    require_tool("gcc", package="gcc")
    protocol, codec = loaded()
    for name, text in c.generate(protocol, Options()).items():
        (tmp_path / Path(name).name).write_text(text)
    (tmp_path / "main.c").write_text(PROGRAM)
    program = tmp_path / "main"
    files = ["-I", str(tmp_path), str(tmp_path / "main.c"), "-o", str(program)]
    subprocess.run(["gcc", "-O1", "-std=c99", *WARNINGS, *files], check=True)
    asked = [codec.SpeedRequest(node=0x81), codec.NameRequest(node=0x81, part=0x0102)]
    words = [each.to_frame().hex() for each in asked]
    told = subprocess.run([program, *words], check=True, capture_output=True, text=True)
    assert told.stdout.splitlines() == [
        with_check("811e", "fffffffe07") + " 1",
        "09" + with_check("1f0102", "03616263") + " 0",
    ]


@pytest.mark.parametrize("role", ["master", "slave"])
def test_both_sides_have_the_function(role: Literal["master", "slave"]) -> None:
    protocol, _ = loaded()
    header = "".join(c.generate(protocol, Options(role=role)).values())
    assert "claw_speed_response_check(const claw_frame_t *request" in header
