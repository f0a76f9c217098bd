"""Every text of the file model has a slot, accepts ordinary texts, and refuses control characters."""

from __future__ import annotations

import pytest

from qlinkgen.errors import Fault
from qlinkgen.model.texts import CONTROL
from qlinkgen.schema import loads
from qlinkgen.schema.source import parse
from tests.texts.samples import TEXTS
from tests.texts.slots import SCHEMAS, kinds_of_slots, put, slots, text_of

CHARACTERS = [chr(number) for number in range(0x10000) if CONTROL.match(chr(number))]
#: Code points that the YAML parser refuses.
SURROGATES = [character for character in CHARACTERS if "\ud800" <= character <= "\udfff"]
OTHERS = [character for character in CHARACTERS if character not in SURROGATES]


def faults(name: str, text: str) -> list[Fault]:
    return loads(text, f"{name}.yaml")[1]


def test_every_text_of_the_file_model_has_a_slot() -> None:
    assert {slot.kind for name in SCHEMAS for slot in slots(name)} == kinds_of_slots()


def test_which_characters_are_control_characters() -> None:
    assert {*map(chr, range(0x20)), *map(chr, range(0x7F, 0xA0))} - set(CHARACTERS) == {"\t", "\n"}
    marks = "\u061c\u200b\u200e\u200f\u202a\u202b\u202c\u202d\u202e\u2066\u2067\u2068\u2069\u2028\u2029\ufeff"
    assert set(marks) <= set(CHARACTERS)
    assert not [char for char in CHARACTERS if char.isprintable()]


@pytest.mark.parametrize("text", TEXTS)
def test_ordinary_texts_are_clean(text: str) -> None:
    for name in SCHEMAS:
        assert faults(name, text_of(put(name, slots(name), text))) == []


@pytest.mark.parametrize("name", SCHEMAS)
def test_a_control_character_is_refused_in_every_slot(name: str) -> None:
    every = slots(name)
    text = text_of(put(name, every, "a \x1b[31m b"))
    assert r"\e[31m" in text, "YAML holds it as an escape"
    positions = parse(text).values
    found = faults(name, text)
    assert {fault.rule for fault in found} == {"control-character"}
    assert {(fault.line, fault.column) for fault in found} == {
        (positions[slot.path].line, positions[slot.path].column) for slot in every
    }


def marked_with(source: str) -> str:
    return text_of(put("marked", [], "")).replace("source: Made up", f"source: {source}")


@pytest.mark.parametrize("character", OTHERS, ids=ascii)
def test_every_control_character_is_refused_where_it_is_escaped(character: str) -> None:
    text = marked_with(f'"Made\\u{ord(character):04X}up"')
    (found,) = faults("marked", text)
    lines = text.split("\n")
    assert found.rule == "control-character"
    assert lines[found.line - 1][found.column - 1 :].startswith('"Made')
    assert f"U+{ord(character):04X}" in found.message
    assert found.hint.startswith("remove it")
    assert not CONTROL.search(str(found))


@pytest.mark.parametrize("character", SURROGATES[::256], ids=ascii)
def test_half_a_character_is_refused(character: str) -> None:
    (found,) = faults("marked", marked_with(f'"Made\\u{ord(character):04X}up"'))
    assert found.rule in {"yaml-syntax", "control-character"}
    assert not CONTROL.search(str(found))


@pytest.mark.parametrize("character", [each for each in OTHERS if each != "\r"], ids=ascii)
def test_every_control_character_is_refused_where_it_is_written(character: str) -> None:
    text = f"{text_of(put('marked', [], ''))}# a comment{character}frame: {{}}\n"
    (found,) = faults("marked", text)
    assert found.rule in {"yaml-syntax", "control-character"}  # YAML itself forbids most of them
    assert (found.line, found.column) == (text.count("\n"), len("# a comment") + 1)
    assert found.hint.startswith("remove it")
    assert not CONTROL.search(str(found))


def test_a_byte_order_mark_may_open_a_file_and_lines_may_end_as_on_windows() -> None:
    text = text_of(put("marked", [], "")).replace("\n", "\r\n")
    assert faults("marked", f"\ufeff{text}") == []
