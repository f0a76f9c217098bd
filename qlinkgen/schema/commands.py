"""Second pass, commands: builds transactions of requests and responses."""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType
from typing import assert_never

from qlinkgen.model.frame import DelimitedFrame, Frame, FrameKinds, MarkedFrame, PacketFrame
from qlinkgen.model.message import Message
from qlinkgen.model.transaction import Addressing, Allowance, Bus, Command, Many, Repeat, Reply
from qlinkgen.model.types import Scalar
from qlinkgen.schema.constants import MAX_BITS
from qlinkgen.schema.file_commands import AnswerSpec, CommandSpec, RepeatSpec, ResponseWord
from qlinkgen.schema.file_fields import Fields
from qlinkgen.schema.file_model import SchemaFile
from qlinkgen.schema.hosts import HostChecker, resync_of, selection_of
from qlinkgen.schema.kind_messages import AnyMessages, KindMessages
from qlinkgen.schema.kind_names import message_kind, response_kind
from qlinkgen.schema.kinds import Label
from qlinkgen.schema.layouts import fields_of, fields_path
from qlinkgen.schema.many import ManyBuilder
from qlinkgen.schema.messages import Written
from qlinkgen.schema.notation import AnswerId, Divider, Duration, StatedId, shown
from qlinkgen.schema.replies import ReplyBuilder
from qlinkgen.schema.report import Reporter, did_you_mean, listed
from qlinkgen.schema.seeds import is_number
from qlinkgen.schema.sides import EITHER, asker_of, check_sides
from qlinkgen.schema.sizes import Sized, sized
from qlinkgen.schema.source import Path
from qlinkgen.schema.steps import Asked, StepBuilder, names_response
from qlinkgen.schema.stopping import stopped


def build_bus(file: SchemaFile, report: Reporter) -> Bus:
    """The bus described by the file."""
    spec = file.bus
    if spec.sides is not None and (spec.kind != "link" or len(set(spec.sides)) < len(spec.sides)):
        what, hint = "only a link has sides", "use kind: link, or remove them"
        if spec.kind == "link":
            what, hint = "both sides of the link have the same name", "use different names"
        report.error("bad-link", ("bus", "sides"), what, hint, of_key=True)
    for index, side in enumerate(spec.sides or ()):
        if side == EITHER:
            what = f"from: {EITHER} of a command means both sides, not one called so"
            report.error("bad-link", ("bus", "sides", index), what, "use another name")
    return Bus(
        kind=spec.kind,
        nodes=spec.nodes,
        broadcast=spec.broadcast,
        baud=spec.baud,
        bits_per_byte=spec.bits_per_byte,
        response_within=_allowance(spec.response_within),
        section=spec.section,
        sides=tuple(spec.sides or ()),
        resync=resync_of(file),
        selection=selection_of(file),
    )


def _allowance(time: Duration | None) -> Allowance:
    return Allowance(time.byte_times, time.seconds) if time else Allowance()


#: What tells answers of the same number apart.
_TELLING = ("frame", "frames", "bus")
#: The hint where a reply has the id of its response.
_ONE_ANSWER = "; or make one response of both, with if or switch for their fields, and with means"


