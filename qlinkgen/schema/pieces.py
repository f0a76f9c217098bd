"""Second pass, pieces: the roles of the bits of a part, and the message id that they make up."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import replace

from qlinkgen.model.digits import Digits
from qlinkgen.model.fields import FieldType
from qlinkgen.model.frame import Counting, DelimitedFrame, Frame, Part, PartBits
from qlinkgen.model.message import Direction
from qlinkgen.model.types import Bits, Blob, Characters, Flags, Float, Scalar, byte_chunks
from qlinkgen.schema.bit_directions import bits_direction, counted, other_tests
from qlinkgen.schema.constants import repeated_constant
from qlinkgen.schema.file_fields import FieldSpec
from qlinkgen.schema.file_frames import PartBitSpec, PartSpec
from qlinkgen.schema.notation import NO_ID, StatedId, shown
from qlinkgen.schema.part_texts import text_of
from qlinkgen.schema.report import Reporter, listed
from qlinkgen.schema.source import Path
from qlinkgen.schema.text_ids import TextIds
from qlinkgen.schema.types import TypeBuilder

#: Maximum number of bits of a message id.
MAX_ID_BITS = 64
#: Keys of bits with a value of every frame.
VALUE_KEYS = frozenset({"type", "signed", "scale", "offset", "unit", "range", "raw_range", "default"})


class PieceBuilder:
    """Builds the bits of parts."""

    def __init__(self, report: Reporter, types: TypeBuilder) -> None:
        """``types`` are those of values."""
        self._report = report
        self._types = types.in_bytes()

    def whole(self, name: str, spec: PartSpec, scalar: Scalar, path: Path) -> PartBits | None:
        """All bits of a part with one role; None for a role that needs no bits."""
        match spec.told:
            case "message" | "address" | "direction" as role:
                directions = self._directions(spec, scalar.bits, path) if role == "direction" else {}
                text = role == "message" and text_size(spec.type) > 0
                return PartBits(
                    name=name,
                    role=role,
                    shift=0,
                    bits=scalar.bits,
                    directions=directions,
                    text=text,
                    digits=scalar.text if isinstance(scalar.text, Digits) else None,
                )
            case "destination" | "source" as party:
                number = self._number(name, 0, scalar, spec.doc, path)
                return replace(number, party=party)
            case "constant":
                constants = self._constants(spec, scalar.bits, path)
                return PartBits(name=name, role="constant", shift=0, bits=scalar.bits, constants=constants)
            case _:
                return None

    def value(self, name: str, spec: PartSpec, path: Path) -> tuple[Scalar, tuple[PartBits, ...]]:
        """The integer of a part without a role, and the values in it."""
        keys = spec.model_fields_set & FieldSpec.model_fields.keys() - {"when"}
        given = {key: getattr(spec, key) for key in keys}
        kind = self._types.build(FieldSpec.model_construct(_fields_set=set(given), **given), path)
        whole = kind.container if isinstance(kind, Bits) else kind
        if isinstance(whole, Scalar) and not whole.text and any(each.bits < 8 for each in whole.chunks):
            what = f"{shown(spec.type)} is sent in groups of bits"
            self._fault("bad-width", (*path, "type"), what, "use an integer of whole bytes for a part")
        match kind:
            case Bits():
                found = [(each.name, each.shift, each.type, each.doc) for each in kind.members]
                bits = tuple(self._number(*each, path) for each in found)
                return kind.container, bits
            case Scalar() if (
                kind.settable and kind.text is None and not isinstance(kind.meaning, Float | str)
            ):
                number = self._number(name, 0, kind, spec.doc, path)
                return _container(kind), (self._counted(number, spec, path),)
            case Blob() if (text := text_of(kind)) is not None:
                number = self._number(name, 0, text, spec.doc, path)
                return _container(text), (self._counted(number, spec, path),)
            case _:
                if kind is not None and spec.as_ is None:
                    what = f"{shown(spec.type)} is not the type of a value of every frame"
                    hint = "use an integer, an enum, flags, bits, or text[1..8]"
                    self._fault("not-applicable", (*path, "type"), what, hint)
                self._report.taint(path)
                return _container(None), ()

    def _number(self, name: str, shift: int, number: Scalar, doc: str, path: Path) -> PartBits:
        if number.required:
            what, hint = f"{name} has no default, and 0 is not legal", "add a default"
            self._report.error("default-out-of-range", path, what, hint, of_key=True)
        return PartBits(name=name, role="value", shift=shift, bits=number.bits, type=number, doc=doc)

    def _counted(self, bits: PartBits, spec: PartSpec | PartBitSpec, path: Path) -> PartBits:
        """The bits of a value, which may be a counter."""
        if spec.role != "counter":
            keys = {"per", "echo", "repeats"} if isinstance(spec, PartBitSpec) else set()
            for key in spec.model_fields_set & keys:
                what = f"'{key}' has no effect on a value that is not a counter"
                self._fault("not-applicable", (*path, key), what, "remove it, or add role: counter")
            return bits
        number = bits.type
        if number is None or number.signed or number.meaning is not None or number.scaling is not None:
            what = f"{bits.name} cannot count"
            self._fault("bad-frame", path, what, "use a plain unsigned integer")
        again = spec.repeats == "answered"
        if again and spec.per == "frame":
            what = f"each frame has another {bits.name}, so none tells that a request is repeated"
            hint = "remove repeats, or let the counter count requests"
            self._fault("not-applicable", (*path, "repeats"), what, hint)
        return replace(bits, counting=Counting(spec.per == "frame", spec.echo, again))

    def inside(
        self, specs: Mapping[str, PartBitSpec], container: Scalar, ways: Sequence[str], path: Path
    ) -> tuple[PartBits, ...]:
        """The bits of an integer with several roles; ``ways`` are parts with the direction."""
        found: list[PartBits] = []
        ways = ("direction", *ways, *(name for name, spec in specs.items() if spec.role == "direction"))
        for name, spec in specs.items():
            place = (*path, "bits", name)
            last = spec.at[1]
            if last >= container.bits:
                what = f"{name} extends to bit {last}"
                self._fault("bits-do-not-fit", place, what, f"use bits 0..{container.bits - 1}")
                continue
            bits = self._inside(name, spec, place)
            if bits is None:
                continue
            bits = self._conditional(bits, spec, ways, place)
            if other := next(
                (each.name for each in found if each.mask & bits.mask and _meet(each, bits)), None
            ):
                self._fault("bits-overlap", place, f"{name} overlaps {other}", "use different bits")
            found.append(bits)
        return tuple(found)

    def _conditional(self, bits: PartBits, spec: PartBitSpec, ways: Sequence[str], path: Path) -> PartBits:
        """The bits with the direction whose frames have them, and what a counter counts."""
        bits = replace(bits, only=bits_direction(spec, ways, path, self._report))
        if not (others := other_tests(spec, ways)):
            return bits
        if bits.counting is None:
            what = f"{others[0].field} cannot decide whether a frame has {bits.name}"
            hint = "write if: {direction: request}, or let a part of its own depend on values"
            self._fault("part-condition", (*path, "if"), what, hint)
            return bits
        when = counted(others, path, self._report)
        return replace(bits, counting=replace(bits.counting, when=when))

    def _inside(self, name: str, spec: PartBitSpec, path: Path) -> PartBits | None:
        first, last = spec.at
        width, role = last + 1 - first, spec.role or ("constant" if spec.const else None)
        if role is None:
            number = self._types.bits(spec, path)
            bits = self._number(name, first, number, spec.doc, path) if number else None
            return self._counted(bits, spec, path) if bits else None
        if spec.role and spec.const:
            hint = "omit one of them"
            self._fault("bad-frame", path, f"{name} has a role and a constant", hint)
        for key in spec.model_fields_set & VALUE_KEYS:
            what = f"'{key}' has no effect on bits with a role or a constant"
            self._fault("not-applicable", (*path, key), what, "remove it")
        if spec.values is not None and role != "direction":
            self._fault("not-applicable", (*path, "values"), "'values' has no effect here", "remove it")
        number = Scalar(bits=width, chunks=(), minimum=0, maximum=(1 << width) - 1)
        match role:
            case "counter":
                return self._counted(self._number(name, first, number, spec.doc, path), spec, path)
            case "destination" | "source":
                return replace(self._number(name, first, number, spec.doc, path), party=role)
        return PartBits(
            name=name,
            role=role,
            shift=first,
            bits=width,
            constants=self._constants(spec, width, path) if role == "constant" else (),
            directions=self._directions(spec, width, path) if role == "direction" else {},
            doc=spec.doc,
        )

    def _constants(self, spec: PartSpec | PartBitSpec, bits: int, path: Path) -> tuple[int, ...]:
        for number in spec.const or ():
            self._check_fits(number, bits, (*path, "const"))
        if repeated := repeated_constant(spec.const or ()):
            self._report.error("duplicate-value", (*path, "const"), *repeated)
        return tuple(dict.fromkeys(spec.const or (0,)))

    def _directions(self, spec: PartSpec | PartBitSpec, bits: int, path: Path) -> Mapping[str, int]:
        values = spec.values
        if values is None:
            if not self._report.touched((*path, "values")):
                hint = "add values: {request: 0, response: 1}"
                what = f"{path[-1]} has no values"
                self._report.error("bad-frame", path, what, hint, of_key=True, absent=True)
            return {"request": 0, "response": 0}
        for direction, number in values.items():
            self._check_fits(number, bits, (*path, "values", direction))
        if len(set(values.values())) < len(values):
            what = f"{path[-1]} has one value twice"
            self._fault("bad-frame", (*path, "values"), what, "use different values")
        return {str(direction): number for direction, number in values.items()}

    def _check_fits(self, number: int, bits: int, path: Path) -> None:
        if number >> bits:
            what = f"{number} does not fit {bits} bits"
            self._report.error("value-does-not-fit", path, what, f"use 0..{(1 << bits) - 1}")

    def _fault(self, rule: str, path: Path, what: str, hint: str) -> None:
        self._report.error(rule, path, what, hint, of_key=True)


def _meet(one: PartBits, other: PartBits) -> bool:
    """Whether a frame may have both."""
    return one.only is None or other.only is None or one.only == other.only


def _container(number: Scalar | None) -> Scalar:
    """The unsigned integer that holds a number; any for None."""
    bits, chunks = (number.bits, number.chunks) if number else (8, byte_chunks(1, "big"))
    return Scalar(bits=bits, chunks=chunks, minimum=0, maximum=(1 << bits) - 1)


_TEXT = re.compile(r"text\s*\[\s*([1-8])\s*\]\Z", re.ASCII)


def text_size(kind: str | None) -> int:
    """Number of characters of ``text[3]``, 0 for other types."""
    match = _TEXT.match(kind or "")
    return int(match[1]) if match else 0


def placed(parts: tuple[Part, ...]) -> tuple[Part, ...]:
    """The parts, the pieces of the message id in their places: the direction first, then in wire order."""
    pieces = [bits for part in parts for bits in part.bits if bits.role in ("direction", "message")]
    pieces.sort(key=lambda each: each.role != "direction")
    places, at = dict[str, int](), 0
    for each in reversed(pieces):
        places[each.name] = at
        at += each.bits
    return tuple(
        replace(part, bits=tuple(replace(bits, at=places.get(bits.name, 0)) for bits in part.bits))
        for part in parts
    )


class IdBuilder:
    """Composes the ids of messages from the numbers in a file."""

    def __init__(self, report: Reporter, frame: Frame | None) -> None:
        """``frame`` is None if it could not be built."""
        self._report = report
        self._frame = frame
        pieces = frame.id_bits if isinstance(frame, DelimitedFrame) else ()
        self.direction = next((each for each in pieces if each.role == "direction"), None)
        self._pieces = [each for each in pieces if each.role == "message"]
        by_parts = isinstance(frame, DelimitedFrame) and frame.directed
        self._values = {each.name for each in frame.values} if isinstance(frame, DelimitedFrame) else set()
        self._directed = by_parts or self.direction is not None
        opening = frame.payload.opening if isinstance(frame, DelimitedFrame) else None
        #: Ids that are texts of several lengths, None without any.
        self._texts = TextIds(opening, report) if opening else None

    @property
    def identifies(self) -> bool:
        """Whether the frame has a message id, apart from its direction; unknown frames do."""
        return bool(self._pieces or self._texts) or not isinstance(self._frame, DelimitedFrame)

    def text(self, number: int) -> bytes | None:
        """The text of an id of several lengths, None for other ids."""
        return self._texts.text(number) if self._texts else None

    def number(
        self, stated: StatedId, direction: Direction, path: Path, whose: str = "", *, way: str = ""
    ) -> int:
        """The id of a message, stated at a path; ``whose`` is its name if it is not that of its command.

        ``way`` is the value that states the direction, if it is another one than that of the direction.
        """
        number = self._stated(stated, direction, path, f" of {whose}" if whose else "")
        if direction == "message" and self._directed:
            what = f"{path[-2]} has no direction, which its frame states"
            hint = "add direction: request or direction: response"
            self._report.error("bad-frame", path[:-1], what, hint, of_key=True, needs=(path[:-1], ("frame",)))
            direction = "request"
        if self.direction is None:
            return number
        return number | self.direction.directions[way or direction] << self.direction.at

    def _stated(self, stated: StatedId, direction: Direction, path: Path, whose: str) -> int:
        given = stated.given
        if not isinstance(self._frame, DelimitedFrame):
            return self._alone(given, path) + stated.added
        if self._texts is not None:
            return self._text_number(self._texts, stated, path)
        pieces = [each for each in self._pieces if each.only in (None, direction)]
        names = [each.name for each in pieces]
        if not names:
            if given not in (None, NO_ID) or stated.added:
                hint = "remove it, or add a part with role: message"
                self._wrong(path, "the frame has no message id", hint)
            return 0
        if given is None:
            return self._missing(path)
        if isinstance(given, int | str):
            if sum(each.only is None for each in pieces) > 1 or (pieces[0].only and len(pieces) > 1):
                hint = f"write {{{', '.join(f'{name}: NUMBER' for name in names)}}}"
                self._wrong(path, f"the id consists of {listed(names)}", hint)
                return 0
            given = {next((each.name for each in pieces if each.only is None), names[0]): given}
        if path[0] == "commands" and path[2:] == ("id",):  # that of its command, which states the request's
            others = {each.name for each in self._pieces if each not in pieces}
            given = {name: value for name, value in given.items() if name not in others}
        return self._added(self._composed(given, pieces, path), stated.added, path, whose)

    def _alone(self, given: object, path: Path) -> int:
        """The id in a frame whose pieces are not known, or that has none."""
        if isinstance(given, str):
            self._not_number(given, path)
        elif isinstance(given, Mapping):
            self._report.taint(path)
        return given if isinstance(given, int) else 0 if given else self._missing(path)

    def _text_number(self, texts: TextIds, stated: StatedId, path: Path) -> int:
        if stated.given is None:
            return self._missing(path)
        if stated.added:
            self._wrong(path, "an id that is text has no sum", "write the id of the answer, or remove it")
            return 0
        given = stated.given
        if isinstance(given, Mapping):
            own = {name: each for name, each in given.items() if name not in self._values}
            if [*own] != [texts.name]:
                hint = f"give {texts.name}, and values of every frame"
                self._wrong(path, f"the id consists of {texts.name}", hint)
                return 0
            given = own[texts.name]
        return texts.number(given, path)

    def fixed(self, stated: StatedId, direction: Direction, path: Path) -> tuple[tuple[str, int], ...]:
        """The values of the frame that an id states beside the pieces of the number, and their numbers."""
        frame, given = self._frame, stated.given
        if not isinstance(frame, DelimitedFrame) or not isinstance(given, Mapping) or not stated.own:
            return ()
        known = {each.name: each.type for each in frame.towards(direction).values}
        found = []
        for name, number in given.items():
            if name not in self._values:
                continue
            if fault := _fixed_fault(name, number, known.get(name), frame):
                self._report.error("bad-fixed", (*path, name), *fault, needs=(path, ("frame",)))
            elif isinstance(number, int):
                found.append((name, number))
        return tuple(found)

    def _composed(self, stated: Mapping[str, int | str], pieces: list[PartBits], path: Path) -> int:
        """The id of these pieces; those that only one direction has may be left out, and are 0 then."""
        names = [each.name for each in pieces]
        own = set(stated) - self._values
        if not set(names) >= own >= {each.name for each in pieces if each.only is None}:
            hint = f"give {listed(names)}, and values of every frame"
            self._wrong(path, f"the id consists of {listed(names)}", hint)
            return 0
        given = {piece.name: self._piece(piece, stated.get(piece.name, 0), path) for piece in pieces}
        for piece in pieces if len(names) > 1 else ():
            value = given[piece.name]
            if value >> piece.bits:
                what, hint = (
                    f"{piece.name} {value:#x} does not fit the frame",
                    f"use 0..{(1 << piece.bits) - 1:#x}",
                )
                self._wrong(path, what, hint, "id-does-not-fit")
        return sum(given[piece.name] << piece.at for piece in pieces)

    def _piece(self, piece: PartBits, stated: int | str, path: Path) -> int:
        """The number of a piece of an id, which may be written as text."""
        if isinstance(stated, int) and not piece.text:
            return stated
        size = piece.bits // 8
        if not piece.text:
            self._not_number(stated, path)
        elif isinstance(stated, int):
            self._wrong(path, f"{piece.name} {stated} is not text", f'quote it: "{stated}"')
        elif len(stated) != size or not stated.isascii() or not stated.isprintable():
            what = f"{piece.name} {shown(stated)} does not fit the frame"
            self._wrong(path, what, f"write {size} ASCII characters", "id-does-not-fit")
        else:
            return int.from_bytes(stated.encode("ascii"), "big")
        return 0

    def _not_number(self, given: object, path: Path) -> None:
        self._wrong(path, f"{shown(given)} has the wrong type", "write a whole number", "wrong-type")

    def _added(self, number: int, added: int, path: Path, whose: str) -> int:
        most = (1 << max(piece.at + piece.bits for piece in self._pieces)) - 1
        if not 0 <= number + added <= most:
            what = f"id {number + added:#x}{whose} does not fit the frame"
            self._wrong(path, what, f"use 0..{most:#x}", "id-does-not-fit")
        return number + added

    def _missing(self, path: Path) -> int:
        if self._frame is not None and not self._report.touched(path):
            self._report.error(
                "missing-key",
                path[:-1],
                "key 'id' is missing",
                "add id: its number in the frame",
                of_key=True,
                absent=True,
            )
        self._report.taint(path)
        return 0

    def _wrong(self, path: Path, what: str, hint: str, rule: str = "bad-frame") -> None:
        self._report.error(rule, path, what, hint, needs=(path, ("frame",)))


def _fixed_fault(
    name: str, number: int | str, kind: FieldType | None, frame: DelimitedFrame
) -> tuple[str, str] | None:
    """Error and fix for a value that a message fixes, None if it is right."""
    held = next((bits for part in frame.parts for bits in part.bits if bits.name == name), None)
    if kind is None:
        return f"the frame of the message does not have {name}", "remove it"
    if held is not None and (held.counting or held.party):
        return f"{name} is not a value that the program chooses", "remove it"
    if any(part.when and part.name == name for part in frame.parts) or not isinstance(kind, Scalar):
        return f"not every frame has {name}", "fix the value that decides whether it is there"
    if kind.scaling is not None or isinstance(kind.meaning, Float | Characters | Flags):
        return f"{name} is not a whole number", "remove it; the program sets it"
    if not isinstance(number, int) or not kind.minimum <= number <= kind.maximum:
        return f"{name} cannot be {number}", f"use {kind.minimum}..{kind.maximum}"
    return None
