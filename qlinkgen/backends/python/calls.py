"""The calls of masters and hosts, and the handlers of slaves: a typed method for each command."""

from __future__ import annotations

import textwrap
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from functools import cached_property
from typing import Protocol as Protocol_

from qlinkgen._dataclass import dataclass
from qlinkgen.backends import python_text
from qlinkgen.backends.base import banner
from qlinkgen.backends.python import docstrings, values
from qlinkgen.backends.python.fitted import fitted
from qlinkgen.backends.python.layout import WIDTH, wrapped
from qlinkgen.backends.python.names import attribute, class_name, held, imported
from qlinkgen.backends.python.place import Place, place_of
from qlinkgen.backends.python.ports import Asker, Ports
from qlinkgen.backends.python.sections import templates
from qlinkgen.model.fields import Value
from qlinkgen.model.naming import file_stem, method, pascal
from qlinkgen.model.protocol import Protocol
from qlinkgen.model.texts import one_line
from qlinkgen.model.transaction import Command, Reply, Selection, Unknown
from qlinkgen.model.types import Enum
from qlinkgen.plan import MessagePlan, Plan
from qlinkgen.plan.ends import InStep
from qlinkgen.plan.hosts import selection_of
from qlinkgen.plan.payload import BytesStep, Holder, RecordsStep, RecordStep, by_slot

#: Who does not ask what the first and the second side of a link ask.
_OTHERS = ("second", "first")


@dataclass(frozen=True)
class Method:
    """A method as finished text."""

    head: list[str]
    doc: list[str]
    body: list[str]


@dataclass(frozen=True)
class Caller:
    """A class whose methods send requests."""

    name: str
    doc: list[str]
    prefix: str
    #: Its objects represent one address or what is selected, and hold its number.
    one: bool
    methods: list[Method]
    #: The class of requests.
    request: str = "Message"
    #: Name of the argument that selects what a command acts on, "" if there is none.
    selected: str = ""

    @property
    def ask(self) -> list[str]:
        """The signature of the method by which a host sends a request, for what is selected."""
        more = f", {self.selected}: int | None = None" if self.selected else ""
        arguments = f"self, request: {self.request}, response: type[_R]{more}"
        line = f"{self.prefix}def ask({arguments}) -> _R:"
        return (
            [line] if len(line) + 4 <= WIDTH else [f"{self.prefix}def ask(", f"    {arguments}", ") -> _R:"]
        )


@dataclass(frozen=True)
class Server:
    """A class whose methods answer requests, and the table of these methods."""

    name: str
    what: str
    table: str
    rows: list[str]
    methods: list[Method]


@dataclass(frozen=True)
class Side:
    """Who asks: a master, or one side of a link whose sides both do."""

    #: What the names of its classes begin with, for those that ask and those that answer.
    asks: str
    answers: str
    asked: Sequence[Transaction]
    answered: Sequence[Transaction]


def sides_of(protocol: Protocol, calls: Sequence[Transaction]) -> list[Side]:
    """The sides of a protocol that have classes of their own: the second one only if it asks for others."""
    names = protocol.bus.sides
    if all(call.command.asker == "either" for call in calls) or not protocol.both_ask or not names:
        return [Side("Master", "Slave", calls, calls)]
    by_first, by_second = ([call for call in calls if call.command.asker != other] for other in _OTHERS)
    first, second = (pascal(name) for name in names)
    return [Side(first, first, by_first, by_second), Side(second, second, by_second, by_first)]


class Sent(Protocol_):
    """A message that a method sends."""

    @property
    def name(self) -> str:
        """Name of the method."""
        ...

    @property
    def request(self) -> MessagePlan:
        """The message."""
        ...

    @property
    def further(self) -> tuple[MessagePlan, ...]:
        """What is sent after it."""
        ...


