"""Second pass, kinds of frame: builds several frames, and checks that receivers can tell them apart."""

from __future__ import annotations

import itertools
from collections.abc import Iterator, Sequence
from dataclasses import replace

from qlinkgen.model.frame import DelimitedFrame, Direction, FrameKind, FrameKinds, Part, PartBits
from qlinkgen.model.message import Message
from qlinkgen.schema.file_model import SchemaFile
from qlinkgen.schema.frames import FrameBuilder
from qlinkgen.schema.kind_names import named_kinds
from qlinkgen.schema.layouts import own_steps
from qlinkgen.schema.part_directions import stated_direction
from qlinkgen.schema.report import Reporter
from qlinkgen.schema.source import Path

_RULE = "bad-kinds"
#: Size up to which only answers may have a frame without a check value.
_SHORT = 2


def build_kinds(file: SchemaFile, builder: FrameBuilder, report: Reporter) -> FrameKinds | None:
    """The kinds of frame; kinds that no message names are one family. None after an error."""
    if "frame" in file.model_fields_set:
        what, hint = "the protocol has a frame and kinds of frame", "write its frame as one of the kinds"
        report.error(_RULE, ("frames",), what, hint, of_key=True)
    built = list(_built(file, builder, report))
    if len(built) < len(file.frames) or report.failed:
        report.taint(("frame",))
    if len(built) < len(file.frames):
        return None
    named = {name for name, _ in named_kinds(file)}
    ways = [(name, frame, way) for name, frame, only in built for way in _ways(frame, only)]
    families = list(dict.fromkeys((name if name in named else "", way) for name, _, way in ways))
    steps = sum(1 for name, spec in file.commands.items() for _ in own_steps(name, spec))
    steps += sum(1 for spec in file.commands.values() if spec.steps is None and spec.response != "none")
    kinds = FrameKinds(
        tuple(
            FrameKind(
                name,
                frame.towards(way) if way else frame,
                families.index((name if name in named else "", way)),
                way,
                f"{name}_{way}" if frame.directed else "",
            )
            for name, frame, way in ways
        ),
        steps if any(frame.is_payload for _, frame, _ in built) else 0,
    )
    checker = _Checker(report)
    for name, frame, _ in built:
        checker.kind(name, frame)
    checker.addresses(kinds.kinds)
    checker.values(kinds.kinds)
    checker.titles(kinds.kinds)
    checker.shared([each for each in kinds.kinds if each.name not in named])
    for family in range(len(families)):
        checker.family([each for each in kinds.kinds if each.family == family])
    return kinds


def begun(kinds: FrameKinds, messages: list[Message], report: Reporter) -> FrameKinds:
    """The kinds, of which those that begin with the message id know its numbers; checks how they begin.

    A kind with parts of one direction is none in the other if that has no messages.
    """
    found = []
    for kind in kinds.kinds:
        if kind.own and not any(kind in kinds.carrying(each.id) for each in messages):
            continue
        if kind.frame.leading is not None:
            first = replace(kind.frame.leading, numbers=_leading(kinds, kind, messages))
            kind = replace(kind, frame=replace(kind.frame, parts=(first, *kind.frame.parts[1:])))  # noqa: PLW2901
        found.append(kind)
    checker = _Checker(report)
    checker.starts(found)
    checker.inserted(found)
    return replace(kinds, kinds=tuple(found))


def _leading(kinds: FrameKinds, kind: FrameKind, messages: list[Message]) -> tuple[int, ...]:
    """The numbers that the first part of a kind may have: ids, addresses, or those of its bits."""
    first, base = kind.frame.parts[0], kinds.base(kind.family)
    carried = {(each.id - base, each.addresses) for each in messages if kind in kinds.carrying(each.id)}
    if first.bits == kind.frame.id_bits:
        return tuple(sorted({number for number, _ in carried}))
    if first.size > 1 or first.scalar is None:
        return ()
    numbers = range(first.scalar.integer.mask + 1)
    return tuple(each for each in numbers if any(_begins(first.bits, each, *one) for one in carried))


def _begins(bits: tuple[PartBits, ...], byte: int, number: int, addresses: Sequence[tuple[int, int]]) -> bool:
    """Whether the first byte of the frame of a message, with its id and addresses, may be this one."""
    for each in bits:
        value = (byte & each.mask) >> each.shift
        if each.is_id and value != number >> each.at & (1 << each.bits) - 1:
            return False
        if each.role == "constant" and value not in each.constants:
            return False
        if each.role == "address" and not any(first <= value <= last for first, last in addresses):
            return False
    return True


