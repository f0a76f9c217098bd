"""Captures of the same traffic, written as programs write them."""

from __future__ import annotations

import io
import struct
from collections.abc import Callable, Sequence
from datetime import UTC, datetime
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import NamedTuple

from qlinkgen.captures import Writer
from qlinkgen.captures.pcapng import Direction
from qlinkgen.captures.records import Format

NANO = 10**9
#: 2026-03-01 12:00 UTC.
START = 1_772_366_400 * NANO


class Burst(NamedTuple):
    """Bytes that were seen together."""

    data: bytes
    #: Nanoseconds since 1970.
    at: int
    way: Direction


Write = Callable[[Sequence[Burst]], bytes]


def _lines(line: Callable[[Burst], str], head: str = "") -> Write:
    return lambda bursts: (head + "".join(f"{line(each)}\n" for each in bursts)).encode()


def _clock(burst: Burst, digits: int = 6) -> str:
    moment = datetime.fromtimestamp(burst.at // NANO, UTC)
    return f"{moment:%H:%M:%S}.{burst.at % NANO:09d}"[: 9 + digits]


def _date(burst: Burst) -> str:
    return f"{datetime.fromtimestamp(burst.at // NANO, UTC):%Y-%m-%d} {_clock(burst)}"


def _seconds(burst: Burst) -> str:
    return f"{(burst.at - START) // NANO}.{(burst.at - START) % NANO:09d}"


def _mark(burst: Burst, sent: str, received: str) -> str:
    return sent if burst.way == "sent" else received


def _python(burst: Burst) -> str:
    return f"{_clock(burst)} {_mark(burst, '>>>', '<<<')} {burst.data!r}"


#: Logs: times and directions.
LOGS: dict[str, Write] = {
    "words": _lines(lambda each: f"{_clock(each)} {_mark(each, 'TX', 'RX')}: {each.data.hex(' ').upper()}"),
    "brackets": _lines(lambda each: f"[{_date(each)}] [{_mark(each, 'SEND', 'RECV')}] {each.data.hex(' ')}"),
    "counted": _lines(
        lambda each: f"{_date(each)} {_mark(each, '->', '<-')} ({len(each.data)} bytes) {each.data.hex(':')}"
    ),
    "zone": _lines(
        lambda each: f"{_date(each).replace(' ', 'T')}+00:00 {_mark(each, 'W:', 'R:')} {each.data.hex()}"
    ),
    "seconds": _lines(
        lambda each: f"{_seconds(each)} {_mark(each, 'sent', 'received')} 0x{each.data.hex(' ')}"
    ),
    "python": _lines(_python),
    "shown": _lines(
        lambda each: (
            f"{_clock(each)} {_mark(each, 'Tx', 'Rx')} {each.data.hex(' ')}   "
            + "".join(chr(byte) if 32 <= byte < 127 else "." for byte in each.data)
        )
    ),
}

#: Hex text, without either.
HEXES: dict[str, Write] = {
    "pairs": _lines(lambda each: each.data.hex(" ")),
    "plain": _lines(lambda each: each.data.hex().upper()),
    "colons": _lines(lambda each: each.data.hex(":").upper()),
    "prefixed": _lines(lambda each: ", ".join(f"0x{byte:02X}" for byte in each.data)),
    "escaped": _lines(lambda each: '"' + "".join(f"\\x{byte:02x}" for byte in each.data) + '"'),
    "c": _lines(lambda each: "{ " + ", ".join(f"0x{byte:02x}u" for byte in each.data) + " },"),
    "array": _lines(
        lambda each: f"const uint8_t frame[{len(each.data)}] = {{" + each.data.hex(",").upper() + "};"
    ),
    "intel": _lines(lambda each: " ".join(f"{byte:02X}h" for byte in each.data)),
    "remarks": _lines(lambda each: f"{each.data.hex(' ')}  # {each.way}", "# a capture\n\n"),
}


def _by_byte(bursts: Sequence[Burst]) -> list[tuple[int, int, Direction]]:
    """Return time, byte and direction of each byte, at 100 us each."""
    return [
        (each.at + 100_000 * index, byte, each.way) for each in bursts for index, byte in enumerate(each.data)
    ]


def saleae_1(bursts: Sequence[Burst]) -> bytes:
    """Return the export of an analyser by Logic 1."""
    rows = ["Time [s],Analyzer Name,Value,Parity Error,Framing Error"]
    for at, byte, way in _by_byte(bursts):
        name = "Async Serial TX" if way == "sent" else "Async Serial RX"
        rows.append(f"{(at - START) / NANO:.9f},{name},0x{byte:02X},,")
    return "\r\n".join([*rows, ""]).encode()


def saleae_2(bursts: Sequence[Burst]) -> bytes:
    """Return the export of a table by Logic 2, of two analysers."""
    rows = ["name,type,start_time,duration,data,error"]
    for at, byte, way in _by_byte(bursts):
        name = "Async Serial" if way == "sent" else "Async Serial [1]"
        rows.append(f'"{name}","data",{(at - START) / NANO:.9f},8.6e-05,0x{byte:02X},')
    return "\n".join([*rows, ""]).encode()


def sigrok(bursts: Sequence[Burst]) -> bytes:
    """Return the annotations of `sigrok-cli -P uart`."""
    rows = [
        f"uart-1: {'TX data' if way == 'sent' else 'RX data'}: {byte:02X}"
        for _, byte, way in _by_byte(bursts)
    ]
    return "\n".join([*rows, ""]).encode()


def _levels(bursts: Sequence[Burst], bit: int) -> list[tuple[int, int, int]]:
    """Return time and levels of two channels, TX and RX, at each change; `bit` is in nanoseconds."""
    changes = {0: [1, 1]}
    for each in bursts:
        channel = 0 if each.way == "sent" else 1
        at = each.at - START + NANO // 1000
        for byte in each.data:
            for level in (0, *(byte >> index & 1 for index in range(8)), 1):
                changes.setdefault(at, [-1, -1])[channel] = level
                at += bit
    found, sent, received = [], 1, 1
    for at, (first, second) in sorted(changes.items()):
        sent, received = first if first >= 0 else sent, second if second >= 0 else received
        found.append((at, sent, received))
    return found


def saleae_samples(bursts: Sequence[Burst]) -> bytes:
    """Return the export of two digital channels by Logic 2."""
    rows = [f"{at / NANO:.9f},{sent},{received}" for at, sent, received in _levels(bursts, 8681)]
    return "\n".join(["Time [s],TX,RX", *rows, ""]).encode()


def pulseview(bursts: Sequence[Burst]) -> bytes:
    """Return the export of two channels by PulseView, at 100 kHz and 9600 Bd: one burst each 25 ms."""
    near = [Burst(each.data, START + index * 25_000_000, each.way) for index, each in enumerate(bursts)]
    changes = iter(_levels(near, 104_167))
    rows, level = [], "1,1"
    at, sent, received = next(changes)
    for sample in range(2500 * (len(near) + 1)):
        while at <= sample * 10_000:
            level = f"{sent},{received}"
            at, sent, received = next(changes, (1 << 62, 1, 1))
        rows.append(level)
    head = [
        "; CSV generated by libsigrok 0.5.2",
        "; Channels (2/8): TX, RX",
        "; Samplerate: 100 kHz",
        "TX,RX",
    ]
    return "\n".join([*head, *rows, ""]).encode()


def _pcap(order: str, magic: int, unit: int) -> Write:
    def written(bursts: Sequence[Burst]) -> bytes:
        found = struct.pack(f"{order}IHHiIII", magic, 2, 4, 0, 0, 65535, 147)
        for each in bursts:
            size = len(each.data)
            found += (
                struct.pack(f"{order}IIII", each.at // NANO, each.at % NANO // unit, size, size) + each.data
            )
        return found

    return written


def pcapng(bursts: Sequence[Burst]) -> bytes:
    """Return a recording."""
    with TemporaryDirectory() as folder:
        path = Path(folder, "line.pcapng")
        with Writer(path, "a test") as writer:
            port = writer.add_interface("/dev/ttyUSB0", [], 115200)
            for each in bursts:
                writer.write(port, each.at, each.data, each.way)
        return path.read_bytes()


#: Formats that state direction and time.
STATED: dict[str, tuple[Format, Write]] = {
    **{f"log {name}": ("log", write) for name, write in LOGS.items()},
    "saleae 1": ("saleae", saleae_1),
    "samples": ("samples", saleae_samples),
    "pcapng": ("pcapng", pcapng),
}
#: Others.
SILENT: dict[str, tuple[Format, Write]] = {
    **{f"hex {name}": ("hex", write) for name, write in HEXES.items()},
    "saleae 2": ("saleae", saleae_2),
    "sigrok": ("sigrok", sigrok),
    "pcap": ("pcap", _pcap("<", 0xA1B2C3D4, 1000)),
    "pcap, big": ("pcap", _pcap(">", 0xA1B2C3D4, 1000)),
    "pcap, ns": ("pcap", _pcap("<", 0xA1B23C4D, 1)),
    "raw": ("raw", lambda bursts: b"".join(each.data for each in bursts)),
}
EVERY = {**STATED, **SILENT}


def reading(data: bytes) -> io.BytesIO:
    """Return a file with these bytes."""
    return io.BytesIO(data)
