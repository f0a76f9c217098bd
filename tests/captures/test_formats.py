"""Every format is detected, read exactly, and gives what can be read of damaged and cut files."""

from __future__ import annotations

import random
import subprocess
from collections import Counter
from collections.abc import Callable, Sequence
from pathlib import Path

import pytest

from qlinkgen.captures import Reader
from qlinkgen.captures.formats import possible, reader_of
from qlinkgen.captures.records import Format, Problems, Record
from qlinkgen.captures.samples import Frame
from tests.captures.written import EVERY, NANO, START, STATED, Burst, pulseview, reading

TEXTS = {name for name, (kind, _) in EVERY.items() if kind in {"hex", "log", "saleae", "sigrok", "samples"}}
BYTEWISE = {"saleae 1", "saleae 2", "sigrok", "samples"}


def bursts(count: int, seed: int = 1) -> list[Burst]:
    chance = random.Random(seed)
    found = []
    at = START
    for _ in range(count):
        at += chance.randrange(5_000_000, 90_000_000) // 1000 * 1000
        found.append(
            Burst(chance.randbytes(chance.randrange(1, 20)), at, chance.choice(("sent", "received")))
        )
    return found


def read(kind: Format, data: bytes) -> tuple[list[Record], Problems]:
    problems = Problems()
    return list(reader_of(kind)(reading(data), problems)), problems


def joined(records: Sequence[Record | Burst]) -> bytes:
    return b"".join(each.data for each in records)


