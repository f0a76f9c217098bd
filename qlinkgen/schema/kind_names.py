"""Which kind of frame commands and messages name, and which one each message has."""

from __future__ import annotations

from collections.abc import Iterator

from qlinkgen.schema.file_commands import AnswerSpec, CommandSpec, ReplySpec, StepMessageSpec
from qlinkgen.schema.file_model import SchemaFile
from qlinkgen.schema.notation import shown
from qlinkgen.schema.report import Reporter, did_you_mean, listed
from qlinkgen.schema.source import Path

_RULE = "bad-kinds"


def named_kinds(file: SchemaFile) -> Iterator[tuple[str, Path]]:
    """The names of kinds that commands and messages state, with their places."""
    answers: list[tuple[object, Path]] = [(file.defaults.response, ("defaults", "response"))]
    answers += [(spec.response, ("commands", name, "response")) for name, spec in file.commands.items()]
    stated: list[tuple[str | None, Path]] = [(file.defaults.frame, ("defaults",))]
    stated += [(spec.frame, path) for spec, path in answers if isinstance(spec, AnswerSpec)]
    for group in ("replies", "commands", "messages"):
        stated += [(spec.frame, (group, name)) for name, spec in getattr(file, group).items()]
    for name, command in file.commands.items():
        path: Path = ("commands", name)
        stated += [(spec.frame, (*path, "replies", key)) for key, spec in command.replies.items()]
        for index, step in enumerate(command.steps or ()):
            for key, message in (("send", step.send), ("receive", step.receive)):
                if isinstance(message, StepMessageSpec):
                    stated.append((message.frame, (*path, "steps", index, key)))
    yield from ((kind, (*path, "frame")) for kind, path in stated if kind is not None)


def response_kind(file: SchemaFile, command: CommandSpec) -> str | None:
    """The kind of frame of the response to a command: the nearest that is stated, None if none is."""
    own, common = command.response, file.defaults.response
    return _nearest(
        own.frame if isinstance(own, AnswerSpec) else None,
        command.frame,
        common.frame if isinstance(common, AnswerSpec) else None,
        file.defaults.frame,
    )


def reply_kind(file: SchemaFile, reply: ReplySpec, command: CommandSpec | None) -> str | None:
    """The kind of a reply; ``command`` is None for one of all commands."""
    common = file.defaults.response
    return _nearest(
        reply.frame,
        command.frame if command else None,
        common.frame if isinstance(common, AnswerSpec) else None,
        file.defaults.frame,
    )


def step_kind(file: SchemaFile, own: str | None, command: CommandSpec) -> str | None:
    """The kind of a frame of a dialogue after its request, which states ``own``."""
    return _nearest(own, command.frame, file.defaults.frame)


def message_kind(file: SchemaFile, own: str | None) -> str | None:
    """The kind of a request, or of a message outside transactions, which states ``own``."""
    return _nearest(own, file.defaults.frame)


def _nearest(*stated: str | None) -> str | None:
    return next((kind for kind in stated if kind is not None), None)


def check_kind_names(file: SchemaFile, report: Reporter) -> None:
    """Check that the kinds of frame that commands and messages name exist."""
    for name, path in named_kinds(file):
        if name not in file.frames:
            hint = did_you_mean(name, file.frames, f"the kinds are {listed(file.frames)}")
            if not file.frames:
                hint = "remove it; the protocol has one kind of frame"
            report.error(_RULE, path, f"unknown kind of frame {shown(name)}", hint)
