"""After any corruption, frames of every framing with a check value are delivered."""

from __future__ import annotations

import re
from dataclasses import replace

import pytest

from qlinkgen.plan import plan_of
from qlinkgen.schema import find, load
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


#: Protocols without a check value, and the least share of intact frames that their receivers deliver.
UNCHECKED = {"slip": 0.8, "stm32": 0.95, "visca": 0.8}


@pytest.mark.slow
@pytest.mark.parametrize("name", framings.LIBRARY)
def test_every_intact_frame_of_the_library_is_delivered(name: str) -> None:
    """But for those that a false frame takes along: its check value is right by chance, or before a loss."""
    found = framings.total(name)
    plan = plan_of(load(find(name)))
    kinds = [kind.envelope for kind in plan.frame.every]
    # Kinds of one constant, such as the acknowledgement of M-Bus, have nothing to check.
    # Digits double the bytes of a check value, not its bits.
    bits = min(
        (sum(part.check.mask.bit_length() for part in each.checks) for each in kinds if each.checks),
        default=0,
    )
    if not bits:
        assert found.recovered >= UNCHECKED[name] * found.intact
        return
    if bits > 8 and not any(each.after for each in kinds):
        assert found.recovered == found.intact
    assert not framings.unexplained(framings.library_subject(name), plan)


def test_a_frame_that_a_receiver_drops_is_not_explained() -> None:
    whole = framings.library_subject("nmea_0183")
    careless = replace(whole, decoded=lambda chunks: whole.decoded(chunks)[1:])
    lost = framings.unexplained(careless, plan_of(load(find("nmea_0183"))))
    assert {kind: len(each) for kind, each in lost.items()} == dict.fromkeys(EVERY_KIND, 1)


def test_the_page_has_every_protocol_of_the_library() -> None:
    """If not, run `python -m tests.proof.framings --write`."""
    page = (cases.ROOT / "docs" / "recovery.md").read_text("utf-8")
    found = page.partition("| protocol | delivered | not sent |\n")[2].partition("\n\n")[0]
    assert re.findall(r"^\| (\w+) \|", found, re.MULTILINE) == list(framings.LIBRARY)