@pytest.mark.parametrize("name", EVERY)
def test_read_back(name: str) -> None:
    kind, write = EVERY[name]
    sent = bursts(300)
    written = write(sent)
    assert possible(written)[0] == kind
    records, problems = read(kind, written)
    assert not problems.kept
    assert joined(records) == joined(sent)
    if name not in BYTEWISE and kind != "raw":
        assert [each.data for each in records] == [each.data for each in sent]
    if name in STATED:
        ways = [each.way for each in sent for _ in (each.data if name in BYTEWISE else "x")]
        assert [each.direction for each in records] == ways
        begins = {each.at for each in records if each.at is not None}
        apart = {each.at - sent[0].at for each in sent}
        first = min(begins)
        assert apart <= {at - first for at in begins}
    # The offset of a record is that of its line or packet.
    if name in TEXTS:
        for record in records[:: len(records) // 20]:
            assert record.offset == 0 or written[record.offset - 1 : record.offset] == b"\n"


@pytest.mark.parametrize("name", [name for name in EVERY if name != "raw"])
def test_damaged(name: str) -> None:
    """Of 200 damaged files, each gives all records that the damage did not touch."""
    kind, write = EVERY[name]
    whole = write(bursts(10 if kind == "samples" else 40, seed=2))
    chance = random.Random(name)
    offsets = [each.offset for each in read(kind, whole)[0]]
    for _ in range(200):
        damaged, first, last = _damage(whole, chance, header=min(offsets))
        records, problems = read(kind, damaged)
        found = Counter(each.data for each in records)
        untouched = _untouched(kind, whole, first, last)
        lost = Counter(untouched) - found
        # In levels, the bytes that follow without a pause have their start bit elsewhere.
        assert lost.total() <= (40 if kind == "samples" else 0), (name, first, last, problems.kept)


def _damage(whole: bytes, chance: random.Random, header: int) -> tuple[bytes, int, int]:
    """Return a damaged file, and the bytes of the whole one that were touched: the rest is as it was."""
    first = chance.randrange(header, len(whole))
    last = min(len(whole), first + chance.choice((1, 1, 4, 30)))
    match chance.randrange(4):
        case 0:
            return whole[:first], first, len(whole)
        case 1:
            return whole[:first] + whole[last:], first, last
        case 2:
            return (
                whole[:first] + chance.randbytes(chance.choice((1, 3, 50))) + whole[first:],
                first,
                first + 1,
            )
        case _:
            return whole[:first] + chance.randbytes(last - first) + whole[last:], first, last


def _untouched(kind: Format, whole: bytes, first: int, last: int) -> list[bytes]:
    """Return the data of records whose bytes, and those of the ones beside them, were not touched."""
    records, _ = read(kind, whole)
    ends = [each.offset for each in records[1:]] + [len(whole)]
    touched = [
        index
        for index, (each, end) in enumerate(zip(records, ends, strict=True))
        if each.offset < last and end > first
    ]
    beside = range(min(touched, default=0) - 1, max(touched, default=-1) + 2)
    return [each.data for index, each in enumerate(records) if index not in beside]


@pytest.mark.parametrize("name", EVERY)
def test_any_beginning(name: str) -> None:
    """A cut file has the records before the cut."""
    kind, write = EVERY[name]
    sent = bursts(2 if kind == "samples" else 6, seed=3)
    whole = write(sent)
    every, _ = read(kind, whole)
    for size in range(0, len(whole), len(whole) // 1000 + 1):
        records, _ = read(kind, whole[:size])
        ended = sum(each.offset <= size for each in every) - 1  # the last one may be cut
        assert joined(sent).startswith(joined(records[:-1]))
        assert len(records) >= ended or kind == "raw"


@pytest.mark.parametrize("baud", [None, 9600])
def test_samples_at_a_rate(baud: int | None) -> None:
    """Samples without times have a rate; the speed of the line is measured if it is not given."""
    sent = bursts(8, seed=6)
    problems = Problems()
    table = reading(pulseview(sent))
    records = list(reader_of("samples", Frame(baud))(table, problems))
    assert not problems.kept
    assert joined(records) == joined(sent)
    assert {each.direction for each in records} == {"sent", "received"}
    firsts = [each for each in records if each.at is not None and each.at % 25_000_000 // 100_000 == 10]
    assert len(firsts) == len(sent)
    assert possible(pulseview(sent))[0] == "samples"


def test_bits_of_samples() -> None:
    """Parity bits and pulses of less than half a bit are passed over; bytes without a stop bit are noted."""
    bit = 104_167
    levels = [0, 1, 0, 1, 0, 0, 0, 0, 0, 1, 1]  # 05, a parity bit, stop
    rows = ["Time [s],Channel 0", "0,1", "0.001,0", "0.00103,1"]
    rows += [f"{0.01 + index * bit / NANO:.9f},{level}" for index, level in enumerate(levels)]
    rows += [f"{0.02 + index * bit / NANO:.9f},{level}" for index, level in enumerate([0] * 12 + [1])]
    problems = Problems()
    found = list(reader_of("samples", Frame(9600, 11))(reading("\n".join(rows).encode()), problems))
    assert [(each.data, each.port) for each in found] == [(b"\x05", "Channel 0")]
    assert [each.text for each in problems.kept] == ["a byte of Channel 0 has no stop bit; it is left out"]
    assert list(reader_of("samples")(reading(b"Time [s],A\n0,1\n"), problems)) == []


def test_random_files() -> None:
    """No bytes at all make a reader fail."""
    chance = random.Random(4)
    for _ in range(300):
        data = chance.choice((chance.randbytes, _characters(chance)))(chance.randrange(400))
        for kind in ("hex", "dump", "log", "saleae", "sigrok", "pcap", "pcapng"):
            read(kind, data)
        assert "raw" in possible(data)


def _characters(chance: random.Random) -> Callable[[int], bytes]:
    text = "0123456789abcdefx:., \n\t[]()->TXRX\\'\"#*|é"
    return lambda size: "".join(chance.choices(text, k=size)).encode()


#: Programs that dump a file, and the Debian package of each.
DUMPS = {
    "xxd": ("xxd", ["xxd"]),
    "xxd in columns of 7": ("xxd", ["xxd", "-c7"]),
    "xxd, single bytes, capitals": ("xxd", ["xxd", "-g1", "-u"]),
    "xxd without addresses": ("xxd", ["xxd", "-p"]),
    "xxd for C": ("xxd", ["xxd", "-i"]),
    "hexdump": ("bsdextrautils", ["hexdump"]),
    "hexdump -C": ("bsdextrautils", ["hexdump", "-C"]),
    "od of bytes": ("coreutils", ["od", "-t", "x1"]),
    "od of bytes with characters": ("coreutils", ["od", "-A", "x", "-t", "x1z"]),
}


@pytest.mark.program
@pytest.mark.parametrize("name", DUMPS)
def test_dumps_of_programs(name: str, tmp_path: Path, require_tool: Callable[..., str]) -> None:
    package, command = DUMPS[name]
    require_tool(command[0], package=package)
    chance = random.Random(5)
    for size in (*range(1, 35), 300, 1000):
        data = chance.randbytes(size) if size < 1000 else b"\xa5" * 333 + bytes(667)  # lines are repeated
        file = tmp_path / "raw.bin"
        file.write_bytes(data)
        # A name of a file would be the name of an array.
        dump = subprocess.run([*command, file.name], cwd=tmp_path, capture_output=True, check=True).stdout
        kinds = possible(dump)
        wanted = "hex" if "-p" in command or "-i" in command else "dump"
        assert wanted in kinds
        records, problems = read(wanted, dump)
        assert joined(records) == data, (size, dump)
        if "-i" not in command:  # its lines of declarations are noted
            assert not problems.kept


@pytest.mark.program
def test_recordings_of_programs(tmp_path: Path, require_tool: Callable[..., str]) -> None:
    """Files that Wireshark's programs write have the same packets as ours."""
    editcap = require_tool("editcap", package="tshark")
    sent = bursts(50)
    ours = tmp_path / "ours.pcapng"
    ours.write_bytes(EVERY["pcapng"][1](sent))
    for kind, suffix in (("pcapng", "pcapng"), ("pcap", "pcap"), ("nsecpcap", "pcap")):
        theirs = tmp_path / f"theirs.{kind}"
        subprocess.run([editcap, "-F", kind, ours, theirs], check=True, capture_output=True)
        data = theirs.read_bytes()
        assert possible(data)[0] == suffix
        records, problems = read(possible(data)[0], data)
        assert not problems.kept
        assert [(each.data, each.at) for each in records] == [(each.data, each.at) for each in sent]
        if kind == "pcapng":
            assert [each.direction for each in records] == [each.way for each in sent]
            assert len(list(Reader(reading(data)))) == len(sent)
