"""What requests have set, for the answers of a simulated node."""

from __future__ import annotations

from qlinkgen.link.codec import Message
from qlinkgen.model.fields import Record, Records
from qlinkgen.model.naming import attribute
from qlinkgen.model.protocol import Protocol
from qlinkgen.model.types import Array, Blob, Length, Scalar


class Memory:
    """Keeps the latest value of each field of requests by its name.

    An answer reads those of its fields that have the name and can hold every value of the field that was set.
    """

    def __init__(self, protocol: Protocol) -> None:
        """Make the empty memory of one node."""
        requests = [each for each in protocol.messages if each.direction == "request"]
        #: Attribute of an answer, and the requests that set it.
        self._readable: dict[str, dict[str, frozenset[str]]] = {}
        for answer in protocol.messages:
            if answer.direction != "response":
                continue
            fields = self._readable[answer.name] = {}
            for value in answer.values:
                setting = frozenset(
                    request.name
                    for request in requests
                    for each in request.values
                    if each.name == value.name and fits(each.type, value.type)
                )
                if setting:
                    fields[attribute(value.name)] = setting
        self._set = {name for fields in self._readable.values() for name in fields}
        self._kept: dict[str, tuple[str, object]] = {}

    def keep(self, request: Message) -> None:
        """Keep the values of a request."""
        for name in self._set:
            value = getattr(request, name, None)
            if value is not None:
                self._kept[name] = request.NAME, value

    def of(self, answer: str) -> dict[str, object]:
        """Return what has been set of the fields of an answer, by attribute."""
        found = {}
        for name, setting in self._readable.get(answer, {}).items():
            request, value = self._kept.get(name, ("", None))
            if request in setting:
                found[name] = value
        return found


_Kind = Scalar | Blob | Array | Record | Records


def fits(given: _Kind, wanted: _Kind) -> bool:
    """Whether a type can hold every value of another one."""
    match given, wanted:
        case Scalar(), Scalar():
            same = (given.scaling, given.meaning) == (wanted.scaling, wanted.meaning)
            return same and wanted.minimum <= given.minimum and given.maximum <= wanted.maximum
        case Array(), Array():
            return fits(given.item, wanted.item) and _within(given.length, wanted.length)
        case Blob(), Blob():
            alike = given.text == wanted.text and given.excluded == wanted.excluded
            return alike and _within(given.length, wanted.length)
        case _:
            return given == wanted


def _within(given: Length, wanted: Length) -> bool:
    return wanted.minimum <= given.minimum and given.maximum <= wanted.maximum
