"""Loads in pieces that are refused."""

from __future__ import annotations

import pytest

from qlinkgen.codecs import qlink
from qlinkgen.errors import LoadError, Refused
from qlinkgen.link.loading import LoadProgress, Pieces, load
from qlinkgen.link.procedure import Ask, Pause, Tell


def test_a_refused_piece_is_not_sent_again() -> None:
    def make(number: int, data: bytes) -> qlink.NodeProgramLoadRequest:
        return qlink.NodeProgramLoadRequest(node=3, counter=number, program_data=data)

    running = load(b"abc", Pieces(make, 256, 2, None, None), patience=60.0)
    assert next(running) == Tell(LoadProgress(0, 3)), "without an opening request"
    asked = next(running)
    assert isinstance(asked, Ask)
    assert asked.request == make(0, b"ab")
    assert isinstance(running.throw(Refused("flash is locked", attempts=1, elapsed=0.01)), Pause)
    with pytest.raises(LoadError) as caught:
        running.send(1.0)
    assert str(caught.value) == (
        "the device: 0 of 3 bytes were acknowledged, then a refusal; it may have discarded its program, "
        "so load it again: flash is locked"
    )
    assert (caught.value.acknowledged, caught.value.total, caught.value.attempts) == (0, 3, 1)


def test_an_empty_program() -> None:
    with pytest.raises(ValueError, match="the program is empty"):
        next(load(b"", Pieces(lambda _number, _data: None, 1, 1, None, None)))  # type: ignore[arg-type,return-value]
