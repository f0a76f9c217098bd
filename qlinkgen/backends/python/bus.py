"""Bus modules: a typed method for each command, for what a master or host asks and for what a slave does.

The module `X_bus` is written beside the codec `X`, whose classes it takes and hands out. A runtime supplies
how a request is sent; the module knows no port, clock or thread.
"""

from __future__ import annotations

import re
import textwrap
from collections.abc import Iterable, Sequence
from dataclasses import dataclass

from qlinkgen.backends.base import Options, Outputs, banner, environment
from qlinkgen.backends.python import docstrings, package, tables, values
from qlinkgen.backends.python.classes import class_name
from qlinkgen.backends.python.frames_delimited import is_unique
from qlinkgen.backends.python.module import kept
from qlinkgen.backends.python.place import WIDTH, Place, place_of, wrapped
from qlinkgen.model.message import Message
from qlinkgen.model.protocol import Protocol
from qlinkgen.model.transaction import Command

__all__ = ["generate", "render"]

#: Names in the classes that no command can have: what they have themselves, and types of arguments.
_TAKEN = ("ask", "tell", "handle", "number", "axis", "bytes", "list", "str")
#: Attribute of the commands of a host that says on which axis they act, and those of its values for which the
#: axis has to be chosen: where it is not known, a host is on the safe side with the one that it means.
_AXIS = "axis"
_CHOSEN = ("current", "unknown")


@dataclass(frozen=True)
class Method:
    """A method, ready to be placed: every entry is finished text."""

    head: list[str]
    doc: list[str]
    body: list[str]


@dataclass(frozen=True)
class Caller:
    """A class whose methods send requests."""

    name: str
    doc: list[str]
    prefix: str
    #: Its objects stand for one address or axis, and have its number.
    one: bool
    methods: list[Method]
    #: Name of the argument that chooses an axis, "" where there is none.
    axis: str = ""


def generate(protocol: Protocol, options: Options) -> Outputs:
    """The module of a protocol and the package around it, by path; nothing if there are no commands."""
    text = render(protocol, options)
    return {f"{options.package}/{protocol.name}_bus.py": text, **package(options)} if text else {}


def render(protocol: Protocol, options: Options) -> str:
    """The text of a protocol's module, "" where there is nothing to say."""
    if protocol.bus.kind == "ring" or (protocol.bus.kind == "host" and options.role == "slave"):
        return ""
    messages = kept(protocol, options)
    names = {message.name for message in messages}
    commands = [
        each for each in protocol.commands if {m.name for m in (each.request, each.response) if m} <= names
    ]
    return BusModule(protocol, commands, messages).text(options) if commands else ""


