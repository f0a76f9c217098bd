"""The fields of a schema file."""

from __future__ import annotations

import math
import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from fractions import Fraction
from typing import Any

from tests.support.whole.reference.layouts import (
    Number,
    Packed,
    Record,
    Records,
    Run,
    Slot,
    Test,
    is_met,
    most_bytes,
    values_of,
)
from tests.support.whole.reference.notation import (
    Doc,
    Role,
    as_doc,
    exact,
    octets,
    part_doc,
    span,
    whole_or_negative,
    whole_span,
)


def _as_text(number: Number, spec: Doc) -> Number:
    """A number that is sent as text; a shorter text than the type needs limits it."""
    name, _, span = spec["as"].rstrip("]").partition("[")
    point = 0
    while name == "decimal" and Fraction(str(spec.get("scale", 1))) * 10**point < 1:
        point += 1
    base = 10 if name == "decimal" else 16
    longest = max(len(f"{abs(each):d}" if base == 10 else f"{each:x}") for each in (number.low, number.high))
    longest = max(longest, point + 1) + (point > 0) + (number.low < 0)
    least, most = whole_span(span) if span else (1, longest)
    assert most is not None
    digits = most - (point > 0)
    low = -(10 ** (digits - 1)) + 1 if digits - 1 > point else 0
    high = min(number.high, base**digits - 1)
    text = (base, least, most, point, max(number.low, low) < 0)
    spaced = "pad" in spec
    return replace(
        number, low=max(number.low, low), high=high, text=text, pieces=((0, 8),) * most, spaced=spaced
    )


def byte_pieces(size: int, order: str) -> tuple[tuple[int, int], ...]:
    """An integer of whole bytes."""
    pieces = tuple((8 * index, 8) for index in range(size))
    return pieces if order == "little" else pieces[::-1]


def _counting(fields: Mapping[str, Any]) -> Doc:
    """The fields, with sizes that name an earlier field as counts of it."""
    found = dict(fields)
    for name, spec in fields.items():
        written = spec if isinstance(spec, dict) else {"type": spec}
        if "switch" in written:
            continue
        base, _, size = str(written["type"]).partition("[")
        count = found.get(size.rstrip("]"))
        if count is not None:
            counter = dict(count) if isinstance(count, dict) else {"type": count}
            bounds = str(counter.pop("range", ""))
            bare = base in ("bytes", "text") and not bounds
            found[size.rstrip("]")] = {**counter, "counts": name}
            found[name] = {**written, "type": base if bare else f"{base}[{bounds}]"}
    return found


