"""Kaitai Struct files: some with the constructs of public ones, and everything that can be wrong."""

from __future__ import annotations

import os
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from qlinkgen.errors import ImportFileError
from qlinkgen.importers.checking import written
from qlinkgen.importers.document import Notation, Value
from qlinkgen.importers.ksy import read_ksy
from qlinkgen.importers.ksy.conditions import Tested as Field
from qlinkgen.importers.ksy.conditions import condition
from qlinkgen.importers.ksy.expressions import Count, Expression, Name, Number, count, parsed, replaced
from qlinkgen.importers.notes import Notes
from qlinkgen.importers.yaml_text import write
from qlinkgen.schema import loads
from tests.importers.conftest import refused, survives

FILES = sorted((Path(__file__).parent / "ksy").glob("*.ksy"))
#: Files of which nothing can be taken.
EMPTY = {"calculated_endian", "imported_types"}


def taken(file: Path) -> str:
    """The schema of a file, unchecked, and the notes."""
    notes = Notes(file.name)
    schema = write(read_ksy(file, notes)).text
    return schema + "".join(f"# {each}\n" for each in sorted(notes.found))


@pytest.mark.parametrize("file", FILES, ids=lambda each: each.stem)
def test_files(file: Path) -> None:
    """The schema is the one beside the file; with QLINKGEN_UPDATE=1 it is written there, to be reviewed."""
    expected = file.with_suffix(".yaml")
    found = taken(file)
    if os.environ.get("QLINKGEN_UPDATE"):
        expected.write_text(found)
    assert found == expected.read_text()


@pytest.mark.parametrize("file", FILES, ids=lambda each: each.stem)
def test_what_is_written_passes_lint(file: Path) -> None:
    notes = Notes(file.name)
    document = read_ksy(file, notes)
    before = len(notes.found)
    if file.stem in EMPTY:
        with pytest.raises(ImportFileError, match="nothing could be imported"):
            written(document, notes)
        return
    protocol, faults = loads(written(document, notes), "x.yaml")
    assert protocol is not None
    assert {each.rule for each in faults} <= {"unconfirmed", "unused-type"}
    assert notes.found[before:] == []


LAUGHS = "meta: {id: x}\na0: &a0 [1]\n" + "".join(
    f"a{number}: &a{number} [*a{number - 1}, *a{number - 1}]\n" for number in range(1, 40)
)
SIMPLE = "meta: {id: x, endian: le}\nseq:\n  - {id: a, type: u1}\n"


@pytest.mark.parametrize(
    ("attribute", "note"),
    [
        ("{id: b, type: str, process: zlib}", "b: a process is code, and the number of bytes is not stated"),
        ("{id: b, type: u1, io: _root._io}", "b: another stream is not on the line"),
        ("{id: b, type: u1, banana: 1}", "b: the key 'banana' is not known"),
        ("banana", "unnamed_1: it is not a mapping"),
        ("{id: b, type: strz, consume: false}", "a terminator that is kept or may be missing is not taken"),
        ("{id: b}", "b: its size is not stated"),
        ("{id: b, size: 0}", "b: 0 bytes are not between 1 and 65535"),
        ("{id: b, size: a * a}", "b: 'a * a' is not a field or number"),
        ("{id: b, size: c}", "b: 'c' is not a field before it"),
        ("{id: b, type: foo}", "b: the type foo is not in this file"),
        ("{id: b, type: u3}", "b: the type u3 is not in this file"),
        ("{id: b, contents: []}", "b: constant bytes are missing"),
        ("{id: b, contents: [300]}", "b: '300' is not a byte or text"),
        ("{id: b, contents: 'a long constant'}", "b: more than 8 constant bytes in fields"),
        ("{id: b, type: u2, repeat: expr, repeat-expr: a % 2}", "b: 'a % 2' is not a field or number"),
        ("{id: b, type: u2, repeat: forever}", "b: repeat: forever is not known"),
        ("{id: b, size: 2, repeat: eos}", "b: only numbers and types are repeated"),
        ("{id: b, type: u2, if: a + 1 != 0}", "b: the condition 'a + 1 != 0' does not compare a field"),
        ("{id: b, type: u2, if: c == 1}", "b: 'c' is not a field before it"),
        ("{id: b, type: b3, repeat: eos}", "b: bits that are repeated"),
        (
            "{id: b, type: b64}\n  - {id: c, type: b3}\n  - {id: d, type: b62}",
            "d: bits that end more than 64 bits",
        ),
        (
            "{id: b, type: {switch-on: a + 1, cases: {1: u1}}}",
            "the choice by 'a + 1' is not one by a field before it",
        ),
        (
            "{id: b, type: {switch-on: a, cases: {x: u1}}}",
            "the case 'x' is not a number or a value of an enum",
        ),
        ("{id: b, type: {switch-on: a, cases: {1: foo}}}", "the type 'foo' of a case is not in this file"),
        ("{id: b, type: str, size: 4, pad-right: 300, encoding: ASCII}", "b: '300' is not a byte"),
    ],
)
def test_what_is_refused(tmp_path: Path, attribute: str, note: str) -> None:
    """The message is left out with the line, and nothing is left."""
    file = tmp_path / "x.ksy"
    file.write_text(f"{SIMPLE}  - {attribute}\n")
    notes = Notes("x.ksy")
    assert read_ksy(file, notes).sections["messages"] == ()
    found = str(notes.found[-1])
    assert found.startswith(
        ("x.ksy:4: note: message x is left out: ", "x.ksy:6: note: message x is left out: ")
    )
    assert note in found


