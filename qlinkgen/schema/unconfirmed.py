"""Warns of facts from a weak source."""

from __future__ import annotations

from collections.abc import Iterator

from qlinkgen.schema.file_base import Fact
from qlinkgen.schema.file_model import SchemaFile
from qlinkgen.schema.layouts import layouts, own_steps
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
    yield from _frame_facts(file)
    for group in ("replies", "commands", "messages"):
        for name, spec in getattr(file, group).items():
            yield (group, name), name, spec
    for name, command in file.commands.items():
        for key, reply in command.replies.items():
            yield ("commands", name, "replies", key), f"{name}.{key}", reply
        for step in own_steps(name, command):
            yield step.path, f"{name}.{step.name}", step.spec
    for each in layouts(file):
        for name, field in each.fields.items():
            yield (*each.path, name), f"{each.owner or each.path[1]}.{name}", field


def _frame_facts(file: SchemaFile) -> Iterator[tuple[Path, str, Fact]]:
    yield ("frame",), "the frame", file.frame
    for group in ("parts", "packet"):
        for name, part in (getattr(file.frame, group) or {}).items():
            yield ("frame", group, name), f"{name} of the frame", part
    for kind, spec in file.frames.items():
        yield ("frames", kind), f"the frame {kind}", spec
        for name, part in spec.parts.items():
            yield ("frames", kind, "parts", name), f"{name} of the frame {kind}", part
    if file.frame.marked and file.frame.marked.checksum:
        yield ("frame", "marked", "checksum"), "the checksum of the frame", file.frame.marked.checksum


def _users(file: SchemaFile) -> dict[str, list[str]]:
    """Fields by the name of their type."""
    users: dict[str, list[str]] = {}
    for each in layouts(file):
        for name, field in each.fields.items():
            try:
                base = type_text(field.type).base
            except ValueError:
                continue
            users.setdefault(base, []).append(f"{each.owner or each.path[1]}.{name}")
    return users
