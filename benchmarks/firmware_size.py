"""Flash, RAM and stack of the headers: the core with each form of the CRC, and the cost of each message."""

from __future__ import annotations

import functools
from collections.abc import Collection
from dataclasses import dataclass
from pathlib import Path

from benchmarks.firmware_build import PROGRAMS, Size, Target, Workshop, in_parallel, size_of
from benchmarks.firmware_stack import CallGraph
from qlinkgen.backends import c
from qlinkgen.backends.base import Options
from qlinkgen.backends.c.names import Names
from qlinkgen.model.message import Message
from qlinkgen.model.protocol import Protocol
from qlinkgen.schema import find, load

ANSWER, PAYLOAD = "ANSWER", "PAYLOAD"
CRC_FORMS = ("FOLD", "LOOP", "NIBBLE", "TABLE")
PROTOCOLS = ("qlink", "trio")


@dataclass(frozen=True)
class Core:
    """A program with the core less the same program without it."""

    size: Size
    stack: int


@dataclass(frozen=True)
class Added:
    """Size that the two functions of a message add to a program with all others."""

    size: Size
    stack: int


@dataclass(frozen=True)
class Messages:
    """Cost of the messages of a protocol one by one, and of all together without the receiver."""

    each: dict[str, Added]
    together: Size
    receive_stack: int

    @property
    def mean(self) -> float:
        """Average flash per message, shared code included."""
        return self.together.flash / len(self.each)


@dataclass(frozen=True)
class Costs:
    """The messages of a protocol.

    Attributes:
        fields: get and put, `_decode` and `_encode`, of messages with fields; the budget applies to these.
        framed: `_decode` and `_to_frame` of every message.
        structs: RAM of a message with fields.
    """

    fields: Messages
    framed: Messages
    structs: dict[str, int]


# The programs of core.c: each form of the CRC with one message; the small one without any, in two ways.
CORES = {
    **{form: ("-DMESSAGE", f"-DQLINK_CRC_FORM=QLINK_CRC_FORM_{form}") for form in CRC_FORMS},
    ANSWER: ("-DANSWER",),
    PAYLOAD: ("-DPAYLOAD",),
}


def cores(shop: Workshop, target: Target) -> dict[str, Core]:
    """Receiver, encode and CRC, for each of CORES."""
    return {name: core(shop, target, name) for name in CORES}


def core(shop: Workshop, target: Target, name: str) -> Core:
    """One of CORES."""
    source = PROGRAMS / "core.c"
    program = shop.link(target, f"core-{name}", source, CORES[name])
    empty = shop.size(target, "empty", source, ["-DEMPTY"])
    return Core(size_of(target, program) - empty, CallGraph(target, program).depth("main"))


@functools.cache
def protocol(name: str) -> Protocol:
    """A shipped protocol."""
    return load(find(name))


def functions(description: Protocol, *, framed: bool) -> tuple[str, dict[str, list[str]]]:
    """A program with the receiver and every message's functions, and the names of each message's functions.

    Each is called in a wrapper with the same parameters. The linker keeps the chosen wrappers, so the size is
    that of the functions without any call of them.
    """
    names, prefix = Names(description), description.name
    parts = [f'#include "{prefix}.h"', _receiver(prefix)]
    kept = {}
    for message in description.messages:
        if not framed and not message.values:
            continue
        stem = names.stem(message)
        kept[message.name] = [f"put_{stem}"]
        parts.append(_put(names, message, framed=framed))
        if message.values:
            kept[message.name].append(f"get_{stem}")
            parts.append(_get(names, message))
    return "\n".join([*parts, "int main(void) { return 0; }", ""]), kept


RECEIVER = ("feed", "frame")


def _receiver(prefix: str) -> str:
    return f"""int feed({prefix}_receiver_t *to, uint8_t byte) {{ return (int){prefix}_receive(to, byte); }}
void frame({prefix}_receiver_t *from, {prefix}_frame_t *to) {{ *to = {prefix}_receiver_frame(from); }}"""