@dataclass(frozen=True)
class Transaction:
    """A command with all its messages in the codec module."""

    command: Command
    request: MessagePlan
    response: MessagePlan | None
    #: Answers other than the response; `done` are those that a call returns.
    others: tuple[MessagePlan, ...] = ()
    done: tuple[MessagePlan, ...] = ()
    #: Of a dialogue, what the master sends after the request, and the answers of the slave in their order.
    further: tuple[MessagePlan, ...] = ()
    answers: tuple[MessagePlan, ...] = ()

    @classmethod
    def of(cls, plan: Plan, command: Command) -> Transaction | None:
        """The transaction of a command, None if its response is left out."""
        request = plan.by_name[command.request.name]
        if command.response is None:
            return cls(command, request, None)
        response = plan.by_name.get(command.response.name)
        kept = [each for each in command.replies if each.message.name in plan.by_name]
        others = tuple(plan.by_name[each.message.name] for each in kept)
        ends = () if command.many else kept  # of several answers: it is not one of them
        done = tuple(plan.by_name[each.message.name] for each in ends if "done" in each.meanings)
        if response is None:
            return None
        steps = [(step.sent, plan.by_name[step.message.name]) for step in command.steps]
        further = tuple(message for sent, message in steps if sent)
        answers = tuple(message for sent, message in steps if not sent)
        return cls(command, request, response, others, done, further, answers)

    @property
    def name(self) -> str:
        """Name of the method: that of the command, with an underscore if it is reserved."""
        return method(self.command.name)


@dataclass(frozen=True, kw_only=True)
class BusView:
    """The variables of the template."""

    doc: Sequence[str]
    imports: Sequence[str]
    decimals: bool
    new: bool
    public: Sequence[str]
    callers: Sequence[Caller]
    servers: Sequence[Server]
    nodes: str
    selects: str
    host: bool
    ring: bool
    others: bool
    #: Classes of collections.abc.
    abstract: Sequence[str]
    #: Kinds of several answers: each, many, stream.
    several: set[str]
    dialogues: bool
    #: Classes that open ports, by module.
    ports: Mapping[str, Sequence[str]]


