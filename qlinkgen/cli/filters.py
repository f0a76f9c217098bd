"""Options that choose frames of a capture: ``--message``, ``--node``, ``--where``, ``--since`` and others."""

from __future__ import annotations

import functools
import re
from collections.abc import Callable, Iterable, Iterator, Mapping
from decimal import Decimal
from typing import Literal

import click

from qlinkgen._dataclass import dataclass
from qlinkgen.captures.records import NANO
from qlinkgen.cli.boundary import Failure
from qlinkgen.cli.common import find_message
from qlinkgen.cli.conditions import Condition, ConditionError, parse_condition
from qlinkgen.model.fields import Record, Records, Value
from qlinkgen.model.naming import record_key
from qlinkgen.model.protocol import Protocol
from qlinkgen.model.values import Json

FlagForm = Literal["number", "names"]


@dataclass(frozen=True, slots=True)
class FilterOptions:
    """What the user wants to see."""

    messages: tuple[str, ...] = ()
    nodes: tuple[int, ...] = ()
    errors_only: bool = False
    where: str | None = None
    #: Seconds as in the capture.
    since: Decimal | None = None
    until: Decimal | None = None


def filter_options(command: Callable[..., int]) -> Callable[..., int]:
    """Add the options; the command gets them as `wanted`."""

    @functools.wraps(command)
    def wrapped(
        *given: object,
        messages: tuple[str, ...],
        nodes: tuple[int, ...],
        errors_only: bool,
        where: str | None,
        since: Decimal | None,
        until: Decimal | None,
        **named: object,
    ) -> int:
        wanted = FilterOptions(messages, nodes, errors_only, where, since, until)
        return command(*given, wanted=wanted, **named)

    for option in reversed(_OPTIONS):
        option(wrapped)
    return wrapped


def _moment(context: click.Context, parameter: click.Parameter, value: str | None) -> Decimal | None:  # noqa: ARG001
    """Read a time as captures state it: seconds, a time of day, or a date with or without one."""
    if value is None:
        return None
    if re.fullmatch(r"\d{1,12}(\.\d{1,9})?", value):
        return Decimal(value)
    from qlinkgen.captures.times import TIME, nanoseconds  # noqa: PLC0415  # only for these options

    text = f"{value} 00:00:00" if re.fullmatch(r"\d{4}-\d\d-\d\d", value) else value
    found = TIME.fullmatch(text)
    at = nanoseconds(found) if found else None
    if at is None:
        forms = "seconds, 12:00:00.5, 2026-03-01 or 2026-03-01T12:00:00"
        raise Failure(f"{parameter.opts[0]} {value}: not a time; write {forms}")
    return Decimal(at) / NANO


_OPTIONS = [
    click.option(
        "--message",
        "messages",
        metavar="MESSAGE",
        multiple=True,
        help="Only this message or command; repeatable. Where only its turn tells a message: what HEX is.",
    ),
    click.option("--node", "nodes", type=int, multiple=True, help="Only frames of this address; repeatable."),
    click.option("--errors-only", is_flag=True, help="Only bad frames and refusals."),
    click.option(
        "--where",
        metavar="CONDITION",
        help="Only frames with such values: 'position > 1000 and node in (1, 2)'.",
    ),
    click.option("--since", metavar="TIME", callback=_moment, help="Only frames from this time on."),
    click.option("--until", metavar="TIME", callback=_moment, help="Only frames until this time."),
]


