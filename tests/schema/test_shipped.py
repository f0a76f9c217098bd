"""The shipped schemas agree with the facts about their protocols."""

from __future__ import annotations

import csv
import time
from fractions import Fraction
from pathlib import Path

import pytest

from qlinkgen.model.frame import DelimitedFrame, FrameKinds, MarkedFrame, PacketFrame
from qlinkgen.model.message import Message
from qlinkgen.model.protocol import Protocol
from qlinkgen.model.types import Array, Blob, Enum, Flags, Scalar
from qlinkgen.plan import plan_of
from qlinkgen.plan.ends import Hunt
from qlinkgen.schema import find, lint, load, loads, shipped

ROWS = list(csv.DictReader(Path(__file__).with_name("mc1231a.csv").read_text("utf-8").splitlines()))
#: Command: section, code, size of request, size of response (None: no response), addressing.
QLINK = {
    "node_setup": ("7.1", 0x01, (4, 4), (0, 0), "answered_broadcast"),
    "node_info": ("7.2", 0x02, (0, 0), (11, 11), "answered_broadcast"),
    "node_start": ("7.3", 0x03, (0, 0), None, "either"),
    "node_stop": ("7.4", 0x04, (0, 0), None, "either"),
    "node_sync": ("7.5", 0x05, (1, 1), None, "broadcast"),
    "node_program_load": ("7.6", 0x06, (1, 26), (1, 1), "node"),
    "node_reset": ("7.7", 0x07, (0, 0), (0, 0), "node"),
    "motor_response_poll": ("7.8", 0x15, (0, 0), (1, 26), "node"),
    "motor_request": ("7.9", 0x16, (1, 26), (0, 0), "node"),
    "motion": ("7.10", 0x20, (2, 26), (9, 9), "node"),
    "motor_position": ("7.11", 0x21, (0, 0), (4, 4), "node"),
    "clear_fifo": ("7.12", 0x22, (0, 0), (0, 0), "node"),
    "preset_motor_position": ("7.13", 0x23, (4, 4), (0, 0), "node"),
    "read": ("7.14", 0x81, (2, 2), (1, 26), "node"),
    "write": ("7.15", 0x82, (2, 26), (0, 0), "node"),
    "write_read": ("7.16", 0x83, (3, 3), (3, 3), "node"),
    "set_outputs": ("7.17", 0x84, (3, 3), (0, 0), "node"),
    "clear_outputs": ("7.18", 0x85, (3, 3), (0, 0), "node"),
    "loop_back": ("7.19", 0xA4, (2, 26), (2, 26), "node"),
}
#: Request fields and response fields, with their types.
QLINK_FIELDS = {
    "node_setup": "node_number:u8 t1_delay:u8 t2_delay:u8 position_type:position_type",
    "node_info": "| version_major:u8 version_minor:u8 product_id:u16 t1_delay:u8 t2_delay:u8"
    " position_type:position_type serial_number:u32",
    "node_sync": "counter:u8",
    "node_program_load": "counter:u8 program_data:bytes[0..25] | counter:u8",
    "motor_response_poll": "| last_completion:u8 motor_data:bytes[0..25]",
    "motor_request": "motor_data:bytes[1..26]",
    "motion": "counter:u8 outputs:u8 segments:u16[0..12]"
    " | counter:u8 inputs:u8 position:i32 motor_status:motor_status fifo_space:u8",
    "motor_position": "| position:i32",
    "preset_motor_position": "position:i32",
    "read": "size:u8 offset:u8 | data:bytes[1..26]",
    "write": "offset:u8 data:bytes[1..25]",
    "write_read": "outputs:u24 | inputs:u24",
    "set_outputs": "mask:u24",
    "clear_outputs": "mask:u24",
    "loop_back": "offset:u8 data:bytes[1..25] | offset:u8 data:bytes[1..25]",
}


@pytest.fixture(scope="module", params=shipped())
def protocol(request: pytest.FixtureRequest) -> Protocol:
    return load(find(request.param))


@pytest.fixture(scope="module")
def qlink() -> Protocol:
    return load(find("qlink"))