@pytest.mark.parametrize(
    ("text", "error"),
    [
        ("", "x.ksy:1: this is not a Kaitai Struct file"),
        ("a: 1", "x.ksy:1: this is not a Kaitai Struct file"),
        ("meta: {id: x}\n  bad: [", "x.ksy:2: this is not YAML"),
        ("a: &a [*a]", "this is not YAML: an alias refers to a node that contains it"),
        (LAUGHS, "expand to too much data"),
        ("meta: {id: x}\ntypes: " + "{a: {types: " * 24 + "{}" + "}}" * 24, "types are nested more than 20"),
        ("meta: {id: x}\nseq: " + "[" * 90 + "]" * 90, "nested more than 50 deep"),
        (b"\x00\x01", "a byte 00: this is not a text file"),
        ("meta: {id: x, endian: le}\nseq: []\n", "x.ksy:1: the file describes no bytes: it has no seq"),
    ],
)  # fmt: skip
def test_errors(tmp_path: Path, text: str | bytes, error: str) -> None:
    assert error in refused(tmp_path, read_ksy, text, "x.ksy")


@pytest.mark.parametrize("more", ["", ", repeat: eos"])
def test_types_that_contain_themselves(tmp_path: Path, more: str) -> None:
    text = f"""\
meta: {{id: x, endian: le}}
seq:
  - {{id: a, type: t{more}}}
types:
  t:
    seq:
      - {{id: b, type: t{more}}}
"""
    assert "nothing could be imported" in refused(tmp_path, read_ksy, text)


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("4", 4), ("0x10", 16), ("len", Count("len")), ("len - 2", Count("len", offset=-2)),
        ("(len + 1)", Count("len", offset=1)), ("header.len * 2", Count("header.len", scale=2)),
        ("len.as<u1>", Count("len")), ("len.to_i", Count("len")), ("2 * (len - 1)", Count("len", 2, -2)),
        ("len / 2", None), ("len * 0", None), ("len - other", None), ("f(len)", None), ("len +", None),
        ("", None),
        ("len[0]", None), ("a ? b : c", None), ("1.5", None), ("'x'", None),
        ("(" * 60 + "a" + ")" * 60, None),
    ],
)  # fmt: skip
def test_counts(text: str, expected: object) -> None:
    assert count(parsed(text)) == expected


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("t", {"t": True}), ("not t", {"t": False}), ("t == true", {"t": True}), ("t != true", {"t": False}),
        ("a == 1", {"a": 1}), ("1 == a", {"a": 1}), ("(a != 0x10)", {"a": Notation("not 16")}),
        ("a > 3", {"a": Notation("4..255")}),
        ("3 > a", {"a": Notation("0..2")}), ("a >= 255", {"a": 255}),
        ("a < 3 and t", {"a": Notation("0..2"), "t": True}),
        ("a == k::one", {"a": "one"}), ("a == 1 or a == k::one or a == 5", {"a": [1, "one", 5]}),
        ("not (a == 1)", {"a": Notation("not 1")}), ("not (a != 1)", {"a": Notation("1")}),
        ("not (a > 3)", {"a": Notation("not 4..255")}),
        ("a & 0x80 != 0", {"a.7..7": True}), ("(a & 0x80) == 0", {"a.7..7": False}),
        ("(a >> 4) & 7 == 5", {"a.4..6": 5}),
        ("a >> 6 == 2", {"a.6..7": 2}), ("a & 0x81 == 0x80", {"a.0..0": False, "a.7..7": True}),
        ("a & 0x81 != 0", None), ("a & 1 == 2", None), ("a & 1", None), ("a", None), ("a > 255", None),
        ("a == k::two", None), ("a == b", None), ("a == 1 or b == 1", None), ("a == 1 and a == 2", None),
        ("a != 1 or a != 2", None), ("a + 1 == 2", None), ("x > 3", None), ("((a == 1)", None), ("", None),
    ],
)  # fmt: skip
def test_conditions(text: str, expected: Value | None) -> None:
    def of(name: str) -> Expression | None:
        known = {"k::one": Number(1, "one"), "true": Number(1), "false": Number(0)}
        return known.get(name) or (Name(name) if name in "abt" else None)

    def tested(name: str) -> Field:
        return Field(name, (0, 255), name == "t", lambda first, last: f"{name}.{first}..{last}")

    found = parsed(text)
    assert condition(found and replaced(found, of), tested) == expected


