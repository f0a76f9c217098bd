"""Encodes and decodes delimited frames."""

from __future__ import annotations

import functools
import itertools
import re
from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

from tests.support.whole.reference import checks, text_ids
from tests.support.whole.reference.codings import Coding, codings
from tests.support.whole.reference.fields import Fields, bits_of, bits_of_type, byte_pieces
from tests.support.whole.reference.layouts import (
    Message,
    Number,
    Packed,
    Record,
    Records,
    Run,
    Slot,
    Test,
    most_bytes,
    size_of,
)
from tests.support.whole.reference.notation import Doc, octets, of_way, part_doc, whole_span
from tests.support.whole.reference.parties import has_parties, told
from tests.support.whole.reference.values import Raw, Wrong, get, holds, items_of, met, note, put
from tests.support.whole.reference.values import check as check_range


class NeedMore(Exception):
    """The bytes may be an incomplete frame; at least `size` are needed to decide."""

    def __init__(self, size: int = 0) -> None:
        """Set the size."""
        super().__init__(size)
        self.size = size


class Refused(Exception):
    """The bytes are not a frame: kind of fault, its wire bytes, and whether a receiver reports it."""

    def __init__(self, kind: str, size: int = 1, *, told: bool = True) -> None:
        """Set the details."""
        super().__init__(kind)
        self.kind, self.size, self.told = kind, size, told


@dataclass(frozen=True, slots=True)
class Part:
    """A part of a frame; the size of a payload is 0."""

    name: str
    role: str
    size: int
    spec: Doc
    constant: bytes = b""
    pieces: tuple[tuple[int, int], ...] = ()
    #: Role, lowest bit and number of bits of what its integer holds, and their mapping.
    bits: tuple[tuple[str, int, int, Doc], ...] = ()
    #: Name, lowest bit and number of the values in it.
    values: tuple[tuple[str, int, Number], ...] = ()

    @property
    def base(self) -> int:
        """The base of its digits if it is a number in digits, 0 if it is not."""
        shown = str(self.spec.get("as", "")) if self.role == "bits" else ""
        return {"": 0, "hex": 16, "decimal": 10}[shown.partition("[")[0]]

    def raw(self, data: bytes) -> int:
        """Its number; wrong digits are 0."""
        if self.base:
            return int(data, self.base) if self.legible(data) else 0
        return get(self.pieces, data)

    def data(self, raw: int) -> bytes:
        """Its bytes."""
        if self.base:
            return f"{raw:0{self.size}{'X' if self.base == 16 else 'd'}}".encode()
        return put(self.pieces, raw)

    def legible(self, data: bytes) -> bool:
        """Whether each byte is a digit."""
        return all(byte in b"0123456789abcdefABCDEF"[: 10 if self.base == 10 else 22] for byte in data)

    @property
    def mask(self) -> int:
        """All its bits."""
        return (1 << 8 * self.size) - 1

    def accepts(self, raw: int) -> bool:
        """Whether the constants in its bits are legal."""
        return all(
            raw >> shift & (1 << bits) - 1 in _several(spec["const"])
            for role, shift, bits, spec in self.bits
            if role == "constant"
        )


@dataclass(frozen=True, slots=True)
class Stuffing:
    """The stuffing rule."""

    after: bytes
    insert: int
    exempt: tuple[str, ...]
    #: Only the payload is stuffed, and length and checksum apply to the stuffed bytes.
    payload_alone: bool

    def stuff(self, data: bytes) -> bytes:
        """Insert bytes; an occurrence begins after the last inserted byte."""
        return data.replace(self.after, self.after + bytes([self.insert]))

    def unstuff(self, data: bytes) -> bytes:
        """Remove inserted bytes. Raises Wrong."""
        plain, rest = b"", data
        while self.after in rest:
            front, _, rest = rest.partition(self.after)
            if rest[:1] != bytes([self.insert]):
                raise Wrong("stuffing")
            plain, rest = plain + front + self.after, rest[1:]
        return plain + rest


