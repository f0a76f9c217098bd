"""Test vectors: for every message several sets of values with their bytes, and frames with one wrong part.

`choice` selects the values, `faults` the errors. The interpreter of the plan computes the bytes and the kind
of every fault.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence

from qlinkgen.backends.base import Options, Outputs, banner
from qlinkgen.backends.vectors import choice, writer
from qlinkgen.backends.vectors.choice import Chance
from qlinkgen.backends.vectors.faults import Faults, Good
from qlinkgen.backends.vectors.writer import Json
from qlinkgen.model.fields import chosen
from qlinkgen.model.message import Direction, Example
from qlinkgen.model.naming import record_key
from qlinkgen.model.protocol import Protocol
from qlinkgen.model.values import to_json
from qlinkgen.plan import MessagePlan, plan_of
from qlinkgen.plan.codec import Codec
from qlinkgen.plan.content import Raw, pack
from qlinkgen.plan.natives import native_of
from qlinkgen.plan.payload import ItemsStep, Member, PayloadPlan, RecordsStep, RecordStep, ValueStep
from qlinkgen.plan.walk import of_values

__all__ = ["KINDS", "generate"]

#: Kinds of vectors of every message. Kinds with the same bytes share a line.
KINDS = ("defaults", "minimum", "maximum", "a5", "random1", "random2")
#: Kind of a frame of the source document.
EXAMPLE = "example"
_RULES = {"minimum": choice.MINIMUM, "maximum": choice.MAXIMUM, "a5": choice.A5}


def generate(protocol: Protocol, options: Options) -> Outputs:
    """The vectors of a protocol: path below the output folder to text."""
    kept = plan_of(protocol, Options(only=options.only))
    vectors = _Vectors(protocol, Codec(kept) if options.only else None)
    good = {message.name: vectors.of(message) for message in kept.messages}
    head: dict[str, Json] = {"about": banner(protocol), "protocol": protocol.name}
    rows = (row for each in good.values() for row in vectors.rows(each))
    text = writer.document(head, {"vectors": rows, "faults": vectors.faults(good.values())})
    return {f"vectors/{protocol.name}.json": text}


class _Vectors:
    """Makes the vectors of one protocol's messages."""

    def __init__(self, protocol: Protocol, kept: Codec | None) -> None:
        self._protocol, self._kept = protocol, kept
        # A response may be selected without its request, which its packet depends on.
        self._codec = Codec(plan_of(protocol))

    def of(self, message: MessagePlan) -> dict[str, Good]:
        """The vectors of a message by kind, and those of the document."""
        examples = self._examples(message, decode_only=False)
        return {kind: self._one(message, kind) for kind in KINDS} | {
            f"{EXAMPLE}{number}": self._example(message, each) for number, each in enumerate(examples, 1)
        }

    def _examples(self, message: MessagePlan, *, decode_only: bool) -> list[Example]:
        of_message = (each for each in self._protocol.examples if each.message == message.name)
        return [each for each in of_message if each.decode_only == decode_only]

    def _example(self, message: MessagePlan, example: Example) -> Good:
        found = self._codec.decode_as(message, example.wire, example.after)
        values, beside = dict(found.values), dict(found.beside)
        payload = pack(message.payload, {**values, **beside})
        return Good(message, found.address, values, beside, payload, example.wire, example.after)

    def _one(self, message: MessagePlan, kind: str) -> Good:
        chance = Chance(f"{self._protocol.name} {message.name} {kind}")
        decided = bool(message.payload.decided_by)
        beside = _beside(message, kind, chance) if decided else {}
        values = _values(message, kind, chance, beside)
        address = _address(message, kind, chance)
        beside = beside if decided else _beside(message, kind, chance)
        request = self._request(message, kind)
        wire = self._codec.encode(message.name, {**values, **beside}, address, request)
        if message.asked:
            request = self._asking(message, kind, wire)
        payload = pack(message.payload, {**values, **beside})
        return Good(message, address, values, beside, payload, wire, request)

    def _request(self, message: MessagePlan, kind: str) -> bytes:
        """The request of a response, b"" if its frame does not depend on it."""
        if not self._codec.plan.frame.needs_request or message.direction != "response":
            return b""
        return self._one(self._codec.plan.message(f"{message.message.command}.request"), kind).wire

    def _asking(self, message: MessagePlan, kind: str, wire: bytes) -> bytes:
        """A request by which the frame of an answer is told from others, b"" if there is none."""
        plan, told = self._codec.plan, self._codec.decode
        asked = [
            name for name, answers in plan.asked.items() if message.name in (each.name for each in answers)
        ]
        requests = (self._one(plan.message(name), kind).wire for name in asked)
        found = (each for each in requests if told(wire, "response", each).message.name == message.name)
        return next(found, b"")

    def faults(self, messages: Iterable[Mapping[str, Good]]) -> Iterator[Mapping[str, Json]]:
        """The wrong frames; those of all messages only for the first of each direction and shape of frame.

        A shape is a kind of frame, and which of the parts with conditions are not sent.
        """
        faults = Faults(self._codec, self._kept)
        begun: set[tuple[Direction, str, tuple[str, ...]]] = set()
        for good in messages:
            if good["defaults"].message.asked and not self._codec.plan.is_first(good["defaults"].message):
                continue  # wrong ones may be other answers
            shapes = {(each.frame.name, faults.absent(each)): each for each in reversed([*good.values()])}
            for shape, one in shapes.items():
                place = one.message.direction, *shape
                yield from (bad.entry() for bad in faults.of(one, first=place not in begun))
                begun.add(place)

    def rows(self, vectors: Mapping[str, Good]) -> Iterator[Mapping[str, Json]]:
        """The lines of a message in the file, one for each distinct frame."""
        kinds: dict[tuple[bytes, bytes], list[str]] = {}
        for kind, good in vectors.items():
            if good.message.asked and not good.request:
                continue  # it is another answer
            kinds.setdefault((good.request, good.wire), []).append(kind)
        for same in kinds.values():
            yield self._row(same, vectors[same[0]])
        message = vectors["defaults"].message
        for each in self._examples(message, decode_only=True):
            yield self._row([EXAMPLE], self._example(message, each)) | {"decode_only": True}

    def _row(self, kinds: list[str], good: Good) -> dict[str, Json]:
        named = dict.fromkeys(kind if kind in KINDS else EXAMPLE for kind in kinds)
        row: dict[str, Json] = {"message": good.message.name, "kinds": [*named]}
        if good.address is not None:
            row[record_key(self._codec.plan.frame.address)] = good.address
        steps = {member.name: member for _, member in good.message.envelope.values}
        for value in self._protocol.beside(good.message.message):
            row[record_key(value.name)] = to_json(
                value, native_of(steps[value.name], good.beside[value.name])
            )
        row |= _shown(good)
        if good.request:
            row["request"] = good.request.hex()
        return row | {"payload": good.payload.hex(), "wire": good.wire.hex()}