class BusModule:
    """Collects the variables of the template."""

    #: What has a method.
    each = "command"

    def __init__(self, plan: Plan, transactions: Sequence[Transaction]) -> None:
        """``transactions`` have all their messages in the codec module."""
        self._plan = plan
        self._protocol = plan.protocol
        self._transactions = transactions
        self._sides = sides_of(plan.protocol, transactions)
        self._place: Place = place_of(plan)
        self._classes = {"Message"}
        packets = isinstance(plan.frames["request"].receiver, InStep)
        #: The class of requests, which have a frame of their own.
        self._request = "Request" if packets and plan.protocol.bus.kind == "host" else "Message"
        self._classes |= {self._request} if plan.role != "slave" else set()

    @cached_property
    def ports(self) -> Ports:
        """The modules with classes that open ports."""
        asks, answers = self._plan.role != "slave", self._plan.role != "master"
        host = self._protocol.bus.kind == "host"
        sides = [side for side in self._sides if side.asked] if asks else []
        askers = [self._host_asker() if host else self._asker(side) for side in sides]
        slave = answers and any(side.answered for side in self._sides)
        nodes = self._numbers if self._selected else self._nodes()
        return Ports(self._plan, askers, slave=slave, nodes=nodes)

    def _host_asker(self) -> Asker:
        """The class of a device at a host, and that of one of what it selects."""
        selected = self._selected
        one = pascal(selected)
        return Asker("Device", "HostCalls", one, f"{one}Calls" if one else "", host=True, selects=selected)

    def _asker(self, side: Side) -> Asker:
        """The classes of a side that open ports: those of a bus, or of a device if frames have no address."""
        both, several = self._protocol.both_ask, len(self._sides) > 1
        prefix = side.asks if several else ""
        one = f"{prefix}Node" if self._place.address else ""
        name = "Peer" if both else "Bus" if one else "Device"
        return Asker(prefix or name, f"{side.asks}Calls", one, f"{prefix}NodeCalls", both)

    def text(self) -> str:
        """The module's text."""
        host = self._protocol.bus.kind == "host"
        callers = self._callers(host=host) if self._plan.role != "slave" else []
        servers = self._servers() if self._plan.role != "master" else []
        titles = self._titles
        title = " and ".join(title for title, part in zip(titles, (callers, servers), strict=True) if part)
        first, *others = banner(self._protocol)
        head = one_line(f"{first}: {title}, a method for each {self.each}.")
        source = f"from .{file_stem(self._protocol.name)} import "
        classes = sorted(self._classes, key=imported)
        fits = len(source) + len(", ".join(classes)) <= WIDTH
        lines = [line for other in others for line in textwrap.wrap(one_line(other), WIDTH)]
        view = BusView(
            doc=python_text.docstring([*textwrap.wrap(head, WIDTH - 4), "", *lines]),
            imports=[source + ", ".join(classes)]
            if fits
            else [f"{source}(", *(f"    {each}," for each in classes), ")"],
            decimals="Decimal" in self._place.used,
            new="NEW" in self._place.used,
            public=sorted(
                [*(each.name for each in callers), *(each.name for each in servers)]
                + [name for names in self.ports.names.values() for name in names]
            ),
            callers=callers,
            servers=servers,
            nodes=f", {self._nodes()}" if self._nodes() else "",
            selects=self._selected,
            host=host,
            ring=self._protocol.bus.kind == "ring",
            others=any(each.done for each in self._transactions),
            abstract=self._abstract(callers=bool(callers), servers=bool(servers)),
            several=self._several,
            dialogues=any(each.command.steps for each in self._transactions),
            ports=self.ports.names,
        )
        template = templates().get_template("templates/bus.j2")
        return fitted(template.render(vars(view)).rstrip("\n") + "\n")

    @property
    def _titles(self) -> tuple[str, str]:
        """What the classes of calls and of handlers are."""
        if len(self._sides) > 1:
            return "calls of each side of a link", "its handlers"
        if self._protocol.bus.kind == "host":
            return "calls of a host", "handlers of a device"
        return "calls of a master", "handlers of a slave"

    @property
    def _several(self) -> set[str]:
        return {kind for each in self._transactions if (kind := _several(each.command))}

    def _abstract(self, *, callers: bool, servers: bool) -> list[str]:
        """Classes of collections.abc that annotations use."""
        several, dialogues = self._several, any(each.command.steps for each in self._transactions)
        stream = "stream" in several
        used = {
            "AsyncGenerator": stream and callers,
            "Callable": servers or dialogues,
            "Generator": (dialogues and servers) or (stream and callers),
            "Iterable": stream and servers,
            "Sequence": dialogues or (servers and bool(several) and not stream),
        }
        return [name for name, needed in used.items() if needed]

    def _class(self, message: MessagePlan) -> str:
        """The class of a message; adds it to the imports."""
        name = class_name(message)
        self._classes.add(name)
        return name

    # Master and host

    def _taken(self, transaction: Sent) -> list[str]:
        """Parameters for the values of a request."""
        settable = self._settable(transaction)
        for each in settable:
            if isinstance(each, RecordStep | RecordsStep):
                self._classes.add(self._place.classes[each.record.name])
            elif not isinstance(each, BytesStep) and isinstance(each.number.meaning, Enum):
                self._classes.add(self._place.classes[each.number.meaning.name])
        taken = [values.argument(each, self._place) for each in by_slot(settable)]
        for name, message in self._further(transaction):
            kind = self._class(message)
            # answers of several classes
            taken.append(f"{name}: {kind} | Callable[[Sequence[Any]], {kind}]")
        return taken

    def _further(self, transaction: Sent) -> list[tuple[str, MessagePlan]]:
        """Parameters for what the master sends after a request."""
        names = {held(each) for each in self._settable(transaction)}
        names |= {self._place.address}
        found = []
        for message in transaction.further:
            name = attribute(message.name.rpartition(".")[2])
            while name in names:
                name += "_"
            names.add(name)
            found.append((name, message))
        return found

    def _settable(self, transaction: Sent) -> list[Holder]:
        """What a caller gives: the values of a request, and those of its frame without the counter."""
        counter = self._protocol.counter
        beside = (member for _, member in transaction.request.envelope.values)
        others = [each for each in beside if counter is None or each.name != counter.name]
        return [*transaction.request.payload.settable, *others]

    def _given(self, transaction: Sent) -> list[str]:
        """Arguments that pass the parameters on."""
        names = dict.fromkeys(held(each) for each in self._settable(transaction))
        return [f"{name}={name}" for name in names]

    def _answer(
        self,
        transaction: Transaction,
        more: Sequence[MessagePlan],
        *,
        surely: bool = False,
        stream: str = "Iterable",
    ) -> str:
        """Return type of a method.

        Args:
            transaction: the transaction.
            more: answers besides the response.
            surely: whether it never returns None.
            stream: class of answers without an end.
        """
        if transaction.response is None:
            return "None"
        names = [self._class(each) for each in (transaction.response, *more)]
        if transaction.answers:
            names[0] = f"tuple[{', '.join(self._class(each) for each in transaction.answers)}]"
        if transaction.command.many is not None:
            names[0] = _type_of_several(transaction.command, names, stream)
        return " | ".join(names if surely else [*names, "None"])

    def _ask(self, call: Transaction, wait: str) -> str:
        """The statement that returns the answer."""
        if call.answers:
            return f"return {wait}self.ask_steps(_request, [{', '.join(n for n, _ in self._further(call))}])"
        several = _several(call.command)
        kind = f"_{several}" if several else "_any" if call.done else ""
        return f"return {wait}self.ask{kind}(_request, {self._asked(call)})"

    def _asked(self, transaction: Transaction) -> str:
        """The classes of the answers that a call returns, as arguments."""
        assert transaction.response is not None
        return ", ".join(self._class(each) for each in (transaction.response, *transaction.done))

    def _callers(self, *, host: bool) -> list[Caller]:
        found = []
        for asynchronous in (False, True):
            if host:
                found += self._host_callers(asynchronous=asynchronous)
                continue
            for side in (side for side in self._sides if side.asked):
                found.append(self._caller(side, asynchronous=asynchronous, node=False))
                if self._place.address:
                    found.append(self._caller(side, asynchronous=asynchronous, node=True))
        return found

    def _caller(self, side: Side, *, asynchronous: bool, node: bool) -> Caller:
        what = "calls to one node" if node else "calls of a master"
        name = "NodeCalls" if node else f"{side.asks}Calls"
        if len(self._sides) > 1:
            what = (
                f"calls of the {self._side(side)} to one node" if node else f"calls of the {self._side(side)}"
            )
            name = f"{side.asks}NodeCalls" if node else name
        more = ["", "Attributes:", f"    number: Address of the node, {self._nodes()}."] if node else []
        doc = caller_doc(name, what, more, asynchronous=asynchronous)
        asked = [each for each in side.asked if not (node and each.command.addressing == "broadcast")]
        methods = [self._method(each, asynchronous=asynchronous, node=node) for each in asked]
        return make_caller(name, doc, methods, asynchronous=asynchronous, one=node)

    def _method(self, call: Transaction, *, asynchronous: bool, node: bool) -> Method:
        command, for_tasks = call.command, asynchronous
        address = "" if node or command.addressing in ("broadcast", "none") else self._place.address
        asynchronous = asynchronous and not command.stopped  # which returns an iterator at once
        stream = "AsyncGenerator" if for_tasks else "Generator"
        answer = self._answer(call, call.done, surely=node or command.addressing != "either", stream=stream)
        head = self._head(call, address, answer, asynchronous=asynchronous)
        entry = f"{address}: Address of the node, {self._nodes()}{self._all(command)}." if address else ""
        doc = _summary(command) if for_tasks else [*_summary(command), *self._arguments(call, entry)]
        if command.stopped:
            text = f"Closing the iterator stops the answers, as {method(command.stopped.command)} does."
            doc[len(_summary(command)) :] = ["", text, *doc[len(_summary(command)) :]]
        body = self._body(call, "await " if asynchronous else "", address=address, node=node)
        return Method(head, python_text.docstring(doc), body)

    def _head(self, call: Sent, where: str, answer: str, *, asynchronous: bool) -> list[str]:
        """The signature of a method; ``where`` is the argument for an address or axis."""
        arguments = ["self", *([f"{where}: int"] if where else [])]
        taken = self._taken(call)
        arguments += ["*", *taken] if taken else []
        prefix = "async " if asynchronous else ""
        return wrapped(f"{prefix}def {call.name}(", arguments, f") -> {answer}:", 4)

    def _body(self, call: Transaction, wait: str, *, address: str, node: bool) -> list[str]:
        addressed = [f"{self._place.address}={'self.number' if node else address}"] if address or node else []
        request = wrapped(
            f"_request = {self._class(call.request)}(", [*addressed, *self._given(call)], ")", 8
        )
        if call.response is None:
            return [*request, f"{wait}self.tell(_request)"]
        ask = [self._ask(call, wait)]
        if call.done or call.answers:  # of any class, which `ask` cannot express
            answer = self._answer(call, call.done, surely=True)
            ask = [f"_answer: {answer} = {ask[0].removeprefix('return ')}", "return _answer"]
        if call.command.addressing != "either" or node:
            return [*request, *ask]
        return [
            *request,
            f"if {address} == {self._protocol.bus.broadcast}:",
            f"    {wait}self.tell(_request)",
            "    return None",
            *ask,
        ]

    def _arguments(self, call: Sent, first: str) -> list[str]:
        """The section on arguments; ``first`` describes the one that is not a field."""
        entries = [first] if first else []
        pairs: dict[str, list[tuple[Value, Holder]]] = {}
        stated = {value.name: value for value in self._protocol.frame_values}
        settable = self._settable(call)
        own = call.request.message.values
        all_stated = [*own, *(stated[each.name] for each in settable[len(own) :])]
        for value, each in zip(all_stated, settable, strict=True):
            pairs.setdefault(attribute(value.name), []).append((value, each))
        entries += [f"{name}: {values.description(cases, self._place)}" for name, cases in pairs.items()]
        entries += [
            f"{name}: {class_name(message)} to send, or a function that makes it from the answers so far."
            for name, message in self._further(call)
        ]
        lines = [line for entry in entries for line in docstrings.item(entry, WIDTH - 8)]
        return ["", "Args:", *lines] if lines else []

    def _all(self, command: Command) -> str:
        """The meaning of the broadcast address for a command."""
        everybody = self._protocol.bus.broadcast
        if command.addressing == "answered_broadcast" and command.many:
            return f"; or {everybody} for all of them"
        if command.addressing == "answered_broadcast":
            return f"; or {everybody} for a single node on the line with any number"
        if command.addressing != "either":
            return ""
        silent = ", which do not respond: returns None" if command.response else ""
        return f"; or {everybody} for all of them{silent}"

    def _nodes(self) -> str:
        nodes = self._protocol.bus.nodes
        return f"{nodes[0]}..{nodes[1]}" if nodes else ""

    # Host of a device, whose commands may act on what is selected

    @property
    def _selection(self) -> Selection | None:
        """What commands act on; None if nothing is selected."""
        found = selection_of(self._plan)
        return found if found and any(found.decides(each.command) for each in self._transactions) else None

    @property
    def _selected(self) -> str:
        """The name of what commands act on, "" if nothing is selected."""
        return self._selection.attribute if self._selection else ""

    def _host_callers(self, *, asynchronous: bool) -> list[Caller]:
        selection = self._selection
        if selection is None:
            calls = self._transactions
            return [self._host_caller("HostCalls", calls, "", asynchronous=asynchronous, one=False)]
        name, selected = attribute(selection.attribute), pascal(selection.attribute)
        on_it = [each for each in self._transactions if selection.decides(each.command)]
        fields = {held(each) for call in on_it for each in call.request.payload.settable}
        while name in fields:
            name += "_"
        return [
            self._host_caller("HostCalls", self._transactions, name, asynchronous=asynchronous, one=False),
            self._host_caller(f"{selected}Calls", on_it, "", asynchronous=asynchronous, one=True),
        ]

    def _host_caller(
        self, name: str, calls: Sequence[Transaction], argument: str, *, asynchronous: bool, one: bool
    ) -> Caller:
        selected, selection = self._selected, self._selection
        what = f"calls to one {selected}" if one else "calls of a host"
        more = ["", "Attributes:", f"    number: Number of the {selected}, {self._numbers}."] if one else []
        doc = caller_doc(name, what, more, asynchronous=asynchronous)
        methods = [
            self._host_method(
                each,
                argument if selection and selection.decides(each.command) else "",
                asynchronous=asynchronous,
            )
            for each in calls
        ]
        made = make_caller(name, doc, methods, asynchronous=asynchronous, one=one)
        return replace(made, request=self._request, selected=argument)

    @property
    def _numbers(self) -> str:
        """The numbers of what is selected."""
        numbers = sorted(self._selection.commands) if self._selection else []
        *others, last = map(str, numbers)
        if len(numbers) > 2 and len(numbers) == numbers[-1] - numbers[0] + 1:
            return f"{others[0]}..{last}"
        return f"{', '.join(others)} or {last}" if others else last

    def _host_method(self, call: Transaction, argument: str, *, asynchronous: bool) -> Method:
        head = self._head(call, argument, self._answer(call, (), surely=True), asynchronous=asynchronous)
        doc = [*_summary(call.command), *_attributes(call.command, self._selection)]
        if not asynchronous:
            entry = (
                f"{argument}: {self._selected.capitalize()} to act on, {self._numbers}." if argument else ""
            )
            doc += self._arguments(call, entry)
        wait, chosen = "await " if asynchronous else "", f", {argument}" if argument else ""
        request = wrapped(f"_request = {self._class(call.request)}(", self._given(call), ")", 8)
        ask = f"{wait}self.tell(_request{chosen})"
        if call.response is not None:
            ask = f"return {wait}self.ask(_request, {self._class(call.response)}{chosen})"
        return Method(head, python_text.docstring(doc), [*request, ask])

    # Slave

    def _side(self, side: Side) -> str:
        """The name of a side of a link."""
        return self._protocol.bus.sides[self._sides.index(side)]

    @property
    def _answerer(self) -> str:
        return "a device" if self._protocol.bus.kind == "host" else "a slave"

    def _servers(self) -> list[Server]:
        several = len(self._sides) > 1
        return [
            Server(
                f"{side.answers}Handlers",
                f"the {self._side(side)}" if several else self._answerer,
                f"_{self._side(side).upper()}_METHODS" if several else "_METHODS",
                [f'{self._class(t.request)}: "{t.name}"' for t in side.answered],
                [self._handler(call) for call in side.answered],
            )
            for side in self._sides
            if side.answered
        ]

    def _handler(self, call: Transaction) -> Method:
        command = call.command
        arguments = ["self", f"request: {self._class(call.request)}", "now: float"]
        answer = self._answer(call, call.others)
        if _answers_once(command) and call.response is not None:
            answer = " | ".join([*(self._class(each) for each in (call.response, *call.others)), "None"])
        if call.answers:
            answer = " | ".join(["_Handling", *(self._class(each) for each in call.others), "None"])
        head = wrapped(f"def {call.name}(", arguments, f") -> {answer}:", 4)
        doc = _summary(command)
        if call.answers:
            frames = ", ".join(self._class(each) for each in call.further)
            gets = f" Each `yield` gives the next frame: {frames}." if frames else ""
            text = f"A dialogue: a generator of the answers to each frame, the last of them returned.{gets}"
            doc += ["", *textwrap.wrap(text, WIDTH - 8)]
        if repeated := [of for of in command.repeated(command.response).values() if isinstance(of, str)]:
            doc += ["", f"The response repeats {' and '.join(repeated)} of the request."]
        if call.command.proof is not None:
            doc += ["", "The engine gives the response its check value, which covers the request."]
        if command.response and command.addressing == "either":
            doc += ["", "Return None for a broadcast, which is not answered."]
        if _answers_once(command):
            doc += ["", "Each node in the list answers once, in the order of the list."]
        elif command.many is not None:
            doc += ["", *textwrap.wrap(_how_many(command), WIDTH - 8)]
        if call.others:
            names = " or ".join(self._class(each) for each in call.others)
            doc += ["", *textwrap.wrap(f"Return {names} to answer in another way.", WIDTH - 8)]
        return Method(head, python_text.docstring(doc), self._refusing(call))

    def _refusing(self, call: Transaction) -> list[str]:
        """What a slave without a method for a command does: it refuses, if the schema says so."""
        unknown = self._plan.protocol.to_unknown
        reply = next((r for r in call.command.replies if unknown and _is_reply(r, unknown)), None)
        message = next((each for each in call.others if reply and each.name == reply.message.name), None)
        if unknown is None or message is None:
            return []
        node = [f"{self._place.address}=self.number"] if self._place.address else []
        given = [*node, *(f"{attribute(name)}={raw}" for name, raw in unknown.raws)]
        several = call.command.many is not None and not _answers_once(call.command)
        before, after = ("return [", ")]") if several else ("return ", ")")
        return wrapped(f"{before}{self._class(message)}(", given, after, 8)


