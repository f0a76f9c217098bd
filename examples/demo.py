"""One message of each protocol through construct, generated Python and compiled C, side by side.

Run it with ``make demo``. It generates all three protocols into a temporary folder, compiles a small C
program against each header, and checks that the three make the same bytes and read the same values. Needs
gcc, or the compiler in the environment variable CC.
"""

from __future__ import annotations

import importlib
import os
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Mapping
from dataclasses import dataclass, field
from decimal import Decimal
from pathlib import Path
from types import ModuleType
from typing import Any

from qlinkgen.backends import construct
from qlinkgen.model.message import Message
from qlinkgen.model.naming import snake, upper
from qlinkgen.model.protocol import Protocol
from qlinkgen.model.types import Scalar
from qlinkgen.model.values import Native, native_from_raw, raw_from_native, to_json
from qlinkgen.schema import find, load

FLAGS = ["-std=c99", "-O1", "-Wall", "-Wextra", "-Wpedantic", "-Werror"]


@dataclass(frozen=True)
class Case:
    """A message with its values; ``request`` is the request of a packet's response."""

    protocol: str
    message: str
    values: Mapping[str, Native]
    address: Mapping[str, int] = field(default_factory=dict)
    request: str = ""


CASES = (
    Case(
        "qlink",
        "motion.response",
        # 0xA5 in the data shows the stuffing: a 00 follows it on the wire.
        {"counter": 7, "inputs": 0xA5, "position": -123456, "motor_status": 3, "fifo_space": 24},
        {"node": 3},
    ),
    Case("trio", "direct_variable_transfer", {"number": 7, "value": Decimal("-0.25")}, {"address": 2}),
    Case("mc1231a", "get_pos.response", {"value": 1234567}, request="get_pos.request"),
)


@dataclass(frozen=True)
class Shown:
    """The result of one output: the bytes of a message, and the values read back from them."""

    wire: bytes
    values: Mapping[str, Any]


def main() -> int:
    """Run every case; 0 if all agree."""
    compiler = os.environ.get("CC") or shutil.which("gcc") or shutil.which("cc")
    if compiler is None:
        print("the demo compiles C; on Debian: apt-get install gcc libc6-dev", file=sys.stderr)
        return 2
    try:
        with tempfile.TemporaryDirectory(prefix="qlinkgen-demo-") as name:
            _generate(Path(name))
            agreed = [_show(case, Path(name), compiler) for case in CASES]
    except subprocess.CalledProcessError as error:
        print(f"{' '.join(error.cmd)} failed with {error.returncode}", file=sys.stderr)
        return 1
    print("All three agree." if all(agreed) else "THEY DIFFER: see above.")
    return 0 if all(agreed) else 1


def _generate(folder: Path) -> None:
    """Run `qlinkgen generate`."""
    command = [sys.executable, "-m", "qlinkgen", "generate", "--output", str(folder)]
    print("$ qlinkgen generate --output DIR")
    print(subprocess.run(command, check=True, capture_output=True, text=True).stdout)


def _show(case: Case, folder: Path, compiler: str) -> bool:
    protocol = load(find(case.protocol))
    message = protocol.by_name[case.message]
    results = {
        "construct": _by_construct(case, protocol, message),
        "Python": _by_python(case, protocol, message),
        "C": _by_c(case, protocol, message, folder, compiler),
    }
    where = "".join(f", {name} {number}" for name, number in case.address.items())
    print(f"{protocol.title}: {case.message}{where}")
    rows = [("", "wire bytes", *(value.name for value in message.values))]
    rows += [(name, shown.wire.hex(" "), *map(str, shown.values.values())) for name, shown in results.items()]
    widths = [max(map(len, column)) for column in zip(*rows, strict=True)]
    for row in rows:
        print("  " + "  ".join(cell.ljust(width) for cell, width in zip(row, widths, strict=True)).rstrip())
    same = len({row[1:] for row in rows[1:]}) == 1
    print(f"  {'equal' if same else 'DIFFERENT'}\n")
    return same


def _readable(message: Message, found: Mapping[str, Any]) -> dict[str, Any]:
    return {value.name: to_json(value, found[value.name]) for value in message.values}


