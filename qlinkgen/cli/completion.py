"""Completes words of a command line in a shell: protocols, messages, fields, their values, and ports.

A shell calls the program with `_QLINKGEN_COMPLETE` set; see `qlinkgen.cli.boundary`. Nothing is said of
a schema with errors or an unknown word: there is nothing to complete then.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from pathlib import Path

import click
from click.shell_completion import CompletionItem

from qlinkgen._resources import library_dir, schemas_dir
from qlinkgen.cli.boundary import Failure
from qlinkgen.errors import SchemaError
from qlinkgen.model.fields import Value
from qlinkgen.model.message import Message
from qlinkgen.model.protocol import Protocol
from qlinkgen.model.texts import one_line

Items = list[CompletionItem]

#: URLs of pyserial that are entered in part.
_URLS = ("socket://", "rfc2217://", "hwgrep://", "loop://")


def protocols(context: click.Context, parameter: click.Parameter, incomplete: str) -> Items:  # noqa: ARG001
    """Complete the name of a protocol, or the path of a schema."""
    names = sorted(path.stem for folder in (schemas_dir(), library_dir()) for path in folder.glob("*.yaml"))
    found = _beginning(incomplete, [*names, *_schemas_here()])
    return found or [CompletionItem(incomplete, type="file")]


def _schemas_here() -> list[str]:
    return sorted(str(path) for pattern in ("*.yaml", "*.yml") for path in Path().glob(pattern))


def messages(context: click.Context, parameter: click.Parameter, incomplete: str) -> Items:  # noqa: ARG001
    """Complete a command or a message of the protocol."""
    protocol = loaded_of(context)
    return [] if protocol is None else message_items(protocol, incomplete)


def message_items(protocol: Protocol, incomplete: str) -> Items:
    """Return the commands and messages whose names begin so."""
    commands = [CompletionItem(each.name, help=one_line(each.doc)) for each in protocol.commands]
    others = [CompletionItem(each.name, help=one_line(each.doc)) for each in protocol.messages]
    return [each for each in (*commands, *others) if each.value.startswith(incomplete)]


def assignments(context: click.Context, parameter: click.Parameter, incomplete: str) -> Items:  # noqa: ARG001
    """Complete FIELD=, or the value after it.

    bash splits words at "=", so there the field and "=" may be words of their own, before the value.
    """
    message, protocol = _message(context), loaded_of(context)
    if message is None or protocol is None:
        return []
    return assignment_items(protocol, message, context.params.get("assignments") or (), incomplete)


def assignment_items(protocol: Protocol, message: Message, words: Sequence[str], incomplete: str) -> Items:
    """Return FIELD= and values of fields that begin so; ``words`` are those before."""
    values = {value.name: value for value in (*protocol.beside(message), *message.values)}
    given = {word.partition("=")[0] for word in words if word != "="}
    last = words[-2:] if words and words[-1] == "=" else words[-1:]
    if last and last[0] in values:
        return _values(values, last[0], incomplete)
    name, mark, begun = incomplete.partition("=")
    if mark:
        found = _values(values, name, begun)
        return [CompletionItem(f"{name}={each.value}", help=each.help) for each in found]
    return [
        CompletionItem(f"{each.name}=", help=_about(each))
        for each in values.values()
        if each.name.startswith(incomplete) and each.name not in given
    ]


def _values(values: dict[str, Value], name: str, begun: str) -> Items:
    """Return the values of a field that begin so; the last of several flags is completed."""
    if name not in values:
        return []
    names, between = values[name].names
    head, mark, last = begun.rpartition(between) if between else ("", "", begun)
    return [CompletionItem(f"{head}{mark}{each.value}") for each in _beginning(last, names)]


def _about(value: Value) -> str:
    unit = f"[{value.unit}] " if value.unit else ""
    return f"{unit}{one_line(value.doc)}".strip()


def ports(context: click.Context, parameter: click.Parameter, incomplete: str) -> Items:  # noqa: ARG001
    """Complete the serial ports of this machine and the URLs of pyserial, otherwise a path."""
    from serial.tools.list_ports import comports  # noqa: PLC0415  # pyserial is slow to import

    known = [
        CompletionItem(each.device, help=each.description)
        for each in sorted(comports(), key=lambda each: each.device)
    ]
    found = [each for each in known if each.value.startswith(incomplete)]
    return (found + _beginning(incomplete, _URLS)) or [CompletionItem(incomplete, type="file")]


def _beginning(incomplete: str, words: Iterable[str]) -> Items:
    return [CompletionItem(word) for word in words if word.startswith(incomplete)]


def loaded_of(context: click.Context) -> Protocol | None:
    """Return the protocol of the command line, None without a valid one."""
    from qlinkgen.cli.common import load_protocol  # noqa: PLC0415  # arguments are made before it

    name = context.params.get("protocol")
    try:
        return load_protocol(name) if name else None
    except (Failure, SchemaError):
        return None


def _message(context: click.Context) -> Message | None:
    protocol, name = loaded_of(context), context.params.get("message")
    try:
        return None if protocol is None or name is None else protocol.message(name)
    except KeyError:
        return None
