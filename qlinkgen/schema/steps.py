"""Second pass, steps: the frames of a dialogue after its request."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Literal

from qlinkgen.model.message import Message
from qlinkgen.model.transaction import Addressing, Allowance, Step
from qlinkgen.schema.file_commands import CommandSpec, StepMessageSpec, StepSpec
from qlinkgen.schema.file_fields import Fields
from qlinkgen.schema.file_model import SchemaFile
from qlinkgen.schema.kind_messages import AnyMessages
from qlinkgen.schema.kind_names import step_kind
from qlinkgen.schema.layouts import OwnStep, own_steps
from qlinkgen.schema.messages import Written
from qlinkgen.schema.notation import AnswerId, shown
from qlinkgen.schema.replies import written_replies
from qlinkgen.schema.report import Reporter, did_you_mean
from qlinkgen.schema.sizes import Sized, sized
from qlinkgen.schema.source import Path

_RULE = "bad-steps"
#: Their number is one byte in C.
_MOST = 250
#: The keys of a step and the messages of the command that they may name.
_OWN = {"send": "request", "receive": "response"}


def step_messages(file: SchemaFile) -> Iterator[tuple[str, Path]]:
    """Names and places of the messages of all steps that are not messages with another name."""
    for name, spec in file.commands.items():
        for step in own_steps(name, spec):
            yield f"{name}.{step.name}", step.path


def names_response(spec: CommandSpec) -> bool:
    """Whether a command has a response of its own, which a dialogue need not have."""
    return spec.steps is None or any(step.receive == _OWN["receive"] for step in spec.steps)


@dataclass(frozen=True, slots=True)
class Asked:
    """The command of a dialogue.

    Attributes:
        name: its name.
        spec: the command as written.
        request: its request.
        response: its response, None if its steps do not name it.
        addressing: the nodes that it may address.
    """

    name: str
    spec: CommandSpec
    request: Message
    response: Message | None
    addressing: Addressing

    @property
    def path(self) -> Path:
        """The place of the steps."""
        return ("commands", self.name, "steps")


class StepBuilder:
    """Builds the steps of commands."""

    def __init__(
        self,
        file: SchemaFile,
        report: Reporter,
        messages: AnyMessages,
        singles: Mapping[str, Message],
        sizes: dict[str, Sized],
    ) -> None:
        """``singles`` are the messages outside of commands, which steps may name.

        ``sizes`` takes the sizes of responses that earlier frames say, by command.
        """
        self._file = file
        self._report = report
        self._messages = messages
        self._singles = singles
        self._sizes = sizes
        #: Messages with a name that steps send.
        self._sent: set[str] = set()

    def build(self, asked: Asked) -> tuple[Step, ...]:
        """The steps of a command after its request."""
        if not asked.spec.steps:
            if asked.response is not None and self._messages.turned(asked.response):
                self._may_have(asked)  # the master waits for it as for that of a dialogue
            return ()
        if not self._may_have(asked):
            return ()
        self._check_names(asked)
        own = {step.path[-1]: step for step in own_steps(asked.name, asked.spec)}
        found: list[Step] = []
        frames = {"request": asked.request}
        for index, spec in enumerate(asked.spec.steps):
            if index == 0 and spec.send == _OWN["send"]:
                self._check_time(spec, asked.path, index)
                continue
            step = self._step(asked, spec, own.get(index), (*asked.path, index), frames)
            if step is not None:
                found.append(step)
                if step.sent and index in own:
                    frames[own[index].name] = step.message
        begun = asked.spec.steps[0].send == _OWN["send"]
        if len(found) == len(asked.spec.steps) - begun:  # otherwise a wrong one is missing
            self._check_order(asked, found)
        return tuple(found)

    def _error(self, path: Path, what: str, hint: str, *more: Path) -> None:
        self._report.error(_RULE, path, what, hint, needs=(path, *more))

    def _may_have(self, asked: Asked) -> bool:
        """Whether a command may have steps; reports why not."""
        several = asked.addressing not in ("node", "none")
        spec, path = asked.spec, asked.path if asked.spec.steps else (*asked.path[:-1], "response")
        echo = ", ".join(self._messages.numbered)
        faults = {
            "many": (spec.many is not None, "it has several answers", "write each as a step, or remove many"),
            "addressing": (several, "it may be broadcast", "use addressing: node"),
            "bus": (
                self._file.bus.kind in ("ring", "host"),
                "its bus has no master",
                "use kind: master_slave",
            ),
            "frame": (
                self._file.frame.parts is None and not self._file.frames,
                "its frame has no parts",
                "describe a frame with parts",
            ),
            "echo": (bool(echo), f"answers repeat the {echo} of one request", "remove echo from the part"),
            "in_flight": (
                (spec.in_flight or 1) > 1,
                "it may have several requests at once",
                "remove in_flight",
            ),
        }
        for key, (wrong, why, hint) in faults.items():
            if wrong:
                needs = (path, (key,) if key in ("bus", "frame") else (*path[:-1], key), ("frame",))
                what = f"{asked.name} cannot be a dialogue of several frames: {why}"
                if not asked.spec.steps:
                    what = f"only its turn tells the response of {asked.name}, which it cannot: {why}"
                self._report.error(_RULE, path, what, hint, of_key=True, needs=needs)
                return False
        return True

    def _check_names(self, asked: Asked) -> None:
        taken = {"request": "the request", "response": "the response"}
        taken |= {each.name: f"the reply {each.name}" for each in written_replies(self._file, asked.name)}
        for step in own_steps(asked.name, asked.spec):
            if step.name in taken:
                what = f"the step {step.name} is called like {taken[step.name]}"
                self._error(step.path, what, "give it another name", asked.path)
            taken[step.name] = "another step"

    def _check_time(self, spec: StepSpec, path: Path, index: int) -> None:
        if spec.within is not None:
            self._error((*path, index, "within"), "within has no effect: nothing precedes it", "remove it")

    def _step(
        self, asked: Asked, spec: StepSpec, own: OwnStep | None, path: Path, frames: Mapping[str, Message]
    ) -> Step | None:
        given = {
            key: each for key, each in (("send", spec.send), ("receive", spec.receive)) if each is not None
        }
        if len(given) != 1:
            self._error(path, f"a step has {len(given)} frames, not one", "write one of send and receive")
            return None
        [(key, written)] = given.items()
        within = Allowance(spec.within.byte_times, spec.within.seconds) if spec.within else None
        sent = key == "send"
        if isinstance(written, str):
            message = self._named(asked, key, written, (*path, key))
            if spec.name is not None:
                what = f"{spec.name} is the name of a message that has one, {written}"
                self._error((*path, "name"), what, "remove it", path)
        else:
            message = self._inline(asked, own, frames, sent=sent) if own else None
        if message is None:
            return None
        turned = self._messages.turned(message)
        if within is None and (not sent or turned):
            limit = asked.spec.response_within or self._file.bus.response_within
            within = Allowance(limit.byte_times, limit.seconds) if limit else Allowance()
            if turned and sent and not limit:
                what = f"{message.name} is told by its turn, and nothing else ends the wait for it"
                self._error(path, what, "add within: 1 s, or response_within to the bus")
        return Step(message, sent, within)

    def _inline(self, asked: Asked, step: OwnStep, frames: Mapping[str, Message], *, sent: bool) -> Message:
        number = AnswerId(0, relative=True)
        place: Path = ("commands", asked.name, "id")
        if isinstance(step.message, StepMessageSpec) and step.message.id is not None:
            number, place = step.message.id, (*step.path, step.key, "id")
        fields: Fields = step.fields
        items: set[str] = set()
        if step.last:
            self._sizes[asked.name] = found = sized(fields, frames, step.fields_path, self._report)
            fields, items = found.fields, {name for name, _ in found.sizes}
        own = step.message if isinstance(step.message, StepMessageSpec) else StepMessageSpec(fields={})
        layout = Written(
            step.name,
            number.of(asked.spec.id),
            place,
            fields,
            step.fields_path,
            items,
            asked.spec.separator if own.separator is None else own.separator,
            kind=step_kind(self._file, own.frame, asked.spec),
            inherited=number.relative,
        )
        direction: Literal["request", "response"] = "request" if sent else "response"
        return self._messages.reply(
            asked.name, step.spec, layout, addressing=asked.addressing, direction=direction
        )

    def _named(self, asked: Asked, key: str, name: str, path: Path) -> Message | None:
        """The message that a step names."""
        if name == _OWN[key]:
            if key == "send":
                self._error(path, "the request is not the first step", "move it to the beginning")
            return asked.response if key == "receive" else None
        message = self._singles.get(name)
        if message is None:
            known = [_OWN[key], *self._singles]
            hint = did_you_mean(name, known, "write fields, or the name of a message")
            needs = (path, ("messages", name))
            self._report.error("unknown-message", path, f"unknown message {shown(name)}", hint, needs=needs)
            return None
        side, direction = ("masters", "request") if key == "send" else ("slaves", "response")
        if message.direction != direction:
            what = f"{name} is not sent by {side}"
            self._error(path, what, f"give it direction: {direction}", ("messages", name))
        return message

    def _check_order(self, asked: Asked, steps: list[Step]) -> None:
        """Check that there is an answer, and that the response is the last one."""
        received = [step.message for step in steps if not step.sent]
        sent = [step.message.name for step in steps if step.sent]
        twice = next((name for name in sent if sent.count(name) > 1 or name in self._sent), None)
        self._sent |= {*sent}
        if twice is not None:
            what = f"{twice} is sent in two steps, which a slave tells by their messages"
            self._report.error(_RULE, asked.path, what, "write its fields in each of them", of_key=True)
        elif len(steps) > _MOST:
            what = f"{asked.name} has {len(steps)} steps"
            self._report.error(_RULE, asked.path, what, f"use at most {_MOST}", of_key=True)
        elif not received:
            what = f"{asked.name} receives nothing"
            self._report.error(_RULE, asked.path, what, "add a step with receive", of_key=True)
        elif asked.spec.response is not None and received[-1] is not asked.response:
            what = f"the response of {asked.name} is not its last answer"
            hint = "let the last step that receives be {receive: response}, or remove the response"
            self._report.error(_RULE, asked.path, what, hint, of_key=True, needs=(asked.path,))