class CommandBuilder:
    """Builds the messages and commands of one file."""

    def __init__(
        self, file: SchemaFile, report: Reporter, messages: AnyMessages, frame: Frame | None, bus: Bus
    ) -> None:
        """``frame`` is None if it could not be built; checks that depend on it are skipped."""
        self._file = file
        self._report = report
        self._build = messages
        self._frame = frame
        self._bus = bus
        self._replies = ReplyBuilder(file, report, messages, frame)
        self._sizes: dict[str, Sized] = {}
        self._singles: dict[str, Message] = {}
        self._replied: set[str] = set()
        self._steps = StepBuilder(file, report, messages, self._singles, self._sizes)
        #: Names of the answers that only their request tells apart, and of the message that carries them.
        self._asked: frozenset[str] = frozenset()
        self.messages: list[Message] = []
        self.commands: list[Command] = []

    def build(self) -> None:
        """Fill :attr:`messages` and :attr:`commands`."""
        self._replies.check_names()
        for name, message in self._file.messages.items():
            for key, value in message.attributes.items():
                self._check_attribute(key, value, ("messages", name, "attributes", key))
            self._singles[name] = self._build.single(name, message)
        for name, spec in self._file.commands.items():
            self._command(name, spec, ("commands", name))
        self._replies.check_meant()
        self.commands = stopped(self.commands, self._frame, self._report)
        self.messages += self._singles.values()
        self._carry()
        if not self._file.commands and not self._file.messages:
            what = "the protocol has no commands and no messages"
            needs = (("commands",), ("messages",))
            self._report.error("empty-protocol", (), what, "add commands: or messages:", needs=needs)
        self._check_ids()
        check_sides(
            self._file,
            self._frame,
            self.commands,
            self.messages,
            places=self._build.id_places,
            report=self._report,
        )
        HostChecker(self._file, self._frame, self.commands, self._report).run()
        self._check_only()
        self._check_breaks()

    def _check_breaks(self) -> None:
        """Refuse answers whose end only a break tells, which ports do not report."""
        silence = self._frame.idle if isinstance(self._frame, DelimitedFrame) else None
        for command in self.commands if silence and silence.broken and silence.alone else ():
            if command.response is not None:
                place = ("commands", command.name)
                what = f"only the next break ends an answer to {command.name}, and ports do not report breaks"
                hint = "write response: none, or let a length or the message end frames"
                self._report.error("bad-frame", place, what, hint, of_key=True, needs=(place, ("frame",)))

    def _carry(self) -> None:
        """Add the message that carries the answers which only their request tells apart."""
        if isinstance(self._build, KindMessages):  # such answers may be in different kinds of frame
            return
        steps = {name for name, spec in self._file.commands.items() if spec.steps is not None}
        others = steps | self._singles.keys()
        answers = [m for m in self.messages if m.direction == "response" and m.command not in others]
        asked = self._build.asked.of(answers, self._build.id_places)
        if asked:
            self.messages.append(self._build.carrier(asked))
            self._asked = frozenset(each.name for each in (*asked, self.messages[-1]))

    def _command(self, name: str, spec: CommandSpec, path: Path) -> None:
        defaults = self._file.defaults
        addressing = self._addressing(spec.addressing or defaults.addressing, path)
        request, response = self._directions(name, spec, addressing, path)
        steps = self._steps.build(Asked(name, spec, request, response, addressing))
        if steps:
            response = next((step.message for step in reversed(steps) if not step.sent), response)
            known = {message.name for message in self.messages}
            own = {step.message.name: step.message for step in steps if step.message.command == name}
            self.messages += [message for message in own.values() if message.name not in known]
        replies = self._other_replies(name, response, addressing)
        many = self._many(spec, request, response, replies, path, addressing=addressing)
        found = self._sizes.get(name, Sized({}))
        self.commands.append(
            Command(
                name=name,
                id=request.id,
                request=request,
                response=response,
                addressing=addressing,
                response_within=_allowance(spec.response_within or self._file.bus.response_within),
                repeat=self._repeat(spec.repeat or defaults.repeat, request, path),
                replies=replies,
                sizes=found.sizes,
                sized_by=found.by,
                many=many,
                steps=steps,
                outcome=self._replies.outcome(name, response),
                in_flight=spec.in_flight or defaults.in_flight or 1,
                asker=asker_of(self._file, name, self._report),
                restart=self._restart(spec, path),
                doc=spec.doc,
                section=self._section(spec),
                confirmed=spec.confirmed,
                attributes=self._attributes(spec.attributes, path),
            ),
        )

    def _other_replies(
        self, name: str, response: Message | None, addressing: Addressing
    ) -> tuple[Reply, ...]:
        found = tuple(self._replies.of(name, addressing, answered=response is not None))
        self.messages += [each.message for each in found if each.message.name not in self._replied]
        self._replied |= {each.message.name for each in found}
        return found

    def _many(
        self,
        spec: CommandSpec,
        request: Message,
        response: Message | None,
        replies: tuple[Reply, ...],
        path: Path,
        *,
        addressing: Addressing,
    ) -> Many | None:
        place = (*path, "many")
        if spec.many is None or spec.steps is not None:
            return None
        if response is None or isinstance(self._frame, PacketFrame):
            why = "it has no response" if response is None else "answers in packets have no id"
            what, needs = (
                f"{path[-1]} cannot have several answers: {why}",
                (place, (*path, "response"), ("frame",)),
            )
            self._report.error("bad-many", place, what, "remove it", of_key=True, needs=needs)
            return None
        builder = ManyBuilder(
            request,
            response,
            replies,
            self._report,
            address=self._address_name,
            addressing=addressing,
            commands=self._file.commands,
        )
        return builder.build(spec.many, place)

    @property
    def _address_name(self) -> str:
        """The name of the part with the address, "" without one."""
        frame = self._frame
        found = frame.address if isinstance(frame, DelimitedFrame | FrameKinds) else None
        return found.name if found else ""

    def _section(self, spec: CommandSpec) -> str:
        return spec.section if spec.section is not None else self._file.defaults.section or ""

    def _directions(
        self, name: str, spec: CommandSpec, addressing: Addressing, path: Path
    ) -> tuple[Message, Message | None]:
        defaults = self._file.defaults
        request = defaults.request if spec.request is None else spec.request
        response, answers = self._response(spec, path)
        if request is None:
            self._missing(
                "bad-response",
                "request",
                path,
                f"{name} has no request",
                "write request: {} for one without data",
            )
        if response is None and names_response(spec):
            hint = "write response: {} for an empty response, response: none for no response"
            self._missing("bad-response", "response", path, f"{name} has no response", hint)
        self._check_answered(addressing, response, path)
        section, build = self._section(spec), self._build.directed
        place = (*path, "request") if spec.request is not None else ("defaults", "request")
        written = Written(
            "request",
            StatedId(spec.id),
            (*path, "id"),
            request or {},
            place,
            separator=spec.separator,
            kind=message_kind(self._file, spec.frame),
        )
        asked = build(name, spec, written, addressing=addressing, section=section)
        self.messages.append(asked)
        if response is None or response == "none":
            return asked, None
        if isinstance(response, str):
            return asked, self._named_response(response, answers.path)
        found = sized(answers.fields, {"request": asked}, answers.path, self._report)
        self._sizes[name] = found
        sized_answers = answers._replace(fields=found.fields, asked={name for name, _ in found.sizes})
        answered = build(name, spec, sized_answers, addressing=addressing, section=section)
        self.messages.append(answered)
        return asked, answered

    def _response(self, spec: CommandSpec, path: Path) -> tuple[Fields | ResponseWord | None, Written]:
        """The fields or the word of the response, None if nothing states it; and the message as written."""
        own, common = spec.response, self._file.defaults.response if names_response(spec) else None
        given, place = (own, (*path, "response")) if own is not None else (common, ("defaults", "response"))
        fields = fields_of(given)
        number, number_path = AnswerId(0, relative=True), (*path, "id")
        for each, where in ((own, (*path, "response")), (common, ("defaults", "response"))):
            if isinstance(each, AnswerSpec) and each.id is not None:
                number, number_path = each.id, (*where, "id")
                break
        written = Written(
            "response",
            number.of(spec.id),
            number_path,
            fields or {},
            fields_path(given, place),
            separator=self._separator(spec),
            kind=response_kind(self._file, spec),
            inherited=number.relative,
        )
        return given if isinstance(given, str) else fields, written

    def _separator(self, spec: CommandSpec) -> Divider | None:
        """The separator of a response: the nearest that is stated; None for that of the defaults."""
        own, common = spec.response, self._file.defaults.response
        stated = (
            own.separator if isinstance(own, AnswerSpec) else None,
            spec.separator,
            common.separator if isinstance(common, AnswerSpec) else None,
        )
        return next((each for each in stated if each is not None), None)

    def _named_response(self, name: str, path: Path) -> Message | None:
        """The message that is the response of a command."""
        message = self._singles.get(name)
        if message is None:
            hint = did_you_mean(name, self._singles, "write fields, none, or the name of a message")
            what, needs = f"unknown message {shown(name)}", (path, ("messages", name))
            self._report.error("unknown-message", path, what, hint, needs=needs)
        elif message.direction != "response":
            what, needs = f"{name} is not sent by slaves", (path, ("messages", name))
            self._report.error("bad-response", path, what, "give it direction: response", needs=needs)
        return message

    def _missing(self, rule: str, key: str, path: Path, what: str, hint: str) -> None:
        """Report a key that is missing in a command and in the defaults."""
        lost = self._report.touched((*path, key)) or self._report.incomplete(("defaults",))
        if not lost:
            self._report.error(rule, path, what, hint, of_key=True, absent=True)

    def _addressing(self, given: Addressing | None, path: Path) -> Addressing:
        place = (*path, "addressing")
        needs = (("bus",), ("frame",), place, ("defaults", "addressing"))
        if not self._build.addressed:
            if given not in (None, "none"):
                what, hint = (
                    f"'{given}' needs an address in the frame",
                    "remove it, or add a part with role: address",
                )
                self._report.error("bad-addressing", place, what, hint, needs=needs)
            return "none"
        if given is None or given == "none":
            hint = "add addressing: node, broadcast, either or answered_broadcast"
            if not self._report.touched(("frame",)):
                self._missing("bad-addressing", "addressing", path, f"{path[-1]} has no addressing", hint)
            return "node"
        if given != "node" and self._bus.broadcast is None:
            what = f"'{given}' needs a broadcast address"
            self._report.error("bad-addressing", place, what, "add broadcast: 0 to the bus", needs=needs)
        return given

    def _check_answered(
        self, addressing: Addressing, response: Fields | ResponseWord | None, path: Path
    ) -> None:
        place, needs = (*path, "response"), ((*path, "response"), (*path, "addressing"))
        if response == "none" and addressing == "answered_broadcast":
            what = f"{path[-1]} has an answered broadcast but no response"
            self._report.error(
                "bad-response", place, what, "use addressing: either", of_key=True, needs=needs
            )
        if response not in ("none", None) and addressing == "broadcast":
            what = f"{path[-1]} is only broadcast but has a response"
            hint = "use response: none, or addressing: answered_broadcast"
            self._report.error("bad-response", place, what, hint, of_key=True, needs=needs)

    def _repeat(self, spec: RepeatSpec | None, request: Message, path: Path) -> Repeat:
        if spec is None:
            hint = "write repeat: safe, unsafe or {counter: FIELD}"
            self._missing(
                "bad-repeat", "repeat", path, f"{path[-1]} does not state whether it may be repeated", hint
            )
            return Repeat(safe=False)
        if spec.counter is not None:
            self._check_counter(spec.counter, request, path)
        return Repeat(spec.safe, spec.counter or "")

    def _check_counter(self, counter: str, request: Message, path: Path) -> None:
        place, needs = (*path, "repeat", "counter"), ((*path, "request"), (*path, "repeat"))
        known = {value.name: value.type for value in request.values}
        if counter not in known:
            hint = did_you_mean(counter, known, f"its fields are {listed(known)}")
            what = f"the request has no field {shown(counter)}"
            self._report.error("unknown-message", place, what, hint, needs=needs)
            return
        kind = known[counter]
        absent = any(value.field.conditional for value in request.values if value.name == counter)
        if (
            absent
            or not isinstance(kind, Scalar)
            or kind.meaning is not None
            or kind.scaling is not None
            or kind.signed
            or kind.bits > MAX_BITS
        ):
            what = f"{counter} cannot count repeats"
            self._report.error("bad-repeat", place, what, "use a plain unsigned integer", needs=needs)

    def _restart(self, spec: CommandSpec, path: Path) -> int | None:
        """The number of the request after this one."""
        counter = self._frame.counter if isinstance(self._frame, DelimitedFrame | FrameKinds) else None
        if spec.restart is None or self._report.touched(("frame",)) or self._report.touched(("frames",)):
            return spec.restart
        what, hint = "", "remove it, or add a part with role: counter"
        if counter is None or (counter.counting and counter.counting.per_frame):
            what = "frames have no counter of requests"
        elif spec.restart >> counter.bits:
            what = f"{spec.restart} does not fit {counter.name}"
            hint = f"use 0..{(1 << counter.bits) - 1}"
        if what:
            place = (*path, "restart")
            self._report.error("bad-repeat", place, what, hint, of_key=True, needs=(place, ("frame",)))
            return None
        return spec.restart

    def _attributes(self, given: Mapping[str, Label], path: Path) -> Mapping[str, Label]:
        """The attributes of a command, including defaults."""
        merged: dict[str, Label] = {**self._file.defaults.attributes, **given}
        for key, value in merged.items():
            place = (*(path if key in given else ("defaults",)), "attributes", key)
            self._check_attribute(key, value, place)
        return MappingProxyType(merged)

    def _check_attribute(self, key: str, value: Label, place: Path) -> None:
        declared = self._file.attributes.get(key)
        needs = (place, ("attributes", key))
        if declared is None:
            hint = did_you_mean(key, self._file.attributes, "declare it under attributes")
            what = f"attribute {shown(key)} is not declared"
            self._report.error("unknown-attribute", place, what, hint, of_key=True, needs=needs)
        elif declared.values is None:
            if declared.type is not None and not is_number(value, declared.type or ""):
                what = f"{key} cannot be {shown(value)}"
                hint = f"use a number that fits {declared.type}"
                self._report.error("unknown-attribute", place, what, hint, needs=needs)
        elif not any(value == allowed and type(value) is type(allowed) for allowed in declared.values):
            words = [shown(allowed).strip("'") for allowed in declared.values]
            hint = did_you_mean(str(value), words, f"use {listed(words, 'or')}")
            self._report.error(
                "unknown-attribute", place, f"{key} cannot be {shown(value)}", hint, needs=needs
            )

    # Relations between messages

    def _check_ids(self) -> None:
        seen: dict[tuple[str, int], Message] = {}
        answers = {each.response.name for each in self.commands if each.response is not None} - {
            *self._singles
        }
        for message in self.messages:
            path = self._build.id_places[message.name]
            self._check_id_fits(message, path)
            directions = ("request", "response") if message.direction == "message" else (message.direction,)
            for direction in directions:
                other = seen.setdefault((direction, message.id), message)
                if other is not message and not {message.name, other.name} <= self._asked:
                    what = f"{self._called(message)} has the id of {self._called(other)}, {message.id:#04x}"
                    needs: list[Path] = [path, self._build.id_places[other.name]]
                    # What tells answers apart is known once the frame is.
                    needs += ((key,) for key in _TELLING if {message.name, other.name} <= answers)
                    hint = "use another id"
                    if message.command and message.direction == other.direction == "response":
                        hint += _ONE_ANSWER if message.command == other.command else ""
                    if message.name in answers and other.name in answers:
                        hint += (
                            "; a number of all answers is stated once, in defaults: {response: {id: 0x55}}"
                        )
                    self._report.error("overlapping-id", path, what, hint, needs=needs)

    def _called(self, message: Message) -> str:
        """The name of what states the number of a message: a command, or a message with one of its own."""
        own = self._build.id_places[message.name] not in (
            ("commands", message.command, "id"),
            ("messages", message.name, "id"),
        )
        return message.name if own else message.command

    def _check_id_fits(self, message: Message, path: Path) -> None:
        most = 0xFF
        match self._frame:
            case DelimitedFrame() | FrameKinds():
                return  # checked when it was composed
            case MarkedFrame():
                most = self._frame.id_bits.mask
                if message.id == self._frame.end_id:
                    what = f"{message.id} marks the end of a message"
                    needs = (path, ("frame",))
                    self._report.error("overlapping-id", path, what, "use another id", needs=needs)
            case PacketFrame() | None:
                pass
            case _:
                assert_never(self._frame)
        if not 0 <= message.id <= most:
            whose = f" of {message.name}" if path[-2:] != (message.command, "id") else ""
            what = f"id {message.id:#x}{whose} does not fit the frame"
            self._report.error("id-does-not-fit", path, what, f"use 0..{most:#x}", needs=(path, ("frame",)))

    def _check_only(self) -> None:
        marked = self._file.frame.marked
        known = [*self._file.messages, *self._file.commands]
        for index, name in enumerate((marked.checksum.only if marked and marked.checksum else None) or ()):
            if name not in known:
                path = ("frame", "marked", "checksum", "only", index)
                hint = did_you_mean(name, known, f"there are {listed(known)}")
                needs = (path, ("messages", name), ("commands", name))
                self._report.error(
                    "unknown-message", path, f"unknown message {shown(name)}", hint, needs=needs
                )
