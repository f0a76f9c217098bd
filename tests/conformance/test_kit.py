"""Contents and style of a kit."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Literal

import pytest

from qlinkgen.backends.base import Options
from qlinkgen.cli import kits as cli_kits
from qlinkgen.cli.targets import TARGETS
from qlinkgen.model.protocol import Protocol
from qlinkgen.schema import find, load
from tests.conformance import kits
from tests.conformance.conftest import Write
from tests.proof import cases

WIDTH = 120
ROLES: tuple[Literal["both", "master", "slave"], ...] = ("both", "slave", "master")


def text_of(protocol: Protocol, options: Options | None = None) -> str:
    generate = TARGETS["conformance"].load()
    (text,) = generate(protocol, options or Options()).values()
    return text


@pytest.mark.parametrize("name", [name for name in cases.PROTOCOLS if name != "mc1231a"])
def test_it_reads_like_the_header(name: str) -> None:
    for role in ROLES:
        text = text_of(cases.protocol(name), Options(role=role))
        assert not [
            line
            for line in text.splitlines()
            if len(line) > WIDTH or line != line.rstrip() or "\t" in line or not line.isascii()
        ]
        assert "\n\n\n" not in text
        assert text.startswith("/*\n * ")
        assert cases.protocol(name).schema_hash in text.splitlines()[2]


def test_values_out_of_range_are_not_to_be_sent(kit: Write) -> None:
    """One step past each bound that the C type can hold; none for a constant, a bool or a full range."""
    text = kit("qlink").read_text()
    start = text.index("node_setup_request_unsent[] IN_FLASH = {\n")
    assert text[start : text.index("};", start)].splitlines()[1:] == [
        "    /* node_number is 0 */",
        "    0x01, 4, 0x00, 0x0A, 0x0A, 0x00,",
        "    /* node_number is 17 */",
        "    0x01, 4, 0x11, 0x0A, 0x0A, 0x00,",
        "    /* sent to 17 */",
        "    0x11, 4, 0x01, 0x0A, 0x0A, 0x00,",
    ]
    parts = kit("kitchen_sink").read_text().split("_unsent[] IN_FLASH = {")[1:]
    sink = "".join(part[: part.index("};")] for part in parts)
    for each in (
        "around_zero is -6",
        "a_i24 is 8388608",
        "gear is 8",
        "level is 61",
        "low is 0",
        "sent to 32",
    ):
        assert f"/* {each} */" in sink
    assert "/* yes is" not in sink
    assert "/* a_u64 is" not in sink


def test_vectors_by_hand_have_their_source(kit: Write) -> None:
    text = " ".join(kit("qlink").read_text().replace("\n     * ", " ").split())
    for row in [*cases.by_hand("qlink")["vectors"], *cases.by_hand("qlink")["faults"]]:
        assert f"by hand, {row['source']}" in text
    assert "1.0 s = 10 steps of 0.1 s = 0A; 2.5 s = 25 = 19; metronix = 2" in text


def test_vectors_by_hand_are_those_of_the_shipped_schema_alone(tmp_path: Path) -> None:
    """With another checksum, or after a change of the schema, their bytes are wrong."""
    shipped = cases.protocol("trio")
    assert cli_kits.by_hand(shipped) == cases.by_hand("trio")
    assert cli_kits.by_hand(load(find("trio"), crc="crc-16/xmodem")) == {}
    changed = tmp_path / "trio.yaml"
    changed.write_text(find("trio").read_text().replace("keypad", "keyboard"))
    assert cli_kits.by_hand(load(changed)) == {}
    assert cli_kits.by_hand(cases.protocol("modbus_rtu")) == {}


def run(protocol: Protocol, folder: Path, *compiler: str, options: Options | None = None) -> kits.Report:
    for target in ("c", "conformance"):
        generate = TARGETS[target].load()
        for path, text in generate(protocol, options or Options()).items():
            (folder / Path(path).name).write_text(text)
    file = folder / f"{protocol.name}_conformance.c"
    return kits.ran(kits.compiled(folder / "kit", *compiler, "-std=c99", kits.STDIO, file))


def test_another_checksum_has_vectors_of_its_own(tmp_path: Path, require_tool: Callable[..., str]) -> None:
    compiler = require_tool("clang", package="clang")
    report = run(load(find("trio"), crc="crc-16/modbus"), tmp_path, compiler)
    report.check()
    assert report.names[0] == "check value crc-16/modbus"
    assert not [each for each in report.names if "by-hand" in each]


BARE = """
qlinkgen: 1
protocol: {name: bare, title: Bare, revision: "1", source: this test, doc: No preamble and no checksum.}
byteorder: big
frame:
  parts:
    id: {role: message, type: u8}
    station: {role: address, type: u16}
    size: {role: length, type: u8, counts: [data]}
    data: {role: payload, size: 0..8}
