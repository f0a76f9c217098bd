"""`qlinkgen explain`: every byte is named, and every kind of damage is, with its likely cause."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from qlinkgen.cli.explain import explained
from qlinkgen.cli.findings import finding
from qlinkgen.model.checksum import find as algorithm
from qlinkgen.plan import plan_of
from qlinkgen.schema import find, load
from tests.cli.conftest import Run

VECTORS = Path(__file__).parents[2] / "generated" / "vectors"
GOOD = "a5a504210315e8"


def crc_of(name: str, data: str) -> str:
    return f"{algorithm(name).compute(bytes.fromhex(data)):04x}"


def rows(out: str) -> list[list[str]]:
    return [line.split() for line in out.splitlines() if line.strip()[:1].isdigit()]


def test_the_documents_own_example(qlinkgen: Run) -> None:
    """Its stuffing is right, its CRC is of no known algorithm."""
    result = qlinkgen("explain", "qlink", "A5A5 0783 01A5 00FF A500 E305")
    assert result.code == 1
    assert [row[:3] for row in rows(result.out)] == [
        ["0", "a5", "preamble"],
        ["1", "a5", "preamble"],
        ["2", "07", "length"],
        ["3", "83", "command"],
        ["4", "01", "node"],
        ["5", "a5", "outputs"],
        ["6", "00", "(stuffing)"],
        ["7", "ff", "outputs"],
        ["8", "a5", "outputs"],
        ["9", "00", "(stuffing)"],
        ["10", "e3", "crc"],
        ["11", "05", "crc"],
    ]
    assert "crc is 0xE305, but crc-16/ibm-3740 over length, command, node, data gives 0xCC3B" in result.out
    assert "no algorithm of the catalogue" in result.out


def test_a_good_frame(qlinkgen: Run) -> None:
    result = qlinkgen("explain", "qlink", GOOD)
    assert result.code == 0
    assert result.lines[0] == "motor_position.request, node 3"
    assert "no errors" in result.out


@pytest.mark.parametrize("name", ["crc-16/xmodem", "crc-16/kermit", "crc-16/ibm-sdlc"])
def test_another_algorithm_is_named(qlinkgen: Run, name: str) -> None:
    result = qlinkgen("explain", "qlink", "a5a5042103" + crc_of(name, "042103"))
    assert result.code == 1
    assert f"it matches {name}" in result.out


def test_another_byte_order_and_coverage_are_named(qlinkgen: Run) -> None:
    out = qlinkgen("explain", "qlink", "a5a5042103e815").out
    assert "it matches crc-16/ibm-3740 with its bytes swapped" in out
    out = qlinkgen("explain", "qlink", "a5a5042103" + crc_of("crc-16/ibm-3740", "2103")).out
    assert "it matches crc-16/ibm-3740 over command, node" in out


def test_coverage_before_and_after_unstuffing(qlinkgen: Run) -> None:
    stuffed = crc_of("crc-16/ibm-3740", "078301a500ffa500")
    out = qlinkgen("explain", "qlink", "a5a5078301a500ffa500" + stuffed).out
    assert "with the stuffing" in out


def test_a_flipped_bit_is_found(qlinkgen: Run) -> None:
    out = qlinkgen("explain", "qlink", "a5a5042107" + GOOD[-4:]).out
    assert "one bit was flipped on the wire: 03 at offset 4 would match" in out
    out = qlinkgen("explain", "qlink", GOOD[:-1] + "9").out
    assert "one bit of the check value itself" in out


@pytest.mark.parametrize(
    ("wire", "rule", "cause"),
    [
        ("a504210315e8", "preamble a5 a5 missing", "byte of the preamble was lost"),
        ("a5a5ff210315e8", "length is 255, allowed are 4..30", "flipped"),
        ("a5a50421", "announces 3 bytes more than received", "cut"),
        ("a5a504200300", "announces 1 byte more", "cut"),
        ("a5a504" + "2203" + "a5a5", "a new preamble begins at offset 5", "interrupted"),
        ("a5a505" + "8301a507" + "0000", "a5 at offset 5 is followed by 07", "does not stuff"),
        ("a5a506" + "2303" + "12340000", "payload of 2 bytes; preset_motor_position", "has length 8"),
        ("a5a504" + "2503" + "0000", "command 0x25 is unknown", "the nearest known is motor_position"),
        ("a5a504" + "2163" + "0000", "node is 99; motor_position.request has", "wrong address"),
    ],
)  # fmt: skip
def test_broken_delimited_frames(qlinkgen: Run, wire: str, rule: str, cause: str) -> None:
    result = qlinkgen("explain", "qlink", wire)
    assert result.code == 1
    assert rule in result.out
    assert cause in result.out


def test_ambiguous_and_given_directions(qlinkgen: Run) -> None:
    wire = "a5a5" + "078301000000" + crc_of("crc-16/ibm-3740", "078301000000")
    out = qlinkgen("explain", "qlink", wire).out
    assert out.startswith("write_read.request")
    assert "it may also be write_read.response" in out
    assert qlinkgen("explain", "qlink", "--direction", "response", wire).out.startswith("write_read.response")


@pytest.mark.parametrize(
    ("wire", "rule"),
    [
        ("0102", "header missing"),
        ("9401", "end byte missing"),
        ("947f90", ""),
        ("947f98", "the end has address 3, the header 2"),
        ("840180", "address is 0; keypad_mode has 1..15"),
        ("9700" + "90", "type 7 is unknown"),
        ("94", "end byte missing"),
        ("94000090", "2 bytes between header and end; keypad_mode has 1"),
        ("94" + "94" + "0090", "a header at offset 1, before the end"),
        ("01947f90", "1 byte before the header"),
        ("920000" + "00" * 10 + "0000" + "90", "checksum is 0x0000, but crc-16/ibm-3740 over payload gives"),
        ("931f90", "offset is 31, allowed are 1..15"),
    ],
)
def test_marked_frames(qlinkgen: Run, wire: str, rule: str) -> None:
    result = qlinkgen("explain", "trio", wire)
    assert result.code == (1 if rule else 0)
    assert rule in result.out


@pytest.mark.parametrize(
    ("wire", "rule"),
    [
        ("4a 0012d687 d6e3", ""),
        ("4a 0012d687", "reading the check value is optional"),
        ("4a", ""),
        ("4a 0012", "the packet ends 4 bytes too early; get_pos.response has 4 bytes, and 2 of checksum"),
        ("4a 0012d687 d6", "1 of 2 bytes received"),
        ("4a 0012d687 0000", "the command was refused as illegal"),
        ("4a 0012d687 e3d6", "its bytes are swapped"),
        ("4a 0012d687 d699", "the sum of the words without command"),
        ("4a 0012d687 d6e2", "one bit was flipped"),
        ("10 ffff fff1 0000", ""),
        ("10 0012", "the packet ends 2 bytes too early; set_pos.request has 4"),
        ("ff", "command 0xFF is unknown"),
    ],
)
def test_packets(qlinkgen: Run, wire: str, rule: str) -> None:
    result = qlinkgen("explain", "mc1231a", wire)
    assert result.code == (1 if rule else 0), result.out
    assert rule in result.out


def test_a_packets_response_alone(qlinkgen: Run) -> None:
    assert qlinkgen("explain", "mc1231a", "--request", "4a", "0012d687d6e3").code == 0
    result = qlinkgen("explain", "mc1231a", "--direction", "response", "0012d687d6e3")
    assert result.code == 2
    assert "--request" in result.err


def test_an_own_schema(qlinkgen: Run, thermo: Path) -> None:
    assert qlinkgen("explain", thermo, "7e81" + "030410" + "01" + "d007" + "ef").code == 1
    out = qlinkgen("explain", thermo, "7e81" + "030310" + "01" + "d007" + "ee").out
    assert "20 degC (raw 2000)" in out
    assert "heat (1)" in out
    out = qlinkgen("explain", thermo, "7e81" + "030611" + "02" + "01000200" + "31" + "00").out
    assert "1, 2" in out
    assert ".heating" in out
    assert "true" in out


@pytest.mark.parametrize(
    ("schema", "wire", "title"),
    [
        ("modbus_rtu", "010300000001840a", "read_holding_registers.request, address 1"),
        ("modbus_rtu", "01030200017984", "read_holding_registers.response, address 1"),
        ("dynamixel", "fffffd000103000119 4e", "ping.request, id 1"),
    ],
)
def test_other_frames(qlinkgen: Run, schema: str, wire: str, title: str) -> None:
    path = Path(__file__).parents[1] / "schemas" / f"{schema}.yaml"
    result = qlinkgen("explain", path, wire)
    assert result.code == 0, result.out
    assert result.lines[0] == title
    assert qlinkgen("decode", path, wire).code == 0


def test_empty_and_broken_hex(qlinkgen: Run) -> None:
    assert qlinkgen("explain", "qlink", "").code == 2
    assert "'z' is not a hex digit" in qlinkgen("explain", "qlink", "a5zz").err
    assert "'a5a' is a word with an odd number of hex digits" in qlinkgen("explain", "qlink", "a5a").err


def test_one_fault_is_not_blamed_twice(qlinkgen: Run) -> None:
    """After a stuffing fault a check value says nothing; without a preamble no length does."""
    out = qlinkgen("explain", "qlink", "a5a5042103a5ff").out
    assert "a5 at offset 5 is followed by ff, not by 00" in out
    assert "not checked" in out
    assert out.count("wrong:") == 1
    out = qlinkgen("explain", "qlink", "00").out
    assert "missing" in out
    assert out.count("wrong:") == 1


@pytest.mark.parametrize("name", ["qlink", "trio", "mc1231a"])
def test_nothing_is_wrong_with_the_vectors(name: str) -> None:
    plan = plan_of(load(find(name)))
    for row in json.loads((VECTORS / f"{name}.json").read_text("utf-8"))["vectors"]:
        wire = bytes.fromhex(row.get("request", "") + row["wire"])
        found, _ = explained(plan, wire, None, None)
        assert [each.kind for each in found] == [""] * len(found), row
        assert found[-1].message is not None
        same = found[-1].message.message.command == plan.message(row["message"]).message.command
        assert same, row


@pytest.mark.parametrize("name", ["qlink", "trio", "mc1231a"])
def test_every_rule_has_words(name: str) -> None:
    """Every wrong frame of the vectors, and all its beginnings."""
    plan = plan_of(load(find(name)))
    for row in json.loads((VECTORS / f"{name}.json").read_text("utf-8"))["faults"]:
        request = bytes.fromhex(row["request"]) if "request" in row else None
        wire, message = bytes.fromhex(row["wire"]), plan.message(row["message"])
        way = None if message.direction == "message" or request else message.direction
        for end in range(1, len(wire) + 1):
            found, _ = explained(plan, wire[:end], way, request)
            assert all(finding(each, fault)[0] for each in found for fault in each.faults)
        assert any(each.kind for each in explained(plan, wire, way, request)[0]), row


def test_the_byte_that_should_have_been_inserted_is_marked(qlinkgen: Run) -> None:
    out = qlinkgen("explain", "qlink", "a5a5042103a5ff").out
    assert [row[1] for row in rows(out) if row[-1] == "wrong"] == ["ff"]
