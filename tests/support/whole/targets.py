"""A common interface to the outputs of one schema, with raw values."""

from __future__ import annotations

import functools
import importlib
import sys
import types
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from decimal import Context, Decimal
from fractions import Fraction
from importlib.machinery import SourceFileLoader
from pathlib import Path
from typing import Any
from unittest import mock

from construct import ConstructError, RangeError

from qlinkgen.backends import construct
from qlinkgen.backends.base import Outputs
from qlinkgen.model import naming
from qlinkgen.model.message import Direction
from qlinkgen.plan import Plan
from qlinkgen.plan import receive as interpreted
from qlinkgen.plan.codec import Codec, Decoded
from qlinkgen.plan.content import Unsendable, pack
from qlinkgen.plan.reading import BadFrame
from qlinkgen.plan.receive import PacketReceiver as PlannedPackets
from qlinkgen.plan.receive import receiver
from tests.support.cdriver import Driver
from tests.support.whole.reference import Event, Raw, Reference, Seen, Wrong
from tests.support.whole.reference.frames import Frame
from tests.support.whole.reference.kinds import Kinds
from tests.support.whole.reference.layouts import (
    Message,
    Number,
    Record,
    Records,
    Run,
    Slot,
    Value,
    by_choice,
)
from tests.support.whole.reference.special import Packets
from tests.support.whole.reference.values import decode as decode_payload
from tests.support.whole.reference.values import default, holds

_EXACT = Context(prec=200)

_NONE: Mapping[str, Raw] = {}


@dataclass(frozen=True)
class Heard:
    """An event in a form common to all receivers; `place` is None if the receiver does not report it."""

    at: int
    kind: str
    name: str = ""
    address: int | None = None
    values: str = ""
    place: tuple[int, str] | None = None

    @classmethod
    def of(cls, event: Event) -> Heard:
        """An event of the reference."""
        shown = str(dict(event.values)) if event.kind == "message" else ""
        place = (event.offset, event.raw.hex()) if event.kind != "message" else None
        return cls(event.at, event.kind, event.name, event.address, shown, place)


class Target:
    """One output."""

    name = ""

    def __init__(self, reference: Reference) -> None:
        """`reference` has the layout of every message."""
        self.reference = reference

    def encode(
        self, message: Message, given: Mapping[str, Raw], address: int, request: bytes
    ) -> tuple[bytes, bytes]:
        """Payload and wire bytes. Raises only Wrong, if the output rejects the values."""
        raise NotImplementedError

    def decode(self, message: Message, wire: bytes, request: bytes) -> Seen:
        """Decode a frame. Raises only Wrong, if the output rejects it."""
        raise NotImplementedError

    def natives(self, message: Message, given: Mapping[str, Raw]) -> dict[str, Any]:
        """Values of the Python API."""
        return message.by_name({name: native(kind, given[name]) for name, kind in message.values()})

    def raws(self, message: Message, found: Callable[[str], Any]) -> dict[str, Raw]:
        """Raw values from values of the Python API."""
        return by_case(message, lambda name, kind: raw_of(kind, found(name)))


def by_case(message: Message, value: Callable[[str, Value], Raw]) -> dict[str, Raw]:
    """Raw values; those of a choice under the name of each case. `value` gives one by its name."""
    beside = {name: value(name, kind) for name, kind in message.beside}
    return beside | _slots_by_case(message.slots, value, beside)


def _slots_by_case(
    slots: Sequence[Slot], value: Callable[[str, Value], Raw], beside: Mapping[str, Raw] = _NONE
) -> dict[str, Raw]:
    found: dict[str, Raw] = {}
    for slot in slots:
        numbers = {name: raw for name, raw in {**beside, **found}.items() if isinstance(raw, int)}
        sent = not slot.choice or holds(slot, numbers)
        for name, kind in slot.values():
            found[name] = value(slot.choice or name, kind) if sent else None
    return found


def native(kind: Value, raw: Any) -> Any:
    """An int, bool, float or Decimal in the unit, bytes, text, lists, dicts for records; None if absent."""
    if raw is None:
        return None
    if isinstance(kind, Record):
        return by_choice(kind.slots, {name: native(each, raw[name]) for name, each in kind.values()})
    if isinstance(kind, Records):
        return [native(kind.record, each) for each in raw]
    if isinstance(kind, Run):
        if kind.item and isinstance(raw, list):
            return [native(kind.item, each) for each in raw]
        return bytes(raw).decode("ascii") if kind.text else raw
    assert isinstance(raw, int)
    exact = kind.native(raw)
    if isinstance(exact, float | str):
        return exact
    if kind.scale is None or not isinstance(exact, Fraction):
        return exact
    if kind.scale.denominator == kind.offset.denominator == 1:
        return int(exact)
    return (
        float(exact)
        if kind.bits <= 53
        else _EXACT.divide(Decimal(exact.numerator), Decimal(exact.denominator))
    )