def _type_of_several(command: Command, names: Sequence[str], stream: str) -> str:
    """The type of several answers, whose classes are ``names``; one alone is an answer without an end too."""
    found = " | ".join(names)
    if command.stopped:
        return f"{names[0]} | {stream}[{found}]" if stream == "Iterable" else f"{stream}[{found}]"
    return f"dict[int, {found} | None]" if command.each else f"list[{found}]"


def _how_many(command: Command) -> str:
    """What a handler of a command with several answers returns."""
    if command.stopped is None:
        return "Return a list: several answers are sent."
    stop = method(command.stopped.command)
    return (
        f"Return the first answer, several, or an iterator of all until {stop}. "
        "The engine takes further ones, with the request."
    )


def _several(command: Command) -> str:
    """How several answers are returned: each, many or stream; "" if there is one."""
    if command.many is None:
        return ""
    return "each" if command.each else "stream" if command.stopped else "many"


def _answers_once(command: Command) -> bool:
    """Whether a node sends one of several answers."""
    return command.each is not None and not command.each.by


def _is_reply(reply: Reply, unknown: Unknown) -> bool:
    """Whether a reply is the one to unknown requests, for its own command."""
    return reply.message.name.rpartition(".")[2] == unknown.message.name.rpartition(".")[2]


def _summary(command: Command) -> list[str]:
    text = docstrings.opening(command.doc or command.name, command.section)
    unconfirmed: Iterable[str] = () if command.confirmed else ("", docstrings.UNCONFIRMED)
    return [*docstrings.paragraph(text, WIDTH - 12), *unconfirmed]


