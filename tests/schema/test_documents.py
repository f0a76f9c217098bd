"""Generated pages are up to date, examples of the reference are valid, the JSON Schema agrees with lint."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

import jsonschema
import pytest
import yaml

from qlinkgen.schema import find, library, loads, shipped
from qlinkgen.schema.documents import json_schema_text, outputs
from qlinkgen.schema.file_model import SchemaFile, json_schema
from qlinkgen.schema.rules import RULES
from qlinkgen.schema.source import parse

ROOT = Path(__file__).parents[2]
REFERENCE = (ROOT / "docs/schema-reference.md").read_text("utf-8")
BLOCKS = re.findall(r"```yaml\n(.*?)```", REFERENCE, re.DOTALL)
#: Protocols of the design of the language by their titles, each with its text and its schemas.
PROTOCOLS = re.findall(
    r"^### (.*?)\n(.*?)(?=^##)",
    (ROOT / "docs/explain/language.md").read_text("utf-8"),
    re.DOTALL | re.MULTILINE,
)
HEAD = (
    'qlinkgen: 1\nprotocol: {name: example, title: Example, revision: "1", source: Example, doc: Example}\n'
)
FILES = [*(find(name) for name in (*shipped(), *library())), *sorted((ROOT / "tests/schemas").glob("*.yaml"))]


def plain(data: Any) -> Any:
    """The text parsed like by a YAML parser of an editor."""
    if isinstance(data, dict):
        return {key: plain(value) for key, value in data.items()}
    if isinstance(data, list):
        return [plain(value) for value in data]
    return data if isinstance(data, bool | int | str | None) else float(data)


@pytest.mark.parametrize(("path", "text"), outputs(ROOT).items(), ids=lambda value: value[:30])
def test_committed_page_is_up_to_date(path: str, text: str) -> None:
    committed = (ROOT / path).read_text("utf-8")
    assert committed == text, f"{path} is out of date; run: qlinkgen generate"


def test_rules_page_without_the_repository_has_no_examples(tmp_path: Path) -> None:
    page = outputs(tmp_path)["docs/rules.md"]
    assert all(f"## {rule}\n" in page for rule in RULES)
    assert "```yaml" not in page


@pytest.mark.parametrize("number", range(len(BLOCKS)))
def test_example_of_the_reference(number: int) -> None:
    whole = yaml.load(BLOCKS[0], Loader=yaml.BaseLoader)
    block = {**whole, **yaml.load(BLOCKS[number], Loader=yaml.BaseLoader)}
    if "frames" in block:
        del block["frame"]
    text = _dump(block)
    protocol, faults = loads(text, "example.yaml")
    assert protocol, [str(fault) for fault in faults]
    assert {fault.rule for fault in faults} <= {"unconfirmed", "unused-type"}


@pytest.mark.parametrize(("title", "text"), PROTOCOLS, ids=lambda value: value[:20])
def test_protocol_of_the_design(title: str, text: str, tmp_path: Path) -> None:
    if title == "Modbus ASCII":  # includes the protocol before it
        (rtu,) = re.findall(r"```yaml\n(.*?)```", dict(PROTOCOLS)["Modbus RTU"], re.DOTALL)
        (tmp_path / "modbus_rtu.yaml").write_text(HEAD + rtu)
    schemas = re.findall(r"```yaml\n(.*?)```", text, re.DOTALL)
    assert schemas
    for schema in schemas:
        protocol, faults = loads(HEAD + schema, str(tmp_path / "example.yaml"))
        assert (protocol is None) == ("Not built:" in text), [str(fault) for fault in faults]


def _dump(data: Any) -> str:
    """YAML with scalars as written: plain if the notation needs it."""
    if isinstance(data, dict):
        return "{" + ", ".join(f"{key}: {_dump(value)}" for key, value in data.items()) + "}"
    if isinstance(data, list):
        return "[" + ", ".join(map(_dump, data)) + "]"
    return data if re.fullmatch(r"-?[\w./^]+", data) else f'"{data}"'


def test_reference_names_every_key() -> None:
    def keys(schema: dict[str, Any]) -> set[str]:
        return {key for part in schema["$defs"].values() for key in part.get("properties", {})}

    missing = {key for key in keys(json_schema()) if not re.search(rf"\b{key}\b", REFERENCE)}
    assert missing == set()


@pytest.mark.parametrize("path", FILES, ids=lambda path: path.stem)
def test_json_schema_accepts(path: Path) -> None:
    jsonschema.Draft202012Validator(json_schema()).validate(plain(parse(path.read_text("utf-8")).data))


def test_json_schema_is_one() -> None:
    jsonschema.Draft202012Validator.check_schema(json_schema())
    assert json_schema_text() == json_schema_text()


@pytest.mark.parametrize(
    "text", ["{type: 5}", "{type: u8, scal: 1}", "5", "{range: 0..1}", "{type: u8, byteorder: middle}"]
)
def test_json_schema_refuses_the_same_as_the_front_end(text: str) -> None:
    source = find("qlink").read_text("utf-8").replace("{type: u8, doc: Returned as it is}", text, 1)
    protocol, _ = loads(source, "x.yaml")
    assert protocol is None
    with pytest.raises(jsonschema.ValidationError):
        jsonschema.Draft202012Validator(json_schema()).validate(plain(parse(source).data))


def test_schema_files_name_the_json_schema_in_their_first_line() -> None:
    for path in FILES:
        first = path.read_text("utf-8").splitlines()[0]
        assert first.startswith("# yaml-language-server: $schema=")
        assert (path.parent / first.partition("=")[2]).resolve() == ROOT / "docs/schema/qlinkgen.schema.json"


def test_every_key_is_described() -> None:
    undescribed = [
        f"{name}.{key}"
        for name, part in json_schema()["$defs"].items()
        for key, spec in part["properties"].items()
        if "description" not in spec and "$ref" not in spec and not _described(spec)
    ]
    assert undescribed == []
    assert SchemaFile.__doc__


def _described(spec: dict[str, Any]) -> bool:
    return any("description" in each for each in spec.get("anyOf", ()))