def _built(
    file: SchemaFile, builder: FrameBuilder, report: Reporter
) -> Iterator[tuple[str, DelimitedFrame, Direction | None]]:
    """The kinds with their names, and the direction that each has as a whole."""
    for name, spec in file.frames.items():
        frame, only, place = builder.kind(name, spec), None, ("frames", name, "if")
        if spec.when is not None:
            only = stated_direction(spec.when, f"which frames are {name}", place, report)
        if frame and frame.directed and only:
            what = f"{name} and parts of it are only in one direction"
            report.error(_RULE, place, what, "remove one of the conditions", of_key=True)
        if frame is not None:
            yield name, frame, only


def _ways(frame: DelimitedFrame, only: Direction | None) -> Sequence[Direction | None]:
    """The directions for which a kind is one of its own: both if parts of it are only in one of them."""
    return frame.ways if frame.directed else (only,)


def family_frame(kinds: FrameKinds, family: int) -> DelimitedFrame:
    """The largest frame of a family, with a payload of any size that one of its kinds has."""
    members = [each.frame for each in kinds.kinds if each.family == family]
    largest = max(members, key=lambda frame: frame.payload.max_size)
    payload = replace(largest.payload, min_size=min(each.payload.min_size for each in members))
    return replace(largest, parts=tuple(payload if p is largest.payload else p for p in largest.parts))


def check_used(file: SchemaFile, kinds: FrameKinds, messages: list[Message], report: Reporter) -> None:
    """Check that each kind carries a message, and which kinds only answers or steps may have."""
    steps = {f"{name}.{step.name}" for name, spec in file.commands.items() for step in own_steps(name, spec)}
    used = {each.name for message in messages for each in kinds.carrying(message.id)}
    _check_repeated(kinds, messages, report)
    for name in dict.fromkeys(each.name for each in kinds.kinds):
        if name not in used:
            what = f"no message has frame: {name}"
            hint = "remove it, or let a message name it"
            report.error(_RULE, ("frames", name), what, hint, of_key=True, needs=(("commands",),))
    for kind in kinds.kinds:
        carried = [each for each in messages if kind in kinds.carrying(each.id)]
        for message in carried:
            response = f"{message.command}.response"
            if kind.frame.is_payload and message.name not in steps and message.name != response:
                what = f"{message.name} is neither a response nor a step, and nothing but its turn tells"
                what += f" a frame of {kind.name}"
                hint = "let only responses and steps have this kind, or begin it with a constant or the"
                hint += " message id"
                report.error(_RULE, ("frames", kind.name), what, hint, of_key=True)
        _check_asking(kinds, kind, [each for each in carried if each.direction != "response"], report)


def _check_asking(kinds: FrameKinds, kind: FrameKind, asking: list[Message], report: Reporter) -> None:
    """Check that a kind may carry messages that are not answers."""
    path: Path = ("frames", kind.name)
    for message in asking if kinds.address and not kind.frame.address else ():
        what = f"{message.name} is not an answer, and its frame has no address, which other kinds have"
        hint = "let only responses and replies have this kind, or give it the address"
        report.error(_RULE, path, what, hint, of_key=True)
    size = sum(part.size for part in kind.frame.parts) + kind.frame.payload.max_size
    proven = kind.frame.part("checksum") or kind.frame.complemented or kind.frame.is_payload
    for message in asking if size <= _SHORT and not proven else ():
        counted = f"{size} byte{'s' if size > 1 else ''}"
        what = f"{message.name} is not an answer, and its frame of {counted} has no check value"
        hint = "any byte of noise may be one; only a response or a reply has such a frame, or one "
        hint += "that is a byte and its complement"
        report.error("short-frame", path, what, hint, of_key=True)


def _check_repeated(kinds: FrameKinds, messages: list[Message], report: Reporter) -> None:
    """Check that requests have the counter that their answers repeat."""
    requests = [each for each in messages if each.name == f"{each.command}.request"]
    for answer in (each for each in messages if each.echoed):
        own = [each for each in requests if each.command == answer.command]
        for request in own or requests:
            kind = kinds.carrying(request.id)[0]
            if kind.frame.counter is None:
                what = f"{answer.name} repeats {answer.echoed[0]}, which {request.name} does not have"
                hint = f"add the counter to the frame {kind.name}, or remove echo"
                report.error(_RULE, ("frames", kind.name), what, hint, of_key=True)


