"""Recordings read back; cut files, hostile blocks, both byte orders."""

from __future__ import annotations

import io
import random
import struct
from pathlib import Path
from typing import Literal

import pytest

from qlinkgen.captures import Interface, Packet, Reader, Writer, read_pcapng
from qlinkgen.errors import CaptureError

AT = 1_700_000_000_123_456_789
PORT = Interface("/dev/ttyUSB0", 147, ("schema qlink.yaml 00cf6bc2f861",), 115200)
OTHER = Interface("COM3", 147)
PACKETS = [
    Packet(AT, bytes.fromhex("a5a504"), PORT, "sent"),
    Packet(AT + 1, b"", PORT, "received", ("crc: é", "")),
    Packet(0, bytes(range(256)), OTHER, None, ("x" * 9,)),
    Packet((1 << 64) - 1, b"\0", OTHER, "sent"),
]


@pytest.fixture
def recorded(tmp_path: Path) -> Path:
    path = tmp_path / "line.pcapng"
    with Writer(path, "a test") as writer:
        ports = {each: writer.add_interface(each.name, each.comments, each.speed) for each in (PORT, OTHER)}
        for packet in PACKETS:
            writer.write(ports[packet.interface], packet.at, packet.data, packet.direction, packet.comments)
    return path


def test_read_back(recorded: Path) -> None:
    assert list(read_pcapng(recorded)) == PACKETS


def test_a_program_that_does_not_close(tmp_path: Path) -> None:
    writer = Writer(tmp_path / "line.pcapng", "a test")
    writer.add_interface("port")
    writer.write(0, AT, b"frame")
    assert [each.data for each in read_pcapng(tmp_path / "line.pcapng")] == [b"frame"]
    writer.close()


def test_texts_that_are_too_long_or_not_unicode(tmp_path: Path) -> None:
    with Writer(tmp_path / "line.pcapng", "a test") as writer:
        writer.add_interface("a\udc80", ["é" * 40_000])
        writer.write(0, AT, b"frame")
    (packet,) = read_pcapng(tmp_path / "line.pcapng")
    assert packet.interface == Interface("a\\udc80", 147, ("é" * 32767,))


def test_arguments(tmp_path: Path) -> None:
    with Writer(tmp_path / "line.pcapng", "a test") as writer:
        with pytest.raises(ValueError, match="no interface 0; add_interface"):
            writer.write(0, AT, b"")
        writer.add_interface("port")
        for at in (-1, 1 << 64):
            with pytest.raises(ValueError, match="nanoseconds since 1970"):
                writer.write(0, at, b"")


def test_cut_at_each_byte(recorded: Path) -> None:
    whole = recorded.read_bytes()
    ends = [0]
    while ends[-1] < len(whole):
        ends.append(ends[-1] + int.from_bytes(whole[ends[-1] + 4 :][:4], "little"))
    first = len(ends) - len(PACKETS)  # blocks before the end of the first packet
    for size in range(len(whole) + 1):
        reader = Reader(io.BytesIO(whole[:size]))
        complete = sum(end <= size for end in ends[first:])
        assert list(reader) == PACKETS[:complete]
        assert reader.whole == (size in ends[1:])


Order = Literal["<", ">"]


def block(
    order: Order, kind: int, body: bytes, *, length: int | None = None, again: int | None = None
) -> bytes:
    size = len(body) + 12 if length is None else length
    tail = size if again is None else again
    return struct.pack(f"{order}II", kind, size) + body + struct.pack(f"{order}I", tail)


def section(order: Order, magic: int = 0x1A2B3C4D, major: int = 1) -> bytes:
    return block(order, 0x0A0D0D0A, struct.pack(f"{order}IHHq", magic, major, 0, -1))


def magic(order: Order) -> bytes:
    return struct.pack(f"{order}I", 0x1A2B3C4D)


def port(order: Order, *options: tuple[int, bytes]) -> bytes:
    return block(order, 1, struct.pack(f"{order}HHI", 147, 0, 0) + in_body(order, *options))


def in_body(order: Order, *options: tuple[int, bytes]) -> bytes:
    return b"".join(
        struct.pack(f"{order}HH", code, len(value)) + value + bytes(-len(value) % 4)
        for code, value in options
    )


def packet(
    order: Order, data: bytes, *options: tuple[int, bytes], number: int = 0, size: int | None = None
) -> bytes:
    size = len(data) if size is None else size
    head = struct.pack(f"{order}IIIII", number, 0, 7, size, size)
    return block(order, 6, head + data + bytes(-len(data) % 4) + in_body(order, *options))


def read(*blocks: bytes) -> list[Packet]:
    return list(Reader(io.BytesIO(b"".join(blocks))))


