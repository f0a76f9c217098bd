"""An error is reported once, without errors derived from it."""

from __future__ import annotations

from pathlib import Path

import pytest

from qlinkgen.schema import find, loads
from qlinkgen.schema.report import Reporter
from qlinkgen.schema.source import parse

SINK = (Path(__file__).parents[1] / "schemas/kitchen_sink.yaml").read_text("utf-8")


def rules(text: str) -> list[str]:
    return [fault.rule for fault in sorted(loads(text, "x.yaml")[1]) if fault.severity == "error"]


@pytest.mark.parametrize(
    ("old", "new", "rule"),
    [
        # A removed part is still counted, covered, and addressed.
        ("station: {role: address, type: u8}", "station: {rôle: address, type: u8}", "unknown-key"),
        ("kind: {role: message, type: u8}", "kind: {role: message, type: 8}", "wrong-type"),
        ("payload: {role: payload, size: 0..120}", "payload: {role: payload, size: many}", "bad-value"),
        ("payload: {role: payload, size: 0..120}", "payload: {role: pay, size: 0..120}", "bad-value"),
        ("value: 0x7E", "value: 0x7EE", "bad-value"),
        ("crc-8/smbus", "crc-8/smbas", "unknown-algorithm"),
        ("over: [length, kind,", "over: [length, kin,", "unknown-part"),
        ("counts: [payload]", "counts: {payload: 1}", "wrong-type"),
        ("\nframe:", "\nfram:", "unknown-key"),
        # Addresses and transactions.
        ("nodes: 1..31", "nodes: 31..1", "bad-value"),
        ("broadcast: 0", "broadcast: none", "wrong-type"),
        ("addressing: node", "adressing: node", "unknown-key"),
        ("  repeat: safe", "  repeat: save", "bad-value"),
        ("response_within: 20 bytes", "response_within: 20", "bad-value"),
        # Named types: used repeatedly, reported once.
        ("type: i16, scale: 1/10, offset: -40", "type: i16, scale: 1/0, offset: -40", "bad-value"),
        ("type: i16, scale: 1/10, offset: -40", "type: i16, scael: 1/10, offset: -40", "unknown-key"),
        ("type: i64, scale: 1/1000", "type: i64, scale: 1/3", "inexact-scale"),
        ("celsius: {type: i16", "celsius: {type: i99", "bad-width"),
        ("green: 2,", "green: two,", "wrong-type"),
        ("  colour:\n    type: u8", "  colour:\n    type: u5x", "unknown-type"),
        ("  strict:\n    type: u8", "  strict:\n    typ: u8", "unknown-key"),
        # Fields referred to by other fields and keys.
        ('words: "u16[0..8]"', 'words: "u17x[0..8]"', "unknown-type"),
        ("counts: words}", "count: words}", "unknown-key"),
        ("counts: words}", "counts: wrods}", "bad-count"),
        ("counts: words}", "counts: {words: 1}}", "wrong-type"),
        (
            "request: {counter: {type: u8, default: 9}",
            "request: {counter: {type: u8, default: 900}",
            "value-does-not-fit",
        ),
        (
            "request: {counter: {type: u8, default: 9}",
            "request: {counter: {typo: u8, default: 9}",
            "unknown-key",
        ),
        (
            "gear: {at: 0..2, type: gear, default: high}",
            "gear: {at: 0..2, type: gaer, default: high}",
            "unknown-type",
        ),
        ("level: {at: 4..9, scale: 1/2", "level: {at: 4..9, scale: 0", "bad-scale"),
        ("    id: 0x06\n", "    id: six\n", "wrong-type"),
        ("    id: 0x06\n", "", "missing-key"),
        ("    id: 0x06\n", "    Id: 0x06\n", "unknown-key"),
        ("byteorder: big", "byteorder: bid", "bad-value"),
        ("qlinkgen: 1", "qlinkgen: 3", "bad-value"),
        ("  revision:", "  revison:", "unknown-key"),
    ],
)
def test_one_fault_is_one_message(old: str, new: str, rule: str) -> None:
    assert old in SINK
    assert rules(SINK.replace(old, new, 1)) == [rule]


def test_faults_in_all_passes_come_in_one_run() -> None:
    text = SINK.replace("crc-8/smbus", "crc-8/smbas").replace("baud: 9600", "boud: 9600")
    text = text.replace('name: "text[0..16]"', 'name: "txet[0..16]"').replace("    id: 0x09", "    id: 0x08")
    text = text.replace(
        "      colour: {type: colour, default: green}", "      class: {type: colour, default: gren}"
    )
    assert set(rules(text)) == {
        "bad-value", "overlapping-id", "unknown-algorithm", "unknown-key", "unknown-type",
    }  # fmt: skip


def test_taint_reaches_down_and_up_but_not_aside() -> None:
    report = Reporter("x.yaml", parse("a: {b: {c: 1}, d: 2}"))
    report.taint(("a", "b"))
    assert report.touched(("a", "b"))
    assert report.touched(("a", "b", "c"))
    assert report.touched(("a",))
    assert not report.touched(("a", "d"))
    report.error("bad-value", ("a", "d"), "seen", "mend it")
    report.error("bad-value", ("a", "b", "c"), "not seen")
    report.error("bad-value", ("a", "d"), "not seen", needs=(("a", "d"), ("a", "b")))
    report.error("missing-key", ("a",), "not seen either", absent=True)
    report.error("bad-value", ("a", "d"), "seen", "mend it")
    assert [str(fault) for fault in report.faults] == ["x.yaml:1:19: error[bad-value]: seen; mend it"]


def test_position_of_key_and_value() -> None:
    source = parse("a:\n  b: [1, {c: 2}]\n")
    assert (source.position(("a", "b")).line, source.position(("a", "b")).column) == (2, 6)
    assert source.position(("a", "b"), of_key=True).column == 3
    assert source.position(("a", "b", 1, "c"), of_key=True).column == 11
    assert source.position(("a", "b", 1, "c")).column == 14
    assert source.position(("a", "x", "y"), of_key=True).line == 1, (
        "a missing node has the position of its parent"
    )


def test_warnings_do_not_keep_a_file_from_being_used() -> None:
    text = find("qlink").read_text("utf-8")
    protocol, faults = loads(text, "qlink.yaml")
    assert protocol
    assert {fault.severity for fault in faults} == {"warning"}


def test_another_crc() -> None:
    protocol, _ = loads(SINK, "x.yaml", crc="crc-8/maxim-dow")
    assert protocol
    assert rules(SINK) == []
    _, faults = loads(SINK, "x.yaml", crc="crc-16/modbus")
    assert [fault.rule for fault in faults] == ["checksum-does-not-fit"]
    _, faults = loads(SINK, "x.yaml", crc="crc-8/nonsense")
    assert [fault.rule for fault in faults] == ["unknown-algorithm"]
