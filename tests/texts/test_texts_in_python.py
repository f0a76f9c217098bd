"""Texts of a schema are data in Python files: codecs, bus modules, construct structures."""

from __future__ import annotations

import ast
import functools
import importlib
import linecache
import re
import sys
from collections.abc import Iterator, Mapping
from pathlib import Path
from types import ModuleType
from typing import Any

import pytest

from qlinkgen.backends import construct, python
from qlinkgen.backends.base import Options
from qlinkgen.backends.python import bus, load
from qlinkgen.model.protocol import Protocol
from tests.texts.samples import CASES, HARMLESS, HOSTILE, TEXTS, harmless, turned
from tests.texts.slots import SCHEMAS, Slot, is_label, protocol_of, slots

#: Differs from the name of the shipped package, which is already imported.
OPTIONS = Options(package="python/wire")
TARGETS = {"python": python.generate, "bus": bus.generate, "construct": construct.generate}


def sources(protocol: Protocol) -> dict[str, str]:
    """Every Python module of a protocol, by its target."""
    return {
        name: text
        for name, generate in TARGETS.items()
        for path, text in generate(protocol, Options()).items()
        if Path(path).stem.startswith(protocol.name)
    }


class _Bare(ast.NodeTransformer):
    """Empties every string of a module, which leaves its structure."""

    def visit_Constant(self, node: ast.Constant) -> ast.Constant:
        return ast.Constant("") if isinstance(node.value, str) else node


def structure(tree: ast.Module) -> str:
    """The text of a module without its strings; changes the tree."""
    return ast.dump(_Bare().visit(tree))


@functools.cache
def structures(
    name: str, texts: tuple[str, ...], places: tuple[Slot, ...] | None = None
) -> Mapping[str, str]:
    """The structure of each module of a schema."""
    found = sources(protocol_of(name, texts, places))
    return {target: structure(ast.parse(source)) for target, source in found.items()}


def docstrings(tree: ast.Module) -> list[str]:
    """Docstrings of a module without blanks, because lines and even long words are wrapped."""
    owners = (ast.Module, ast.ClassDef, ast.FunctionDef, ast.AsyncFunctionDef)
    found = (ast.get_docstring(node, clean=False) for node in ast.walk(tree) if isinstance(node, owners))
    return [re.sub(r"\s", "", doc) for doc in found if doc]


@pytest.mark.parametrize(("name", "texts"), CASES)
def test_texts_change_only_docstrings(name: str, texts: tuple[str, ...]) -> None:
    protocol = protocol_of(name, texts)
    wanted = re.sub(r"\s", "", protocol.title).rstrip(".")
    for target, source in sources(protocol).items():
        tree = ast.parse(source)
        said = docstrings(tree)
        assert wanted in said[0], target
        assert target != "python" or len(texts) > 1 or sum(wanted in doc for doc in said) > 4
        assert structure(tree) == structures(name, harmless(texts))[target], target


@pytest.mark.slow
def test_the_code_is_that_of_harmless_texts_in_each_kind_of_slot_alone() -> None:
    text = f'\'"""\\ {{{{ x }}}} */ ??/ {HOSTILE[0]} {HOSTILE[3]}'
    first = {slot.kind: (name, slot) for name in reversed(SCHEMAS) for slot in slots(name)}
    for name, slot in first.values():
        places = tuple(each for each in slots(name) if is_label(each)) if is_label(slot) else (slot,)
        for target, source in sources(protocol_of(name, text, places)).items():
            assert structure(ast.parse(source)) == structures(name, (HARMLESS,), places)[target], (
                target,
                slot,
            )


def modules(folder: Path, protocol: Protocol) -> Iterator[ModuleType]:
    """The generated modules, written to a package and imported."""
    files = {path: text for make in TARGETS.values() for path, text in make(protocol, OPTIONS).items()}
    for path, text in files.items():
        (folder / path).parent.mkdir(parents=True, exist_ok=True)
        (folder / path).write_text(text, "utf-8")
    for path in files:
        if path.endswith(f"/{protocol.name}.py"):
            yield importlib.import_module(".".join(Path(path).with_suffix("").parts[1:]))