@pytest.fixture(scope="module")
def trio() -> Protocol:
    return load(find("trio"))


@pytest.fixture(scope="module")
def mc1231a() -> Protocol:
    return load(find("mc1231a"))


def scalar(message: Message | None, name: str) -> Scalar:
    assert message
    kind = next(field.type for field in message.fields if field.name == name)
    assert isinstance(kind, Scalar)
    return kind


def notation(message: Message | None) -> str:
    return " ".join(f"{field.name}:{_kind(field.type)}" for field in message.fields) if message else ""


def _kind(kind: object) -> str:
    if isinstance(kind, Blob | Array):
        base = "text" if isinstance(kind, Blob) and kind.text else "bytes"
        base = _kind(kind.item) if isinstance(kind, Array) else base
        return f"{base}[{kind.length.minimum}..{kind.length.maximum}]"
    assert isinstance(kind, Scalar)
    if isinstance(kind.meaning, Enum | Flags):
        return kind.meaning.name
    return f"{'i' if kind.signed else 'u'}{kind.bits}"


# All protocols


def test_only_warnings_of_unconfirmed_facts() -> None:
    for name in shipped():
        assert {fault.rule for fault in lint(find(name))} == {"unconfirmed"}, name


def test_everything_has_a_section_and_a_text(protocol: Protocol) -> None:
    assert protocol.bus.section
    assert not isinstance(protocol.frame, FrameKinds)
    assert protocol.frame.section
    named: tuple[Enum | Flags, ...] = (*protocol.enums, *protocol.flags)
    for each in named:
        assert each.section, each.name
        assert each.doc, each.name
    for message in protocol.messages:
        assert message.section, message.name
        assert message.doc, message.name
        for field in message.fields:
            assert field.doc, f"{message.name}.{field.name}"


def test_first_line_names_the_json_schema() -> None:
    for name in shipped():
        line = find(name).read_text("utf-8").splitlines()[0]
        assert line == "# yaml-language-server: $schema=../docs/schema/qlinkgen.schema.json"
        assert (find(name).parent / line.partition("=")[2]).resolve().is_file()


@pytest.mark.slow
@pytest.mark.parametrize("what", ["messages", "fields"])
def test_loading_is_linear(what: str) -> None:
    """A schema of 1,000 messages, or fields of one message, costs about ten times one of 100."""
    small, large = (_messages(count) if what == "messages" else _fields(count) for count in (100, 1000))
    seconds = []
    for text in (small, large):
        best = 1e9
        for _ in range(3):
            start = time.process_time()
            protocol, faults = loads(text, "big.yaml")
            best = min(best, time.process_time() - start)
            assert protocol, faults[:3]
        seconds.append(best)
    assert seconds[1] < 20 * seconds[0], seconds


def _fields(count: int) -> str:
    head = _messages(1).replace("size: 0..64", "size: 0..60000")
    return head + "    response:\n" + "".join(f"      f{n}: u8\n" for n in range(count))


def _messages(count: int) -> str:
    head = (
        "qlinkgen: 1\nprotocol: {name: big, revision: '1', source: made up}\n"
        "frame: {parts: {id: {role: message, type: u16}, data: {role: payload, size: 0..64}}}\n"
        "bus: {kind: host, response_within: 0 bytes}\ndefaults: {repeat: safe, response: {}}\ncommands:\n"
    )
    return head + "".join(
        f"  c{n}:\n    id: {n}\n    request: {{a: u8, b: {{type: u16, scale: 1/10}}, c: 'u16[4]'}}\n"
        for n in range(count)
    )


# Q.link


def test_qlink_commands(qlink: Protocol) -> None:
    found = {
        command.name: (
            command.section,
            command.id,
            (command.request.min_size, command.request.max_size),
            (command.response.min_size, command.response.max_size) if command.response else None,
            command.addressing,
        )
        for command in qlink.commands
    }
    assert found == QLINK
    assert list(found) == list(QLINK)


