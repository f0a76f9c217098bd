"""Codings against published examples, and their bounds."""

from __future__ import annotations

import random

import pytest

from qlinkgen.plan.coding import Add, Cobs, Digits, Escaping, Insertion, Pair, Read, Stage
from qlinkgen.plan.transparency import Coded

HDLC = Escaping(0x7D, ((0x7E, 0x5E), (0x7D, 0x5D)), 0x20)
SLIP = Escaping(0xDB, ((0xC0, 0xDC), (0xDB, 0xDD)), 0)
LONG = bytes(range(1, 255))
EXAMPLES: list[tuple[Stage, bytes, bytes]] = [
    (HDLC, b"\x41\x7e\x7d\x42", b"\x41\x7d\x5e\x7d\x5d\x42"),
    (SLIP, b"\xc0A\xdb", b"\xdb\xdcA\xdb\xdd"),
    # Of Cheshire and Baker's paper, and its summary in Wikipedia.
    (Cobs(), b"", b"\1"),
    (Cobs(), b"\0", b"\1\1"),
    (Cobs(), b"\0\0", b"\1\1\1"),
    (Cobs(), b"\0\x11\0", b"\1\2\x11\1"),
    (Cobs(), b"\x11\x22\0\x33", b"\3\x11\x22\2\x33"),
    (Cobs(), b"\x11\x22\x33\x44", b"\5\x11\x22\x33\x44"),
    (Cobs(), b"\x11\0\0\0", b"\2\x11\1\1\1"),
    (Cobs(), LONG, b"\xff" + LONG),
    (Cobs(), b"\0" + LONG, b"\1\xff" + LONG),
    (Cobs(), LONG + b"\xff", b"\xff" + LONG + b"\2\xff"),
    (Cobs(), LONG[1:] + b"\xff\0", b"\xff" + LONG[1:] + b"\xff\1\1"),
    (Cobs(), LONG[2:] + b"\xff\0\1", b"\xfe" + LONG[2:] + b"\xff\2\1"),
    (Digits(), b"\x0a\xff", b"0AFF"),
    (Pair(), b"\x00\xa5", b"\x00\xff\xa5\x5a"),
    (Add(0x33), b"\x00\xee", b"\x33\x21"),
    (Insertion(b"\xa5", 0), b"\xa5\xa5", b"\xa5\0\xa5\0"),
]
WRONG: list[tuple[Stage, bytes, int]] = [
    (HDLC, b"A\x7d", 2),
    (HDLC, b"\x7d\x7d\x5e", 1),
    (SLIP, b"\xdb\xdb", 1),
    (SLIP, b"A\xdbA", 2),
    (Cobs(), b"\3A", 2),
    (Cobs(), b"\2\0A", 1),
    (Cobs(), b"\0", 0),
    (Digits(), b"0A4", 3),
    (Digits(), b"0G", 1),
    (Digits(), b" 4", 0),
    (Pair(), b"AA", 1),
    (Pair(), b"A", 1),
    (Insertion(b"\xa5", 0), b"\xa5", 1),
]


@pytest.mark.parametrize(("stage", "plain", "sent"), EXAMPLES, ids=lambda each: type(each).__name__)
def test_examples(stage: Stage, plain: bytes, sent: bytes) -> None:
    assert stage.encode(plain) == sent
    read = stage.read(sent)
    assert (read.plain, read.wrong) == (plain, None)
    assert len(sent) <= len(plain) + stage.growth(len(plain))
    assert sorted(set(read.places)) == list(read.places)


@pytest.mark.parametrize(("stage", "sent", "at"), WRONG, ids=lambda each: type(each).__name__)
def test_wrong_bytes_are_found_where_they_are(stage: Stage, sent: bytes, at: int) -> None:
    assert stage.read(sent).wrong == at


def test_what_is_escaped_without_need_is_taken() -> None:
    assert HDLC.read(b"\x7d\x61").plain == b"\x41"
    assert HDLC.read(b"\x7e").plain == b"\x7e"
    assert Digits().read(b"aF").plain == b"\xaf"


@pytest.mark.parametrize("stage", [HDLC, SLIP, Cobs(), Digits(), Pair(), Add(7), Insertion(b"\0\1", 1)])
def test_every_coding_is_undone_within_its_growth(stage: Stage) -> None:
    rng = random.Random(1)
    for size in (*range(20), *range(250, 260), 508, 509, 600):
        for alphabet in (b"\0\1", bytes(range(256)), b"\x7e\x7d\xc0\xdb"):
            data = bytes(rng.choice(alphabet) for _ in range(size))
            sent = stage.encode(data)
            assert stage.read(sent).plain == data
            assert len(sent) <= size + stage.growth(size)


def test_codings_apply_one_after_the_other() -> None:
    coded = Coded((Add(1), Digits()), 1, 2)
    assert coded.encode(b":\x09\x0a\r\n") == b":0A0B\r\n"
    assert coded.read(b"0A0B") == Read(b"\x09\x0a", (1, 3))
    assert coded.most_frame(5) == 7
    assert coded.read(b"0A0").wrong == 3