@pytest.fixture
def alone(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Path]:
    """A folder for generated packages; they are removed from sys.modules afterwards."""
    packages = ["wire", Path(construct.FOLDER).name]
    kept = {name: module for name, module in sys.modules.items() if name.split(".")[0] in packages}
    for name in kept:
        monkeypatch.delitem(sys.modules, name)
    for folder in ("python", "construct"):
        monkeypatch.syspath_prepend(tmp_path / folder)
    monkeypatch.chdir(tmp_path)
    yield tmp_path
    for name in [name for name in sys.modules if name.split(".")[0] in packages]:
        del sys.modules[name]
    sys.modules.update(kept)


@pytest.mark.parametrize("texts", turned(3))
@pytest.mark.parametrize("name", SCHEMAS)
def test_written_modules_run_nothing_and_hold_the_texts(
    name: str, texts: tuple[str, ...], alone: Path
) -> None:
    protocol = protocol_of(name, texts)
    codec, *_ = modules(alone, protocol)
    assert not (alone / "canary").exists()
    for command in protocol.commands:
        row = codec.COMMANDS[command.name]
        assert row.section == command.section
        assert row.attributes == command.attributes
    for message in protocol.messages:
        found = codec.MESSAGES[message.name]
        legal = {rule.name: rule.legal for rule in found.RULES}
        units = {value.name: getattr(value.type, "unit", "") for value in message.values}
        assert all(legal[field].endswith(unit) for field, unit in units.items())


@pytest.mark.parametrize("text", [text for text in TEXTS if text.isascii() and len(text) <= 60])
def test_a_default_that_is_text_is_one(text: str) -> None:
    protocol = protocol_of("delimited", HARMLESS, default=text)
    codec = load(protocol)
    assert codec.MESSAGES["measure.response"](node=1).note == text
    space: dict[str, Any] = {}
    (argument,) = [line for line in sources(protocol)["python"].splitlines() if "note: str = " in line][:1]
    exec("default = " + re.sub(r".*note: str = |,?$|\) -> None:.*", "", argument), space)
    assert space["default"] == text


@pytest.mark.parametrize("name", SCHEMAS)
def test_code_that_runs_here_has_no_text_of_the_schema(name: str) -> None:
    def executed(text: str, file: str) -> str:
        protocol = protocol_of(name, text, default=text, file=file)
        codec = load(protocol)
        decode = getattr(codec, "decode", None) or codec.decode_request
        return "".join(linecache.getlines(decode.__code__.co_filename))

    source = executed("Zebra", "zebra.yaml")
    assert "def " in source
    assert "zebra" not in source.lower()
    # The schema's hash, and a default, which may take several lines.
    varied = re.compile(r"(?<=\.yaml )\(\w+\)|note: str = .*?(?=,\n    \) -> None)", re.DOTALL)
    assert varied.sub("", executed(HOSTILE[0][:60], '"""canary.yaml')) == varied.sub("", source)


def test_errors_of_code_that_runs_here_name_the_units() -> None:
    codec = load(protocol_of("delimited", 'mm"'))
    with pytest.raises(codec.EncodeError, match=r'speed: 1001 cannot be sent; .* 0\.\.1000 mm"$'):
        codec.MESSAGES["measure.request"](node=1, speed=1001).to_frame()


def test_units_of_one_message_are_not_those_of_another() -> None:
    places = [slot for slot in slots("packet") if slot.kind == ("FieldSpec", "unit")]
    protocol = protocol_of("packet", [f"unit {index}" for index in range(len(places))], places)
    codec = load(protocol)
    legal = [each.RULES[0].legal.rpartition(" ")[2] for each in codec.MESSAGES.values() if each.RULES]
    assert sorted(legal) == sorted(map(str, range(len(places))))
