"""Random fields of every kind, in any legal order."""

from __future__ import annotations

import random
import re
from dataclasses import dataclass, field
from typing import Any

from tests.support.whole.field_kinds import Doc, KindMaker, Structure, limits_of
from tests.support.whole.filled import add_filled
from tests.support.whole.frames import Shape

#: Maximum number of characters of a floating-point number.
_REAL = 24
#: Maximum characters of a count as text.
_TOLD = 5
#: Maximum number of records inside each other.
_DEPTH = 3


@dataclass
class Room:
    """The rest of a payload."""

    least: int
    left: int
    open_end: bool
    fixed: bool = False

    @classmethod
    def of(cls, shape: Shape) -> Room:
        """An empty payload."""
        fixed = bool(shape.word or shape.trimmed or shape.kind == "packet")
        return cls(shape.least, shape.most, shape.has_length, fixed)


@dataclass
class FieldMaker(KindMaker):
    """Creates the fields of the messages of a schema."""

    #: Fraction of fields of variable size.
    variable: float = 0.3
    #: Records of variable size, or with a bit that ends an array.
    varied: dict[str, Structure] = field(default_factory=dict)
    #: Fraction of fields that are records.
    structured: float = 0.12
    #: Fraction of messages in which fields may be absent.
    conditional: float = 0.25
    #: Fraction of messages with a choice.
    choosing: float = 0.15
    #: Fraction of messages and records with numbers that follow from other fields.
    filled: float = 0.2

    @property
    def _counts_size(self) -> int:
        """The size of two counts of sixteen bits."""
        return 2 * self._bytes_of("u16", {})

    def types(self) -> Doc:
        """Enums, flags and named types."""
        rng = self.rng
        self.taken |= {"bool", "bytes", "text"}
        for _ in range(rng.randint(0, 3)):
            self.enums[self.words.name(self.taken)] = self._enum(
                rng.choice(("u8", "u8", "u16", "i8", "u24", "u32"))
            )
        self.enums[self.words.name(self.taken)] = {"type": "u3", "values": self._members(8)}
        for _ in range(0 if self.shape.groups else rng.choice((0, 1, 2))):
            self.spoken[self.words.name(self.taken)] = self._spoken()
        for _ in range(rng.randint(0, 2)):
            self.flags[self.words.name(self.taken)] = self._flags(
                rng.choice(("u8", "u16", "u24", "u32", "u64"))
            )
        for _ in range(rng.randint(0, 3)):
            name = self.words.name(self.taken)
            self.named[name] = self._scalar()[0]
        for _ in range(rng.choice((0, 0, 1, 2))):
            self._new_bits()
        for _ in range(rng.choice((0, 1, 2, 3, 4))):
            self._new_record()
        if not (self.shape.word > 1 or self.shape.trimmed or self.shape.kind == "packet"):
            for _ in range(rng.choice((0, 0, 1, 2, 4))):
                self._new_varied()
        records = {**self.bitty, **self.records, **self.varied}
        return {
            key: value
            for key, value in (
                ("enums", {**self.enums, **self.spoken}),
                ("flags", self.flags),
                ("types", {**self.named, **{name: each.spec for name, each in records.items()}}),
            )
            if value
        }

    def _new_bits(self) -> None:
        """A named integer with bits."""
        rng, taken = self.rng, set[str]()
        if rng.random() < 0.5 and not self.shape.groups:
            number, more = self.words.name(taken), self.words.name(taken)
            spec: Any = {"type": "u8", "bits": {number: "0..6", more: 7}}
            size, last = 1, {more: rng.choice((False, 0))}
        else:
            spec, size = self._packed(taken)
            last = {}
        if isinstance(spec, dict) and "bits" in spec:
            self.bitty[self.words.name(self.taken)] = Structure(spec, size, 1, last)

    def _new_record(self) -> None:
        """A record of fixed size, perhaps with records in it."""
        inner, taken = [name for name, each in self.records.items() if each.depth < _DEPTH], set[str]()
        made: Doc = {}
        size, depth, has_value = 0, 1, False
        for _ in range(self.rng.choice((1, 2, 3, 5))):
            name, roll = self.words.name(taken), self.rng.random()
            if self.bitty and roll < 0.05:
                kind, times, depth = (
                    self.rng.choice(list(self.bitty)),
                    self.rng.choice((1, 2, 3)),
                    max(2, depth),
                )
                spec: Any = f"{kind}[{times}]"
                more = self.bitty[kind].size * times
            elif inner and roll < 0.2:
                kind = self.rng.choice((*inner, inner[-1]))  # some in three levels
                times, depth = self.rng.choice((0, 0, 1, 2, 3)), max(depth, 1 + self.records[kind].depth)
                spec = f"{kind}[{times}]" if times else kind
                more = self.records[kind].size * max(1, times)
            elif roll < 0.35:
                spec, more = self._fixed_run()
            elif roll < 0.45:
                spec, more = self._packed(taken)
            else:
                spec, more = self._scalar()
            if size + more > 24:
                continue
            made[name] = spec
            size += more
            whole = self._merged(spec if isinstance(spec, dict) else {"type": spec})
            has_value = has_value or not {"const", "reserved"} & whole.keys()
        if has_value:
            if not self.shape.groups and self.shape.word <= 1 and self.rng.random() < self.filled:
                listed = list(made.items())
                before = len(listed)
                add_filled(self.rng, listed, lambda: self.words.name(taken), room=4)
                made, size = dict(listed), size + 4 * (len(listed) > before)
            name = self.words.name(self.taken)
            about = {"doc": self.words.text()} if self.rng.random() < 0.5 else {}
            self.records[name] = Structure({**about, "fields": made}, size, depth)

    def _new_varied(self) -> None:
        """A record of variable size, perhaps with others in it, or one that can end an array."""
        rng, taken = self.rng, set[str]()
        first, last, made, size, depth = self.words.name(taken), Doc(), dict[str, Any](), 1, 1
        bit, more = self.words.name(taken), self.words.name(taken)
        made[first] = {"type": "u8", "bits": {bit: "0..2", more: 6}} if rng.random() < 0.6 else "bool"
        if isinstance(made[first], dict) and rng.random() < 0.6:
            last = rng.choice(({more: False}, {bit: "0..3"}, {bit: 0, more: "not 1"}))
        test = f"{first}.{more}" if isinstance(made[first], dict) else first
        if rng.random() < 0.3 and not self.shape.groups:
            second = self.words.name(taken)
            made[second] = {"type": "u8", "bits": {f"{second}_bit": 1}, "if": test}
            size, test = size + 1, rng.choice((test, f"{second}.{second}_bit"))
        for _ in range(rng.choice((0, 1, 2, 3) if last else (1, 2, 3))):
            more_size, inside = self._varied_part(made, taken, test)
            size, depth = size + more_size, max(depth, 1 + inside)
        rests = rng.random() < 0.3
        if rests and rng.random() < 0.6:
            more_size, inside = self._rest_part(made, taken, test)
            size, depth = size + more_size, max(depth, 1 + inside)
        elif rng.random() < (1 if rests else 0.4):
            listed, room = list(made.items()), Room(0, 24, open_end=rests)
            self._add_choice(listed, taken, room, when=rng.choice((None, None, test)))
            made, size = dict(listed), size + 24 - room.left
            inside = max((self._depth(each) for spec in made.values() for each in _cases_of(spec)), default=0)
            depth = max(depth, 1 + inside)
        if not self.shape.groups and rng.random() < self.filled:
            kinds = {"type": "u8", "algorithm": rng.choice(("xor8", "sum8", "crc-8/smbus")), "over": [first]}
            made = {first: made.pop(first), self.words.name(taken): kinds, **made}
            size += 1
        varies = any(
            isinstance(each, dict) and {"if", "counts", "last", "switch", "terminator"} & each.keys()
            for each in made.values()
        )
        nested = any(self.is_varied(each) for each in made.values())
        if depth <= _DEPTH and size <= 60 and (varies or nested or last):
            ended = "'terminator'" in repr(made) or any(
                self.varied[name].ended for name in self.varied if f"'{name}" in repr(made)
            )
            whole = {"fields": made}
            self.varied[self.words.name(self.taken)] = Structure(whole, size, depth, last, ended, rests)

    def _rest_part(self, made: Doc, taken: set[str], test: str) -> tuple[int, int]:
        """What takes all bytes that are left in some records: its size, and the records inside each other."""
        rng, name = self.rng, self.words.name(taken)
        inner = [kind for kind, each in self.varied.items() if each.rests and each.depth < _DEPTH]
        if inner and rng.random() < 0.5:
            kind = rng.choice(inner)
            made[name] = rng.choice((kind, {"type": kind, "if": test}))
            return self.varied[kind].size, self.varied[kind].depth
        most, kind = rng.choice((1, 4, 9)), "text" if self.shape.groups else rng.choice(("bytes", "u16"))
        made[name] = {"type": f"{kind}[{rng.choice((0, 0, 1))}..{most}]", "if": test}
        if rng.random() < 0.3:
            made[self.words.name(taken)] = "u8"
        return 2 * most + 1, 0

    def _varied_part(self, made: Doc, taken: set[str], test: str) -> tuple[int, int]:
        """A field of a record of variable size: its size, and the number of records inside each other."""
        rng, name, roll = self.rng, self.words.name(taken), self.rng.random()
        inner = [name for name, each in self.varied.items() if each.depth < _DEPTH and not each.rests]
        if roll < 0.1 and self.shape.text and self.shape.has_length:
            most = rng.choice((1, 3, 6))
            made[name] = {"type": f"text[{rng.choice((0, most - 1))}..{most}]", "terminator": "00"}
            return most + 1, 0
        if roll < 0.5:
            kind, spec, step = self._variable_kind()
            most = rng.choice((1, 2, 5))
            self._counted(name, f"{kind}[0..{most}]", spec, made, taken=taken)
            return 2 + most * step, self.arrayed[kind].depth if kind in self.arrayed else 0
        if roll < 0.7:
            spec, step = self._plain()
            made[name] = {**(spec if isinstance(spec, dict) else {"type": spec}), "if": test}
            return step, 0
        if roll < 0.75 and self.bitty:
            kind = rng.choice(list(self.bitty))
            other = self.bitty[kind]
            kept = {"if": test} if rng.random() < 0.5 else {}
            made[name] = {"type": f"{kind}[1..3]", "last": other.last, **kept} if other.last else f"{kind}[2]"
            return 3 * other.size, 1
        if roll < 0.85 and inner:
            kind = rng.choice((*inner, inner[-1]))
            other = self.varied[kind]
            made[name] = kind if rng.random() < 0.5 else f"{kind}[2]"
            if other.last and rng.random() < 0.7:
                made[name] = {"type": f"{kind}[1..2]", "last": other.last}
            return 2 * other.size, other.depth
        made[name], step = self._plain()
        return step, 0

    def _counted(self, name: str, kind: str, spec: Doc, made: Doc, *, taken: set[str]) -> None:
        """A field after a count of its items, of its bytes, or of its bytes and those of the count."""
        count, roll = self.words.name(taken), self.rng.random()
        made[count] = {"type": "u16", "counts": name}
        if roll < 0.6:
            made[count] |= {"counts_in": "bytes"} if roll < 0.3 else {"counts": [count, name]}
        made[name] = {"type": kind, **spec}

    def _varied_field(self, name: str, made: list[tuple[str, Any]], taken: set[str], room: Room) -> None:
        """One record of variable size, or an array of them: counted, of constant length, or to its end."""
        rng = self.rng
        kinds = [each for each, of in self.varied.items() if self.shape.has_length or not of.ended]
        if not kinds:
            return
        kind = rng.choice(kinds)
        record = self.varied[kind]
        opened = any(self._is_open(each, made) for _, each in made)
        rows = any(isinstance(each, dict) and "packed" in each and ".." in each["type"] for _, each in made)
        if opened or rows:
            return
        # Some messages can be longer than the frame allows.
        size = rng.choice((record.size, record.size, max(1, record.size // 4)))
        most = min(rng.choice((1, 2, 3, 8)), (room.left - room.least - self._counts_size) // size)
        if most < 1:
            return
        roll = rng.random()
        if record.rests:  # what tells its own end comes last, see `_add_final`
            roll = 0.4 if room.open_end and roll < 0.5 else 1
        if record.last and most > 1 and roll < 0.6 and not record.rests:
            made.append((name, {"type": f"{kind}[1..{most}]", "last": record.last}))
        elif roll < 0.3:
            most = min(most, 2)
            made.append((name, rng.choice((kind, f"{kind}[{most}]"))))
        elif roll < 0.5 and room.open_end:
            made.append((name, f"{kind}[{rng.choice((0, 0, min(1, most - 1)))}..{most}]"))
            room.open_end = False
        else:
            units = (
                (("bytes",), ("items", "bytes"))
                if record.rests
                else (("items",), ("bytes",), ("bytes",), ("items", "bytes"))
            )
            for unit in rng.choice(units):
                number = most * (record.size if unit == "bytes" else 1)
                self._count(name, unit, number, made, len(made), taken=taken, room=room)
            made.append((name, {"type": f"{kind}[{rng.choice((0, 0, min(1, most - 1), most - 1))}..{most}]"}))
        room.left -= size * most

    def forget_unused(self, document: Doc) -> None:
        """Remove unused types, so that lint does not warn."""
        text = repr({key: document.get(key) for key in ("replies", "commands", "messages")})
        for group in ("types", "enums", "flags"):
            for name in reversed(list(document.get(group, {}))):
                if f"'{name}'" not in text and f"'{name}[" not in text:
                    del document[group][name]
                elif group == "types":
                    text += repr(document[group][name])
            if not document.get(group, True):
                del document[group]

    # The fields of a message

    def fields(self, room: Room, begun: Doc | None = None) -> Doc:
        """The fields of one message, beginning with `begun`."""
        rng = self.rng
        taken = {*self.shape.attributes, *(begun or {})}
        made: list[tuple[str, Any]] = []
        for name, spec in (begun or {}).items():
            size = self._bytes_of(spec["type"], spec)
            if size <= room.left:
                made.append((name, spec))
                room.left -= size
        fixed = room.fixed
        count = rng.choice((0, 1, 1, 2, 3, 3, 4, 5, 7))
        for _ in range(count):
            self._add_field(made, taken, room)
        if room.least and not any(self._least(spec) for _, spec in made):
            made.append((self.words.name(taken), "u8"))
        if self.shape.word > 1:
            self._fill_words(made, taken)
            self._add_words(made, taken)
        if not fixed and not room.least and self.rng.random() < self.conditional:
            self._add_conditions(made, set(begun or {}), taken)
        self._offset_counts(made)
        self._count_several(made)
        self._name_sizes(made)
        dated = self._dated(made, taken)
        if not fixed and not room.least and self.rng.random() < self.choosing:
            self._add_choice(dated, taken, room)
        if self.shape.word <= 1 and not self.shape.groups and rng.random() < self.filled:
            left = room.left - room.least
            add_filled(rng, dated, lambda: self.words.name(taken), room=left, varied=self.varied)
        if not fixed and self.shape.has_length and rng.random() < 2 * self.structured:
            self._add_final(dated, taken, room)
        return dict(dated)

    def _add_final(self, made: list[tuple[str, Any]], taken: set[str], room: Room) -> None:
        """Records at the end that tell their number, the last of which may take all bytes that are left."""
        rng = self.rng
        kinds = [
            kind
            for kind, each in self.varied.items()
            if each.rests and each.size <= room.left - room.least - 4
        ]
        if not kinds or not room.open_end:
            return
        for _, each in made:
            if isinstance(each, dict) and (
                {"optional", "switch"} & each.keys() or ("packed" in each and ".." in each["type"])
            ):
                return
            if self._is_open(each, made):
                return
        kind, name = rng.choice(kinds), self.words.name(taken)
        record = self.varied[kind]
        forms: list[Any] = [kind, f"{kind}[2]", f"{kind}[0..2]"]
        forms += [{"type": f"{kind}[1..3]", "last": record.last}] * 2 if record.last else []
        form = rng.choice(forms)
        if str(form).endswith("2]") and ".." in form:
            self._count(name, "items", 2, made, len(made), taken=taken, room=room)
        made.append((name, form))

    def _add_choice(
        self, made: list[tuple[str, Any]], taken: set[str], room: Room, when: str | None = None
    ) -> None:
        """A value whose type an earlier field decides, at the end of the payload.

        ``when`` is a condition on fields that are there, if that field is to be absent without it.
        """
        rng = self.rng
        specs = [spec for _, spec in made if isinstance(spec, dict)]
        if any(self._is_open(each, made) for _, each in made) or any("optional" in each for each in specs):
            return
        if any("packed" in spec and not spec["type"].partition("[")[2][:-1].isdigit() for spec in specs):
            return
        tag, size, ref, low, high = self._tag(taken, when)
        room.left -= size
        cases: Doc = {}
        middle = (low + high) // 2
        keys = rng.choice(
            (
                [low],
                [low, high],
                [low, f"{low + 1}..{middle}", high],
                [f"{low}..{middle}", f"{middle + 1}..{high}"],
            )
        )
        if high - low < 3:
            keys = [low]
        most, counted = 0, room.left > 8 and rng.random() < 0.5
        for key in keys:
            case, size = self._case(room, last=counted)
            if size > room.left:
                return
            cases[str(key)] = case
            most = max(most, size)
        spec: Doc = {"switch": ref, "cases": cases}
        covered = len(keys) == 2 and isinstance(keys[0], str)
        if not covered:
            last = room.open_end or counted
            case, size = ({}, 0) if rng.random() < 0.3 else self._case(room, last=last)
            if size > room.left:
                return
            spec["default"] = case
            most = max(most, size)
        if not any(cases.values()) and not spec.get("default"):
            return
        made.insert(rng.randint(0 if when is None else len(made), len(made)), tag)
        name = self.words.name(taken)
        if counted:
            count = self.words.name(taken)
            of = rng.choice((name, [count, name], [tag[0], name, count] if when is None else [name]))
            made.insert(rng.randint(0, len(made)), (count, {"type": "u16", "counts": of}))
            most += self._bytes_of("u16", {})
        made.append((name, spec))
        room.left -= most

    def _depth(self, case: Any) -> int:
        """The number of records inside each other in a case of a choice."""
        if isinstance(case, dict) and "type" not in case:
            return int(bool(case)) + max(map(self._depth, case.values()), default=0)
        kind = str(case["type"] if isinstance(case, dict) else case).partition("[")[0]
        return self.arrayed[kind].depth if kind in self.arrayed else 0

    def _tag(self, taken: set[str], when: str | None) -> tuple[tuple[str, Any], int, str, int, int]:
        """A field that a choice may test: itself, its size, the reference, and its range."""
        (name, spec), size, ref, low, high = self._plain_tag(taken)
        if when is not None:
            spec = {**({"type": spec} if isinstance(spec, str) else spec), "if": when}
        return (name, spec), size, ref, low, high

    def _plain_tag(self, taken: set[str]) -> tuple[tuple[str, Any], int, str, int, int]:
        rng, name = self.rng, self.words.name(taken)
        roll = rng.random()
        if roll < 0.3 and not self.shape.groups:
            bit = self.words.name(taken)
            return (name, {"type": "u8", "bits": {bit: "2..4"}}), 1, rng.choice((bit, f"{name}.{bit}")), 0, 7
        if roll < 0.4:
            return (name, "bool"), 1, name, 0, 1
        kind = "u8" if self.shape.groups or roll < 0.8 else rng.choice(("u16", "i8"))
        return (name, {"type": kind, "range": "0..9"}), self._bytes_of(kind, {}), name, 0, 9

    def _case(self, room: Room, *, last: bool = False) -> tuple[Any, int]:
        """What a choice is in one case, and its size."""
        rng, roll = self.rng, self.rng.random()
        if last and roll > 0.6 and room.left > 8:
            most = rng.choice((3, room.left - 4))
            return (f"text[0..{most}]" if self.shape.groups else f"bytes[0..{most}]"), most
        if roll < 0.1:
            return {}, 0
        if self.records and roll < 0.2:
            return self._of_record()
        if roll < 0.4:
            taken = set[str]()
            parts = [(self.words.name(taken), self._plain()) for _ in range(rng.choice((1, 2, 3)))]
            fields, size = {name: spec for name, (spec, _) in parts}, sum(size for _, (_, size) in parts)
            if last and rng.random() < 0.5 and size + 3 < room.left:
                fields[self.words.name(taken)] = f"{'text' if self.shape.groups else 'bytes'}[0..3]"
                size += 3
            return fields, size
        if roll < 0.5:
            return self._fixed_run()
        while True:
            spec, size = self._scalar()
            written = self._merged({"type": spec} if isinstance(spec, str) else spec)
            if {"const", "reserved", "bits", "counts"}.isdisjoint(written):
                return spec, size

    def texts(self, room: Room) -> Doc:
        """The fields of a message between separators; any may be empty that is optional."""
        rng, taken = self.rng, {*self.shape.attributes}
        made: Doc = {}
        for _ in range(rng.choice((1, 2, 3, 5))):
            if rng.random() < 0.3:
                low = rng.choice((0, 1, 1, 3))
                spec: Doc = {"type": f"text[{low}..{max(1, low + rng.choice((0, 2, 6)))}]"}
                size, optional = int(spec["type"].partition("..")[2][:-1]), low > 0
                if rng.random() < 0.3 and size > low:
                    spec["default"] = "#" * size
            elif self.spoken and rng.random() < 0.5:
                spec, size = self._word(list(self.spoken))
                optional = "const" not in spec
            else:
                spec, size = self._text_number()
                optional = not {"const", "reserved"} & spec.keys()
                if rng.random() < 0.6:
                    name, _, size_text = spec["as"].rstrip("]").partition("[")
                    least = rng.randint(1, int(size_text))
                    spec["as"] = rng.choice((f"{name}[{least}..{size_text}]", f"{name}[1..{size_text}]"))
            single = not {"const", "reserved", "default"} & spec.keys() and not spec["type"].startswith(
                "text"
            )
            if single and rng.random() < 0.25:
                number = rng.choice((1, 2, 3, 8))
                spec["type"], size = f"{spec['type']}[{number}]", number * (size + 1) - 1
            elif optional and rng.random() < 0.5:
                spec["optional"] = True
            if size < room.left:
                made[self.words.name(taken)] = spec
                room.left -= size + 1
        self._opened(made)
        return self._told(self._opened_before(self._with_real(made, room, taken)), room, taken)

    def _with_real(self, made: Doc, room: Room, taken: set[str]) -> Doc:
        """Perhaps one more field, of a floating-point number."""
        # Drawn from another source: the schemas of earlier seeds stay what they are.
        rng = random.Random(repr(self.rng.getstate()))
        name = next(each for each in ("reading", "reading_2", "reading_3") if each not in taken)
        if rng.random() < 0.6 or room.left <= _REAL or {f"{name}_count", f"{name}_size"} & taken:
            return made
        spec: Doc = {"type": rng.choice(("f32", "f64")), "as": "scientific"}
        spec |= rng.choice(({}, {}, {"range": "-10..1000"}, {"default": 1.5}, {"default": -2.5e-7}))
        spec |= {"optional": True} if rng.random() < 0.4 else {}
        taken.add(name)
        room.left -= _REAL + 1
        names = list(made)
        at = rng.randint(0, max(0, len(names) - 1))
        before, after = ({each: made[each] for each in part} for part in (names[:at], names[at:]))
        return {**before, name: spec, **after}

    def _opened(self, made: Doc) -> None:
        """A list at the end may have fewer items."""
        last = list(made.values())[-1] if made else {"type": ""}
        name, _, number = last["type"].partition("[")
        if number and name != "text" and self.rng.random() < 0.7:
            last["type"] = f"{name}[{self.rng.choice((0, 0, 1))}..{number}"

    def _opened_before(self, made: Doc) -> Doc:
        """A list before fields that are always there may have fewer items, if no other one has."""
        # Drawn from another source: the schemas of earlier seeds stay what they are.
        rng, names = random.Random(repr(self.rng.getstate())), list(made)
        if not names or ".." in made[names[-1]]["type"].replace("text", "") or rng.random() < 0.3:
            return made
        lists = [name for name in names[:-1] if made[name]["type"].endswith("]")]
        lists = [name for name in lists if not made[name]["type"].startswith("text")]
        if not lists:
            return made
        chosen = rng.choice(lists)
        for name in names[names.index(chosen) + 1 :]:
            made[name].pop("optional", None)
        name, _, number = made[chosen]["type"].partition("[")
        made[chosen]["type"] = f"{name}[{rng.choice((0, 0, 1))}..{number}"
        return made

    def _told(self, made: Doc, room: Room, taken: set[str]) -> Doc:
        """Perhaps a count before a list of varying length."""
        # Drawn from another source: the schemas of earlier seeds stay what they are.
        rng, names = random.Random(repr(self.rng.getstate())), list(made)
        lists = [name for name in names if ".." in made[name]["type"] and "1..1]" not in made[name]["type"]]
        lists = [name for name in lists if not made[name]["type"].startswith("text")]
        name = next(each for each in ("number", "number_2", "number_3") if each not in taken)
        if not lists or room.left <= _TOLD or rng.random() < 0.5:
            return made
        counted = rng.choice(lists)
        forms = ("decimal", "decimal[1..3]", "decimal[2]", "hex[1..2]", "hex[4]")
        spec = {"type": rng.choice(("u8", "u16")), "as": rng.choice(forms), "counts": counted}
        taken.add(name)
        room.left -= _TOLD + 1
        at = rng.randint(0, names.index(counted))
        before, after = ({each: made[each] for each in part} for part in (names[:at], names[at:]))
        return {**before, name: spec, **after}

    def _dated(self, made: list[tuple[str, Any]], taken: set[str]) -> list[tuple[str, Any]]:
        """Some fields begin with a version of the protocol, and others have ended before the newest one."""
        rng = self.rng
        dated = [
            (name, {**spec, "since": "1.10"})
            if isinstance(spec, dict) and rng.random() < 0.05
            else (name, spec)
            for name, spec in made
        ]
        if rng.random() < 0.1:
            dated.insert(rng.randint(0, len(dated)), (self.words.name(taken), {"type": "u8", "until": "1.9"}))
        return dated

    def _name_sizes(self, made: list[tuple[str, Any]]) -> None:
        """Name the count in the brackets of some fields that have one, of items."""
        specs = dict(made)
        for name, spec in made:
            counts = [
                each for each in specs if isinstance(specs[each], dict) and specs[each].get("counts") == name
            ]
            if len(counts) != 1 or specs[counts[0]].get("counts_in") == "bytes" or self.rng.random() < 0.6:
                continue
            base, _, bounds = spec["type"].partition("[")
            count = {key: each for key, each in specs[counts[0]].items() if not key.startswith("counts")}
            specs[counts[0]] = {**count, "range": bounds.rstrip("]")}
            specs[name] = {**spec, "type": f"{base}[{counts[0]}]"}
        made[:] = list(specs.items())

    def _count_several(self, made: list[tuple[str, Any]]) -> None:
        """Count the bytes of other fields too, where a count of bytes has room for them."""
        rng, specs = self.rng, dict(made)
        for at, (name, spec) in enumerate(made):
            counting = isinstance(spec, dict) and spec.get("counts_in") == "bytes" and "scale" not in spec
            if not counting or spec["type"] != "u16" or rng.random() < 0.3:
                continue
            always = [
                each for each in specs if self._is_always(specs[each]) and not self.is_varied(specs[each])
            ]
            chosen = [each for each in always if rng.random() < 0.5]
            several = [*chosen, spec["counts"]]
            rng.shuffle(several)
            made[at] = (name, {**spec, "counts": several})
            if chosen:
                del made[at][1]["counts_in"]

    def _offset_counts(self, made: list[tuple[str, Any]]) -> None:
        """Let some counts be less than the number of items or bytes that they tell, or more."""
        specs = dict(made)
        for at, (name, spec) in enumerate(made):
            counted = spec.get("counts") if isinstance(spec, dict) else None
            run = specs.get(counted) if isinstance(counted, str) else None
            bounds = re.search(r"\[(\d+)\.\.\d+\]", str(run))
            if run is None or bounds is None or self.is_varied(run) or self.rng.random() < 0.8:
                continue
            base = str(run["type"] if isinstance(run, dict) else run).partition("[")[0]
            least = int(bounds[1])
            if (
                spec.get("counts_in") == "bytes"
                and re.fullmatch("[ui](16|24|32|64)", base)
                and self.rng.random() < 0.7
            ):
                step = int(base[1:]) // 8
                scale = self.rng.choice((step, 2 if step % 2 == 0 else step))
                if not isinstance(run, dict) or not {"packed", "as", "groups"} & run.keys():
                    made[at] = (
                        name,
                        {**spec, "scale": scale} | ({"offset": -2 * scale} if step == 2 else {}),
                    )
            else:
                made[at] = (name, {**spec, "offset": self.rng.choice((-1, -2, min(1, least), least))})

    @staticmethod
    def _is_always(spec: Any) -> bool:
        """Whether a field is always present, with a constant size."""
        if isinstance(spec, dict) and {"if", "optional"} & spec.keys():
            return False
        kind = str(spec["type"] if isinstance(spec, dict) else spec)
        return ".." not in kind and "[]" not in kind and kind not in ("bytes", "text")

    def is_varied(self, spec: Any) -> bool:
        """Whether a field holds records that are read one by one."""
        if isinstance(spec, dict) and "switch" in spec:
            return False
        kind = str(spec["type"] if isinstance(spec, dict) else spec)
        return kind.partition("[")[0] in self.varied

    def _add_conditions(self, made: list[tuple[str, Any]], kept: set[str], taken: set[str]) -> None:
        """Conditions on some fields, and optional fields at the end; `kept` fields stay as they are."""
        rng = self.rng
        opened = next((at for at, (_, each) in enumerate(made) if self._is_open(each, made)), len(made))
        specs: dict[str, Doc] = {
            name: dict(spec) if isinstance(spec, dict) else {"type": spec} for name, spec in made
        }
        if any("packed" in spec and ".." in spec["type"] for spec in specs.values()):
            return
        order = [name for name, _ in made]
        for at in range(min(opened + 1, len(order))):
            name = order[at]
            spec = specs[name]
            if name in kept or "counts" in spec or rng.random() < 0.5:
                continue
            counts = [each for each in order if specs[each].get("counts") == name]
            before = order[: min([order.index(each) for each in counts] + [at])]
            sure = rng.random() < 0.7
            choices = [
                each
                for other in before
                if "if" not in specs[other] or not sure
                for each in self._tests(other, specs)
            ]
            if choices:
                for each in (name, *counts):
                    specs[each]["if"] = choices[0] if len(choices) == 1 else choices[len(choices) // 2]
        while order and opened == len(made) and self.shape.has_length and rng.random() < 0.4:
            name = order.pop()
            run = ".." in specs[name]["type"] or specs[name]["type"] in ("bytes", "text")
            if (
                run
                or name in kept
                or self.is_varied(specs[name])
                or {"if", "const", "reserved", "counts"} & specs[name].keys()
            ):
                break
            specs[name]["optional"] = True
        made[:] = [(name, specs[name] if len(specs[name]) > 1 else spec) for name, spec in made]
        if opened < len(made):
            self._add_other_rest(made, opened, taken)

    def _add_other_rest(self, made: list[tuple[str, Any]], opened: int, taken: set[str]) -> None:
        """Another field that takes the rest, where the first one is absent."""
        rest = made[opened][1]
        when = rest.get("if") if isinstance(rest, dict) else None
        if not isinstance(when, dict) or self.shape.groups or self.shape.word > 1 or self.rng.random() < 0.3:
            return
        ref, wanted = next(iter(when.items()))
        if isinstance(wanted, list):
            return
        reverse = not wanted if isinstance(wanted, bool) else f"not {wanted}"
        reverse = reverse.removeprefix("not not ") if isinstance(reverse, str) else reverse
        most = rest["type"].partition("..")[2].rstrip("]") or "1"
        name = self.words.name(taken)
        made.insert(opened + 1, (name, {"type": f"bytes[0..{most}]", "if": {ref: reverse}}))

    def _tests(self, name: str, specs: dict[str, Doc]) -> list[Any]:
        """A condition on a field, or on some of its bits."""
        spec = specs[name]
        kind = spec["type"]
        if "bits" in spec:
            return [self._test(f"{name}.{bit}", *self._bit_limits(each)) for bit, each in spec["bits"].items()
                    if isinstance(each, int | str)]  # fmt: skip
        if set(spec) - {"type", "byteorder", "default", "doc", "unit", "if"} or "[" in kind:
            return []
        if kind == "bool":
            return [self.rng.choice((name, {name: True}, {name: False}))]
        if kind in self.enums:
            members = list(self.enums[kind]["values"])
            number = self.enums[kind]["values"][members[-1]]
            return [self.rng.choice(({name: members[0]}, {name: f"not {members[0]}"}, {name: members[:2]},
                                     {name: number}))]  # fmt: skip
        plain = kind[:1] in "ui" and kind[1:].isdigit() and int(kind[1:]) <= 64
        return [self._test(name, *limits_of(kind))] if plain else []

    @staticmethod
    def _bit_limits(spec: int | str) -> tuple[int, int]:
        first, _, last = str(spec).partition("..")
        return 0, (1 << int(last or first) + 1 - int(first)) - 1

    def _test(self, ref: str, low: int, high: int) -> Any:
        middle = (low + high) // 2
        return self.rng.choice(
            (
                {ref: low},
                {ref: high},
                {ref: f"{low}..{middle}"},
                {ref: f"not {low}..{middle}"},
                {ref: [high, low]},
                {ref: f"not {high}"},
            )
        )

    def _add_field(self, made: list[tuple[str, Any]], taken: set[str], room: Room) -> None:
        roll = self.rng.random()
        name = self.words.name(taken)
        if roll < self.variable and not room.fixed:
            self._variable(name, made, taken, room)
            return
        if self.varied and not room.fixed and self.rng.random() < 2 * self.structured:
            self._varied_field(name, made, taken, room)
            return
        if self.arrayed and self.rng.random() < self.structured:
            spec, size = self._of_record()
        elif roll < 0.42:
            spec, size = self._fixed_run()
        elif roll < 0.52:
            spec, size = self._packed(taken)
        else:
            spec, size = self._scalar()
            if isinstance(spec, dict) and self.rng.random() < 0.3:
                spec["doc"] = self.words.text()
        if spec is not None and size <= room.left - room.least:
            made.append((name, spec))
            room.left -= size

    @staticmethod
    def _least(spec: Any) -> bool:
        kind = str(spec["type"] if isinstance(spec, dict) else spec)
        return "[" not in kind and kind not in ("bytes", "text")

    def _fill_words(self, made: list[tuple[str, Any]], taken: set[str]) -> None:
        """Reserved bytes as padding to whole words."""
        size = sum(self._packet_size(spec) for _, spec in made)
        while size % self.shape.word:
            made.append((self.words.name(taken), {"type": "u8", "reserved": True}))
            size += 1
        while made and size > self.shape.most:
            size -= self._packet_size(made.pop()[1])
        while size % self.shape.word:
            size -= self._packet_size(made.pop()[1])

    def _add_words(self, made: list[tuple[str, Any]], taken: set[str]) -> None:
        """Whole words at the end, of any number, if a length tells it."""
        left = (self.shape.most - sum(self._packet_size(spec) for _, spec in made)) // self.shape.word
        if self.shape.has_length and self.shape.word == 2 and left > 0 and self.rng.random() < self.variable:
            kind = self.rng.choice(("u16", "i16", "f16"))
            made.append((self.words.name(taken), f"{kind}[0..{self.rng.choice((1, left))}]"))

    def _row(self, name: str, made: list[tuple[str, Any]], taken: set[str], room: Room) -> None:
        """A packed array of variable size, with a count of its items and perhaps one of its bytes."""
        rng = self.rng
        if any("terminator" in each for _, each in made):
            return
        kind, spec, bits = self._bits_in_a_row()
        most = min(rng.choice((1, 3, 8, 17, 40, 250)), (room.left - room.least - 6) * 8 // bits)
        if most < 2 or any(self.is_varied(each) for _, each in made):
            return
        opened = next((at for at, (_, each) in enumerate(made) if self._is_open(each, made)), len(made))
        self._count(name, "items", most, made, opened, taken=taken, room=room)
        if rng.random() < 0.4:
            after = next(
                at
                for at, (_, each) in enumerate(made)
                if isinstance(each, dict) and each.get("counts") == name
            )
            size, before = -(-most * bits // 8), made[: after + 1]
            del made[: after + 1]
            self._count(name, "bytes", size, made, opened - after, taken=taken, room=room)
            made[:0] = before
        made.append((name, {"type": f"{kind}[{rng.choice((0, 0, 1, most - 1))}..{most}]", **spec}))
        room.left -= -(-most * bits // 8)

    def _variable(self, name: str, made: list[tuple[str, Any]], taken: set[str], room: Room) -> None:
        """A field of variable size: with one or two preceding counts, or as the rest of the payload."""
        rng = self.rng
        if rng.random() < 0.15 and not self.shape.groups:
            self._row(name, made, taken, room)
            return
        if rng.random() < 0.15 and self.shape.text and self.shape.has_length:
            self._terminated(rng, name, made, room)
            return
        # Drawn from another source: the schemas of earlier seeds stay what they are.
        more = random.Random(f"terminated {rng.getstate()!r}")
        if more.random() < 0.2 and self.shape.text and not self.shape.has_length and not self.shape.trimmed:
            self._terminated(more, name, made, room)
            return
        kind, spec, step = self._variable_kind()
        most = min(rng.choice((1, 3, 8, 40, 250)), (room.left - room.least - self._counts_size) // step)
        if most < 1:
            return
        low = rng.choice((0, 0, 0, 1, most))
        opened = next((at for at, (_, each) in enumerate(made) if self._is_open(each, made)), len(made))
        counted = not room.open_end or opened < len(made) or rng.random() < 0.5
        if counted:
            low = min(low, most - 1)
        spec = {"type": f"{kind}[{low}..{most}]", **spec}
        if counted:
            for unit in rng.choice((("items",), ("items",), ("bytes",), ("items", "bytes"))):
                number = most * (step if unit == "bytes" else 1)
                self._count(name, unit, number, made, opened, taken=taken, room=room)
                opened += 1
        elif low == 0 and rng.random() < 0.3 and kind in ("bytes", "text", *self.arrayed):
            spec["type"] = f"{kind}[]" if kind in self.arrayed else kind
            most = int(kind in self.arrayed)
        made.append((name, spec))
        room.left -= most * step
        room.open_end = room.open_end and counted

    def _terminated(self, rng: random.Random, name: str, made: list[tuple[str, Any]], room: Room) -> None:
        """A text that a character ends, or bytes, before a field that takes the rest."""
        most = min(rng.choice((1, 3, 8, 40)), room.left - room.least - 1)
        rows = any("packed" in spec and ".." in spec["type"] for _, spec in made if isinstance(spec, dict))
        if most < 1 or rows:
            return
        low = rng.choice((0, 0, min(1, most - 1)))
        spec: Doc = {"type": f"text[{low}..{most}]", "terminator": rng.choice(("00", "0D", "20"))}
        if rng.random() < 0.3:
            spec["default"] = "a"
        other = random.Random(f"bytes {rng.getstate()!r}")
        if other.random() < 0.5 and not self.shape.groups:
            spec = {"type": f"bytes[{low}..{most}]", "terminator": other.choice(("00", "FF", "7E"))}
            spec |= {"default": "20"} if other.random() < 0.3 else {}
        opened = next((at for at, (_, each) in enumerate(made) if self._is_open(each, made)), len(made))
        made.insert(rng.randint(0, opened), (name, spec))
        room.left -= most + 1

    def _is_open(self, spec: Any, made: list[tuple[str, Any]]) -> bool:
        counts = [each["counts"] for _, each in made if isinstance(each, dict) and "counts" in each]
        names = {name for each in counts for name in ([each] if isinstance(each, str) else each)}
        if isinstance(spec, dict) and "last" in spec:
            return False
        kind = str(spec["type"] if isinstance(spec, dict) else spec)
        kind = kind.replace("[]", "[..]")
        if isinstance(spec, dict) and "terminator" in spec:
            return False
        own = next(name for name, each in made if each is spec)
        return (kind in ("bytes", "text") or ".." in kind) and own not in names

    def _variable_kind(self) -> tuple[str, Doc, int]:
        rng = self.rng
        kinds = ["array", *(["text"] if self.shape.text else []), *([] if self.shape.groups else ["bytes"])]
        if self.arrayed and rng.random() < 2 * self.structured:
            name = rng.choice(list(self.arrayed))
            return name, {}, self.arrayed[name].size
        kind = rng.choice(kinds)
        if kind != "array":
            return kind, {}, 1
        return self._item()

    def _count(
        self,
        name: str,
        unit: str,
        most: int,
        made: list[tuple[str, Any]],
        end: int,
        *,
        taken: set[str],
        room: Room,
    ) -> None:
        """A count anywhere before its field, and before an uncounted one at `end`."""
        rng = self.rng
        kind = "u8" if most < 256 and rng.random() < 0.75 else "u16"
        spec: Doc = {"type": kind, "counts": name, "counts_in": unit}
        if unit == "items" and rng.random() < 0.5:
            del spec["counts_in"]
        if kind == "u16" and not self.shape.groups and rng.random() < 0.4:
            spec["byteorder"] = rng.choice(("big", "little"))
        made.insert(rng.randint(0, end), (self.words.name(taken), spec))
        room.left -= self._bytes_of(kind, {})


def _cases_of(spec: Any) -> list[Any]:
    """What a choice may be; nothing for other fields."""
    if not isinstance(spec, dict) or "switch" not in spec:
        return []
    return [*spec["cases"].values(), *([spec["default"]] if "default" in spec else [])]