def _by_construct(case: Case, protocol: Protocol, message: Message) -> Shown:
    live = construct.live(protocol)
    asked = live.wrap(case.request, live.payload(case.request, {})) if case.request else b""
    payload = live.payload(case.message, case.values)
    wire = live.wrap(case.message, payload, next(iter(case.address.values()), 0), asked)
    found = live.parse(message.direction, wire, asked)
    return Shown(wire, _readable(message, found.fields))


def _by_python(case: Case, protocol: Protocol, message: Message) -> Shown:
    codec: ModuleType = importlib.import_module(f"qlinkgen.codecs.{protocol.name}")
    sent = codec.MESSAGES[case.message](**case.address, **case.values)
    if case.request:
        asked = codec.MESSAGES[case.request]()
        wire = sent.to_frame(asked)
        found = codec.decode_response(wire, asked)
    else:
        wire = sent.to_frame()
        suffix = "" if message.direction == "message" else f"_{message.direction}"
        found = getattr(codec, f"decode{suffix}")(wire)
    return Shown(wire, _readable(message, {name: getattr(found, name) for name in case.values}))


PROGRAM = """\
#include <stdio.h>
#include "@protocol@.h"

int main(void)
{
    @name@_t sent = @NAME@_INIT;
    @name@_t read = @NAME@_INIT;
    int status = @PROTOCOL@_ERROR_TRUNCATED;
@set@
@exchange@
    for (int index = 0; index < size; ++index) {
        printf("%02x", wire[index]);
    }
@print@
    return status == @PROTOCOL@_OK ? 0 : 1;
}
"""

#: A frame: encoded whole, then fed to the receiver byte by byte as an interrupt would.
FRAME = """\
    uint8_t wire[@PROTOCOL@_MAX_WIRE_SIZE];
    int size = @name@_to_frame(&sent, @address@, wire, sizeof wire);
    @protocol@_receiver_t receiver;
    @protocol@_receiver_init(&receiver);
    for (int index = 0; index < size; ++index) {
        if (@protocol@_receive(&receiver, wire[index]) == @PROTOCOL@_EVENT_FRAME) {
            @protocol@_frame_t frame = @protocol@_receiver_frame(&receiver);
            status = @name@_decode(&read, frame.payload, frame.size);
        }
    }"""

#: A packet's response: its check value covers the request, which for get_pos is only the command byte.
PACKET = """\
    uint8_t wire[@PROTOCOL@_MAX_WIRE_SIZE];
    int size = @name@_to_frame(&sent, @request@_ID, wire, sizeof wire);
    status = @name@_from_frame(&read, @request@_ID, wire, (size_t)size);"""


def _by_c(case: Case, protocol: Protocol, message: Message, folder: Path, compiler: str) -> Shown:
    source = folder / f"demo_{protocol.name}.c"
    program = source.with_suffix("")
    source.write_text(_program(case, protocol, message))
    command = [compiler, *FLAGS, f"-I{folder / 'c'}", str(source), "-o", str(program)]
    subprocess.run(command, check=True)
    lines = subprocess.run([str(program)], check=True, capture_output=True, text=True).stdout.split()
    raws = dict(line.split("=") for line in lines[1:])
    found = {
        value.name: native_from_raw(_scalar(value.type), int(raws[value.name])) for value in message.values
    }
    return Shown(bytes.fromhex(lines[0]), _readable(message, found))


def _scalar(kind: object) -> Scalar:
    assert isinstance(kind, Scalar), "the demo's messages contain only numbers"
    return kind


def _program(case: Case, protocol: Protocol, message: Message) -> str:
    values = {value.name: raw_from_native(value, case.values[value.name]) for value in message.values}
    put = [f"    sent.{name} = {number};" for name, number in values.items()]
    got = [f'    printf("\\n{name}=%lld", (long long)read.{name});' for name in values]
    words = {
        "exchange": PACKET if case.request else FRAME,
        "set": "\n".join(put),
        "print": "\n".join(got),
        "address": str(next(iter(case.address.values()), "")),
        "request": upper(f"{protocol.name}_{case.request}"),
        "protocol": protocol.name,
        "PROTOCOL": upper(protocol.name),
        "name": f"{protocol.name}_{snake(message.name)}",
        "NAME": upper(f"{protocol.name}_{message.name}"),
    }
    text = PROGRAM
    for word, replacement in words.items():
        text = text.replace(f"@{word}@", replacement)
    return text


if __name__ == "__main__":
    sys.exit(main())
