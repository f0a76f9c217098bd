"""The messages of a kit: names, tables and numbers of tests."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import assert_never

from qlinkgen._dataclass import dataclass
from qlinkgen.backends.conformance import streams
from qlinkgen.backends.conformance.layout import call, comment, folded, numbers, row_lines
from qlinkgen.backends.conformance.rows import Right, Row, Wrong, presences
from qlinkgen.backends.conformance.sources import Header
from qlinkgen.backends.conformance.streams import INTACT, Stream
from qlinkgen.backends.conformance.unsent import Unsent, unsent
from qlinkgen.model import naming
from qlinkgen.model.types import Characters
from qlinkgen.plan import MessagePlan, Plan
from qlinkgen.plan.payload import (
    BytesStep,
    Holder,
    ItemsStep,
    Member,
    PayloadPlan,
    RecordsStep,
    RecordStep,
    ValueStep,
)

#: Words for the errors of a header, in the order of their numbers.
ERRORS = (
    *(INTACT, "capacity", "length", "range", "unknown"),
    *("crc", "stuffing", "truncated", "frame", "illegal"),
)
_RANGE = "range"


@dataclass(frozen=True, slots=True)
class Answer:
    """The response of a slave to a message."""

    number: int
    stem: str
    function: str
    has_struct: bool


@dataclass(frozen=True, slots=True, kw_only=True)
class Entry:
    """A message.

    Attributes:
        members: members of its struct, in the order of values in vectors.
        framed: its frame identifies the message.
        turned: only its turn in a dialogue tells it.
        received_as: the direction in which it is received.
        received: whether it has a stream, which may be ``noisy``.
        lines: its rows.
        unsent_lines: rows that an encoder refuses.
        tests: their number; ``handler_tests`` and ``callback_tests`` are those of slave and listener.
        slave_member: the member of the slave's struct that handles it, "" if none does.
        callback_member: the member of the listener's struct that receives it, "" if none does.
        turn: the number of the frame in dialogues, 0 if it is not a later one.
        proof: bytes at the end of its response that cover the request.
    """

    number: int
    name: str
    stem: str
    function: str
    constant: str
    is_response: bool
    has_struct: bool
    has_bytes: bool
    cases: list[CaseView]
    members: list[str]
    encoded: bool
    decoded: bool
    framed: bool
    turned: bool
    received_as: str
    received: bool
    noisy: bool
    lines: list[str]
    unsent_lines: list[str]
    tests: int
    handler_tests: int
    callback_tests: int
    encode_lines: list[str]
    decode_lines: list[str]
    slave_member: str
    callback_member: str
    answer: Answer | None
    turn: int
    proof: int

    @property
    def entry_lines(self) -> list[str]:
        """The row of the table of messages."""
        stem, answer = self.stem, self.answer or self
        numbers_of = (answer.number, self.tests, self.handler_tests, self.callback_tests, len(self.members))
        facts = (self.is_response, self.received, self.noisy)
        groups = (
            [f"{stem}_name", f"{stem}_members" if self.members else "NULL"],
            [f"{stem}_vectors", f"sizeof({stem}_vectors)"],
            [f"{stem}_unsent", f"sizeof({stem}_unsent)"] if self.unsent_lines else ["NULL", "0u"],
            [
                f"{self.constant}_ID",
                *(f"{number}u" for number in numbers_of),
                *("true" if fact else "false" for fact in facts),
            ],
            [f"{stem}_encode" if self.encoded else "NULL", f"{stem}_decode" if self.decoded else "NULL"],
        )
        lines = [line for group in groups for line in folded(", ".join(group) + ",")]
        return ["{" + lines[0], *(f" {line}" for line in lines[1:-1]), f" {lines[-1].removesuffix(',')}}},"]


class Entries:
    """Converts the selected messages to views, in schema order."""

    def __init__(self, plan: Plan, header: Header, rows: Mapping[str, Sequence[Row]]) -> None:
        """``rows`` are the vectors of each message."""
        self._plan = plan
        self._header = header
        self._rows = rows
        self._numbers = {message.name: number for number, message in enumerate(plan.messages)}
        self._streams = {each.name: streams.stream(plan, each, rows[each.name]) for each in plan.messages}
        most = max(size for each in rows.values() for row in each for size in _sizes(row))
        #: Size of the length of each part of a row.
        self.size_bytes = 1 if most <= 0xFF else 2 if most <= 0xFFFF else 3

    @property
    def most_events(self) -> int:
        """Maximum number of events of a row of a stream."""
        found = [each.events for each in self._streams.values() if each]
        return max((len(events) for each in found for events in each if events is not None), default=0)

    @property
    def store(self) -> str:
        """The place of the messages."""
        return "store.message." if self._plan.beside else "store."

    def views(self) -> list[Entry]:
        """The views of all messages."""
        return [self._view(message) for message in self._plan.messages]

    # Roles

    def _has_handler(self, message: MessagePlan) -> bool:
        """Whether a slave has a function for it."""
        exchange = self._plan.protocol.exchanges.get(message.name)
        each = exchange.command.each if exchange else None
        listed = each is not None and not each.by  # whose node need not be in the list of a vector
        return "request" in self._plan.received_directions and message.direction != "response" and not listed

    def _has_callback(self, message: MessagePlan) -> bool:
        """Whether a listener has a function for it."""
        listens = self._plan.received_directions != ("request",)
        return (
            bool(self._header.listener) and listens and message.direction != "request" and not message.asked
        )

    def _answer(self, message: MessagePlan) -> Answer | None:
        header, exchange = self._header, self._plan.protocol.exchanges.get(message.name)
        answer = exchange.answers[0] if exchange and exchange.answers else None
        if answer is None or answer.name not in self._numbers:
            return None
        stem, number = naming.member(header.stem(answer)), self._numbers[answer.name]
        return Answer(number, stem, header.function(answer), bool(answer.values))

    # A message

    def _view(self, plan: MessagePlan) -> Entry:
        header, message = self._header, plan.message
        rows, found = self._rows[plan.name], self._streams[plan.name]
        framed = plan.decoded and not (self._plan.frame.needs_request and plan.direction == "response")
        refused = self._unsent(plan) if plan.encoded else []
        function, stem = header.function(message), naming.member(header.stem(message))
        store = f"&{self.store}{stem}, " if message.values else ""
        address = "address, " if header.address else ""
        address += "&store.parts, " if self._plan.around(plan.direction).values else ""
        part = "request_sum, " if header.sum_bits and plan.direction == "response" else ""
        decided = "&store.parts, " if message.decided_by else ""
        decode = f"decode({store}{decided}" if framed else f"from_frame({store}{part}"
        handled, called = self._has_handler(plan), self._has_callback(plan)
        ranges = sum(isinstance(row, Wrong) and row.kind == _RANGE for row in rows)
        right = [row for row in rows if isinstance(row, Right)]
        exchange = self._plan.protocol.exchanges.get(plan.name)
        own = MemberRows(header, stem)
        return Entry(
            number=self._numbers[message.name],
            name=message.name,
            stem=stem,
            function=function,
            constant=header.constant(message),
            is_response=plan.direction == "response",
            has_struct=bool(message.values),
            has_bytes=bool(message.fields),
            members=own.members(plan),
            cases=own.cases,
            encoded=plan.encoded,
            decoded=plan.decoded,
            framed=framed,
            turned=plan.turned,
            received_as=self._plan.direction_of(plan),
            received=found is not None,
            noisy=found is not None and found.noisy,
            lines=[line for index, row in enumerate(rows) for line in self._lines(row, found, index)],
            unsent_lines=[line for row in refused for line in self._unsent_lines(row)],
            tests=len(refused) + self._tests(plan, rows, found),
            handler_tests=ranges + sum(bool(row.kinds) for row in right) if handled else 0,
            callback_tests=ranges + len(right) if called else 0,
            encode_lines=call(f"return {function}_to_frame({store}{address}{part}bytes, capacity);"),
            decode_lines=call(f"return {function}_{decode}bytes, size);"),
            slave_member=header.slave_member(message) if handled else "",
            callback_member=header.callback_member(message) if called else "",
            answer=self._answer(plan) if handled else None,
            turn=exchange.turn if exchange else 0,
            proof=exchange.command.proof.size if exchange and exchange.command.proof else 0,
        )

    def _tests(self, plan: MessagePlan, rows: Sequence[Row], found: Stream | None) -> int:
        """Number of tests of encoding, decoding and receiving."""
        sent = sum(isinstance(row, Right) and not row.decode_only for row in rows)
        fed = sum(each is not None for each in found.events) if found else 0
        return fed + (sent if plan.encoded else 0) + (len(rows) if plan.decoded else 0)

    def _unsent(self, message: MessagePlan) -> list[Unsent]:
        rows = self._rows[message.name]
        right = next(row for row in rows if isinstance(row, Right) and not row.decode_only)
        return list(unsent(self._header, message, right))

    # Rows

    def _lines(self, row: Row, found: Stream | None, index: int) -> list[str]:
        """A row of the table, with a comment if its first byte does not describe it."""
        pieces = [self._head(row)]
        if isinstance(row, Right) and (row.message.values or row.beside):
            pieces.append(self._sized(row.values))
        if self._header.sum_bits and row.message.direction == "response":
            pieces.append(self._sized(row.request))
        pieces.append(self._sized(row.wire))
        if found is not None:
            pieces.append(_events(found.events[index]))
        what = row.what if isinstance(row, Wrong) else ""
        return [*comment(f"by hand, {row.source}" if row.by_hand else what), *row_lines(pieces)]

    def _unsent_lines(self, row: Unsent) -> list[str]:
        pieces = [self._address(row.address)] if self._header.address else []
        pieces += [self._sized(row.values)] if row.values else []
        return [*comment(row.what), *row_lines(pieces)]

    def _address(self, address: int) -> str:
        return numbers(address.to_bytes(self._header.address_bits // 8, "big")) + ","

    def _head(self, row: Row) -> str:
        hand = ["BY_HAND"] if row.by_hand else []
        if isinstance(row, Wrong):
            return f"{' | '.join([*hand, f'REFUSED(E_{row.kind.upper()})'])},"
        hand += ["ONLY_DECODED"] if row.decode_only else []
        kinds = " | ".join([*hand, *(f"V_{kind.upper()}" for kind in row.kinds)])
        return f"{kinds}, {self._address(row.address)}" if self._header.address else f"{kinds},"

    def _sized(self, data: bytes) -> str:
        size = f"SIZE({len(data)})" if self.size_bytes > 1 else str(len(data))
        return ", ".join([size, *([numbers(data)] if data else [])]) + ","


def _sizes(row: Row) -> tuple[int, ...]:
    return len(row.wire), len(row.request), len(row.values) if isinstance(row, Right) else 0


def _events(events: tuple[str, ...] | None) -> str:
    if events is None:
        return "NOT_FED,"
    return ", ".join([str(len(events)), *(f"E_{event.upper()}" for event in events)]) + ","


@dataclass(frozen=True, slots=True)
class CaseView:
    """The function that tells whether a struct has a case of a choice.

    Attributes:
        struct: its type, "" if a value of the frame tells.
    """

    function: str
    struct: str
    test: str


class MemberRows:
    """The rows of the table of one struct, one for each number, run, record and case.

    Attributes:
        cases: the functions that rows of cases name; complete once the rows have been made.
    """

    def __init__(self, header: Header, stem: str) -> None:
        """``stem`` identifies the message in names."""
        self._header = header
        self._stem = stem
        self.cases: list[CaseView] = []

    def members(self, message: MessagePlan) -> list[str]:
        """The rows of a message, with the values of its frame."""
        values = [
            line for _, each in message.envelope.values for line in self._member("store_t", "parts.", each)
        ]
        return values + self._rows_of(f"{self._header.function(message.message)}_t", "", message.payload)

    def _rows_of(self, struct: str, inside: str, payload: PayloadPlan) -> list[str]:
        """The rows of the values of a message or a record."""
        lines: list[str] = []
        before = presences(payload.settable)
        for step in payload.settable:
            rows = self._member(struct, inside, step)
            if step.name in before and before[step.name].slot:
                test = self._header.test(payload, before[step.name], inside, "store.parts.")
                beside = before[step.name].choosing.value in {each.name for each in payload.decided_by}
                name = f"{self._stem}_case_{len(self.cases) + 1}"
                case = CaseView(name, "" if beside else struct, test)
                self.cases.append(case)
                lines.append(f"CASE({case.function}, {len(rows)}u),")
            elif step.name in before:
                lines.append(f"NUMBER({struct}, {inside}has_{before[step.name].field}),")
            lines += rows
        return lines

    def _member(self, struct: str, inside: str, step: Holder) -> list[str]:
        name = inside + self._header.member(step)
        match step:
            case ValueStep() | Member() if step.number.bits > 64:
                return [f"NUMBER({struct}, {name}.high),", f"NUMBER({struct}, {name}.low),"]
            case ValueStep() | Member() if isinstance(step.number.meaning, Characters):
                return [f"ITEMS({struct}, {name}),"]
            case ValueStep() | Member():
                return [f"NUMBER({struct}, {name}),"]
            case RecordStep():
                return self._rows_of(struct, f"{name}.", step.record.payload)
            case BytesStep() | ItemsStep() if step.fixed:
                return [f"ITEMS({struct}, {name}),"]
            case BytesStep() | ItemsStep():
                return [
                    f"NUMBER({struct}, {inside}{self._header.counting(step)}),",
                    f"COUNTED({struct}, {name}),",
                ]
            case RecordsStep():
                return self._records(struct, inside, step)
            case _:
                assert_never(step)

    def _records(self, struct: str, inside: str, step: RecordsStep) -> list[str]:
        record = f"{self._header.record(step.record.name)}_t"
        rows = self._rows_of(record, "", step.record.payload)
        name, counted = inside + self._header.member(step), "false" if step.fixed else "true"
        first = [] if step.fixed else [f"NUMBER({struct}, {inside}{self._header.counting(step)}),"]
        return [*first, f"RECORDS({struct}, {name}, {counted}, {len(rows)}u),", *rows]
