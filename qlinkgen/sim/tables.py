"""Tables of numbered values of a simulated node, such as registers, that requests set and read."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from qlinkgen.link.codec import Message
from qlinkgen.model.fields import Value
from qlinkgen.model.naming import attribute
from qlinkgen.model.protocol import Protocol
from qlinkgen.model.spelling import similar
from qlinkgen.model.types import Array, Blob, Scalar
from qlinkgen.model.values import Item
from qlinkgen.sim.errors import SimulationError
from qlinkgen.sim.memory import fits

#: A number, or several, that tell where a value is.
Key = tuple[int, ...]


@dataclass(frozen=True, slots=True)
class Access:
    """How one command uses a table.

    Attributes:
        at: fields of the request that tell where, the one that counts up last.
        value: field with the value, a list of values or bytes: of the request to set them, else of the
            response.
    """

    at: Sequence[str]
    value: str


@dataclass(frozen=True, slots=True)
class _Use:
    """An access in terms of messages: attributes, and the value as the schema has it."""

    at: tuple[str, ...]
    value: Value
    #: The request tells the number of items.
    asked: bool = False

    def key(self, request: Message) -> Key:
        return tuple(int(getattr(request, name)) for name in self.at)


class Table:
    """Values that some commands set and others read; for one node."""

    def __init__(self, protocol: Protocol, uses: Mapping[str, Access]) -> None:
        """Make an empty table.

        Args:
            protocol: the protocol.
            uses: by command.

        Raises:
            SimulationError: an unknown command or field, or values that do not fit one another.
        """
        self._cells: dict[Key, Item] = {}
        self._setting: dict[str, _Use] = {}
        self._reading: dict[str, _Use] = {}
        for name, access in uses.items():
            self._add(protocol, name, access)
        for reader in self._reading.values():
            for setter in self._setting.values():
                if len(setter.at) != len(reader.at):
                    raise SimulationError(f"at: {len(setter.at)} and {len(reader.at)} fields; give as many")
                if not _alike(setter.value, reader.value):
                    told = f"{reader.value.name} cannot have every {setter.value.name}"
                    raise SimulationError(f"{told} that is set; use a table for each")

    def _add(self, protocol: Protocol, name: str, access: Access) -> None:
        commands = {command.name: command for command in protocol.commands}
        if name not in commands:
            raise SimulationError(f"unknown command '{name}'{_meant(name, commands)}")
        command = commands[name]
        asking = {value.name: value for value in command.request.values}
        answering = {} if command.response is None else {v.name: v for v in command.response.values}
        for field in access.at:
            if field not in asking or not isinstance(asking[field].type, Scalar):
                raise SimulationError(f"{name}: the request has no number '{field}'{_meant(field, asking)}")
        setting = access.value in asking
        value = asking.get(access.value) or answering.get(access.value)
        if value is None or not _is_table_value(value):
            known = {**asking, **answering}
            raise SimulationError(f"{name}: no value or list '{access.value}'{_meant(access.value, known)}")
        at = tuple(map(attribute, access.at))
        if setting:
            self._setting[command.request.name] = _Use(at, value)
        elif command.response is not None:
            asked = access.value in dict(command.sizes)
            self._reading[command.response.name] = _Use(at, value, asked)

    def keep(self, request: Message) -> None:
        """Set what a request sets."""
        use = self._setting.get(request.NAME)
        if use is None:
            return
        found = getattr(request, attribute(use.value.name))
        *first, last = use.key(request)
        for offset, item in enumerate([found] if isinstance(use.value.type, Scalar) else found):
            self._cells[*first, last + offset] = item

    def of(self, answer: str, request: Message, values: Mapping[str, object]) -> dict[str, object]:
        """Return what has been set of an answer, by attribute; the rest of a list is that of ``values``."""
        use = self._reading.get(answer)
        if use is None:
            return {}
        name, key = attribute(use.value.name), use.key(request)
        before = values.get(name)
        if isinstance(use.value.type, Scalar):
            return {name: self._cells[key]} if key in self._cells else {}
        items: list[Item] = list(before) if isinstance(before, list | bytes | bytearray) else []
        *first, last = key
        most = len(items) if use.asked else _most(use.value)
        while len(items) < most and (*first, last + len(items)) in self._cells:
            items.append(0)
        items = [self._cells.get((*first, last + offset), item) for offset, item in enumerate(items)]
        return {name: bytes(map(int, items)) if isinstance(use.value.type, Blob) else items}


def _is_table_value(value: Value) -> bool:
    kind = value.type
    return isinstance(kind, Scalar | Array) or (isinstance(kind, Blob) and not kind.text)


def _most(value: Value) -> int:
    return value.type.length.maximum if isinstance(value.type, Array | Blob) else 1


def _alike(setter: Value, reader: Value) -> bool:
    """Whether one item of a value can be one of another."""
    given, wanted = (
        each.type.item if isinstance(each.type, Array) else each.type for each in (setter, reader)
    )
    return (isinstance(given, Blob) and isinstance(wanted, Blob)) or fits(given, wanted)


def _meant(name: str, known: Mapping[str, object]) -> str:
    close = similar(name, known)
    return f"; did you mean {close[0]}?" if close else f"; there are {', '.join(known)}" if known else ""
