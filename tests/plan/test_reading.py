"""A reader says how many bytes it needs at least, so that a receiver need not ask again before."""

from __future__ import annotations

import random
from pathlib import Path

import pytest

from qlinkgen.model.message import Direction
from qlinkgen.plan.codec import Codec
from qlinkgen.plan.ended import frame_reader
from qlinkgen.plan.ends import ByTerminator, Hunt, Rescan
from qlinkgen.plan.reading import BadFrame, Incomplete
from tests.plan import shapes


def _delimited(path: Path | str) -> bool:
    return isinstance(shapes.plan(path).frame.receiver, Hunt | Rescan)


@pytest.mark.parametrize(
    ("path", "direction"),
    [each for each in shapes.cases() if _delimited(each[0])],
    ids=lambda value: getattr(value, "stem", value),
)
def test_a_frame_that_is_cut_needs_more_and_no_more_than_it_has(
    path: Path | str, direction: Direction
) -> None:
    plan = shapes.plan(path)
    for wire, request in shapes.frames(plan, direction, random.Random(0))[:8]:
        try:
            Codec(plan).decode(wire, direction, request)
        except BadFrame:
            continue
        reader = frame_reader(plan.frames[direction], plan.known(direction))
        hunting = isinstance(plan.frame.receiver, Hunt)
        end = reader.read(wire, hunting=hunting).end
        for cut in range(end):
            with pytest.raises(Incomplete) as caught:
                reader.read(wire[:cut], hunting=hunting)
            # A terminator may come later than in this frame.
            most = plan.frame.max_wire if isinstance(plan.frame.end, ByTerminator) else end
            assert cut < caught.value.size <= most
