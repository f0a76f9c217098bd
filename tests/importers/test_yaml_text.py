"""The text of a schema: whatever is written is read back, in the form that a person would write."""

from __future__ import annotations

from decimal import Decimal
from pathlib import Path

import pytest
import yaml
from hypothesis import given
from hypothesis import strategies as st

from qlinkgen.importers.document import Block, Commented, Document, Field, Message, Notation, Value
from qlinkgen.importers.names import Names, schema_name, without_prefix
from qlinkgen.importers.notes import Notes
from qlinkgen.importers.reading import Unreadable, content
from qlinkgen.importers.yaml_text import WIDTH, write
from qlinkgen.model.texts import one_line
from qlinkgen.schema.source import Data, parse

TEXTS = st.one_of(
    st.text(max_size=300),
    st.text("ab :#,[]{}'\"\\-?&*!|>%@`~=<.+0\n\té", max_size=20),
    st.sampled_from(
        ["true", "No", "null", "~", "1e5", "0x10", "1.5", "2001-01-01", "12:30", "<<", "=", "..."]
    ),
)
KEYS = st.from_regex(r"[a-z][a-z0-9_]{0,12}", fullmatch=True).filter(
    # Keys of schemas need no quotes here, though they would for other readers of YAML.
    lambda key: key not in ("on", "off", "yes", "no", "true", "false", "null")
)
VALUES = st.recursive(
    st.one_of(TEXTS, st.integers(-(10**20), 10**20), st.booleans()),
    lambda inner: st.one_of(
        st.lists(inner, max_size=4),
        st.dictionaries(KEYS, inner, max_size=4),
        st.dictionaries(KEYS, inner, max_size=4).map(Block),
        st.tuples(TEXTS, inner).map(lambda pair: Commented(*pair)),
    ),
    max_leaves=12,
)


def document(frame: Value) -> Document:
    return Document({"name": "x"}, "big", frame, {"kind": "host"}, {})


def plain(value: Value) -> Data:
    match value:
        case Commented():
            return plain(value.value)
        case str():
            return one_line(value)
        case list():
            return [plain(each) for each in value]
        case dict():
            return {key: plain(each) for key, each in value.items()}
        case Notation():
            return value.text
        case _:
            return value


@given(value=VALUES.filter(bool))
def test_values_are_read_back(value: Value) -> None:
    """By the parser of schemas, and by a plain one."""
    text = write(document(value)).text
    source = parse(text)
    assert source.faults == []
    assert isinstance(source.data, dict)
    expected = plain(value)
    if expected:
        assert source.data["frame"] == expected
        assert yaml.safe_load(text)["frame"] == expected


@pytest.mark.parametrize(
    ("text", "written"),
    [
        ("Level in mm", "Level in mm"),
        ("m/s", "m/s"),
        ("°C", "°C"),
        ("u16[0..12]", "u16[0..12]"),
        ("a: b", '"a: b"'),
        ("a #b", '"a #b"'),
        ("a:b#c", "a:b#c"),
        ("on", '"on"'),
        ("1", '"1"'),
        ("- a", '"- a"'),
        ('say "hi"', 'say "hi"'),
        ("\x1b[31m", "\\x1b[31m"),
    ],
)
def test_quotes_only_where_needed(text: str, written: str) -> None:
    assert f"frame: {written}\n" in write(document(text)).text


def test_quotes_inside_braces() -> None:
    assert 'frame: {a: "u16[2]", b: c}\n' in write(document({"a": "u16[2]", "b": "c"})).text


def test_long_mappings_and_texts_are_divided() -> None:
    doc = "word " * 40
    lines = write(document({"a": {"type": "u8", "doc": doc}, "b": 1})).lines
    assert lines[lines.index("frame:") + 1 : lines.index("frame:") + 4] == [
        "  a:",
        "    type: u8",
        "    doc: >-",
    ]
    assert max(map(len, lines)) <= WIDTH


def test_places_of_items() -> None:
    messages = (Message("a", (Field("x", "u8", doc="d"),), 1, {"id": 1}), Message("b", (), 2, {"id": 2}))
    result = write(Document({}, "big", {}, {}, {"messages": messages}))
    assert [result.item_at(result.lines.index(line) + 1) for line in ("    id: 1", "  b:", "messages:")] == [
        ("messages", "a"),
        ("messages", "b"),
        None,
    ]


@pytest.mark.parametrize(
    ("raw", "name"),
    [
        ("MotorStatus", "motor_status"),
        ("HTTPCode2", "http_code2"),
        ("MAP_3D", "map_3d"),
        ("Axis2Speed", "axis2_speed"),
        ("motor-status (rpm)", "motor_status_rpm"),
        ("Überdruck", "uberdruck"),
        ("2nd", "n2nd"),
        ("___", "none"),
        ("温度", "none"),
        ("x" * 99, "x" * 40),
        ("_a__b_", "a_b"),
    ],
)
def test_names(raw: str, name: str) -> None:
    assert schema_name(raw, "none") == name


@given(raw=st.lists(st.text(max_size=60), max_size=20))
def test_names_are_names_and_differ(raw: list[str]) -> None:
    notes = Notes("file")
    taken = [Names(notes, "type", types=True, taken=["u8"]).take(each, 1) for each in raw]
    names = Names(notes, "field")
    taken = [names.take(each, 1) for each in raw]
    assert len(set(taken)) == len(taken)
    assert all(schema_name(each) == each and len(each) <= 40 for each in taken)


def test_names_of_types_differ_from_built_in_ones() -> None:
    names = Names(Notes("file"), "type", types=True)
    assert [names.take(each, 1) for each in ("U8", "Bytes", "fixed32", "mode", "Mode")] == [
        "u8_type",
        "bytes_type",
        "fixed32_type",
        "mode",
        "mode_2",
    ]


@pytest.mark.parametrize(
    ("raw", "short"),
    [
        ("MODE_OFF MODE_HEAT", "off heat"),
        ("MODE_1 MODE_2", "mode_1 mode_2"),
        ("MAV_TYPE_A MAV_TYPE_A_B", "a a_b"),
        ("A A_B", "a a_b"),
        ("ONLY_ONE", "ONLY_ONE"),
        ("off heat", "off heat"),
    ],
)
def test_names_without_prefix(raw: str, short: str) -> None:
    assert without_prefix(raw.split()) == short.split()


@pytest.mark.parametrize(
    ("make", "reason"), [("mkdir", "s a directory|not a file"), ("none", "No such file")]
)
def test_what_cannot_be_read(tmp_path: Path, make: str, reason: str) -> None:
    if make == "mkdir":
        (tmp_path / "x").mkdir()
    with pytest.raises(Unreadable, match=reason):
        content(tmp_path / "x")


def test_notes_are_told_once() -> None:
    notes = Notes("a")
    for _ in range(2):
        notes.add(1, "x")
        notes.of("b").add(0, "y")
    assert [str(each) for each in notes.found] == ["a:1: note: x", "b: note: y"]


def test_numbers_of_the_parser() -> None:
    """What `test_values_are_read_back` relies on: only these are numbers."""
    assert parse("a: 1.5").data == {"a": Decimal("1.5")}
