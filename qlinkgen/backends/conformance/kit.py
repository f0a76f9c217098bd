"""Everything that a kit says, as strings and small integers for the templates."""

from __future__ import annotations

from qlinkgen._dataclass import dataclass
from qlinkgen.backends.base import banner
from qlinkgen.backends.conformance import streams
from qlinkgen.backends.conformance.layout import numbers, wrapped
from qlinkgen.backends.conformance.messages import ERRORS, Entries, Entry
from qlinkgen.backends.conformance.rows import Right, held, kinds_in, most_values, rows_of
from qlinkgen.backends.conformance.sources import Sources
from qlinkgen.errors import GenerationError
from qlinkgen.model.naming import file_stem
from qlinkgen.plan import Plan
from qlinkgen.plan.ends import Rescan

#: Bits of a row's first byte that name kinds; the two above them say "by hand" and "refused".
_KINDS = 6


@dataclass(frozen=True, slots=True)
class CheckView:
    """The check value of the nine characters 123456789, as text and as a literal."""

    name: str
    bits: int
    value: str
    literal: str


@dataclass(frozen=True, slots=True)
class KindView:
    """A kind of vectors, and its bit in the first byte of a row."""

    name: str
    bit: str


@dataclass(frozen=True, kw_only=True)
class KitView:
    """The variables of the templates. Types are the smallest that hold every number of the kit.

    Attributes:
        place_type: holds the offsets of struct members; 16 bits if possible, for small targets.
        unaddressed: responses in frames without address, where others have one.
        has_records: the struct of a message has records, or choices.
        has_choices: a message has a value whose type another value decides.
        empty_wires: a response is empty: without payload, frame and check value.
    """

    about: list[str]
    p: str
    header: str
    P: str
    id: str
    address: str
    has_values: bool
    store: str
    directed: bool
    unpacks: bool
    listener: str
    sum_bits: int
    address_type: str
    address_bytes: int
    rescans: bool
    gaps: bool
    packets: bool
    broadcast: bool
    unaddressed: list[str]
    size_bytes: int
    place_type: str
    has_records: bool
    has_choices: bool
    id_type: str
    number_type: str
    member_type: str
    printed_type: str
    printed_digits: int
    check: CheckView | None
    kinds: list[KindView]
    kind_mask: str
    kind_size: int
    errors: tuple[str, ...]
    error_size: int
    noise: list[str]
    noise_size: int
    most_wire: int
    empty_wires: bool
    most_request: int
    most_values: int
    most_events: int
    entries: list[Entry]
    last: int
    tests: int
    has_requests: bool
    refuses: bool
    encodes: bool
    decodes: bool
    receives: bool
    has_handlers: bool
    has_callbacks: bool
    frame_id_type: str
    checks: list[str]
    turned: list[str]
    keeps: bool


