"""Fields of every kind next to fields of every kind, compared with an independent reference.

`tests.support.field_kinds` defines the kinds and their bytes. Here they are combined to messages: each kind
alone, each ordered pair of the commonest kinds, triples of those that generated code treats differently, and
chains in which every kind precedes every other. If lint rejects a message, it reports the right rule.
"""

from __future__ import annotations

import functools
import itertools
import random
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pytest

from qlinkgen.backends import construct, python
from qlinkgen.model.message import Message
from qlinkgen.model.protocol import Protocol
from qlinkgen.schema import loads
from tests.proof.outputs import ConstructOutput, COutput, Output, PythonOutput, Refused
from tests.support import field_kinds
from tests.support.cdriver import Driver, build
from tests.support.field_kinds import COUNTS, KINDS, LENGTH, PACKET, STUFFED, Edge, Kind, Layout, Order, Row

#: Messages in one schema.
MANY = 250
BY_NAME = {kind.name: kind for kind in KINDS}
#: Kinds with different code, at both positions of pairs.
COMMON = tuple(
    BY_NAME[name]
    for name in (
        *("u8", "i16le", "u24", "u40le", "u64", "i11g", "bool", "strict flags", "scaled i24", "fixed32.32"),
        *("bits u16le", "bits u64", "const u24le", "reserved u8", "text[4]", "u8[2]", "i16le[3]"),
        *("u64[2]", "u24[2]"),
        *("bytes[0..5] rest", "u8[0..3] rest", "i64le[1..130] rest", "u24[0..3] rest", "u14g[0..3] rest"),
        *("text[1..4] by u8", "u16[0..4] by u8", "u8[1..250] by both", "i16le[1..5] by bytes"),
        *("u64[0..3] by both", "i40[1..4] by bytes", "i11g[1..2] by both"),
    )
)
#: In triples.
DISTINCT = tuple(
    BY_NAME[name]
    for name in (
        *("u24", "bits u8", "u8[2]", "u64[2]", "bytes[2..200] rest", "i64le[1..130] rest"),
        *("u8[0..3] by both", "i24le[0..150] by both"),
    )
)


def refusals(layout: Layout) -> set[str]:
    """The rules of lint that a message violates."""
    rows = [kind for kind in layout.kinds if isinstance(kind, Row)]
    at = [index for index, row in enumerate(rows) if row.open]
    found = {"two-open-ends"} if len(at) > 1 else set()
    later = rows[at[0] + 1 :] if at and not layout.counts_first else []
    return found | {"bad-count" for row in later if row.counted}


def chains(kinds: Sequence[Kind], size: int) -> Iterator[Layout]:
    """Messages in which every kind precedes every other, as far as legal, in blocks of several kinds."""
    opens = [kind for kind in kinds if isinstance(kind, Row) and kind.open]
    others = tuple(kind for kind in kinds if kind not in opens)
    blocks = [others[start : start + size] for start in range(0, len(others), size)]
    for block in blocks:
        yield Layout(block[::-1])
        yield from (Layout(block + other) for other in blocks)
        fixed = [kind for kind in block if not isinstance(kind, Row) or not kind.counted]
        yield from (Layout((*block, each, *fixed)) for each in opens)


def layouts() -> Mapping[str, list[Layout]]:
    """All messages, legal or not."""
    pairs = [Layout(pair, first) for first in (False, True) for pair in itertools.product(COMMON, repeat=2)]
    triples = [Layout(triple) for triple in itertools.product(DISTINCT, repeat=3)]
    return {
        "alone": [Layout((kind,)) for kind in KINDS],
        # Counts before both fields differ only if the second one has a count.
        "pairs": [
            pair for pair in pairs if not pair.counts_first or pair.specs() != Layout(pair.kinds).specs()
        ],
        "triples": triples,
        "chains": list(chains(KINDS, 12)),
    }


LAYOUTS = layouts()


@dataclass(frozen=True, eq=False)
class Group:
    """Messages of one schema."""

    name: str
    layouts: tuple[Layout, ...]
    frame: str = LENGTH
    order: Order = "big"

    def protocol(self) -> Protocol:
        return _load(self)

    def output(self, kind: str) -> Output:
        return _output(self, kind)

    def __str__(self) -> str:
        return self.name


@functools.cache
def _load(group: Group) -> Protocol:
    text = field_kinds.schema(group.layouts, group.frame, group.order)
    protocol, faults = loads(text, "pairs.yaml")
    assert protocol is not None, [str(fault) for fault in faults if fault.severity == "error"][:5]
    return protocol


@functools.cache
def _output(group: Group, kind: str) -> Output:
    protocol = group.protocol()
    if kind == "python":
        return PythonOutput(protocol, python.load(protocol))
    return ConstructOutput(protocol, construct.live(protocol))


def groups() -> Iterator[Group]:
    """The legal messages, in alternating frames and byte orders."""
    frames: Iterator[tuple[str, Order]] = itertools.cycle(
        ((LENGTH, "big"), (STUFFED, "little"), (LENGTH, "little"), (STUFFED, "big"))
    )
    for name, made in LAYOUTS.items():
        legal = [layout for layout in made if not refusals(layout)]
        for start in range(0, len(legal), MANY):
            frame, order = next(frames)
            yield Group(f"{name} from {start}", tuple(legal[start : start + MANY]), frame, order)
    closed = [kind for kind in COMMON if not isinstance(kind, Row) or not kind.open]
    fixed = [kind for kind in closed if not kind.counts("")]
    yield Group("packets", tuple(Layout(pair) for pair in itertools.product(fixed[::2], repeat=2)), PACKET)
    yield Group("counts", tuple(Layout(pair) for pair in itertools.product(closed[1::2], repeat=2)), COUNTS)


