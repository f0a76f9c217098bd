"""Port modules: masters and slaves that open a port, of the classes in `qlinkgen.bus`.

The modules `_X_bus` and `_X_aio` are generated next to the bus module `X_bus`, which imports them when one of
their classes is first used: it needs nothing of qlinkgen otherwise. They are printed by one template.
"""

from __future__ import annotations

import textwrap
from collections.abc import Iterator, Mapping, Sequence
from functools import cached_property

from qlinkgen._dataclass import dataclass
from qlinkgen.backends import python_text
from qlinkgen.backends.base import banner
from qlinkgen.backends.python.layout import WIDTH
from qlinkgen.backends.python.names import attribute
from qlinkgen.backends.python.sections import templates
from qlinkgen.model.naming import file_stem
from qlinkgen.model.texts import one_line
from qlinkgen.plan import Plan
from qlinkgen.plan.ends import InStep
from qlinkgen.plan.framing import frame_plan
from qlinkgen.plan.hosts import host_of

#: A byte that is sent to look for an echo, where receivers skip it.
_PROBE = b"\0"
#: Who asks, and who answers, on most buses.
_MASTERS = ("masters", "slaves")


@dataclass(frozen=True)
class Asker:
    """A class of calls of the bus module, for which there is a class that opens a port.

    Attributes:
        name: name of that class.
        calls: name of the class of calls.
        node: name of the class of one node, "" without addresses.
        node_calls: name of its class of calls.
        both: the other side asks, too.
        host: it is the device of a host.
        ring: it is a node of a ring.
        selects: what its commands act on and select, "" for others; `node` is the class of one.
    """

    name: str
    calls: str
    node: str = ""
    node_calls: str = ""
    both: bool = False
    host: bool = False
    ring: bool = False
    selects: str = ""

    @property
    def base(self) -> str:
        """The class of qlinkgen that it is derived from."""
        if self.ring:
            return "Ring"
        return "Link" if self.both else "Host" if self.host else "Bus"

    @property
    def node_base(self) -> str:
        """The class of qlinkgen that the class of one node is derived from."""
        return "Selected" if self.host else "Node"


@dataclass(frozen=True)
class _View:
    """A class as the template prints it."""

    name: str
    base: str
    calls: str
    doc: Sequence[str]
    node: str
    node_calls: str
    node_base: str
    #: The method that returns one node, and what it is.
    method: str
    what: str
    echo: str


class Ports:
    """The port modules of a protocol."""

    def __init__(self, plan: Plan, askers: Sequence[Asker], *, slave: bool, nodes: str) -> None:
        """Name what the bus module has.

        Args:
            plan: the plan of the protocol.
            askers: its classes of calls.
            slave: whether it has handlers of a slave.
            nodes: addresses of nodes as text.
        """
        self._protocol = plan.protocol
        frame = frame_plan(plan.protocol.frame)
        in_step = isinstance(frame.receiver, InStep)
        self._host = in_step and host_of(plan) is not None
        self._ring = plan.protocol.bus.kind == "ring"
        driven = (
            self._host or self._ring or (plan.protocol.bus.kind in {"master_slave", "link"} and not in_step)
        )
        self._askers = askers if driven else ()
        self._slave = slave and driven and not any(each.both for each in askers)
        self._nodes = nodes
        self._echo = "auto" if frame.skips(_PROBE) else ""
        self._name, self._codec = plan.protocol.name, file_stem(plan.protocol.name)

    @cached_property
    def names(self) -> Mapping[str, Sequence[str]]:
        """Classes by module."""
        found = {f"_{self._name}_aio": self._public("Async"), f"_{self._name}_bus": self._public("")}
        return {module: names for module, names in found.items() if names}

    def texts(self) -> Iterator[tuple[str, str]]:
        """The modules and their texts."""
        for module in self.names:
            yield module, self._text("Async" if module.endswith("_aio") else "")

    def _public(self, prefix: str) -> list[str]:
        masters = (f"{prefix}{name}" for each in self._askers for name in (each.name, each.node) if name)
        return sorted([*masters, *(["Slave"] if self._slave and not prefix else [])])

    def _text(self, prefix: str) -> str:
        slave = self._slave and not prefix
        first, *others = banner(self._protocol)
        whom = ("hosts", "devices") if self._host else ("nodes of a ring", "") if self._ring else _MASTERS
        what = f"{whom[0]} for asyncio" if prefix else " and ".join(whom) if slave else whom[0]
        head = one_line(f"{first}: {what} that open a port.")
        lines = [line for other in others for line in textwrap.wrap(one_line(other), WIDTH)]
        doc = python_text.docstring([*textwrap.wrap(head, WIDTH - 4), "", *lines])
        return (
            templates()
            .get_template("templates/ports.j2")
            .render(
                doc=doc,
                imports=list(self._imports(prefix)),
                public=self._public(prefix),
                masters=[self._view(each, prefix) for each in self._askers],
                codec=self._codec,
                nodes=self._nodes,
                prefix=prefix,
                slave=slave,
                host=self._host,
            )
        )

    def _view(self, asker: Asker, prefix: str) -> _View:
        bus = asker.node and not asker.host
        what = "One side of the link" if asker.both else "The bus" if bus else "The device on a line"
        what = "A node of the ring" if asker.ring else what
        whom = "tasks of one event loop" if prefix else "threads"
        text = (
            f"{what}, a method for each {'message' if asker.ring else 'command'}, for any number of {whom}."
        )
        return _View(
            name=prefix + asker.name,
            base=f"{prefix}{asker.base}Base",
            calls=prefix + asker.calls,
            doc=python_text.docstring(textwrap.wrap(text, WIDTH - 12)),
            node=asker.node and prefix + asker.node,
            node_calls=prefix + asker.node_calls,
            node_base=f"{prefix}{asker.node_base}Base",
            method=attribute(asker.selects) or "node",
            what=asker.selects or "node",
            echo=self._echo if asker.base == "Bus" else "",
        )

    def _imports(self, prefix: str) -> Iterator[str]:
        own = "host" if self._host else "ring" if self._ring else ""
        module = f"{own}{'_' * bool(own)}aio" if prefix else own or "blocking"
        used = {each.base for each in self._askers}
        used |= {each.node_base for each in self._askers if each.node}
        imports = [f"from qlinkgen.bus.{module} import {prefix}{name} as {prefix}{name}Base" for name in used]
        if self._slave and not prefix:
            answerer = "devices import DeviceSlave" if self._host else "slaves import Slave"
            imports.append(f"from qlinkgen.bus.{answerer} as SlaveBase")
        yield from sorted(imports)
        yield ""
        yield f"from . import {self._codec}"
        calls = {
            prefix + name
            for each in self._askers
            for name in (each.calls, each.node and each.node_calls)
            if name
        }
        if calls:
            line = f"from .{self._name}_bus import {', '.join(sorted(calls))}"
            if len(line) <= WIDTH:
                yield line
            else:
                yield f"from .{self._name}_bus import ("
                yield from (f"    {each}," for each in sorted(calls))
                yield ")"