class Kit:
    """Converts the vectors of a protocol to the tables of a C file."""

    def __init__(self, plan: Plan, sources: Sources) -> None:
        """``plan`` has the messages of the header."""
        self._plan = plan
        self._header = sources.header
        self._rows = rows_of(plan, sources)
        self._every = [row for each in self._rows.values() for row in each]
        self._entries = Entries(plan, sources.header, self._rows)

    def view(self) -> KitView:
        """The variables of the templates."""
        header, entries = self._header, self._entries.views()
        check, kinds, noise = self._check(), self._kinds(), streams.noise(self._plan)
        tests = bool(check) + sum(each.tests + each.handler_tests + each.callback_tests for each in entries)
        most_wire = max(len(row.wire) for row in self._every)
        members = max(len(each.members) for each in entries)
        choices = any(each.cases for each in entries)
        records = choices or any(each.payload.records for each in self._plan.messages)
        values = max(most_values(header, held(each)) for each in self._plan.messages)
        printed = max(tests, most_wire, (1 << header.address_bits) - 1)
        return KitView(
            about=[piece for line in banner(self._plan.protocol) for piece in wrapped(line)],
            p=header.prefix,
            header=file_stem(header.prefix),
            P=header.upper,
            id=header.id,
            address=header.address,
            has_values=bool(self._plan.beside),
            store=self._entries.store,
            directed=header.directed,
            unpacks=header.unpacks,
            listener=header.listener,
            sum_bits=header.sum_bits,
            address_type=f"uint{header.address_bits}_t",
            address_bytes=header.address_bits // 8,
            rescans=isinstance(self._plan.frame.receiver, Rescan),
            gaps=self._plan.frame.silent,
            packets=self._plan.frame.needs_request,
            broadcast=bool(header.address) and self._plan.protocol.bus.broadcast is not None,
            unaddressed=self._unaddressed(),
            size_bytes=self._entries.size_bytes,
            # A number in a struct is followed by up to seven bytes of padding.
            place_type=_unsigned(8 * values if records else values + 8 * members),
            has_records=records,
            has_choices=choices,
            frame_id_type=f"uint{header.id_bits}_t",
            id_type=_unsigned((1 << header.id_bits) - 1),
            number_type=_unsigned(tests),
            member_type="uint8_t" if members <= 0xFF else "uint16_t",
            printed_type=_unsigned(printed),
            printed_digits=len(str(printed)) if printed > 0xFFFF else 5,
            check=check,
            kinds=[KindView(kind, f"0x{1 << bit:02X}") for bit, kind in enumerate(kinds)],
            kind_mask=f"0x{(1 << _KINDS) - 1:02X}",
            kind_size=max(map(len, kinds)) + 1,
            errors=ERRORS,
            error_size=max(map(len, ERRORS)) + 1,
            noise=[numbers((len(piece), *piece)) for piece in noise],
            noise_size=max(map(len, noise)) + 1,
            most_wire=most_wire,
            empty_wires=not all(row.wire for row in self._every if isinstance(row, Right)),
            most_request=max(len(row.request) for row in self._every),
            most_values=max(1, values),
            most_events=self._entries.most_events + 1,
            entries=entries,
            last=len(entries) - 1,
            tests=tests,
            has_requests=bool(header.sum_bits and any(row.request for row in self._every)),
            refuses=any(each.unsent_lines for each in entries),
            encodes=any(each.encoded for each in entries),
            decodes=any(each.decoded for each in entries),
            receives=any(each.received for each in entries),
            has_handlers=any(each.slave_member for each in entries),
            has_callbacks=any(each.callback_member for each in entries),
            checks=sorted({each.received_as for each in entries if each.framed and not each.turned}),
            keeps=any(map(self._plan.protocol.keeps, self._plan.commands)),
            turned=[each.constant for each in entries if each.turned and each.decoded],
        )

    def _kinds(self) -> tuple[str, ...]:
        kinds = tuple(kinds_in(self._rows))
        if len(kinds) > _KINDS:
            raise GenerationError(
                f"{self._plan.protocol.name}: {len(kinds)} kinds of vectors; a kit holds at most {_KINDS}"
            )
        return kinds

    def _unaddressed(self) -> list[str]:
        responses = [each for each in self._plan.messages if each.direction == "response"]
        if not self._header.address or not self._plan.frame.kinds:
            return []
        found = {each.id: each.message for each in responses if not each.envelope.address}
        return [self._header.constant(each) for each in found.values()]

    def _check(self) -> CheckView | None:
        """The check value of the nine characters 123456789, None if it is not a CRC."""
        check, bits = self._plan.frame.check, self._header.check_bits
        if check is None or not bits:
            return None
        algorithm = check.algorithm
        suffix = {8: "u", 16: "u", 32: "ul", 64: "ull"}[bits]
        value = f"0x{algorithm.check:0{bits // 4}X}"
        return CheckView(algorithm.name, bits, value, value + suffix)


def _unsigned(most: int) -> str:
    return next(f"uint{bits}_t" for bits in (16, 32, 64) if most < 1 << bits)
