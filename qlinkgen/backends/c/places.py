"""The places of the parts of a frame in a buffer, and the numbers in them."""

from __future__ import annotations

from collections.abc import Iterable

from qlinkgen._dataclass import dataclass
from qlinkgen.backends.c.layout import Layouts
from qlinkgen.backends.c.names import unsigned, unsigned_type
from qlinkgen.model.naming import address_member
from qlinkgen.plan.conditional import Selector
from qlinkgen.plan.envelope import Envelope
from qlinkgen.plan.framing import FramePlan
from qlinkgen.plan.parts import Bits, Numeric, Part, Slot
from qlinkgen.plan.transparency import FrameStuffing


@dataclass(frozen=True, slots=True)
class Sender:
    """Message number, address and values of a frame: their C names and types; "" without them."""

    id: str
    id_type: str
    address: str
    address_type: str
    values_type: str

    @property
    def identity(self) -> str:
        """Message number and address as parameters."""
        address = f", {self.address_type} {self.address}" if self.address else ""
        return f"{self.id_type} {self.id}{address}"

    @property
    def parameters(self) -> str:
        """All as parameters."""
        return f"{self.identity}, const {self.values_type} *parts" if self.values_type else self.identity

    @property
    def arguments(self) -> str:
        """All as arguments."""
        parts = ("parts",) if self.values_type else ()
        return ", ".join((self.id, *((self.address,) if self.address else ()), *parts))


def sender_of(frame: FramePlan, prefix: str) -> Sender:
    """The sender of a frame; names are "id" and that of the address, changed if taken."""
    if frame.kinds:
        return _sender_of_kinds(frame, prefix)
    envelope = frame.envelope
    address = address_member(frame.address)
    address_type = unsigned_type(envelope.address[0].bits if envelope.address else 8)
    return Sender(
        address_member(frame.id_name) if address == "id" else "id",
        unsigned_type(_reach(envelope) or max(8, len(frame.texts).bit_length())),
        address,
        address_type if address else "",
        f"{prefix}_parts_t" if envelope.values else "",
    )


def _reach(envelope: Envelope) -> int:
    """Bits of a message number; frames of the other direction may have pieces below those of this one."""
    return max((bits.at + bits.bits for bits in envelope.id), default=0)


def id_bits(frame: FramePlan) -> int:
    """Bits of a message number, above it that of the family of kinds."""
    numbers = ((each.base, _reach(each.envelope)) for each in frame.every)
    most = max((base | (1 << size) - 1).bit_length() for base, size in numbers)
    return most or max(8, len(frame.texts).bit_length())


def _sender_of_kinds(frame: FramePlan, prefix: str) -> Sender:
    """Several kinds have the address and the values of any of them."""
    address = address_member(frame.address)
    sizes = [bits.bits for kind in frame.kinds for bits in kind.envelope.address[:1]]
    return Sender(
        address_member(frame.id_name) if address == "id" else "id",
        unsigned_type(id_bits(frame)),
        address,
        unsigned_type(sizes[0]) if sizes else "",
        f"{prefix}_parts_t" if frame.values else "",
    )


