"""Bounded model checking of a header: the text of the proofs, and the results of cbmc.

The proofs of a receiver and its invariant are in tests/c/proofs; those of the messages are generated here.
"""

from __future__ import annotations

import re
import subprocess
from dataclasses import dataclass, replace
from pathlib import Path

from qlinkgen.backends import c
from qlinkgen.backends.base import Options
from qlinkgen.backends.c import master
from qlinkgen.backends.c.framing import payload_arguments
from qlinkgen.backends.c.names import Names
from qlinkgen.model.frame import DelimitedFrame, Frame, FrameKinds
from qlinkgen.model.message import Field, Message
from qlinkgen.model.protocol import Protocol
from qlinkgen.model.types import Array, Blob
from qlinkgen.plan import plan_of
from qlinkgen.plan.ends import Hunt, InStep, Marks
from qlinkgen.plan.framing import FramePlan
from tests.support.cmaster_source import asks_of

PROOFS = Path(__file__).parents[1] / "c" / "proofs"
CHECKS = (
    "--bounds-check",
    "--pointer-check",
    "--pointer-overflow-check",
    "--signed-overflow-check",
    "--div-by-zero-check",
    "--undefined-shift-check",
    "--drop-unused-functions",
)
_MESSAGES = """#include "@p@.h"
#include <stdlib.h>
size_t nondet_size(void);
static size_t up_to(size_t most)
{
    const size_t size = nondet_size();
    __CPROVER_assume(size <= most);
    return size;
}
/* Memory of exactly this size, so that accesses past its end are detected. */
static uint8_t *bytes_of(size_t size)
{
    uint8_t *const bytes = (uint8_t *)malloc(size);
    __CPROVER_assume(bytes != NULL);
    return bytes;
}"""
_PROPERTY = re.compile(r"^\[(?P<name>\S+)\] (?P<text>.*): (?P<verdict>[A-Z]+)$", re.MULTILINE)


@dataclass(frozen=True)
class Verdict:
    """Results of cbmc by property, SUCCESS or FAILURE, or by goal, SATISFIED or FAILED."""

    properties: dict[str, tuple[str, str]]

    def failed(self) -> list[str]:
        """Failed properties, unreachable goals."""
        wrong = ("FAILURE", "FAILED", "UNKNOWN", "ERROR")
        return [f"{name}: {text}" for name, (text, verdict) in self.properties.items() if verdict in wrong]


def prove(cbmc: str, file: Path, function: str, unwind: int, *options: str) -> Verdict:
    """Check every property that `function` can reach; a loop that runs longer than `unwind` is a failure."""
    return _run(cbmc, file, function, unwind, *CHECKS, "--unwinding-assertions", *options)


def reach(cbmc: str, file: Path, function: str, unwind: int) -> Verdict:
    """Check that every goal of `function` can be reached."""
    return _run(cbmc, file, function, unwind, "-DREACHING", "--drop-unused-functions", "--cover", "cover")


def _run(cbmc: str, file: Path, function: str, unwind: int, *options: str) -> Verdict:
    command = [cbmc, file.name, "--function", function, "--unwind", str(unwind), *options]
    done = subprocess.run(command, cwd=file.parent, capture_output=True, text=True, timeout=300, check=False)
    found = {each["name"]: (each["text"], each["verdict"]) for each in _PROPERTY.finditer(done.stdout)}
    # 0: all hold; 10: some do not. Any other code is an error of cbmc.
    if done.returncode not in (0, 10) or not found:
        raise RuntimeError(
            f"{command} ended with {done.returncode}:\n{done.stdout[-2000:]}\n{done.stderr[-2000:]}"
        )
    return Verdict(found)


def write_header(protocol: Protocol, folder: Path, options: Options = Options()) -> Path:  # noqa: B008  # immutable
    """Write the header to a folder, its receiver without padding.

    Without padding, a write past the last array of the receiver is a write past the receiver.
    """
    (text,) = c.generate(protocol, options).values()
    end = f"}} {protocol.name}_receiver_t;"
    assert text.count(end) == 1
    file = folder / f"{protocol.name}.h"
    file.write_text(text.replace(end, f"}} __attribute__((packed)) {protocol.name}_receiver_t;"), "utf-8")
    return file


def write_receiver_proof(protocol: Protocol, folder: Path) -> Path:
    """Write the proofs of the receiver next to the header."""
    kind, store, places = _receiver_of(plan_of(protocol).frame)
    invariant = (PROOFS / f"invariant_{kind}.c").read_text("utf-8")
    text = (PROOFS / "receiver.c").read_text("utf-8")
    text = text.replace("@invariant@", invariant.rstrip()).replace("@store@", store)
    for key, value in places.items():
        text = text.replace(f"@{key}@", value)
    file = folder / f"receiver_{protocol.name}.c"
    file.write_text(text.replace("@p@", protocol.name).replace("@P@", protocol.name.upper()), "utf-8")
    return file


