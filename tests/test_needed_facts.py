"""Each fact that hand-written behaviour needs is missed in one sentence, in mutated copies of the schemas.

A copy renames one field of every message at a time, all values, or all messages, enums and flags. The facts
are the tables that the behaviour checks; that these list what it uses is read from its code.
"""

from __future__ import annotations

import ast
import importlib
import importlib.util
import itertools
import re
from collections.abc import Callable, Collection, Iterator
from pathlib import Path
from types import ModuleType
from typing import Any

import pytest
import yaml

import qlinkgen.codecs
from qlinkgen import _resources
from qlinkgen.backends.base import Options
from qlinkgen.backends.python.module import render
from qlinkgen.errors import UnsuitableSchema
from qlinkgen.model.naming import pascal
from qlinkgen.plan import plan_of
from qlinkgen.schema import find, loads

NAMES = ("qlink", "trio", "mc1231a")
#: A schema, as YAML reads it.
Document = dict[str, Any]
#: What sentences say is missing.
Missing = set[str]


def facts_of(name: str) -> ModuleType:
    return importlib.import_module(f"qlinkgen.protocols.{name}.facts")


def document(name: str) -> Document:
    text = find(name).read_text(encoding="utf-8")
    read: Document = yaml.load(text, Loader=getattr(yaml, "CSafeLoader", yaml.SafeLoader))
    return read


def renamed(node: Any, names: Collection[str]) -> Any:
    """Return a part of a schema with other names, wherever they are keys or values."""
    if isinstance(node, dict):
        return {renamed(key, names): renamed(value, names) for key, value in node.items()}
    if isinstance(node, list):
        return [renamed(each, names) for each in node]
    return f"{node}_x" if node in names else node


def own_fields(found: Document, name: str, fields: Collection[str]) -> list[str]:
    """Return the fields that a message has of itself, without the address of its frame."""
    command, dot, part = name.rpartition(".")
    held = found["commands"][command].get(part, {}) if dot else found["messages"][name]["fields"]
    return [field for field in fields if isinstance(held, dict) and field in held]


def with_field(command: Document, field: str) -> Document:
    """Return a command or a message with another name for a field, and `repeat` with that name too."""
    written = dict(command)
    for key in ("request", "response", "fields"):
        if isinstance(part := command.get(key), dict):
            written[key] = {f"{each}_x" if each == field else each: value for each, value in part.items()}
    if isinstance(repeat := command.get("repeat"), dict):
        written["repeat"] = {key: renamed(value, {field}) for key, value in repeat.items()}
    return written


def without_fields(name: str) -> Iterator[tuple[Document, Missing]]:
    """Rename the first needed field of every message, then the second one.."""
    needed = {message: fields.split() for message, fields in facts_of(name).FIELDS.items()}
    plain = document(name)
    key = "commands" if "commands" in plain else "messages"
    chosen: dict[str, list[str]] = {}
    for message, fields in needed.items():
        chosen.setdefault(message.partition(".")[0], []).extend(own_fields(plain, message, fields))
    turns = itertools.zip_longest(*(dict.fromkeys(fields) for fields in chosen.values()))
    for turn in turns:
        copy, missing = document(name), set()
        for command, field in zip(chosen, turn, strict=True):
            if field is not None:
                copy[key][command] = with_field(copy[key][command], field)
                missing |= {
                    f"{message} has no {field}"
                    for message, fields in needed.items()
                    if message.partition(".")[0] == command and field in fields
                }
        yield copy, missing


def without_messages(name: str) -> Iterator[tuple[Document, Missing]]:
    """Rename every message that is needed."""
    needed = facts_of(name).FIELDS
    commands = {message.partition(".")[0] for message in needed}
    copy = document(name)
    key = "commands" if "commands" in copy else "messages"
    copy[key] = {f"{each}_x" if each in commands else each: value for each, value in copy[key].items()}
    for part in ("frame", "bus"):
        copy[part] = renamed(copy[part], commands)
    yield copy, {f"the schema has no {message}" for message in needed}


def without_values(name: str) -> Iterator[tuple[Document, Missing]]:
    """Rename every needed value of enums and flags, then these themselves."""
    needed = {kind: values.split() for kind, values in facts_of(name).ENUMS.items()}
    copy = document(name)
    for kind, values in needed.items():
        part = copy["enums" if kind in copy.get("enums", {}) else "flags"]
        part[kind]["values"] = renamed(part[kind]["values"], values)
    missing = {f"{kind} has no {value}" for kind, values in needed.items() for value in values}
    yield with_defaults(copy, {value for values in needed.values() for value in values}), missing
    yield with_types(document(name), needed), {f"the schema has no enum or flags {kind}" for kind in needed}


