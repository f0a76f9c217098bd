"""Second pass, parts that only some frames have: values of the header decide."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace

from qlinkgen.model.condition import Test
from qlinkgen.model.fields import Field, Value
from qlinkgen.model.frame import ATTRIBUTE, DelimitedFrame, Part
from qlinkgen.model.types import Scalar
from qlinkgen.schema.conditions import ConditionBuilder
from qlinkgen.schema.file_frames import PartSpec
from qlinkgen.schema.notation import TestText
from qlinkgen.schema.report import Reporter, listed
from qlinkgen.schema.source import Path

_RULE = "part-condition"
_LONG = "long-length"
#: Roles of parts at the end of a frame that it has as a whole or not.
_WHOLE = ("constant", "checksum")
#: Conditions are about other fields than the one that has them.
_NO_TYPE = Scalar(bits=8, chunks=(), minimum=0, maximum=0)


class PartConditions(ConditionBuilder):
    """Adds conditions on values of the header to the parts of a frame."""

    def __init__(self, specs: Mapping[str, PartSpec], path: Path, report: Reporter) -> None:
        """``specs`` are the parts as written."""
        super().__init__({}, path, report)
        self._written = specs
        self._known: dict[str, Value] = {}
        #: Those that the condition of a part may be about.
        self._names: Mapping[str, Value] = {}
        self._lengths: dict[str, Value] = {}
        #: Lengths with a number that hands over to a longer one, and that number.
        self._handing: dict[str, int] = {}

    def added(self, parts: Sequence[Part]) -> tuple[Part, ...]:
        """The parts with their conditions."""
        return tuple(self._with_condition(part) for part in parts)

    def _with_condition(self, part: Part) -> Part:
        texts = self._written[part.name].when or ()
        if part.otherwise is not None:
            self._handing[part.name] = part.otherwise
        elif part.role == "length" and part.scalar and not texts:
            self._lengths[part.name] = Value(part.name, part.scalar, part.doc, part.field)
        if not texts:
            values = (
                bits for bits in part.bits if bits.type is not None and not bits.party and not bits.only
            )
            self._known |= {
                bits.name: Value(bits.name, bits.type, bits.doc, part.field) for bits in values if bits.type
            }
        if not texts or any(text.field == "direction" for text in texts):
            return part
        if part.role == "length":
            return self._longer(part, texts)
        self._names = self._known
        if part.role in _WHOLE:
            # Their absence leaves no value at its default, so that the size of a frame may decide, too.
            self._names = self._known | self._lengths
        elif not _holds_values(part):
            what = f"{part.name} holds more than values of a frame"
            self._error(part.name, "if", what, "let only values, constants and check values depend on others")
            return part
        return replace(part, when=self._condition(Field(part.name, _NO_TYPE), texts, ()))

    def _longer(self, part: Part, texts: Sequence[TestText]) -> Part:
        """A length that is there where an earlier one hands over to it."""
        (text, *others) = texts
        number = self._handing.get(text.field)
        first, *rest = text.wanted
        if number is None or others or rest or text.negated or (first.first, first.last) != (number, number):
            known = [f"{{{name}: {each}}}" for name, each in self._handing.items()]
            what = f"no earlier length hands over to {part.name}"
            hint = f"write if: {listed(known, 'or')}" if known else "give the length before it otherwise: 255"
            self._report.error(_LONG, (*self._path, part.name, "if"), what, hint, of_key=True)
            self._report.taint((*self._path, part.name, "if"))
            return part
        return replace(part, when=(Test(text.field, ((number, number),)),))

    def _values(self, field: Field, before: Sequence[Field]) -> Mapping[str, Value]:
        del field, before
        return self._names

    def _error(self, field: str, key: str, what: str, hint: str) -> None:
        place = (*self._path, field)
        what = what.replace("no field", "no part or bits").replace(
            "with a value before it", "before it with a value of every frame"
        )
        hint = hint.replace("earlier fields", "earlier parts and bits")
        self._report.error(_RULE, (*place, key), what, hint, of_key=True, needs=(place,))
        self._report.taint((*place, key))


def _holds_values(part: Part) -> bool:
    """Whether a part holds values of a frame and nothing else; counters and parties are not."""
    roles = [bits.role == "value" and not (bits.counting or bits.party) for bits in part.bits]
    return part.role == "bits" and all(roles)


def check_conditions(frame: DelimitedFrame, path: Path, report: Reporter) -> None:
    """Check that a receiver knows the size of a frame from its header."""
    if any(report.touched((*path, part.name, "if")) for part in frame.parts):
        return
    _check_lengths(frame, path, report)
    for part in frame.conditional:
        if fault := next(_faults(frame, part), None):
            report.error(_RULE, (*path, part.name, "if"), *fault, of_key=True, needs=(path,))


def _check_lengths(frame: DelimitedFrame, path: Path, report: Reporter) -> None:
    """Check the two lengths of frames that may be long."""
    lengths = [part for part in frame.parts if part.role == "length"]
    first = next((part for part in lengths if part.otherwise is not None), None)
    if first is None or not first.scalar:
        return
    longer = next((part for part in lengths if part.when), None)
    copies = [part.name for part in frame.parts if part.derivation and part.derivation.of == first.name]
    most = frame.length_bias + frame.payload.max_size
    wrong = [
        (longer is None, "no other length follows", f"add one with if: {{{first.name}: {first.otherwise}}}"),
        (
            longer is not None and longer.counts != first.counts,
            "the lengths count different parts",
            "let both count the same",
        ),
        (
            any((part.scale, part.offset) != (1, 0) for part in lengths),
            "a length counts in steps, or from an offset",
            "remove scale and offset",
        ),
        (
            most <= first.scalar.maximum,
            f"no frame is longer than {first.name} can state",
            "allow larger payloads",
        ),
        (bool(copies), f"{listed(copies)} repeats {first.name}", "remove it"),
        (frame.payload.trim is not None, "zeros at the end of payloads are not sent", "remove trim"),
    ]
    for is_wrong, what, hint in wrong:
        if is_wrong:
            place = (*path, first.name, "otherwise")
            report.error(_LONG, place, what, f"{hint}, or remove otherwise", of_key=True, needs=(path,))
            return


def _faults(frame: DelimitedFrame, part: Part) -> Iterator[tuple[str, str]]:
    """What a frame with a conditional part cannot have, and the way round."""
    name, length = part.name, frame.part("length")
    if length is None:
        yield f"a frame with {name} has no length", f"add one, or remove the condition of {name}"
    elif name in length.counts:
        yield f"{length.name} counts {name}, which not every frame has", "count other parts"
    if frame.part("terminator"):
        yield f"a frame with {name} has a terminator", f"remove it, or the condition of {name}"
    if frame.stuffing or frame.coding:
        done, what = ("stuffed", "stuffing") if frame.stuffing else ("coded", "coding")
        yield f"a frame with {name} is {done}", f"remove the {what}, or the condition of {name}"
    names = [each.name for each in frame.parts]
    at, payload = names.index(name), names.index(frame.payload.name)
    following = frame.parts[at + 1 :] if at > payload else frame.parts[at + 1 : payload]
    if other := next((each.name for each in following if each.when != part.when), ""):
        where = "it to the end" if at > payload else f"it directly before {frame.payload.name}"
        yield f"{other} follows {name}, and has another condition or none", f"move {where}"
    if part.role in _WHOLE and at < payload:
        yield f"{name} is a {part.role} before {frame.payload.name}", "move it to the end"
    yield from _check_faults(frame, part)
    for each in frame.parts:
        yield from _misuses(each, part, trails=at > payload, early=names.index(each.name) < payload)


def _check_faults(frame: DelimitedFrame, part: Part) -> Iterator[tuple[str, str]]:
    """What a check value that only some frames have cannot cover."""
    check, others = part.checksum, {each.name for each in frame.parts if each.checksum}
    if check is None:
        return
    if check.otherwise is not None:
        yield f"{part.name} has a value for nothing", "remove otherwise"
    if other := next((each for each in check.over if each in others), ""):
        yield f"{part.name} covers the check value {other}", f"leave {other} out of over"
    if seed := next((each for each in check.over if each.startswith(ATTRIBUTE)), ""):
        yield f"{part.name} covers {seed}", f"leave {seed} out of over"


def _misuses(other: Part, part: Part, *, trails: bool, early: bool) -> Iterator[tuple[str, str]]:
    """How another part depends on one that a frame may not have."""
    name = part.name
    if other.derivation and other.derivation.of == name:
        yield f"{other.name} follows from {name}, which not every frame has", "let it follow from another"
    if other.checksum and other.checksum.every:
        what = f"{other.name} has values for blocks of the payload"
        yield what, f"remove every, or the condition of {name}"
    together = trails and other.when == part.when
    if other.checksum and name in other.checksum.over and (trails or early) and not together:
        hint = f"leave {name} out of over"
        if not trails:
            hint += ", or move the check value after the payload"
        yield f"{other.name} covers {name}, which not every frame has", hint
