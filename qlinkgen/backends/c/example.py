"""Options and example program for the head comment of a header."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

from qlinkgen.backends.c.crc import CheckView, CrcView
from qlinkgen.backends.c.dispatch import callback_name
from qlinkgen.backends.c.names import Names, is_wide
from qlinkgen.model.naming import file_stem, handler, member, snake
from qlinkgen.model.transaction import Command
from qlinkgen.plan.payload import Member, ValueStep
from qlinkgen.plan.tree import MessagePlan, Plan

if TYPE_CHECKING:
    from qlinkgen.backends.c.frames import FrameSection


#: One parameter per line, because names of messages are long.
_BREAK = "\n    "


def option_lines(upper: str, check: CheckView | None, *, slave: bool) -> list[str]:
    """Macros that users may define."""
    options = [
        (f"{upper}_ENABLE_FLOAT=1", "conversions between raw and physical values"),
        (f"{upper}_REAL=float", "those conversions in float, not in double"),
        (f"{upper}_ENABLE_NAMES=1", "names of enum values as text"),
    ]
    if isinstance(check, CrcView):
        options.append(
            (f"{upper}_CRC_FORM=FORM", f"{upper}_CRC_FORM_{_forms(check)}, otherwise the best for the chip")
        )
    if isinstance(check, CrcView) and check.selectable:
        options.append((f"{upper}_CRC=NAME", f"another 16-bit algorithm, such as {upper}_CRC_16_XMODEM"))
    if slave:
        options.append((f"{upper}_CONST_HANDLERS=1", "the functions of a slave in a const struct, for flash"))
        options.append((f"{upper}_WITHOUT_MESSAGE", "a slave without the command of this name"))
    width = max(len(name) for name, _ in options)
    return [f"{name:<{width}}  {what}" for name, what in options]


def _forms(check: CrcView) -> str:
    return "LOOP, _NIBBLE, _TABLE or _FOLD" if check.folds else "LOOP, _NIBBLE or _TABLE"


def example_lines(plan: Plan, names: Names, section: FrameSection) -> list[str]:
    """A slave if the header has one, otherwise a master or a listener."""
    if plan.protocol.directions == ("message",):
        return _listener(names, section, plan.messages[0], "listener")
    exchanges = (plan.protocol.exchanges[command.request.name] for command in plan.commands)
    pairs = [
        (each.command, plan.by_name[each.sent.name], plan.by_name[each.answers[0].name])
        for each in exchanges
        if each.answers and each.answers[0].name in plan.by_name
    ]
    if plan.role != "master" and pairs:
        return _slave(names, section, *max(pairs, key=lambda pair: _weight(*pair[1:])))
    responses = [m for m in plan.messages if m.direction != "request" and m.payload.settable]
    if section.slave_only or not responses:
        return [f'#include "{file_stem(names.prefix)}.h"']
    return _listener(names, section, max(responses, key=lambda m: len(m.payload.settable)), "master")


def _weight(request: MessagePlan, response: MessagePlan) -> tuple[bool, int]:
    asked, told = len(request.payload.settable), len(response.payload.settable)
    return bool(asked and told), asked + told


def _slave(
    names: Names, section: FrameSection, command: Command, request: MessagePlan, response: MessagePlan
) -> list[str]:
    p, name = names.prefix, snake(command.name)
    parameters = [f"{p}_slave_t *own"]
    parameters += [f"const {names.function(request.message)}_t *request"] if request.payload.settable else []
    parameters += [f"{names.function(response.message)}_t *response"] if response.payload.settable else []
    echo, address = _echo(request, response), section.view.address
    ignored = request.payload.settable and not any("request->" in line for line in echo)
    unused = [f"    (void){each};" for each in ["own", *(["request"] if ignored else [])]]
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
        *(_answered_later(p, section) if section.pending else _answered(p, section)),
        "",
        "void board_start(void)",
        "{",
        f"    {p}_receiver_init(&receiver{_direction(names, section, 'REQUEST')});",
        *([f"    slave.{address} = 1U;"] if address else []),
        f"    slave.{handler(name, names.address)} = on_{name};",
        "}",
    ]


def _listener(names: Names, section: FrameSection, message: MessagePlan, role: str) -> list[str]:
    p, address = names.prefix, section.view.address
    entry = callback_name(names, message.message)
    whose = [f"{section.view.address_type} {address}"] if address else []
    taken = [f"const {names.function(message.message)}_t *message"] if message.payload.settable else []
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
    return [f'#include "{file_stem(prefix)}.h"', "", f"static {prefix}_receiver_t receiver;"]


def _direction(names: Names, section: FrameSection, direction: str) -> str:
    return f", {names.upper}_{direction}" if section.view.needs_direction else ""


def _echo(request: MessagePlan, response: MessagePlan) -> list[str]:
    """Statements that copy common fields from request to response, to show access to fields."""
    asked, told = _numbers(request), _numbers(response)
    if same := [name for name in told if name in asked]:
        return [f"    response->{member(name)} = request->{member(name)};" for name in same]
    if told:
        return [f"    response->{member(told[0])} = 1;"]
    return ["    (void)response;"] if response.payload.settable else []


def _numbers(message: MessagePlan) -> list[str]:
    steps = [each for each in message.payload.settable if isinstance(each, ValueStep | Member)]
    return [each.name for each in steps if not is_wide(each.number)]


def _answered(prefix: str, section: FrameSection) -> list[str]:
    return _receive(
        prefix,
        section,
        ["uint8_t answer[{P}_MAX_WIRE_SIZE];"],
        "const size_t size = {p}_slave_dispatch(&slave, &frame, answer, sizeof answer);",
        "if (size > 0U) {{",
        "    board_send(answer, size);",
        "}}",
    )


def _answered_later(prefix: str, section: FrameSection) -> list[str]:
    """The answer waits for the byte that may be inserted after the frame; another event makes it void."""
    handled = [
        "if (event == {P}_EVENT_FRAME) {{",
        "    const {p}_frame_t frame = {p}_receiver_frame(&receiver);",
        "    size = {p}_slave_dispatch(&slave, &frame, answer, sizeof answer);",
        "}}",
    ]
    again = ["event = {p}_receiver_next(&receiver);"] if section.rescans else []
    lines = [
        "static uint8_t answer[{P}_MAX_WIRE_SIZE];",
        "static size_t size;",
        ("" if again else "const ") + "{p}_event_t event = {p}_receive(&receiver, byte);",
        ("while" if again else "if") + " (event != {P}_EVENT_NONE) {{",
        *(f"    {line}" for line in ["size = 0U;", *handled, *again]),
        "}}",
        "if ((size > 0U) && !{p}_receiver_pending(&receiver)) {{",
        "    board_send(answer, size);",
        "    size = 0U;",
        "}}",
    ]
    return _written(
        prefix, ["void board_received(uint8_t byte)", "{{", *(f"    {each}" for each in lines), "}}"]
    )


def _receive(prefix: str, section: FrameSection, declared: list[str], *handled: str) -> list[str]:
    """A function that processes a received byte, for an interrupt or a loop; and one for a silence."""
    rescans = section.rescans
    call = "{p}_rx_idle(&receiver)" if section.gaps else "{p}_receive(&receiver, byte)"
    test = "while (event != {P}_EVENT_NONE) {{" if rescans else f"if ({call} == {{P}}_EVENT_FRAME) {{{{"
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
    if section.gaps:
        taken = ["    (void){p}_receive(&receiver, byte);", "}}", "", "void board_idle(void)", "{{"]
        lines = [*lines[:2], *taken, *lines[2:]]
    return _written(prefix, lines)


def _written(prefix: str, lines: Sequence[str]) -> list[str]:
    upper = prefix.upper()
    return [
        line.replace("{p}", prefix).replace("{P}", upper).replace("{{", "{").replace("}}", "}")
        for line in lines
    ]
