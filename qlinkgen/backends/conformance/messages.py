"""Everything that a kit says of its messages: names, tables, and how many tests they come to."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from qlinkgen.backends.conformance import streams
from qlinkgen.backends.conformance.layout import call, comment, folded, numbers, row_lines
from qlinkgen.backends.conformance.rows import Right, Row, Wrong
from qlinkgen.backends.conformance.sources import Header
from qlinkgen.backends.conformance.streams import INTACT, Stream
from qlinkgen.backends.conformance.unsent import Unsent, unsent
from qlinkgen.model import naming
from qlinkgen.model.message import Message, Value
from qlinkgen.model.types import Scalar
from qlinkgen.plan import MessagePlan, Plan

#: Words for the errors of a header, in the order of their numbers.
ERRORS = (
    *(INTACT, "capacity", "length", "range", "unknown"),
    *("crc", "stuffing", "truncated", "frame", "illegal"),
)
_RANGE = "range"


class Entries:
    """Lowers the messages that are kept, in schema order."""

    def __init__(self, plan: Plan, header: Header, rows: Mapping[str, Sequence[Row]]) -> None:
        """``rows`` are the vectors of each message."""
        self._plan = plan
        self._header = header
        self._rows = rows
        self._numbers = {message.name: number for number, message in enumerate(plan.messages)}
        self._streams = {each.name: streams.stream(plan, each, rows[each.name]) for each in plan.messages}
        most = max(size for each in rows.values() for row in each for size in _sizes(row))
        #: Bytes that say how long a part of a row is.
        self.size_bytes = 1 if most <= 0xFF else 2 if most <= 0xFFFF else 3

    @property
    def most_events(self) -> int:
        """Most events that a row of a stream brings."""
        found = [each.events for each in self._streams.values() if each]
        return max((len(events) for each in found for events in each if events is not None), default=0)

    def views(self) -> list[dict[str, Any]]:
        """Each message for the templates."""
        return [self._view(message) for message in self._plan.messages]

    # Who does what

    def _asked(self, message: MessagePlan) -> bool:
        """A slave has a function for it."""
        return "request" in self._plan.heard and message.direction != "response"

    def _told(self, message: MessagePlan) -> bool:
        """A listener has a function for it."""
        listens = self._plan.heard != ("request",)
        return bool(self._header.listener) and listens and message.direction != "request"

    def _answer(self, message: MessagePlan) -> Message | None:
        command = self._plan.protocol.command_of(message.message)
        answer = command.response if command else None
        return answer if answer and answer.name in self._numbers else None

    # A message

    def _view(self, plan: MessagePlan) -> dict[str, Any]:
        header, message = self._header, plan.message
        rows, found = self._rows[plan.name], self._streams[plan.name]
        framed = plan.decoded and not (self._plan.frame.needs_request and plan.direction == "response")
        refused = self._unsent(message) if plan.encoded else []
        view = {
            "number": self._numbers[message.name],
            "name": message.name,
            "stem": naming.member(header.stem(message)),
            "function": header.function(message),
            "constant": header.constant(message),
            "has_struct": bool(message.values),
            "has_bytes": bool(message.fields),
            "members": [line for value in message.values for line in self._members(message, value)],
            "encoded": plan.encoded,
            "decoded": plan.decoded,
            "framed": framed,
            "taken_as": self._plan.hears(plan),
            "received": found is not None,
            "lines": [line for index, row in enumerate(rows) for line in self._lines(row, found, index)],
            "unsent_lines": [line for row in refused for line in self._unsent_lines(row)],
            "tests": len(refused) + self._tests(plan, rows, found),
            "asked_tests": 0,
            "told_tests": 0,
        }
        view |= self._calls(message, view)
        view |= self._dispatched(plan, rows)
        return view | {"entry_lines": _entry(message, view, found)}

    def _calls(self, message: Message, view: Mapping[str, Any]) -> dict[str, Any]:
        """The lines that make a frame, and take its payload (or that of an answer: all of it) apart."""
        header, function = self._header, view["function"]
        store = f"&store.{view['stem']}, " if message.values else ""
        address = "address, " if header.address else ""
        part = "request_sum, " if header.sum_bits and message.direction == "response" else ""
        decode = "decode" if view["framed"] else "from_frame"
        decode_part = "" if view["framed"] else part
        return {
            "encode_lines": call(f"return {function}_to_frame({store}{address}{part}bytes, capacity);"),
            "decode_lines": call(f"return {function}_{decode}({store}{decode_part}bytes, size);"),
        }

    def _dispatched(self, plan: MessagePlan, rows: Sequence[Row]) -> dict[str, Any]:
        header, message = self._header, plan.message
        refused = sum(isinstance(row, Wrong) and row.kind == _RANGE for row in rows)
        view: dict[str, Any] = {"slave_member": "", "told_member": "", "answer": None}
        if self._asked(plan):
            answer = self._answer(plan)
            view["slave_member"] = header.slave_member(message)
            view["asked_tests"] = refused + sum(isinstance(row, Right) and bool(row.kinds) for row in rows)
            if answer:
                view["answer"] = {
                    "number": self._numbers[answer.name],
                    "stem": naming.member(header.stem(answer)),
                    "function": header.function(answer),
                    "has_struct": bool(answer.values),
                }
        if self._told(plan):
            view["told_member"] = header.told_member(message)
            view["told_tests"] = refused + sum(isinstance(row, Right) for row in rows)
        return view

    def _tests(self, plan: MessagePlan, rows: Sequence[Row], found: Stream | None) -> int:
        """Tests of making, taking apart and receiving."""
        sent = sum(isinstance(row, Right) and not row.decode_only for row in rows)
        fed = sum(each is not None for each in found.events) if found else 0
        return fed + (sent if plan.encoded else 0) + (len(rows) if plan.decoded else 0)

    def _unsent(self, message: Message) -> list[Unsent]:
        rows = self._rows[message.name]
        right = next(row for row in rows if isinstance(row, Right) and not row.decode_only)
        return list(unsent(self._header, message, right))

    def _members(self, message: Message, value: Value) -> list[str]:
        """Members of the struct in the order of the vectors' values."""
        kind, struct = value.type, f"{self._header.function(message)}_t"
        name = naming.member(value.name)
        if isinstance(kind, Scalar):
            return [f"NUMBER({struct}, {name}),"]
        if kind.length.fixed:
            return [f"ITEMS({struct}, {name}),"]
        count = self._header.count_member(value.field)
        return [f"NUMBER({struct}, {count}),", f"COUNTED({struct}, {name}),"]

    # Rows

    def _lines(self, row: Row, found: Stream | None, index: int) -> list[str]:
        """A row of the table, with a comment where there is more to say than its first byte does."""
        pieces = [self._head(row)]
        if isinstance(row, Right) and row.message.values:
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


