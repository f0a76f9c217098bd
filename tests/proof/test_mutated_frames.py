"""Mutated frames give the same values or fault in every output; `make soak-frames` tries a million."""

from __future__ import annotations

import pytest

from qlinkgen.schema import shipped
from tests.soak.frames import Trial, run
from tests.support.whole.reference import Seen, Wrong
from tests.support.whole.reference.layouts import Message
from tests.support.whole.targets import PythonTarget


@pytest.mark.parametrize("protocol", shipped())
def test_mutated_frames_are_the_same_to_every_output(protocol: str) -> None:
    tally = run(Trial(protocol, seed=10**9, frames=2000))
    assert tally.differences == []
    assert tally.found.total() == 2000
    assert tally.found["accepted"] > 300
    assert len(tally.found) > 4


def test_another_kind_of_fault_is_a_difference(monkeypatch: pytest.MonkeyPatch) -> None:
    decode = PythonTarget.decode

    def wrong(self: PythonTarget, message: Message, wire: bytes, request: bytes) -> Seen:
        try:
            return decode(self, message, wire, request)
        except Wrong as error:
            raise Wrong("truncated" if error.kind == "length" else error.kind) from None

    monkeypatch.setattr(PythonTarget, "decode", wrong)
    tally = run(Trial("qlink", seed=1, frames=200))
    assert tally.differences
    assert all(each.endswith("python has truncated, not length") for each in tally.differences)