def test_qlink_fields(qlink: Protocol) -> None:
    found = {
        command.name: f"{notation(command.request)} | {notation(command.response)}".strip(" ").removesuffix(
            " |"
        )
        for command in qlink.commands
    }
    assert {name: text for name, text in found.items() if text != "|"} == QLINK_FIELDS


def test_qlink_frame(qlink: Protocol) -> None:
    frame = qlink.frame
    assert isinstance(frame, DelimitedFrame)
    assert [part.name for part in frame.parts] == ["preamble", "length", "command", "node", "data", "crc"]
    assert frame.preamble == b"\xa5\xa5"
    assert isinstance(plan_of(qlink).frame.receiver, Hunt)
    assert (frame.length_bias, frame.payload.min_size, frame.payload.max_size) == (4, 0, 26)
    crc = frame.parts[-1].checksum
    assert crc
    assert (crc.algorithm.name, crc.over) == ("crc-16/ibm-3740", ("length", "command", "node", "data"))
    assert [chunk.shift for chunk in crc.chunks] == [8, 0], "high byte first"
    assert not crc.confirmed
    assert frame.stuffing
    assert (frame.stuffing.after, frame.stuffing.insert) == (b"\xa5", 0)
    assert {part.name for part in frame.parts} - {*frame.coded} == {"preamble"}
    assert not frame.checked_after


def test_qlink_worst_wire_size(qlink: Protocol) -> None:
    # Length, command 0x20 and node 1..16 are never A5: 26 data and 2 CRC bytes can be stuffed.
    assert plan_of(qlink).message("motion").wire_size == 5 + 2 * 28


def test_qlink_bus(qlink: Protocol) -> None:
    bus = qlink.bus
    assert (bus.kind, bus.nodes, bus.broadcast) == ("master_slave", (1, 16), 0)
    assert (bus.baud, bus.bits_per_byte) == (115200, 10)
    for command in qlink.commands:
        slow = command.name == "node_program_load"
        within = (command.response_within.byte_times, command.response_within.seconds)
        expected = (Fraction(0), Fraction(1, 100)) if slow else (Fraction(3), Fraction(0))
        assert within == expected, command.name


def test_qlink_details(qlink: Protocol) -> None:
    setup = qlink.by_name["node_setup.request"]
    assert (scalar(setup, "node_number").minimum, scalar(setup, "node_number").maximum) == (1, 16)
    assert scalar(setup, "node_number").default == 1
    for name in ("t1_delay", "t2_delay"):
        delay = scalar(setup, name)
        assert delay.scaling
        assert (delay.scaling.scale, delay.unit, delay.default) == (Fraction(1, 10), "s", 10)
        assert (delay.physical(delay.minimum), delay.physical(delay.maximum)) == (0, 25.5)
    size = scalar(qlink.by_name["read.request"], "size")
    assert (size.minimum, size.maximum) == (1, 26)
    for name in ("write_read.request", "set_outputs.request", "clear_outputs.request", "write_read.response"):
        (field,) = qlink.by_name[name].fields
        assert scalar(qlink.by_name[name], field.name).byteorder == "little"
    (kinds,) = qlink.enums
    assert {member.name: member.value for member in kinds.members} == {
        "none": 0,
        "jvl_mactalk": 1,
        "metronix": 2,
    }
    (status,) = qlink.flags
    assert {member.name: member.value for member in status.members} == {"running": 0, "position_valid": 1}
    assert not status.reserved_zero


def test_qlink_repeats(qlink: Protocol) -> None:
    counters = {command.name: command.repeat.counter for command in qlink.commands if command.repeat.counter}
    assert counters == {"node_program_load": "counter", "motion": "counter"}
    assert qlink.by_name["node_program_load.request"].empty_is_default


# Trio