WORDS = """id: x type: u1 u2 u4le s2 f4 b3 b1 str strz size: 4 size: len size-eos: true contents: [1] 'ab'
    repeat: eos expr until repeat-expr: 3 repeat-until: _ == 0 if: a == 1 enum: e valid: 3 {min: 1}
    terminator: 0 pad-right: 0 switch-on: a cases: {1: t} encoding: ASCII doc: text t a len"""


@given(
    lines=st.lists(st.lists(st.sampled_from(WORDS.split()), max_size=6).map(" ".join), max_size=8),
    nested=st.booleans(),
)
def test_any_lines(tmp_path_factory: pytest.TempPathFactory, lines: list[str], nested: bool) -> None:
    margin = "      " if nested else "    "
    seq = "".join(f"{margin}{'- ' if at % 3 == 0 else '  '}{each}\n" for at, each in enumerate(lines))
    survives(tmp_path_factory.getbasetemp(), read_ksy, f"{SIMPLE}types:\n  t:\n    seq:\n{seq}")


KEYS = [
    "type",
    "size",
    "repeat",
    "repeat-expr",
    "repeat-until",
    "if",
    "enum",
    "valid",
    "contents",
    "terminator",
]
VALUES = st.sampled_from(
    """u1,u2,b3,b8,str,strz,t,4,a,a - 1,eos,expr,until,a == 1,_ == 0,e,[1],{min: 1},{any-of: [1]},'x',[],{},~,
    true,-1,1.5,{switch-on: a},{cases: {1: t}}""".split(",")  # noqa: SIM905
)


@given(attributes=st.lists(st.dictionaries(st.sampled_from(KEYS), VALUES, max_size=5), max_size=6))
def test_any_attributes(tmp_path_factory: pytest.TempPathFactory, attributes: list[dict[str, str]]) -> None:
    rows = [", ".join(f"{key}: {value}" for key, value in each.items()) for each in attributes]
    seq = "".join(f"  - {{id: f{at}, {each}}}\n" for at, each in enumerate(rows))
    text = f"{SIMPLE}{seq}types: {{t: {{seq: [{{id: x, type: u2}}]}}}}\nenums: {{e: {{1: one}}}}\n"
    survives(tmp_path_factory.getbasetemp(), read_ksy, text)


@given(data=st.binary(max_size=200))
def test_any_bytes(tmp_path_factory: pytest.TempPathFactory, data: bytes) -> None:
    survives(tmp_path_factory.getbasetemp(), read_ksy, data)


@given(file=st.sampled_from(FILES), at=st.integers(0, 2000), width=st.integers(0, 9), put=st.text(max_size=4))
def test_mutated_files(
    tmp_path_factory: pytest.TempPathFactory, file: Path, at: int, width: int, put: str
) -> None:
    text = file.read_text()
    at %= len(text)
    text = text[:at] + put + text[at + width :]
    survives(tmp_path_factory.getbasetemp(), read_ksy, text.encode("utf-8", "replace"))