class BusModule:
    """Collects what the template places."""

    def __init__(self, protocol: Protocol, commands: Sequence[Command], messages: Iterable[Message]) -> None:
        """``messages`` are those of the codec module, ``commands`` those that have all theirs in it."""
        self._protocol = protocol
        self._commands = commands
        classes = [class_name(message) for message in messages]
        constants = tables.constant_classes(protocol, classes)
        self._place: Place = place_of(protocol, constants, unique=is_unique(protocol))
        self._importable = {"Message", *classes, *constants.values()}

    def text(self, options: Options) -> str:
        """The module's text."""
        host = self._protocol.bus.kind == "host"
        callers = self._callers(host=host) if options.role != "slave" else []
        handlers = self._handlers() if options.role != "master" and not host else []
        lines = [line for each in callers for method in each.methods for line in (*method.head, *method.body)]
        lines += [line for method in handlers for line in method.head]
        words = set(re.findall(r"\w+", "\n".join(lines)))
        imported = sorted(self._importable & {*words, "Message"})
        asker = "host" if host else "master"
        parts = {f"what a {asker} asks": callers, "what a slave does": handlers}
        title = " and ".join(title for title, part in parts.items() if part)
        first, *others = banner(self._protocol)
        context = {
            "title": textwrap.wrap(f"{first}: {title}, a method for each command.", WIDTH - 8),
            "banner": others,
            "imports": wrapped(f"from .{self._protocol.name} import (", imported, ")", 0),
            "decimals": "Decimal" in words,
            "public": [*(each.name for each in callers), *(["SlaveHandlers"] if handlers else [])],
            "callers": callers,
            "handlers": handlers,
            "nodes": f", {self._nodes()}" if self._nodes() else "",
            "table": [f'{class_name(c.request)}: "{_method_name(c)}"' for c in self._commands],
        }
        template = environment(__package__).get_template("templates/bus.j2")
        return template.render(context).rstrip("\n") + "\n"

    # The side that asks

    def _callers(self, *, host: bool) -> list[Caller]:
        found = []
        for asynchronous in (False, True):
            if host:
                found += self._host_callers(asynchronous=asynchronous)
                continue
            found.append(self._caller("MasterCalls", asynchronous=asynchronous, node=False))
            if self._place.address:
                found.append(self._caller("NodeCalls", asynchronous=asynchronous, node=True))
        return found

    def _caller(self, name: str, *, asynchronous: bool, node: bool) -> Caller:
        what = "one node may be asked" if node else "a master may ask"
        more = ["", "Attributes:", f"    number: Address of the node, {self._nodes()}."] if node else []
        doc = _caller_doc(name, what, more, asynchronous=asynchronous)
        asked = [each for each in self._commands if not (node and each.addressing == "broadcast")]
        methods = [self._method(each, asynchronous=asynchronous, node=node) for each in asked]
        return _make_caller(name, doc, methods, asynchronous=asynchronous, one=node)

    def _method(self, command: Command, *, asynchronous: bool, node: bool) -> Method:
        address = "" if node or command.addressing in ("broadcast", "none") else self._place.address
        answer = _answer(command, surely=node or command.addressing != "either")
        head = self._head(command, address, answer, asynchronous=asynchronous)
        entry = f"{address}: Address of the node, {self._nodes()}{self._all(command)}." if address else ""
        doc = _summary(command) if asynchronous else [*_summary(command), *self._arguments(command, entry)]
        body = self._body(command, "await " if asynchronous else "", address=address, node=node)
        return Method(head, docstrings.quoted(doc), body)

    def _head(self, command: Command, where: str, answer: str, *, asynchronous: bool) -> list[str]:
        """The line that begins a method; ``where`` is the argument for an address or axis."""
        arguments = ["self", *([f"{where}: int"] if where else [])]
        taken = [values.argument(value, self._place) for value in command.request.values]
        arguments += ["*", *taken] if taken else []
        prefix = "async " if asynchronous else ""
        return wrapped(f"{prefix}def {_method_name(command)}(", arguments, f") -> {answer}:", 4)

    def _body(self, command: Command, wait: str, *, address: str, node: bool) -> list[str]:
        addressed = [f"{self._place.address}={'self.number' if node else address}"] if address or node else []
        given = [*addressed, *(f"{value.name}={value.name}" for value in command.request.values)]
        request = f"{class_name(command.request)}("
        if command.response is None:
            return wrapped(f"{wait}self.tell({request}", given, "))", 8)
        answer = class_name(command.response)
        if command.addressing != "either" or node:
            return wrapped(f"return {wait}self.ask({request}", given, f"), {answer})", 8)
        return [
            *wrapped(f"_request = {request}", given, ")", 8),
            f"if {address} == {self._protocol.bus.broadcast}:",
            f"    {wait}self.tell(_request)",
            "    return None",
            f"return {wait}self.ask(_request, {answer})",
        ]

    def _arguments(self, command: Command, first: str) -> list[str]:
        """The section on arguments; ``first`` is about the one that is no field."""
        entries = [first] if first else []
        described = (f"{v.name}: {values.description(v, self._place)}" for v in command.request.values)
        entries += described
        lines = [line for entry in entries for line in docstrings.item(entry, WIDTH - 8)]
        return ["", "Args:", *lines] if lines else []

    def _all(self, command: Command) -> str:
        """What the broadcast address means to a command."""
        everybody = self._protocol.bus.broadcast
        if command.addressing == "answered_broadcast":
            return f"; or {everybody} for whatever number it has, where it is alone on the line"
        if command.addressing != "either":
            return ""
        silent = ": nobody answers, None is returned" if command.response else ""
        return f"; or {everybody} for all of them{silent}"

    def _nodes(self) -> str:
        nodes = self._protocol.bus.nodes
        return f"{nodes[0]}..{nodes[1]}" if nodes else ""

    # The host of a device, which may have axes

    def _host_callers(self, *, asynchronous: bool) -> list[Caller]:
        on_axis = [each for each in self._commands if _axis_of(each) in _CHOSEN]
        fields = {value.name for each in on_axis for value in each.request.values}
        axis = ("axis_" if "axis" in fields else "axis") if on_axis else ""
        return [
            self._host_caller("HostCalls", self._commands, axis, asynchronous=asynchronous, one=False),
            *(
                [self._host_caller("AxisCalls", on_axis, "", asynchronous=asynchronous, one=True)]
                if axis
                else []
            ),
        ]

    def _host_caller(
        self, name: str, commands: Sequence[Command], axis: str, *, asynchronous: bool, one: bool
    ) -> Caller:
        what = "one axis may be asked" if one else "a host may ask"
        more = ["", "Attributes:", "    number: Number of the axis, counted from 1."] if one else []
        doc = _caller_doc(name, what, more, asynchronous=asynchronous)
        methods = [
            self._host_method(each, axis if _axis_of(each) in _CHOSEN else "", asynchronous=asynchronous)
            for each in commands
        ]
        return _make_caller(name, doc, methods, asynchronous=asynchronous, one=one, axis=axis)

    def _host_method(self, command: Command, axis: str, *, asynchronous: bool) -> Method:
        head = self._head(command, axis, _answer(command, surely=True), asynchronous=asynchronous)
        doc = [*_summary(command), *_attributes(command)]
        if not asynchronous:
            entry = f"{axis}: Axis that it acts on, counted from 1." if axis else ""
            doc += self._arguments(command, entry)
        wait = "await " if asynchronous else ""
        given = [f"{value.name}={value.name}" for value in command.request.values]
        request, chosen = f"{class_name(command.request)}(", f", {axis}" if axis else ""
        if command.response is None:
            return Method(
                head, docstrings.quoted(doc), wrapped(f"{wait}self.tell({request}", given, f"){chosen})", 8)
            )
        end = f"), {class_name(command.response)}{chosen})"
        return Method(
            head, docstrings.quoted(doc), wrapped(f"return {wait}self.ask({request}", given, end, 8)
        )

    # The slave's side

    def _handlers(self) -> list[Method]:
        return [self._handler(command) for command in self._commands]

    def _handler(self, command: Command) -> Method:
        arguments = ["self", f"request: {class_name(command.request)}", "now: float"]
        head = wrapped(f"def {_method_name(command)}(", arguments, f") -> {_answer(command)}:", 4)
        doc = _summary(command)
        if command.echoes:
            doc += ["", f"The answer repeats {' and '.join(command.echoes)} of the request."]
        if command.response and command.addressing == "either":
            doc += ["", "Nobody answers a broadcast: return None then."]
        return Method(head, docstrings.quoted(doc), [])


