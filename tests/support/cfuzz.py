"""libFuzzer harnesses for headers: three targets, for one protocol or several in one program."""

from __future__ import annotations

import subprocess
from pathlib import Path

from qlinkgen.model.protocol import Protocol
from qlinkgen.plan.ends import Hunt, Marks, Rescan
from tests.support.cfuzz_dispatch import dispatch
from tests.support.cfuzz_source import Harness

TARGETS = ("receiver", "decoders", "dispatch")
#: Without optimisation the fuzzer sees nearly every branch of the source, and compiling with sanitizers takes
#: a fifth of the time.
FUZZER = (
    "-std=c99",
    "-gline-tables-only",
    "-O0",
    "-fsanitize=fuzzer,address,undefined",
    "-fno-sanitize-recover=all",
)


def program(protocols: list[Protocol], targets: tuple[str, ...]) -> str:
    """The text of the program; the first byte of an input selects the protocol, and the target if several."""
    harnesses = [Harness(protocol) for protocol in protocols]
    lines = [f"#define {h.c.upper}_ENABLE_{what} 1" for h in harnesses for what in ("FLOAT", "NAMES")]
    lines += [f'#include "{h.c.prefix}.h"' for h in harnesses]
    parts = [(h, target) for h in harnesses for target in targets]
    cases = [
        f"    case {number}u: {h.c.prefix}_{target}_(&input); break;"
        for number, (h, target) in enumerate(parts)
    ]
    text = "".join(h.text() + "".join(_WRITERS[target](h) for target in targets) for h in harnesses)
    main = harnesses[0].part("main", parts=str(len(parts)), cases="\n".join(cases))
    return "\n".join(lines) + "\n" + harnesses[0].part("head") + text + main


def compiled(compiler: str, folder: Path, name: str, *flags: str) -> subprocess.CompletedProcess[str]:
    """Build the program NAME of NAME.c in a folder."""
    command = [compiler, *flags, f"{name}.c", "-o", name, "-lm"]
    return subprocess.run(command, cwd=folder, capture_output=True, text=True, timeout=600, check=False)


# Receiver


def _receiver(h: Harness) -> str:
    kind = h.frame.receiver
    return h.part(
        "receiver",
        init=h.filled(", answer ? @P@_RESPONSE : @P@_REQUEST" if h.c.directed else ""),
        delivered=_made_of_it(h) if isinstance(kind, Hunt | Rescan) else "",
        next=_events(h, "next") if h.c.rescans else "",
        finish=_finish(h),
        lawful=str(_lawful(h.protocol)),
        # After a false start the last frame may be delivered only at the end of the stream.
        promised="!answer" if h.c.packets else "true" if isinstance(kind, Hunt | Marks) else "false",
    )


def _lawful(protocol: Protocol) -> int:
    return protocol.bus.nodes[0] if protocol.bus.nodes else 0


def _made_of_it(h: Harness) -> str:
    made = h.frame_encode("frame.payload", "frame.size", "wire", "sizeof wire")
    return h.filled(
        "    {\n        uint8_t wire[2u * @P@_MAX_FRAME_SIZE];\n"
        f"        const int size = {made};\n"
        "        REQUIRE(size >= 0 && @p@_whole_(answer, wire, (size_t)size));\n    }"
    )


def _events(h: Harness, name: str) -> str:
    return h.filled(
        "    while (event != @P@_EVENT_NONE) {\n"
        f"        event = @p@_receiver_{name}(receiver);\n"
        "        @p@_event_(answer, receiver, event);\n    }"
    )


def _finish(h: Harness) -> str:
    if h.c.packets:
        # Packets have no delimiter: the host must resynchronise.
        return h.filled("    @p@_receiver_init(receiver);")
    if h.c.rescans:
        return (
            h.filled("    {\n    @p@_event_t event = @P@_EVENT_FRAMING;\n") + _events(h, "finish") + "\n    }"
        )
    return ""


# Decoders


