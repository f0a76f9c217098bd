"""Helpers of all commands: finding protocols and messages, warnings, hex input."""

from __future__ import annotations

import os
import re
import sys
from collections.abc import Iterable
from pathlib import Path
from typing import IO

import click

from qlinkgen.cli.boundary import Failure
from qlinkgen.cli.hex_text import HexError, HexReader
from qlinkgen.errors import SchemaError
from qlinkgen.model.checksum import candidates
from qlinkgen.model.message import Message
from qlinkgen.model.protocol import Protocol
from qlinkgen.model.replacement import Replacement
from qlinkgen.model.spelling import similar
from qlinkgen.model.texts import visible

_VERSION = re.compile(r"[0-9]{1,9}(\.[0-9]{1,9}){0,5}", re.ASCII)


def find_schema(name: str) -> Path:
    """Return the file of a schema, given by shipped name or path."""
    from qlinkgen.schema import find  # noqa: PLC0415  # not needed by all commands

    try:
        return find(name)
    except SchemaError as error:
        raise Failure(f"unknown schema '{name}'; {error.faults[0].hint}") from None


def load_protocol(name: str, crc: Replacement | None = None, version: str | None = None) -> Protocol:
    """Load a protocol by shipped name or path. Raises SchemaError."""
    from qlinkgen.cli.model_cache import keep, recall  # noqa: PLC0415  # JSON is not needed by all commands

    path = find_schema(name)
    if crc is None and (kept := recall(path, version)) is not None:
        return kept
    from qlinkgen.schema import load  # noqa: PLC0415  # pydantic is slow to import

    protocol = load(path, version=version)
    if crc is None:
        keep(path, version, protocol)
        return protocol
    from qlinkgen.plan.framing import frame_plan  # noqa: PLC0415  # only this option needs the plan

    if not any(each.check for each in frame_plan(protocol.frame).every):
        raise Failure(f"{crc}: the frame of {protocol.name} has no checksum; omit the option")
    try:
        protocol = load(path, crc=crc.algorithm, crc_over=crc.over, version=version)
        if names := [each.name for each in candidates(crc.algorithm or "")]:
            warn(f"{crc}: several algorithms have this name; write one of {', '.join(names)}")
        return protocol
    except SchemaError as error:
        # The schema is valid without the option.
        fault = error.faults[0]
        raise Failure(f"{crc}: {fault.message}" + (f"; {fault.hint}" if fault.hint else "")) from None


def find_message(protocol: Protocol, name: str) -> Message:
    """Find a message by name; the name of a command means its request."""
    try:
        return protocol.message(name)
    except KeyError:
        command = name.removesuffix(".response").removesuffix(".request")
        silent = any(each.name == command for each in protocol.commands) and name.endswith(".response")
        fix = (
            f"{command} is not answered"
            if silent
            else did_you_mean(name, [*(each.name for each in protocol.commands), *protocol.by_name])
        )
        hint = fix or f"`qlinkgen show {protocol.name}` lists the messages"
        raise Failure(f"{protocol.name} has no message '{name}'; {hint}") from None


def turned_message(protocol: Protocol, name: str) -> Message:
    """Find a message that only its turn in a dialogue tells."""
    message = find_message(protocol, name)
    if not protocol.is_turned(message):
        raise Failure(f"--message {name}: its frame tells what it is; omit the option")
    return message


def did_you_mean(word: str, known: Iterable[str]) -> str:
    """Return a hint with the closest known words, or ""."""
    close = similar(word, known, most=2)
    return f"did you mean {' or '.join(close)}?" if close else ""


def warn(text: str) -> None:
    """Print a warning on stderr."""
    click.echo(f"qlinkgen: warning: {visible(text)}", err=True)


def warn_unconfirmed(protocol: Protocol, message: Message) -> None:
    """Warn if a message or any of its fields is unconfirmed."""
    command = protocol.command_of(message)
    weak = [field.name for field in message.fields if not field.confirmed]
    if message.confirmed and (command is None or command.confirmed) and not weak:
        return
    what = f"{message.name} ({', '.join(weak)})" if weak and message.confirmed else message.name
    warn(f"{what} is unconfirmed in the source document; verify it on the device")


def parse_hex(text: str, what: str = "HEX") -> bytes:
    """Parse hex text, as defined in `qlinkgen.cli.hex_text`."""
    try:
        return HexReader().feed(f"{text}\n")
    except HexError as error:
        raise Failure(f"{what}: {error.message} (character {error.at + 1})") from None


def is_hex(text: str) -> bool:
    """Whether a text is hex."""
    try:
        HexReader().feed(f"{text}\n")
    except HexError:
        return False
    return True


def on_terminal(stream: IO[str] | None = None) -> bool:
    """Whether to use colours and fit the width."""
    if os.environ.get("NO_COLOR") or os.environ.get("TERM") == "dumb":
        return False
    return bool(os.environ.get("FORCE_COLOR")) or (stream or sys.stdout).isatty()


def addressed(protocol: Protocol, message: Message) -> bool:
    """Whether the frame of a message has an address (not so for responses of a packet protocol)."""
    return protocol.address_name is not None and bool(message.addresses)


def _set(
    context: click.Context,  # noqa: ARG001  # as all callbacks
    parameter: click.Parameter,  # noqa: ARG001
    values: tuple[str, ...],
) -> Replacement | None:
    given: dict[str, str] = {}
    for value in values:
        key, _, set_to = value.partition("=")
        if key not in {"crc", "crc_over"} or not set_to.strip(","):
            raise Failure(
                f"--set {value}: only crc=NAME and crc_over=PART,PART can be set, for example "
                "--set crc=crc-16/xmodem"
            )
        if key in given:
            raise Failure(f"--set {value}: {key} is set twice; omit one of them")
        given[key] = set_to
    over = [part.strip() for part in given.get("crc_over", "").split(",")]
    return Replacement(given.get("crc"), tuple(filter(None, over))) if given else None


#: ``--set crc=NAME`` and ``--set crc_over=PART,PART``; the command gets them as ``crc``.
crc_option = click.option(
    "--set",
    "crc",
    multiple=True,
    metavar="crc=NAME",
    callback=_set,
    help="Use another checksum algorithm from the catalogue; crc_over=PART,PART sets what it covers.",
)


def _version(context: click.Context, parameter: click.Parameter, value: str | None) -> str | None:  # noqa: ARG001
    if value is not None and not _VERSION.fullmatch(value):
        raise Failure(f"--protocol-version {value}: write numbers with dots between them, like 2.1")
    return value


#: ``--protocol-version V``; the command gets it as ``version``.
version_option = click.option(
    "--protocol-version",
    "version",
    metavar="VERSION",
    callback=_version,
    help="A version of the protocol, see since and until in the schema; by default the newest.",
)