def with_types(copy: Document, names: Collection[str]) -> Document:
    """Return a schema whose enums and flags have other names."""

    def changed(node: Any) -> Any:
        if isinstance(node, list):
            return [changed(each) for each in node]
        if not isinstance(node, dict):
            return node
        return {
            key: renamed(value, names) if key == "type" else changed(value) for key, value in node.items()
        }

    for part in ("enums", "flags"):
        copy[part] = {renamed(kind, names): value for kind, value in copy.get(part, {}).items()}
    written: Document = changed(copy)
    return written


def with_defaults(node: Any, names: Collection[str]) -> Any:
    """Return a part of a schema whose defaults have the new names."""
    if isinstance(node, list):
        return [with_defaults(each, names) for each in node]
    if not isinstance(node, dict):
        return node
    return {
        key: renamed(value, names) if key == "default" else with_defaults(value, names)
        for key, value in node.items()
    }


def faults_of(name: str, copy: Document, folder: Path, patch: pytest.MonkeyPatch) -> tuple[str, list[str]]:
    """Import the facts of a protocol with the module of a copy; return the copy's text and the sentences."""
    text = yaml.safe_dump(copy, sort_keys=False)
    file = folder / f"{name}.yaml"
    file.write_text(text, encoding="utf-8")
    model, faults = loads(text, file.name)
    assert model is not None, faults
    codec = ModuleType(f"qlinkgen.codecs.{name}")
    codec.__package__ = "qlinkgen.codecs"  # it uses the support module there
    exec(render(plan_of(model, Options()), laid_out=False), codec.__dict__)
    patch.setattr(qlinkgen.codecs, name, codec)
    patch.setattr(_resources, "schemas_dir", lambda: folder)
    spec = importlib.util.spec_from_file_location("facts_of_a_copy", facts_of(name).__file__)
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    with pytest.raises(UnsuitableSchema) as caught:
        spec.loader.exec_module(module)
    return text, str(caught.value).splitlines()


SENTENCE = re.compile(
    r"schemas/(\w+)\.yaml:(\d+):(\d+): (.* has no .*), "
    r"which qlinkgen/protocols/\1 needs; change both together"
)
#: Keys at which something may be missing, besides the names of messages.
PARENTS = {"commands", "messages", "enums", "flags", "fields", "values", "request", "response"}


@pytest.mark.parametrize("name", NAMES)
@pytest.mark.parametrize("kind", [without_fields, without_messages, without_values])
def test_each_missing_fact_is_one_sentence(
    name: str,
    kind: Callable[[str], Iterator[tuple[Document, Missing]]],
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    for copy, missing in kind(name):
        text, sentences = faults_of(name, copy, tmp_path, monkeypatch)
        read = [SENTENCE.fullmatch(each) for each in sentences]
        assert all(read), sentences
        assert sorted(each[4] for each in read if each) == sorted(missing)
        lines = text.splitlines()
        at = {lines[int(each[2]) - 1][int(each[3]) - 1 :].partition(":")[0] for each in read if each}
        assert at <= PARENTS


@pytest.mark.parametrize("name", NAMES)
def test_the_tables_have_what_the_code_names(name: str) -> None:
    codec, facts = importlib.import_module(f"qlinkgen.codecs.{name}"), facts_of(name)
    messages = {kind.__name__: message for message, kind in codec.MESSAGES.items()}
    used = set()
    for path in Path(str(facts.__file__)).parent.rglob("*.py"):
        tree = ast.parse(path.read_text(encoding="utf-8"))
        for node in ast.walk(tree):
            if isinstance(node, ast.Attribute) and node.attr in messages:
                used.add((messages[node.attr], ""))
            if (
                isinstance(node, ast.Call)
                and isinstance(node.func, ast.Attribute)
                and node.func.attr in messages
            ):
                used |= {(messages[node.func.attr], each.arg) for each in node.keywords if each.arg}
    listed = {message: {"", "node", "address", *fields.split()} for message, fields in facts.FIELDS.items()}
    assert {(message, field) for message, field in used if field not in listed.get(message, ())} == set()


@pytest.mark.parametrize("name", NAMES)
def test_the_tables_have_the_values_that_the_code_names(name: str) -> None:
    facts = facts_of(name)
    listed = {
        f"{pascal(kind)}.{value.upper()}" for kind, values in facts.ENUMS.items() for value in values.split()
    }
    used = set()
    for path in Path(str(facts.__file__)).parent.rglob("*.py"):
        for found in re.finditer(r"\b([A-Z]\w+)\.([A-Z][A-Z0-9_]+)\b", path.read_text(encoding="utf-8")):
            kind = found[1].removesuffix("Enum")
            if any(kind == pascal(each) for each in facts.ENUMS):
                used.add(f"{kind}.{found[2]}")
    assert used
    assert used <= listed