def write_master_proof(protocol: Protocol, folder: Path, command: str, most: int) -> Path:
    """Write the header, the master and its proofs of one command; a request has at most ``most`` bytes."""
    options = Options(only=(command,))
    write_header(protocol, folder, options)
    for path, made in master.generate(protocol, options).items():
        (folder / Path(path).name).write_text(made, "utf-8")
    _, _, places = _receiver_of(plan_of(protocol).frame)
    invariant = (PROOFS / "invariant_streamed.c").read_text("utf-8").rstrip()
    (ask,) = [each for each in asks_of(protocol) if each.doc == command]
    places |= {"ask": ask.name, "request": ask.request, "response": ask.response, "most": str(most)}
    text = (PROOFS / "master.c").read_text("utf-8").replace("@invariant@", invariant)
    for key, value in {**places, "p": protocol.name, "P": protocol.name.upper()}.items():
        text = text.replace(f"@{key}@", value)
    file = folder / f"master_{protocol.name}.c"
    file.write_text(text, "utf-8")
    return file


def _receiver_of(frame: FramePlan) -> tuple[str, str, dict[str, str]]:
    if isinstance(frame.receiver, InStep):
        return "packet", "payload", {}
    if isinstance(frame.receiver, Marks):
        return "marked", "buffer", {}
    assert isinstance(frame.receiver, Hunt)
    assert frame.envelope.length is not None
    return "streamed", "body", {"bias": str(frame.envelope.length.bias)}


def write_message_proof(protocol: Protocol, folder: Path) -> Path:
    """Write the proofs of the messages next to the header: `decoding` and `encoding` of any message."""
    names = Names(protocol)
    messages = [message for message in protocol.messages if message.fields]
    lines = [_MESSAGES.replace("@p@", protocol.name)]
    for message in messages:
        lines += _decoding(names, message) + _encoding(names, message)
    for what in ("decoding", "encoding"):
        cases = [f"    case {number}u: {what}_{names.stem(m)}(); break;" for number, m in enumerate(messages)]
        lines += [
            f"void {what}(void)",
            "{",
            "    switch (nondet_size()) {",
            *cases,
            "    default: break;",
            "    }",
            "}",
        ]
    file = folder / f"messages_{protocol.name}.c"
    file.write_text("\n".join(lines) + "\n", "utf-8")
    return file


def _decoding(names: Names, message: Message) -> list[str]:
    call, struct = _call(names, message)
    return [
        f"static void decoding_{names.stem(message)}(void)",
        "{",
        *struct,
        f"    const size_t size = up_to({names.constant(message)}_MAX_SIZE + 1u);",
        f"    (void){names.function(message)}_decode({call}bytes_of(size), size);",
        "}",
    ]


def _encoding(names: Names, message: Message) -> list[str]:
    call, struct = _call(names, message)
    return [
        f"static void encoding_{names.stem(message)}(void)",
        "{",
        *struct,
        f"    const size_t capacity = up_to({names.constant(message)}_MAX_SIZE + 1u);",
        f"    const int written = {names.function(message)}_encode({call}bytes_of(capacity), capacity);",
        '    __CPROVER_assert(written < 0 || (size_t)written <= capacity, "no more than there is room for");',
        "}",
    ]


def _call(names: Names, message: Message) -> tuple[str, list[str]]:
    # cbmc assumes any value for an uninitialised variable.
    held = [f"    {names.function(message)}_t message;"] if message.values else []
    beside = [f"    {names.prefix}_parts_t parts;"] if message.decided_by else []
    return payload_arguments(message, "&message", "&parts"), [*held, *beside]


def shrunk(protocol: Protocol, most: int) -> Protocol:
    """The protocol with short payloads: runs are cut, and fields that do not fit are removed."""
    kept = {m.name: _cut(m, most) for m in protocol.messages if m.min_size <= most}
    commands = tuple(
        replace(
            command,
            request=kept[command.request.name],
            response=command.response and kept[command.response.name],
        )
        for command in protocol.commands
        if all(m is None or m.name in kept for m in (command.request, command.response))
    )
    alone = {m.name for command in commands for m in (command.request, command.response) if m}
    paired = {m.name for command in protocol.commands for m in (command.request, command.response) if m}
    messages = tuple(message for name, message in kept.items() if name in alone or name not in paired)
    return replace(protocol, frame=_cut_frame(protocol.frame, most), commands=commands, messages=messages)


def _cut_frame(frame: Frame, most: int) -> Frame:
    if isinstance(frame, DelimitedFrame):
        return _cut_parts(frame, most)
    if isinstance(frame, FrameKinds):
        kinds = (replace(each, frame=_cut_parts(each.frame, most)) for each in frame.kinds)
        return replace(frame, kinds=tuple(kinds))
    return replace(frame, payload_max=most)


def _cut_parts(frame: DelimitedFrame, most: int) -> DelimitedFrame:
    parts = tuple(replace(p, max_size=most) if p.role == "payload" else p for p in frame.parts)
    return replace(frame, parts=parts)


def _cut(message: Message, most: int) -> Message:
    spare = message.max_size - most
    if spare <= 0:
        return message
    fields = list(message.fields)
    (index,) = [number for number, each in enumerate(fields) if not each.fixed]
    fields[index] = _cut_field(fields[index], spare)
    return replace(message, fields=tuple(fields))


def _cut_field(each: Field, spare: int) -> Field:
    kind = each.type
    assert isinstance(kind, Array | Blob)
    length = replace(kind.length, maximum=kind.items_in(kind.size_of(kind.length.maximum) - spare))
    if isinstance(kind, Blob):
        return replace(each, type=replace(kind, length=length, default=kind.default[: length.maximum]))
    return replace(each, type=replace(kind, length=length, default=kind.default[: length.maximum]))