bus: {kind: master_slave, nodes: 1..2000, broadcast: 0, baud: 9600, response_within: 20 bytes}
defaults: {addressing: node, repeat: safe}
commands:
  set:
    id: 0x01
    doc: Set a level.
    request: {level: {type: u16, range: 0..1000}}
    response: {done: bool}
  noisy:
    id: 0xFF
    doc: What it begins with is noise to others.
    request: {text: "bytes[3]"}
    response: {}
"""


ENDED = """
qlinkgen: 1
protocol: {name: ended, title: Ended, revision: "1", source: this test, doc: A constant after the checksum.}
byteorder: big
frame:
  parts:
    start: {role: constant, value: 0x02}
    node: {role: address, type: u8}
    id: {role: message, type: u8}
    size: {role: length, type: u8, counts: [data]}
    data: {role: payload, size: 0..8}
    check: {role: checksum, type: u16, algorithm: crc-16/modbus, over: [node, id, size, data]}
    end: {role: constant, value: 0D 0A}
bus: {kind: master_slave, nodes: 1..31, broadcast: 0, baud: 9600, response_within: 20 bytes}
defaults: {addressing: node, repeat: safe}
commands:
  set: {id: 1, doc: Set a level., request: {level: {type: u16, range: 0..1000}}, response: {done: bool}}
  get: {id: 2, doc: Get levels., request: {}, response: {levels: "u8[0..4]"}}
"""


def test_a_constant_after_the_checksum(tmp_path: Path, require_tool: Callable[..., str]) -> None:
    """First the check value is wrong, then the constant, and each fault has its kind."""
    (tmp_path / "ended.yaml").write_text(ENDED)
    report = run(load(tmp_path / "ended.yaml"), tmp_path, require_tool("gcc", package="gcc"))
    assert len(report.names) == report.planned
    assert not report.failed, report.diagnoses[:3]
    tested = {each.split(" ", 1)[1] for each in report.names}
    assert {"wrong-crc decode", "wrong-frame decode"} <= tested


def test_where_noise_looks_like_a_frame_there_is_less_of_it(
    tmp_path: Path, require_tool: Callable[..., str]
) -> None:
    """A frame that is cut short is completed by the following bytes."""
    (tmp_path / "bare.yaml").write_text(BARE)
    protocol = load(tmp_path / "bare.yaml")
    report = run(protocol, tmp_path, require_tool("gcc", package="gcc"))
    assert len(report.names) == report.planned
    assert not report.failed, report.diagnoses[:3]
    text = (tmp_path / "bare_conformance.c").read_text()
    assert set(report.by_verb) == {"encode", "decode", "refuse", "receive", "ask", "tell"}
    assert "\n    REFUSED(E_TRUNCATED), 5, 0x01, 0x00, 0x01, 0x02, 0x00, NOT_FED,\n" in text


SILENT = """
qlinkgen: 1
protocol: {name: silent, title: Silent, revision: "1", source: this test, doc: Every value can be sent.}
byteorder: big
frame:
  parts:
    node: {role: address, type: u8}
    id: {role: message, type: u8}
    data: {role: payload, size: 1}
bus: {kind: master_slave, nodes: 0..255}
messages:
  set: {id: 1, direction: request, fields: {level: u8}}
  get: {id: 1, direction: response, fields: {level: u8}}
"""


@pytest.mark.parametrize(("role", "only"), [("slave", "get"), ("master", "set")])
def test_a_role_that_hears_nothing_has_no_unused_functions(
    role: Literal["master", "slave"], only: str, tmp_path: Path, require_tool: Callable[..., str]
) -> None:
    (tmp_path / "silent.yaml").write_text(SILENT)
    options = Options(role=role, only=(only,))
    report = run(
        load(tmp_path / "silent.yaml"), tmp_path, require_tool("gcc", package="gcc"), options=options
    )
    report.check()
    assert set(report.by_verb) == {"encode"}
