"""Code of the library beside others' on a Cortex-M3: `python -m benchmarks.firmware_library [--write]`.

A Modbus RTU slave beside nanoMODBUS, whose sources the environment variable NANOMODBUS names (a folder with
nanomodbus.c; they are not part of this project), and messages of MAVLink 1 beside pymavlink's C generator.
`--write` writes the table to docs/firmware.md.
"""

from __future__ import annotations

import argparse
import contextlib
import importlib
import io
import os
import re
import sys
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path

from benchmarks.firmware_build import CORTEX_M3, PROGRAMS, ToolMissing, Workshop, size_of, temporary
from benchmarks.firmware_page import PAGE, rewritten, written
from benchmarks.firmware_stack import CallGraph, UnknownDepth
from benchmarks.peer import PeerMissing, load
from benchmarks.report import as_markdown
from qlinkgen.backends.c import generate
from qlinkgen.plan import Options
from qlinkgen.schema import find
from qlinkgen.schema import load as load_schema

#: Functions 1 to 6, 15 and 16.
COMMANDS = (
    "read_coils", "read_discrete_inputs", "read_holding_registers", "read_input_registers",
    "write_single_coil", "write_single_register", "write_multiple_coils", "write_multiple_registers",
)  # fmt: skip
#: What of nanoMODBUS the other program has not.
_WITHOUT = (
    "CLIENT", "STRERROR", "SERVER_READ_FILE_RECORD", "SERVER_WRITE_FILE_RECORD",
    "SERVER_READ_DEVICE_IDENTIFICATION", "SERVER_READ_WRITE_REGISTERS",
)  # fmt: skip
#: Numbers of messages of MAVLink 1 that a program decodes and encodes.
MESSAGES = (1, 4, 10, 21)
COLUMNS = ("", "flash", "RAM", "stack")

_HEAD = """\
#include <stddef.h>
#include <stdint.h>
volatile uint8_t port;
void send(const uint8_t *bytes, int size);
__attribute__((noinline)) void send(const uint8_t *bytes, int size)
{
    while (size-- > 0) {
        port = *bytes++;
    }
}
"""
_OWN = """\
#include "mavlink_1.h"
static mavlink_1_receiver_t receiver;
static uint8_t wire[MAVLINK_1_MAX_WIRE_SIZE];
static void answer(const mavlink_1_frame_t *frame)
{
    int size = 0;
    switch (frame->id) {
CASES
    default:
        break;
    }
    send(wire, size);
}
int main(void)
{
    mavlink_1_receiver_init(&receiver);
    for (;;) {
        mavlink_1_event_t event = mavlink_1_receive(&receiver, port);
        while (event != MAVLINK_1_EVENT_NONE) {
            if (event == MAVLINK_1_EVENT_FRAME) {
                const mavlink_1_frame_t frame = mavlink_1_receiver_frame(&receiver);
                answer(&frame);
            }
            event = mavlink_1_receiver_next(&receiver);
        }
    }
}
"""
_OWN_CASE = """\
    case MAVLINK_1_UPPER_ID: {
        mavlink_1_NAME_t message;
        if (mavlink_1_NAME_decode(&message, frame->payload, frame->size) == MAVLINK_1_OK) {
            size = mavlink_1_NAME_to_frame(&message, frame->system, &frame->parts, wire, sizeof wire);
        }
        break;
    }"""
_THEIRS = """\
#include "common/mavlink.h"
static mavlink_message_t frame;
static mavlink_status_t status;
static uint8_t wire[MAVLINK_MAX_PACKET_LEN];
int main(void)
{
    for (;;) {
        if (mavlink_parse_char(MAVLINK_COMM_0, port, &frame, &status) == MAVLINK_FRAMING_OK) {
            switch (frame.msgid) {
CASES
            default:
                continue;
            }
            send(wire, mavlink_msg_to_send_buffer(wire, &frame));
        }
    }
}
"""
_THEIR_CASE = """\
            case MAVLINK_MSG_ID_UPPER: {
                mavlink_NAME_t message;
                mavlink_msg_NAME_decode(&frame, &message);
                mavlink_msg_NAME_encode(frame.sysid, frame.compid, &frame, &message);
                break;
            }"""


def _header(folder: Path, name: str, options: Options) -> None:
    for path, text in generate(load_schema(find(name)), options).items():
        (folder / Path(path).name).write_text(text)


