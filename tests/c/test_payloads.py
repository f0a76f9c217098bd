"""Payloads of every kind in C against the interpreter of the plan: the same fault, or the same values.

The family: messages of every kind of step and every way to determine a count. Payloads are valid ones, all
their cuts, and valid ones with bytes changed, added and removed.
"""

from __future__ import annotations

import random
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

from qlinkgen.model.protocol import Protocol
from qlinkgen.plan import MessagePlan, Plan, plan_of
from qlinkgen.plan.content import BadContent, Raw, Unsendable, pack, unpack
from qlinkgen.plan.payload import BytesStep, CountStep, ItemsStep, Member, ValueStep, least_size
from qlinkgen.schema import loads
from tests.c.conftest import SANITIZED
from tests.c.test_shapes import EMPTY, FIELDS
from tests.support.cdriver import Driver, build

SEVEN = "groups: {bits: 7, first: least}"
#: More kinds of counts than in test_shapes, and faults of two kinds in one payload.
COUNTED = {
    "value before size": '{a: {type: u8, range: 1..3}, n: {type: u8, counts: v}, v: "u16[1..4]"}',
    "open before counted": (
        '{n: {type: u8, counts: w}, v: "bytes[0..5]", w: "u16[1..3]", z: {type: u8, const: 7}}'
    ),
    "open between counted": (
        '{n: {type: u8, counts: u}, m: {type: u16, counts: w, counts_in: bytes}, u: "u8[0..3]",'
        ' v: "i24[1..3]", w: "u16[1..3]", z: bool}'
    ),
    "compared late": (
        '{n: {type: u8, counts: w}, m: {type: u8, counts: v}, v: "u8[0..3]",'
        ' k: {type: u8, counts: w}, w: "u16[0..3]"}'
    ),
    "learnt late": (
        '{m: {type: u8, counts: v}, v: "u8[0..3]", k: {type: u24, counts: w}, w: "u16[0..3]", x: u16}'
    ),
    "compared after open": (
        '{n: {type: u8, counts: w}, v: "u8[0..3]", k: {type: u8, counts: w}, w: "text[0..3]"}'
    ),
    "count of seven bits": (
        f'{{n: {{type: u7, {SEVEN}, counts: v}}, v: "u8[0..3]", z: {{type: u7, {SEVEN}}}}}'
    ),
    "count of two groups": f'{{n: {{type: u14, {SEVEN}, counts: v}}, v: "u16[0..3]"}}',
    "narrow second count": '{n: {type: u16, counts: v}, m: {type: u8, counts: v}, v: "u8[]"}',
    "signed second count": '{n: {type: u16, counts: v}, m: {type: i8, counts: v}, v: "u8[]"}',
    "wide count": '{n: {type: u64, counts: v, counts_in: bytes}, v: "u32[2..3]"}',
    "signed count": '{n: {type: i8, counts: v}, v: "u16[0..3]"}',
    "meanings": (
        "{a: modes, c: {type: u16, bits: {d: {at: 0..2, range: 1..5}, e: {at: 8..15, type: level}}}}"
    ),
}
KINDS = {name: text for name, text in {**FIELDS, **COUNTED}.items() if text != EMPTY}
NAMES = {f"kind{number}": kind for number, kind in enumerate(KINDS)}
SCHEMA = """
qlinkgen: 1
protocol: {name: kinds, title: Kinds, revision: "1", source: this test, doc: Every kind of payload.}
byteorder: big
enums: {level: {type: u8, doc: D., values: {low: 1, high: 9}}}
flags: {modes: {type: u8, doc: D., reserved: zero, values: {fast: 0, far: 4}}}
frame:
  parts:
    start: {role: constant, value: 0xDC}
    len: {role: length, type: u16, counts: [id, data]}
    id: {role: message, type: u8}
    data: {role: payload, size: 0..600}
bus: {kind: master_slave, baud: 9600, response_within: 1 ms}
defaults: {repeat: safe}
commands:
"""


def protocol() -> Protocol:
    rows = [
        f"  {name}: {{id: {number}, doc: D., request: {KINDS[kind]}, response: {{}}}}"
        for number, (name, kind) in enumerate(NAMES.items())
    ]
    found, faults = loads(SCHEMA + "\n".join(rows), "kinds.yaml")
    assert found, faults
    return found


def values(message: MessagePlan, chance: random.Random) -> dict[str, Raw]:
    """Legal values, mostly bounds."""
    found: dict[str, Raw] = {}
    for each in message.payload.settable:
        match each:
            case ValueStep() | Member():
                numbers = (each.number.minimum, each.number.default, each.number.maximum)
                found[each.name] = chance.choice(
                    [n for n in numbers if all(c.holds(n) for c in each.conditions)]
                )
            case BytesStep() | ItemsStep():
                bounds = message.payload.sendable(each)
                size = chance.choice((bounds.low, bounds.high, chance.randint(bounds.low, bounds.high)))
                if isinstance(each, BytesStep):
                    found[each.name] = bytes(chance.randrange(0x80) for _ in range(size))
                else:
                    found[each.name] = chance.choices((each.number.minimum, each.number.maximum), k=size)
    return found


