"""Enums, flags and the transaction table of a module."""

from __future__ import annotations

import textwrap
from collections.abc import Mapping, Sequence
from fractions import Fraction
from typing import assert_never

from qlinkgen._dataclass import dataclass
from qlinkgen.backends import python_text
from qlinkgen.backends.python.integers import numbers_of, words_of
from qlinkgen.backends.python.layout import WIDTH, in_hex, listing, literal, wrapped
from qlinkgen.backends.python.names import attribute, class_name
from qlinkgen.backends.python.place import Place
from qlinkgen.model.texts import one_line
from qlinkgen.model.transaction import (
    Allowance,
    Bus,
    ByCommand,
    ByCount,
    ByEach,
    ByField,
    ByReply,
    ByTime,
    Command,
    Many,
    Proof,
    Repeated,
    Reply,
    Step,
)
from qlinkgen.model.types import Array, Enum, Flags, NamedValue
from qlinkgen.model.words import Words
from qlinkgen.plan.hosts import host_of
from qlinkgen.plan.proofs import ProofPlan, proof_of
from qlinkgen.plan.tree import MessagePlan, Plan


@dataclass(frozen=True)
class Member:
    """A constant of an enum or flags class."""

    name: str
    value: str
    doc: list[str]


@dataclass(frozen=True)
class ConstantsModel:
    """An enum or flags class."""

    name: str
    doc: list[str]
    members: list[Member]


def enum_model(enum: Enum, name: str) -> ConstantsModel:
    """Render model of an enum."""
    members = [
        Member(each.name.upper(), str(each.value), _comment(each, enum.words)) for each in enum.members
    ]
    rest = "Sent as words." if enum.words else "Numbers without a name are preserved."
    return ConstantsModel(name, _doc(enum.doc, enum.section, rest), members)


def word_tables(plan: Plan) -> list[str]:
    """Definitions of the words of enums and of ids, and of their numbers."""
    lines: list[str] = []
    found = [each.words for each in plan.enums if each.words is not None]
    for words in (*found, *plan.id_words):
        written = list(map(literal, words.words))
        lines += listing(f"{words_of(words)} = (", written, ")", 0)
        received = [literal(each.upper()) for each in words.words] if words.folded else written
        pairs = [f"{word}: {number}" for number, word in enumerate(received)]
        lines += wrapped(f"{numbers_of(words)} = {{", pairs, "}", 0)
    return lines


def flags_model(flags: Flags, name: str) -> ConstantsModel:
    """Render model of flags."""
    digits = (flags.bits + 3) // 4 + 2
    members = [
        Member(each.name.upper(), f"{1 << each.value:#0{digits}x}", _comment(each)) for each in flags.members
    ]
    rest = "Other bits must be zero." if flags.reserved_zero else "Other bits are preserved."
    return ConstantsModel(name, _doc(flags.doc, flags.section, f"Masks. {rest}"), members)


def _comment(constant: NamedValue, words: Words | None = None) -> list[str]:
    doc = constant.doc
    if words is not None:
        doc = f"{doc}{'.' * (doc[-1:].isalnum())} Sent as {words.text(constant.value).decode()}".strip()
    return python_text.comment(doc, WIDTH - 10)


def _doc(doc: str, section: str, more: str) -> list[str]:
    where = f" ({'section ' if section[:1].isdigit() else ''}{section})" if section else ""
    text = one_line(f"{doc.rstrip('.')}{where}.") if doc else ""
    first, _, rest = text.partition(". ")
    lines = [f"{first}.", "", rest, more] if rest else [text, "", more]
    if not text:
        return python_text.docstring([more])
    return python_text.docstring(part for line in lines for part in (textwrap.wrap(line, WIDTH - 8) or [""]))


def bus(line: Bus) -> list[str]:
    """The call that creates the description of the bus, without unknown facts."""
    facts = [("broadcast", line.broadcast), ("baud", line.baud), ("bits_per_byte", line.bits_per_byte)]
    if line.nodes:
        facts = [("first_node", line.nodes[0]), ("last_node", line.nodes[1]), *facts]
    given = [f"{name}={value}" for name, value in facts if value is not None]
    return wrapped("BUS = Bus(", [f'"{line.kind}"', *given], ")", 0)


