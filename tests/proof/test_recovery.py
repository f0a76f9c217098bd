"""After any corruption, every later intact frame is delivered."""

from __future__ import annotations

import pytest

from tests.proof import cases, recovery
from tests.proof.corruption import EVERY_KIND
from tests.proof.recovery_report import cell


@pytest.mark.parametrize("kind", EVERY_KIND)
@pytest.mark.parametrize("protocol", ["qlink", "trio"])
def test_every_intact_frame_is_delivered(protocol: str, kind: str) -> None:
    result = getattr(recovery, protocol)().result(kind)
    assert result.intact > recovery.FRAMES / 2
    assert result.recovered == result.intact


@pytest.mark.parametrize("kind", EVERY_KIND)
def test_a_checksum_over_everything_lets_nothing_else_through(kind: str) -> None:
    assert recovery.qlink().result(kind).strange == 0


@pytest.mark.parametrize("kind", EVERY_KIND)
def test_the_table_in_the_docs_is_this_one(kind: str) -> None:
    text = (cases.ROOT / "docs" / "recovery.md").read_text("utf-8")
    cells = " | ".join(cell(subject.result(kind)) for subject in (recovery.qlink(), recovery.trio()))
    assert f"| {kind} | {cells} |" in text


def test_the_set_is_fixed() -> None:
    first, again = recovery.qlink().stream("all"), recovery.qlink().stream("all")
    assert first.data == again.data
    assert b"".join(first.chunks()) == first.data
