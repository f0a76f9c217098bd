"""Random types of fields: numbers of every kind, words, bits, and lists of them."""

from __future__ import annotations

import random
from collections.abc import Callable
from dataclasses import dataclass, field
from fractions import Fraction
from typing import Any, Protocol

from tests.support.whole.frames import Shape

Doc = dict[str, Any]
_INTEGERS = ("u8", "u8", "i8", "u16", "i16", "u24", "i24", "u32", "i32", "u40", "i48", "u56", "u64", "i64")
_SCALES = (("1/10", 10), ("1/2^8", 256), ("0.5", 2), ("5", 1), ("-1/4", 4), ("1/1000", 1000), ("1/3", 3))


class _Words(Protocol):
    def name(self, taken: set[str]) -> str: ...
    def text(self) -> str: ...
    def unit(self) -> str: ...


@dataclass
class Structure:
    """A record: its definition, its size, and the number of records inside each other."""

    spec: Doc
    size: int
    depth: int
    #: The condition that ends an array.
    last: Doc = field(default_factory=dict)
    #: Texts in it have terminators, which a frame without a length does not allow.
    ended: bool = False
    #: Some of its values take all bytes that are left.
    rests: bool = False


@dataclass
class KindMaker:
    """Creates types of fields that have one value, or a constant number of values.

    Attributes:
        rng: chance.
        words: names and texts.
        shape: the frame.
    """

    rng: random.Random
    words: _Words
    shape: Shape
    taken: set[str] = field(default_factory=set)
    enums: Doc = field(default_factory=dict)
    flags: Doc = field(default_factory=dict)
    #: Enums of words.
    spoken: Doc = field(default_factory=dict)
    named: Doc = field(default_factory=dict)
    records: dict[str, Structure] = field(default_factory=dict)
    #: Integers with bits, which arrays have as records.
    bitty: dict[str, Structure] = field(default_factory=dict)

    @property
    def arrayed(self) -> dict[str, Structure]:
        """What arrays may have as records of fixed size."""
        return {**self.records, **self.bitty}

    def _members(self, limit: int, low: int = 0) -> Doc:
        rng = self.rng
        names: set[str] = set()
        numbers = {low, limit - 1, *(rng.randrange(low, limit) for _ in range(rng.randint(0, 3)))}
        return {self.words.name(names): number for number in sorted(numbers)}

    def _enum(self, kind: str) -> Doc:
        bits = int(kind[1:])
        low, limit = (-(1 << bits - 1), 1 << bits - 1) if kind[0] == "i" else (0, 1 << bits)
        return {"type": kind, "doc": self.words.text(), "values": self._members(limit, low)}

    def _spoken(self) -> Doc:
        """An enum of words, of one length or of several."""
        rng, names = self.rng, set[str]()
        size = rng.choice((0, 0, 1, 1, 2, 5))
        characters = "ABCabc019+-?*/%"
        words = {
            "".join(rng.choice(characters) for _ in range(size or rng.choice((1, 2, 3, 7))))
            for _ in range(rng.choice((1, 2, 3, 8)))
        }
        listed = rng.sample(sorted(words), len(words))
        if len({word.upper() for word in words}) == len(words) and random.Random(repr(listed)).random() < 0.4:
            named = {self.words.name(names): word for word in listed}
            return {"type": "text", "ignore_case": True, "values": named}
        return {"type": "text", "values": {self.words.name(names): word for word in listed}}

    def _word(self, kinds: list[str]) -> tuple[Any, int]:
        """A word of one of these enums."""
        rng, name = self.rng, self.rng.choice(kinds)
        spec: Doc = {"type": name}
        if rng.random() < 0.5:
            names = list(self.spoken[name]["values"])
            key = rng.choice(("default", "default", "const"))
            several = key == "const" and rng.random() < 0.3
            spec[key] = rng.sample(names, rng.randint(1, len(names))) if several else rng.choice(names)
        return spec, self._longest(name)

    def _fixed_word(self) -> tuple[Any, int]:
        """A word of an enum whose words have one length."""
        fixed = [
            name for name in self.spoken if len(set(map(len, self.spoken[name]["values"].values()))) == 1
        ]
        return self._word(fixed) if fixed else self._plain()

    def _longest(self, name: str) -> int:
        return max(map(len, self.spoken[name]["values"].values()))

    def _flags(self, kind: str) -> Doc:
        rng, names, bits = self.rng, set[str](), int(kind[1:])
        numbers = {0, bits - 1, *(rng.randrange(bits) for _ in range(2))}
        spec: Doc = {"type": kind, "values": {self.words.name(names): bit for bit in sorted(numbers)}}
        return spec | ({"reserved": "zero"} if rng.random() < 0.5 else {})

    def _bytes_of(self, kind: str, spec: Doc) -> int:
        bits, groups = int(kind[1:]), spec.get("groups") or self.shape.groups
        parts = [each.split("..") for each in spec.get("parts", [f"0..{bits - 1}"])]
        width = groups["bits"] if groups else 8
        return sum(-(-(int(last) + 1 - int(first)) // width) for first, last in parts)

    def _packet_size(self, spec: Any) -> int:
        written: Doc = {"type": spec} if isinstance(spec, str) else spec
        base, _, count = written["type"].partition("[")
        if base in self.spoken:
            return self._longest(base) * int(count.rstrip("]") or 1)
        if base in self.arrayed:
            return int(self.arrayed[base].size * int(count.rstrip("]") or 1))
        if "packed" in written:
            base = self.enums.get(base, {"type": base})["type"]
            return -(-int(count.rstrip("]")) * (1 if base == "bool" else int(base[1:])) // 8)
        named = self.named.get(base)
        if named is not None:
            return self._packet_size(
                {
                    **(named if isinstance(named, dict) else {"type": named}),
                    **{key: value for key, value in written.items() if key != "type"},
                }
            )
        base = self.enums.get(base, self.flags.get(base, {"type": base}))["type"]
        if "[" in written.get("as", ""):
            size = int(written["as"].partition("[")[2].rstrip("]"))
        elif base in ("bool", "bytes", "text"):
            size = 1
        elif "fixed" in base:
            size = sum(map(int, base.lstrip("u").removeprefix("fixed").split("."))) // 8
        else:
            size = self._bytes_of(base, written)
        return size * int(count.rstrip("]") or 1)

    def _scalar(self) -> tuple[Any, int]:
        rng = self.rng
        made: Callable[[], tuple[Any, int]] = rng.choice(
            (self._plain, self._plain, self._plain, self._ranged, self._truth, self._of_enum, self._of_flags,
             self._scaled, self._fixed_point, self._constant, self._reserved, self._grouped, self._of_named,
             self._real, self._digits, self._text_number, self._fixed_word, self._wide)
        )  # fmt: skip
        return made()

    def _integer(self) -> tuple[str, Doc, int]:
        """An integer type, its byte order if it differs, its size."""
        if self.shape.groups:
            bits = self.rng.choice((1, 6, 7, 8, 13, 14, 16, 20, 28, 32, 64))
            kind = f"{'i' if bits > 1 and self.rng.random() < 0.3 else 'u'}{bits}"
            return kind, {}, self._bytes_of(kind, {})
        kind = self.rng.choice(_INTEGERS)
        order: Doc = {"byteorder": self.rng.choice(("big", "little"))} if self.rng.random() < 0.3 else {}
        return kind, order, int(kind[1:]) // 8

    def _plain(self) -> tuple[Any, int]:
        kind, order, size = self._integer()
        if not order and self.rng.random() < 0.5:
            return kind, size
        spec: Doc = {"type": kind, **order}
        low, high = limits_of(kind)
        if self.rng.random() < 0.5:
            spec["default"] = self.rng.choice((low, high, self.rng.randint(low, high)))
        if self.rng.random() < 0.3:
            spec["unit"] = self.words.unit()
        return spec, size

    def _ranged(self) -> tuple[Any, int]:
        kind, order, size = self._integer()
        low, high = limits_of(kind)
        first = self.rng.choice((low, high, min(high, low + 1), self.rng.randint(low, high)))
        last = self.rng.choice((first, high, self.rng.randint(first, high)))
        spec: Doc = {"type": kind, **order, self.rng.choice(("range", "raw_range")): f"{first}..{last}"}
        if self.rng.random() < 0.6:
            spec["default"] = self.rng.choice((first, last))
        return spec, size

    def _truth(self) -> tuple[Any, int]:
        return self.rng.choice(("bool", {"type": "bool", "default": True})), 1

    def _of_enum(self) -> tuple[Any, int]:
        name = self.rng.choice(list(self.enums))
        enum = self.enums[name]
        if enum["type"] == "u3" and not self.shape.groups:
            return self._truth()
        member = self.rng.choice(list(enum["values"]))
        spec = self.rng.choice((name, {"type": name, "default": member}))
        return spec, self._bytes_of(enum["type"], {})

    def _of_flags(self) -> tuple[Any, int]:
        if not self.flags:
            return self._truth()
        name = self.rng.choice(list(self.flags))
        bit = next(iter(self.flags[name]["values"].values()))
        spec = self.rng.choice((name, {"type": name, "default": 1 << bit}))
        return spec, self._bytes_of(self.flags[name]["type"], {})

    def _scaled(self) -> tuple[Any, int]:
        kind, order, size = self._integer()
        scale, below = self.rng.choice(_SCALES)
        if scale == "1/3" and int(kind[1:]) > 53:
            scale, below = "1/10", 10
        spec: Doc = {"type": kind, **order, "scale": scale, "unit": self.words.unit()}
        if self.rng.random() < 0.4:
            spec["offset"] = self.rng.choice((-40, 100, 1))
        if self.rng.random() < 0.4 and below in (1, 2, 4):
            low, high = limits_of(kind)
            raw = self.rng.choice((low, high, self.rng.randint(low, high)))
            if abs(raw) < 1 << 40:
                spec["default"] = _decimal(raw * Fraction(scale) + spec.get("offset", 0))
        return spec, size

    def _fixed_point(self) -> tuple[Any, int]:
        kinds = (
            ("fixed16.16", 32),
            ("ufixed8.8", 16),
            ("fixed4.4", 8),
            ("fixed32.32", 64),
            ("ufixed1.15", 16),
        )
        kind, bits = self.rng.choice(kinds)
        return kind, self._bytes_of(f"u{bits}", {})

    def _wide(self) -> tuple[Any, int]:
        """An integer of more than 64 bits."""
        rng = self.rng
        if self.shape.groups:
            return self._plain()
        kind = rng.choice(("u72", "i72", "u96", "u128", "i128"))
        low, high = limits_of(kind)
        spec: Doc = {"type": kind}
        if rng.random() < 0.3:
            spec["byteorder"] = rng.choice(("big", "little"))
        roll = rng.random()
        first = rng.choice((low, high, rng.randint(low, high), rng.randint(0, 1 << 64)))
        if roll < 0.3:
            spec["range"] = f"{first}..{rng.choice((high, rng.randint(first, high)))}"
        elif roll < 0.6:
            spec[rng.choice(("default", "const"))] = first
        return spec, int(kind[1:]) // 8

    def _digits(self) -> tuple[Any, int]:
        """A number in binary-coded decimal."""
        rng = self.rng
        if self.shape.groups:
            return self._plain()
        kind = rng.choice(("u8", "u16", "u24", "u32", "u64"))
        size = int(kind[1:]) // 8
        most = 100**size - 1
        spec: Doc = {"type": kind, "as": "bcd"}
        if rng.random() < 0.3:
            spec["byteorder"] = rng.choice(("big", "little"))
        roll = rng.random()
        if roll < 0.25:
            low = rng.randint(0, most)
            spec["range"] = f"{low}..{rng.randint(low, most)}"
        elif roll < 0.5:
            spec["scale"] = "1/100"
        elif roll < 0.75:
            spec[rng.choice(("default", "const"))] = rng.choice((most, rng.randint(0, most)))
        return spec, size

    def _text_number(self) -> tuple[Any, int]:
        """A number as text of a constant number of characters."""
        rng = self.rng
        if self.shape.groups:
            return self._plain()
        kind = rng.choice(("u8", "u16", "i16", "u24", "i24", "i32", "u64", "i64"))
        if kind[0] == "u" and rng.random() < 0.4:
            size = rng.choice((1, 2, 4, 5))
            spec: Doc = {"type": kind, "as": f"hex[{size}]"}
            most = min(16**size, 1 << int(kind[1:])) - 1
        else:
            point = rng.choice((0, 0, 1, 2, 4))
            size = point + 2 + rng.choice((0, 1, 2, 5))
            spec = {"type": kind, "as": f"decimal[{size}]"}
            spec |= {"scale": f"1/{10**point}"} if point else {}
            spec |= {"pad": "20"} if rng.random() < 0.25 else {}
            most = min(10 ** (size - (point > 0)), 1 << int(kind[1:]) - (kind[0] == "i")) - 1
        if "scale" not in spec and rng.random() < 0.5:
            low = rng.randint(0, most)
            spec["range"] = f"{low}..{rng.randint(low, most)}"
            if rng.random() < 0.3:
                spec["const"] = low
        return spec, size

    def _real(self) -> tuple[Any, int]:
        """A floating-point number."""
        rng, kind = self.rng, self.rng.choice(("f16", "f32", "f32", "f64"))
        if self.shape.groups:
            return self._plain()
        size = int(kind[1:]) // 8
        spec: Doc = {"type": kind}
        if rng.random() < 0.3:
            spec["byteorder"] = rng.choice(("big", "little"))
        if rng.random() < 0.3:
            low, high = rng.choice(
                ((-1, 1), (0, 100), ("-0.1", "0.1"), (-5, 0), (1, "2.5"), (-9, "-1/3"), (2, 2))
            )
            return spec | {"range": f"{low}..{high}"}, size
        if rng.random() < 0.5:
            key = rng.choice(("default", "default", "const"))
            spec[key] = rng.choice((0, 1, -2.5, 0.1, "1/3", "-inf", "1e4"))
        return spec, size

    def _constant(self) -> tuple[Any, int]:
        kind, order, size = self._integer()
        low, high = limits_of(kind)
        const = self.rng.choice((high, low, self.rng.randint(low, high)))
        several = self.rng.random() < 0.2
        return {
            "type": kind,
            **order,
            "const": [*dict.fromkeys((const, low, high))] if several else const,
        }, size

    def _reserved(self) -> tuple[Any, int]:
        kind, order, size = self._integer()
        spec: Doc = {"type": kind, **order, "reserved": True}
        return spec | ({"const": limits_of(kind)[1]} if self.rng.random() < 0.3 else {}), size

    def _grouped(self) -> tuple[Any, int]:
        """Integers with their own groups of bits."""
        if self.shape.groups:
            return self._plain()
        bits, size = self.rng.choice((4, 6, 7)), self.rng.choice((7, 10, 13, 16, 24, 32, 64))
        kind = f"{self.rng.choice('ui')}{size}"
        spec: Doc = {"type": kind, "groups": {"bits": bits, "first": self.rng.choice(("least", "most"))}}
        if size >= 16 and self.rng.random() < 0.5:
            spec["parts"] = [f"{size // 2}..{size - 1}", f"0..{size // 2 - 1}"]
        return spec, self._bytes_of(kind, spec)

    def _of_named(self) -> tuple[Any, int]:
        if not self.named:
            return self._plain()
        name = self.rng.choice(list(self.named))
        return name, self._packet_size(name)

    def _item(self) -> tuple[str, Doc, int]:
        if self.rng.random() < 0.4:
            return self._named_item()
        if not self.shape.groups and self.rng.random() < 0.2:
            kind = self.rng.choice(("f16", "f32", "f64"))
            order: Doc = {"byteorder": self.rng.choice(("big", "little"))} if self.rng.random() < 0.3 else {}
            return kind, order, int(kind[1:]) // 8
        return self._integer()

    def _named_item(self) -> tuple[str, Doc, int]:
        """An item with a meaning, a scale or a range."""
        rng = self.rng
        made = rng.choice(
            (
                self._truth,
                self._of_enum,
                self._of_flags,
                self._scaled,
                self._ranged,
                self._fixed_point,
                self._of_named,
                self._digits,
                self._text_number,
                self._fixed_word,
            )
        )
        spec, size = made()
        written: Doc = {"type": spec} if isinstance(spec, str) else dict(spec)
        whole = self._merged(written)
        if not {"const", "reserved", "bits", "counts"}.isdisjoint(whole):
            return self._integer()
        keys = {key: value for key, value in written.items() if key not in ("type", "default", "doc")}
        return written["type"], keys, size

    def _merged(self, written: Doc) -> Doc:
        """A field with the keys of its named type."""
        named = self.named.get(written["type"], {})
        return {**(named if isinstance(named, dict) else {}), **written}

    def _fixed_run(self) -> tuple[Any, int]:
        rng, number = self.rng, self.rng.choice((1, 2, 3, 4, 9))
        roll = rng.random()
        if roll < 0.3 and not self.shape.groups:
            spec: Doc = {"type": f"bytes[{number}]"}
            if roll < 0.1:
                spec |= {"pad": rng.choice(("00", "20", "A5"))}
                return spec | ({"default": "01"} if rng.random() < 0.5 else {}), number
            return spec | ({"default": "01" * number} if rng.random() < 0.5 else {}), number
        if roll < 0.35 and self.shape.text:
            spec = {"type": f"text[{number}]", "pad": rng.choice(("00", "20"))}
            return spec | ({"default": "a"} if rng.random() < 0.5 else {}), number
        if roll < 0.5 and self.shape.text:
            spec = {"type": f"text[{number}]"}
            return spec | ({"default": "a" * number} if rng.random() < 0.5 else {}), number
        if roll > 0.85 and not self.shape.groups:
            kind, spec, bits = self._bits_in_a_row()
            return {"type": f"{kind}[{number}]", **spec}, -(-bits * number // 8)
        kind, order, size = self._item()
        return {"type": f"{kind}[{number}]", **order}, size * number

    def _of_record(self) -> tuple[Any, int]:
        """One record, or a constant number of them."""
        known = self.arrayed
        name, times = self.rng.choice(list(known)), self.rng.choice((0, 0, 1, 2, 4))
        times = max(1, times) if name in self.bitty else times
        spec: Any = f"{name}[{times}]" if times else name
        if self.rng.random() < 0.3:
            spec = {"type": spec, "doc": self.words.text()}
        return spec, known[name].size * max(1, times)

    def _bits_in_a_row(self) -> tuple[str, Doc, int]:
        """Type, keys and bits of an item of a packed array."""
        rng = self.rng
        kind = rng.choice(("bool", "bool", "u1", "u3", "i5", "u11", "i11", "u8", "u13", "u24", "i33", "u64"))
        bits = 1 if kind == "bool" else int(kind[1:])
        keys: Doc = {"packed": rng.choice(("least", "most"))}
        small = next((name for name, enum in self.enums.items() if enum["type"] == "u3"), "")
        if kind == "u3" and small:
            return small, keys, 3
        if bits > 1 and rng.random() < 0.3:
            keys |= rng.choice(({"range": "1..2"}, {"scale": "1/2"}, {"range": "0..1"}))
        return kind, keys, bits

    def _packed(self, taken: set[str]) -> tuple[Any, int]:
        """Bit fields of every kind inside an integer."""
        rng = self.rng
        kind, order, size = self._integer()
        bits: Doc = {}
        at, width = rng.randint(0, 2), int(kind[1:])
        while at < width and len(bits) < 6:
            wide = min(width - at, rng.choice((1, 1, 2, 3, 4, 8, 9, 16, 32, 64)))
            bits[self.words.name(taken)] = self._bit(at, wide)
            at += wide + rng.choice((0, 0, 1, 5))
        if not bits:
            return self._plain()
        return {"type": "u" + kind[1:], **order, "bits": bits}, size

    def _bit(self, at: int, wide: int) -> Any:
        rng, place = self.rng, f"{at}..{at + wide - 1}"
        roll = rng.random()
        small = next((name for name, enum in self.enums.items() if enum["type"] == "u3"), "")
        if wide == 1:
            return rng.choice((at, {"at": at, "type": "bool", "default": True}))
        if wide >= 3 and roll < 0.15 and small:
            return {"at": place, "type": small}
        if roll < 0.45:
            return {"at": place, "signed": True}
        if roll < 0.6:
            return {"at": place, "scale": "1/2", "unit": self.words.unit()}
        if roll < 0.75:
            top = (1 << wide) - 1
            return {"at": place, "range": f"0..{rng.choice((top, top // 2, 1))}"}
        return place


def limits_of(kind: str) -> tuple[int, int]:
    """The least and the greatest number of an integer type."""
    bits = int(kind[1:])
    return (-(1 << bits - 1), (1 << bits - 1) - 1) if kind[0] == "i" else (0, (1 << bits) - 1)


def _decimal(number: Fraction) -> float | int:
    return int(number) if number.denominator == 1 else float(number)
