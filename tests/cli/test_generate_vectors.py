"""`qlinkgen generate` checks the shipped schemas against the hand-written vectors."""

from __future__ import annotations

import re
import shutil
from pathlib import Path

import pytest

from qlinkgen.cli import hand_vectors, manifest
from tests.cli.conftest import Run

REPOSITORY = Path(__file__).resolve().parents[2]


@pytest.fixture
def schemas(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A copy of the shipped schemas, used in their place."""
    folder = tmp_path / "schemas"
    shutil.copytree(REPOSITORY / "schemas", folder)
    for module in (hand_vectors, manifest):
        monkeypatch.setattr(module, "schemas_dir", lambda: folder)
    monkeypatch.chdir(tmp_path)
    return folder


def rows(schemas: Path, pattern: str, protocol: str = "qlink") -> list[int]:
    """Line numbers of entries whose text matches a pattern."""
    text = (schemas / "vectors" / f"{protocol}.yaml").read_text()
    parts = re.split(r"(?m)^(?=  - (?:message|kind):)", text)
    lines, line = [], 1
    for part in parts:
        if re.search(pattern, part) and part.startswith("  - "):
            lines.append(line)
        line += part.count("\n")
    return lines


def change(schemas: Path, old: str, new: str, protocol: str = "qlink") -> None:
    file = schemas / f"{protocol}.yaml"
    text = file.read_text()
    assert len(re.findall(old, text, re.MULTILINE)) == 1, old
    file.write_text(re.sub(old, new, text, count=1, flags=re.MULTILINE))


def mismatches(qlinkgen: Run, *schemas: Path) -> list[int]:
    """Line numbers of the reported mismatches, all in the file of one protocol."""
    result = qlinkgen("generate", *schemas, "--target", "c", "-o", "out")
    lines = result.err.splitlines()
    assert (result.code, Path("out").exists()) == (int(bool(lines)), not lines)
    name = schemas[-1].name
    form = re.compile(rf"schemas/vectors/{name}:([0-9]+): this vector no longer matches: .+")
    found = [form.fullmatch(each) for each in lines]
    assert all(found), result.err
    return [int(each[1]) for each in found if each]


@pytest.mark.parametrize("name", ["qlink", "trio", "mc1231a"])
def test_the_shipped_schemas_fit(qlinkgen: Run, schemas: Path, name: str) -> None:
    assert mismatches(qlinkgen, schemas / f"{name}.yaml") == []


#: An edit of qlink.yaml, and a pattern of the entries that no longer match.
EDITS = {
    "message renamed": (r"^  motion:", "  move:", r"message: motion\."),
    "field renamed": (r"node_number: {type: u8, range", "number: {type: u8, range", r"node_number: "),
    "enum renamed": (r"metronix: ", "metro: ", r": metronix"),
    "enum renumbered": (r"metronix: {value: 2", "metronix: {value: 3", r": metronix"),
    "narrower range": (
        r"range: 1..16, default: 1, doc: N",
        "range: 1..4, default: 1, doc: N",
        r"node_number: 5",
    ),
    "scale": (r"scale: 1/10", "scale: 1/5", r"t1_delay: "),
    "preamble": (r"A5 A5", "A5 A6", r"  - message: (.|\n)*payload: "),
    "checksum": (r"crc-16/ibm-3740", "crc-16/xmodem", r"  - message: (.|\n)*payload: "),
    "byte order": (r"^byteorder: big", "byteorder: little", r"message: motion.response(.|\n)*position: "),
}


@pytest.mark.parametrize("edit", EDITS)
def test_every_vector_that_no_longer_fits_is_named(qlinkgen: Run, schemas: Path, edit: str) -> None:
    old, new, pattern = EDITS[edit]
    change(schemas, old, new)
    found, expected = mismatches(qlinkgen, schemas / "qlink.yaml"), rows(schemas, pattern)
    assert expected
    assert set(expected) <= set(found) <= set(rows(schemas, ""))
    assert found == sorted(set(found))
    if edit.endswith("renamed"):
        assert found == expected


def test_mismatches_of_all_protocols_are_reported_together(qlinkgen: Run, schemas: Path) -> None:
    change(schemas, "A5 A5", "A5 A6")
    change(schemas, "^  set_pos:", "  set_position:", "mc1231a")
    files = [schemas / f"{name}.yaml" for name in ("qlink", "mc1231a", "trio")]
    result = qlinkgen("generate", *files, "-o", "out")
    assert (result.code, Path("out").exists()) == (1, False)
    assert {line.partition(":")[0] for line in result.err.splitlines()} == {
        "schemas/vectors/qlink.yaml",
        "schemas/vectors/mc1231a.yaml",
    }


def test_another_checksum_is_not_held_to_them(qlinkgen: Run, schemas: Path) -> None:
    arguments = (schemas / "qlink.yaml", "--target", "c", "-o", "out", "--set", "crc=xmodem")
    assert qlinkgen("generate", *arguments).code == 0


def test_other_schemas_of_the_same_name_are_not_held_to_them(
    qlinkgen: Run, schemas: Path, tmp_path: Path
) -> None:
    change(schemas, "A5 A5", "A5 A6")
    own = tmp_path / "qlink.yaml"
    shutil.move(schemas / "qlink.yaml", own)
    assert qlinkgen("generate", own, "--target", "c", "-o", "out").code == 0
