"""Reads and checks an Intel HEX file for the master, before anything is sent.

The package `intelhex` (extra `load`) checks the records: form, count, type, checksum, size of the special
records, overlapping data. This module also refuses these errors, which `intelhex` accepts:

* a missing end record, and text after it (where it stops reading);
* a program without data;
* data past the end of their 64 KiB segment, with type 02 or no address record in force: the format wraps them
  around, `intelhex` and some loaders do not; data beyond 4 GiB;
* other than text files: a folder, a device, a file of more than 16 MiB, characters outside ASCII.

The text is sent as in the file, record by record, in upper or lower case; blank lines are omitted, and every
record has the same line end, the last one too: by default CR LF, since the document does not specify it, and
a loader may wait for either.
"""

from __future__ import annotations

import os
from importlib import import_module
from io import StringIO
from pathlib import Path
from types import ModuleType
from typing import Protocol

from qlinkgen.errors import ExtraMissing, HexFileError
from qlinkgen.protocols.hex_image import SIZES, HexImage

__all__ = ["LINE_ENDS", "MOST_TEXT", "read_hex"]

#: Most bytes of text: some 6 MB of program, hours on the bus. A larger file is not a program.
MOST_TEXT = 16 * 1024 * 1024
LINE_ENDS = (b"\r\n", b"\n", b"\r")

_SEGMENT = 0x1_0000
_LINEAR = 0x1_0000_0000


def read_hex(path: str | os.PathLike[str], *, line_end: bytes = b"\r\n") -> HexImage:
    """Read and check an Intel HEX file.

    Args:
        path: the file.
        line_end: line end of every record on the wire: CR LF, LF or CR.

    Returns:
        The program; its `text` is what a node receives.

    Raises:
        HexFileError: the file is invalid; the message begins with file and line.
        ExtraMissing: the package `intelhex` is not installed.
        ValueError: `line_end` is not one of the three.
    """
    if line_end not in LINE_ENDS:
        raise ValueError(f"line_end={line_end!r} must be one of {', '.join(map(repr, LINE_ENDS))}")
    judge = _judge()
    name = os.fspath(path)
    lines = _lines(name, _content(name))
    program = _judged(judge, name, lines)
    _check_end(name, lines)
    _check_reach(name, lines)
    segments = tuple((a, program.tobinstr(start=a, size=b - a)) for a, b in program.segments())
    if not segments:
        raise HexFileError("no data record, so nothing to load; check how the file was made", file=name)
    text = b"".join(line.encode("ascii") + line_end for line in lines if line)
    return HexImage(text, segments, _entry(program.start_addr))


class _Program(Protocol):
    """Interface of the program of intelhex, which has no types."""

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
            raise HexFileError("not a file; pass the path of an Intel HEX file", file=name)
        with path.open("rb") as stream:
            content = stream.read(MOST_TEXT + 1)
    except OSError as fault:
        raise HexFileError(f"{fault.strerror or fault}; pass a readable file", file=name) from fault
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
    """Return a full error text: intelhex names the rule, this adds what was seen and the fix."""
    if type(fault) is judge.HexRecordError:
        return _no_record(line)
    if isinstance(fault, judge.AddressOverlapError):
        return f"overlapping data at {fault.address:#x}; each address occurs once: were two programs joined?"
    if isinstance(fault, judge.DuplicateStartAddressRecordError):
        return "a second start address; a program has one: were two programs joined?"
    record = bytes.fromhex(line[1:])
    if isinstance(fault, judge.RecordChecksumError):
        return f"checksum {record[-1]:02X}, must be {-sum(record[:-1]) & 0xFF:02X}; make the file again"
    if isinstance(fault, judge.RecordLengthError):
        wanted = record[0] + 5
        return (
            f"count {record[0]:02X} requires {wanted} bytes, the record has {len(record)}; was the line cut?"
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
    """Check that there is an end record, and nothing after it. Earlier records have been checked."""
    ended = False
    for number, line in enumerate(lines, start=1):
        if ended and line:
            text = f"{line[:12]!r} after the end record; nothing may follow it: were two files joined?"
            raise HexFileError(text, file=name, line=number)
        ended = ended or line[7:9] == "01"
    if not ended:
        text = "no end record; a program ends in :00000001FF: was the file cut?"
        raise HexFileError(text, file=name, line=len(lines))


def _check_reach(name: str, lines: list[str]) -> None:
    """Check for data past the end of their segment."""
    base, room = 0, _SEGMENT
    for number, line in enumerate(lines, start=1):
        record = bytes.fromhex(line[1:])
        kind = record[3] if record else None
        offset, data = int.from_bytes(record[1:3], "big"), record[4:-1]
        if kind == 0 and (offset + len(data) > room or base + offset + len(data) > _LINEAR):
            text = (
                f"{len(data)} bytes at {base + offset:#x} exceed the end of their segment, where loaders "
                "differ; end the record there and continue with an address record"
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