def _row(shop: Workshop, name: str, source: Path, options: Sequence[str] = ()) -> list[str]:
    """A program less the empty one, and its stack."""
    program = shop.link(CORTEX_M3, re.sub(r"\W+", "-", name), source, options)
    size = size_of(CORTEX_M3, program) - shop.size(CORTEX_M3, "empty", _empty(shop.folder))
    return [name, str(size.flash), str(size.ram), _stack(program)]


def _empty(folder: Path) -> Path:
    (folder / "empty.c").write_text("int main(void)\n{\n    for (;;) {\n    }\n}\n")
    return folder / "empty.c"


def _stack(program: Path) -> str:
    graph = CallGraph(CORTEX_M3, program)
    callers = graph.callers()
    compiled = {name for name, function in graph.functions.items() if function.compiled}
    # Kept by the linker without a direct call: reached through a pointer.
    graph.pointed_to = {name for name in compiled - {"main"} if not callers[name]}
    try:
        return str(graph.depth("main"))
    except UnknownDepth:
        return "unknown"


def modbus(folder: Path) -> Iterator[list[str]]:
    """The slave of benchmarks/firmware/modbus.h."""
    shop = Workshop(folder, folder)
    _header(folder, "modbus_rtu", Options(role="slave", only=COMMANDS))
    yield _row(shop, "Modbus RTU slave, this header", PROGRAMS / "modbus_own.c")
    place = os.environ.get("NANOMODBUS", "")
    if not place or not (Path(place) / "nanomodbus.c").is_file():
        raise PeerMissing("nanoMODBUS (set NANOMODBUS to a folder with nanomodbus.c)")
    without = [f"-DNMBS_{each}_DISABLED" for each in _WITHOUT]
    options = [f"-I{place}", *without, str(Path(place) / "nanomodbus.c")]
    yield _row(shop, "Modbus RTU slave, nanoMODBUS", PROGRAMS / "modbus_nano.c", options)


def mavlink(folder: Path) -> Iterator[list[str]]:
    """Some messages of MAVLink 1, decoded and encoded again."""
    shop = Workshop(folder, folder)
    _header(folder, "mavlink_1", Options())
    names = [each.name for each in load_schema(find("mavlink_1")).messages]
    pymavlink = load("pymavlink")
    mavgen = importlib.import_module("pymavlink.generator.mavgen")
    options = mavgen.Opts(
        output=str(folder / "mavlink"), wire_protocol="1.0", language="C", validate=False, strict_units=False
    )
    common = Path(pymavlink.__file__ or "").parent / "dialects" / "v10" / "common.xml"
    with contextlib.redirect_stdout(io.StringIO()):
        mavgen.mavgen(options, [str(common)])
    system = ("-std=gnu99", "-isystem", str(folder / "mavlink"))
    for number in MESSAGES:
        what = f"MAVLink 1, {number} message{'s' * (number > 1)}"
        own = _program(folder / "own.c", _OWN, _OWN_CASE, names[:number])
        yield _row(shop, f"{what}, this header", own)
        theirs = _program(folder / "theirs.c", _THEIRS, _THEIR_CASE, names[:number])
        yield _row(shop, f"{what}, pymavlink, one channel", theirs, (*system, "-DMAVLINK_COMM_NUM_BUFFERS=1"))


def _program(path: Path, text: str, case: str, names: Sequence[str]) -> Path:
    cases = [case.replace("NAME", name).replace("UPPER", name.upper()) for name in names]
    path.write_text(_HEAD + text.replace("CASES", "\n".join(cases)))
    return path


def main(arguments: Sequence[str] | None = None) -> int:
    """Measure and print; write if nothing is missing."""
    parser = argparse.ArgumentParser(description="Measure code of the library beside other people's.")
    parser.add_argument("--write", action="store_true", help="write the table into docs/firmware.md")
    options = parser.parse_args(arguments)
    rows: list[list[str]] = []
    missing: list[str] = []
    work: tuple[Callable[[Path], Iterator[list[str]]], ...] = (modbus, mavlink)
    for each in work:
        with temporary() as folder:
            try:
                rows.extend(each(Path(folder)))
            except (PeerMissing, ToolMissing) as fault:
                missing.append(str(fault))
    table = as_markdown(COLUMNS, rows)
    print(table)
    for reason in missing:
        print(f"firmware_library: not measured: {reason}", file=sys.stderr)
    if options.write and not missing:
        page = PAGE.read_text("utf-8")
        PAGE.write_text(rewritten(page, {**written(page), "library": table}), "utf-8")
        print(f"written: docs/{PAGE.name}")
    return 0


if __name__ == "__main__":
    sys.exit(main())
