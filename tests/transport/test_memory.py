"""Two ports in one process."""

from __future__ import annotations

import threading

import pytest

from qlinkgen.errors import PortError, PortLost
from qlinkgen.transport import Ability, memory_pair
from tests.transport.conftest import PATIENCE


def test_both_ways_and_apart() -> None:
    left, right = memory_pair(9600)
    left.write(b"request")
    right.write(b"answer")
    assert right.read(0) == b"request"
    assert left.read(0) == b"answer"
    assert (left.baud, right.baud) == (9600, 9600)
    assert left.name != right.name


def test_read_takes_all_that_is_there_up_to_a_chunk() -> None:
    left, right = memory_pair()
    left.write(b"ab")
    left.write(b"cd")
    assert right.read(0) == b"abcd"
    left.write(bytes(5000))
    assert [len(right.read(0)) for _ in range(3)] == [4096, 904, 0]


def test_nothing_comes() -> None:
    left, right = memory_pair()
    before = left.now()
    assert left.read(0) == b""
    assert left.read(-1.0) == b""
    assert left.read(0.01) == b""
    assert left.now() - before >= 0.01
    right.write(b"")
    assert left.read(0) == b""


def test_a_waiting_read_is_woken() -> None:
    left, right = memory_pair()
    got: list[bytes] = []
    reader = threading.Thread(target=lambda: got.append(right.read(PATIENCE)))
    reader.start()
    left.write(b"x")
    reader.join(PATIENCE)
    assert got == [b"x"]


def test_bytes_of_several_threads_all_arrive_whole() -> None:
    left, right = memory_pair()
    words = [bytes([number]) * 7 for number in range(4)]

    def send(word: bytes) -> None:
        for _ in range(200):
            left.write(word)

    writers = [threading.Thread(target=send, args=[word]) for word in words]
    for writer in writers:
        writer.start()
    data = b""
    while len(data) < 4 * 200 * 7:
        piece = right.read(PATIENCE)
        assert piece
        data += piece
    for writer in writers:
        writer.join(PATIENCE)
    pieces = [data[start : start + 7] for start in range(0, len(data), 7)]
    assert {piece: pieces.count(piece) for piece in words} == dict.fromkeys(words, 200)


def test_the_other_end_closes_after_its_last_words() -> None:
    left, right = memory_pair(names=("master", "node"))
    left.write(b"bye")
    left.close()
    assert right.read(0) == b"bye"
    for _ in range(2):
        with pytest.raises(PortLost, match="node was lost: its other end was closed") as caught:
            right.read(PATIENCE)
        assert caught.value.port == "node"
    with pytest.raises(PortLost, match="other end was closed"):
        right.write(b"x")


def test_closed_here() -> None:
    left, right = memory_pair()
    right.write(b"unread")
    left.close()
    left.close()
    for use in (lambda: left.read(0), lambda: left.write(b"")):
        with pytest.raises(PortLost, match="was closed here"):
            use()
    assert left.fileno() is None


@pytest.mark.parametrize("own", [True, False])
def test_close_ends_a_waiting_read(own: bool) -> None:
    left, right = memory_pair()
    caught: list[Exception] = []

    def wait() -> None:
        try:
            left.read(PATIENCE)
        except PortError as error:
            caught.append(error)

    reader = threading.Thread(target=wait)
    reader.start()
    (left if own else right).close()
    reader.join(PATIENCE)
    assert [type(error) for error in caught] == [PortLost]
    assert ("closed here" in str(caught[0])) is own


def test_capabilities_and_context() -> None:
    left, right = memory_pair()
    with left as same:
        assert same is left
        assert left.capabilities.latency == 0.0
        assert left.capabilities.paced is Ability.NO
    with pytest.raises(PortLost):
        right.read(0)
