"""Reads an Intel HEX file for the master, and finds what is wrong with it before a byte is sent.

The judge of the records is the package `intelhex` (extra `load`): form, count, type, checksum, size of the
special records, data given twice. What it accepts in silence, and this module refuses:

* a missing end record, and text behind it (it stops reading there);
* a program without data;
* data that run over the end of their 64 KiB segment, where type 02 or no address record is in force: the
  format wraps them around, `intelhex` and some loaders go on above; data beyond the 4 GiB of all addresses;
* what is no file of text: a folder, a device, a file of more than 16 MiB, characters outside ASCII.

The text is sent as it stands in the file, record by record, upper or lower case; blank lines are left out,
and every record gets the same line end, the last one too. That is CR LF unless asked otherwise: the document
says nothing, and a loader that waits for either of the two sees it.
"""

from __future__ import annotations

import os
from collections.abc import Iterator
from importlib import import_module
from io import StringIO
from pathlib import Path
from types import ModuleType
from typing import Protocol

from qlinkgen.errors import ExtraMissing, HexFileError
from qlinkgen.protocols.qlink.arguments import whole
from qlinkgen.protocols.qlink.facts import PIECE
from qlinkgen.protocols.qlink.hex_image import SIZES, HexImage

__all__ = ["LINE_ENDS", "MOST_TEXT", "PIECE", "pieces", "read_hex"]

#: Most bytes of text: some 6 MB of program, hours on the bus. More than that is another file.
MOST_TEXT = 16 * 1024 * 1024
LINE_ENDS = (b"\r\n", b"\n", b"\r")

_SEGMENT = 0x1_0000
_LINEAR = 0x1_0000_0000


def read_hex(path: str | os.PathLike[str], *, line_end: bytes = b"\r\n") -> HexImage:
    """Read and check an Intel HEX file.

    Args:
        path: the file.
        line_end: what ends every record on the wire: CR LF, LF or CR.

    Returns:
        The program; its `text` is what a node_program_load sends.

    Raises:
        HexFileError: the file cannot be sent; the text begins with file and line.
        ExtraMissing: the package that checks it is not installed.
        ValueError: `line_end` is none of the three.
    """
    if line_end not in LINE_ENDS:
        raise ValueError(f"line_end={line_end!r}: give one of {', '.join(map(repr, LINE_ENDS))}")
    judge = _judge()
    name = os.fspath(path)
    lines = _lines(name, _content(name))
    program = _judged(judge, name, lines)
    _check_end(name, lines)
    _check_reach(name, lines)
    segments = tuple((a, program.tobinstr(start=a, size=b - a)) for a, b in program.segments())
    if not segments:
        raise HexFileError(
            "no data record; there is nothing to load: look at how the file was made", file=name
        )
    text = b"".join(line.encode("ascii") + line_end for line in lines if line)
    return HexImage(text, segments, _entry(program.start_addr))


def pieces(text: bytes, size: int = PIECE) -> Iterator[bytes]:
    """Cut a text into the program data of its requests, all of the same size but the last.

    Args:
        text: what `HexImage.text` holds.
        size: bytes of each, 1..25.

    Raises:
        ValueError: `size` is out of range.
    """
    whole("size", size, 1, PIECE)
    return (text[at : at + size] for at in range(0, len(text), size))


class _Program(Protocol):
    """What intelhex, which has no types, makes of a file."""

    start_addr: dict[str, int] | None

    def segments(self) -> list[tuple[int, int]]: ...

    def tobinstr(self, *, start: int, size: int) -> bytes: ...


def _judge() -> ModuleType:
    try:
        return import_module("intelhex")
    except ImportError:
        raise ExtraMissing(
            "checking an Intel HEX file needs the package intelhex: pip install 'qlinkgen[load]'"
        ) from None


def _content(name: str) -> bytes:
    path = Path(name)
    try:
        if path.exists() and not path.is_file():
            raise HexFileError("this is no file; give the path of an Intel HEX file", file=name)
        with path.open("rb") as stream:
            content = stream.read(MOST_TEXT + 1)
    except OSError as fault:
        raise HexFileError(f"{fault.strerror or fault}; give a file that can be read", file=name) from fault
    if len(content) > MOST_TEXT:
        raise HexFileError(f"more than {MOST_TEXT} bytes; is this the Intel HEX file?", file=name)
    return content


