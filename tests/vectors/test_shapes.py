"""Vectors of frames of every shape agree with targets, and each fault is in the named part."""

from __future__ import annotations

import functools
import itertools
import json
from collections import defaultdict
from collections.abc import Iterable, Iterator, Mapping
from decimal import Decimal
from typing import Any

import pytest
from construct import ConstructError

from qlinkgen.backends import construct, python, vectors
from qlinkgen.backends.base import Options
from qlinkgen.backends.python._records import BaseRecord
from qlinkgen.model.naming import record_key
from qlinkgen.model.protocol import Protocol
from qlinkgen.model.values import Native, natives_of
from qlinkgen.plan import MessagePlan, Plan, plan_of
from qlinkgen.plan.codec import Codec
from qlinkgen.plan.ends import ByTerminator
from qlinkgen.plan.envelope import Envelope
from qlinkgen.plan.framing import FramePlan
from qlinkgen.plan.parts import (
    AddressPart,
    CheckPart,
    ConstantPart,
    IdPart,
    LengthPart,
    MarkPart,
    Part,
    PayloadPart,
)
from qlinkgen.plan.transparency import Coded, FrameStuffing, PayloadStuffing, SevenBit
from qlinkgen.schema import find, load, loads
from tests.c import test_shapes
from tests.proof import cases
from tests.proof.outputs import plain_numbers
from tests.support.whole import schemas

#: Making all of these protocols takes some seconds of each worker.
pytestmark = pytest.mark.slow

Row = Mapping[str, Any]
#: Random whole schemas, in addition to the shapes of the tests of C headers.
SEEDS = range(16)


@functools.cache
def protocols() -> tuple[Protocol, ...]:
    """Valid shapes, random schemas, and one whose preamble occurs nowhere else."""
    shapes = [protocol for _, protocol in itertools.chain(test_shapes.pairs(), test_shapes.others())]
    random = [loads(schemas.generate(seed), "whole.yaml")[0] for seed in SEEDS]
    hunting = cases.protocol("qlink")
    return (hunting, *shapes, *(protocol for protocol in random if protocol is not None))


@functools.cache
def written() -> tuple[tuple[Plan, Mapping[str, list[Row]]], ...]:
    """The plan and the vectors of each protocol."""
    found = []
    for protocol in protocols():
        (text,) = vectors.generate(protocol, Options()).values()
        found.append((plan_of(protocol), json.loads(text, parse_float=Decimal)))
    return tuple(found)


@functools.cache
def module_of(plan: Plan) -> Any:
    """The generated Python module."""
    return python.load(plan.protocol)


@functools.cache
def live_of(plan: Plan) -> construct.Live:
    """Live construct structures."""
    return construct.live(plan.protocol)


def rows(kind: str) -> Iterator[tuple[Plan, MessagePlan, Row]]:
    for plan, document in written():
        yield from ((plan, plan.message(row["message"]), row) for row in document[kind])


def wire(row: Row, key: str = "wire") -> bytes:
    return bytes.fromhex(row.get(key, ""))


def test_many_shapes() -> None:
    assert len(protocols()) > 150
    found = {type(plan.frame.receiver).__name__ for plan, _ in written()}
    assert found == {"Hunt", "Rescan", "Marks", "InStep"}


def test_every_right_vector_decodes_in_python_and_construct() -> None:
    for plan, document in written():
        module, live = module_of(plan), live_of(plan)
        for row in document["vectors"]:
            message = plan.message(row["message"])
            fields = natives(plan, message, row)
            found = decoded(module, plan, message, row)
            assert message.name == found.NAME
            assert {name: plain(getattr(found, name)) for name in fields} == fields, row
            parsed = live.parse(plan.direction_of(message), wire(row), wire(row, "request"))
            assert parsed["message"] == message.name
            parsed_fields = plain_numbers(parsed["fields"])
            assert {name: parsed_fields[name] for name in fields} == fields, row
            address = row.get(plan.frame.address)
            # Not every kind of frame has one.
            assert address == (getattr(found, plan.frame.address, None) if plan.frame.address else None)
            assert address == parsed.get(plan.frame.address)


def natives(plan: Plan, message: MessagePlan, row: Row) -> dict[str, Native]:
    """The values of the payload of a vector; those of its frame decide about some."""
    beside = plan.protocol.beside(message.message)
    around = {value.name: row[record_key(value.name)] for value in beside}
    found = natives_of((*beside, *message.message.values), around | row["fields"])
    return {name: value for name, value in found.items() if name not in around}


def plain(value: Any) -> Any:
    """A value of generated Python, with a mapping for each record."""
    if isinstance(value, list):
        return [plain(each) for each in value]
    if isinstance(value, BaseRecord):
        return {name: plain(getattr(value, name)) for name in value.FIELDS}
    return value


def decoded(module: Any, plan: Plan, message: MessagePlan, row: Row) -> Any:
    """The result of generated Python for a vector."""
    direction = plan.direction_of(message)
    decode = getattr(module, "decode" if direction == "message" else f"decode_{direction}")
    return decode(wire(row), *([module.decode_request(wire(row, "request"))] if row.get("request") else []))


def test_every_fault_has_its_kind_in_python_and_is_refused_by_construct() -> None:
    for plan, document in written():
        module, live = module_of(plan), live_of(plan)
        for row in document["faults"]:
            message = plan.message(row["message"])
            with pytest.raises(module.DecodeError) as caught:
                decoded(module, plan, message, row)
            assert caught.value.kind == row["kind"], (plan.protocol.schema_file, row)
            with pytest.raises(ConstructError):
                live.parse(plan.direction_of(message), wire(row), wire(row, "request"))


