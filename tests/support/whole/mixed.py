"""Random headers and trailers: bits, several ids, constants of several values, derived numbers."""

from __future__ import annotations

import random
from dataclasses import dataclass, field
from typing import Any

from tests.support.whole.reference.fields import bits_of_type

Doc = dict[str, Any]


def draw_value(rng: random.Random) -> Doc:
    """A value of every frame."""
    spec: Doc = {"type": rng.choice(("u8", "u8", "u16", "i8", "i24", "u32", "u40"))}
    if rng.random() < 0.4:
        low = rng.choice((0, 1, 3))
        spec |= {"range": f"{low}..{low + rng.choice((0, 4, 100))}", "default": low}
    elif rng.random() < 0.4:
        spec |= {"scale": "1/2"} if rng.random() < 0.5 else {"default": rng.choice((0, 1, 5))}
    return spec


@dataclass
class Mixture:
    """Parts before and after the payload by name, and what they identify.

    Attributes:
        pieces: name and bits of each piece of the message id.
        address: name of the address, "" if there is none.
        directed: whether a part states the direction.
        ways: its values beyond the two of the directions.
    """

    rng: random.Random
    front: Doc = field(default_factory=dict)
    back: Doc = field(default_factory=dict)
    pieces: list[tuple[str, int]] = field(default_factory=list)
    address: str = ""
    address_bits: int = 0
    directed: bool = False
    length: str = ""
    ways: list[str] = field(default_factory=list)

    def draw(self) -> None:
        """Draw all of them."""
        rng, bits = self.rng, dict[str, Doc]()
        parts = self._identified(bits)
        if bits or rng.random() < 0.2:
            parts["head"] = self._container(bits)
        for name in ("node", "way"):
            if name in parts:
                parts[name]["type"] = self._type()
        if self.directed and "way" in parts:
            parts["way"]["values"] = self._ways(int(parts["way"]["type"][1:]))
        if rng.random() < 0.3:
            const = rng.randrange(1 << 8)
            parts["version"] = {"type": "u8", "const": rng.choice((const, [const], [const, const ^ 0x22]))}
        has_length = rng.random() < 0.6
        if has_length:
            self.length = "size"
            parts["size"] = {"counts": ["data"], "type": rng.choice(("u8", "u8", "u16"))}
        self._count(parts)
        for name in ("component", "status"):
            if rng.random() < 0.3:
                parts[name] = draw_value(rng)
        self._place(parts, may_trail=has_length)
        self._derive()
        self._measure()

    def _identified(self, bits: dict[str, Doc]) -> dict[str, Doc]:
        """Parts with message id, address and direction; those of other parts are added to ``bits``."""
        rng, parts = self.rng, dict[str, Doc]()
        style = rng.choice(("whole", "whole", "split", "bits", "bits", "none"))
        if style in ("whole", "split"):
            text = style == "whole" and rng.random() < 0.3
            parts["code"] = {
                "role": "message",
                "type": f"text[{rng.randint(1, 5)}]" if text else self._type(),
            }
        if style == "split":
            parts["sub"] = {"role": "message", "type": "u8"}
        if style == "bits" or (style == "split" and rng.random() < 0.3):
            bits["function"] = {"role": "message"}
        where = rng.choice(("", "whole", "bits"))
        if where:
            self.address = "node" if where == "whole" else "unit"
            (parts if where == "whole" else bits)[self.address] = {"role": "address"}
        way = rng.choice(("", "", "whole", "bits"))
        if way:
            (parts if way == "whole" else bits)["way"] = {"role": "direction"}
            self.directed = True
        return parts

    def _count(self, parts: dict[str, Doc]) -> None:
        """Perhaps a counter, in a part of its own or in the last bit of another."""
        rng = self.rng
        if rng.random() < 0.75:
            return
        counter: Doc = {"role": "counter"} | rng.choice(({}, {"echo": True}, {"per": "frame"}))
        # Drawn from another source: the schemas of earlier seeds stay what they are.
        if "per" not in counter and random.Random(f"repeats {rng.getstate()!r}").random() < 0.5:
            counter["repeats"] = "answered"
        if "head" not in parts or rng.random() < 0.5:
            parts["sequence"] = {**counter, "type": rng.choice(("u8", "u16"))}
        elif (last := int(parts["head"]["type"][1:]) - 1) not in _used(parts["head"]):
            parts["head"]["bits"]["toggle"] = {**counter, "at": last}

    def _type(self) -> str:
        return self.rng.choices(("u8", "u16", "u24", "u32", "u40", "u48"), (30, 5, 1, 2, 1, 1))[0]

    def _container(self, bits: dict[str, Doc]) -> Doc:
        """An integer with these bits, constant ones, and gaps."""
        rng = self.rng
        if rng.random() < 0.5 or not bits:
            bits["fixed"] = {"const": 0}
        if rng.random() < 0.4:
            bits["grade"] = rng.choice(({}, {"signed": True}, {"range": "1..2", "default": 1}))
        names, width = list(bits), rng.choice((8, 8, 16, 16, 24))
        rng.shuffle(names)
        room, at, inside = width - 2 * len(names), rng.choice((0, 0, 1)), dict[str, Doc]()
        for name in names:
            size = rng.choice((2, 2 + rng.randint(0, max(0, room - 2))))
            room -= size - 2
            size = min(size, width - at)
            if size < 1:
                break
            spec = {"at": f"{at}..{at + size - 1}" if size > 1 else at, **bits[name]}
            if "const" in spec:
                spec["const"] = rng.choice((rng.randrange(1 << size), [0, (1 << size) - 1]))
            if spec.get("role") == "direction":
                spec["values"] = self._ways(size)
            inside[name] = spec
            at += size
        for name in set(names) - set(inside):
            if name == self.address:
                self.address = ""
            self.directed = self.directed and name != "way"
        order = {"byteorder": rng.choice(("big", "little"))} if rng.random() < 0.3 else {}
        return {"type": f"u{width}", "bits": inside, **order}

    def _ways(self, bits: int) -> Doc:
        request = self.rng.randrange(min(1 << bits, 256))
        # Without a draw: the schemas of earlier seeds stay what they are.
        others = {"refused": request ^ 3, "late": request ^ 2} if bits > 1 and request % 2 else {}
        self.ways = list(others)
        return {"request": request, "response": request ^ 1, **others}

    def _place(self, parts: dict[str, Doc], *, may_trail: bool) -> None:
        names = list(parts)
        self.rng.shuffle(names)
        for name in names:
            spec = parts[name]
            text = str(spec)
            identifies = "'message'" in text or "'direction'" in text
            late = self.rng.random() < 0.25 and name != self.length and (may_trail or not identifies)
            (self.back if late else self.front)[name] = spec

    def _derive(self) -> None:
        """Perhaps a number that follows from an earlier one."""
        rng = self.rng
        every = {**self.front, **self.back}.items()
        sources = [name for name, spec in every if not _constant(spec) and "text" not in spec["type"]]
        if not sources or rng.random() < 0.6:
            return
        name = rng.choice(sources)
        form = rng.choice(("{}", "~{}", "~ {}", "{} + 1", "{} - 3", "~{} + 200"))
        spec = {
            "type": {**self.front, **self.back}[name]["type"].replace("i", "u"),
            "equals": form.format(name),
        }
        group = self.back if name in self.back or rng.random() < 0.4 else self.front
        names = list(group)
        first = names.index(name) + 1 if name in group else 0
        names.insert(rng.randint(first, len(names)), "again")
        group["again"] = spec
        items = {each: group[each] for each in names}
        group.clear()
        group.update(items)

    def _measure(self) -> None:
        for name, spec in {**self.front, **self.back}.items():
            for each, inner in {name: spec, **spec.get("bits", {})}.items():
                first, _, last = str(inner.get("at", "")).partition("..")
                if inner.get("role") not in ("message", "address"):
                    continue
                size = int(last or first) + 1 - int(first) if first else bits_of_type(inner["type"])
                if inner.get("role") == "message":
                    self.pieces.append((each, size))
                elif inner.get("role") == "address":
                    self.address_bits = size


def _used(spec: Doc) -> set[int]:
    """The bits of an integer that have a role."""
    used = set[int]()
    for each in spec["bits"].values():
        first, _, last = str(each["at"]).partition("..")
        used |= set(range(int(first), int(last or first) + 1))
    return used


def _constant(spec: Doc) -> bool:
    """Whether it has a single value and thus no number."""
    const = spec.get("const")
    return isinstance(const, int) or (isinstance(const, list) and len(const) == 1)