def resync(plan: Plan) -> list[str]:
    """The call that describes how a host comes back in step; no lines if the schema does not."""
    host = host_of(plan)
    if host is None:
        return []
    fills = [f'"{name}": 0x{byte:02X}' for name, byte in host.fills.items()]
    selects = [f'{number}: "{name}"' for number, name in host.selects.items()]
    lost = [f'"{name}"' for name in host.lost_by]
    given = [
        [f'"{host.command}"'],
        [f"fill=0x{host.fill:02X}"],
        *([wrapped("fills={", fills, "}", 5)] if fills else []),
        *([[f"rejected={literal(host.rejected)}"]] if host.rejected else []),
        *([[f'selected="{host.selected}"']] if host.selected else []),
        *([wrapped("selects={", selects, "}", 5)] if selects else []),
        *([wrapped("lost_by=(", lost, ",)" if len(lost) == 1 else ")", 5)] if lost else []),
    ]
    if all(len(each) == 1 for each in given):
        return wrapped("RESYNC = Resync(", (line for each in given for line in each), ")", 0)
    lines = [f"    {line}" for each in given for line in (*each[:-1], f"{each[-1]},")]
    return ["RESYNC = Resync(", *lines, ")"]


def command_rows(plan: Plan, place: Place) -> list[list[str]]:
    """The rows of the transaction table, each in one or more lines."""
    return [_row(command, plan, place) for command in plan.commands]


def _row(command: Command, plan: Plan, place: Place) -> list[str]:
    kept = plan.by_name
    answer = kept.get(command.response.name) if command.response else None
    request, response = class_name(kept[command.request.name]), class_name(answer) if answer else "None"
    arguments = [f'"{command.name}"', in_hex(command.id), request, response]
    if command.addressing != "none":
        arguments.append(f'addressing="{command.addressing}"')
    within = command.response_within
    if within.byte_times:
        arguments.append(f"response_byte_times={_number(within.byte_times)}")
    if within.seconds:
        arguments.append(f"response_seconds={_number(within.seconds)}")
    arguments += _repetition(command)
    arguments += _answers(command, kept)
    if command.in_flight != 1:
        arguments.append(f"in_flight={command.in_flight}")
    if command.section:
        arguments.append(f"section={python_text.literal(command.section)}")
    if not command.confirmed:
        arguments.append("confirmed=False")
    if command.attributes:
        pairs = (
            f"{python_text.literal(key)}: {_literal(value)}" for key, value in command.attributes.items()
        )
        arguments.append(f"attributes={{{', '.join(pairs)}}}")
    proof = proof_of(plan.protocol, command) if answer else None
    if proof is not None:
        arguments = [_proof(proof, place), *arguments]
    made = place.use("ProvenCommand") if proof else "Command"
    return wrapped(f'"{command.name}": {made}(', arguments, "),", 4)


def _answers(command: Command, kept: Mapping[str, MessagePlan]) -> list[str]:
    """Arguments on the number and size of answers, and on other ones."""
    arguments = []
    if command.many is not None:
        arguments.append(f"many={many_class(command.many)}({_end(command.many, kept)})")
    sizes = [
        f'("{attribute(name)}", "{attribute(asked)}", {_row_bits(command, name)})'
        for name, asked in command.sizes
    ]
    if sizes:
        arguments.append(f"sizes={tuple_of(sizes)}")
    if command.sized_by is not None and command.sized_by is not command.request:
        arguments.append(f"sized_by={class_name(kept[command.sized_by.name])}")
    steps = [_step(each, kept[each.message.name]) for each in command.steps]
    if steps:
        arguments.append(f"steps={tuple_of(steps)}")
    replies = [
        _reply(each, command.repeated(each.message), kept[each.message.name])
        for each in command.meant
        if each.message.name in kept
    ]
    if replies:
        arguments.append(f"replies={tuple_of(replies)}")
    return arguments


def _step(step: Step, planned: MessagePlan) -> str:
    """A frame of a dialogue: who sends it, its class, and its time limit."""
    within = "None" if step.within is None else _time(step.within)
    return f'("{"send" if step.sent else "receive"}", {class_name(planned)}, {within})'