@pytest.mark.parametrize("order", ["<", ">"])
def test_both_byte_orders(order: Order) -> None:
    flags = struct.pack(f"{order}I", 0x0000_0101)  # and a kind of reception
    (one,) = read(section(order), port(order), packet(order, b"abc", (2, flags), (1, b"fine"), (0, b"")))
    assert one == Packet(7000, b"abc", Interface("", 147), "received", ("fine",))


@pytest.mark.parametrize(
    ("options", "expected"),
    [
        ((), 7000),
        (((9, b"\x09"),), 7),
        (((9, b"\x81"),), 3_500_000_000),
        (((9, b"\x00"), (14, struct.pack("<q", -2))), 5_000_000_000),
        (((9, b"\x7f"),), 0),
        (((9, b"\xff"),), 0),
    ],
)
def test_resolutions_of_time(options: tuple[tuple[int, bytes], ...], expected: int) -> None:
    (one,) = read(section("<"), port("<", *options), packet("<", b""))
    assert one.at == expected


def test_sections_of_other_orders_and_blocks_of_other_kinds() -> None:
    statistics = block("<", 5, bytes(12))
    data = [
        section("<"),
        port("<"),
        statistics,
        packet("<", b"a"),
        section(">"),
        port(">"),
        packet(">", b"b"),
    ]
    reader = Reader(io.BytesIO(b"".join(data)))
    assert [each.data for each in reader] == [b"a", b"b"]
    assert (reader.skipped, reader.whole, len(reader.interfaces)) == (1, True, 1)


@pytest.mark.parametrize("order", ["<", ">"])
@pytest.mark.parametrize(
    ("wrong", "message"),
    [
        (lambda order: block(order, 6, b"", length=0), "has length 0; it is a multiple of 4 from 12 to 1677"),
        (lambda order: block(order, 6, b"", length=8), "has length 8"),
        (lambda order: block(order, 6, bytes(20), length=33), "has length 33"),
        (lambda order: block(order, 6, b"", length=0xFFFF_FFFC), "has length 4294967292"),
        (lambda order: block(order, 0x0A0D0D0A, magic(order), length=12), "has length 12"),
        (lambda order: block(order, 6, bytes(20), again=36), "begins with length 32 and ends with 36"),
        (lambda order: block(order, 6, bytes(16)), "has 16 bytes, less than its kind needs"),
        (lambda order: block(order, 1, bytes(4)), "has 4 bytes, less"),
        (lambda order: block(order, 0x0A0D0D0A, magic(order)), "has 4 bytes, less"),
        (lambda order: section(order, magic=0x1A2B3C4E), "has byte order mark "),
        (lambda order: section(order, major=2), "has version 2; only version 1 is known"),
        (lambda order: packet(order, b"", number=1), "names interface 1 of 1, counted from 0"),
        (lambda order: packet(order, b"abcd", size=5), "states 5 bytes of data and has 4"),
        (lambda order: packet(order, b"", size=0xFFFF_FFFF), "states 4294967295 bytes"),
        (lambda order: packet(order, b"", (2, b"")), "has an option of 0 bytes; this one has 4"),
        (lambda order: port(order, (9, b"12")), "has an option of 2 bytes; this one has 1"),
        (
            lambda order: block(order, 6, bytes(20) + struct.pack(f"{order}HH", 1, 65535)),
            "has an option of 65535 bytes, and 0 are left",
        ),
    ],
)  # fmt: skip
def test_hostile_blocks(order: Order, wrong: object, message: str) -> None:
    assert callable(wrong)
    before = b"".join([section(order), port(order), packet(order, b"good")])
    packets = iter(Reader(io.BytesIO(before + wrong(order))))
    assert next(packets).data == b"good"
    with pytest.raises(CaptureError) as caught:
        next(packets)
    assert str(caught.value).startswith(f"the block at offset {len(before)} {message}")


def test_other_files() -> None:
    for data in (b"\xd4\xc3\xb2\xa1", b"{}", b"\0", b"\x0a\x0d\x0d\x0b" + bytes(100)):
        with pytest.raises(CaptureError, match="not a pcapng file"):
            read(data)


def test_damaged_files(recorded: Path) -> None:
    whole, chance = recorded.read_bytes(), random.Random(1)
    faults = 0
    for _ in range(2000):
        data = bytearray(whole)
        for _ in range(chance.randint(1, 4)):
            data[chance.randrange(len(data))] = chance.choice((0, 1, 0x7F, 0x80, 0xFF, chance.randrange(256)))
        try:
            read(bytes(data))
        except CaptureError:
            faults += 1
    assert 500 < faults < 1900