def raw_of(kind: Value, found: Any) -> Raw:
    """The integer that represents a value. Raises TypeError or ValueError for a value without one."""
    if found is None:
        return None
    if isinstance(kind, Record):
        return _record_of(kind, found)
    if isinstance(kind, Records):
        return [_record_of(kind.record, each) for each in found]
    if isinstance(kind, Run):
        if kind.item:
            return [_number_of(kind.item, each) for each in found]
        return found.encode("ascii") if kind.text else bytes(found)
    return _number_of(kind, found)


def _number_of(kind: Number, found: Any) -> int:
    if kind.without is not None:
        return int.from_bytes(found.encode("ascii"), "big")
    if kind.real:
        if not isinstance(found, float):
            raise TypeError(f"{found!r} is of a wrong type")
        return kind.pattern(found)
    if kind.scale is None:
        if isinstance(found, bool) != kind.truth:
            raise TypeError(f"{found!r} is of a wrong type")
        return int(found)
    raw = round((Fraction(found) - kind.offset) / kind.scale)
    if found != native(kind, raw):
        raise ValueError(f"{found!r} is not exact")
    return raw


def told(kind: Value, raw: Any) -> Raw:
    """A raw value without what a NaN does not preserve."""
    if raw is None:
        return None
    if isinstance(kind, Record):
        return _told_record(kind, raw)
    if isinstance(kind, Records):
        return [_told_record(kind.record, each) for each in raw]
    if isinstance(raw, list):
        assert isinstance(kind, Run)
        return [kind.item.told(each) if kind.item else each for each in raw]
    return kind.told(raw) if isinstance(kind, Number) and isinstance(raw, int) else raw


def _told_record(kind: Record, raw: Mapping[str, Any]) -> dict[str, Raw]:
    return {name: told(each, raw[name]) for name, each in kind.values()}


def _record_of(kind: Record, found: Any) -> dict[str, Raw]:
    return _slots_by_case(kind.slots, lambda name, each: raw_of(each, member(found, name)))


def member(found: Any, name: str) -> Any:
    """A value of a record: an item of a mapping, or an attribute."""
    return found[name] if isinstance(found, Mapping) else getattr(found, naming.attribute(name))


def _chosen(kind: Value, raw: Any) -> Any:
    """A raw value with one for each choice in its records."""
    if isinstance(kind, Record) and raw is not None:
        return by_choice(kind.slots, {name: _chosen(each, raw[name]) for name, each in kind.values()})
    if isinstance(kind, Records) and raw is not None:
        return [_chosen(kind.record, each) for each in raw]
    return raw


def _divided(kind: Value, raw: Any) -> Raw:
    """A raw value with one for each case of the choices in its records."""
    if isinstance(kind, Record) and raw is not None:
        return _slots_by_case(kind.slots, lambda name, each: _divided(each, raw[name]))
    if isinstance(kind, Records) and raw is not None:
        return [_divided(kind.record, each) for each in raw]  # type: ignore[return-value]  # records alone
    return raw  # type: ignore[no-any-return]  # of the plan


