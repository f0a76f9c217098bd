"""The fuzz target dispatch: a slave with any response, and a listener with any message."""

from __future__ import annotations

from qlinkgen.model.message import Message
from tests.support.cfuzz_source import Harness


def dispatch(h: Harness) -> str:
    """The text of the target for one protocol."""
    slave, master = h.first == "request", bool(h.c.listener)
    return h.part(
        "dispatch",
        slave=_slave(h) if slave else "",
        master=_master(h) if master else "",
        call_slave="@p@_ask_(input);" if slave else "@p@_listen_(input);",
        call_master="@p@_listen_(input);" if master else "@p@_ask_(input);",
    )


def _slave(h: Harness) -> str:
    asked = [message for message in h.protocol.messages if message.direction != "response"]
    members = [f"        slave.{h.c.slave_member(m)} = {h.c.function(m)}_asked_;" for m in asked]
    answers = {c.request.name: c.response for c in h.protocol.commands}
    return h.part(
        "slave",
        handlers="\n".join(line for m in asked for line in _handler(h, m, answers.get(m.name))),
        members="\n".join(members),
        whom=_whom(h),
        for_me=_for_me(h),
        rejects="!supported" if h.c.packets else "false",
        silent=" || slave.broadcast" if h.c.address else "",
        answered="\n".join(_answer_of_packet(h) if h.c.packets else _answer_of_frame(h)),
    )


def _for_me(h: Harness) -> str:
    """Only requests to this slave and broadcasts reach its functions."""
    if not h.c.address:
        return "true"
    own = f"frame.{h.c.address} == slave.{h.c.address}"
    broadcast = h.protocol.bus.broadcast
    return own if broadcast is None else f"{own} || frame.{h.c.address} == {broadcast}u"


def _whom(h: Harness) -> str:
    """Address of the slave and of the request: mostly the same, sometimes any."""
    if not h.c.address:
        return ""
    first, last = h.protocol.bus.nodes or (0, 255)
    own, kind = f"slave.{h.c.address}", f"uint{h.c.address_bits}_t"
    any_address = f"({kind})take_number(input, @address_size@u)"
    at_least = f"{own} >= {first}u && " if first else ""
    lines = [
        f"    {own} = ({kind})({first}u + whose % {last - first + 1}u);",
        f"    if (whose >= 0xE0u) {{ {own} = {any_address}; }}",
        f"    lawful = {at_least}{own} <= {last}u;",
        h.address(own),
        f"    if ((whose & 3u) == 3u) {{ frame.{h.c.address} = {any_address}; }}",
    ]
    return "\n".join(lines)


def _handler(h: Harness, request: Message, response: Message | None) -> list[str]:
    """A function of a slave's table: its request can be encoded; its response is taken from the input."""
    function, takes, gives = h.c.function(request), bool(request.values), bool(response and response.values)
    parameters = "@p@_slave_t *slave"
    parameters += f", const {function}_t *request" if takes else ""
    parameters += f", {h.c.function(response)}_t *response" if response and gives else ""
    lines = [
        f"static {'bool' if response else 'void'} {function}_asked_({parameters})",
        "{",
        "    @p@_context_t *const context = (@p@_context_t *)slave->context;",
        "    uint8_t bytes[@P@_MAX_PAYLOAD_SIZE + 1u];",
        "    ++context->called;",
        "    (void)bytes;",
    ]
    if takes:
        lines.append(f"    REQUIRE({h.put(request, 'request', 'bytes', 'sizeof bytes')} >= 0);")
    if response:
        lines.append("    const bool says = (take(&context->input) & 7u) != 7u;")
        if gives:
            lines.append(f"    {h.c.function(response)}_fill_(response, &context->input);")
        can = h.put(response, "response", "bytes", "sizeof bytes")
        lines += [f"    context->answers = says && {can} >= 0;", "    return says;"]
    return [*lines, "}"]


def _answer_of_frame(h: Harness) -> list[str]:
    """The response is a valid frame, from this slave and for this command."""
    address = [f"        REQUIRE(back.{h.c.address} == slave.{h.c.address});"] if h.c.address else []
    pairs = [(command.request, command.response) for command in h.protocol.commands if command.response]
    same = "back.@id@ == frame.@id@" if all(q.id == r.id for q, r in pairs) else "true"
    return [
        "        @p@_frame_t back;",
        *(["        uint8_t buffer[@P@_DECODE_BUFFER_SIZE];"] if h.c.unpacks else []),
        f"        REQUIRE({h.frame_decode('back', '@P@_RESPONSE', 'exact', 'answer')} == @P@_OK);",
        "        REQUIRE(@p@_@second@_check(&back) == @P@_OK);",
        f"        REQUIRE({same});",
        *address,
    ]


def _answer_of_packet(h: Harness) -> list[str]:
    """The response is that of the command, or the rejection of an unsupported one."""
    cases = []
    for command in h.protocol.commands:
        if command.response:
            function, own = h.c.function(command.response), "&message, " if command.response.values else ""
            cases += [
                f"        case {h.c.constant(command.request)}_ID: {{",
                *([f"            {function}_t message;"] if own else []),
                f"            status = {function}_from_frame({own}@p@_frame_sum(&frame), exact, answer);",
                "            break;",
                "        }",
            ]
    return [
        "        int status = @P@_ERROR_UNKNOWN;",
        f"        switch (frame.{h.c.id}) {{",
        *cases,
        "        default: break;",
        "        }",
        # The check value of a rejection may happen to be the right one.
        "        REQUIRE(status == @P@_OK || (!supported && status == @P@_ERROR_ILLEGAL));",
    ]


def _master(h: Harness) -> str:
    received = [message for message in h.protocol.messages if message.direction != "request"]
    members = [f"        listener.{h.c.callback_member(m)} = {h.c.function(m)}_callback_;" for m in received]
    return h.part(
        "listener",
        callbacks="\n".join(line for message in received for line in _callback(h, message)),
        members="\n".join(members),
        set_address=h.address("take_number(input, @address_size@u)"),
    )


def _callback(h: Harness, message: Message) -> list[str]:
    """A function of a listener's table: its message can be encoded."""
    function, takes = h.c.function(message), bool(message.values)
    parameters = f"@p@_{h.c.listener}_t *listener"
    parameters += f", uint{h.c.address_bits}_t whom" if h.c.address else ""
    parameters += f", const {function}_t *message" if takes else ""
    encoded = h.put(message, "message", "bytes", "sizeof bytes")
    return [
        f"static void {function}_callback_({parameters})",
        "{",
        "    uint8_t bytes[@P@_MAX_PAYLOAD_SIZE + 1u];",
        "    (void)bytes;",
        *(["    (void)whom;"] if h.c.address else []),
        *([f"    REQUIRE({encoded} >= 0);"] if takes else []),
        "    ++*(unsigned *)listener->context;",
        "}",
    ]