GROUPS = tuple(groups())
#: Few enough to compile: every kind alone, and every common one before every other.
COMPILED = (
    Group("alone", tuple(LAYOUTS["alone"])),
    Group("chains", tuple(chains(COMMON, 4)), LENGTH, "little"),
)
SANITIZED = ("-O0", "-std=c99", "-fsanitize=address,undefined", "-fno-sanitize-recover=all")
EDGES: tuple[Edge, ...] = ("least", "most", "any")

#: With this scope the tests of one group run in a row, and mostly in the worker that has made its outputs.
every_group = pytest.mark.parametrize(
    "group",
    [pytest.param(group, marks=() if group.name == "alone from 0" else pytest.mark.slow) for group in GROUPS],
    ids=str,
    scope="module",
)


@contextmanager
def named(layout: Layout) -> Iterator[None]:
    """Add the message to an error."""
    try:
        yield
    except Exception as error:
        error.add_note(str(layout))
        raise


def outcome(output: Output, message: Message, payload: bytes) -> Mapping[str, Any] | None:
    """The values of a payload, None if it is rejected. Other exceptions are errors."""
    try:
        return dict(output.decode_payload(message, payload))
    except Refused:
        return None


def damaged(payload: bytes, rng: random.Random) -> Iterator[bytes]:
    """A payload cut, lengthened, and with other bytes."""
    size = len(payload)
    yield from (payload[:cut] for cut in (range(size) if size <= 12 else sorted(rng.sample(range(size), 8))))
    yield from (payload + bytes(rng.choices(b"\0\1\2\x7f\xff", k=more)) for more in (1, 2, 3, 8))
    for _ in range(4 if payload else 0):
        at = rng.randrange(size)
        yield payload[:at] + bytes((rng.randrange(256),)) + payload[at + 1 :]


def agree(group: Group, output: Output) -> None:
    """Compare an output with the reference."""
    for number, layout in enumerate(group.layouts):
        message = group.protocol().by_name[f"m{number}"]
        rng = random.Random(number)
        for edge in EDGES:
            values, payload = layout.draw(rng, edge)
            with named(layout):
                made, wire = output.encode(message, values, message.default_address, b"")
                assert made.hex() == payload.hex()
                found = dict(output.decode_payload(message, payload))
                assert found == values
                assert [type(found[name]) for name in values if type(values[name]) is not int] == [
                    type(value) for value in values.values() if type(value) is not int
                ]
                assert output.decode(message, wire, b"").fields == values


def agree_on_damage(group: Group, outputs: Sequence[Output]) -> None:
    """Damaged payloads have the same values in all outputs, or are rejected by all."""
    for number, layout in enumerate(group.layouts):
        message = group.protocol().by_name[f"m{number}"]
        rng = random.Random(number)
        _, payload = layout.draw(rng, "any")
        for data in damaged(payload, rng):
            with named(layout):
                expected, *others = [outcome(each, message, data) for each in outputs]
                assert others == [expected] * len(others), data.hex()


@every_group
def test_python_has_the_bytes_and_values_of_the_reference(group: Group) -> None:
    agree(group, group.output("python"))


@every_group
def test_construct_has_the_bytes_and_values_of_the_reference(group: Group) -> None:
    agree(group, group.output("construct"))


@every_group
def test_damaged_payloads_are_read_alike_or_refused(group: Group) -> None:
    agree_on_damage(group, [group.output("construct"), group.output("python")])


@pytest.mark.parametrize("group", COMPILED, ids=str)
def test_c_has_the_bytes_and_values_of_the_reference(
    group: Group, tmp_path: Path, require_tool: Callable[..., str]
) -> None:
    program = build(group.protocol(), tmp_path, require_tool("gcc", package="gcc"), SANITIZED)
    with Driver(program) as driver:
        output = COutput(group.protocol(), driver)
        agree(group, output)
        agree_on_damage(group, [group.output("construct"), output])


# Messages rejected by lint


def test_lint_names_a_reason_for_each_message_that_it_refuses() -> None:
    refused = [layout for made in LAYOUTS.values() for layout in made if refusals(layout)]
    text = field_kinds.schema(refused, LENGTH)
    _, faults = loads(text, "pairs.yaml")
    first = len(text.splitlines()) - len(refused) + 1
    found = {(fault.line - first, fault.rule) for fault in faults if fault.severity == "error"}
    assert found == {(number, rule) for number, layout in enumerate(refused) for rule in refusals(layout)}
    assert {rule for _, rule in found} == {"two-open-ends", "bad-count"}


def test_a_bit_field_cannot_count() -> None:
    layout = Layout((Row("", "bytes", 0, 5),))
    text = field_kinds.schema([layout], LENGTH).replace(
        "{f0: ", "{n: {type: u8, bits: {low: {at: 0..3, counts: f0}}}, f0: "
    )
    _, faults = loads(text, "pairs.yaml")
    assert [fault.rule for fault in faults if fault.severity == "error"] == ["unknown-key"]
