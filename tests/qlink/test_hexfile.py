"""Intel HEX files for the master: reading, and errors found before anything is sent."""

from __future__ import annotations

import os
import re
import sys
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from qlinkgen.errors import ExtraMissing, HexFileError, QlinkgenError
from qlinkgen.protocols import hexfile
from qlinkgen.protocols.hex_image import HexImage, HexReader
from qlinkgen.protocols.hexfile import read_hex
from qlinkgen.protocols.qlink.loading import pieces

END = ":00000001FF"


def record(kind: int, offset: int, data: bytes = b"") -> str:
    body = bytes((len(data), *offset.to_bytes(2, "big"), kind)) + data
    return ":" + (body + bytes((-sum(body) & 0xFF,))).hex().upper()


DATA = record(0, 0x100, bytes(range(16)))


@pytest.fixture
def path(tmp_path: Path) -> Path:
    return tmp_path / "firmware.hex"


def put(path: Path, *lines: str, end: str = "\n") -> Path:
    path.write_bytes("".join(line + end for line in lines).encode("latin-1"))
    return path


def test_a_program_is_read(path: Path) -> None:
    lines = (record(4, 0, b"\x08\0"), DATA, record(0, 0x200, b"xyz"), record(5, 0, b"\x08\0\1\1"), END)
    image = read_hex(put(path, *lines))
    assert image == HexImage(
        "".join(line + "\r\n" for line in lines).encode(),
        ((0x8000100, bytes(range(16))), (0x8000200, b"xyz")),
        0x8000101,
    )
    assert (image.size, image.start, image.end) == (19, 0x8000100, 0x8000203)
    assert read_hex(str(path)) == image


@pytest.mark.parametrize("end", ["\n", "\r\n", "\r"])
def test_all_records_get_one_line_end(path: Path, end: str) -> None:
    put(path, DATA.lower(), "", "   ", END, end=end)
    path.write_bytes(path.read_bytes().removesuffix(end.encode()))
    text = f"{DATA.lower()}|{END}|"
    assert read_hex(path).text == text.replace("|", "\r\n").encode(), "the case of the digits stays"
    for wanted in hexfile.LINE_ENDS:
        assert read_hex(path, line_end=wanted).text == text.encode().replace(b"|", wanted)


@pytest.mark.parametrize("wrong", [b"", b"\n\n", b"\n\r", "\n"])
def test_a_line_end_is_one_of_three(path: Path, wrong: bytes) -> None:
    with pytest.raises(ValueError, match=r"line_end=.* must be one of") as caught:
        read_hex(put(path, DATA, END), line_end=wrong)
    assert not isinstance(caught.value, HexFileError)


def test_addresses_of_segments(path: Path) -> None:
    put(path, record(4, 0, b"\0\2"), record(0, 1, b"a"), record(2, 0, b"\x10\0"), record(0, 1, b"b"),
        record(3, 0, b"\x12\x34\x56\x78"), END)  # fmt: skip
    image = read_hex(path)
    assert (image.segments, image.entry) == (((0x10001, b"b"), (0x20001, b"a")), 0x12345678)


