"""Several answers in C: their end for a master, and the turn of a slave in a list of nodes."""

from __future__ import annotations

import subprocess
from collections.abc import Callable
from pathlib import Path

import pytest

from qlinkgen.backends.python import load as load_codec
from qlinkgen.schema import loads
from tests.c.test_replies import PROGRAM as REPLYING
from tests.c.test_replies import built

SCHEMA = """\
qlinkgen: 1
protocol: {name: pump, title: Pump, revision: "1", source: Manual}
frame:
  parts:
    node: {role: address, type: u8}
    code: {role: message, type: u8}
    length: {type: u8, counts: [data]}
    data: {role: payload, size: 0..16}
    crc: {type: u16, algorithm: crc-16/modbus, over: [node, code, data]}
bus: {kind: master_slave, nodes: 1..9, broadcast: 0, response_within: 10 ms}
enums: {more: {type: u8, values: {last: 0, follows: 1}}}
types: {place: {fields: {node: u8, size: u8}}}
defaults: {addressing: node, repeat: safe}
replies: {end: {id: 0x70, fields: {}, means: done}}
commands:
  pair: {id: 1, request: {}, response: {value: u8}, many: {count: 2}}
  some:
    id: 2
    request: {number: {type: u8, range: 1..4}}
    response: {value: u8}
    many: {count: request.number}
  list: {id: 3, request: {}, response: {more: more}, many: {until: {more: last}}}
  range: {id: 4, request: {}, response: {left: i16}, many: {until: {left: 1..5}}}
  ever: {id: 5, request: {}, response: {left: u8}, many: {until: {left: 0..255}}}
  dump: {id: 6, request: {}, response: {value: u8}, many: {until: end}}
  scan: {id: 7, request: {}, response: {value: u8}, addressing: answered_broadcast, many: {within: 200 ms}}
  sync:
    id: 8
    request: {size: {type: u8, range: 1..3}, nodes: "u8[1..5]"}
    response: {data: "bytes[request.size]"}
    addressing: answered_broadcast
    many: {each: request.nodes}
  bulk:
    id: 9
    request: {places: "place[1..4]"}
    response: {value: u8}
    addressing: answered_broadcast
    many: {each: request.places.node}
  told: {id: 10, request: {nodes: "u16[3]"}, response: {whose: u8}, many: {each: request.nodes, by: whose}}
"""
MASTER = r"""
#include "pump.h"
#include <stdio.h>

static pump_some_answers_t some;
static pump_list_answers_t list;
static pump_range_answers_t range;
static pump_sync_answers_t sync;
static pump_told_answers_t told;
static const pump_sync_request_t sync_request = {.size = 1, .nodes = {5, 2, 5, 7}, .nodes_count = 4};
static const pump_told_request_t told_request = {.nodes = {300, 2, 7}};

static void on_some(pump_master_t *master, uint8_t node, const pump_some_response_t *message)
{
    (void)master; (void)node; (void)message;
    printf("%d", (int)pump_some_answers_take(&some));
}

static void on_list(pump_master_t *master, uint8_t node, const pump_list_response_t *message)
{
    (void)master; (void)node;
    printf("%d", (int)pump_list_answers_take(&list, message));
}

static void on_range(pump_master_t *master, uint8_t node, const pump_range_response_t *message)
{
    (void)master; (void)node;
    printf("%d", (int)pump_range_answers_take(&range, message));
}

static void on_sync(pump_master_t *master, uint8_t node, const pump_sync_response_t *message)
{
    (void)master; (void)message;
    printf("%d", (int)pump_sync_answers_take(&sync, &sync_request, node));
}

static void on_told(pump_master_t *master, uint8_t node, const pump_told_response_t *message)
{
    (void)master; (void)node;
    printf("%d", (int)pump_told_answers_take(&told, &told_request, message));
}

int main(int count, char **heard)
{
    static pump_master_t master;
    const pump_some_request_t some_request = {3};
    pump_pair_answers_t pair;
    pump_ever_answers_t ever;
    const pump_ever_response_t any = {7};
    pump_pair_answers_init(&pair);
    pump_ever_answers_init(&ever);
    printf("%d", (int)pump_pair_answers_take(&pair));
    printf("%d", (int)pump_pair_answers_take(&pair));
    printf("%d ", (int)pump_ever_answers_take(&ever, &any));
    pump_some_answers_init(&some, &some_request);
    pump_list_answers_init(&list);
    pump_range_answers_init(&range);
    pump_sync_answers_init(&sync, &sync_request);
    pump_told_answers_init(&told, &told_request);
    printf("%u ", (unsigned)sync.left);
    master.some = on_some;
    master.list = on_list;
    master.range = on_range;
    master.sync = on_sync;
    master.told = on_told;
    for (int at = 1; at < count; ++at) {
        uint8_t bytes[32];
        size_t size = 0;
        pump_frame_t frame;
        unsigned byte;
        while (sscanf(&heard[at][2U * size], "%2x", &byte) == 1) {
            bytes[size++] = (uint8_t)byte;
        }
        if (pump_frame_decode(PUMP_RESPONSE, &frame, bytes, size) != PUMP_OK) {
            return 1;
        }
        if (pump_master_dispatch(&master, &frame) != PUMP_OK) {
            return 1;
        }
    }
    return 0;
}
"""
SLAVE = r"""
#include "pump.h"
#include <stdio.h>

static bool on_sync(pump_slave_t *slave, const pump_sync_request_t *request, pump_sync_response_t *response)
{
    (void)request;
    response->data[0] = slave->before;
    return true;
}

static bool on_bulk(pump_slave_t *slave, const pump_bulk_request_t *request, pump_bulk_response_t *response)
{
    response->value = (uint8_t)(request->places[slave->before].size + slave->before);
    return true;
}

static bool on_told(pump_slave_t *slave, const pump_told_request_t *request, pump_told_response_t *response)
{
    (void)slave;
    response->whose = (uint8_t)request->nodes[1];
    return true;
}
""" + REPLYING[REPLYING.index("\nint main") :].replace(
    "slave.read = on_read;", "slave.sync = on_sync;"
).replace("slave.set = on_set;", "slave.bulk = on_bulk;").replace(
    "slave.log = on_log;", "slave.told = on_told;"
)
COMPILERS = pytest.mark.parametrize(("compiler", "package"), [("gcc", "gcc"), ("clang", "clang")])


