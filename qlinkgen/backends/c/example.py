"""The head comment's list of options and its example, a program that compiles as it stands."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from qlinkgen.backends.c.dispatch import member_name, told_name
from qlinkgen.backends.c.names import Names
from qlinkgen.model.message import Message
from qlinkgen.model.naming import snake
from qlinkgen.model.protocol import Protocol
from qlinkgen.model.transaction import Command
from qlinkgen.model.types import Scalar

if TYPE_CHECKING:
    from qlinkgen.backends.c.frames import FrameSection


#: Parameters stand one a line: names of messages are long.
_BREAK = "\n *     "


def option_lines(upper: str, check: dict[str, Any] | None) -> list[str]:
    """Macros that a user may define."""
    options = [
        (f"{upper}_ENABLE_FLOAT=1", "conversions between raw and physical values, in double"),
        (f"{upper}_ENABLE_NAMES=1", "names of enum values as text"),
    ]
    if check and check["is_crc"]:
        options.append((f"{upper}_CRC_FORM=FORM", f"{upper}_CRC_FORM_LOOP (as it is), _NIBBLE or _TABLE"))
    if check and check["selectable"]:
        options.append((f"{upper}_CRC=NAME", f"another 16-bit algorithm, such as {upper}_CRC_16_XMODEM"))
    width = max(len(name) for name, _ in options)
    return [f"{name:<{width}}  {what}" for name, what in options]


def example_lines(
    protocol: Protocol, names: Names, section: FrameSection, kept: tuple[Message, ...], role: str
) -> list[str]:
    """A slave where the header has one, else a master or a listener."""
    if protocol.directions == ("message",):
        return _listener(names, section, kept[0], "listener")
    present = {message.name for message in kept}
    commands = [c for c in protocol.commands if c.response and {c.request.name, c.response.name} <= present]
    if role != "master" and commands:
        return _slave(names, section, max(commands, key=_weight))
    responses = [m for m in kept if m.direction != "request" and m.values]
    if section.slave_only or not responses:
        return [f'#include "{names.prefix}.h"']
    return _listener(names, section, max(responses, key=lambda m: len(m.values)), "master")


def _weight(command: Command) -> tuple[bool, int]:
    response = command.response
    assert response is not None
    both = bool(command.request.values) and bool(response.values)
    return both, len(command.request.values) + len(response.values)


def _slave(names: Names, section: FrameSection, command: Command) -> list[str]:
    p, name, request, response = names.prefix, snake(command.name), command.request, command.response
    assert response is not None
    parameters = [f"{p}_slave_t *own"]
    parameters += [f"const {names.function(request)}_t *request"] if request.values else []
    parameters += [f"{names.function(response)}_t *response"] if response.values else []
    echo, address = _echo(request, response), section.view["address"]
    used = any("request->" in line for line in echo)
    unused = [f"    (void){each};" for each in ["own", *(["request"] if request.values and not used else [])]]
    return [
        *_start(p),
        f"static {p}_slave_t slave;",
        "",
        f"static bool on_{name}({parameters[0]}{''.join(f',{_BREAK}{each}' for each in parameters[1:])})",
        "{",
        *unused,
        *echo,
        "    return true;",
        "}",
        "",
        "void board_send(const uint8_t *bytes, size_t size);",
        "",
        *_receive(
            p,
            section,
            ["uint8_t answer[{P}_MAX_WIRE_SIZE];"],
            "const size_t size = {p}_slave_dispatch(&slave, &frame, answer, sizeof answer);",
            "if (size > 0U) {{",
            "    board_send(answer, size);",
            "}}",
        ),
        "",
        "void board_start(void)",
        "{",
        f"    {p}_receiver_init(&receiver{_direction(names, section, 'REQUEST')});",
        *([f"    slave.{address} = 1U;"] if address else []),
        f"    slave.{member_name(name)} = on_{name};",
        "}",
    ]


def _listener(names: Names, section: FrameSection, message: Message, role: str) -> list[str]:
    p, address = names.prefix, section.view["address"]
    entry = told_name(names, message)
    whose = [f"{section.view['address_type']} {address}"] if address else []
    taken = [f"const {names.function(message)}_t *message"] if message.values else []
    parameters = [f"{p}_{role}_t *own", *whose, *taken]
    unused = [
        f"    (void){each};"
        for each in ["own", *([address] if address else []), *(["message"] if taken else [])]
    ]
    return [
        *_start(p),
        f"static {p}_{role}_t {role};",
        "",
        f"static void on_{entry}({', '.join(parameters)})",
        "{",
        *unused,
        "}",
        "",
        *_receive(p, section, [], f"(void){{p}}_{role}_dispatch(&{role}, &frame);"),
        "",
        "void board_start(void)",
        "{",
        f"    {p}_receiver_init(&receiver{_direction(names, section, 'RESPONSE')});",
        f"    {role}.{entry} = on_{entry};",
        "}",
    ]


def _start(prefix: str) -> list[str]:
    return [f'#include "{prefix}.h"', "", f"static {prefix}_receiver_t receiver;"]


def _direction(names: Names, section: FrameSection, direction: str) -> str:
    return f", {names.upper}_{direction}" if section.view["needs_direction"] else ""


def _echo(request: Message, response: Message) -> list[str]:
    """What both have is returned; that shows how fields are reached."""
    asked = {value.name: value.type for value in request.values if isinstance(value.type, Scalar)}
    same = [v.name for v in response.values if isinstance(v.type, Scalar) and v.name in asked]
    if same:
        return [f"    response->{name} = request->{name};" for name in same]
    first = next((value.name for value in response.values if isinstance(value.type, Scalar)), None)
    return [f"    response->{first} = 1;"] if first else ["    (void)response;"] if response.values else []


def _receive(prefix: str, section: FrameSection, declared: list[str], *handled: str) -> list[str]:
    """Each byte, as an interrupt or a loop brings it."""
    upper, rescans = prefix.upper(), section.rescans
    test = (
        "while (event != {P}_EVENT_NONE) {{"
        if rescans
        else "if ({p}_receive(&receiver, byte) == {P}_EVENT_FRAME) {{"
    )
    body = ["const {p}_frame_t frame = {p}_receiver_frame(&receiver);", *handled]
    if rescans:
        body = [
            "if (event == {P}_EVENT_FRAME) {{",
            *(f"    {line}" for line in body),
            "}}",
            "event = {p}_receiver_next(&receiver);",
        ]
    first = ["{p}_event_t event = {p}_receive(&receiver, byte);"] if rescans else []
    inside = [*declared, *first, test, *(f"    {line}" for line in body), "}}"]
    lines = ["void board_received(uint8_t byte)", "{{", *(f"    {line}" for line in inside), "}}"]
    return [
        line.replace("{p}", prefix).replace("{P}", upper).replace("{{", "{").replace("}}", "}")
        for line in lines
    ]