class Filter:
    """Chooses objects as `decode` prints them."""

    def __init__(self, protocol: Protocol, wanted: FilterOptions) -> None:
        """Read the options.

        Raises:
            Failure: a message or a name is not known, or the condition is wrong.
        """
        self._wanted = wanted
        self._messages = {name for each in wanted.messages for name in _named(protocol, each)}
        self._address = record_key(protocol.address_name or "")
        if wanted.nodes and not protocol.address_name:
            raise Failure(f"frames of {protocol.name} have no address; omit --node")
        self._flags = Flagged(protocol)
        self._condition = None if wanted.where is None else _condition(protocol, wanted.where)

    @property
    def chooses(self) -> bool:
        """Whether anything is left out."""
        return self._wanted != FilterOptions()

    def keeps(self, record: Mapping[str, Json]) -> bool:
        """Whether the user wants to see an object."""
        wanted = self._wanted
        if wanted.errors_only and "error" not in record and "refused" not in record:
            return False
        if self._messages and record.get("message") not in self._messages:
            return False
        if wanted.nodes and record.get(self._address) not in wanted.nodes:
            return False
        if not self._in_time(record.get("time")):
            return False
        return self._condition is None or ("message" in record and self._condition.fits(self._values(record)))

    def _in_time(self, at: Json) -> bool:
        since, until = self._wanted.since, self._wanted.until
        if since is None and until is None:
            return True
        if not isinstance(at, Decimal):
            return False
        return (since is None or at >= since) and (until is None or at <= until)

    def _values(self, record: Mapping[str, Json]) -> Mapping[str, Json]:
        named = self._flags.named(record)
        inner = named["fields"]
        assert isinstance(inner, Mapping)
        return {**inner, **{key: value for key, value in named.items() if key != "fields"}}


class Flagged:
    """Writes flags as lists of names; bits without a name are numbers."""

    def __init__(self, protocol: Protocol) -> None:
        self._of = {
            message.name: [each for each in message.values if _has_flags(each)]
            for message in protocol.messages
        }

    def named(self, record: Mapping[str, Json]) -> dict[str, Json]:
        """Return an object as `decode` prints it with names of flags."""
        values = self._of.get(str(record.get("message")))
        inner = record.get("fields")
        if not values or not isinstance(inner, Mapping):
            return dict(record)
        return {**record, "fields": _with_names(values, inner)}


def _has_flags(value: Value) -> bool:
    if isinstance(value.type, Record | Records):
        return any(map(_has_flags, value.type.layout.values))
    return value.flags is not None


def _with_names(values: Iterable[Value], given: Mapping[str, Json]) -> dict[str, Json]:
    found = dict(given)
    for value in values:
        if value.name in found:
            found[value.name] = _named_flags(value, found[value.name])
    return found


def _named_flags(value: Value, given: Json) -> Json:
    if isinstance(given, list | tuple):
        return [_named_flags(value, each) for each in given]
    if isinstance(given, Mapping):
        kind = value.type
        assert isinstance(kind, Record | Records)
        return _with_names(kind.layout.values, given)
    flags = value.flags
    if not isinstance(given, int) or flags is None:
        return given
    names: list[Json] = [each.name for each in flags.members if given >> each.value & 1]
    rest = given & ~flags.mask
    return [*names, *([rest] if rest else [])]


def _named(protocol: Protocol, name: str) -> list[str]:
    """Return the messages that a name means: one, or all of a command."""
    of_command = [each.name for each in protocol.messages if each.name.startswith(f"{name}.")]
    return of_command or [find_message(protocol, name).name]


def _condition(protocol: Protocol, text: str) -> Condition:
    names = {"message", "time", "offset", "file", *filter(None, [record_key(protocol.address_name or "")])}
    texts: set[str] = set()
    for message in protocol.messages:
        names |= {record_key(value.name) for value in protocol.beside(message)}
        for path, value in _paths(message.values):
            names.add(path)
            texts.update(value.members)
    try:
        return parse_condition(text, names, texts)
    except ConditionError as error:
        raise Failure(f"--where: {error.message} (character {error.at + 1})") from None


def _paths(values: Iterable[Value], before: str = "") -> Iterator[tuple[str, Value]]:
    for value in values:
        yield f"{before}{value.name}", value
        if isinstance(value.type, Record | Records):
            yield from _paths(value.type.layout.values, f"{before}{value.name}.")