#: The fault of each kind of part, if it does not depend on the rest of the frame.
KINDS = {ConstantPart: "frame", CheckPart: "crc", MarkPart: "frame", AddressPart: "range", IdPart: "unknown"}


def test_every_part_has_a_vector() -> None:
    """In any frame: a constant or another part may follow the check value."""
    for plan, document in written():
        kinds: dict[tuple[str, str], set[str]] = defaultdict(set)
        for row in document["faults"]:
            kinds[row["message"], row["part"]].add(row["kind"])
        begun: set[str] = set()
        sent = _sent(plan, document["vectors"])
        for message in plan.messages:
            if message.asked and not plan.is_first(message):
                continue  # a wrong one may be another answer
            for part in message.envelope.parts:
                if (message.name, part.name) not in sent:
                    continue
                expected = _expected(plan, message, part, first=message.direction not in begun)
                found = kinds[message.name, part.name]
                assert not expected or expected & found, (plan.protocol.name, message.name, part)
            begun.add(message.direction)


def _sent(plan: Plan, vectors: Iterable[Row]) -> set[tuple[str, str]]:
    """The parts that some vector of a message has; conditions may hold in none."""
    found = set()
    for row in vectors:
        message = plan.message(row["message"])
        values = Codec(plan).decode_as(message, wire(row), wire(row, "request")).beside
        absent = {
            part.name
            for each in message.envelope.conditional
            for part in each.parts
            if each.length is None and not all(test.holds(values[test.value]) for test in each.tests)
        }
        found |= {(message.name, part.name) for part in message.envelope.parts if part.name not in absent}
    return found


def _frame(plan: Plan, message: MessagePlan) -> FramePlan:
    """The longest kind of frame of a message."""
    return message.frames[-1] if message.frames else plan.frame


def _expected(plan: Plan, message: MessagePlan, part: Part, *, first: bool) -> set[str]:
    """Kinds of which a part has a fault; empty if it needs none. `first`: of the messages of a direction."""
    end = _frame(plan, message).end
    match part:
        case ConstantPart() if isinstance(end, ByTerminator) and end.part == part:
            return {"truncated"}
        case IdPart() if plan.frame.kinds and not message.envelope.preamble:
            return (
                {"frame"} if first else set()
            )  # of several kinds, only a known number begins one without a constant
        case ConstantPart() | IdPart():
            return {KINDS[type(part)]} if first else set()
        case LengthPart():
            return {"length", "truncated"} if first else set()
        case CheckPart() | MarkPart():
            return {KINDS[type(part)]}
        case AddressPart():
            every = message.allowed is None or message.allowed.ranges[0].high == part.integer.maximum
            return set() if every else {"range"}
        case _:
            return set()


def test_a_wrong_part_is_the_only_one() -> None:
    """In the frame without stuffing; the check value is computed over the wrong part."""
    for plan, message, row in rows("faults"):
        part = next(each for each in message.envelope.parts if each.name == row["part"])
        coding = _frame(plan, message).transparency
        if isinstance(coding, FrameStuffing | PayloadStuffing | SevenBit):
            continue
        if isinstance(coding, Coded) and coding.encode(wire(row)) != wire(row):
            continue  # some bytes of it are sent as others
        if not isinstance(part, ConstantPart | CheckPart) or row["kind"] in {"truncated", "length"}:
            continue
        envelope = message.envelope
        cells = _cut(envelope, wire(row)) | dict(message.message.seeds)
        wrong = {
            each.name
            for each in envelope.parts
            if not envelope.absent(each, cells)
            if (isinstance(each, ConstantPart) and cells[each.name] != each.data)
            or (isinstance(each, CheckPart) and cells[each.name] != checked(plan, message, each, cells, row))
        }
        assert wrong == {part.name}, (plan.protocol.name, row)


def _cut(envelope: Envelope, frame: bytes) -> dict[str, bytes]:
    """The bytes of each part of a frame that is not stuffed, b"" for one that it does not have."""
    cells: dict[str, bytes] = {}
    for each in envelope.parts:
        at = sum(map(len, cells.values()))
        rest = [part for part in envelope.back if not envelope.absent(part, cells)]
        size = (
            len(frame) - at - sum(part.size for part in rest) if isinstance(each, PayloadPart) else each.size
        )
        cells[each.name] = b"" if envelope.absent(each, cells) else frame[at : at + size]
    return cells


def checked(plan: Plan, message: MessagePlan, part: CheckPart, cells: Mapping[str, bytes], row: Row) -> bytes:
    return part.check.pack(Codec(plan).check_value(part, message.envelope, cells, wire(row, "request")))


def test_a_frame_is_cut_everywhere() -> None:
    """The first message of each direction is cut after every number of bytes that is not a frame."""
    for plan, document in written():
        module = module_of(plan)
        begun: set[str] = set()
        for message in plan.messages:
            if message.direction in begun:
                continue
            begun.add(message.direction)
            whole = next(row for row in document["vectors"] if row["message"] == message.name)
            wrong = {row["wire"] for row in document["faults"] if row["message"] == message.name}
            for size in range(len(wire(whole))):
                cut = {**whole, "wire": whole["wire"][: 2 * size]}
                if cut["wire"] not in wrong:
                    decoded(module, plan, message, cut)


def test_faults_of_one_command_are_those_of_its_outputs() -> None:
    """An id that a fault changes may be that of another command, which outputs of one command do not know."""
    protocol, options = load(find("cobs")), Options(only=("write",))
    (text,) = vectors.generate(protocol, options).values()
    module = python.load(protocol, options)
    for row in json.loads(text)["faults"]:
        with pytest.raises(module.DecodeError) as caught:
            getattr(module, f"decode_{row['message'].partition('.')[2]}")(wire(row))
        assert caught.value.kind == row["kind"]
