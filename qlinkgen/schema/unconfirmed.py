"""Warns of facts from a weak source."""

from __future__ import annotations

from collections.abc import Iterator

from qlinkgen.schema.file_model import Fact, Fields, SchemaFile
from qlinkgen.schema.notation import type_text
from qlinkgen.schema.report import Reporter, listed
from qlinkgen.schema.source import Path

_MOST_NAMED = 3


def report_unconfirmed(file: SchemaFile, report: Reporter) -> None:
    """Warn of each unconfirmed fact, and list the fields that use it."""
    users = _users(file)
    for path, called in _marked(file):
        relying = users.get(str(path[-1]), []) if path[0] in ("enums", "flags", "types") else []
        more = f" and {len(relying) - _MOST_NAMED} more" if len(relying) > _MOST_NAMED else ""
        names = ", ".join(relying[:_MOST_NAMED]) if more else listed(relying[:_MOST_NAMED])
        used = f", used by {names}{more}," if relying else ""
        what = f"{called}{used} is not confirmed by its source"
        report.error("unconfirmed", path, what, "check it on the device", of_key=True, needs=())


def _marked(file: SchemaFile) -> Iterator[tuple[Path, str]]:
    """Path and name of every unconfirmed fact."""
    for path, called, fact in _facts(file):
        if not fact.confirmed:
            yield path, called


def _facts(file: SchemaFile) -> Iterator[tuple[Path, str, Fact]]:
    for group in ("enums", "flags", "types"):
        for name, spec in getattr(file, group).items():
            yield (group, name), f"type {name}", spec
    yield ("frame",), "the frame", file.frame
    for group in ("parts", "packet"):
        for name, part in (getattr(file.frame, group) or {}).items():
            yield ("frame", group, name), f"{name} of the frame", part
    if file.frame.marked and file.frame.marked.checksum:
        yield ("frame", "marked", "checksum"), "the checksum of the frame", file.frame.marked.checksum
    for group in ("commands", "messages"):
        for name, spec in getattr(file, group).items():
            yield (group, name), name, spec
    for fields, path, owner in _fields(file):
        for name, field in fields.items():
            yield (*path, name), f"{owner}.{name}", field


def _fields(file: SchemaFile) -> Iterator[tuple[Fields, Path, str]]:
    for name, command in file.commands.items():
        for direction, fields in (("request", command.request), ("response", command.response)):
            if isinstance(fields, dict):
                yield fields, ("commands", name, direction), f"{name}.{direction}"
    for name, message in file.messages.items():
        yield message.fields, ("messages", name, "fields"), name


def _users(file: SchemaFile) -> dict[str, list[str]]:
    """Fields by the name of their type."""
    users: dict[str, list[str]] = {}
    for fields, _, owner in _fields(file):
        for name, field in fields.items():
            try:
                base = type_text(field.type).base
            except ValueError:
                continue
            users.setdefault(base, []).append(f"{owner}.{name}")
    return users
