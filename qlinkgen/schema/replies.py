"""Second pass, replies: answers other than the response, and what each means."""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

from qlinkgen.model.frame import DelimitedFrame, Frame, FrameKinds, PacketFrame
from qlinkgen.model.message import Message
from qlinkgen.model.transaction import Addressing, Allowance, Case, Reply
from qlinkgen.model.types import Enum, Float, Scalar
from qlinkgen.schema.file_commands import AnswerSpec, Means, MeansSpec, MessageSpec, ReplySpec
from qlinkgen.schema.file_model import SchemaFile
from qlinkgen.schema.kind_messages import AnyMessages
from qlinkgen.schema.kind_names import reply_kind
from qlinkgen.schema.messages import Written
from qlinkgen.schema.notation import AnswerId, Duration, Wanted, shown, wanted
from qlinkgen.schema.report import Reporter, did_you_mean, listed
from qlinkgen.schema.source import Path

_RULE = "bad-reply"
#: Names of the other two messages of a command.
_TAKEN = ("request", "response")


class OfCommand(NamedTuple):
    """A reply as written for a command.

    Attributes:
        name: its name.
        spec: its mapping.
        path: its place.
        shared: it has a number of its own for all commands, or a frame without any, so it is one message.
    """

    name: str
    spec: ReplySpec
    path: Path
    shared: bool

    @property
    def number(self) -> AnswerId:
        """Its number."""
        return self.spec.id if self.spec.id is not None else AnswerId(0, relative=True)


def written_replies(file: SchemaFile, command: str) -> Iterator[OfCommand]:
    """The replies of a command: its own, and those of the file that it does not replace."""
    own = file.commands[command].replies
    for name, spec in file.replies.items():
        if name not in own:
            shared = _is_anonymous(file, spec) if spec.id is None else not spec.id.relative
            yield OfCommand(name, spec, ("replies", name), shared)
    for name, spec in own.items():
        yield OfCommand(name, spec, ("commands", command, "replies", name), shared=False)


def _is_anonymous(file: SchemaFile, spec: ReplySpec) -> bool:
    """Whether a reply names a kind of frame without a message id."""
    kind = file.frames.get(spec.frame or "")
    if kind is None:
        return False
    roles: set[str | None] = {each.told for each in kind.parts.values()}
    roles |= {bits.role for each in kind.parts.values() for bits in (each.bits or {}).values()}
    return "message" not in roles


def reply_messages(file: SchemaFile) -> Iterator[tuple[str, Path]]:
    """Names and places of the messages of all replies; a shared one has the name of the reply."""
    seen: set[str] = set()
    for command in file.commands:
        for each in written_replies(file, command):
            name = each.name if each.shared else f"{command}.{each.name}"
            if name not in seen:
                seen.add(name)
                yield name, each.path


class _Meaning(NamedTuple):
    """What an answer means as written, and otherwise."""

    spec: MeansSpec
    otherwise: Means
    within: Duration | None
    after: Duration | None