def _entry(message: Message, view: Mapping[str, Any], found: Stream | None) -> list[str]:
    """The message in the table of messages."""
    stem, answer = view["stem"], view["answer"] or view
    facts = (message.direction == "response", found is not None, found is not None and found.noisy)
    numbers_of = (
        answer["number"],
        view["tests"],
        view["asked_tests"],
        view["told_tests"],
        len(view["members"]),
    )
    groups = (
        [f"{stem}_name", f"{stem}_members" if view["members"] else "NULL"],
        [f"{stem}_vectors", f"sizeof({stem}_vectors)"],
        [f"{stem}_unsent", f"sizeof({stem}_unsent)"] if view["unsent_lines"] else ["NULL", "0u"],
        [
            f"{view['constant']}_ID",
            *(f"{number}u" for number in numbers_of),
            *("true" if fact else "false" for fact in facts),
        ],
        [f"{stem}_{verb}" if view[f"{verb}d"] else "NULL" for verb in ("encode", "decode")],
    )
    lines = [line for group in groups for line in folded(", ".join(group) + ",")]
    return ["{" + lines[0], *(f" {line}" for line in lines[1:-1]), f" {lines[-1].removesuffix(',')}}},"]


def _sizes(row: Row) -> tuple[int, ...]:
    return len(row.wire), len(row.request), len(row.values) if isinstance(row, Right) else 0


def _events(events: tuple[str, ...] | None) -> str:
    if events is None:
        return "NOT_FED,"
    return ", ".join([str(len(events)), *(f"E_{event.upper()}" for event in events)]) + ","