def _decoders(h: Harness) -> str:
    parts, call = "", "break;"
    if isinstance(h.frame.receiver, Hunt | Rescan):
        parts, call = _any_frame(h), "@p@_parts_(input); break;"
    elif h.c.packets:
        parts, call = _any_answer(h), "@p@_parts_(input); break;"
    return h.part(
        "decoders",
        set_address=h.address("whom"),
        sums=h.filled("    @sums@", sums=_SUMS) if h.c.sum_bits else "",
        enums="\n".join(line for enum in h.protocol.enums for line in _enum(h, enum.name)),
        parts=parts,
        parts_call=call.removesuffix(" break;") if call != "break;" else "",
    )


def _enum(h: Harness, name: str) -> list[str]:
    call = f"{h.c.prefix}_{name}"
    return [
        "    {",
        f"        const {call}_t value = ({call}_t)id;",
        f'        REQUIRE({call}_is_valid(value) == (strcmp({call}_name(value), "?") != 0));',
        "    }",
    ]


def _any_frame(h: Harness) -> str:
    """Any id, address and payload in a buffer of any size: an encoded frame can be decoded."""
    made = h.frame_encode("bytes", "input->left", "wire", "capacity")
    lines = [
        "/* Any id, address and payload as a frame. */",
        "static void @p@_parts_(input_t *input)",
        "{",
        "    const bool answer = (take(input) & 1u) != 0u;",
        "    const size_t capacity = take_capacity(input, 2u * @P@_MAX_FRAME_SIZE);",
        "    uint8_t *const wire = room(capacity);",
        "    @p@_frame_t frame;",
        "    uint8_t *bytes;",
        "    int size;",
        "    frame.@id@ = take(input);",
        h.address("take_number(input, @address_size@u)"),
        "    bytes = copy(input->at, input->left);",
        f"    size = {made};",
        "    REQUIRE(size <= (int)capacity);",
        # Without a length in the frame, only valid messages are frames.
        "    if (size >= 0) { REQUIRE(@p@_whole_(answer, wire, (size_t)size)@or_unknown@); }",
        "    release(bytes);",
        "    release(wire);",
        "}",
    ]
    return h.filled("\n".join(lines) + "\n", or_unknown=" || true" if h.c.directed else "")


def _any_answer(h: Harness) -> str:
    """Any bytes as the response to any request; a decoded one is encoded again."""
    cases = []
    for number, message in enumerate(h.protocol.messages):
        if message.direction == "response":
            function, own = h.c.function(message), "&message, " if message.values else ""
            cases += [
                f"    case {number}u: {{",
                *([f"        {function}_t message;"] if message.values else []),
                f"        const int status = {function}_from_frame({own}sum, wire, size);",
                "        @p@_outcomes_[found][6][-status] = 1u;",
                "        if (status == @P@_OK) {",
                f"            REQUIRE({function}_to_frame({own}sum, again, sizeof again) == (int)size);",
                "            REQUIRE(memcmp(again, wire, size) == 0);",
                "        }",
                "        break;",
                "    }",
            ]
    lines = [
        "/* Any bytes as the answer to a request. */",
        "static void @p@_parts_(input_t *input)",
        "{",
        "    const unsigned found = @p@_find_(true, take(input));",
        "    const uint@sum_bits@_t sum = (uint@sum_bits@_t)take_number(input, @sum_bits@u / 8u);",
        "    const size_t size = input->left;",
        "    uint8_t *const wire = copy(input->at, size);",
        "    uint8_t again[@P@_MAX_WIRE_SIZE];",
        "    switch (found) {",
        *cases,
        "    default: break;",
        "    }",
        "    release(wire);",
        "}",
    ]
    return h.filled("\n".join(lines) + "\n")


_SUMS = """{
        const uint@sum_bits@_t sum = @p@_request_sum(wire, input->left);
        @p@_frame_t frame;
        if (@p@_frame_decode(&frame, wire, input->left) == @P@_OK) { REQUIRE(sum == @p@_frame_sum(&frame)); }
    }"""


_WRITERS = {"receiver": _receiver, "decoders": _decoders, "dispatch": dispatch}