FAULTS = {
    "checksum": ([DATA, DATA[:-1] + "0", END], 2, "checksum 70, must be 77; make the file again"),
    "character": (
        [DATA[:11] + "G" + DATA[12:], END],
        1,
        "'G' in column 12; a record has hexadecimal digits only",
    ),
    "space inside": ([DATA[:5] + " " + DATA[5:], END], 1, "' ' in column 6; "),
    "space behind": ([DATA + " ", END], 1, "' ' in column 44; "),
    "colon": (["", DATA, DATA[1:], END], 3, "'100100000001'; a record begins with ':' in the first column"),
    "space before": ([" " + DATA, END], 1, "a record begins with ':'"),
    "odd": ([DATA[:-1], END], 1, "41 digits; a record has an even number of at least 10: was the line cut?"),
    "short": ([":000000", END], 1, "6 digits; a record has an even number"),
    "too few": ([DATA[:-2], END], 1, "count 10 requires 21 bytes, the record has 20; was the line cut?"),
    "too many": ([":0F" + DATA[3:], END], 1, "count 0F requires 20 bytes, the record has 21"),
    "type": ([record(6, 0, b"a"), END], 1, "type 06; Intel HEX has 00 to 05: is this another format?"),
    "overlap": (
        [DATA, "", record(0, 0x10F, b"a"), END],
        3,
        "overlapping data at 0x10f; each address occurs once",
    ),
    "no end": (
        [DATA, record(0, 0, b"a")],
        2,
        "no end record; a program ends in :00000001FF: was the file cut?",
    ),
    "behind": ([DATA, END, "", DATA], 4, "':10010000000' after the end record; nothing may follow it"),
    "behind, no record": ([DATA, END, "hello"], 3, "'hello' after the end record"),
    "two ends": ([DATA, END, END], 3, "':00000001FF' after the end record"),
    "end with data": (
        [DATA, record(1, 0, b"a")],
        2,
        "type 01 with 1 data bytes and address 0000; it has 0 and address 0000",
    ),
    "type 02 short": ([record(2, 0, b"a"), END], 1, "type 02 with 1 data bytes and address 0000; it has 2"),
    "type 04 long": ([record(4, 0, b"abc"), END], 1, "type 04 with 3 data bytes and address 0000; it has 2"),
    "type 03 short": ([record(3, 0, b"a"), END], 1, "type 03 with 1 data bytes and address 0000; it has 4"),
    "type 05 empty": ([record(5, 0), END], 1, "type 05 with 0 data bytes and address 0000; it has 4"),
    "two starts": ([record(5, 0, b"abcd")] * 2 + [DATA, END], 2, "a second start address; a program has one"),
    "wrap": ([record(0, 0xFFF8, bytes(9)), END], 1, "9 bytes at 0xfff8 exceed the end of their segment"),
    "wrap 02": (
        [record(2, 0, b"\x10\0"), record(0, 0xFFFF, b"ab"), END],
        2,
        "2 bytes at 0x1ffff exceed the end of their segment, where loaders differ; end the record there",
    ),
    "4 GiB": (
        [record(4, 0, b"\xff\xff"), record(0, 0xFFFF, b"ab"), END],
        2,
        "2 bytes at 0xffffffff exceed the end",
    ),
    "no ASCII": ([DATA, "\xe4", END], 2, "byte 0xE4; Intel HEX is ASCII text: is this a binary file?"),
    "empty": ([], 0, "empty; an Intel HEX file has at least an end record"),
    "blank": (["", "  "], 0, "empty; "),
    "no data": ([record(4, 0, b"\0\1"), END], 0, "no data record, so nothing to load"),
    "other format": (
        ["S1130000285F245F2212226A000424290008237C2A"],
        1,
        "'S1130000285F'; a record begins with ':'",
    ),
}


@pytest.mark.parametrize(("lines", "line", "text"), FAULTS.values(), ids=FAULTS)
def test_what_is_wrong_is_told_with_its_place(path: Path, lines: list[str], line: int, text: str) -> None:
    with pytest.raises(HexFileError) as caught:
        read_hex(put(path, *lines))
    fault = caught.value
    assert (fault.file, fault.line) == (str(path), line)
    assert str(fault).startswith(f"{path}:{line}: " if line else f"{path}: ")
    assert text in fault.message
    assert isinstance(fault, QlinkgenError)
    assert isinstance(fault, ValueError)


@pytest.mark.parametrize("end", ["\r\n", "\r"])
def test_lines_are_counted_as_an_editor_does(path: Path, end: str) -> None:
    with pytest.raises(HexFileError, match=re.escape("firmware.hex:4: checksum 00")):
        read_hex(put(path, DATA, "", "", ":00000001" + "00", end=end))


@pytest.mark.parametrize(
    "lines",
    [
        [record(0, 0xFFF0, bytes(16)), END],
        [record(2, 0, b"\x10\0"), record(0, 0xFFFF, b"a"), END],
        [record(4, 0, b"\0\0"), record(0, 0xFFFF, b"ab"), END],
        [record(4, 0, b"\xff\xff"), record(0, 0xFFFF, b"a"), END],
    ],
)
def test_data_may_reach_the_end_of_their_segment(path: Path, lines: list[str]) -> None:
    assert read_hex(put(path, *lines)).size in {16, 1, 2}


