"""Bytes in a schema: every notation, at every key for bytes."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import pytest
from pydantic import BaseModel

from qlinkgen.errors import SchemaError
from qlinkgen.model.coding import Insert
from qlinkgen.model.frame import DelimitedFrame
from qlinkgen.model.protocol import Protocol
from qlinkgen.model.types import Blob
from qlinkgen.schema import file_commands, file_fields, file_frames, load

SCHEMA = """\
qlinkgen: 1
protocol: {{name: sample, revision: "1", source: Made up}}
frame:
  parts:
    sync: {{role: constant, value: {value}}}
    length: {{role: length, type: u8, counts: [data]}}
    id: {{role: message, type: u8}}
    node: {{role: address, type: u8}}
    data: {{role: payload, size: 0..16}}
    crc: {{role: checksum, type: u16, algorithm: crc-16/ibm-3740, over: [length, id, node, data]}}
  stuffing: {{after: {after}, insert: {insert}, exempt: [sync]}}
bus: {{kind: master_slave, nodes: 1..16, broadcast: 0, response_within: 3 bytes}}
defaults: {{addressing: node, repeat: safe}}
commands:
  go:
    id: 1
    request:
      key: {{type: "bytes[1..4]", default: {default}}}
      name: {{type: "bytes[4]", pad: {pad}}}
    response: {{}}
"""
USUAL = {"value": "A5 A5", "after": "A5 A5", "insert": "0x00", "default": '"00"', "pad": "00"}


def frame(protocol: Protocol) -> DelimitedFrame:
    assert isinstance(protocol.frame, DelimitedFrame)
    return protocol.frame


def stuffing(protocol: Protocol) -> Insert:
    found = frame(protocol).stuffing
    assert found is not None
    return found


def default(protocol: Protocol) -> bytes:
    kind = protocol.message("go.request").fields[0].type
    assert isinstance(kind, Blob)
    return kind.default


def pad(protocol: Protocol) -> bytes:
    kind = protocol.message("go.request").fields[1].type
    assert isinstance(kind, Blob)
    return kind.pad


#: Keys, and their values in the model.
READ: dict[str, Callable[[Protocol], bytes]] = {
    "value": lambda protocol: frame(protocol).preamble,
    "after": lambda protocol: stuffing(protocol).after,
    "insert": lambda protocol: bytes([stuffing(protocol).insert]),
    "default": default,
    "pad": pad,
}
every_key = pytest.mark.parametrize("key", READ)


def test_every_key_of_type_bytes_is_listed() -> None:
    mappings = [
        each
        for module in (file_fields, file_frames, file_commands)
        for each in vars(module).values()
        if isinstance(each, type) and issubclass(each, BaseModel)
    ]
    mappings.remove(file_frames.CodingSpec)  # see test_coding
    keys = {
        name
        for each in mappings
        for name, info in each.model_fields.items()
        if info.annotation is bytes or "Annotated[bytes" in str(info.annotation)
    }
    # Those of an example have to be a whole frame: see test_examples. A separator is a character.
    assert (keys | {"default"}) - {"wire", "separator", "terminator"} == set(READ)


def loaded(tmp_path: Path, key: str, text: str) -> Protocol:
    path = tmp_path / "sample.yaml"
    path.write_text(SCHEMA.format(**{**USUAL, key: text}), encoding="utf-8")
    return load(path)


@every_key
def test_a_bare_number_of_two_digits_is_a_hex_pair(tmp_path: Path, key: str) -> None:
    for number in range(10, 100, 7):
        assert READ[key](loaded(tmp_path, key, str(number))) == bytes.fromhex(str(number))


@every_key
@pytest.mark.parametrize(
    ("text", "meant"),
    [
        ("0x10", "10"), ("'10'", "10"), ('"10"', "10"), ("1A", "1a"), ("a1", "a1"), ("0xA1", "a1"),
        ("07", "07"), ("7", "07"), ("0", "00"), ("0x7", "07"), ("100", "64"), ("255", "ff"), ("0b10", "02"),
        ("'99'", "99"), ("'1e'", "1e"),
    ],
)  # fmt: skip
def test_what_is_clear(tmp_path: Path, key: str, text: str, meant: str) -> None:
    assert READ[key](loaded(tmp_path, key, text)).hex() == meant


@every_key
@pytest.mark.parametrize("text", ["10 10", "'1010'", "1A1B", "0010", "'10 20 30'"])
def test_pairs(tmp_path: Path, key: str, text: str) -> None:
    if key in ("insert", "pad"):
        with pytest.raises(SchemaError, match=r"bytes cannot be inserted|the pad is not one byte"):
            loaded(tmp_path, key, text)
    else:
        assert READ[key](loaded(tmp_path, key, text)) == bytes.fromhex(text.strip("'"))


@every_key
@pytest.mark.parametrize(
    "text", ["256", "10100", "-10", "-1", "1.5", "true", "[16]", "0xA5A5", "1_0_0_0", "ABC", "'x'", "A5A"]
)
def test_invalid_byte_strings(tmp_path: Path, key: str, text: str) -> None:
    with pytest.raises(SchemaError, match="is not a byte string; write one number like 0xA5, or hex pairs"):
        loaded(tmp_path, key, text)


@pytest.mark.parametrize(
    ("text", "meant"), [("00", "00"), ("10", "10"), ("13", "13"), ("0x0A", "0a"), ("'7C'", "7c")]
)
def test_a_terminator_is_a_character_by_its_hex_pair(tmp_path: Path, text: str, meant: str) -> None:
    path = tmp_path / "sample.yaml"
    plain = SCHEMA.format(**USUAL).replace('"bytes[1..4]", default: "00"', '"bytes[1]"')
    plain = plain.replace('"bytes[4]", pad: 00', f'"text[0..4]", terminator: {text}')
    path.write_text(plain, encoding="utf-8")
    kind = load(path).message("go.request").fields[1].type
    assert isinstance(kind, Blob)
    assert kind.terminator.hex() == meant


def test_numbers_elsewhere_are_as_they_were(tmp_path: Path) -> None:
    path = tmp_path / "sample.yaml"
    text = SCHEMA.format(**USUAL).replace("id: 1\n", "id: 11\n")
    path.write_text(text.replace('bytes[1..4]", default: "00"', 'u8", default: 10, range: 10..99'))
    protocol = load(path)
    assert protocol.message("go.request").id == 11
