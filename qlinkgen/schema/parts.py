"""Second pass, parts of a frame: each part, and references between parts."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import replace
from fractions import Fraction
from typing import Literal

from qlinkgen.model import checksum as catalogue
from qlinkgen.model.frame import ATTRIBUTE, Checksum, Derivation, Part, Role, Silence
from qlinkgen.model.types import Chunk, Scalar, byte_chunks
from qlinkgen.schema.algorithms import AlgorithmBuilder
from qlinkgen.schema.file_frames import PartKind, PartSpec
from qlinkgen.schema.file_model import SchemaFile
from qlinkgen.schema.kinds import MAX_PAYLOAD
from qlinkgen.schema.notation import DERIVED, Duration, shown
from qlinkgen.schema.part_digits import FORM, check_source, in_digits
from qlinkgen.schema.part_directions import direction_of
from qlinkgen.schema.pieces import PieceBuilder, text_size
from qlinkgen.schema.report import Reporter, did_you_mean, listed
from qlinkgen.schema.source import Path
from qlinkgen.schema.synonyms import type_hint
from qlinkgen.schema.types import TypeBuilder

#: The least number that hands over to a longer length: one below it states a size other than 0.
_LEAST_OTHERWISE = 2
#: Decimal digits of a checksum; as many as the widest one may have.
_MOST_DIGITS = 20
_INTEGERS = {f"u{8 * size}": size for size in range(1, 9)}
_SINGLE_ROLES = (
    "length",
    "address",
    "destination",
    "source",
    "direction",
    "counter",
    "payload",
    "terminator",
    "idle",
    "break",
)
_VALUE_KEYS = ("scale", "offset", "unit", "range", "raw_range", "default")
_ROLE_KEYS: Mapping[PartKind, Sequence[str]] = {
    "constant": ("value", "text", "type", "byteorder", "const"),
    "bits": ("type", "byteorder", "bits"),
    "derived": ("type", "byteorder", "equals"),
    "direction": ("type", "byteorder", "values"),
    "value": ("type", "byteorder", *_VALUE_KEYS),
    "counter": ("type", "byteorder", "per", "echo", "repeats"),
    "length": ("type", "byteorder", "counts", "scale", "offset", "range", "otherwise"),
    "message": ("type", "byteorder"),
    "address": ("type", "byteorder", "as"),
    "destination": ("type", "byteorder"),
    "source": ("type", "byteorder"),
    "payload": ("size", "trim"),
    "checksum": ("type", "byteorder", "algorithm", "init", "over", "every", "otherwise", "sent", "as"),
    "terminator": ("value", "text", "shared"),
    "idle": ("time", "at_least", "alone"),
    "break": ("time", "at_least", "alone"),
}
#: Roles of parts that are numbers and not sent as digits.
_NUMBERS = (
    "length",
    "message",
    "destination",
    "source",
    "direction",
    "value",
    "counter",
    "derived",
)
_KEYS = (
    "type",
    "byteorder",
    "value",
    "text",
    "const",
    "values",
    "per",
    "echo",
    "repeats",
    "equals",
    "bits",
    "shared",
    "time",
    "at_least",
    "counts",
    "size",
    "trim",
    "algorithm",
    "init",
    "over",
    "every",
    "alone",
    "otherwise",
    "sent",
    "as",
    "only",
    "words",
    "rejected",
    "ignore_case",
    *_VALUE_KEYS,
)


class PartBuilder:
    """Builds the parts of one frame."""

    def __init__(self, file: SchemaFile, report: Reporter, types: TypeBuilder) -> None:
        """``types`` are those of values."""
        self._file = file
        self._report = report
        self._pieces = PieceBuilder(report, types)

    def roles_fit(self, specs: Mapping[str, PartSpec], needed: Sequence[str], path: Path) -> bool:
        """Check that every part has a role, that required ones are present, and single ones occur once."""
        fit = True
        for name in (name for name, spec in specs.items() if spec.told is None):
            if not any(self._report.touched((*path, name, key)) for key in ("role", *_KEYS)):
                what = f"{name} has no role"
                hint = "add role: message, address or payload; counts, value, text or algorithm tell others"
                self._report.error("bad-frame", (*path, name), what, hint, of_key=True, absent=True)
            fit = False
        first: dict[str, str] = {}
        for name, role, place in _roles(specs, path):
            other = first.setdefault(role, name)
            longer = role == "length" and specs[name].when is not None
            if role in _SINGLE_ROLES and other != name and not longer:
                what = f"{name} and {other} are both the {role}"
                hint = "a frame has one of each role but constant, message and checksum"
                if role == "length":
                    hint = f"if one follows from the other, write {name}: {{equals: {other} - 24}}"
                self.fault("bad-frame", place, what, hint)
                fit = False
        for role in needed:
            if role not in first and "None" not in first:
                what, hint = f"the frame has no {role}", f"add a part with role: {role}"
                self._report.error("bad-frame", path, what, hint, of_key=True, absent=True)
                fit = False
        return fit

    def build(self, name: str, spec: PartSpec, names: Mapping[str, PartSpec], path: Path) -> Part:
        """The part described by a mapping, one of ``names``.

        Missing keys are reported and replaced by placeholders.
        """
        role = spec.told
        assert role is not None
        assert role not in {"idle", "break"}
        self.reject(spec, [key for key in _KEYS if key not in _ROLE_KEYS[role]], role, path)
        if role == "constant" and spec.const is not None:
            self.reject(spec, ("value", "text"), "constant with a type", path)
        value, size, checksum, scalar = b"", (0, 0), None, None
        if role == "terminator" or (role == "constant" and spec.const is None):
            value = self.constant(spec, path)
        elif role == "payload":
            size = self.payload_size(spec, path)
        elif role in ("value", "counter"):
            return self._value(name, spec, path)
        elif role == "checksum":
            checksum = self.checksum(spec, names, path)
        else:
            scalar = self.integer(spec, path)
            if role == "length" and not spec.counts:
                self._lacks("counts", "add counts: [PART, ...]", path)
            self.known(spec.counts or (), names, (*path, "counts"))
            if role == "length":
                scalar = self._bounded(spec, scalar, path)
        values = ("direction", "counter", "value", "destination", "source")
        kind: Role = "bits" if role in values else role  # type: ignore[assignment]
        whole = self._pieces.whole(name, spec, scalar, path) if scalar else None
        ways = [each for each, one in names.items() if one.told == "direction"]
        bits = self._pieces.inside(spec.bits or {}, scalar, ways, path) if scalar and role == "bits" else ()
        if role == "constant" and scalar and whole and len(whole.constants) == 1:
            value, scalar, whole = scalar.integer.pack(whole.constants[0] & scalar.integer.mask), None, None
        elif role == "constant" and scalar:
            kind = "bits"
        return Part(
            name=name,
            role=kind,
            bits=(whole,) if whole else bits,
            derivation=self._derivation(spec, names, path) if role == "derived" else None,
            doc=spec.doc,
            section=spec.section,
            confirmed=spec.confirmed,
            only=direction_of(spec, self._report, path),
            constant=value,
            shared=spec.shared,
            scalar=scalar,
            checksum=checksum,
            counts=tuple(spec.counts or ()),
            otherwise=spec.otherwise if role == "length" else None,
            scale=self._whole(spec, "scale", 1, path) if role == "length" else 1,
            offset=self._whole(spec, "offset", 0, path) if role == "length" else 0,
            min_size=size[0],
            max_size=size[1],
            trim=spec.trim.keep if spec.trim and role == "payload" else None,
        )

    def _bounded(self, spec: PartSpec, scalar: Scalar, path: Path) -> Scalar:
        """The integer of a length; of one that hands over to a longer one, up to the last of its numbers."""
        if spec.otherwise is None:
            self.reject(spec, ("range",), "length without otherwise", path)
            return scalar
        if spec.otherwise > scalar.maximum:
            what = f"{spec.otherwise} does not fit {scalar.bits} bits"
            self._report.error("value-does-not-fit", (*path, "otherwise"), what, f"use 0..{scalar.maximum}")
            return scalar
        if spec.otherwise < _LEAST_OTHERWISE:
            what = f"{spec.otherwise} leaves no numbers for the sizes of other frames"
            hint = f"use {_LEAST_OTHERWISE}..{scalar.maximum}"
            self._report.error("long-length", (*path, "otherwise"), what, hint)
            return scalar
        most = spec.range.last if spec.range else Fraction(spec.otherwise - 1)
        if most.denominator != 1 or not 0 < most < spec.otherwise or (spec.range and spec.range.first > 0):
            what = f"{path[-1]} is {spec.otherwise} in long frames, which others do not reach"
            hint = f"write range: 0..{spec.otherwise - 1}, or a smaller one"
            self._report.error("long-length", (*path, "otherwise"), what, hint, of_key=True)
            return scalar
        return replace(scalar, maximum=int(most))

    def _whole(self, spec: PartSpec, key: str, least: int, path: Path) -> int:
        """The scale or the offset of a length."""
        given: Fraction | None = getattr(spec, key)
        if given is None:
            return least
        if given.denominator != 1 or given < least:
            what = f"{given} is not a number of bytes"
            self._report.error("bad-value", (*path, key), what, f"use a whole number from {least}")
            return least
        return int(given)

    def silence(self, spec: PartSpec, path: Path, *, names: Sequence[str]) -> Silence | None:
        """The silence that ends a frame, or the break that begins it; ``names`` are those of all parts."""
        broken = spec.told == "break"
        what = "break" if broken else "silence"
        self.reject(spec, [key for key in _KEYS if key not in _ROLE_KEYS["idle"]], what, path)
        if broken and names[0] != path[-1]:
            self.fault("bad-frame", path, f"{path[-1]} is not the first part", "move it to the beginning")
        elif not broken and names[-1] != path[-1]:
            self.fault("bad-frame", path, f"{path[-1]} is not the last part", "move it to the end")
        least = spec.at_least or Duration()
        if least.byte_times:
            what = "the minimum of an idle time depends on the speed of the line"
            self.fault("bad-value", (*path, "at_least"), what, "write a time like 1750 us")
        if spec.time is None:
            self._lacks("time", "add time: 1.3 bytes" if broken else "add time: 3.5 bytes", path)
            return None
        seconds = max(spec.time.seconds, least.seconds)
        return Silence(spec.time.byte_times, seconds, spec.alone, broken)

    def _value(self, name: str, spec: PartSpec, path: Path) -> Part:
        """A part with a value of every frame, or several in its bits."""
        if spec.type is None:
            return Part(name=name, role="bits", scalar=self.integer(spec, path))
        scalar, bits = self._pieces.value(name, spec, path)
        return Part(
            name=name,
            role="bits",
            bits=bits,
            scalar=scalar,
            doc=spec.doc,
            section=spec.section,
            confirmed=spec.confirmed,
            only=direction_of(spec, self._report, path),
        )

    def fault(self, rule: str, path: Path, what: str, hint: str) -> None:
        """Report an error in a part, or in one of its keys."""
        self._report.error(rule, path, what, hint, of_key=True)

    def check_opening(self, spec: PartSpec, path: Path) -> None:
        """Report keys that do not apply to a message id of several lengths."""
        known = ("type", "ignore_case")
        self.reject(spec, [key for key in _KEYS if key not in known], "message id of several lengths", path)

    def reject(self, spec: PartSpec, keys: Iterable[str], role: str, path: Path) -> None:
        """Report keys that do not apply to a part with this role."""
        for key in keys:
            if {"as": "as_"}.get(key, key) not in spec.model_fields_set:
                continue
            article = "an" if role[0] in "aeiou" else "a"
            if key == "as" and role in _NUMBERS:
                what = f"{path[-1]} is {article} {role}, and only addresses and check values may be digits"
                hint = "describe it as text with as many characters, type: text[N]"
                self.fault("bad-digits", (*path, key), what, hint)
                self._report.taint((*path, key))
                continue
            what = f"'{key}' has no effect on {article} {role} here"
            self.fault("not-applicable", (*path, key), what, "remove it")

    def _lacks(self, key: str, hint: str, path: Path) -> None:
        if not self._report.touched((*path, key)):
            self._report.error("bad-frame", path, f"{path[-1]} has no {key}", hint, of_key=True, absent=True)

    def constant(self, spec: PartSpec, path: Path) -> bytes:
        """The bytes of a constant without a type."""
        self.reject(spec, ("type", "byteorder"), "constant without const", path)
        if spec.value is not None and spec.text is not None:
            what = f"{path[-1]} has both value and text"
            self.fault("bad-frame", (*path, "text"), what, "remove one of them")
        if spec.value is None and spec.text is None:
            self._lacks("value", "add value: A5 A5", path)
        return spec.value or (spec.text or "\0").encode("ascii")

    def _derivation(self, spec: PartSpec, names: Mapping[str, PartSpec], path: Path) -> Derivation:
        match = DERIVED.match(spec.equals or "")
        order, name = list(names), path[-1]
        if match is None:
            what, hint = (
                f"{shown(spec.equals)} does not name a part",
                "write PART, ~PART, PART + N or PART - N",
            )
        elif match["name"] not in order:
            hint = did_you_mean(match["name"], order, f"the parts are {listed(order)}")
            what = f"unknown part {shown(match['name'])}"
        elif order.index(match["name"]) >= order.index(str(name)):
            what, hint = f"{match['name']} does not precede {name}", f"move {name} after it"
        else:
            check_source(match["name"], names[match["name"]], path, self._report)
            return Derivation(
                match["name"], bool(match["not"]), int((match["added"] or "0").replace(" ", ""))
            )
        self._report.error("unknown-part", (*path, "equals"), what, hint)
        self._report.taint(path)
        return Derivation(order[0])

    def payload_size(self, spec: PartSpec, path: Path) -> tuple[int, int]:
        """Minimum and maximum size of a payload."""
        if spec.size is None:
            self._lacks("size", "add size: 0..26", path)
            self._report.taint(path)
        low, high = spec.size or (0, MAX_PAYLOAD)
        if high > MAX_PAYLOAD:
            what = f"a payload of {high} bytes is too long"
            self._report.error("bad-frame", (*path, "size"), what, f"use at most {MAX_PAYLOAD}")
        return low, high

    def integer(self, spec: PartSpec, path: Path) -> Scalar:
        """The integer of a length, message id, address or checksum."""
        size = _INTEGERS.get(spec.type or "")
        if spec.told == "message" and (characters := text_size(spec.type)):
            if spec.byteorder is not None:
                self.reject(spec, ("byteorder",), "text", path)
            chunks = byte_chunks(characters, "big")
            return Scalar(bits=8 * characters, chunks=chunks, minimum=0, maximum=(1 << 8 * characters) - 1)
        if size is None:
            kinds = listed(_INTEGERS, "or")
            if spec.type is None:
                self._lacks("type", f"add type: {kinds}", path)
            else:
                what = f"{shown(spec.type)} is not a type for a part of a frame"
                hint = type_hint(spec.type) or f"use {kinds}"
                self._report.error("unknown-type", (*path, "type"), what, hint)
            self._report.taint((*path, "type"))
            size = 1
        chunks = byte_chunks(size, spec.byteorder or self._file.byteorder)
        scalar = Scalar(bits=8 * size, chunks=chunks, minimum=0, maximum=(1 << 8 * size) - 1)
        if spec.told != "address" or spec.as_ is None:
            return scalar
        self.reject(spec, ("byteorder",), "digits", path)
        return in_digits(scalar, spec, path, self._report)

    def known(self, names: Iterable[str], parts: Iterable[str], path: Path) -> None:
        """Check that names refer to parts, without repetition, in wire order."""
        order = list(parts)
        last = -1
        if self._report.touched(path):
            return
        for index, name in enumerate(names):
            if name.startswith(ATTRIBUTE) and path[-1] == "over":
                continue
            place, needs = (*path, index), ((*self._parts_path(path), name),)
            if name not in order:
                hint = did_you_mean(name, order, f"the parts are {listed(order)}")
                self._report.error("unknown-part", place, f"unknown part {shown(name)}", hint, needs=needs)
                self._report.taint(place)
            elif order.index(name) <= last:
                what = f"{name} precedes {order[last]} on the wire"
                if name == order[last]:
                    what = f"{name} is listed twice"
                self._report.error(
                    "part-order", place, what, "list each part once, in wire order", needs=needs
                )
            else:
                last = order.index(name)

    @staticmethod
    def _parts_path(path: Path) -> Path:
        if path[0] == "frames":
            return path[:3]
        return ("frame", "packet" if "packet" in path[:2] else "parts")

    # Checksums

    def checksum(self, spec: PartSpec, names: Iterable[str], path: Path) -> Checksum | None:
        """The checksum of a frame; None if its algorithm is unknown."""
        algorithm = self._algorithm(spec, path)
        covered = [name for name in names if name != path[-1]]
        if not spec.over:
            self._lacks("over", "add over: [PART, ...]", path)
        self.known(spec.over or (), covered, (*path, "over"))
        scalar = self.integer(spec, path)
        if algorithm is None:
            self._report.taint(path)
            return None
        if scalar.bits != algorithm.width:
            what = f"{algorithm.name} has {algorithm.width} bits, {path[-1]} {scalar.bits}"
            hint = "use a type as wide as the algorithm"
            self._report.error("checksum-does-not-fit", path, what, hint, of_key=True)
        return Checksum(
            algorithm,
            self._sent(spec, scalar, path),
            tuple(spec.over or ()),
            spec.confirmed,
            self._otherwise(spec, algorithm, path),
            spec.every or 0,
            base=_base(spec.as_),
        )

    def _otherwise(self, spec: PartSpec, algorithm: catalogue.Checksum, path: Path) -> int | None:
        if spec.otherwise is not None and spec.otherwise > algorithm.mask:
            what = f"{spec.otherwise} does not fit {algorithm.width} bits"
            self._report.error("value-does-not-fit", (*path, "otherwise"), what, f"use 0..{algorithm.mask}")
        return spec.otherwise

    def _algorithm(self, spec: PartSpec, path: Path) -> catalogue.Checksum | None:
        if spec.algorithm is None:
            self._lacks("algorithm", "add algorithm: crc-16/ibm-3740 or another", path)
            return None
        return AlgorithmBuilder(self._report).build(spec.algorithm, spec.init, path)

    def _sent(self, spec: PartSpec, scalar: Scalar, path: Path) -> tuple[Chunk, ...]:
        if spec.as_ is not None:
            return self._as_digits(spec, scalar, path)
        if not spec.sent:
            return scalar.chunks
        taken = 0
        for index, (first, last) in enumerate(spec.sent):
            place = (*path, "sent", index)
            if last >= scalar.bits or last - first >= 8:
                what = f"{first}..{last} spans more than 8 bits, or exceeds the {scalar.bits}-bit checksum"
                self._report.error(
                    "checksum-does-not-fit", place, what, "let each range fill one byte", needs=(path,)
                )
                self._report.taint(place)
                return scalar.chunks
            mask = (1 << last + 1) - (1 << first)
            if taken & mask:
                what = f"{first}..{last} repeats bits that are already sent"
                self._report.error("checksum-does-not-fit", place, what, "name each bit once", needs=(path,))
            taken |= mask
        return tuple(Chunk(first, last + 1 - first) for first, last in spec.sent)

    def _as_digits(self, spec: PartSpec, scalar: Scalar, path: Path) -> tuple[Chunk, ...]:
        """The digits of a checksum."""
        self.reject(spec, ("byteorder", "sent", "every"), "digits", path)
        if (found := FORM.fullmatch(spec.as_ or "")) and found["name"] == "decimal":
            return (Chunk(0, scalar.bits),) * int(found["size"])
        right = f"hex[{scalar.bits // 4}]"
        if (spec.as_ or "").replace(" ", "") != right:
            what = f"a checksum of {scalar.bits} bits is not {shown(spec.as_)}"
            hint = f"write as: {right}, or decimal[N] with up to {_MOST_DIGITS} digits"
            self._report.error("bad-digits", (*path, "as"), what, hint, needs=(path,))
        return tuple(Chunk(shift, 4) for shift in range(scalar.bits - 4, -1, -4))


def _base(form: str | None) -> Literal[0, 10, 16]:
    """The base of the digits of a checksum, 0 if it is sent as bytes."""
    if form is None:
        return 0
    found = FORM.fullmatch(form)
    return 10 if found and found["name"] == "decimal" else 16


def _roles(specs: Mapping[str, PartSpec], path: Path) -> Iterator[tuple[str, str, Path]]:
    """The roles of parts and of their bits: name, role, place."""
    for name, spec in specs.items():
        yield name, str(spec.told), (*path, name)
        for inner, bits in (spec.bits or {}).items():
            yield inner, bits.role or "constant", (*path, name, "bits", inner)