def _shown(good: Good) -> Mapping[str, Json]:
    """Decoded values, and raw integers where they differ."""
    fields: dict[str, Json] = {}
    raw: dict[str, Json] = {}
    pairs = dict(zip(good.message.message.values, good.message.payload.settable, strict=True))
    for value in chosen(pairs, {**good.beside, **good.values}.get):
        step, number = pairs[value], good.values[value.name]
        shown = fields[value.name] = to_json(value, native_of(step, number))
        if isinstance(step, RecordStep | RecordsStep):
            if _has_other_raws(step.record.payload):
                raw[value.name] = _numbers(step, number)
        elif _differs(shown, number):
            raw[value.name] = number
    return {"fields": fields, "raw": raw} if raw else {"fields": fields}


def _differs(shown: Json, raw: Raw) -> bool:
    """Whether the JSON value of a number, or of an item of a list, is not its raw integer."""
    if isinstance(raw, list):
        assert isinstance(shown, list)
        return any(map(_differs, shown, raw))
    return isinstance(raw, int) and (type(shown) is not int or shown != raw)


def _has_other_raws(plan: PayloadPlan) -> bool:
    """Whether numbers of a record are not shown as raw integers."""
    return any(
        _has_other_raws(each.record.payload)
        if isinstance(each, RecordStep | RecordsStep)
        else isinstance(each, ValueStep | Member | ItemsStep)
        and (each.number.scaling is not None or each.number.meaning is not None)
        for each in plan.settable
    )


def _numbers(step: RecordStep | RecordsStep, raw: Raw) -> Json:
    """The raw numbers of records."""
    if raw is None:
        return None
    if isinstance(raw, Mapping):
        return _numbers_of(step.record.payload, raw)
    assert isinstance(raw, Sequence)
    return [_numbers_of(step.record.payload, each) for each in raw if isinstance(each, Mapping)]


def _numbers_of(plan: PayloadPlan, raw: Mapping[str, Raw]) -> Json:
    found: dict[str, Json] = {}
    for name, (each, value) in of_values(plan, raw).items():
        if isinstance(each, RecordStep | RecordsStep):
            found[name] = _numbers(each, value)
        elif isinstance(each, ItemsStep) and value is not None:
            assert isinstance(value, list)
            found[name] = value
        elif isinstance(value, int):
            found[name] = value
    return found


def _values(message: MessagePlan, kind: str, chance: Chance, beside: Mapping[str, Raw]) -> dict[str, Raw]:
    """The values of a payload in a frame with the values ``beside``."""
    if kind == "defaults":
        return choice.defaults(message.payload)
    return (_RULES.get(kind) or choice.random(chance)).values(message.payload, beside)


def _beside(message: MessagePlan, kind: str, chance: Chance) -> dict[str, Raw]:
    """The values of a frame."""
    if kind == "defaults":
        return {member.name: member.number.default for _, member in message.envelope.values}
    return (_RULES.get(kind) or choice.random(chance)).beside(message.envelope)


def _address(message: MessagePlan, kind: str, chance: Chance) -> int | None:
    if message.allowed is None:
        return None
    ranges = message.allowed.ranges
    if kind.startswith("random"):
        some = ranges[chance.between(0, len(ranges) - 1)]
        return chance.between(some.low, some.high)
    given = {"minimum": ranges[0].low, "maximum": ranges[-1].high}
    return given.get(kind, message.message.default_address)