def _put(names: Names, message: Message, *, framed: bool) -> str:
    function, stem = names.function(message), names.stem(message)
    if not framed:
        return f"""int put_{stem}(const {function}_t *message, uint8_t *payload, size_t capacity)
{{ return {function}_encode(message, payload, capacity); }}"""
    given, passed = (f"const {function}_t *message, ", "message, ") if message.values else ("", "")
    return f"""int put_{stem}({given}uint8_t node, uint8_t *wire, size_t capacity)
{{ return {function}_to_frame({passed}node, wire, capacity); }}"""


def _get(names: Names, message: Message) -> str:
    function, stem = names.function(message), names.stem(message)
    return f"""int get_{stem}({function}_t *message, const uint8_t *payload, size_t size)
{{ return {function}_decode(message, payload, size); }}"""


def costs(shop: Workshop, target: Target, name: str) -> Costs:
    """Cost of each message on top of the receiver and all others: only its fields, and with the frame."""
    fields, framed = (messages(shop, target, name, framed=framed) for framed in (False, True))
    return Costs(fields, framed, _structs(shop, target, protocol(name)))


def messages(shop: Workshop, target: Target, name: str, *, framed: bool) -> Messages:
    """Link the functions of all messages, and those of all but each."""
    text, kept = functions(protocol(name), framed=framed)
    called = f"{name}-{'frames' if framed else 'fields'}"
    source = shop.folder / f"{target.name}-{called}.c"
    source.write_text(text)
    compiled = shop.compile(target, called, source)

    def link(build: str, chosen: Collection[str]) -> Path:
        roots = [*RECEIVER, *(root for message in kept if message in chosen for root in kept[message])]
        return shop.link(target, f"{called}-{build}", compiled, [f"-Wl,-u,{root}" for root in roots])

    def without(message: str) -> Size:
        return size_of(target, link(f"without-{message}", kept.keys() - {message}))

    receiver, full = link("receiver", ()), link("all", kept)
    graph, whole = CallGraph(target, full, stacks=compiled.parent), size_of(target, full)
    less = in_parallel({message: functools.partial(without, message) for message in kept})
    each = {
        message: Added(whole - less[message], max(map(graph.depth, roots))) for message, roots in kept.items()
    }
    receive = max(map(graph.depth, RECEIVER))
    return Messages(each, whole - size_of(target, receiver), receive)


@dataclass(frozen=True)
class Dispatch:
    """A slave's receiver, dispatch and every answer, from a header with some of the commands."""

    lines: int
    flash: int
    stack: int


CHOICES = {
    "all": Options(),
    "--role slave": Options(role="slave"),
    "--role slave --only motion": Options(role="slave", only=("motion",)),
}


def dispatch(shop: Workshop, target: Target) -> dict[str, Dispatch]:
    """Size of a header with `--role` and `--only`, and of a slave that dispatches all its commands."""
    empty = shop.size(target, "empty", PROGRAMS / "core.c", ["-DEMPTY"])
    found = {}
    for number, (name, options) in enumerate(CHOICES.items()):
        part = Workshop(shop.folder / f"{target.name}-choice-{number}")
        part.folder.mkdir(exist_ok=True)
        part.headers = part.folder
        (text,) = c.generate(protocol("qlink"), options).values()
        (part.headers / "qlink.h").write_text(text)
        program = part.link(target, "dispatch", PROGRAMS / "dispatch.c")
        stack = CallGraph(target, program, pointed_to=()).depth("main")
        found[name] = Dispatch(text.count("\n"), (size_of(target, program) - empty).flash, stack)
    return found


def _structs(shop: Workshop, target: Target, description: Protocol) -> dict[str, int]:
    names = Names(description)
    sizes = {
        names.stem(each): f"sizeof({names.function(each)}_t)" for each in description.messages if each.values
    }
    found = shop.values(target, f"{description.name}.h", sizes)
    return {each.name: found[names.stem(each)] for each in description.messages if each.values}


def buffers(shop: Workshop, target: Target, name: str) -> dict[str, int]:
    """Bytes of the variables of a program: receiver, longest frame, dispatch table; and longest payload."""
    upper = name.upper()
    table = "slave" if name == "qlink" else "listener"
    return shop.values(
        target,
        f"{name}.h",
        {
            "receiver": f"sizeof({name}_receiver_t)",
            "payload": f"{upper}_MAX_PAYLOAD_SIZE",
            "wire": f"{upper}_MAX_WIRE_SIZE",
            "table": f"sizeof({name}_{table}_t)",
        },
    )