def _lines(name: str, content: bytes) -> list[str]:
    """Return all lines, the blank ones empty."""
    lines: list[str] = []
    for number, line in enumerate(content.splitlines(), start=1):
        if not line.isascii():
            seen = next(byte for byte in line if byte > 0x7F)
            raise HexFileError(
                f"byte 0x{seen:02X}; Intel HEX is ASCII text: is this a binary file?", file=name, line=number
            )
        lines.append(line.decode("ascii") if line.strip() else "")
    if not any(lines):
        raise HexFileError("empty; an Intel HEX file has at least an end record :00000001FF", file=name)
    return lines


def _judged(judge: ModuleType, name: str, lines: list[str]) -> _Program:
    try:
        program: _Program = judge.IntelHex(StringIO("\n".join(lines)))
    except judge.HexReaderError as fault:
        number = fault.line
        raise HexFileError(_complaint(judge, fault, lines[number - 1]), file=name, line=number) from fault
    return program


def _complaint(judge: ModuleType, fault: Exception, line: str) -> str:
    """Say in full what the judge found: it names the rule, this adds what was seen and what to do."""
    if type(fault) is judge.HexRecordError:
        return _no_record(line)
    if isinstance(fault, judge.AddressOverlapError):
        return f"data for {fault.address:#x} again; each address is given once: were two programs joined?"
    if isinstance(fault, judge.DuplicateStartAddressRecordError):
        return "a second start address; a program has one: were two programs joined?"
    record = bytes.fromhex(line[1:])
    if isinstance(fault, judge.RecordChecksumError):
        return f"checksum {record[-1]:02X}, must be {-sum(record[:-1]) & 0xFF:02X}; make the file again"
    if isinstance(fault, judge.RecordLengthError):
        wanted = record[0] + 5
        return (
            f"count {record[0]:02X} asks for {wanted} bytes, the record has {len(record)}; was the line cut?"
        )
    kind, address = record[3], line[3:7]
    if kind not in SIZES:
        return f"type {kind:02X}; Intel HEX has 00 to 05: is this another format?"
    return (
        f"type {kind:02X} with {record[0]} data bytes and address {address}; it has {SIZES[kind]} and "
        "address 0000: make the file again"
    )


def _no_record(line: str) -> str:
    if not line.startswith(":"):
        return f"{line[:12]!r}; a record begins with ':' in the first column: is this an Intel HEX file?"
    for column, char in enumerate(line[1:], start=2):
        if char not in "0123456789abcdefABCDEF":
            return f"{char!r} in column {column}; a record has hexadecimal digits only: make the file again"
    return f"{len(line) - 1} digits; a record has an even number of at least 10: was the line cut?"


def _check_end(name: str, lines: list[str]) -> None:
    """Find the end record, and that nothing follows it. What is in front of it has been judged."""
    ended = False
    for number, line in enumerate(lines, start=1):
        if ended and line:
            text = f"{line[:12]!r} behind the end record; nothing may follow it: were two files joined?"
            raise HexFileError(text, file=name, line=number)
        ended = ended or line[7:9] == "01"
    if not ended:
        text = "no end record; a program ends in :00000001FF: was the file cut?"
        raise HexFileError(text, file=name, line=len(lines))


def _check_reach(name: str, lines: list[str]) -> None:
    """Find data that run over the end of their segment."""
    base, room = 0, _SEGMENT
    for number, line in enumerate(lines, start=1):
        record = bytes.fromhex(line[1:])
        kind = record[3] if record else None
        offset, data = int.from_bytes(record[1:3], "big"), record[4:-1]
        if kind == 0 and (offset + len(data) > room or base + offset + len(data) > _LINEAR):
            text = (
                f"{len(data)} bytes at {base + offset:#x} run over the end of their segment, where loaders "
                "differ; end the record there and go on with an address record"
            )
            raise HexFileError(text, file=name, line=number)
        if kind == 2:
            base, room = int.from_bytes(data, "big") << 4, _SEGMENT
        elif kind == 4:
            base, room = int.from_bytes(data, "big") << 16, _LINEAR


def _entry(start: dict[str, int] | None) -> int | None:
    if start is None:
        return None
    return start["EIP"] if "EIP" in start else start["CS"] << 16 | start["IP"]
