"""A slave in C whose dialogues have frames that only their turn tells."""

from __future__ import annotations

import subprocess
from collections.abc import Callable
from pathlib import Path

import pytest

from qlinkgen.backends import c
from qlinkgen.backends.base import Options
from qlinkgen.schema import find, load
from qlinkgen.schema.loader import loads
from tests.support.cdriver import WARNINGS

PROGRAM = r"""
#include "stm32.h"
#include <stdio.h>

static uint8_t memory[512];
static uint32_t place;
static uint16_t amount;

static bool on_read(stm32_slave_t *slave)
{
    (void)slave;
    return true;
}

static bool on_place(stm32_slave_t *slave, const stm32_read_memory_place_t *request)
{
    place = request->start & 0xFFU;
    return (request->start < 0x10000000UL) ? true : stm32_nack_answer(slave);
}

static bool on_amount(stm32_slave_t *slave, const stm32_read_memory_amount_t *request)
{
    (void)slave;
    amount = (uint16_t)(request->count + 1U);
    return true;
}

static bool on_block(stm32_slave_t *slave, const stm32_write_memory_block_t *request)
{
    (void)slave;
    for (uint16_t index = 0; index < request->data_size; ++index) {
        memory[index] = request->data[index];
    }
    return true;
}

static bool on_write(stm32_slave_t *slave)
{
    (void)slave;
    return true;
}

static bool on_write_place(stm32_slave_t *slave, const stm32_write_memory_place_t *request)
{
    (void)slave;
    return request->start == 0U;
}

static void show(const uint8_t *bytes, size_t size)
{
    for (size_t index = 0; index < size; ++index) {
        printf("%02x", (unsigned)bytes[index]);
    }
}

int main(int count, char **asked)
{
    static stm32_slave_t slave;
    static stm32_receiver_t receiver;
    static stm32_turn_t turn;
    static stm32_read_memory_content_t content;
    static uint8_t wire[STM32_MAX_WIRE_SIZE];
    for (size_t index = 0; index < sizeof memory; ++index) {
        memory[index] = (uint8_t)index;
    }
    slave.read_memory = on_read;
    slave.read_memory_place = on_place;
    slave.read_memory_amount = on_amount;
    slave.write_memory = on_write;
    slave.write_memory_place = on_write_place;
    slave.write_memory_block = on_block;
    stm32_receiver_init(&receiver, STM32_REQUEST);
    stm32_turn_init(&turn);
    for (int at = 1; at < count; ++at) {
        unsigned byte;
        for (size_t place_in = 0; sscanf(&asked[at][place_in], "%2x", &byte) == 1; place_in += 2U) {
            stm32_frame_t frame;
            const stm32_event_t event = stm32_slave_receive(&slave, &receiver, &turn, (uint8_t)byte, &frame);
            if (event == STM32_EVENT_FRAME) {
                show(wire, stm32_slave_dispatch(&slave, &frame, wire, sizeof wire));
                if (frame.id == STM32_READ_MEMORY_AMOUNT_ID) {
                    content.data_size = amount;
                    for (uint16_t index = 0; index < amount; ++index) {
                        content.data[index] = memory[place + index];
                    }
                    show(wire, (size_t)stm32_read_memory_content_to_frame(&content, wire, sizeof wire));
                }
            } else if (event != STM32_EVENT_NONE) {
                printf("error %d", (int)event);
            }
        }
        printf("\n");
    }
    return 0;
}
"""
CASES = [
    ("11ee", "79"),
    ("0800000008", "79"),
    ("03fc", "7900010203"),
    ("11ee", "79"),
    ("11ee79", ""),  # any byte may be one of the place
    ("1f99", "1f"),
    ("11ee", "79"),
    ("0800000000", ""),  # a wrong check value ends the dialogue
    ("11ee", "79"),
    ("0800000109", "79"),
    ("00ff", "7901"),
    ("31ce", "79"),
    ("0000000000", "79"),
    ("0311ee79", ""),
    ("1f9a", "79"),
    ("11ee0000000000" + "03fc", "797979" + "11ee791f"),
    ("43bc", ""),  # it has no function for it
    ("11ee", "79"),
]


@pytest.mark.parametrize(("compiler", "package"), [("gcc", "gcc"), ("clang", "clang")])
def test_a_slave_passes_bytes_to_the_message_that_is_due(
    tmp_path: Path, compiler: str, package: str, require_tool: Callable[..., str]
) -> None:
    require_tool(compiler, package=package)
    for name, text in c.generate(load(find("stm32")), Options()).items():
        (tmp_path / Path(name).name).write_text(text)
    (tmp_path / "main.c").write_text(PROGRAM)
    program = tmp_path / "main"
    files = ["-I", str(tmp_path), str(tmp_path / "main.c"), "-o", str(program)]
    subprocess.run([compiler, "-O1", "-std=c99", *WARNINGS, *files], check=True)
    told = subprocess.run([program, *(sent for sent, _ in CASES)], check=True, capture_output=True, text=True)
    assert told.stdout.splitlines() == [answer for _, answer in CASES]


def test_a_master_gives_the_size_that_an_earlier_frame_says() -> None:
    header = "".join(c.generate(load(find("stm32")), Options(role="master")).values())
    sizes = header[header.index("stm32_turn_size_(") : header.index("/* Takes the next byte of the message")]
    assert "case STM32_GET_KNOWN_ID:" in sizes
    assert "case STM32_READ_MEMORY_CONTENT_ID:" not in sizes
    assert "case STM32_READ_MEMORY_PLACE_ID:" not in sizes  # a master sends it


def test_an_answer_begins_with_the_scaled_size_of_the_frame_before_it() -> None:
    text = """\
qlinkgen: 1
protocol: {name: pump, title: Pump, revision: "1", source: Manual}
frames:
  ask: {parts: {start: 7E, code: {role: message, type: u8}, sum: {type: u8, algorithm: sum8, over: [code]}}}
  plain: {parts: {data: {role: payload, size: 1..64}}}
bus: {kind: master_slave, response_within: 1 s}
defaults: {frame: ask, addressing: none, repeat: safe}
commands:
  peek:
    id: 1
    request: {}
    steps:
      - {receive: {frame: plain, fields: {ready: u8}}}
      - {name: amount, send: {frame: plain, fields: {count: {type: u8, range: 2..62, scale: 4, offset: 2}}}}
      - {receive: {frame: plain, fields: {data: "bytes[amount.count]"}}}
"""
    protocol, faults = loads(text, "pump.yaml")
    assert protocol is not None, faults
    header = "".join(c.generate(protocol, Options()).values())
    assert "response.data_size = (uint8_t)(((size_t)request.count * 4U) + 2U);" in header


def test_headers_without_such_frames_have_nothing_of_them() -> None:
    header = "".join(c.generate(load(find("mbus")), Options()).values())
    assert "_turn_" not in header
