"""Stations of a link in C: each asks, and answers the one that asked, with a receiver for each direction.

Masters number their requests.
"""

from __future__ import annotations

import subprocess
from collections.abc import Callable
from pathlib import Path

import pytest

from qlinkgen.schema import find
from tests.c.test_replies import built

PROGRAM = r"""
#include "dnp3.h"
#include <stdio.h>

typedef struct {
    dnp3_slave_t slave;
    dnp3_master_t master;
    dnp3_receiver_t requests;
    dnp3_receiver_t answers;
    uint8_t reply[DNP3_MAX_WIRE_SIZE];
    size_t size;
    int passed;
} station_t;

static station_t stations[3];

static bool on_reset(dnp3_slave_t *slave)
{
    printf("%u is reset by %u\n", (unsigned)slave->node, (unsigned)slave->received->master);
    return true;
}

static void on_ack(dnp3_master_t *master, uint16_t node)
{
    const station_t *station = &stations[0];
    while (&station->master != master) {
        ++station;
    }
    printf("%u has an answer of %u\n", (unsigned)station->slave.node, (unsigned)node);
}

static void asked(station_t *station, const dnp3_frame_t *frame)
{
    const size_t size = dnp3_slave_dispatch(&station->slave, frame, station->reply, sizeof station->reply);
    station->size = (size > 0U) ? size : station->size;
}

static void answered(station_t *station, const dnp3_frame_t *frame)
{
    if (frame->parts.master == station->slave.node) {
        station->passed += dnp3_master_dispatch(&station->master, frame) != DNP3_OK;
    }
}

static void hear(station_t *station, const uint8_t *bytes, size_t size)
{
    for (size_t at = 0; at < size; ++at) {
        dnp3_event_t event = dnp3_receive(&station->requests, bytes[at]);
        for (; event != DNP3_EVENT_NONE; event = dnp3_receiver_next(&station->requests)) {
            const dnp3_frame_t frame = dnp3_receiver_frame(&station->requests);
            if (event == DNP3_EVENT_FRAME) {
                asked(station, &frame);
            }
        }
        event = dnp3_receive(&station->answers, bytes[at]);
        for (; event != DNP3_EVENT_NONE; event = dnp3_receiver_next(&station->answers)) {
            const dnp3_frame_t frame = dnp3_receiver_frame(&station->answers);
            if (event == DNP3_EVENT_FRAME) {
                answered(station, &frame);
            }
        }
    }
}

int main(void)
{
    uint8_t wire[2][DNP3_MAX_WIRE_SIZE];
    int sizes[2];
    for (size_t at = 0; at < 3; ++at) {
        stations[at].slave.node = (uint16_t)(10U + at);
        stations[at].slave.reset_link = on_reset;
        stations[at].master.ack = on_ack;
        dnp3_receiver_init(&stations[at].requests, DNP3_REQUEST);
        dnp3_receiver_init(&stations[at].answers, DNP3_RESPONSE);
    }
    for (size_t at = 0; at < 2; ++at) {
        dnp3_parts_t parts = DNP3_PARTS_INIT;
        const uint16_t other = stations[1U - at].slave.node;
        parts.master = stations[at].slave.node;
        sizes[at] = dnp3_reset_link_request_to_frame(other, &parts, wire[at], sizeof wire[at]);
    }
    for (size_t at = 0; at < 3; ++at) {
        hear(&stations[at], wire[0], (size_t)sizes[0]);
        hear(&stations[at], wire[1], (size_t)sizes[1]);
    }
    for (size_t at = 0; at < 3; ++at) {
        for (size_t from = 0; from < 3; ++from) {
            hear(&stations[at], stations[from].reply, stations[from].size);
        }
        printf("%d passed over\n", stations[at].passed);
    }
    return 0;
}
"""


@pytest.mark.parametrize(("compiler", "package"), [("gcc", "gcc"), ("clang", "clang")])
def test_two_stations_ask_each_other_and_a_third_hears_it(
    tmp_path: Path, compiler: str, package: str, require_tool: Callable[..., str]
) -> None:
    require_tool(compiler, package=package)
    schema = find("dnp3").read_text("utf-8")
    program = built(tmp_path, compiler, "-O1", "-std=c99", schema=schema, text_of_main=PROGRAM)
    told = subprocess.run([program], check=True, capture_output=True, text=True).stdout.splitlines()
    assert told == [
        "10 is reset by 11", "11 is reset by 10", "10 has an answer of 11", "1 passed over",
        "11 has an answer of 10", "1 passed over", "0 passed over",
    ]  # fmt: skip


NUMBERS = r"""
#include "mbus.h"
#include <stdio.h>

static uint8_t next[2] = {MBUS_MASTER_FIRST_NUMBER, MBUS_MASTER_FIRST_NUMBER};

static void show(size_t node, uint32_t id)
{
    mbus_parts_t parts = MBUS_PARTS_INIT;
    uint8_t wire[MBUS_MAX_WIRE_SIZE] = {0};
    int size;
    mbus_master_number(&next[node], id, &parts);
    size = (id == MBUS_READ_REQUEST_ID)
               ? mbus_read_request_to_frame((uint8_t)node, &parts, wire, sizeof wire)
               : mbus_initialise_request_to_frame((uint8_t)node, &parts, wire, sizeof wire);
    printf("%02x%d ", (unsigned)wire[1], (int)(size == 5));
}

int main(void)
{
    const uint32_t read = MBUS_READ_REQUEST_ID, initialise = MBUS_INITIALISE_REQUEST_ID;
    show(0, read);
    show(0, read);
    show(1, read);
    show(0, read);
    show(0, initialise);
    show(0, read);
    show(1, read);
    return 0;
}
"""


def test_a_master_alternates_the_frame_count_bit(tmp_path: Path, require_tool: Callable[..., str]) -> None:
    require_tool("gcc", package="gcc")
    schema = find("mbus").read_text("utf-8")
    program = built(tmp_path, "gcc", "-O1", "-std=c99", schema=schema, text_of_main=NUMBERS)
    told = subprocess.run([program], check=True, capture_output=True, text=True).stdout.split()
    assert told == ["7b1", "5b1", "7b1", "7b1", "401", "7b1", "5b1"]