def part_of(name: str, spec: object, order: str, fields: Fields) -> Part:
    """A part from its mapping."""
    spec = part_doc(spec)
    if spec["role"] in ("value", "counter"):
        slot, values = fields.beside(name, spec)
        assert isinstance(slot.kind, Number | Packed)
        return Part(name, "bits", len(slot.kind.pieces), spec, pieces=slot.kind.pieces, values=values)
    if spec["role"] == "terminator" or (spec["role"] == "constant" and "type" not in spec):
        constant = spec["text"].encode("ascii") if "text" in spec else octets(spec["value"])
        return Part(name, spec["role"], len(constant), spec, constant)
    if spec["role"] == "payload":
        return Part(name, "payload", 0, spec)
    order = "big" if spec["type"].startswith("text") else spec.get("byteorder", order)
    pieces = byte_pieces(bits_of_type(spec["type"]) // 8, order)
    if "sent" in spec:
        pieces = tuple((first, last + 1 - first) for first, last in map(whole_span, spec["sent"]))
    if spec["role"] == "address" and "as" in spec:
        pieces = ((0, 8),) * int(spec["as"].partition("[")[2][:-1])
    elif "as" in spec:
        pieces = tuple((at, 4) for at in range(bits_of_type(spec["type"]) - 4, -1, -4))
        if (digits := spec["as"].removeprefix("decimal[").rstrip("]")).isdecimal():
            pieces = ((0, bits_of_type(spec["type"])),) * int(digits)
    if "every" in spec:
        return Part(name, "blocks", 0, spec, pieces=pieces)
    bits = tuple((role, shift, size, inner) for _, role, shift, size, inner in bits_of(spec))
    if spec["role"] == "constant" and len(_several(spec["const"])) == 1:
        data = put(pieces, _several(spec["const"])[0])
        return Part(name, "constant", len(data), spec, data)
    values = fields.beside(name, spec)[1] if "bits" in spec else ()
    role = "bits" if spec["role"] in ("constant", "direction", "message", "address") else spec["role"]
    return Part(name, role, len(pieces), spec, pieces=pieces, bits=bits, values=values)


def _shown(check: Part, value: int) -> bytes:
    """The bytes of a check value."""
    if check.spec.get("as", "").startswith("decimal"):
        return f"{value:0{len(check.pieces)}d}"[-len(check.pieces) :].encode()
    if "as" in check.spec:
        return f"{value:0{len(check.pieces)}x}".upper().encode()
    return put(check.pieces, value)


def _cases(check: Part, data: bytes) -> tuple[bytes, ...]:
    """Received bytes, as they would be sent."""
    return (data.upper(),) if "as" in check.spec else (data,)


def has(spec: object, direction: str) -> bool:
    """Whether the frames of a direction have a part, or a kind."""
    wanted = _directed(spec)
    if not wanted:
        return True
    return bool(wanted == direction or (wanted.startswith("not ") and wanted[4:] != direction))


def _directed(spec: object) -> str:
    """What the condition of a part asks of the direction, "" if nothing."""
    given = spec.get("if", {}) if isinstance(spec, dict) else {}
    return str(given.get("direction", "")) if isinstance(given, dict) else ""


def _among(part: Part, names: Collection[str]) -> Part:
    """A part that covers and counts none but these parts, and attributes."""
    spec = dict(part.spec)
    for key in ("over", "counts"):
        if key in spec:
            given = [spec[key]] if isinstance(spec[key], str) else spec[key]
            spec[key] = [each for each in given if each in names or each.startswith("attribute.")]
    return replace(part, spec=spec)


def _ended(part: Part, end: bytes, coded: Collection[str]) -> Part:
    """A part whose texts do not have the bytes that end a frame, unless a coding hides them."""
    if part.name in coded or all(kind.without is None for *_, kind in part.values):
        return part
    return replace(
        part,
        values=tuple(
            (name, at, kind if kind.without is None else replace(kind, without=end))
            for name, at, kind in part.values
        ),
    )


def _bits_of_values(part: Part, given: Mapping[str, Raw]) -> int:
    raw = 0
    for name, shift, kind in part.values:
        number = given.get(name, kind.default)
        assert isinstance(number, int)
        raw |= (number & (1 << kind.bits) - 1) << shift
    return raw


def _several(given: Any) -> list[int]:
    return given if isinstance(given, list) else [given]


class Frame:
    """A delimited frame."""

    def __init__(self, document: Doc, direction: str = "") -> None:
        """Read the parts of the frames of a direction; "" if both have the same."""
        frame, order = document["frame"], document.get("byteorder", "big")
        fields = Fields(document, 0)
        given = frame["parts"].items()
        specs = {name: of_way(spec, direction) for name, spec in given if has(spec, direction)}
        #: Some parts, or bits, are only in the frames of one direction.
        self.one_way = any(map(_directed, frame["parts"].values())) or has_parties(document)
        self.one_way = self.one_way or any(of_way(spec, "request") != spec for _, spec in given)
        specs = {name: told(spec, direction, document) for name, spec in specs.items()}
        self.parts = [_among(part_of(name, spec, order, fields), specs) for name, spec in specs.items()]
        #: Tests of the values that decide whether a frame has a part, by its name.
        self.tests = {
            name: fields.tests(spec["if"])
            for name, spec in specs.items()
            if isinstance(spec, dict) and "if" in spec and not _directed(spec)
        }
        #: The length of frames of which the first one cannot state the size.
        self.longer = next(
            (part for part in self.parts if part.role == "length" and part.name in self.tests), None
        )
        self.by_role: Mapping[str, Part] = {part.role: part for part in self.parts[::-1]}
        #: Bytes of attributes of messages, by number of the message.
        self.seeds: dict[int, Mapping[str, bytes]] = {}
        #: Ids that payloads begin with, by their number.
        self.texts: dict[bytes, int] = {}
        self.any_case = bool(frame.get("any_case"))
        self.checks = [part for part in self.parts if part.role == "checksum"]
        self.blocks: Part | None = next((part for part in self.parts if part.role == "blocks"), None)
        self.payload_at = self.parts.index(self.by_role["payload"])
        self.least, self.most = whole_span(self.by_role["payload"].spec["size"])
        self.overhead = sum(part.size for part in self.parts)
        self.stuffing = _stuffing(frame.get("stuffing"))
        #: Added to each byte of a payload, before lengths and check values are computed.
        self.plus = int(frame.get("plus", 0))
        length = self.by_role.get("length")
        counted = length.spec["counts"] if length else []
        counted = [counted] if isinstance(counted, str) else counted
        self.bias = sum(part.size for part in self.parts if part.name in counted)
        self.bias -= length.spec.get("offset", 0) if length else 0
        #: Bytes of one step of the length.
        self.step = length.spec.get("scale", 1) if length else 1
        first = self.parts[0]
        #: A frame is its payload, and receivers do not look for it.
        self.turned = len(self.parts) == 1
        #: What a frame begins with: a constant, or each id that a kind has; () for others.
        self.starts: tuple[bytes, ...] = (first.constant,) if first.role == "constant" else ()
        #: No leading constant: a candidate begins with a known message and a legal address.
        self.bare = self.parts[0].role != "constant" and not frame.get("silent")
        most, stuffing = self.most, self.stuffing
        self.terminator = self.by_role.get("terminator")
        #: Only a silence ends a frame.
        self.silent = bool(frame.get("silent"))
        self.codings = codings(frame.get("coding"))
        self._over = _coded_names(frame.get("coding"), self.parts, silent=self.silent)
        if self.terminator:
            hidden = self._over if self.codings else []
            self.parts = [_ended(part, self.terminator.constant, hidden) for part in self.parts]
        #: Names of parts that are decoded as they are read.
        self.coded_names = [] if self.terminator or self.silent else self._over
        #: Maximum payload size on the wire, including inserted bytes if the length counts them.
        self.most_sent = most + most // len(stuffing.after) if stuffing and stuffing.payload_alone else most

    @property
    def longest(self) -> int:
        """Number of bytes after which those outside of frames are reported."""
        if self.terminator is None and not self.silent:
            return self.overhead + self.most_sent + self.added(self.most_sent)
        inner = outer = 0
        for part in self.parts:
            size = self.most if part.role == "payload" else part.size
            if part.name in self._over:
                inner += size
            else:
                outer += size
        for coding in self.codings:
            inner = coding.most(inner)
        return inner + outer

    def ended(self, wire: bytes) -> Cut:
        """The frame up to its terminator. Raises NeedMore or Refused."""
        first = self.parts[0]
        lead = first.constant if first.role == "constant" else b""
        if self.terminator is None:
            return self._between(wire, lead)
        if wire[: len(lead)] != lead[: len(wire)]:
            raise Refused("frame", told=False)
        end, names = self.terminator.constant, [part.name for part in self.parts]
        after = sum(part.size for part in self.parts[names.index(self.terminator.name) + 1 :])
        limit = self.longest - after
        stop = len(lead)
        while stop + len(end) <= limit and wire[stop : stop + len(end)] != end:
            if stop + len(end) > len(wire):
                raise NeedMore
            stop += 2 if self.begins_pair(wire[stop]) else 1
        if stop + len(end) > limit:
            raise Refused("length", limit)
        if stop == len(lead):
            raise Refused("empty", stop + len(end), told=False)
        size = stop + len(end) + after
        if len(wire) < size:
            raise NeedMore
        kept = len(end) if end == lead and not after else 0
        return Cut(self._opened(wire[:size]), size, pending=False, kept=kept)

    def _between(self, wire: bytes, lead: bytes) -> Cut:
        """The frame between two silences. Raises Refused."""
        if any(ours != theirs for ours, theirs in zip(lead, wire, strict=False)):
            raise Refused("frame")
        if not len(lead) <= len(wire) <= self.longest:
            raise Refused("length")
        return Cut(self._opened(wire), len(wire), pending=False)

    def begins_pair(self, byte: int) -> bool:
        """Whether a byte begins a pair of coded bytes, and the terminator."""
        assert self.terminator
        if not self.codings or len(self.terminator.constant) < 2 or self.terminator.constant[0] != byte:
            return False
        return self.codings[-1].begins_pair(byte, self.terminator.constant[1])

    def _opened(self, wire: bytes) -> dict[str, bytes]:
        """The parts of a whole frame. Raises Refused."""
        names = [part.name for part in self.parts]
        first, last = names.index(self._over[0]), names.index(self._over[-1]) + 1
        front = sum(part.size for part in self.parts[:first])
        back = sum(part.size for part in self.parts[last:])
        if front + back > len(wire):
            raise Refused("length", len(wire))
        inner = wire[front : len(wire) - back]
        try:
            for coding in reversed(self.codings):
                inner = coding.decode(inner)
        except Wrong as wrong:
            raise Refused(wrong.kind, len(wire)) from None
        plain = wire[:front] + inner + wire[len(wire) - back :]
        size = len(plain) - self.overhead
        if not self.least <= size <= self.most:
            raise Refused("length", len(wire))
        cut: dict[str, bytes] = {}
        for part in self.parts:
            own = size if part.role == "payload" else part.size
            cut[part.name], plain = plain[:own], plain[own:]
        return cut

    @functools.cached_property
    def unique(self) -> bool:
        """Whether the preamble cannot occur inside a frame, so that a receiver can hunt for it."""
        stuffing, first = self.stuffing, self.parts[0]
        if self.one_way or stuffing is None or stuffing.payload_alone or first.constant != stuffing.after * 2:
            return False
        if (
            len(stuffing.after) != 1
            or stuffing.insert == stuffing.after[0]
            or stuffing.exempt != (first.name,)
        ):
            return False
        if self.step > 1:
            return False
        lengths = range(self.bias + self.least, self.bias + self.most + 1)
        roles = [part.role for part in self.parts]
        if roles[1] != "length" or self.parts[1].size != 1 or stuffing.after[0] in lengths:
            return False
        if (
            roles.count("constant") > 1
            or roles.count("checksum") != 1
            or roles[-1] != "checksum"
            or "derived" in roles
        ):
            return False
        # Message number and address are whole parts.
        alone = [part.bits[0] for part in self.parts if len(part.bits) == 1 and "at" not in part.bits[0][3]]
        kinds = sorted((role, bits if role == "message" else 0) for role, _, bits, _ in alone)
        if any(part.values or part.base for part in self.parts):
            return False
        if len(alone) < roles.count("bits") or kinds not in (
            [("message", 8)],
            [("address", 0), ("message", 8)],
        ):
            return False
        check = self.parts[-1]
        whole = [byte_pieces(check.size, order) for order in ("big", "little")]
        covers = sorted(check.spec["over"]) == sorted(part.name for part in self.parts[1:-1])
        return covers and 8 * check.size == checks.width(check.spec["algorithm"]) and check.pieces in whole

    def stuffed(self, part: Part) -> bool:
        """Whether the whole frame is stuffed, including this part."""
        return (
            self.stuffing is not None
            and not self.stuffing.payload_alone
            and part.name not in self.stuffing.exempt
        )

    @property
    def seeded(self) -> bool:
        """Whether a check value covers attributes of the message."""
        return any(name.startswith("attribute.") for check in self.checks for name in check.spec["over"])

    # Building

    def wrap(self, number: int, payload: bytes, address: int, given: Mapping[str, Raw]) -> bytes:
        """A frame around a payload, which is not checked; `given` are values of the frame."""
        if self.stuffing and self.stuffing.payload_alone:
            payload = self.stuffing.stuff(payload)
        payload = bytes((byte + self.plus) % 256 for byte in payload)
        cut: dict[str, bytes] = {}
        rest = self._id_pieces(number)
        for part in self.parts:
            if part.role == "length":
                cut[part.name] = put(part.pieces, self._length(part, (self.bias + len(payload)) // self.step))
            elif part.role == "bits":
                raw = _bits_of_values(part, given)
                for role, shift, _, spec in part.bits:
                    if role == "value":
                        continue
                    fixed = {"address": address, "constant": _several(spec.get("const"))[0]}
                    raw |= (rest[part.name, shift] if role not in fixed else fixed[role]) << shift
                cut[part.name] = part.data(raw)
            elif part.role == "derived":
                cut[part.name] = put(part.pieces, self.derived(part, cut))
            else:
                cut[part.name] = payload if part.role == "payload" else part.constant
        lacking = self.lacking(given, cut)
        cut |= {**dict.fromkeys(lacking, b""), **self.seeds.get(number, {})}
        for _ in self.checks:  # so often that those which cover others become right
            for check in (each for each in self.checks if each.name not in lacking):
                cut[check.name] = _shown(check, self.check_value(check, cut))
        return self._stuffed(cut | self._blocked(payload))

    def _blocked(self, payload: bytes) -> dict[str, bytes]:
        """The payload with the check values of its blocks."""
        if self.blocks is None:
            return {}
        sent = zip(self.blocks_of(payload), self.block_values(payload), strict=True)
        return {self.by_role["payload"].name: b"".join(itertools.chain(*sent)), self.blocks.name: b""}

    def blocks_of(self, payload: bytes) -> list[bytes]:
        """The blocks of a payload that have check values of their own."""
        every = int(self.blocks.spec["every"].split()[0]) if self.blocks else len(payload) + 1
        return [payload[at : at + every] for at in range(0, len(payload), every)]

    def block_values(self, payload: bytes) -> list[bytes]:
        """The check values of blocks."""
        assert self.blocks
        spec, pieces = self.blocks.spec, self.blocks.pieces
        return [
            put(pieces, checks.compute(spec["algorithm"], block, spec.get("init")))
            for block in self.blocks_of(payload)
        ]

    def added(self, payload: int) -> int:
        """Bytes of the check values of blocks."""
        return len(b"".join(self.block_values(bytes(payload)))) if self.blocks else 0

    def _id_pieces(self, number: int) -> dict[tuple[str, int], int]:
        """The pieces of a message number by part and lowest bit."""
        left, found = sum(bits for _, _, bits, _ in self.id_bits()), {}
        for name, shift, bits, _ in self.id_bits():
            left -= bits
            found[name, shift] = number >> left & (1 << bits) - 1
        return found

    @property
    def beside(self) -> tuple[tuple[str, Number], ...]:
        """Values of every frame."""
        return tuple((name, kind) for part in self.parts for name, _, kind in part.values)

    def values(self, cut: Mapping[str, bytes], wanted: Collection[str] | None = None) -> dict[str, Raw]:
        """The values of a frame, or those wanted. Raises Wrong."""
        found: dict[str, Raw] = {}
        for part in self.parts:
            for name, shift, kind in part.values:
                if wanted is not None and name not in wanted:
                    continue
                if not self.has(part, cut):
                    found[name] = kind.default
                    continue
                raw = get(part.pieces, cut[part.name]) >> shift & (1 << kind.bits) - 1
                raw -= (raw >> kind.bits - 1) << kind.bits if kind.signed else 0
                check_range(kind, raw)
                found[name] = raw
        return found

    def has(self, part: Part, cut: Mapping[str, bytes]) -> bool:
        """Whether a frame with these parts in its header has a part."""
        tests = self.tests.get(part.name, ())
        tested = {name for name, *_ in tests}
        numbers = dict[str, int]()
        for each in self.parts if tests else ():
            if each.name in tested and each.role == "length":
                numbers[each.name] = get(each.pieces, cut[each.name])
            for name, shift, kind in each.values:
                if name in tested:
                    raw = get(each.pieces, cut[each.name]) >> shift & (1 << kind.bits) - 1
                    numbers[name] = raw - ((raw >> kind.bits - 1) << kind.bits if kind.signed else 0)
        return not tests or met(tests, numbers)

    def handing(self, part: Part) -> tuple[int, int] | None:
        """The last number of a length of its own, and the one that hands over; None if it does not."""
        if "otherwise" not in part.spec or part.role != "length":
            return None
        otherwise = int(part.spec["otherwise"])
        span = part.spec.get("range")
        return (whole_span(span)[1] if span else otherwise - 1), otherwise

    def _length(self, part: Part, number: int) -> int:
        """The number in one of the lengths; the longer one is not sent where it would not fit its bits."""
        handing = self.handing(part)
        if handing and number > handing[0]:
            return handing[1]
        return number & part.mask if part is self.longer else number

    def lacking(self, given: Mapping[str, Raw], cut: Mapping[str, bytes]) -> list[str]:
        """Names of the parts that a frame with these values and this header does not have."""
        numbers = {name: kind.default for part in self.parts for name, _, kind in part.values}
        numbers |= {name: raw for name, raw in given.items() if isinstance(raw, int)}
        lengths = [part for part in self.parts if part.role == "length" and part is not self.longer]
        numbers |= {part.name: get(part.pieces, cut[part.name]) for part in lengths}
        return [name for name, tests in self.tests.items() if not met(tests, numbers)]

    def id_bits(self) -> list[tuple[str, int, int, str]]:
        """The pieces of the message number, the most significant first: part, lowest bit, bits, role."""
        found = [(part.name, shift, bits, role) for part in self.parts for role, shift, bits, _ in part.bits]
        return [each for wanted in ("direction", "message") for each in found if each[3] == wanted]

    def derived(self, part: Part, cut: Mapping[str, bytes]) -> int:
        """The value of a part that follows from an earlier one."""
        found = re.fullmatch(r"(~?) ?(\w+)( [+-] \d+)?", part.spec["equals"])
        assert found
        source = next(each for each in self.parts if each.name == found[2])
        raw = get(source.pieces, cut[source.name])
        return (~raw if found[1] else raw) + int((found[3] or "0").replace(" ", "")) & part.mask

    def _stuffed(self, cut: Mapping[str, bytes]) -> bytes:
        wire, run = b"", b""
        if self.terminator or self.silent or self.codings:
            return self._coded(cut)
        for part in self.parts:
            if self.stuffed(part):
                run += cut[part.name]
                continue
            wire += self._run(run) + cut[part.name]
            run = b""
        return wire + self._run(run)

    def _coded(self, cut: Mapping[str, bytes]) -> bytes:
        wire, run = b"", b""
        for part in self.parts:
            if part.name not in self._over:
                wire += cut[part.name]
                continue
            run += cut[part.name]
            if part.name == self._over[-1]:
                for coding in self.codings:
                    run = coding.encode(run)
                wire += run
        return wire

    def _run(self, data: bytes) -> bytes:
        return self.stuffing.stuff(data) if self.stuffing and data else data

    @staticmethod
    def check_value(check: Part, cut: Mapping[str, bytes]) -> int:
        """The check value over the covered parts."""
        covered = b"".join(cut[name] for name in check.spec["over"])
        if not covered and "otherwise" in check.spec:
            return int(check.spec["otherwise"])
        return checks.compute(check.spec["algorithm"], covered, check.spec.get("init"))

    def check_fails(self, cut: Mapping[str, bytes], seeds: Mapping[str, bytes] | None = None) -> bool:
        """Whether one of the check values is wrong that need only the parts found, and the seeds."""
        cut = {**cut, **(seeds or {})}
        if self.blocks and self.blocks.name in cut:
            values = b"".join(self.block_values(cut[self.by_role["payload"].name]))
            if cut[self.blocks.name] != values:
                return True
        checks = [each for each in self.checks if {each.name, *each.spec["over"]} <= cut.keys()]
        checks = [each for each in checks if self.has(each, cut)]
        return any(
            _shown(each, self.check_value(each, cut)) not in _cases(each, cut[each.name]) for each in checks
        )

    def bad_constant(self, cut: Mapping[str, bytes]) -> bool:
        """Whether a constant or a derived number is wrong."""
        return any(self.wrong(part, cut) for part in self.parts if self.has(part, cut))

    def wrong(self, part: Part, cut: Mapping[str, bytes]) -> bool:
        """Whether a part is a wrong constant, has one in its bits, or is wrongly derived."""
        if part.role == "constant":
            return cut[part.name] != part.constant
        if part.role == "derived":
            return get(part.pieces, cut[part.name]) != self.derived(part, cut)
        if part.base:
            return not part.legible(cut[part.name])
        return part.role == "bits" and not part.accepts(get(part.pieces, cut[part.name]))

    def number(self, role: str, cut: Mapping[str, bytes]) -> int | None:
        """The length, message number or address; None if the frame has none, or bytes are missing."""
        if role == "length":
            part = self.by_role.get(role)
            if self.longer and cut.get(self.longer.name):
                part = self.longer
            return self.step * get(part.pieces, cut[part.name]) if part and part.name in cut else None
        if role == "message" and self.texts:
            payload = self.by_role["payload"].name
            if payload not in cut:
                return None
            return text_ids.longest(self.texts, cut[payload], any_case=self.any_case)
        found = (
            self.id_bits()
            if role == "message"
            else [
                (part.name, shift, bits, "")
                for part in self.parts
                for kind, shift, bits, _ in part.bits
                if kind == role
            ]
        )
        if any(name not in cut for name, *_ in found) or (role == "address" and not found):
            return None
        number = 0
        for name, shift, bits, _ in found:
            part = next(each for each in self.parts if each.name == name)
            number = number << bits | part.raw(cut[name]) >> shift & (1 << bits) - 1
        return number


def _coded_names(spec: Any, parts: list[Part], *, silent: bool) -> list[str]:
    """Names of the coded parts: all between the first constant and the terminator unless stated."""
    roles, names = [part.role for part in parts], [part.name for part in parts]
    if "terminator" not in roles and not silent and spec is None:
        return []
    for each in spec if isinstance(spec, list) else [spec or {}]:
        if "over" in each:
            # Some parts may be those of the other direction.
            return [name for name in each["over"] if name in names]
    end = roles.index("terminator") if "terminator" in roles else len(names)
    return names[int(roles[0] == "constant") : end]


def _stuffing(spec: Any) -> Stuffing | None:
    if spec is None:
        return None
    exempt = tuple(spec.get("exempt", ()))
    return Stuffing(octets(spec["after"]), octets(spec["insert"])[0], exempt, spec.get("checksum") == "after")


class Cursor:
    """Reads the bytes of a frame from wire bytes, without inserted ones, one at a time."""

    def __init__(self, wire: bytes, frame: Frame) -> None:
        """Start at the beginning."""
        self._wire, self._frame = wire, frame
        self._recent = b""
        self.at = 0
        #: An inserted byte must follow the last byte.
        self.pending = False

    def take(self, part: Part) -> int:
        """The next byte of a part. Raises NeedMore or Refused."""
        if self.pending:
            assert self._frame.stuffing
            found = self._byte()
            if found != self._frame.stuffing.insert:
                again = self._frame.unique and found == self._frame.stuffing.after[0]
                raise Refused("truncated" if again else "stuffing", self.at)
            self.pending, self._recent = False, b""
        if part.name in self._frame.coded_names:
            return self._decoded(self._frame.codings[0])
        byte = self._byte()
        if self._frame.stuffed(part):
            assert self._frame.stuffing
            self._recent += bytes([byte])
            self.pending = self._recent.endswith(self._frame.stuffing.after)
        else:
            self._recent = b""
        return byte

    def run(self, part: Part, size: int) -> bytes:
        """The next bytes of a part; all at once if they are not stuffed."""
        if self.pending or self._frame.stuffed(part) or part.name in self._frame.coded_names:
            return bytes(self.take(part) for _ in range(size))
        if len(self._wire) < self.at + size:
            raise NeedMore(self.at + size)
        self.at += size
        return self._wire[self.at - size : self.at]

    def _decoded(self, coding: Coding) -> int:
        """The next byte of a coded part."""
        sent = b""
        while not sent or coding.goes_on(sent):
            sent += bytes([self._byte()])
        try:
            return coding.decode(sent)[0]
        except Wrong:
            raise Refused("stuffing", self.at) from None

    def _byte(self) -> int:
        if self.at == len(self._wire):
            raise NeedMore
        self.at += 1
        return self._wire[self.at - 1]


@dataclass(frozen=True, slots=True)
class Cut:
    """The parts of a frame, and its size on the wire."""

    parts: Mapping[str, bytes]
    size: int
    pending: bool
    #: Bytes at its end that may begin the next frame.
    kept: int = 0


class Splitter:
    """Decodes the frame at the beginning of wire bytes."""

    def __init__(self, frame: Frame, known: Mapping[int, Message]) -> None:
        """`known` are the messages of the direction, by number."""
        self._frame, self._known = frame, known

    def split(self, wire: bytes) -> Cut:
        """The frame at the beginning, checked byte by byte. Raises NeedMore or Refused."""
        if self._frame.terminator or self._frame.silent:
            return self._ended(wire)
        frame, cursor, cut = self._frame, Cursor(wire, self._frame), dict[str, bytes]()
        for part in frame.parts[: frame.payload_at]:
            self._take(part, cursor, cut)
            self._judge(part, cursor, cut)
        if frame.check_fails(cut):
            raise Refused("crc", cursor.at)
        payload = frame.by_role["payload"]
        cut[payload.name] = self._payload(payload, cursor, cut)
        if frame.blocks:
            self._unblock(frame.blocks, payload, cut)
        for part in frame.parts[frame.payload_at + 1 :]:
            if part is not frame.blocks:
                cut[part.name] = cursor.run(part, part.size if frame.has(part, cut) else 0)
        if frame.bad_constant(cut):
            raise Refused("frame", cursor.at)
        return Cut(cut, cursor.at, cursor.pending)

    def _ended(self, wire: bytes) -> Cut:
        frame = self._frame
        found = frame.ended(wire)
        cursor, cut = Cursor(wire[: found.size], frame), dict[str, bytes]()
        cursor.at = found.size
        for part in frame.parts:
            cut[part.name] = found.parts[part.name]
            if part.role == "constant" and cut[part.name] != part.constant:
                raise Refused("frame", found.size)
            if part.role == "length":
                announced = (frame.number("length", cut) or 0) - frame.bias
                if announced != len(found.parts[frame.by_role["payload"].name]):
                    raise Refused("length", found.size)
            else:
                self._judge(part, cursor, cut)
        return found

    def _unblock(self, blocks: Part, payload: Part, cut: dict[str, bytes]) -> None:
        """Take the check values of blocks out of a payload."""
        rest, size, values = cut[payload.name], len(blocks.pieces), b""
        every, plain = int(blocks.spec["every"].split()[0]), b""
        while rest:
            block = rest[: min(every, len(rest) - size)]
            plain, values = plain + block, values + rest[len(block) : len(block) + size]
            rest = rest[len(block) + size :]
        cut |= {payload.name: plain, blocks.name: values}

    def _take(self, part: Part, cursor: Cursor, cut: dict[str, bytes]) -> None:
        data, size = b"", part.size if self._frame.has(part, cut) else 0
        while len(data) < size:
            data += bytes([cursor.take(part)])
            known = self._frame.starts if part is self._frame.parts[0] else (part.constant,)
            constant = part.role == "constant" or (part is self._frame.parts[0] and known)
            if constant and not any(each.startswith(data) for each in known):
                raise Refused("frame", cursor.at, told=False)
        cut[part.name] = data

    def _judge(self, part: Part, cursor: Cursor, cut: Mapping[str, bytes]) -> None:
        frame = self._frame
        if part.role == "length" and frame.longer:
            self._judge_two(part, cursor, cut)
        elif part.role == "length":
            announced = (frame.number("length", cut) or 0) - frame.bias
            if not frame.least <= announced <= frame.most_sent:
                raise Refused("length", cursor.at)
        if part.role in ("bits", "derived") and frame.has(part, cut) and frame.wrong(part, cut):
            raise Refused("frame", cursor.at, told=frame.terminator is not None)
        header = frame.parts.index(part) < frame.payload_at
        if frame.bare and header and any(role not in ("constant", "value") for role, *_ in part.bits):
            number, address = frame.number("message", cut), frame.number("address", cut)
            if number is None:
                return
            message = self._known.get(number)
            if message is None:
                raise Refused("unknown", cursor.at, told=False)
            if address is not None and not message.allows(address):
                raise Refused("range", cursor.at, told=False)

    def _judge_two(self, part: Part, cursor: Cursor, cut: Mapping[str, bytes]) -> None:
        """Check one of two lengths."""
        frame = self._frame
        first = frame.by_role["length"]
        handing = frame.handing(first)
        assert handing
        last, otherwise = handing
        if not frame.has(part, cut):
            return
        number = get(part.pieces, cut[part.name])
        if part is first:
            wrong = number != otherwise and not frame.least + frame.bias <= number <= last
        else:
            wrong = not last < number <= frame.most + frame.bias
        if wrong:
            raise Refused("length", cursor.at)

    def _payload(self, part: Part, cursor: Cursor, cut: Mapping[str, bytes]) -> bytes:
        frame = self._frame
        announced = frame.number("length", cut)
        if announced is not None:
            size = announced - frame.bias
            return cursor.run(part, size + frame.added(size))
        message = self._known.get(frame.number("message", cut) or 0)
        if message is None:
            raise Refused("unknown", cursor.at)
        return _measured(message, lambda size: cursor.run(part, size), cursor)


def _measured(message: Message, take: Callable[[int], bytes], cursor: Cursor) -> bytes:
    """The bytes of a payload whose end follows from its counts."""
    most = message.sizes[1]
    taker = _Taker(take, most)
    try:
        size = _Measure(message.slots, taker, most=most).run(0)
        if size > most:
            raise Wrong("length")
    except Wrong:
        raise Refused("length", cursor.at) from None
    return taker.upto(size)


class _Taker:
    """Takes bytes of a payload as far as they decide."""

    def __init__(self, take: Callable[[int], bytes], most: int) -> None:
        self._take, self._data, self._most = take, b"", most

    def upto(self, end: int) -> bytes:
        """The bytes up to an offset. Raises Wrong if no payload is as long."""
        if end > self._most:
            raise Wrong("length")
        self._data += self._take(max(0, end - len(self._data)))
        return self._data[:end]


class _Measure:
    """Finds the end of a message or record field by field."""

    def __init__(
        self, slots: Sequence[Slot], taker: _Taker, last: Sequence[Test] = (), most: int = 1 << 32
    ) -> None:
        self._slots, self._taker, self._most = slots, taker, most
        counted = {slot.counts for slot in slots}
        tests = [
            test for slot in slots if not slot.choice or slot.choice not in counted for test in slot.when
        ]
        self._tested = {name for name, *_ in (*tests, *last)}
        self.numbers: dict[str, int] = {}
        self._counted: dict[str, int] = {}
        self._sizes: dict[str, int] = {}

    def run(self, at: int) -> int:
        """The offset of its end."""
        passed = ""
        for slot in self._slots:
            if slot.choice in self._sizes:
                at += self._sizes[slot.choice] if slot.choice != passed else 0
                passed = slot.choice
            elif holds(slot, self.numbers):
                at = self._records(slot, at) if slot.walked else self._plain(slot, at)
        return at

    def _plain(self, slot: Slot, at: int) -> int:
        kind = slot.kind
        if isinstance(kind, Run) and kind.end:
            return at + self._ended(kind, at)
        if isinstance(kind, Run | Records):
            return at + kind.bytes_of(self._counted.get(slot.name, kind.most))
        end = at + size_of(kind)
        names = {name for name, *_ in kind.members} if isinstance(kind, Packed) else {slot.name}
        if not slot.counts and not names & self._tested:
            return end
        data = self._taker.upto(end)[at:]
        note(slot, data, self.numbers)
        if slot.counts:
            self._count(slot, data)
        return end

    def _ended(self, kind: Run, at: int) -> int:
        """The size of a run with its terminator, byte by byte."""
        for number in range(kind.most + 1):
            if self._taker.upto(at + number + 1)[at + number :] == kind.end:
                if number < kind.low:
                    break
                return number + 1
        raise Wrong("length")

    def _count(self, slot: Slot, data: bytes) -> None:
        assert isinstance(slot.kind, Number)
        raw = get(slot.kind.pieces, data)
        if cases := [each for each in self._slots if each.choice == slot.counts]:
            self._sizes.setdefault(slot.counts, raw - slot.more)
            if not 0 <= raw - slot.more <= min(most_bytes(cases), self._most):
                raise Wrong("length")
            return
        counted = next(each for each in self._slots if each.name == slot.counts)
        if counted.walked and slot.counts_in == "bytes":
            self._sizes.setdefault(slot.counts, raw - slot.more)
            if not counted.least_bytes <= raw - slot.more <= min(counted.most_bytes, self._most):
                raise Wrong("length")
        elif slot.counts not in self._counted:
            self._counted[slot.counts] = items_of(self._slots, slot, raw)

    def _records(self, slot: Slot, at: int) -> int:
        if slot.name in self._sizes:
            return at + self._sizes[slot.name]
        kind = slot.kind
        assert isinstance(kind, Record | Records)
        if isinstance(kind, Record):
            return _Measure(kind.slots, self._taker).run(at)
        for _ in range(self._counted.get(slot.name, kind.most)):
            own = _Measure(kind.record.slots, self._taker, kind.last)
            at = own.run(at)
            if met(kind.last, own.numbers):
                return at
        if kind.last:
            raise Wrong("length")
        return at