@dataclass(frozen=True)
class Places:
    """Where the parts of a frame are in C, and expressions for what they hold.

    A frame without its ``lead``, the constant at its front that is never stuffed, is called a body.
    """

    prefix: str
    frame: FramePlan
    sender: Sender
    layouts: Layouts
    #: Names and bytes of the attributes of any message that check values cover.
    seeds: tuple[tuple[str, bytes], ...] = ()
    #: A receiver knows the direction.
    directed: bool = False
    #: What the names of functions begin with that are about these frames: the prefix, with the direction if
    #: the other direction has other frames.
    own: str = ""
    #: The frames of all directions.
    every: tuple[Envelope, ...] = ()
    #: Bits of a message id, if that has more than the number in the frame.
    id_bits: int = 0

    @property
    def envelope(self) -> Envelope:
        """Its parts."""
        return self.frame.envelope

    @property
    def stuffing(self) -> FrameStuffing | None:
        """The stuffing of whole frames."""
        found = self.frame.transparency
        return found if isinstance(found, FrameStuffing) else None

    @property
    def lead(self) -> bytes:
        """The unstuffed constant before the body; b"" if the body is the whole frame."""
        preamble, stuffing = self.envelope.preamble, self.stuffing
        return preamble if stuffing and len(preamble) <= stuffing.front else b""

    @property
    def head(self) -> int:
        """Size of the header of a body."""
        return self.envelope.header_size - len(self.lead)

    @property
    def least_head(self) -> int:
        """The same without the parts that only some frames have."""
        return self.head - (self.envelope.before.size if self.envelope.before else 0)

    @property
    def head_text(self) -> str:
        """Size of the header of a body as an expression: a variable if it differs among frames."""
        return "head" if self.envelope.before else f"{self.head}U"

    def parts(self) -> tuple[Part, ...]:
        """The parts of a body."""
        return self.envelope.parts[1:] if self.lead else self.envelope.parts

    # Numbers

    def message_id(self, number: str) -> str:
        """The id of a message by its number in the frame."""
        if not self.id_bits:
            return number
        numbered = f"({unsigned_type(self.id_bits)}){number}" if self.envelope.id else "0U"
        if not self.frame.base:
            return numbered
        base = unsigned(self.frame.base, self.id_bits, hexadecimal=True)
        return f"({base} | {numbered})" if self.envelope.id else base

    def number(self, pieces: tuple[Bits, ...]) -> str:
        """The message id or address in these pieces of a received frame, 0 if there are none."""
        kind = unsigned_type(sum(each.bits for each in pieces) or 8)
        if len(pieces) == 1 and pieces[0].whole:
            return self.get(pieces[0].part)
        terms = [shifted(self._piece(each, kind), each.at, kind) for each in pieces]
        return (f"({kind})({' | '.join(terms)})" if len(terms) > 1 else terms[0]) if terms else "0U"

    def _piece(self, bits: Bits, kind: str) -> str:
        return f"({kind}){self.taken(self.get(bits.part), bits, whole=bits.whole)}"

    def get(self, part: Numeric, place: str = "") -> str:
        """The expression for the integer of a part, in a body or after the payload."""
        place = place or ("end" if part in self.envelope.back else "body")
        found = self.layouts.get(part.integer, place, str(self._at(part)))
        if part.size > 1 or part.digits or (mask := part.integer.chunks[0].mask) == 0xFF:
            return found
        return f"({found} & {in_hex(mask)})"

    @staticmethod
    def taken(found: str, bits: Bits | Slot | Selector, *, whole: bool) -> str:
        """The bits of an integer."""
        if whole:
            return found
        shifted = f"({found} >> {bits.shift})" if bits.shift else found
        return f"({shifted} & {unsigned((1 << bits.bits) - 1, bits.bits, hexadecimal=True)})"

    # Offsets

    def _front(self) -> tuple[Part, ...]:
        return self.envelope.front[1:] if self.lead else self.envelope.front

    def _at(self, part: Part) -> int:
        """Offset of a part in the body, or after the payload."""
        trailing = part in self.envelope.back
        return self.envelope.offset(part) - (self.envelope.header_size if trailing else len(self.lead))

    def _place(self, part: Part, start: str, payload_end: str, *, after: bool = False) -> str:
        if after and part is self.envelope.payload:
            return payload_end
        before = self.envelope.before
        if before and part is self.envelope.payload:
            return self.head_text
        if before and part in before.parts:
            place = self._at(part) + (part.size if after else 0)
            if place in (self.least_head, self.head):
                return f"{place}U" if place == self.least_head else self.head_text
            return f"(({self.head_text} > {self.least_head}U) ? {place}U : {self.least_head}U)"
        base = payload_end if part in self.envelope.back else start
        return added(base, self._at(part) + (part.size if after else 0))


def shifted(value: str, shift: int, kind: str) -> str:
    """A value of a type, shifted up."""
    return f"({kind})({value} << {shift})" if shift else value


def any_of(terms: Iterable[str]) -> str:
    """The disjunction of conditions, "" without conditions."""
    found = list(terms)
    return " || ".join(f"({term})" for term in found) if len(found) > 1 else "".join(found)


def refusal(test: str, status: str) -> list[str]:
    """A statement that returns a status if a condition holds."""
    return [f"if ({test}) {{", f"    return {status};", "}"]


def indented(lines: list[str]) -> list[str]:
    """Lines one level deeper."""
    return [f"    {line}" for line in lines]


def in_hex(byte: int) -> str:
    """A byte as a constant."""
    return unsigned(byte, 8, hexadecimal=True)


def added(base: str, offset: int) -> str:
    """An offset after a base, which is "0" or an expression."""
    return f"{offset}U" if base == "0" else f"{base} + {offset}U" if offset else base