def _method_name(command: Command) -> str:
    """The command's own name, or with an underscore: then no other is like it in the generated classes."""
    return f"{command.name}_" if command.name in _TAKEN else command.name


def _answer(command: Command, *, surely: bool = False) -> str:
    """Type of what a method returns."""
    names = [class_name(command.response)] if command.response else []
    return " | ".join(names if names and surely else [*names, "None"])


def _summary(command: Command) -> list[str]:
    text = docstrings.opening(command.doc or command.name, command.section)
    unconfirmed: Iterable[str] = () if command.confirmed else ("", docstrings.UNCONFIRMED)
    return [*docstrings.paragraph(text, WIDTH - 12), *unconfirmed]


def _axis_of(command: Command) -> str:
    """On which axis a command acts, "" where its protocol knows no axes."""
    return str(command.attributes.get(_AXIS, ""))


def _attributes(command: Command) -> list[str]:
    """What a protocol alone says of a command, in a line; what does not apply is left out."""
    told = {(_AXIS, "current")}  # the method of an axis, or the argument for one, says it
    said = [pair for pair in command.attributes.items() if pair[1] is not False and pair not in told]
    words = [(key if value is True else f"{key} {value}").replace("_", " ") for key, value in said]
    return ["", *textwrap.wrap(f"{', '.join(words).capitalize()}.", WIDTH - 8)] if words else []


def _caller_doc(name: str, what: str, more: Sequence[str], *, asynchronous: bool) -> list[str]:
    doc = [f"What {what}, a method for each command{': coroutines' if asynchronous else ''}.", ""]
    if asynchronous:
        doc += [f"The arguments are those of {name}.", ""]
    supplied = "A subclass supplies `ask` and `tell`; what they raise, every method raises."
    return docstrings.quoted([*doc, *textwrap.wrap(supplied, WIDTH - 8), *more])


def _make_caller(
    name: str, doc: list[str], methods: list[Method], *, asynchronous: bool, one: bool, axis: str = ""
) -> Caller:
    prefix = "async " if asynchronous else ""
    return Caller(f"Async{name}" if asynchronous else name, doc, prefix, one, methods, axis)