class Fields:
    """Builds fields from their mappings."""

    def __init__(self, document: Doc, payload_most: int, beside: Mapping[str, Number] | None = None) -> None:
        """`payload_most` limits fields without a bound, and all fields together.

        `beside` are values of frames.
        """
        self._beside = beside or {}
        self._document = document
        self.most = payload_most
        self._order = document.get("byteorder", "big")

    def build(self, fields: Mapping[str, Any]) -> tuple[Slot, ...]:
        """The fields of one message."""
        slots = self._slots(fields)
        counts = {slot.counts: slot for slot in slots[::-1] if slot.counts}
        bounded = [
            slot for slot in slots if not isinstance(slot.kind, Run | Records) or slot.kind.high is not None
        ]
        return tuple(
            _bounded(slot, self.most - most_bytes(bounded, along=slot), counts.get(slot.choice or slot.name))
            for slot in slots
        )

    def _slots(self, fields: Mapping[str, Any]) -> tuple[Slot, ...]:
        slots: list[Slot] = []
        for name, spec in _counting(fields).items():
            if isinstance(spec, dict) and "switch" in spec:
                slots += self._cases(name, spec, slots)
                continue
            resolved = self._resolved(spec)
            slots.append(self._conditional(self._slot(name, resolved), resolved, slots))
        return tuple(self._counting_several(slot, fields.get(slot.name), slots) for slot in slots)

    @staticmethod
    def _counting_several(slot: Slot, spec: Any, slots: Sequence[Slot]) -> Slot:
        """A count of the bytes of several fields, one of them of variable size."""
        counted = spec.get("counts") if isinstance(spec, dict) else None
        choices = {each.choice for each in slots if each.choice}
        if isinstance(counted, str) and counted in choices:
            return replace(slot, counts_in="bytes")
        if not isinstance(counted, list):
            return slot
        names = {each.choice or each.name: each for each in slots}
        (run,) = (name for name in counted if name in choices or not names[name].fixed)
        more = slot.more + sum(names[name].most_bytes for name in counted if name != run)
        unit = slot.counts_in if len(counted) == 1 and run not in choices else "bytes"
        return replace(slot, counts=run, counts_in=unit, more=more)

    def _cases(self, name: str, spec: Doc, before: list[Slot]) -> list[Slot]:
        """The cases of a choice as fields that exclude each other."""
        tag = spec["switch"].split(".")[-1]
        known = {**self._beside, **dict(values_of(before))}
        number = known[tag]
        assert isinstance(number, Number)
        keys = [self._wanted(key) for key in spec["cases"]]
        tests: list[Test] = [(tag, (key,), False) for key in keys]
        kinds = list(spec["cases"].values())
        if "default" in spec:
            tests.append((tag, tuple(keys), True))
            kinds.append(spec["default"])
        found = []
        for index, (test, kind) in enumerate(zip(tests, kinds, strict=True)):
            if isinstance(kind, dict) and "type" not in kind:
                slot = Slot(f"{name}@{index}", Record(self._slots(kind)))
            else:
                slot = self._slot(f"{name}@{index}", self._resolved(kind))
            if kind:
                when = _with_outer((test,), before)
                defaults = {key: each.default for key, each in known.items() if isinstance(each, Number)}
                given = all(is_met(each, defaults[each[0]]) for each in when)
                found.append(replace(slot, when=when, given=given, choice=name))
        return found

    def _conditional(self, slot: Slot, spec: Doc, before: list[Slot]) -> Slot:
        """The slot with what decides whether it is present."""
        tests = _with_outer(self.tests(spec.get("if", {})), before)
        values, holds = {**self._beside, **dict(values_of(before))}, True
        for name, ranges, excluded in tests:
            number = values[name]
            assert isinstance(number, Number)
            holds = holds and any(low <= number.default <= high for low, high in ranges) != excluded
        optional = spec.get("optional", False)
        return replace(slot, when=tests, optional=optional, given=holds and not optional)

    def tests(self, given: str | Doc) -> tuple[Test, ...]:
        """What a condition asks of values."""
        found = []
        for ref, value in ({given: True} if isinstance(given, str) else given).items():
            items = value if isinstance(value, list) else [str(value).removeprefix("not ")]
            ranges = tuple(self._wanted(each) for each in items)
            found.append((ref.split(".")[-1], ranges, str(value).startswith("not ")))
        return tuple(found)

    def _wanted(self, item: object) -> tuple[int, int]:
        text = str(item)
        if text.lower() in ("true", "false"):
            return (int(text.lower() == "true"),) * 2
        for enum in self._document.get("enums", {}).values():
            if text in enum["values"]:
                member = enum["values"][text]
                number = member["value"] if isinstance(member, dict) else member
                return number, number
        return whole_or_negative(text)

    def beside(self, name: str, given: Any) -> tuple[Slot, tuple[tuple[str, int, Number], ...]]:
        """A part of a frame with values: its integer, and the name, lowest bit and number of each."""
        if "groups" in self._document:
            # Groups of the file are those of fields.
            document = {key: each for key, each in self._document.items() if key != "groups"}
            return Fields(document, self.most).beside(name, given)
        spec = part_doc(given)
        if "bits" in spec:
            members = tuple(
                self._member(key, spec["bits"][key]) for key, role, *_ in bits_of(spec) if role == "value"
            )
            return Slot(name, self._number(spec["type"], spec)), members
        facts = ("role", "per", "echo", "repeats")
        slot = self._slot(name, self._resolved({key: each for key, each in spec.items() if key not in facts}))
        if isinstance(slot.kind, Packed):
            return slot, slot.kind.members
        kind = slot.kind
        if isinstance(kind, Run):  # the first character is the most significant byte
            bits, default = 8 * kind.low, int.from_bytes(bytes(kind.default), "big")
            pieces = byte_pieces(kind.low, "big")
            kind = Number(bits, False, pieces, 0, (1 << bits) - 1, default, without=b"")
        assert isinstance(kind, Number)
        return replace(slot, kind=kind), ((name, 0, kind),)

    def _resolved(self, spec: Any) -> Doc:
        """A field merged with its named types."""
        written: Doc = {"type": spec} if isinstance(spec, str) else dict(spec)
        base, brackets, count = written["type"].partition("[")
        named = self._document.get("types", {}).get(base.strip())
        if named is None or "fields" in named:
            return written
        below = self._resolved(named)
        return {**below, **written, "type": below["type"] + brackets + count}

    def _slot(self, name: str, spec: Doc) -> Slot:
        base, bracket, count = spec["type"].replace(" ", "").partition("[")
        if base in self._document.get("types", {}):
            record = Record(self.build(self._document["types"][base]["fields"]))
            if not bracket:
                return Slot(name, record)
            return Slot(name, self._records(name, record, count, spec))
        if bracket and "bits" in spec:
            item = Record((self._divided(name, base, spec),))
            return Slot(name, self._records(name, item, count, spec))
        if base in ("bytes", "text") or bracket:
            return Slot(name, self._run(base, count.rstrip("]"), spec))
        if "bits" in spec:
            return self._divided(name, base, spec)
        return self._single(name, base, spec)

    def _divided(self, name: str, base: str, spec: Doc) -> Slot:
        """An integer with bits."""
        number = self._number(base, spec)
        members = tuple(self._member(*each) for each in spec["bits"].items())
        return Slot(name, Packed(number.pieces, number.bits, members))

    def _single(self, name: str, base: str, spec: Doc) -> Slot:
        """A single number."""
        number = self._number(base, spec)
        if "counts" in spec:
            more, scale = -int(spec.get("offset", 0)), int(spec.get("scale", 1))
            unit = spec.get("counts_in", "items")
            return Slot(name, number, "count", str(spec["counts"]), unit, more=more, scale=scale)
        if "algorithm" in spec and "." not in "".join(spec["over"]):
            return Slot(name, number, "filled", rule=spec, over=tuple(spec["over"]))
        if "equals" in spec and "." not in spec["equals"]:
            source = re.sub(r"[-+] *\d+|[~ ]", "", spec["equals"])
            return Slot(name, number, "filled", rule=spec, over=(source,))
        number = _quantified(number, spec)
        if isinstance(spec.get("const"), list):
            several = [self._with_default(number, base, {"const": each}, "const") for each in spec["const"]]
            return Slot(name, several[0], "constant", accepted=tuple(each.default for each in several))
        if spec.get("reserved"):
            return Slot(name, self._with_default(number, base, spec, "const"), "reserved")
        key = "const" if "const" in spec else "default"
        role: Role = "constant" if "const" in spec else "value"
        return Slot(name, self._with_default(number, base, spec, key), role)

    def _records(self, name: str, record: Record, count: str, spec: Doc) -> Records:
        low, high = whole_span(count.rstrip("]")) if count.rstrip("]") else (0, None)
        last = self._conditional(Slot(name, record), {"if": spec.get("last", {})}, list(record.slots)).when
        return Records(record, low, high, last=last)

    def _run(self, base: str, count: str, spec: Doc) -> Run:
        item = None if base in ("bytes", "text") else _quantified(self._number(base, spec), spec)
        listed = isinstance(spec.get("default"), list)
        if item is not None:
            item = self._with_default(item, base, {} if listed else spec, "default")
        low, high = whole_span(count) if count else (0, None)
        default: tuple[int, ...] = ()
        if listed and item is not None:
            default = tuple(
                self._with_default(item, base, {"default": each}, "default").default
                for each in spec["default"]
            )
        elif "default" in spec and item is None:
            text = str(spec["default"])
            default = tuple(text.encode("ascii") if base == "text" else bytes.fromhex(text))
        fill = item.default if item else ord(" ") if base == "text" else 0
        if "pad" in spec and item is None:
            return Run(item, base == "text", low, high, default, pad=octets(spec["pad"]))
        if "terminator" in spec:
            end = octets(spec["terminator"])
            fill = ord("_") if end == b" " else 1 if end == b"\0" and base == "bytes" else fill
            return Run(item, base == "text", low, high, default + (fill,) * (low - len(default)), end=end)
        filled = default + (fill,) * (low - len(default))
        return Run(item, base == "text", low, high, filled, spec.get("packed", ""))

    def _number(self, base: str, spec: Doc) -> Number:
        enum = self._document.get("enums", {}).get(base, {"type": ""})
        if enum["type"] == "text":
            given = [each["value"] if isinstance(each, dict) else each for each in enum["values"].values()]
            words = tuple(each.encode() for each in given)
            pieces = ((0, 8),) * max(map(len, words))
            any_case = enum.get("ignore_case", False)
            return Number(8, False, pieces, 0, len(words) - 1, words=words, any_case=any_case)
        bits, signed, scale, truth, forbidden = self._carrier(base)
        bits = 1 if truth and "packed" in spec else bits
        pieces = () if "packed" in spec else self._pieces(bits, spec)
        low = 0 if not signed else -(1 << bits - 1)
        high = 1 if truth else (1 << bits - signed) - 1
        real, bcd = base in ("f16", "f32", "f64"), spec.get("as") == "bcd"
        high = 10 ** (bits // 4) - 1 if bcd else high
        number = Number(
            bits, signed, pieces, low, high, 0, scale, Fraction(0), truth, forbidden, bcd=bcd, real=real
        )
        if spec.get("as") == "scientific":
            most = number.number(0x7F7FFFFF if bits == 32 else 0x7FEFFFFFFFFFFFFF)
            return replace(number, scientific=True, bounds=(-most, most), pieces=((0, 8),) * 24)
        return _as_text(number, spec) if str(spec.get("as", "bcd")) != "bcd" else number

    def _carrier(self, base: str) -> tuple[int, bool, Fraction | None, bool, int]:
        if base == "bool":
            return self._document.get("groups", {}).get("bits", 8), False, None, True, 0
        if enum := self._document.get("enums", {}).get(base):
            return int(enum["type"][1:]), enum["type"][0] == "i", None, False, 0
        if flags := self._document.get("flags", {}).get(base):
            bits = int(flags["type"][1:])
            free = flags.get("reserved") != "zero"
            return bits, False, None, False, 0 if free else (1 << bits) - 1 & ~_named_bits(flags)
        if "fixed" in base:
            whole, fraction = base.lstrip("u").removeprefix("fixed").split(".")
            return int(whole) + int(fraction), base[0] != "u", Fraction(1, 1 << int(fraction)), False, 0
        return int(base[1:]), base[0] == "i", None, False, 0

    def _pieces(self, bits: int, spec: Doc) -> tuple[tuple[int, int], ...]:
        groups = spec.get("groups") or self._document.get("groups")
        if groups is None:
            return byte_pieces(bits // 8, spec.get("byteorder") or self._order)
        pieces: list[tuple[int, int]] = []
        for first, last in map(whole_span, spec.get("parts", [f"0..{bits - 1}"])):
            starts = range(first, last + 1, groups["bits"])
            inside = [(at, min(groups["bits"], last + 1 - at)) for at in starts]
            pieces += inside if groups["first"] == "least" else inside[::-1]
        return tuple(pieces)

    def _member(self, name: str, spec: Any) -> tuple[str, int, Number]:
        written: Doc = spec if isinstance(spec, dict) else {"at": spec}
        first, last = whole_span(written["at"])
        bits, signed = last + 1 - first, written.get("signed", False)
        base = written.get("type", "")
        numeric = signed or "scale" in written or "offset" in written or "role" in written
        truth = base == "bool" or (not base and bits == 1 and not numeric)
        flags = self._document.get("flags", {}).get(base, {})
        forbidden = (1 << bits) - 1 & ~_named_bits(flags) if flags.get("reserved") == "zero" else 0
        low, high = (-(1 << bits - 1), (1 << bits - 1) - 1) if signed else (0, (1 << bits) - 1)
        number = Number(bits, signed, (), low, high, truth=truth, forbidden=forbidden)
        number = _quantified(number, written)
        return name, first, self._with_default(number, base, written, "default")

    def _with_default(self, number: Number, base: str, spec: Doc, key: str) -> Number:
        """Without a default, the number nearest to 0."""
        given = spec.get(key)
        if number.real:
            low, high = number.bounds or (-math.inf, math.inf)
            nearest = min(max(0.0, low), high) if given is None else _real(given)
            return replace(number, default=number.pattern(nearest))
        if given is None:
            return replace(number, default=min(max(0, number.low), number.high))
        if isinstance(given, bool):
            return replace(number, default=int(given))
        names = self._document.get("enums", {}).get(base, {}).get("values", {})
        if number.words:
            return replace(number, default=list(names).index(given))
        if given in names:
            member = names[given]
            return replace(number, default=member["value"] if isinstance(member, dict) else member)
        return replace(number, default=int((exact(given) - number.offset) / (number.scale or 1)))


def _real(given: object) -> float:
    text = str(given)
    return float(text) if text in ("nan", "inf", "-inf") else float(exact(given))


def _with_outer(tests: tuple[Test, ...], before: Sequence[Slot]) -> tuple[Test, ...]:
    """Tests after those of the fields with the tested values: an absent one meets none."""
    found: list[Test] = []
    for test in tests:
        holders = (slot for slot in before if test[0] in (name for name, _ in slot.values()))
        outer = next((slot.when for slot in holders), ())  # a value of the frame has none
        found += [each for each in (*outer, test) if each not in found]
    return tuple(found)


def _named_bits(flags: Doc) -> int:
    members = flags["values"].values()
    return sum(1 << (each["bit"] if isinstance(each, dict) else each) for each in members)


def _quantified(number: Number, spec: Doc) -> Number:
    """The number with its scale and range."""
    if "scale" in spec or "offset" in spec:
        scale = exact(spec["scale"]) if "scale" in spec else number.scale or Fraction(1)
        number = replace(number, scale=scale, offset=exact(spec.get("offset", 0)))
    if "range" in spec and number.real:
        low_end, high_end = (number.number(number.pattern(float(end))) for end in span(spec["range"]))
        return replace(number, bounds=(low_end, high_end))
    if "range" in spec:
        ends = [(end - number.offset) / (number.scale or 1) for end in span(spec["range"])]
        number = replace(number, low=int(min(ends)), high=int(max(ends)))
    if "raw_range" in spec:
        low, high = whole_or_negative(spec["raw_range"])
        number = replace(number, low=low, high=high)
    return number


def _bounded(slot: Slot, room: int, counter: Slot | None) -> Slot:
    kind = slot.kind
    if not isinstance(kind, Run | Records) or kind.high is not None:
        return slot
    most = kind.items_in(max(0, room))
    if counter is not None:
        assert isinstance(counter.kind, Number)
        limit = counter.kind.high * counter.scale - counter.more
        most = min(most, kind.items_in(limit) if counter.counts_in == "bytes" else limit)
    return replace(slot, kind=replace(kind, high=max(1, most)))


def bits_of_type(written: str) -> int:
    """Number of bits of ``u16`` or ``text[2]``."""
    return 8 * int(written[5:-1]) if written.startswith("text") else int(written[1:])


def bits_of(spec: Doc) -> Iterator[tuple[str, str, int, int, Doc]]:
    """What the bits of a part hold: name ("" for all bits), role, lowest bit, number of bits, mapping."""
    spec = part_doc(spec)
    if spec["role"] in ("message", "address", "direction", "constant") and "type" in spec:
        yield "", spec["role"], 0, bits_of_type(spec["type"]), spec
    for name, given in spec.get("bits", {}).items():
        inner = as_doc(given)
        first, last = whole_span(inner["at"])
        role = inner.get("role", "constant" if "const" in inner else "value").replace("counter", "value")
        yield name, role, first, last + 1 - first, inner