def run(program: Path, messages: list[bytes]) -> list[str]:
    arguments = [message.hex() for message in messages]
    return subprocess.run(
        [program, *arguments], check=True, capture_output=True, text=True
    ).stdout.splitlines()


@COMPILERS
def test_a_master_sees_the_last_answer(
    tmp_path: Path, compiler: str, package: str, require_tool: Callable[..., str]
) -> None:
    require_tool(compiler, package=package)
    protocol, faults = loads(SCHEMA, "pump.yaml")
    assert protocol is not None, faults
    pump = load_codec(protocol)
    heard = [
        *(pump.SomeResponse(node=3, value=value) for value in (1, 2, 3)),
        *(pump.ListResponse(node=3, more=more) for more in (1, 1, 0)),
        *(pump.RangeResponse(node=3, left=left) for left in (7, -6, 5)),
        *(pump.SyncResponse(node=node, data=b"1") for node in (7, 7, 3, 2, 5)),
        *(pump.ToldResponse(node=3, whose=whose) for whose in (7, 44, 2)),  # 44 is 300 in a byte
    ]
    program = built(tmp_path, compiler, "-O1", "-std=c99", schema=SCHEMA, text_of_main=MASTER)
    assert run(program, [each.to_frame() for each in heard]) == [
        "011 3 001" + "001" + "001" + "00001" + "000"
    ]


@COMPILERS
def test_a_slave_knows_its_turn(
    tmp_path: Path, compiler: str, package: str, require_tool: Callable[..., str]
) -> None:
    require_tool(compiler, package=package)
    protocol, faults = loads(SCHEMA, "pump.yaml")
    assert protocol is not None, faults
    pump = load_codec(protocol)
    place = pump.Place

    def sync(*nodes: int) -> bytes:
        return bytes(pump.SyncRequest(node=0, size=1, nodes=nodes).to_frame())

    def bulk(*nodes: int) -> bytes:
        places = [place(node=node, size=10 * node) for node in nodes]
        return bytes(pump.BulkRequest(node=0, places=places).to_frame())

    cases = [
        (sync(3, 1), pump.SyncResponse(node=3, data=bytes([0])).to_frame()),
        (sync(1, 2, 5, 3, 3), pump.SyncResponse(node=3, data=bytes([3])).to_frame()),
        (sync(1, 2), b""),
        (bulk(1, 3), pump.BulkResponse(node=3, value=31).to_frame()),
        (bulk(1, 2), b""),
        (
            pump.ToldRequest(node=3, nodes=[1, 2, 4]).to_frame(),  # it answers for all of them
            pump.ToldResponse(node=3, whose=2).to_frame(),
        ),
    ]
    program = built(tmp_path, compiler, "-O1", "-std=c99", schema=SCHEMA, text_of_main=SLAVE)
    assert run(program, [request for request, _ in cases]) == [answer.hex() for _, answer in cases]