def _row_bits(command: Command, name: str) -> int:
    """The bits of an item of the response if its bytes alone are counted, otherwise 0."""
    fields = command.response.fields if command.response else ()
    kind = next((field.type for field in fields if field.name == name), None)
    return kind.item.bits if isinstance(kind, Array) and kind.whole else 0


def many_class(many: Many) -> str:
    """The class of the end of several answers."""
    match many:
        case ByEach():
            return "EachOf"
        case ByCommand():
            return "UntilStopped"
        case ByCount() | ByField() | ByReply() | ByTime():
            return "Many"
        case _:
            assert_never(many)


def _end(many: Many, kept: Mapping[str, MessagePlan]) -> str:
    """The argument that states the end of several answers."""
    match many:
        case ByCount():
            counted = f', counted_by="{attribute(many.field)}"' if many.field else ""
            return f"count={many.most}{counted}"
        case ByField():
            return f'until=("{attribute(many.field)}", {many.first}, {many.last})'
        case ByReply():
            return f"reply={class_name(kept[many.reply.name])}"
        case ByTime():
            return f"within={_time(many.within)}"
        case ByEach():
            names = [f'"{attribute(name)}"' if name else '""' for name in (many.field, many.key, many.by)]
            return ", ".join([*names, str(many.most)])
        case ByCommand():
            names = [f'"{attribute(name)}"' for name in many.repeats]
            within = "None" if many.within is None else _time(many.within)
            return f'"{many.command}", {tuple_of(names)}, {within}'
        case _:
            assert_never(many)


def _proof(plan: ProofPlan, place: Place) -> str:
    """The call that creates the check value of a response that covers its request."""
    check, proof = place.check(plan.proof.algorithm), plan.proof
    slices = tuple_of([f"({first}, {end})" for first, end in plan.slices])
    return f'{place.use("Proof")}("{attribute(plan.value)}", {check}, {slices}, {proof.begin}, {proof.size})'


def _reply(reply: Reply, repeated: Mapping[str, Repeated], planned: MessagePlan) -> str:
    """The call that creates a reply, with what it repeats of the request."""
    arguments = [class_name(planned), f'"{reply.means}"']
    if reply.switch:
        cases = [f'({case.first}, {case.last}, "{case.means}")' for case in reply.cases]
        arguments += [f'switch="{attribute(reply.switch)}"', f"cases={tuple_of(cases)}"]
    if reply.within is not None:
        arguments.append(f"within={_time(reply.within)}")
    if reply.after != Allowance():
        arguments.append(f"after={_time(reply.after)}")
    if repeated:
        arguments.append(f"echoes={_echoes(repeated)}")
    return f"OtherReply({', '.join(arguments)})"


def _time(time: Allowance) -> str:
    return f"({_number(time.byte_times)}, {_number(time.seconds)})"


def _echoes(repeated: Mapping[str, Repeated]) -> str:
    """What the values of an answer repeat: an attribute of the request, or a number."""
    pairs = (
        f'"{attribute(name)}": ' + (str(of) if isinstance(of, int) else f'"{attribute(of)}"')
        for name, of in repeated.items()
        if not isinstance(of, Proof)
    )
    return f"{{{', '.join(pairs)}}}"


def tuple_of(items: Sequence[str]) -> str:
    """A tuple of expressions."""
    return f"({', '.join(items)}{',' if len(items) == 1 else ''})"


def _repetition(command: Command) -> list[str]:
    """Arguments on repetition and echoes."""
    found = command.repeated(command.response)
    repeated = {name: of for name, of in found.items() if not isinstance(of, Proof)}
    facts = {
        "repeat_safe=True": command.repeat.safe,
        f'repeat_counter="{attribute(command.repeat.counter)}"': command.repeat.counter,
        f"echoes={_echoes(repeated)}": repeated,
    }
    return [argument for argument, given in facts.items() if given]


def _number(value: Fraction) -> str:
    return str(value.numerator) if value.denominator == 1 else repr(float(value))


def _literal(value: str | int | bool) -> str:
    return python_text.literal(value) if isinstance(value, str) else repr(value)
