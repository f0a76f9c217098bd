"""Generated Python and C return the same messages and faults of a stream, in the same order."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from qlinkgen.model.protocol import Protocol
from qlinkgen.plan import plan_of
from qlinkgen.plan.ends import Rescan
from tests.proof import cases, recovery
from tests.proof.conftest import Make
from tests.proof.corruption import EVERY_KIND, corrupted
from tests.proof.outputs import COutput

#: One side of every comparison is compiled.
pytestmark = pytest.mark.program

NO_STREAM = ("mc1231a", "response")
#: Number of frames in a line to the C program.
_FRAMES = 800


def c_events(output: object, name: str, direction: str, data: bytes) -> list[str]:
    """Messages as name, address and payload, faults as their kind."""
    assert isinstance(output, COutput)
    return [_in_full(name, event.split(":", 1)[1]) for event in output.stream(direction, data)]


def _in_full(name: str, event: str) -> str:
    """An omitted payload, which is decoded as the defaults."""
    _, *words = event.split(":")
    if words and words[-1] == "-" and cases.protocol(name).by_name[words[0]].empty_is_default:
        return event[:-1] + cases.reference(name).payload(words[0], {}).hex()
    return event


def python_events(name: str, direction: str, chunks: Sequence[bytes]) -> list[str]:
    """The same of the generated Python."""
    protocol = cases.protocol(name)
    module = cases.module(name)
    decoder = module.StreamDecoder(*([] if direction == "message" else [direction]))
    events = [event for chunk in chunks for event in decoder.feed(chunk)]
    # In C, a receiver without look-back buffers nothing at the end of a stream.
    events += decoder.finish() if looks_back(name) else []
    return [_shown(event, protocol) for event in events]


def looks_back(name: str) -> bool:
    """The receiver buffers bytes until they can be classified."""
    return isinstance(plan_of(cases.protocol(name)).frame.receiver, Rescan)


def _shown(event: Any, protocol: Protocol) -> str:
    if not hasattr(event, "NAME"):
        return str(event.kind)
    address = getattr(event, protocol.address_name) if protocol.address_name else "-"
    found = (getattr(event, each.name) for each in protocol.beside(protocol.by_name[event.NAME]))
    beside = [each.encode().hex() if isinstance(each, str) else int(each) for each in found]
    return ":".join(["message", event.NAME, str(address), *map(str, beside), event.to_bytes().hex() or "-"])


@st.composite
def streams(draw: st.DrawFn, name: str, direction: str) -> tuple[bytes, ...]:
    """Frames, parts of frames and noise, in chunks."""
    wires = [each.wire for each in cases.cases(name) if each.message.direction in (direction, "message")]
    frame = st.sampled_from(wires)
    part = frame.flatmap(lambda wire: st.integers(0, len(wire)).map(lambda size: wire[:size]))
    noise = st.lists(st.sampled_from([0x00, 0x80, 0x88, 0xA5, 0xFF]) | st.integers(0, 0xFF), max_size=6).map(
        bytes
    )
    pieces = draw(st.lists(frame | part | noise | st.just(b"\xa5\xa5"), max_size=8))
    data = b"".join(pieces)
    cuts = sorted(draw(st.lists(st.integers(0, len(data)), max_size=4)))
    return tuple(data[a:b] for a, b in zip([0, *cuts], [*cuts, len(data)], strict=True))


@pytest.mark.parametrize(
    ("name", "direction"),
    # Responses of a packet protocol cannot be split without their requests.
    [
        (name, each)
        for name in cases.PROTOCOLS
        for each in cases.protocol(name).directions
        if (name, each) != NO_STREAM
    ],
)
@settings(max_examples=40)
@given(data=st.data())
def test_the_same_events(make: Make, name: str, direction: str, data: st.DataObject) -> None:
    chunks = data.draw(streams(name, direction))
    whole = b"".join(chunks)
    assert python_events(name, direction, chunks) == c_events(make(name, "gcc"), name, direction, whole)


@pytest.mark.parametrize("kind", EVERY_KIND)
@pytest.mark.parametrize(("name", "direction"), [("qlink", "response"), ("trio", "message")])
def test_the_same_events_of_a_damaged_stream(make: Make, name: str, direction: str, kind: str) -> None:
    subject = getattr(recovery, name)()
    stream = corrupted(subject.frames[:_FRAMES], kind, subject.look_alike)
    found = c_events(make(name, "gcc"), name, direction, stream.data)
    assert found == python_events(name, direction, list(stream.chunks()))
    assert len([each for each in found if each.startswith("message:")]) >= len(stream.intact)