class PythonTarget(Target):
    """The generated module."""

    name = "python"

    def __init__(self, reference: Reference, module: types.ModuleType) -> None:
        """Use an imported module."""
        super().__init__(reference)
        self.module: Any = module
        self._address = naming.address_attribute(reference.address_name or "")

    def encode(
        self, message: Message, given: Mapping[str, Raw], address: int, request: bytes
    ) -> tuple[bytes, bytes]:
        """See Target."""
        place = {self._address: address} if message.addresses else {}
        natives = {naming.attribute(name): each for name, each in self.natives(message, given).items()}
        try:
            made = self.module.MESSAGES[message.name](**self._objects(message.name, natives), **place)
            return made.to_bytes(), made.to_frame(*self._context(request))
        except self.module.EncodeError as error:
            raise Wrong("encode", str(error)) from None

    def _objects(self, name: str, natives: Mapping[str, Any]) -> dict[str, Any]:
        """Natives with an object for each record, whose class the annotations of the constructor name."""
        hints = self.module.MESSAGES[name].__init__.__annotations__
        return {key: self._object(hints[key], each) for key, each in natives.items()}

    def _object(self, hint: str, found: Any) -> Any:
        if isinstance(found, list):
            return [self._object(hint, each) for each in found]
        if not isinstance(found, dict):
            return found
        names = [each.removeprefix("list[").removesuffix("]") for each in hint.split(" | ")]
        classes = [getattr(self.module, each) for each in names if hasattr(self.module, each)]
        kinds = [each for each in classes if hasattr(each, "FIELDS")]
        fitting = {naming.attribute(name) for name in found}
        kind = next(each for each in kinds if set(each.FIELDS) == fitting)
        hints = kind.__init__.__annotations__
        inner = {naming.attribute(name): each for name, each in found.items()}
        return kind(**{key: self._object(hints[key], each) for key, each in inner.items()})

    def _context(self, request: bytes) -> Sequence[Any]:
        return (self.module.decode_request(request),) if request else ()

    def decode(self, message: Message, wire: bytes, request: bytes) -> Seen:
        """See Target."""
        if message.turned:
            return self._turned(message, wire)
        direction = self.reference.direction_of(message)
        function = getattr(self.module, "decode" if direction == "message" else f"decode_{direction}")
        try:
            return self._seen(function(wire, *self._context(request)))
        except self.module.DecodeError as error:
            raise Wrong(error.kind, str(error)) from None

    def _turned(self, message: Message, wire: bytes) -> Seen:
        try:
            return self._seen(self.module.MESSAGES[message.name].from_bytes(wire))
        except self.module.DecodeError as error:
            raise Wrong(error.kind, str(error)) from None

    def _seen(self, found: Any) -> Seen:
        shape = self.reference.by_name[found.NAME]
        values = self.raws(shape, lambda each: getattr(found, naming.attribute(each)))
        return Seen(found.NAME, getattr(found, self._address) if found.ADDRESS else None, values)

    def events(
        self, direction: Direction, pieces: Sequence[bytes], asked: Sequence[bytes] = ()
    ) -> list[list[Heard]]:
        """The events of each piece, then those at the end; `at` is the last byte of the piece."""
        decoder = self.module.StreamDecoder(*(() if direction == "message" else (direction,)))
        for request in asked:
            decoder.expect(self.module.decode_request(request))
        found, end = [], 0
        for piece in pieces:
            end += len(piece)
            found.append([self._heard(event, end - 1) for event in decoder.feed(piece)])
        return [*found, [self._heard(event, end) for event in decoder.finish()]]

    def _heard(self, event: Any, at: int) -> Heard:
        if hasattr(event, "NAME"):
            seen = self._seen(event)
            return Heard(at, "message", seen.name, seen.address, str(dict(seen.values)))
        return Heard(at, event.kind, place=(event.offset, event.raw.hex()))


class InterpreterTarget(Target):
    """The interpreter of the plan."""

    name = "interpreter"

    def __init__(self, reference: Reference, plan: Plan) -> None:
        """Run a plan."""
        super().__init__(reference)
        self._plan = plan
        self._codec = Codec(plan)

    def encode(
        self, message: Message, given: Mapping[str, Raw], address: int, request: bytes
    ) -> tuple[bytes, bytes]:
        """See Target."""
        place = address if message.addresses else None
        try:
            values = message.by_name({name: _chosen(kind, given[name]) for name, kind in message.values()})
            wire = self._codec.encode(message.name, values, place, request)
            return pack(self._plan.message(message.name).payload, values), wire
        except Unsendable as error:
            raise Wrong("encode", str(error)) from None

    def decode(self, message: Message, wire: bytes, request: bytes) -> Seen:
        """See Target."""
        try:
            return self._seen(self._codec.decode_as(self._plan.message(message.name), wire, request))
        except BadFrame as error:
            raise Wrong(error.kind, str(error)) from None

    def _seen(self, decoded: Decoded) -> Seen:
        found = decoded.values
        found = {**decoded.beside, **found}
        shape = self.reference.by_name[decoded.message.name]
        values = by_case(shape, lambda name, kind: told(kind, _divided(kind, found[name])))
        return Seen(shape.name, decoded.address, values)

    def events(self, direction: Direction, stream: bytes, asked: Sequence[bytes] = ()) -> list[Heard]:
        """The events of a stream."""
        machine = receiver(self._plan, direction)
        if isinstance(machine, PlannedPackets):
            for request in asked:
                machine.expect(request)
        return [self._heard(event) for event in machine.run(stream)]

    def _heard(self, event: interpreted.Event) -> Heard:
        if event.decoded is None:
            return Heard(event.at, event.kind, place=(event.offset, event.raw.hex()))
        seen = self._seen(event.decoded)
        return Heard(event.at, "message", seen.name, seen.address, str(dict(seen.values)))


