"""How simulated nodes of a schema answer: options and the YAML file of ``qlinkgen simulate``."""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping, Sequence
from decimal import Decimal
from pathlib import Path
from types import ModuleType
from typing import TYPE_CHECKING

from qlinkgen._dataclass import dataclass
from qlinkgen.cli.boundary import Failure
from qlinkgen.cli.common import did_you_mean
from qlinkgen.link.codec import Framed
from qlinkgen.model.protocol import Protocol
from qlinkgen.model.values import Json
from qlinkgen.sim import SimulationError
from qlinkgen.sim.generic import GenericNode
from qlinkgen.sim.memory import Memory
from qlinkgen.sim.refusals import Refusals, command_named
from qlinkgen.sim.tables import Access, Table
from qlinkgen.sim.values import Values

if TYPE_CHECKING:
    from qlinkgen.plan import Plan

#: Keys of the file, as the options are called.
_KEYS = ("values", "delay", "refuse", "memory", "tables")
#: What is written in place of a mapping that is none.
_EXAMPLES = {
    "the file": "values: {get: {value: 1}}",
    "values": "values: {get: {value: 1}}",
    "delay": "delay: {get: 0.5}",
    "refuse": "refuse: {get: 0.1}",
    "tables": "tables: {holding: {get: {at: number, value: value}}}",
}


@dataclass(frozen=True, slots=True)
class Behaviour:
    """The options as given."""

    value: Sequence[str] = ()
    file: str | None = None
    delay: Sequence[str] = ()
    refuse: Sequence[str] = ()
    memory: bool = False
    seed: int | None = None

    def __bool__(self) -> bool:
        return bool(self.value or self.file or self.delay or self.refuse or self.memory)


class Nodes:
    """Makes the nodes of a protocol.

    Attributes:
        delays: seconds that answers take longer, by class of request.
    """

    def __init__(self, protocol: Protocol, codec: ModuleType, plan: Plan, given: Behaviour) -> None:
        """Check the options. Raises Failure."""
        file = _file(given.file)
        seed = given.seed or 0
        self._protocol, self._codec, self._plan = protocol, codec, plan
        memory = file.get("memory", False)
        if not isinstance(memory, bool):
            raise Failure(f"{given.file}: memory: {memory} was given; write true or false")
        self._memory = given.memory or memory
        values: dict[str, dict[str, Json]] = {
            name: dict(_mapping(fields, given.file, f"values: {name}"))
            for name, fields in _mapping(file.get("values"), given.file, "values").items()
        }
        for option in given.value:
            path, sign, value = option.partition("=")
            name, dot, field = path.rpartition(".")
            if not sign or not dot:
                raise Failure(f"--value {option}: write COMMAND.FIELD=VALUE")
            values.setdefault(name, {})[field] = value
        delays = _numbers("delay", file, given.file, given.delay)
        refused = _numbers("refuse", file, given.file, given.refuse)
        try:
            self._values = Values(protocol, getattr(codec, "RECORDS", {}), values, seed=seed)
            self._refusals = Refusals(codec, refused, seed=seed)
            self._tables = list(_tables(file, given.file))
            self._own_tables()  # refuses what is wrong
            self.delays: Mapping[type[Framed], float] = {
                command_named(codec, name).request: delay for name, delay in delays.items()
            }
        except SimulationError as error:
            raise Failure(str(error)) from None
        self._check(values)

    def node(self, number: int = 0) -> GenericNode:
        """Make a node."""
        return GenericNode(
            self._codec,
            number,
            self._plan,
            values=self._values,
            memory=Memory(self._protocol) if self._memory else None,
            tables=self._own_tables(),
            refusals=self._refusals,
        )

    def _own_tables(self) -> list[Table]:
        return [Table(self._protocol, uses) for uses in self._tables]

    def _check(self, given_to: Collection[str]) -> None:
        """Refuse values that are only wrong together, by an answer to each command that has some."""
        nodes = self._protocol.bus.nodes
        node = GenericNode(self._codec, nodes[0] if nodes else 0, self._plan, values=self._values)
        for command in self._codec.COMMANDS.values():
            answer = command.response
            if answer is None or not {command.name, answer.NAME}.intersection(given_to):
                continue
            try:
                node.example(command).to_bytes()
            except self._codec.EncodeError as error:
                raise Failure(str(error)) from None


def _tables(file: Mapping[str, Json], path: str | None) -> Iterator[Mapping[str, Access]]:
    for table, uses in _mapping(file.get("tables"), path, "tables").items():
        found = {}
        for name, access in _mapping(uses, path, f"tables: {table}").items():
            match access:
                case {"at": str(at), "value": str(value), **others} if not others:
                    found[name] = Access((at,), value)
                case {"at": [*at], "value": str(value), **others} if at and not others:
                    found[name] = Access([str(field) for field in at], value)
                case _:
                    raise Failure(f"{path}: tables: {table}: {name}: write {{at: FIELD, value: FIELD}}")
        yield found


def _numbers(
    key: str, file: Mapping[str, Json], path: str | None, options: Sequence[str]
) -> Mapping[str, float]:
    """Return the numbers of a key of the file and of an option, by command."""
    given = dict(_mapping(file.get(key), path, key))
    for option in options:
        name, sign, number = option.partition("=")
        if not sign:
            raise Failure(f"--{key} {option}: write COMMAND=NUMBER")
        given[name] = number
    return {name: _number(key, name, number) for name, number in given.items()}


def _number(key: str, name: str, given: Json) -> float:
    if isinstance(given, str | int | float | Decimal):
        try:
            number = float(given)
        except ValueError:
            number = -1.0
        if 0 <= number < float("inf"):
            return number
    raise Failure(f"{key} of {name}: {given} was given; give a number, 0 or more")


def _file(path: str | None) -> Mapping[str, Json]:
    """Return the contents of a file."""
    if path is None:
        return {}
    from qlinkgen.schema.source import parse  # noqa: PLC0415  # only for files

    try:
        source = parse(Path(path).read_text("utf-8"))
    except OSError as error:
        raise Failure(f"--values {path}: {error.strerror}") from None
    except UnicodeDecodeError:
        raise Failure(f"--values {path}: not UTF-8 text") from None
    for fault in source.faults:
        raise Failure(f"{path}:{fault.position.line}:{fault.position.column}: {fault.message}")
    given = _mapping(source.data, path, "the file")
    for key in given:
        if key not in _KEYS:
            position = source.position((key,), of_key=True)
            hint = did_you_mean(key, _KEYS) or f"keys are {', '.join(_KEYS)}"
            raise Failure(f"{path}:{position.line}:{position.column}: unknown key '{key}'; {hint}")
    return given


def _mapping(given: Json, path: str | None, what: str) -> Mapping[str, Json]:
    if given is None:
        return {}
    if not isinstance(given, Mapping):
        raise Failure(
            f"{path}: {what} is not a mapping; write for example {_EXAMPLES[what.partition(':')[0]]}"
        )
    return given
