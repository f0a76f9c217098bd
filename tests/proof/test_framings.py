"""After any corruption, frames of every framing with a check value are delivered."""

from __future__ import annotations

import pytest

from tests.proof import cases, framings
from tests.proof.corruption import EVERY_KIND


@pytest.mark.parametrize("kind", EVERY_KIND)
@pytest.mark.parametrize("name", framings.CHECKED)
def test_every_intact_frame_is_delivered(name: str, kind: str) -> None:
    result = framings.subject(name).result(kind)
    assert result.intact > framings.FRAMES / 2
    assert result.recovered == result.intact


def test_the_table_in_the_docs_is_this_one() -> None:
    assert framings.table() in (cases.ROOT / "docs" / "recovery.md").read_text("utf-8")
