"""Versions of a protocol: what has begun and not yet ended, deprecation, errors of one version alone."""

from __future__ import annotations

from pathlib import Path

import pytest

from qlinkgen.model.protocol import Protocol
from qlinkgen.schema import lint, loads
from qlinkgen.schema.notation import version

SCHEMA = """\
qlinkgen: 1
protocol: {{name: probe, title: Probe, revision: "1", source: this test}}
enums:
  gear: {{type: u8, values: {{low: 1, high: {{value: 2, since: 2.0}}, park: {{value: 3, until: 1.5}}}}}}
flags:
  alarm: {{type: u8, values: {{hot: 0, cold: {{bit: 1, since: 1.10}}}}}}
types:
  pair: {{fields: {{x: u8, y: {{type: u8, since: 3}}}}}}
frame:
  parts:
    size: {{type: u8, counts: [data]}}
    id: {{role: message, type: u8}}
    data: {{role: payload, size: 0..60}}
    sum: {{type: u8, algorithm: sum8, over: [size, id, data]}}
bus: {{kind: master_slave, response_within: 1 ms}}
defaults: {{repeat: safe}}
commands:
  put:
    id: 1
    request:
      gear: gear
      alarm: {{type: alarm, doc: What is wrong., deprecated: 3}}
      old: {{type: u8, until: 1.5}}
      new: {{type: u16, since: "1.10"{more}}}
      pair: pair
    response: {{}}
  late: {{id: 2, since: 2, request: {{}}, response: {{}}}}
messages:
  early: {{id: 3, until: 1.0.3, fields: {{}}}}
"""


def protocol_of(chosen: str | None, more: str = "") -> Protocol:
    protocol, faults = loads(SCHEMA.format(more=more), "probe.yaml", version=chosen)
    assert protocol, [str(fault) for fault in faults]
    return protocol


@pytest.mark.parametrize(
    ("chosen", "fields", "gears", "messages"),
    [
        ("1", "gear alarm old pair", "low park", "put early"),
        ("1.0.3", "gear alarm old pair", "low park", "put early"),
        ("1.0.4", "gear alarm old pair", "low park", "put"),
        ("1.5.0", "gear alarm old pair", "low park", "put"),
        ("1.5.1", "gear alarm pair", "low", "put"),
        ("1.10", "gear alarm new pair", "low", "put"),
        ("2", "gear alarm new pair", "low high", "put late"),
        (None, "gear alarm new pair", "low high", "put late"),
    ],
)
def test_what_a_version_has(chosen: str | None, fields: str, gears: str, messages: str) -> None:
    protocol = protocol_of(chosen)
    assert [field.name for field in protocol.message("put").fields] == fields.split()
    assert [member.name for member in protocol.enums[0].members] == gears.split()
    assert (
        list(dict.fromkeys(message.command or message.name for message in protocol.messages))
        == messages.split()
    )
    assert len(protocol.flags[0].members) == (
        1 if fields.startswith("gear alarm old") or chosen == "1.5.1" else 2
    )
    pair = protocol.message("put").fields[-1]
    assert pair.max_size == (2 if chosen is None else 1)


def test_versions_are_numbers() -> None:
    assert version("1.9") < version("1.10")
    assert version(2).key == version("2.0").key
    assert version("1.0.3") <= version("1.0.3.0")


def test_deprecation_is_in_the_description() -> None:
    def doc(chosen: str | None) -> str:
        return protocol_of(chosen).message("put").fields[1].doc

    assert doc("2") == "What is wrong."
    assert doc("3") == doc(None) == "What is wrong. Deprecated since 3"


def test_the_banner_and_the_hash_name_the_version() -> None:
    assert protocol_of("2").version == "2"
    assert protocol_of("2").schema_hash != protocol_of("1").schema_hash != protocol_of(None).schema_hash


@pytest.mark.parametrize(
    ("more", "text"),
    [
        (", until: 1.2", "until 1.2 is before since 1.10; write the versions in this order"),
        (", deprecated: 1", "deprecated 1 is before since 1.10; write the versions in this order"),
        (", until: new", "'new' is not a version; write numbers with dots between them, like 2.1"),
    ],
)
def test_wrong_versions(more: str, text: str) -> None:
    faults = loads(SCHEMA.format(more=more), "probe.yaml")[1]
    assert text in [f"{fault.message}; {fault.hint}" for fault in faults]


def test_a_named_type_has_no_lifetime() -> None:
    text = (
        SCHEMA.format(more="")
        .replace("types:\n", "types:\n  t: {type: u8, since: 2}\n")
        .replace("old: {type: u8", "old: {type: t")
    )
    faults = loads(text, "probe.yaml", version="1")[1]
    assert "'since' has no effect on a named type" in [fault.message for fault in faults]


def test_lint_checks_every_version(tmp_path: Path) -> None:
    """The newest version is right; before 1.10 a field is counted that is not there."""
    file = tmp_path / "probe.yaml"
    file.write_text(SCHEMA.format(more=""))
    assert lint(file) == []
    wrong = SCHEMA.format(more="").replace(
        "pair: pair", 'n: {type: u8, counts: list}, list: {type: "u8[0..3]", since: 1.10}'
    )
    file.write_text(wrong.replace("      n: {", "      n: {").replace(", list: {", "\n      list: {"))
    faults = lint(file)
    assert faults
    assert {fault.rule for fault in faults if fault.severity == "error"} == {"bad-count"}
    assert faults[-1].message.endswith("in version 0 of the protocol")
    assert [fault.severity for fault in lint(file, version="2")] == ["warning"]


def test_records_come_and_go() -> None:
    text = SCHEMA.format(more="").replace("pair: pair", "pair: {type: pair, since: 2}")
    for chosen, there in (("1", False), ("2", True)):
        protocol, faults = loads(text, "probe.yaml", version=chosen)
        assert protocol, faults
        assert ("pair" in [field.name for field in protocol.message("put").fields]) is there


def test_bits_come_and_go() -> None:
    head = "{type: u8, bits: {a: {at: 0, until: 1}, b: {at: 1, since: 2}, c: 2}}"
    text = SCHEMA.format(more="").replace("pair: pair", f"pair: pair\n      head: {head}")
    for chosen, names in (("1", "ac"), ("1.5", "c"), ("2", "bc")):
        protocol, faults = loads(text, "probe.yaml", version=chosen)
        assert protocol, faults
        assert "".join(value.name for value in protocol.message("put").values if value.bits) == names
