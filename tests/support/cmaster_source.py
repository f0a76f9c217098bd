"""The C program around a generated master that `tests.support.cmaster` loads: frames in, frames out."""

from __future__ import annotations

from collections.abc import Iterator

from qlinkgen.backends.c.frames import FrameSection, frame_section
from qlinkgen.backends.c.layout import Layouts
from qlinkgen.backends.c.master_asks import Asks, AskView
from qlinkgen.backends.c.names import Names
from qlinkgen.model.protocol import Protocol
from qlinkgen.plan import plan_of

_HEAD = """
#include <stdlib.h>
#include "{p}_master.h"

typedef struct world {{
    {p}_bus_t bus;
    {p}_job_t job;
    union {{
        int none;
{requests}
    }} request;
    union {{
        int none;
{responses}
    }} response;
    int command;
    size_t sent;
    int answer;
    uint8_t wire[{P}_MAX_WIRE_SIZE];
}} world_t;

static void send({p}_bus_t *bus, const uint8_t *bytes, size_t size)
{{
    world_t *const world = bus->context;
    (void)bytes;
    world->sent = size;
}}

static int answered(world_t *world, const {p}_frame_t *frame)
{{
    if (world->job.outcome == {P}_OUTCOME_DONE && frame->{id} == world->job.response_id) {{
        switch (world->command) {{
{answers}
        default:
            break;
        }}
    }}
    return {p}_frame_encode(
        {way_back}frame->{id}, {address}{parts}frame->payload, frame->size, world->wire, sizeof world->wire);
}}

static void done({p}_bus_t *bus, {p}_job_t *job)
{{
    world_t *const world = bus->context;
    world->answer = (job->answer != NULL) ? answered(world, job->answer) : 0;
}}

world_t *master_new(uint32_t baud, uint32_t slack, int attempts, int echoes, uint32_t now)
{{
    world_t *const world = calloc(1, sizeof(world_t));
    {p}_bus_init(&world->bus, baud, slack, send, now);
    world->bus.context = world;
    world->bus.attempts = (uint8_t)attempts;
    world->bus.echoes = echoes != 0;
    world->job.done = done;
    return world;
}}

int master_ask(world_t *world, int command, const uint8_t *wire, size_t size, int attempts, uint32_t now)
{{
    {p}_frame_t frame;
{buffer}
    if ({p}_frame_decode({way}&frame, {scratch}wire, size) != {P}_OK) {{
        return -1;
    }}
    world->command = command;
    world->job.attempts = (uint8_t)attempts;
    switch (command) {{
{asks}
    default:
        return -3;
    }}
}}

void master_poll(world_t *world, uint32_t now) {{ {p}_bus_poll(&world->bus, now); }}
void master_receive(world_t *world, const uint8_t *bytes, size_t size, uint32_t now)
{{
    for (size_t index = 0; index < size; ++index) {{
        {p}_bus_receive(&world->bus, bytes[index], now);
    }}
}}
uint32_t master_wait(const world_t *world, uint32_t now) {{ return {p}_bus_wait(&world->bus, now); }}
void master_abort(world_t *world, uint32_t now) {{ {p}_bus_abort(&world->bus, &world->job, now); }}
size_t master_sent(world_t *world)
{{
    const size_t size = world->sent;
    world->sent = 0;
    return size;
}}
const uint8_t *master_bytes(const world_t *world) {{ return world->bus.wire; }}
int master_outcome(const world_t *world) {{ return (int)world->job.outcome; }}
int master_error(const world_t *world) {{ return world->job.error; }}
int master_attempts(const world_t *world) {{ return world->job.sent; }}
int master_answer(const world_t *world) {{ return world->answer; }}
const uint8_t *master_wire(const world_t *world) {{ return world->wire; }}
const uint32_t *master_counters(const world_t *world) {{ return &world->bus.counters.requests; }}
size_t master_size(void) {{ return sizeof({p}_bus_t); }}
size_t master_job_size(void) {{ return sizeof({p}_job_t); }}
"""


def asks_of(protocol: Protocol) -> list[AskView]:
    """The commands of the master in C, in the order of their numbers for the program."""
    plan, names = plan_of(protocol), Names(protocol)
    return [each for each in Asks(plan, names, _section(protocol)) if isinstance(each, AskView)]


def _section(protocol: Protocol) -> FrameSection:
    return frame_section(plan_of(protocol), Layouts(protocol.name))


def source(protocol: Protocol) -> str:
    """The program for a protocol."""
    plan, names, section = plan_of(protocol), Names(protocol), _section(protocol)
    view, asks = section.view, asks_of(protocol)
    body = f"    uint8_t buffer[{names.upper}_DECODE_BUFFER_SIZE];" if view.body_size else ""
    return _HEAD.format(
        p=names.prefix,
        P=names.upper,
        requests=_members(asks, "request"),
        responses=_members(asks, "response"),
        id=view.id,
        address=f"frame->{view.address}, " if view.address else "",
        parts="&frame->parts, " if view.has_values else "",
        way=f"{names.upper}_REQUEST, " if view.scan_direction else "",
        way_back=f"{names.upper}_RESPONSE, " if plan.directed else "",
        buffer=body,
        scratch="buffer, " if view.body_size else "",
        answers="\n".join(
            _answer(names, view.address, view.has_values, number, each) for number, each in enumerate(asks)
        ),
        asks="\n".join(
            line
            for number, each in enumerate(asks)
            for line in _ask(names, view.address, view.has_values, number, each)
        ),
    )


def _members(asks: list[AskView], which: str) -> str:
    kinds = ((number, getattr(each, which)) for number, each in enumerate(asks))
    return "\n".join(f"        {kind} of_{number};" for number, kind in kinds if kind)


def _answer(names: Names, address: str, parts: bool, number: int, ask: AskView) -> str:
    if not ask.response:
        return f"        case {number}: break;"
    given = f"&world->response.of_{number}, "
    given += f"frame->{address}, " if address else ""
    given += "&frame->parts, " if parts else ""
    function = ask.response.removesuffix("_t")
    return f"        case {number}: return {function}_to_frame({given}world->wire, sizeof world->wire);"


def _ask(names: Names, address: str, parts: bool, number: int, ask: AskView) -> Iterator[str]:
    given = f", frame.{address}" if ask.addressed else ""
    given += ", &frame.parts" if parts else ""
    yield f"    case {number}:"
    if ask.request:
        decode = f"{ask.function}_decode(&world->request.of_{number}, frame.payload, frame.size)"
        yield f"        if ({decode} != {names.upper}_OK) {{ return -2; }}"
        given += f", &world->request.of_{number}"
    given += f", &world->response.of_{number}" if ask.response else ""
    yield f"        return {names.prefix}_ask_{ask.name}(&world->bus, &world->job{given}, now) ? 0 : -4;"