def test_what_is_no_file_is_told(tmp_path: Path) -> None:
    with pytest.raises(HexFileError, match="No such file or directory; pass a readable file"):
        read_hex(tmp_path / "missing.hex")
    with pytest.raises(HexFileError, match="not a file"):
        read_hex(tmp_path)
    os.mkfifo(tmp_path / "fifo")
    with pytest.raises(HexFileError, match="not a file"):
        read_hex(tmp_path / "fifo")


def test_another_file_is_not_read_to_its_end(path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    size = put(path, DATA, END).stat().st_size
    monkeypatch.setattr(hexfile, "MOST_TEXT", size)
    assert read_hex(path).size == 16
    monkeypatch.setattr(hexfile, "MOST_TEXT", size - 1)
    with pytest.raises(HexFileError, match=f"more than {size - 1} bytes; is this the Intel HEX file"):
        read_hex(path)


def test_without_the_package_the_extra_is_named(path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "intelhex", None)
    with pytest.raises(ExtraMissing, match=re.escape("pip install 'qlinkgen[load]'")) as caught:
        read_hex(put(path, DATA, END))
    assert isinstance(caught.value, QlinkgenError)
    assert isinstance(caught.value, ImportError)


@given(st.binary(max_size=200), st.integers(1, 25))
def test_pieces_are_the_text(text: bytes, size: int) -> None:
    cut = list(pieces(text, size))
    assert b"".join(cut) == text
    assert all(len(piece) == size for piece in cut[:-1])
    assert all(1 <= len(piece) <= size for piece in cut)


def test_a_piece_fills_a_request() -> None:
    assert [len(piece) for piece in pieces(bytes(60))] == [25, 25, 10]
    for wrong in (0, 26, 2.0):
        with pytest.raises(ValueError, match=f"size={wrong} must be an integer from 1 to 25"):
            pieces(b"", wrong)  # type: ignore[arg-type]


@given(
    st.dictionaries(st.integers(0, 0xFFFF_FFFF), st.integers(0, 255), min_size=1, max_size=30),
    st.booleans(),
)
def test_the_master_and_the_node_read_the_same(
    tmp_path_factory: pytest.TempPathFactory, memory: dict[int, int], below_1m: bool
) -> None:
    lines = []
    memory = {address % 0x10_0000 if below_1m else address: byte for address, byte in memory.items()}
    for address, byte in memory.items():
        if below_1m:
            lines.append(record(2, 0, (address >> 16 << 12).to_bytes(2, "big")))
        else:
            lines.append(record(4, 0, (address >> 16).to_bytes(2, "big")))
        lines.append(record(0, address & 0xFFFF, bytes((byte,))))
    image = read_hex(put(tmp_path_factory.getbasetemp() / "any.hex", *lines, END))
    assert image.memory() == memory
    reader = HexReader()
    reader.feed(image.text)
    assert reader.segments == image.segments


@given(
    st.lists(
        st.sampled_from([DATA, END, record(4, 0, b"\0\1"), record(0, 0xFFFF, b"ab"), "x", ":", ""]),
        max_size=6,
    )
)
def test_what_the_master_accepts_the_node_accepts(
    tmp_path_factory: pytest.TempPathFactory, lines: list[str]
) -> None:
    path = put(tmp_path_factory.getbasetemp() / "some.hex", *lines)
    try:
        image = read_hex(path)
    except HexFileError:
        return
    reader = HexReader()
    reader.feed(image.text)
    assert (reader.segments, reader.entry) == (image.segments, image.entry)


@given(st.binary(max_size=120))
def test_no_content_raises_anything_else(tmp_path_factory: pytest.TempPathFactory, content: bytes) -> None:
    path = tmp_path_factory.getbasetemp() / "noise.hex"
    path.write_bytes(content)
    with pytest.raises(HexFileError):
        read_hex(path)
