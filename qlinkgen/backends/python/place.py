"""The surroundings of a payload in the bytes that a message class encodes and decodes."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import field, replace
from typing import assert_never

from qlinkgen._dataclass import dataclass
from qlinkgen.backends.python.names import named_classes
from qlinkgen.model.checksum import Checksum
from qlinkgen.model.integer import ByteOrder
from qlinkgen.model.naming import address_attribute
from qlinkgen.plan.conditional import Conditional
from qlinkgen.plan.ends import Gaps, Hunt, InStep, Marks, Rescan
from qlinkgen.plan.envelope import Envelope
from qlinkgen.plan.parts import CheckPart, Part
from qlinkgen.plan.payload import Member
from qlinkgen.plan.tree import Plan


@dataclass(frozen=True)
class Place:
    """The module and the frame around a payload.

    Attributes:
        byteorder: byte order of the structs.
        classes: class of each enum, flags and record.
        envelope: the frame if classes handle whole frames, None if they handle only payloads.
        after: parts after it, which the base class of messages handles; None if there are none.
        address: attribute that holds the address, "" if there is none.
        unique: the last step of an encoder adds the preamble, and the receiver checks it.
        texts: print text defaults as text, not as numbers.
        members: values of the frame of a message, if its class handles only its payload.
        used: names of imports used so far.
        checks: algorithms of the check values in payloads so far.
    """

    byteorder: ByteOrder
    classes: Mapping[str, str]
    envelope: Envelope | None
    address: str
    unique: bool
    after: Conditional | None = None
    texts: bool = True
    members: tuple[Member, ...] = ()
    used: set[str] = field(default_factory=set, compare=False)
    checks: list[Checksum] = field(default_factory=list, compare=False)

    def use(self, name: str) -> str:
        """Add a name to the imports of the module and return it."""
        self.used.add(name)
        return name

    def check(self, algorithm: Checksum) -> str:
        """The constant of an algorithm of check values in payloads."""
        if algorithm not in self.checks:
            self.checks.append(algorithm)
        return f"_CHECK_{self.checks.index(algorithm) + 1}"

    @property
    def bare(self) -> Place:
        """The place of a record: without a frame."""
        return replace(self, envelope=None, after=None, address="", unique=False)

    def within(self, envelope: Envelope) -> Place:
        """The place in the frames of a direction or kind."""
        if self.envelope:
            return replace(self, envelope=envelope.inner, after=envelope.after)
        return replace(self, members=tuple(member for _, member in envelope.values))

    @property
    def prefix(self) -> str:
        """The byte order character of struct formats."""
        return ">" if self.byteorder == "big" else "<"

    @property
    def skipped(self) -> int:
        """Number of bytes at the start of the frame that classes do not handle."""
        return len(self.envelope.preamble) if self.envelope and self.unique else 0

    @property
    def header(self) -> int:
        """Bytes before the payload."""
        return self.envelope.header_size - self.skipped if self.envelope else 0

    @property
    def trailer(self) -> int:
        """Bytes after the payload."""
        return self.envelope.trailer_size if self.envelope else 0

    @property
    def overhead(self) -> int:
        """Bytes before and after the payload."""
        return self.header + self.trailer

    @property
    def front(self) -> tuple[Part, ...]:
        """Parts before the payload."""
        return self.envelope.front[int(self.unique) :] if self.envelope else ()

    @property
    def back(self) -> tuple[Part, ...]:
        """Parts after the payload that an encoder packs; a check value at the end is added later."""
        back = self.envelope.back if self.envelope else ()
        return back[:-1] if back and isinstance(back[-1], CheckPart) else back

    @property
    def beside(self) -> tuple[Member, ...]:
        """Values of every frame."""
        return (*self.inside, *(self.after.values if self.after else ()), *self.members)

    @property
    def inside(self) -> tuple[Member, ...]:
        """Values of every frame that the class of a message packs."""
        return tuple(member for _, member in self.envelope.values) if self.envelope else ()

    @property
    def data(self) -> str:
        """Name of the argument of a decoder."""
        return "payload" if self.envelope is None else "body" if self.unique else "frame"

    @property
    def payload(self) -> str:
        """Expression for the payload, for error texts."""
        return f"_payload({self.data})" if self.envelope else "payload"


def place_of(plan: Plan) -> Place:
    """The place of a protocol's messages."""
    match plan.frame.receiver:
        case Hunt():
            envelope: Envelope | None = plan.frame.envelope
            unique = True
        case Rescan() if plan.frame.kinds:
            envelope, unique = None, False
        case Rescan() | Gaps():
            envelope, unique = plan.frame.envelope, False
        case Marks() | InStep():
            envelope, unique = None, False
        case _:
            assert_never(plan.frame.receiver)
    place = Place(
        byteorder=plan.protocol.byteorder,
        classes=named_classes(plan),
        envelope=envelope,
        address=address_attribute(plan.frame.address) if plan.frame.address else "",
        unique=unique,
        texts=plan.protocol.texts,
    )
    return place.within(envelope) if envelope else place