def damaged(payload: bytes, chance: random.Random) -> bytes:
    data = bytearray(payload)
    for _ in range(chance.randint(1, 3)):
        at = chance.randrange(len(data) + 1)
        match chance.randrange(4):
            case 0 if data[at:]:
                data[at] ^= 1 << chance.randrange(8)
            case 1 if data[at:]:
                data[at] = chance.choice((0, 1, 2, 3, 0x7F, 0x80, 0xFF))
            case 2:
                data[at:at] = chance.randbytes(chance.randint(1, 4))
            case _:
                del data[at : at + chance.randint(1, 3)]
    return bytes(data)


def truncated(message: MessagePlan) -> Iterator[bytes]:
    """Counts that hold the low bits of too large a number."""
    for run in message.payload.runs:
        for size in {run.length.maximum, min(run.length.maximum, 200)} - {message.payload.sendable(run).high}:
            parts = []
            for step in message.payload.steps:
                match step:
                    case CountStep() if step.run == run.name:
                        bits = size * step.scale & step.integer.mask
                        parts.append(step.integer.pack(step.integer.signed_value(bits)))
                    case BytesStep() | ItemsStep() if step.name == run.name:
                        parts.append(bytes(size * step.item_size))
                    case _:
                        parts.append(bytes(least_size(step)))
            yield b"".join(parts)


def payloads(message: MessagePlan) -> Iterator[bytes]:
    chance = random.Random(message.name)
    for _ in range(12):
        right = pack(message.payload, values(message, chance))
        yield right
        yield from (right[:size] for size in range(min(len(right), 24)))
        yield from (damaged(right, chance) for _ in range(60))
    yield from truncated(message)


def told(message: MessagePlan, payload: bytes) -> str:
    """The expected answer of the driver."""
    try:
        found = unpack(message.payload, payload)
    except BadContent as bad:
        return f"error {bad.kind}"
    return " ".join(["ok", *(shown(found[each.name]) for each in message.payload.settable)])


def shown(raw: Raw) -> str:
    assert raw is not None
    if isinstance(raw, int):
        return str(raw)
    return raw.hex() or "-" if isinstance(raw, bytes) else ",".join(map(str, raw)) or "-"


@pytest.fixture(scope="module")
def plan() -> Plan:
    return plan_of(protocol())


@pytest.fixture(scope="module")
def driver(
    plan: Plan, tmp_path_factory: pytest.TempPathFactory, require_tool: Callable[..., str]
) -> Iterator[Driver]:
    """Give the driver, and close it."""
    folder: Path = tmp_path_factory.mktemp("kinds")
    with Driver(
        build(plan.protocol, folder, require_tool("gcc", package="gcc"), (*SANITIZED, "-O0"))
    ) as found:
        yield found


@pytest.mark.parametrize("name", NAMES, ids=NAMES.values())
def test_the_same_fault_or_values(name: str, plan: Plan, driver: Driver) -> None:
    message = plan.message(name)
    seen: set[str] = set()
    for payload in payloads(message):
        expected = told(message, payload)
        assert driver.ask("payload", message.name, payload.hex() or "-") == expected, payload.hex()
        seen.add(" ".join(expected.split()[:2]) if expected.startswith("error") else "ok")
    assert {"ok", "error length"} <= seen


@pytest.mark.parametrize("name", NAMES, ids=NAMES.values())
def test_the_same_bytes(name: str, plan: Plan, driver: Driver) -> None:
    message, chance = plan.message(name), random.Random(name)
    for _ in range(20):
        chosen = values(message, chance)
        words = [shown(chosen[each.name]) for each in message.payload.settable]
        answer = driver.ask("encode", message.name, "-", *words).split()
        assert answer[:2] == ["ok", pack(message.payload, chosen).hex() or "-"], words


@pytest.mark.parametrize("name", NAMES, ids=NAMES.values())
def test_a_size_that_matches_no_count_is_refused(name: str, plan: Plan, driver: Driver) -> None:
    message, chance = plan.message(name), random.Random(name)
    for run in message.payload.runs:
        bounds = message.payload.sendable(run)
        for size in {bounds.low - 1, bounds.high + 1} & set(range(run.length.maximum + 1)):
            chosen = values(message, chance)
            assert isinstance(run, BytesStep | ItemsStep)
            chosen[run.name] = bytes(size) if isinstance(run, BytesStep) else [run.number.minimum] * size
            with pytest.raises(Unsendable):
                pack(message.payload, chosen)
            words = [shown(chosen[each.name]) for each in message.payload.settable]
            assert driver.ask("encode", message.name, "-", *words) == "error length"