class ConstructTarget(Target):
    """Construct structures, live or as printed."""

    def __init__(self, reference: Reference, name: str, live: construct.Live) -> None:
        """`name` distinguishes the two."""
        super().__init__(reference)
        self.name = name
        self._live = live

    def encode(
        self, message: Message, given: Mapping[str, Raw], address: int, request: bytes
    ) -> tuple[bytes, bytes]:
        """See Target."""
        natives = self.natives(message, given)
        beside = {naming.record_key(name): natives.pop(name) for name, _ in message.beside}
        whole: dict[str, Any] = {"message": message.name, **beside, "fields": natives}
        if self.reference.address_name:
            whole[naming.record_key(self.reference.address_name)] = address
        try:
            if message.turned:
                return (self._live.payload(message.name, natives),) * 2
            frame = self._live.frames[self.reference.direction_of(message)]
            return self._live.payload(message.name, natives, beside), frame.build(whole, request=request)
        except ConstructError as error:
            raise Wrong("encode", str(error)) from None

    def decode(self, message: Message, wire: bytes, request: bytes) -> Seen:
        """See Target."""
        if message.turned:
            return self._turned(message, wire)
        try:
            found = self._live.parse(self.reference.direction_of(message), wire, request)
        except ConstructError as error:
            raise Wrong(getattr(error, "kind", ""), str(error)) from None
        message = self.reference.by_name[found["message"]]
        fields = {**found["fields"], **{name: found[naming.record_key(name)] for name, _ in message.beside}}
        values = self.raws(message, lambda each: fields[each])
        name = self.reference.address_name
        return Seen(found["message"], found.get(naming.record_key(name)) if name else None, values)

    def _turned(self, message: Message, wire: bytes) -> Seen:
        try:
            fields = self._live.messages[message.name].parse(wire)
        except RangeError as error:
            raise Wrong("length", str(error)) from None
        except ConstructError as error:
            raise Wrong(getattr(error, "kind", "range"), str(error)) from None
        return Seen(message.name, None, self.raws(message, lambda each: fields[each]))


def printed_structures(outputs: Outputs, folder: Path) -> construct.Live:
    """The structures of the printed module."""
    return construct.Live(vars(_printed(folder / "printed_structures", outputs)))


def printed_codec(outputs: Outputs, folder: Path) -> types.ModuleType:
    """The printed module, imported with its bus module."""
    return _printed(folder / "printed_codecs", outputs)


def _printed(package: Path, outputs: Outputs) -> types.ModuleType:
    """The first module of a package, after importing all of its modules."""
    package.mkdir()
    for path, text in outputs.items():
        (package / Path(path).name).write_text(text, "utf-8")
    names = [Path(path).stem for path in outputs if path.endswith(".py") and Path(path).name[0] != "_"]
    sys.path.insert(0, str(package.parent))
    importlib.invalidate_caches()
    try:
        with mock.patch.object(SourceFileLoader, "get_code", _code):
            modules = [importlib.import_module(f"{package.name}.{name}") for name in names]
        return modules[0]
    finally:
        sys.path.remove(str(package.parent))
        for each in [each for each in sys.modules if each.split(".")[0] == package.name]:
            del sys.modules[each]


@functools.lru_cache(maxsize=200)
def compiled(source: bytes, name: str) -> types.CodeType:
    """The code of a module; most support modules are the same for many schemas."""
    return compile(source, name, "exec")


def _code(loader: SourceFileLoader, module: str) -> types.CodeType:
    """The code of an imported module."""
    path = Path(loader.get_filename(module))
    return compiled(path.read_bytes(), path.name)