class _Checker:
    """Checks what all back-ends rely on."""

    def __init__(self, report: Reporter) -> None:
        self._report = report

    def _error(self, path: Path, what: str, hint: str) -> None:
        self._report.error(_RULE, path, what, hint, of_key=True, needs=(path[:2],))

    def kind(self, name: str, frame: DelimitedFrame) -> None:
        """Check that a kind has only what kinds may have."""
        path: Path = ("frames", name, "parts")
        first = frame.parts[0].name
        if frame.leading is not None:
            if frame.leading.role == "address" and frame.leading.size > 1:
                bits = frame.leading.bits[0].bits
                what = f"{name} begins with {first} of {bits} bits, one of too many numbers"
                self._error((*path, first), what, "begin it with a constant, or an address of one byte")
            if frame.part("terminator"):
                told = {"message": "its message id", "address": "its address"}
                what = f"{name} begins with {told.get(frame.leading.role, first)} and ends with a terminator"
                self._error((*path, first), what, "begin it with a constant, or give it a length")
        elif not frame.preamble and not frame.is_payload:
            what = f"{name} begins with {first}, not with constant bytes"
            hint = "begin it with a constant that tells it from other kinds, with its message id or address, "
            hint += "or with a byte of which constants or a piece of the id tell it"
            self._error((*path, first), what, hint)
        if frame.idle:
            what = (
                f"a break begins frames of {name}"
                if frame.idle.broken
                else f"an idle line ends frames of {name}"
            )
            self._error(path, what, "remove it; a length or the message gives the end of a kind of frame")
        end = frame.part("terminator")
        if end is not None and end.constant == frame.preamble:
            what = f"{name} begins with the bytes that end it"
            self._error((*path, end.name), what, "let it begin with other bytes")
        if frame.coding and first in frame.coded:
            what = f"{first} of {name} is coded, but receivers tell kinds by the first bytes as sent"
            hint = f"name the coded parts, without {first}: over: [...]"
            self._error((*path[:-1], "coding"), what, hint)
        for part in frame.parts:
            if wrong := _excess(part):
                what = f"{part.name} of {name} {wrong}, which kinds of frame do not have"
                hint = "remove it, or describe the kind in a file of its own"
                self._error((*path, part.name), what, hint)

    def starts(self, kinds: Sequence[FrameKind]) -> None:
        """Check that no kind begins like another whose frames go the same direction."""
        for index, kind in enumerate(kinds):
            for other in kinds[:index]:
                if kind.only and other.only and kind.only != other.only:
                    continue
                pairs = itertools.product(kind.frame.starts, other.frame.starts)
                alike = (each for each in pairs if each[0].startswith(each[1]) or each[1].startswith(each[0]))
                if (same := next(alike, None)) is not None:
                    first, second = (each.hex(" ").upper() for each in same)
                    what = f"{kind.name} begins with {first}, {other.name} with {second}"
                    led = {each.role for each in (kind.frame.leading, other.frame.leading) if each}
                    words = {"message": "ids", "address": "addresses", "bits": "bits"}
                    others = ["constants", *sorted(words[each] for each in led)]
                    hint = f"a receiver cannot tell them apart; use other {' or '.join(others)}"
                    self._error(("frames", kind.name), what, hint)

    def inserted(self, kinds: Sequence[FrameKind]) -> None:
        """Check that no kind begins with the byte that may follow the last one of a frame."""
        for kind, other in itertools.product(kinds, kinds):
            insert = other.frame.late_insert
            apart = kind.only and other.only and kind.only != other.only
            if insert is not None and not apart and any(each[0] == insert for each in kind.frame.starts):
                what = f"{kind.name} begins with {insert:02X}, the byte inserted into {other.name}"
                what += ", which may follow its last one"
                hint = f"begin it with another byte, or do not code the last part of {other.name}"
                self._error(("frames", kind.name), what, hint)

    def addresses(self, kinds: Sequence[FrameKind]) -> None:
        """Check that the address is the same in all kinds that have one."""
        having = [(kind, kind.frame.address) for kind in kinds if kind.frame.address]
        for kind, address in having[1:]:
            first = having[0][1]
            assert first is not None
            assert address is not None
            if (address.name, address.bits) != (first.name, first.bits):
                what = f"the address of {kind.name} is {address.name} of {address.bits} bits, "
                what += f"that of {having[0][0].name} {first.name} of {first.bits}"
                self._error(("frames", kind.name), what, "give both the same name and size")

    def values(self, kinds: Sequence[FrameKind]) -> None:
        """Check that kinds have the same values under one name, and cover the same attributes."""
        known: dict[str, tuple[FrameKind, PartBits]] = {}
        for kind in kinds:
            path: Path = ("frames", kind.name)
            for bits in (each for part in kind.frame.parts for each in part.bits if each.type):
                other, same = known.setdefault(bits.name, (kind, bits))
                if (bits.type, bits.counting) != (same.type, same.counting):
                    what = f"{bits.name} of {kind.name} is not {bits.name} of {other.name}"
                    self._error(path, what, "give both the same type, range and default, or other names")
        counters = {kind.frame.counter.name: kind.name for kind in kinds if kind.frame.counter is not None}
        if len(counters) > 1:
            (name, one), (second, another), *_ = counters.items()
            what = f"{one} counts with {name}, {another} with {second}"
            self._error(("frames", another), what, "give both the same name")
        seeded = [kind for kind in kinds if kind.frame.attributes]
        for kind in seeded[1:]:
            if kind.frame.attributes != seeded[0].frame.attributes:
                what = f"check values of {kind.name} and {seeded[0].name} cover different attributes"
                self._error(("frames", kind.name), what, "let both cover the same, in the same order")

    def titles(self, kinds: Sequence[FrameKind]) -> None:
        """Check that generated code can tell a kind from the frames of one direction of another."""
        known: dict[str, FrameKind] = {}
        for kind in kinds:
            other = known.setdefault(kind.title, kind)
            if other.name != kind.name:
                what = f"{kind.title} is the name of a kind, and of the {kind.only or other.only}s of another"
                self._error(("frames", kind.title), what, "give it another name")

    def shared(self, kinds: Sequence[FrameKind]) -> None:
        """Check that kinds that no message names are for both directions, or each for one."""
        both = next((each for each in kinds if each.only is None), None)
        if both and (one := next((each for each in kinds if each.only), None)):
            what = (
                f"{one.name} is for one direction or has parts of one, {both.name} carries the same messages"
            )
            self._error(("frames", one.name), what, "let each message name its frame")

    def family(self, kinds: list[FrameKind]) -> None:
        """Check kinds that carry the same messages: only constants, lengths and check values differ."""
        first, *others = kinds
        for kind in others:
            if _kept(kind.frame) != _kept(first.frame):
                what = f"{kind.name} and {first.name} carry the same messages, but have different parts"
                hint = "let each message name its frame, or change only constants, lengths and check values"
                self._error(("frames", kind.name), what, hint)
                return
            if bool(kind.frame.attributes) != bool(first.frame.attributes):
                what = f"{kind.name} and {first.name} carry the same messages, but one covers an attribute"
                hint = "let each message name its frame, or cover it in both"
                self._error(("frames", kind.name), what, hint)
        for kind in kinds if others else ():
            repeated = {part.derivation.of for part in kind.frame.parts if part.derivation}
            if (length := kind.frame.part("length")) and length.name in repeated:
                what = f"a part of {kind.name} repeats its length"
                self._error(("frames", kind.name), what, "let each message name its frame")
            if (length := kind.frame.part("length")) is None or length.scale > 1:
                what = f"no length of {kind.name} gives each size of its payload"
                self._error(("frames", kind.name), what, "add one, or let each message name its frame")
        sizes = sorted((kind.frame.payload.min_size, kind.frame.payload.max_size) for kind in kinds)
        for (_, before), (low, _) in itertools.pairwise(sizes):
            if low > before + 1:
                what = f"no kind has a payload of {before + 1} bytes"
                hint = "let the sizes of kinds that carry the same messages adjoin"
                self._error(("frames", kinds[-1].name), what, hint)


def _excess(part: Part) -> str:
    """What kinds of frame do not have, "" if the part is right."""
    if part.role == "terminator" and part.shared:
        return "may begin the next frame"
    if part.trim is not None:
        return "is trimmed"
    return ""


def _kept(frame: DelimitedFrame) -> list[object]:
    """The parts that kinds of a family have in common, in wire order."""
    own = ("constant", "length", "checksum")
    alike: list[object] = [
        replace(part, min_size=0, max_size=0, doc="", section="", confirmed=True)
        for part in frame.parts
        if part.role not in own
    ]
    return alike
