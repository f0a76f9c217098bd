"""The library agrees with other people's implementations, and with itself in every output."""

from __future__ import annotations

import random
from collections.abc import Callable

import pytest

from tests.library.protocols import NAMES, PEERS, Record, described, peer, text_of
from tests.support.whole.trial import Effort, run_text

#: Random messages of each protocol.
MESSAGES = 1000


@pytest.fixture(params=NAMES)
def name(request: pytest.FixtureRequest) -> str:
    return str(request.param)


def test_every_protocol_has_a_peer() -> None:
    assert sorted(PEERS) == list(NAMES)


@pytest.mark.slow
def test_random_messages_are_those_of_the_peer(name: str) -> None:
    other, ours = peer(name), described(name)
    compared: set[str] = set()
    for message in ours.model.messages:
        direction = ours.plan.direction_of(ours.plan.message(message.name))
        rng = random.Random(message.name)
        for _ in range(max(20, MESSAGES // len(ours.model.messages))):
            wire = ours.wire(message, rng)
            record = ours.record_of(message, wire)
            assert ours.encoded(record) == wire
            built, read = other.build(record), other.read(wire, direction)
            if built is not None:
                assert built.hex(" ") == wire.hex(" "), record
                compared.add(message.name)
            if read is not None:
                assert _part_of(record, read) == read, wire.hex(" ")
                compared.add(message.name)
    assert {each.name for each in ours.model.messages} - compared == other.UNKNOWN


def _part_of(record: Record, read: Record) -> Record:
    """Of a record, what the peer has read as well."""
    fields = {each: record["fields"][each] for each in read.get("fields", {})}
    return {each: fields if each == "fields" else record[each] for each in read}


@pytest.mark.slow
def test_every_output_agrees(name: str, require_tool: Callable[..., str]) -> None:
    for compiler in ("gcc", "clang"):
        require_tool(compiler, package=compiler)
    seed = NAMES.index(name) % 2  # gcc with sanitizers, or clang
    outcome = run_text(text_of(name), seed, effort=Effort(messages=4, streams=12))
    assert not outcome.refused
    assert not outcome.differences, outcome.report()
