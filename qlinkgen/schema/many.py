"""Second pass, several answers to one request: where they end."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Mapping

from qlinkgen.model.fields import Field, FieldType, Records, values_of
from qlinkgen.model.message import Message
from qlinkgen.model.transaction import (
    Addressing,
    Allowance,
    ByCommand,
    ByCount,
    ByEach,
    ByField,
    ByReply,
    ByTime,
    Many,
    Reply,
)
from qlinkgen.model.types import Array, Blob, Enum, Scalar
from qlinkgen.schema.file_commands import ManySpec
from qlinkgen.schema.notation import shown, whole_range
from qlinkgen.schema.report import Reporter, did_you_mean, listed
from qlinkgen.schema.source import Path

_RULE = "bad-many"
#: Bits of the longest number that a program in C can compare.
LONGEST = 64


class ManyBuilder:
    """Builds the end of the answers of one command."""

    def __init__(
        self,
        request: Message,
        response: Message,
        replies: Iterable[Reply],
        report: Reporter,
        *,
        address: str,
        addressing: Addressing,
        commands: Collection[str],
    ) -> None:
        """Make a builder.

        The end may refer to each of these messages, to the part with the address, "" without one, and to the
        names of ``commands``.
        """
        self._request = request
        self._response = response
        self._replies = {reply.name: reply.message for reply in replies}
        self._report = report
        self._address = address
        self._addressing = addressing
        self._commands = commands

    def build(self, spec: ManySpec, path: Path) -> Many | None:
        """The end that a command states, None if it is wrong."""
        given = [key for key in ("count", "until", "within", "each") if getattr(spec, key) is not None]
        # A time limits answers that a command stops; a name of a reply or of nothing is reported below.
        named = isinstance(spec.until, str) and spec.until not in self._replies
        if given == ["until", "within"] and named:
            given.remove("within")
        if len(given) != 1:
            what = f"the answers have {len(given)} ends" if given else "the answers have no end"
            self._error(path, what, "write one of count, until, within and each")
            return None
        if spec.each is not None:
            return self._each(spec.each, spec.by, path)
        if spec.by is not None:
            self._error(
                (*path, "by"),
                "only answers of each node in a list have by",
                "write each: request.LIST, or remove it",
            )
        within = Allowance(spec.within.byte_times, spec.within.seconds) if spec.within else None
        if isinstance(spec.until, str):
            return self._named(spec.until, within, (*path, "until"))
        if within is not None:
            return ByTime(within)
        if spec.count is not None:
            return self._count(spec.count, (*path, "count"))
        return self._field(spec.until or {}, (*path, "until"))

    def _error(self, path: Path, what: str, hint: str) -> None:
        self._report.error(_RULE, path, what, hint)

    def _count(self, count: int | str, path: Path) -> Many | None:
        if isinstance(count, int):
            return ByCount(count)
        kind = self._number(count, self._request, "request", path)
        if kind is not None and kind.minimum < 1:
            what = f"{count} of the request may be {kind.minimum}"
            self._error(path, what, "give it a range of numbers of answers, like 1..8")
            return None
        return ByCount(kind.maximum, count) if kind else None

    def _each(self, each: str, by: str | None, path: Path) -> Many | None:
        """A list of nodes in the request, and the value of an answer with its node."""
        place, (name, _, key) = (*path, "each"), each.partition(".")
        fields = {field.name: field for field in self._request.fields}
        field = fields.get(name)
        if field is None:
            hint = did_you_mean(name, fields, f"its fields are {listed(fields)}")
            self._error(place, f"the request has no field {shown(name)}", hint)
            return None
        most = _most_nodes(field, key)
        if not most:
            what = f"{shown(each)} of the request is not a list of plain numbers"
            self._error(place, what, "use an array, bytes, or LIST.FIELD of an array of records")
            return None
        if field.conditional or field.min_size == 0:
            what, hint = f"{name} of the request may be absent or empty", "let it have 1 item or more"
            self._error(place, what, hint)
            return None
        if by is None and not self._response.addresses:
            what = f"no address tells whose answer {self._response.name} is"
            self._error(path, what, "write by: FIELD, a field of the response with the node")
            return None
        if by is not None and by != self._address:
            return self._each_by(name, most, key, by, path)
        if self._addressing != "answered_broadcast":
            what = "only the node that was asked answers, whatever the list says"
            self._error(path, what, "write addressing: answered_broadcast, or by: FIELD of the response")
            return None
        return ByEach(name, most, key)

    def _each_by(self, name: str, most: int, key: str, by: str, path: Path) -> Many | None:
        kind = self._number(by, self._response, "response", path)
        if kind is not None and kind.signed:
            self._error((*path, "by"), f"{by} may be negative, which no node is", "use an unsigned number")
            return None
        return ByEach(name, most, key, by) if kind else None

    def _named(self, name: str, within: Allowance | None, path: Path) -> Many | None:
        """A reply after the answers, or a command that stops them."""
        if name in self._replies:
            return ByReply(self._replies[name])
        if name in self._commands:
            return ByCommand(name, within)
        known = [*self._replies, *self._commands]
        hint = did_you_mean(name, known, "write {FIELD: value}, or the name of a reply or command")
        self._error(path, f"unknown reply or command {shown(name)}", hint)
        return None

    def _field(self, until: Mapping[str, str | int], path: Path) -> Many | None:
        if len(until) != 1:
            self._error(path, "not exactly one field tells the last answer", "write until: {FIELD: value}")
            return None
        [(name, value)] = until.items()
        kind = self._number(name, self._response, "response", path)
        if kind is None:
            return None
        members = kind.meaning.members if isinstance(kind.meaning, Enum) else ()
        named = {member.name: member.value for member in members}
        if value in named:
            return ByField(name, named[str(value)], named[str(value)])
        try:
            first, last = whole_range(value)
        except ValueError:
            hint = did_you_mean(str(value), named, "write a number, a range or a name")
            self._error((*path, name), f"{shown(value)} is not a value of {name}", hint)
            return None
        if last < kind.minimum or first > kind.maximum:
            what = f"{name} is never {value}, so the answers have no end"
            self._error((*path, name), what, f"use {kind.minimum}..{kind.maximum}")
            return None
        return ByField(name, first, last)

    def _number(self, name: str, message: Message, where: str, path: Path) -> Scalar | None:
        known = {value.name: value.type for value in message.values}
        kind = known.get(name)
        absent = {value.name for value in values_of(each for each in message.fields if each.conditional)}
        if name in absent:
            what = f"{name} of the {where} may be absent"
            self._error(path, what, "name a field that is always present")
            return None
        if (
            isinstance(kind, Scalar)
            and kind.scaling is None
            and kind.bits <= LONGEST
            and (kind.meaning is None or isinstance(kind.meaning, Enum))
        ):
            return kind
        if kind is None:
            hint = did_you_mean(name, known, f"its fields are {listed(known)}")
            self._error(path, f"the {where} has no field {shown(name)}", hint)
        else:
            self._error(path, f"{name} of the {where} is not a plain number", "use a whole number or an enum")
        return None


def _most_nodes(field: Field, key: str) -> int:
    """The most items of a list of plain numbers, 0 for what is not one."""
    kind = field.type
    item: FieldType | None = None
    match kind:
        case Blob() if not kind.text and not key:
            return kind.length.maximum
        case Array() if not key:
            item = kind.item
        case Records() if key:
            kinds = {value.name: value.type for value in values_of(kind.layout.fields)}
            item = kinds.get(key)
    plain = isinstance(item, Scalar) and item.scaling is None and item.meaning is None
    plain = plain and isinstance(item, Scalar) and not item.signed and item.bits <= LONGEST
    return kind.length.maximum if plain and isinstance(kind, Array | Records) else 0