class ReplyBuilder:
    """Checks what replies mean, and builds them."""

    def __init__(
        self, file: SchemaFile, report: Reporter, messages: AnyMessages, frame: Frame | None
    ) -> None:
        """``frame`` is None if it could not be built; checks that depend on it are skipped."""
        self._file = file
        self._report = report
        self._messages = messages
        self._frame = frame
        self._shared: dict[str, Message] = {}
        #: Places whose meaning a command uses.
        self._meant: set[Path] = set()

    def check_names(self) -> None:
        """Report replies called like one of the other messages of a command."""
        groups = [("replies",), *(("commands", name, "replies") for name in self._file.commands)]
        specs = [self._file.replies, *(each.replies for each in self._file.commands.values())]
        for path, replies in zip(groups, specs, strict=True):
            for name in replies:
                if name in _TAKEN:
                    what = f"a reply cannot be called {name}"
                    hint = "give it another name; the response has a key of its own"
                    self._report.error(_RULE, (*path, name), what, hint, of_key=True)

    def of(self, command: str, addressing: Addressing, *, answered: bool) -> Iterator[Reply]:
        """The replies of a command."""
        spec = self._file.commands[command]
        path: Path = ("commands", command)
        if not answered:
            if spec.replies:
                what = f"{command} is not answered, so it has no replies"
                place, needs = (*path, "replies"), ((*path, "response"), (*path, "replies"))
                self._report.error(_RULE, place, what, "remove them", of_key=True, needs=needs)
            return
        for written in written_replies(self._file, command):
            if isinstance(self._frame, PacketFrame):
                what = f"{written.name} cannot be told from the response: answers in packets have no id"
                hint, needs = "remove it, or describe a frame with parts", (written.path, ("frame",))
                self._report.error(_RULE, written.path, what, hint, of_key=True, needs=needs)
            elif written.name not in _TAKEN:
                reply, message = written.spec, self._message(command, written, addressing)
                meaning = _Meaning(reply.means, "refused", reply.within, reply.after)
                yield self._reply(written.name, message, meaning, written.path)

    def _message(self, command: str, written: OfCommand, addressing: Addressing) -> Message:
        if written.shared and written.name in self._shared:
            return self._shared[written.name]
        number = written.number.of(self._file.commands[command].id)
        fields = (*written.path, "fields")
        spec = written.spec
        number_path = (*written.path, "id")
        layout = Written(
            written.name,
            number,
            number_path,
            spec.fields,
            fields,
            separator=spec.separator,
            way=self._way(written),
            kind=self._kind(command, written),
            inherited=spec.id is None,
        )
        owner = "" if written.shared else command
        message = self._messages.reply(owner, written.spec, layout, addressing=addressing)
        if written.shared:
            self._shared[written.name] = message
        return message

    def _way(self, written: OfCommand) -> str:
        """The value of the direction that picks a reply, "" for that of a response."""
        when, ways = written.spec.when, self._messages.ways
        if when is None:
            return ""
        place, needs = (*written.path, "if"), ((*written.path, "if"), ("frame",))
        test = when[0]
        others = {} if ways is None else {each: 0 for each in ways.directions if each not in _TAKEN}
        if ways is None or len(when) > 1 or test.field != ways.name or test.negated or len(test.wanted) > 1:
            named = f"the direction, as in {{{ways.name}: NAME}}" if ways else "a part with role: direction"
            what = f"no value picks {written.name}"
            hint = f"name {named}, or one value of the frame or of a field of the response; or give it an id"
            self._report.error(_RULE, place, what, hint, needs=needs)
        elif (name := test.wanted[0].name) in others:
            return name
        else:
            what = f"{test.wanted[0].text} is not another value of {ways.name}"
            hint = f"its other values are {listed(others)}; add one to its values"
            self._report.error(_RULE, place, what, hint, needs=needs)
        self._report.taint(written.path)
        return ""

    def _kind(self, command: str, written: OfCommand) -> str | None:
        """The kind of frame of a reply: the nearest that is stated."""
        owner = None if written.shared else self._file.commands[command]
        return reply_kind(self._file, written.spec, owner)

    def outcome(self, command: str, response: Message | None) -> Reply | None:
        """What the response of a command means, None if it always answers the request."""
        if response is None:
            return None
        own, common = self._file.commands[command].response, self._file.defaults.response
        stated: list[tuple[object, Path]] = [
            (own, ("commands", command, "response")),
            (self._file.messages.get(response.name), ("messages", response.name)),
            (common, ("defaults", "response")),
        ]
        for spec, path in stated:
            if isinstance(spec, AnswerSpec | MessageSpec) and spec.means is not None:
                self._meant.add(path)
                means = _Meaning(spec.means, "done", spec.within, spec.after)
                found = self._reply("response", response, means, path)
                return found if found.meanings != ("done",) else None
        return None

    def check_meant(self) -> None:
        """Report meanings of messages that are not responses."""
        for name, spec in self._file.messages.items():
            path = ("messages", name)
            if spec.means is not None and path not in self._meant:
                what = f"means has no effect: {name} is not the response of a command"
                needs = ((*path, "means"), ("commands",), ("defaults",))
                hint = "remove it, or let a command name it as its response"
                self._report.error(_RULE, (*path, "means"), what, hint, of_key=True, needs=needs)

    def _reply(self, name: str, message: Message, meaning: _Meaning, path: Path) -> Reply:
        """The reply that a message is."""
        spec = meaning.spec
        reply = Reply(
            name=name,
            message=message,
            means=spec.default or meaning.otherwise,
            switch=spec.switch or "",
            cases=tuple(self._cases(spec, message, (*path, "means"))),
            within=_allowance(meaning.within) if meaning.within else None,
            after=_allowance(meaning.after) if meaning.after else Allowance(),
        )
        times = {"within": ("pending", meaning.within), "after": ("again", meaning.after)}
        for key, (means, given) in times.items():
            if given is not None and means not in reply.meanings:
                what = f"{key} has no effect: {name} never means {means}"
                hint = f"remove it, or let it mean {means}"
                self._report.error(_RULE, (*path, key), what, hint, of_key=True)
        return reply

    def _cases(self, spec: MeansSpec, message: Message, path: Path) -> Iterator[Case]:
        if spec.switch is None:
            if spec.cases:
                what = "the cases have nothing to decide them"
                self._report.error(_RULE, (*path, "cases"), what, "add switch: FIELD", of_key=True)
            return
        number = self._switch(spec.switch, message, path)
        if number is None:
            return
        for key, means in spec.cases.items():
            raw = self._raw(key, number, (*path, "cases", str(key)))
            if raw is not None:
                first, last, name = raw
                yield Case(first, last, means, name)

    def _switch(self, name: str, message: Message, path: Path) -> Scalar | None:
        frame = self._frame
        frame = frame.carrying(message.id)[0].frame if isinstance(frame, FrameKinds) else frame
        every = frame.towards("response").values if isinstance(frame, DelimitedFrame) else ()
        known = {value.name: value.type for value in (*every, *message.values) if not value.field.conditional}
        place, needs = (*path, "switch"), ((*path, "switch"), (*path[:-1], "fields"), ("frame",))
        kind = known.get(name)
        if kind is None:
            hint = did_you_mean(name, known, f"its fields are {listed(known)}")
            what = f"the reply has no field {shown(name)}"
            self._report.error(_RULE, place, what, hint, needs=needs)
        elif not isinstance(kind, Scalar) or kind.scaling is not None or isinstance(kind.meaning, Float):
            what = f"{name} cannot decide what the reply means"
            self._report.error(_RULE, place, what, "use a whole number or an enum", needs=needs)
            return None
        return kind if isinstance(kind, Scalar) else None

    def _raw(self, key: str | int, number: Scalar, path: Path) -> tuple[int, int, str] | None:
        """The first and last raw value of a case, and its name."""
        named = number.meaning.members if isinstance(number.meaning, Enum) else ()
        members = {member.name: member.value for member in named}
        if key in members:
            return members[str(key)], members[str(key)], str(key)
        try:
            value = wanted(key)
        except ValueError:
            value = Wanted(str(key), name=str(key))
        if value.name:
            what = f"{shown(key)} is not a value of the field"
            hint = did_you_mean(str(key), members, "write a number, a range or a name")
            self._report.error(_RULE, path, what, hint, of_key=True)
            return None
        first, last = value.first, value.last
        if not number.minimum <= first <= last <= number.maximum:
            what = f"{shown(key)} is outside the range of the field"
            hint = f"use {number.minimum}..{number.maximum}"
            self._report.error(_RULE, path, what, hint, of_key=True)
            return None
        return first, last, ""


def _allowance(time: Duration) -> Allowance:
    return Allowance(time.byte_times, time.seconds)