def _attributes(command: Command, selection: Selection | None) -> list[str]:
    """The protocol-specific attributes of a command as a line; false ones are omitted."""
    told = {(selection.attribute, selection.values[0])} if selection else set()  # implied by the argument
    said = [pair for pair in command.attributes.items() if pair[1] is not False and pair not in told]
    words = [(key if value is True else f"{key} {value}").replace("_", " ") for key, value in said]
    return ["", *textwrap.wrap(one_line(f"{', '.join(words).capitalize()}."), WIDTH - 8)] if words else []


def caller_doc(
    name: str, what: str, more: Sequence[str], *, asynchronous: bool, each: str = "command"
) -> list[str]:
    """The docstring of a class of calls."""
    doc = [f"The {what}, a method for each {each}{': coroutines' if asynchronous else ''}.", ""]
    if asynchronous:
        doc += [f"The arguments are those of {name}.", ""]
    supplied = "A subclass implements `ask` and `tell`; methods pass on their exceptions."
    if each == "message":
        supplied = "A subclass implements `tell`; methods pass on its exceptions."
    return python_text.docstring([*doc, *textwrap.wrap(supplied, WIDTH - 8), *more])


def make_caller(name: str, doc: list[str], methods: list[Method], *, asynchronous: bool, one: bool) -> Caller:
    """A class of calls, blocking or for asyncio."""
    prefix = "async " if asynchronous else ""
    return Caller(f"Async{name}" if asynchronous else name, doc, prefix, one, methods)
