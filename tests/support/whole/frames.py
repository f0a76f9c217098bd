"""Random frames of all kinds of parts."""

from __future__ import annotations

import random
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any, Protocol

from tests.support.whole import bit_ways, conditional, endings, header_texts, one_way, parties
from tests.support.whole.endings import Ending
from tests.support.whole.mixed import Mixture
from tests.support.whole.reference import checks
from tests.support.whole.reference.fields import bits_of_type

Doc = dict[str, Any]
_LEADS = ("7E", "A5 A5", "AA AA", "02 02", "02", "FF FF FD 00", "AA 55", "10 02", "68", "3A", "A5 A5 A5")
_ENDS = ("03", "0D 0A", "16", "10 03", "0D", "A5")
_LENGTHS = ("u8", "u8", "u8", "u16", "u16", "u24", "u32")
_SIZES = (4, 8, 16, 32, 64, 120, 200, 255, 300, 600)
_WIDTHS = {8: "u8", 16: "u16", 24: "u24", 32: "u32", 64: "u64"}


class _Words(Protocol):
    def name(self, taken: set[str]) -> str: ...


@dataclass
class Shape:
    """A frame, and its requirements on messages."""

    kind: str
    frame: Doc
    least: int
    most: int
    id_bits: int
    bus: str
    has_length: bool = True
    address_bits: int = 0
    address_name: str = ""
    mark: int = 0xA5
    end_id: int = -1
    groups: Doc = field(default_factory=dict)
    #: Text does not use the marker bit.
    text: bool = True
    #: Size of the words of payloads, or of the steps of their length; most of their fields have a fixed size.
    word: int = 0
    #: Zeros at the end of payloads are not sent; their fields have a fixed size.
    trimmed: bool = False
    #: The checksum of a marked frame lists its messages.
    only: bool = False
    #: Numeric attributes that check values cover.
    seeds: Doc = field(default_factory=dict)
    #: Name and bits of the pieces of the message id, if there is not just one.
    pieces: list[tuple[str, int]] = field(default_factory=list)
    #: The message id is text.
    text_id: bool = False
    #: A part states the direction, so every message needs one.
    directed: bool = False
    #: Values of that part that pick replies.
    ways: list[str] = field(default_factory=list)
    #: Number of the master, None if frames have none.
    master: int | None = None
    #: The greatest address, 0 if its bits tell.
    address_top: int = 0

    @property
    def shares(self) -> bool:
        """Whether only their request may tell answers apart: of any size, with the same attributes."""
        plain = not self.trimmed and not self.seeds and self.word <= 1
        return self.kind == "parts" and self.has_length and plain

    @property
    def attributes(self) -> set[str]:
        """Names of the address and the number of the master."""
        return {self.address_name, *(["master"] if self.master is not None else [])}

    def fit(self, number: int) -> int:
        """A number that can be an id."""
        if not self.text_id:
            return number
        data = number.to_bytes(self.id_bits // 8, "big")
        return int.from_bytes(bytes(48 + each % 43 for each in data), "big")

    def id(self, number: int) -> int | str | Doc:
        """A number as the id of a message; of several pieces the first is the most significant."""
        if self.text_id:
            return number.to_bytes(self.id_bits // 8, "big").decode("ascii")
        given = dict[str, int]()
        for name, bits in reversed(self.pieces):
            given[name] = number & (1 << bits) - 1
            number >>= bits
        return given if len(given) > 1 else next(iter(given.values()), number)

    def number(self, given: int | str | Doc) -> int:
        """The number of an id."""
        if isinstance(given, str):
            return int.from_bytes(given.encode("ascii"), "big")
        if isinstance(given, int):
            return given
        number = 0
        for name, bits in self.pieces:
            number = number << bits | given[name]
        return number


def choose(rng: random.Random, words: _Words) -> Shape:
    """A frame of any kind."""
    kind = rng.choices(("hunted", "parts", "mixed", "marked", "packet", "ended"), (16, 40, 26, 10, 8, 25))[0]
    if kind == "marked":
        return _marked(rng)
    if kind == "packet":
        shape = _packet(rng)
    elif kind == "mixed":
        shape = _Parts(rng, words).mixed()
    elif kind == "ended":
        shape = _Parts(rng, words).make_ended(endings.choose(rng))
    else:
        shape = _Parts(rng, words).make(hunted=kind == "hunted")
    # Drawn from another source: the schemas of earlier seeds stay what they are.
    more = random.Random(repr(rng.getstate()))
    if "parts" in shape.frame:
        _conditions(more, shape, plain=kind == "ended" and "coding" not in shape.frame)
        if shape.directed:
            bit_ways.add(random.Random(f"{rng.getstate()} ways"), shape.frame["parts"])
        header_texts.add(random.Random(f"{rng.getstate()} texts"), shape.frame["parts"])
    _end(rng, more, shape, kind)
    _count_steps(shape)
    for key in ("parts", "packet"):
        parts: Doc = shape.frame.get(key, {})
        for name, spec in parts.items():
            parts[name] = _shorter(rng, spec)
    return shape


def _end(rng: random.Random, more: random.Random, shape: Shape, kind: str) -> None:
    """Add a silence, or a coding that is decoded as it is read, to some frames."""
    if "parts" in shape.frame and rng.random() < 0.15:
        time = rng.choice(("3.5 bytes", "20 ms", "4 bytes"))
        least = {"at_least": rng.choice(("1750 us", "1 ms"))} if rng.random() < 0.5 else {}
        shape.frame["parts"]["silence"] = {"role": "idle", "time": time, **least}
    elif kind == "ended" and more.random() < 0.3:
        endings.silence(more, shape.frame["parts"])
    elif kind in ("parts", "mixed") and _codes(shape.frame) and more.random() < 0.2:
        endings.openly(more, shape.frame)
    if "stuffing" in shape.frame and more.random() < 0.3:
        endings.as_coding(shape.frame)


def _count_steps(shape: Shape) -> None:
    """Let payloads have whole steps of the length, or the length count bytes if its other parts have not."""
    parts: Doc = shape.frame.get("parts", {})
    for spec in parts.values():
        if "counts" in spec and "scale" in spec:
            counted = [spec["counts"]] if isinstance(spec["counts"], str) else spec["counts"]
            if sum(_size(parts[name]) for name in counted) % spec["scale"]:
                del spec["scale"]
            else:
                shape.word = spec["scale"]


def _codes(frame: Doc) -> bool:
    """Whether a frame may have a coding."""
    return "stuffing" not in frame and not any(name in frame["parts"] for name in conditional.NAMES)


def _conditions(rng: random.Random, shape: Shape, *, plain: bool) -> None:
    """Perhaps parts that only some frames have."""
    if not shape.seeds and rng.random() < 0.2:
        one_way.add(rng, shape.frame, plain=plain)
        shape.directed = True
    elif not plain and not shape.seeds and shape.bus == "master_slave" and rng.random() < 0.2:
        _parties(rng, shape)
    if rng.random() < 0.5:
        conditional.add(rng, shape.frame)


def _parties(rng: random.Random, shape: Shape) -> None:
    """A destination and a source in place of the address, if there is one."""
    if bits := parties.add(rng, shape.frame):
        shape.directed, shape.address_name, shape.address_bits = True, "node", bits
        shape.master = rng.randrange(1 << bits)


def _shorter(rng: random.Random, spec: Doc) -> object:
    """A part in one of its notations."""
    if spec.get("role") not in ("constant", "length", "checksum") or rng.random() < 0.3:
        return spec
    rest = {key: value for key, value in spec.items() if key != "role"}
    if spec["role"] != "constant":
        return rest
    data = bytes.fromhex(rest["value"])
    forms: list[object] = [rest, rest["value"]]
    if len(data) == 1 and data[0] >= 100:
        forms.append(data[0])
    if rest["value"].isdecimal() and rest["value"][0] != "0":
        forms += [int(rest["value"]), {"value": int(rest["value"])}]
    if data.isascii() and data.decode().isprintable():
        forms.append({"text": data.decode()})
    return rng.choice(forms)


def _digits(rng: random.Random, width: int) -> str:
    """The digits of a check value."""
    # Drawn from another source: the schemas of earlier seeds stay what they are.
    rng = random.Random(repr(rng.getstate()))
    if rng.random() < 0.5:
        return f"hex[{width // 4}]"
    full = len(str((1 << width) - 1))
    return f"decimal[{rng.choice((full, full, max(1, full - 1), min(20, full + 1)))}]"


def draw_algorithm(rng: random.Random) -> tuple[str | Doc, int]:
    """A checksum and its width, mostly sums and CRCs of eight and sixteen bits."""
    found: str | Doc = rng.choice(
        (
            rng.choice(checks.sums(8)),
            rng.choice(checks.sums(rng.choice((8, 16, 16, 32)))),
            rng.choice(_crcs(8)),
            rng.choice(_crcs(16)),
            rng.choice(_crcs(16)),
            rng.choice(_crcs(rng.choice((24, 32, 64)))),
            _parameters(rng),
        )
    )
    return found, checks.width(found)


def width_type(width: int) -> str:
    """The type of a check value."""
    return _WIDTHS[width]


def _parameters(rng: random.Random) -> Doc:
    """A CRC with parameters of its own."""
    width = rng.choice((8, 16, 16, 32))
    found: Doc = {"width": width, "poly": rng.randrange(1, 1 << width, 2)}
    found |= {key: rng.randrange(1 << width) for key in ("init", "xorout") if rng.random() < 0.5}
    return found | {key: rng.random() < 0.5 for key in ("refin", "refout") if rng.random() < 0.5}


def _crcs(bits: int) -> Sequence[str]:
    return [name for name, row in checks.catalogue().items() if int(row["width"]) == bits]


def order(rng: random.Random) -> Doc:
    """A byte order, if not that of the file."""
    return {"byteorder": rng.choice(("big", "little"))} if rng.random() < 0.4 else {}


@dataclass
class _Parts:
    rng: random.Random
    words: _Words
    parts: Doc = field(default_factory=dict)
    taken: set[str] = field(default_factory=set)
    seeds: Doc = field(default_factory=dict)

    def _chance(self, probability: float) -> bool:
        return self.rng.random() < probability

    def _add(self, name: str, spec: Doc) -> str:
        """A part, usually with a name according to its role."""
        if self._chance(0.15):
            name = self.words.name(self.taken)
        while name in self.parts:
            name += "_"
        self.taken.add(name)
        self.parts[name] = spec
        return name

    def make(self, *, hunted: bool) -> Shape:
        # Some frames violate one of the conditions for a hunting receiver.
        strict = hunted and self._chance(0.8)
        lead = self.rng.choice(("A5 A5", "AA AA", "02 02")) if hunted else self._lead()
        names = {"lead": self._add("start", {"role": "constant", "value": lead})} if lead else {}
        roles = self._header(hunted=hunted)
        for role in roles:
            name, spec = self._header_part(role)
            names[role] = self._add(name, self._in_digits(spec | {"type": "u8"} if strict else spec))
        if self._chance(0.08) and not hunted:
            self._add("gap", {"role": "constant", "value": "55"})
        names["payload"] = self._add("data", {"role": "payload"})
        roll = self.rng.random() if "length" in names else 0.5
        if roll < 0.12 and not hunted:
            names["blocks"] = self._blocks(names)
        elif roll > 0.8 and not hunted:
            self.parts[names["payload"]]["trim"] = "zeros"
        if self._chance(0.08) and not strict:
            self._add("fence", {"role": "constant", "value": "5A"})
        self._checked(names, whole=strict)
        while self._chance(0.2) and not strict:
            self._also_checked(names)
        if self._chance(0.3) and not strict:
            names["end"] = self._add("end", {"role": "constant", "value": self.rng.choice(_ENDS)})
        if "length" in names:
            self._counts(names, hunted=hunted, every=strict and lead == "02 02")
        frame: Doc = {"parts": self.parts}
        stuffing = self._stuffing(names, lead, hunted=hunted, strict=strict)
        if stuffing:
            frame["stuffing"] = stuffing
        return self._shape(frame, names, stuffing, strict=strict)

    def mixed(self) -> Shape:
        """A frame with parts of several roles, some of them after the payload."""
        lead, mixture = self._lead(), Mixture(self.rng)
        names = {"lead": self._add("start", {"role": "constant", "value": lead})} if lead else {}
        mixture.draw()
        self.parts |= mixture.front
        names["payload"] = self._add("data", {"role": "payload"})
        self.parts |= mixture.back
        self.taken |= {*self.parts, mixture.address}
        if mixture.length:
            names["length"] = mixture.length
            self.parts[mixture.length]["counts"] = [names["payload"]]
        self._checked(names, whole=False)
        if "length" in names:
            self._counts(names, hunted=False, every=False)
        frame: Doc = {"parts": self.parts}
        stuffing = self._stuffing(names, lead, hunted=False, strict=False)
        if stuffing:
            frame["stuffing"] = stuffing
        shape = self._shape(frame, {**names, "message": names["payload"]}, stuffing, strict=False)
        shape.pieces, shape.directed = mixture.pieces, mixture.directed
        shape.ways = mixture.ways if mixture.directed else []
        shape.id_bits = sum(bits for _, bits in mixture.pieces)
        shape.text_id = "text" in str(mixture.front.get("code", mixture.back.get("code")))
        shape.address_bits, shape.address_name = mixture.address_bits, mixture.address
        return shape

    def make_ended(self, ending: Ending) -> Shape:
        """A frame with a terminator."""
        rng, coded = self.rng, bool(ending.codings)
        lead = rng.choice((ending.terminator, "", "", "", rng.choice(_LEADS)))
        names = {"lead": self._add("start", {"role": "constant", "value": lead})} if lead else {}
        names |= self._ended_header(coded=coded)
        names["payload"] = self._add("data", {"role": "payload"})
        early = coded and self._chance(0.8)
        if early:
            self._checked(names, whole=False)
        end: Doc = {"role": "terminator", "value": ending.terminator}
        names["terminator"] = self._add("close", end)
        if not early and self._chance(0.6):
            self._checked(names, whole=False)
        if self._chance(0.15):
            names["end"] = self._add("end", {"role": "constant", "value": rng.choice(_ENDS)})
        while coded and self._chance(0.2):
            self._also_checked(names)
        last = next(reversed(self.parts)) == names["terminator"]
        if lead == ending.terminator and last and self._chance(0.7):
            end["shared"] = True
        if "length" in names:
            self._counts(names, hunted=False, every=False)
        frame: Doc = {"parts": self.parts} | ({"coding": ending.coding} if coded else {})
        shape = self._shape(frame, names, {}, strict=False)
        shape.mark, shape.has_length = int(ending.terminator.split()[-1], 16), True
        if not coded:
            shape.id_bits, shape.most = 7, min(shape.most, 40)
            self.parts[names["payload"]]["size"] = f"{shape.least}..{shape.most}"
            shape.groups = {"bits": 7, "first": rng.choice(("least", "most"))}
        return shape

    def _ended_header(self, *, coded: bool) -> Doc:
        roles = ["message"] + ["address"] * (coded and self._chance(0.5)) + ["length"] * self._chance(0.25)
        self.rng.shuffle(roles)
        names: Doc = {}
        for role in roles:
            name, spec = self._header_part(role)
            names[role] = self._add(name, self._in_digits(spec if coded else spec | {"type": "u8"}))
        if "address" not in names and not coded and self._other.random() < 0.3:
            spec = self._in_digits({"role": "address", "type": "u8"}, always=True)
            names["address"] = self._add("node", spec)
        if self._chance(0.1):
            self._add("version", {"role": "constant", "value": "01"})
        return names

    def _lead(self) -> str:
        return self.rng.choice(_LEADS) if self._chance(0.75) else ""

    def _header(self, *, hunted: bool) -> list[str]:
        roles = ["message"]
        roles += ["address"] if self._chance(0.55) else []
        roles += ["constant"] if self._chance(0.1) and not hunted else []
        has_length = hunted or self._chance(0.62)
        self.rng.shuffle(roles)
        if has_length:
            roles.insert(0 if hunted else self.rng.randint(0, len(roles)), "length")
        if roles[0] == "constant":
            roles.append(roles.pop(0))
        return roles

    def _header_part(self, role: str) -> tuple[str, Doc]:
        rng = self.rng
        if role == "constant":
            return "version", {"role": "constant", "value": "01"}
        if role == "length":
            kind = rng.choice(_LENGTHS)
        else:
            kind = rng.choices(("u8", "u16", "u24", "u32", "u64"), (30, 5, 1, 2, 1))[0]
        name = {"message": "code", "address": "node", "length": "length"}[role]
        return name, {"role": role, "type": kind, **order(rng)}

    @property
    def _other(self) -> random.Random:
        """Another source: the schemas of earlier seeds stay what they are."""
        return random.Random(f"digits {self.rng.getstate()!r}")

    def _in_digits(self, spec: Doc, *, always: bool = False) -> Doc:
        """An address that may be sent as digits."""
        rng = self._other
        if spec["role"] != "address" or not (always or rng.random() < 0.2):
            return spec
        most = min(16, bits_of_type(spec["type"]) // 4)
        form = rng.choice(("hex", "decimal"))
        size = rng.randint(1, most) if form == "hex" else len(str(1 << 4 * most)) - 1
        return {"role": "address", "type": spec["type"], "as": f"{form}[{size}]"}

    def _checked(self, names: Doc, *, whole: bool) -> None:
        """A check value; `whole`: over everything after the first part, and sent whole."""
        if not whole and not self._chance(0.78):
            return
        rng, covered = self.rng, self._coverable(names)
        algorithm, width = draw_algorithm(rng)
        if whole:
            covered = covered[1:]
        elif self._chance(0.35):
            covered = [name for name in covered if rng.random() < 0.7] if self._chance(0.7) else []
            covered = covered or ([names["payload"]] if "blocks" not in names else self._coverable(names)[:1])
        spec: Doc = {"role": "checksum", "type": _WIDTHS[width], "algorithm": algorithm, "over": covered}
        spec |= order(rng) | self._start(width)
        if covered == [names["payload"]] and self._chance(0.5):
            spec["otherwise"] = rng.randrange(1 << width)
        if not whole and self._chance(0.15):
            spec.pop("byteorder", None)
            spec["as"] = _digits(rng, width)
        elif not whole:
            spec |= self._sent(width)
        if not whole and "otherwise" not in spec:
            self._seeded(spec)
        names["checksum"] = self._add("crc", spec)

    def _seeded(self, spec: Doc) -> Doc:
        """Let a check value cover an attribute of the message, rarely."""
        if self._chance(0.15):
            name = self.rng.choice(("crc_extra", "salt"))
            self.seeds.setdefault(name, {"type": self.rng.choice(("u8", "u8", "u16", "u32"))})
            over = [*spec["over"]]
            over.insert(
                self.rng.choice((len(over), len(over), self.rng.randint(0, len(over)))), f"attribute.{name}"
            )
            spec["over"] = over
        return spec

    def _sent(self, width: int) -> Doc:
        """The bits of a check value that are sent, if not all."""
        if width != 16 or not self._chance(0.15):
            return {}
        every = (["0..6", "8..14"], ["8..15"], ["0..3", "4..7", "8..11", "12..15"], ["7..14", "0..6"])
        return {"sent": self.rng.choice(every)}

    def _start(self, width: int) -> Doc:
        return {"init": self.rng.randrange(1 << width)} if self._chance(0.15) else {}

    def _coverable(self, names: Doc) -> list[str]:
        """The parts that a check value can cover."""
        blocked = (names["payload"], names["blocks"]) if "blocks" in names else ()
        return [name for name in self.parts if name not in blocked]

    def _blocks(self, names: Doc) -> str:
        """Check values of the blocks of the payload."""
        rng, (algorithm, width) = self.rng, draw_algorithm(self.rng)
        every = rng.choice(("16 bytes", "1 byte", "3 bytes", "8 bytes", "600 bytes"))
        spec = {
            "role": "checksum",
            "type": _WIDTHS[width],
            "algorithm": algorithm,
            "over": [names["payload"]],
        }
        return self._add(
            "blocks", {**spec, "every": every, **order(rng), **self._start(width), **self._sent(width)}
        )

    def _also_checked(self, names: Doc) -> None:
        """One more check value at any place, often in the header and over it alone."""
        rng, others = self.rng, list(self.parts)
        algorithm, width = draw_algorithm(rng)
        front = others[: others.index(names["payload"])]
        covered = front if front and self._chance(0.5) else self._coverable(names)
        covered = [name for name in covered if rng.random() < 0.7] or covered[:1]
        spec: Doc = {"role": "checksum", "type": _WIDTHS[width], "algorithm": algorithm, "over": covered}
        shape = {"as": _digits(rng, width)} if self._chance(0.15) else order(rng) | self._sent(width)
        name = self._add("head", self._seeded(spec) | self._start(width) | shape)
        least = 1 if "lead" in names else 0
        place = rng.randint(least, len(front) if self._chance(0.7) else len(others))
        if "blocks" in names and others[place : place + 1] == [names["blocks"]]:
            place += 1
        others.insert(place, name)
        ordered = {each: self.parts[each] for each in others}
        self.parts.clear()
        self.parts.update(ordered)
        for each, part in self.parts.items():
            # No two check values cover each other.
            if "over" in part and "every" not in part and each not in self._under(name) and self._chance(0.6):
                kept = [other for other in others if other in (name, *part["over"])]
                part["over"] = [*kept, *(each for each in part["over"] if each not in others)]

    def _under(self, name: str) -> set[str]:
        """A part, and the parts that it covers, directly or through others."""
        over = self.parts[name].get("over", ()) if name in self.parts else ()
        return {name}.union(*map(self._under, over))

    def _counts(self, names: Doc, *, hunted: bool, every: bool) -> None:
        counted = [
            name
            for name in self.parts
            if name != names.get("blocks")
            and (every or name == names["payload"] or self.rng.random() < (0.3 if hunted else 0.5))
        ]
        length = self.parts[names["length"]]
        length["counts"] = counted[0] if len(counted) == 1 and self._chance(0.5) else counted
        others = sum(_size(self.parts[name]) for name in counted)
        if others and self._chance(0.15):
            length["offset"] = self.rng.randint(1, others)
        elif self._chance(0.05) and not hunted and "trim" not in self.parts[names["payload"]]:
            length["scale"] = 2
        if hunted:
            self.parts[names["length"]]["type"] = "u8"

    def _counts_payload(self, names: Doc) -> bool:
        """Whether a length tells the end of the payload before the checksum is known."""
        return any(names["payload"] in spec.get("counts", ()) for spec in self.parts.values())

    def _stuffing(self, names: Doc, lead: str, *, hunted: bool, strict: bool) -> Doc:
        rng = self.rng
        if "trim" in self.parts[names["payload"]]:
            return {}
        if "blocks" in names or (not hunted and not self._chance(0.35 if lead else 0.05)):
            return {}
        first = lead.split()
        if hunted or self._chance(0.4):
            after = first[0] if first else "A5"
        else:
            after = rng.choice((" ".join(first[:2]), " ".join(first[:1]), " ".join(first[:3]))) or "10"
        insert = rng.choice(("00", "00", "FD", "10", after.split()[-1]))
        spec: Doc = {"after": after, "insert": "00" if hunted else insert}
        if not hunted and "checksum" in names and self._counts_payload(names) and self._chance(0.4):
            return spec | {"checksum": "after"}
        if strict:
            return spec | {"exempt": [names["lead"]]}
        front = [names["lead"]] if lead and not self._chance(0.04) else []
        if front and self._chance(0.1) and list(self.parts)[1] == names.get("length"):
            front.append(names["length"])
        tail = [names["end"]] if "end" in names and self._chance(0.15) else []
        if front or tail:
            spec["exempt"] = front + tail
        return spec

    def _shape(self, frame: Doc, names: Doc, stuffing: Doc, *, strict: bool) -> Shape:
        rng, parts = self.rng, self.parts
        most, least = rng.choice(_SIZES), rng.choice((0,) * 7 + (1,))
        if "length" in names:
            most = self._longest(names, stuffing, most, below=strict)
        parts[names["payload"]]["size"] = f"{least}..{most}"
        for spec in parts.values() if least else ():
            spec.pop("otherwise", None)
        if (trimmed := "trim" in parts[names["payload"]]) and (least or self._chance(0.5)):
            parts[names["payload"]]["trim"] = {"zeros": True, "keep": max(least, rng.choice((0, 1, 1, 2, 9)))}
        address = parts.get(names.get("address", ""), {})
        return Shape(
            "parts",
            frame,
            least,
            most,
            int(parts[names["message"]].get("type", "u0")[1:]),
            rng.choices(("master_slave", "ring", "host"), (8, 1, 1))[0],
            "length" in names,
            int(address["type"][1:]) if address else 0,
            names.get("address", ""),
            int(stuffing["after"].split()[0], 16) if stuffing else 0xA5,
            seeds=self.seeds,
            trimmed=trimmed,
            address_top=_top(address),
        )

    def _longest(self, names: Doc, stuffing: Doc, most: int, *, below: bool) -> int:
        """The maximum payload for the length; `below`: with lengths below the stuffed byte."""
        length = parts_length = self.parts[names["length"]]
        counts = length["counts"] if isinstance(length["counts"], list) else [length["counts"]]
        bias = sum(_size(self.parts[name]) for name in counts) - int(length.get("offset", 0))
        top: int = (1 << int(parts_length["type"][1:])) - 1 - bias
        if stuffing.get("checksum") == "after":
            top = top * len(stuffing["after"].split()) // (len(stuffing["after"].split()) + 1)
        # Lengths below, around and above the stuffed byte.
        mark = int(stuffing["after"].split()[0], 16) - bias if stuffing else 0
        if below and mark > 4:
            return min(most, mark - 1)
        if mark > 4 and self._chance(0.5):
            most = self.rng.choice((mark - 1, mark, mark + 40))
        return max(4, min(most, top))


def _top(address: Doc) -> int:
    """The greatest address, 0 without one."""
    name, _, size = address.get("as", "").partition("[")
    if name:
        return int((10 if name == "decimal" else 16) ** int(size[:-1])) - 1
    return (1 << int(address["type"][1:])) - 1 if address else 0


def _size(part: Doc) -> int:
    if part.get("role") == "payload":
        return 0
    if "value" in part:
        return len(bytes.fromhex(part["value"]))
    if "as" in part:
        return int(part["as"].partition("[")[2][:-1])
    return len(part["sent"]) if "sent" in part else bits_of_type(part["type"]) // 8


def _marked(rng: random.Random) -> Shape:
    bits = rng.choices((7, 6), (4, 1))[0]
    ids = rng.randint(2, 4)
    rest = 7 - ids
    # With six bits in a group the marker is bit 6, and bit 7 is part of the header.
    places = {7: (f"{ids}..6", f"0..{ids - 1}"), 6: ("7" if rest == 1 else f"{ids}..5", f"0..{ids - 1}")}
    marker, address = 0x80, rest
    header = {"address": places[bits][0], "message": places[bits][1]}
    if bits == 6:
        # The address takes bit 7 alone, the id everything below the marker.
        header, marker, ids, address = {"address": "7", "message": "0..5"}, 0x40, 6, 1
    elif rng.random() < 0.4:
        header = {"address": f"0..{rest - 1}", "message": f"{rest}..6"}
    end, most = rng.randrange(1 << ids), rng.choice((8, 24, 64))
    spec: Doc = {"marker": marker, "header": header, "end": end, "payload": f"0..{most}"}
    only = False
    if rng.random() < 0.6:
        width = rng.choice((8, 16))
        name = rng.choice((rng.choice(_crcs(width)), rng.choice(checks.sums(width))))
        sent = ["0..5", "8..13"] if checks.width(name) == 16 else [rng.choice(("0..5", "2..7"))]
        spec["checksum"] = {
            "role": "checksum",
            "type": f"u{checks.width(name)}",
            "algorithm": name,
            "over": ["payload"],
            "sent": sent,
        }
        only = rng.random() < 0.5
    return Shape(
        "marked",
        {"marked": spec},
        0,
        most,
        ids,
        rng.choice(("ring", "ring", "master_slave")),
        address_bits=address,
        address_name="address",
        end_id=end,
        groups={"bits": bits, "first": rng.choice(("least", "most"))},
        text=bits == 7,
        only=only,
    )


def _packet(rng: random.Random) -> Shape:
    word, most = rng.choice((1, 2, 2, 4)), rng.choice((4, 8, 16))
    parts: Doc = {
        "code": {"role": "message", "type": "u8"},
        "data": {"role": "payload", "size": f"0..{most}"},
    }
    if rng.random() < 0.8:
        name = rng.choice(
            [
                each
                for each in checks.sums(rng.choice((8, 16, 16)))
                if each.startswith("sum") and "carry" not in each
            ]
        )
        check: Doc = {"role": "checksum", "type": f"u{checks.width(name)}", "algorithm": name, "words": word}
        if rng.random() < 0.6:
            check["rejected"] = rng.choice((0, 0, 0xFF))
        parts["check"] = check | order(rng)
    else:
        word = 1
    return Shape(
        "packet",
        {"packet": parts},
        0,
        most,
        8,
        rng.choice(("host", "host", "master_slave")),
        has_length=False,
        word=word,
    )