def test_trio(trio: Protocol) -> None:
    frame = trio.frame
    assert isinstance(frame, MarkedFrame)
    assert (frame.marker, frame.address_bits.shift, frame.address_bits.bits) == (0x80, 3, 4)
    assert (frame.id_bits.shift, frame.id_bits.bits, frame.end_id) == (0, 3, 0)
    assert frame.checksum
    assert (frame.checksum.algorithm.name, frame.checksum.mask) == ("crc-16/ibm-3740", 0x7F7F)
    assert [chunk.shift for chunk in frame.checksum.chunks] == [0, 8]
    assert (trio.bus.kind, trio.bus.nodes) == ("ring", (1, 15))
    assert {message.name: (message.id, message.checksum, message.min_size) for message in trio.messages} == {
        "character_transfer": (1, False, 1),
        "direct_variable_transfer": (2, True, 12),
        "keypad_offset": (3, False, 1),
        "keypad_mode": (4, False, 1),
    }


def test_trio_fields(trio: Protocol) -> None:
    number, value = trio.by_name["direct_variable_transfer"].fields
    assert isinstance(number.type, Scalar)
    assert [chunk.shift for chunk in number.type.chunks] == [0, 7], "least significant group first"
    assert isinstance(value.type, Scalar)
    shifts = [(chunk.shift, chunk.bits) for chunk in value.type.chunks]
    assert shifts[:5] == [(32, 7), (39, 7), (46, 7), (53, 7), (60, 4)], "integer part first, top bits zero"
    assert shifts[5:] == [(0, 7), (7, 7), (14, 7), (21, 7), (28, 4)]
    assert value.type.signed
    offset = scalar(trio.by_name["keypad_offset"], "offset")
    assert (offset.minimum, offset.maximum) == (1, 15)
    assert {member.name: member.value for member in trio.enums[0].members} == {"on_only": 0, "on_off": 127}


# MC1231A


def test_mc1231a_has_every_row_in_order(mc1231a: Protocol) -> None:
    assert len(ROWS) == 101
    assert [command.name for command in mc1231a.commands] == [row["name"] for row in ROWS]


@pytest.mark.parametrize("row", ROWS, ids=[row["name"] for row in ROWS])
def test_mc1231a_row(mc1231a: Protocol, row: dict[str, str]) -> None:
    command = next(command for command in mc1231a.commands if command.name == row["name"])
    assert command.response
    size = 2 * int(row["words"])
    written, read = (size if row["direction"] == way else 0 for way in ("write", "read"))
    assert command.id == int(row["code"], 16)
    assert (command.request.min_size, command.request.max_size) == (written, written)
    assert (command.response.min_size, command.response.max_size) == (read, read)
    assert command.confirmed == (row["confirmed"] == "yes")
    assert command.attributes["axis"] == row["axis"]
    assert command.attributes["double_buffered"] == {"yes": True, "no": False}.get(
        row["double_buffered"], "unknown"
    )
    for field in (*command.request.fields, *command.response.fields):
        assert isinstance(field.type, Scalar)
        assert field.type.byteorder == "big"
        assert field.type.signed == (row["signed"] == "yes")
        assert field.name in {"value", "status", "mask", "axes", "mode"}


def test_mc1231a_scales(mc1231a: Protocol) -> None:
    scaled = {
        command.name: field.type.scaling.scale.denominator.bit_length() - 1
        for command in mc1231a.commands
        for field in (*command.request.fields, *(command.response.fields if command.response else ()))
        if isinstance(field.type, Scalar) and field.type.scaling
    }
    fine = {"set_jerk": 32, "get_jerk": 32}
    names = [f"{way}_{what}" for way in ("set", "get") for what in ("vel", "acc", "max_acc", "ratio")]
    assert scaled == {**dict.fromkeys([*names, "get_trgt_vel"], 16), **fine}
    velocity = scalar(mc1231a.by_name["set_vel.request"], "value")
    assert velocity.scaling
    assert velocity.scaling.raw(Fraction("2.75")) == 180224


def test_mc1231a_frame(mc1231a: Protocol) -> None:
    frame = mc1231a.frame
    assert isinstance(frame, PacketFrame)
    assert frame.checksum
    assert (frame.checksum.algorithm.name, frame.word_size, frame.rejected) == ("sum16", 2, 0)
    status = next(flags for flags in mc1231a.flags if flags.name == "axis_status")
    assert [member.value for member in status.members] == list(range(12))
