"""A whole module: the render model of each part, and the templates in their order."""

from __future__ import annotations

import functools
import re
import textwrap
from collections.abc import Iterable
from typing import Any

import jinja2

from qlinkgen.backends import python_text
from qlinkgen.backends.base import Options, banner, environment
from qlinkgen.backends.python import frames, tables
from qlinkgen.backends.python.checks import selectable
from qlinkgen.backends.python.classes import ClassBuilder, ClassModel, class_name
from qlinkgen.backends.python.frames_delimited import is_unique, seal_lines
from qlinkgen.backends.python.imports import PUBLIC, imports
from qlinkgen.backends.python.place import Place, in_hex, place_of
from qlinkgen.model.frame import DelimitedFrame, MarkedFrame
from qlinkgen.model.message import Message
from qlinkgen.model.protocol import Protocol
from qlinkgen.model.texts import one_line


def render(protocol: Protocol, options: Options) -> str:
    """The text of a protocol's module."""
    return Module(protocol, options).text()


@functools.cache
def templates() -> jinja2.Environment:
    """The templates of this back-end, with the one way for a text into them."""
    found = environment(__package__)
    found.filters["docstring"] = lambda text: "\n".join(python_text.docstring([text]))
    return found


class Module:
    """Collects what the templates place."""

    def __init__(self, protocol: Protocol, options: Options) -> None:
        self.protocol = protocol
        self.options = options
        self.templates = templates()
        self.messages = kept(protocol, options)
        names = [class_name(message) for message in self.messages]
        self.constants = tables.constant_classes(protocol, names)
        self.unique = is_unique(protocol)
        self.place: Place = place_of(protocol, self.constants, unique=self.unique)
        measured = frames.measured(protocol, unique=self.unique)
        self.builder = ClassBuilder(self.place, protocol, self.messages, measured=measured)
        self.models: list[ClassModel] = []
        self.tables = self._tables()

    def text(self) -> str:
        """The module's text."""
        self.models = self.builder.build()
        body = {"classes": self._classes(self.models), "steps": self.builder.steps, **self._frame()}
        context = {**self._head(), **self.tables, **body}
        said = "\n".join([*body["steps"], body["classes"], body["frame"], body["decoder"]])
        text = python_text.bare(said)
        context |= imports(text, enums=bool(self.tables["enums"]), flags=bool(self.tables["flags"]))
        context |= {"public": self._public(text)}
        return _tidy(self._place("module.j2", context))

    def _place(self, template: str, context: dict[str, Any]) -> str:
        return self.templates.get_template(f"templates/{template}").render(context)

    def _head(self) -> dict[str, Any]:
        title, *others = map(one_line, banner(self.protocol))
        about = one_line(f"{self.protocol.doc} Source: {self.protocol.source}.")
        lines = [f"{title}: messages, frames and transactions.", "", *textwrap.wrap(about, 108), "", *others]
        return {"doc": python_text.docstring(lines)}

    def _tables(self) -> dict[str, Any]:
        by_name = {message.name: message for message in self.messages}
        rows = [{"message": message.name, "name": class_name(message)} for message in self.messages]
        used = self._used_constants()
        return {
            "enums": [
                tables.enum_model(e, self.constants[e.name]) for e in self.protocol.enums if e.name in used
            ],
            "flags": [
                tables.flags_model(f, self.constants[f.name]) for f in self.protocol.flags if f.name in used
            ],
            "messages": rows,
            "bus": tables.bus(self.protocol.bus),
            "commands": tables.command_rows(self.protocol.commands, by_name),
        }

    def _used_constants(self) -> set[str]:
        if not self.options.only:
            return set(self.constants)
        return {
            meaning.name
            for message in self.messages
            for value in message.values
            if (meaning := getattr(value.type, "meaning", None)) and not isinstance(meaning, str)
        }

    # The frame and its decoder

    def _frame(self) -> dict[str, Any]:
        names = _received(self.options)
        context: dict[str, Any] = {
            "title": one_line(self.protocol.title),
            "verifies": False,
            "directions": frames.directions(self.protocol, names),
        }
        context |= {"known": self._known(context["directions"])}
        context |= frames.direction_model([each["name"] for each in context["directions"]])
        sizes = sorted({each.body_size for each in self.models if each.body_size is not None})
        rows = {name: self._rows(name) for name in ("request", "response")}
        context |= frames.model_of(self.protocol, sizes, self.place.names.prefix, rows, unique=self.unique)
        kind = frames.kind_of(self.protocol, unique=self.unique)
        context["selectable"] = selectable(frames.checksum_of(self.protocol))
        return {
            "frame": self._place(f"{kind}.j2", context).strip(),
            "decoder": self._place(f"{kind}_decoder.j2", context).strip(),
        }

    def _known(self, directions: Iterable[dict[str, str]]) -> list[dict[str, Any]]:
        return [{**each, "rows": self._rows(each["name"])} for each in directions]

    def _rows(self, direction: str) -> list[dict[str, str]]:
        messages = [message for message in self.messages if message.direction in (direction, "message")]
        return [{"id": in_hex(message.id), "name": class_name(message)} for message in messages]

    def _classes(self, models: list[ClassModel]) -> str:
        template = self.templates.get_template("templates/class.j2")
        common = frames.encoder_model(self.protocol, unique=self.unique)
        texts = []
        for each in models:
            seal = self._seal(each) if each.has_codec else []
            texts.append(template.render(each=each, seal=seal, **common))
        return "".join(texts).strip("\n")

    def _seal(self, each: ClassModel) -> list[str]:
        if not isinstance(self.protocol.frame, DelimitedFrame):
            return []
        if not self.unique:
            return ["return _sealed(body)"]
        return seal_lines(self.protocol.frame, each.body_size, self.place.names.prefix)

    # Names

    def _public(self, text: str) -> list[str]:
        names = [class_name(message) for message in self.messages]
        names += [row.name for group in ("enums", "flags") for row in self.tables[group]]
        names += ["BUS", "COMMANDS", "MESSAGES", "Message", "StreamDecoder", *PUBLIC]
        names += ["MARKING", "Marking"] if isinstance(self.protocol.frame, MarkedFrame) else []
        names += re.findall(r"^def ([a-z]\w*)", text, re.MULTILINE)
        return sorted(set(names))


def kept(protocol: Protocol, options: Options) -> tuple[Message, ...]:
    """The messages that have a class in the module."""
    only = set(options.only)
    if not only:
        return protocol.messages
    return tuple(m for m in protocol.messages if m.name in only or m.command in only)


def _received(options: Options) -> tuple[str, ...]:
    return {"both": ("request", "response"), "master": ("response",), "slave": ("request",)}[options.role]


def _tidy(text: str) -> str:
    """Without blanks at line ends, and never more than two empty lines in a row."""
    text = re.sub(r"[ \t]+$", "", text, flags=re.MULTILINE)
    return re.sub(r"\n{4,}", "\n\n\n", text).rstrip("\n") + "\n"
