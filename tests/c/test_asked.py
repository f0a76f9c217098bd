"""A master in C that decodes an answer by its request."""

from __future__ import annotations

import subprocess
from collections.abc import Callable
from pathlib import Path

import pytest

from qlinkgen.backends import c
from qlinkgen.backends.base import Options
from qlinkgen.schema import loads
from tests.link.test_asked import SCHEMA
from tests.support.cdriver import WARNINGS

PROGRAM = r"""
#include "servo.h"
#include <stdio.h>

static void on_ping(servo_master_t *master, uint8_t node, const servo_ping_response_t *message)
{
    (void)master;
    printf(" ping %u %u", (unsigned)node, (unsigned)message->model);
}

static void on_read(servo_master_t *master, uint8_t node, const servo_read_response_t *message)
{
    (void)master;
    printf(" read %u %u", (unsigned)node, (unsigned)message->data_size);
}

static void on_failed(servo_master_t *master, uint8_t node, const servo_failed_t *message)
{
    (void)master;
    printf(" failed %u %u", (unsigned)node, (unsigned)message->error);
}

static void on_unasked(servo_master_t *master, uint8_t node, const servo_unasked_t *message)
{
    (void)master;
    printf(" unasked %u %u", (unsigned)node, (unsigned)message->data_size);
}

static servo_master_t master = {.ping = on_ping, .read = on_read, .failed = on_failed, .unasked = on_unasked};

static void tell(const uint8_t *wire, int size, const servo_frame_t *request)
{
    servo_frame_t frame;
    const int status = servo_frame_decode(&frame, wire, (size_t)size);
    printf("%d", status == SERVO_OK ? servo_master_dispatch_answer(&master, &frame, request) : status);
    printf("\n");
}

int main(void)
{
    const servo_read_request_t ask = {1U, 2U};
    const servo_read_response_t answer = {.data_size = 2U, .data = {7U, 8U}};
    const servo_failed_t refusal = {4U};
    uint8_t asking[32], wire[32];
    servo_frame_t read, ping, write;
    int size = servo_read_request_to_frame(&ask, 3U, asking, sizeof asking);
    (void)servo_frame_decode(&read, asking, (size_t)size);
    size = servo_read_response_to_frame(&answer, 3U, wire, sizeof wire);
    ping = read;
    ping.id = SERVO_PING_REQUEST_ID;
    write = read;
    write.id = SERVO_WRITE_REQUEST_ID;
    tell(wire, size, &read);
    tell(wire, size, &ping);
    tell(wire, size, &write);
    tell(wire, size, NULL);
    size = servo_failed_to_frame(&refusal, 3U, wire, sizeof wire);
    tell(wire, size, &read);
    tell(wire, size, NULL);
    return 0;
}
"""
#: Length; see docs of the errors of a header.
SAID = " read 3 20\n ping 3 20550\n-2\n unasked 3 30\n failed 3 40\n unasked 3 10\n"


@pytest.mark.parametrize("compiler", ["gcc", "clang"])
def test_an_answer_is_decoded_by_its_request(
    compiler: str, tmp_path: Path, require_tool: Callable[..., str]
) -> None:
    protocol, faults = loads(SCHEMA, "servo.yaml")
    assert protocol is not None, faults
    for name, text in c.generate(protocol, Options()).items():
        (tmp_path / Path(name).name).write_text(text, "utf-8")
    (tmp_path / "main.c").write_text(PROGRAM, "utf-8")
    program = tmp_path / "main"
    flags = ["-std=c99", "-Werror", *WARNINGS, "-fsanitize=address,undefined"]
    subprocess.run(
        [
            require_tool(compiler, package="gcc clang"),
            *flags,
            "-I",
            tmp_path,
            tmp_path / "main.c",
            "-o",
            program,
        ],
        check=True,
    )
    said = subprocess.run([program], capture_output=True, text=True, check=True).stdout
    assert said == SAID
