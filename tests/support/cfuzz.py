"""A libFuzzer harness for a header: any bytes into the receiver, the frame decoder and every decoder."""

from __future__ import annotations

from qlinkgen.backends.c.names import Names
from qlinkgen.model.frame import DelimitedFrame, PacketFrame
from qlinkgen.model.message import Message
from qlinkgen.model.protocol import Protocol

_PROGRAM = r"""
#include "@p@.h"
#include <stdlib.h>
#include <string.h>

/* What was decoded can be encoded again, to the same bytes but for those that are ignored. */
@round_trips@

static void decode_any(uint8_t which, const uint8_t *data, size_t size)
{
    switch (which % @count@u) {
@cases@
    default: break;
    }
}

static void carried(const @p@_frame_t *frame)
{
    volatile uint8_t sum = 0u;
    for (size_t index = 0u; index < frame->size; ++index) { sum = (uint8_t)(sum + frame->payload[index]); }
@checks@
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size);
int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
    @p@_receiver_t *receiver;
    @p@_frame_t frame;
    uint8_t *exact;
@buffer@
    if (size < 2u) { return 0; }
    /* A copy of its own, so that a byte read behind it is noticed. */
    exact = (uint8_t *)malloc(size - 1u);
    if (exact == NULL) { return 0; }
    memcpy(exact, data + 1, size - 1u);
    decode_any(data[0], exact, size - 1u);
    if (@p@_frame_decode(@direction@&frame, @pass_buffer@exact, size - 1u) == @P@_OK) { carried(&frame); }
    receiver = (@p@_receiver_t *)malloc(sizeof *receiver);
    if (receiver != NULL) {
        @p@_receiver_init(receiver@init@);
        for (size_t index = 0u; index + 1u < size; ++index) {
            @p@_event_t event = @p@_receive(receiver, exact[index]);
            while (event != @P@_EVENT_NONE) {
                if (event == @P@_EVENT_FRAME) {
                    frame = @p@_receiver_frame(receiver);
                    carried(&frame);
                }
                event = @next@;
            }
        }
        free(receiver);
    }
    free(exact);
    return 0;
}
"""


def harness(protocol: Protocol) -> str:
    """The program's text."""
    names, frame = Names(protocol), protocol.frame
    decoded = [message for message in protocol.messages if message.fields]
    directed = isinstance(frame, DelimitedFrame) and (frame.part("length") is None or not frame.preamble)
    unpacks = isinstance(frame, DelimitedFrame) and frame.stuffing is not None
    rescans = isinstance(frame, DelimitedFrame) and not frame.unique_preamble
    directions = ["request"] if isinstance(frame, PacketFrame) else list(protocol.directions)
    places = {
        "round_trips": "\n".join(_round_trip(names, message) for message in decoded),
        "count": str(len(decoded)),
        "cases": "\n".join(
            f"    case {i}: take_{names.stem(m)}(data, size); break;" for i, m in enumerate(decoded)
        ),
        "checks": "\n".join(f"    (void)@p@_{direction}_check(frame);" for direction in directions),
        "direction": "(data[0] & 1u) != 0u ? @P@_REQUEST : @P@_RESPONSE, " if directed else "",
        "init": ", (data[0] & 1u) != 0u ? @P@_REQUEST : @P@_RESPONSE" if directed else "",
        "buffer": "    static uint8_t buffer[@P@_DECODE_BUFFER_SIZE];" if unpacks else "",
        "pass_buffer": "buffer, " if unpacks else "",
        "next": "@p@_receiver_next(receiver)" if rescans else "@P@_EVENT_NONE",
    }
    text = _PROGRAM
    for key, value in places.items():
        text = text.replace(f"@{key}@", value)
    return text.replace("@p@", names.prefix).replace("@P@", names.upper)


def _round_trip(names: Names, message: Message) -> str:
    function, constant = names.function(message), names.constant(message)
    struct = f"    {function}_t first;\n    {function}_t second;\n" if message.values else ""
    one, two = ("&first, ", "&second, ") if message.values else ("", "")
    return (
        f"static void take_{names.stem(message)}(const uint8_t *data, size_t size)\n{{\n{struct}"
        f"    uint8_t payload[{constant}_MAX_SIZE];\n    int written;\n"
        f"    if ({function}_decode({one}data, size) != {names.upper}_OK) {{ return; }}\n"
        f"    written = {function}_encode({one}payload, sizeof payload);\n"
        "    if (written < 0) { abort(); }\n"
        f"    if (size != 0u && (size_t)written != size) {{ abort(); }}\n"
        f"    if ({function}_decode({two}payload, (size_t)written) != {names.upper}_OK) {{ abort(); }}\n}}"
    )