class CTarget(Target):
    """A compiled header, called through the driver program."""

    name = "c"

    def __init__(self, reference: Reference, driver: Driver) -> None:
        """`driver` is running."""
        super().__init__(reference)
        self._driver = driver
        frame = reference.frame
        #: Only receivers with look-back have events at the end of a stream.
        self.finishes = isinstance(frame, Kinds) or (isinstance(frame, Frame) and not frame.unique)

    def encode(
        self, message: Message, given: Mapping[str, Raw], address: int, request: bytes
    ) -> tuple[bytes, bytes]:
        """See Target."""
        place: object = request.hex() if request else address if self.reference.address_name else "-"
        payload, wire = self._ask(
            "encode",
            message.name,
            place,
            *_message_words(message, given),
        )
        return _bytes(payload), _bytes(wire)

    def decode(self, message: Message, wire: bytes, request: bytes) -> Seen:
        """See Target."""
        context = (request.hex(),) if request and isinstance(self.reference.frame, Packets) else ()
        address, *found = self._ask("decode", message.name, wire.hex() or "-", *context)
        words = iter(found)
        values: dict[str, Raw] = {name: told(kind, _raw(kind, words)) for name, kind in message.beside}
        values |= _raw_slots(message.slots, words, values)
        assert not list(words)
        return Seen(message.name, int(address) if message.addresses else None, values)

    def events(self, direction: Direction, stream: bytes) -> list[Heard]:
        """The events of a stream fed byte by byte."""
        return [self._heard(word) for word in self._ask("stream", direction, stream.hex() or "-")]

    def _heard(self, word: str) -> Heard:
        at, kind, *rest = word.split(":")
        if kind != "message":
            return Heard(int(at), kind)
        name, address, *numbers, payload = rest
        message = self.reference.by_name[name]
        pairs = zip(message.beside, numbers, strict=True)
        beside = {each: _raw(kind, iter((word,))) for (each, kind), word in pairs}
        try:
            values = str({**beside, **decode_payload(message, _bytes(payload), beside)})
        except Wrong as wrong:
            values = f"{payload}, which is refused: {wrong}"
        return Heard(int(at), kind, name, int(address) if message.addresses else None, values)

    def _ask(self, *words: object) -> list[str]:
        status, *answer = self._driver.ask(*words).split()
        if status == "error":
            raise Wrong(answer[0])
        assert status == "ok", (status, words)
        return answer


def _message_words(message: Message, given: Mapping[str, Any]) -> Iterator[str]:
    """The words of all values; a field that may be absent has one more, which tells whether it is present."""
    for name, number in message.beside:
        yield from _words(number, given[name])
    yield from _slot_words(message.slots, given)


def _slot_words(slots: Sequence[Slot], given: Mapping[str, Any]) -> Iterator[str]:
    for slot in slots:
        values = slot.values()
        if slot.choice:
            for name, kind in values:
                yield from _words(kind, given[name]) if given[name] is not None else ()
            continue
        if slot.conditional and values:
            yield str(int(given[values[0][0]] is not None))
        for name, kind in values:
            raw = given[name]
            yield from _words(kind, default(kind) if raw is None else raw)


def _words(kind: Value, raw: Any) -> Iterator[str]:
    """The words of a value: one, those of a record, or the number of records and those of each."""
    if isinstance(kind, Record):
        yield from _slot_words(kind.slots, raw)
    elif isinstance(kind, Records):
        yield str(len(raw))
        for record in raw:
            yield from _words(kind.record, record)
    elif isinstance(kind, Run) and kind.pad:
        yield raw.ljust(kind.most, kind.pad).hex()
    elif isinstance(kind, Number) and kind.without is not None:
        yield raw.to_bytes(kind.bits // 8, "big").hex()
    elif isinstance(raw, int):
        yield str(raw)
    else:
        yield (raw.hex() if isinstance(raw, bytes) else ",".join(map(str, raw))) or "-"


def _raw(kind: Value, words: Iterator[str]) -> Raw:
    if isinstance(kind, Record):
        return _raw_record(kind, words)
    if isinstance(kind, Records):
        return [_raw_record(kind.record, words) for _ in range(int(next(words)))]
    word = next(words)
    if isinstance(kind, Number) and kind.without is not None:
        return int(word, 16)
    if isinstance(kind, Number):
        raw = int(word, 0)
        return raw - (1 << 128) if kind.signed and word.startswith("0x") and raw >> 127 else raw
    if kind.item is None:
        return _bytes(word).rstrip(kind.pad) if kind.pad else _bytes(word)
    return [int(each) for each in word.split(",")] if word != "-" else []


def _raw_record(kind: Record, words: Iterator[str]) -> dict[str, Raw]:
    return _raw_slots(kind.slots, words)


def _raw_slots(
    slots: Sequence[Slot], words: Iterator[str], beside: Mapping[str, Raw] = _NONE
) -> dict[str, Raw]:
    values: dict[str, Raw] = {}
    for slot in slots:
        if slot.choice:
            known = {**beside, **values}
            sent = holds(slot, {name: raw for name, raw in known.items() if isinstance(raw, int)})
            values |= {name: told(kind, _raw(kind, words)) if sent else None for name, kind in slot.values()}
            continue
        absent = slot.conditional and slot.values() and next(words) == "0"
        read = {name: told(kind, _raw(kind, words)) for name, kind in slot.values()}
        values |= dict.fromkeys(read) if absent else read
    return values


def _bytes(word: str) -> bytes:
    return b"" if word == "-" else bytes.fromhex(word)
