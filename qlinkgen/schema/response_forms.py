"""Replies that a value picks: another form of each response, written once.

Such a reply has an ``if`` on a value of every frame, or on a field of the responses. Where it holds, a
response has the fields of the reply in place of its own: both become fields of the response, with opposite
conditions.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import replace
from typing import NamedTuple

from qlinkgen.schema.file_commands import AnswerSpec, CommandSpec, Means, MeansSpec, Replies, ReplySpec
from qlinkgen.schema.file_fields import Fields, FieldSpec
from qlinkgen.schema.file_model import SchemaFile
from qlinkgen.schema.notation import TestText, Wanted
from qlinkgen.schema.report import Reporter
from qlinkgen.schema.source import Path

_RULE = "bad-reply"


def with_forms(file: SchemaFile, report: Reporter) -> SchemaFile:
    """The file without such replies, and with their fields in responses."""
    beside = {*_frame_values(file)}
    several = {name: _Command(file, name, beside, report) for name in file.commands}
    commands = {name: each.rewritten() for name, each in several.items()}
    if all(commands[name] is spec for name, spec in file.commands.items()):
        return file
    known = beside.union(*(each.fields for each in several.values()))
    left = {name: spec for name, spec in file.replies.items() if not _picked(spec, known)}
    return file.model_copy(update={"commands": commands, "replies": left})


def _frame_values(file: SchemaFile) -> Iterator[str]:
    """Names of parts and bits of frames that may hold a value."""
    frames = [file.frame.parts or {}, *(kind.parts for kind in file.frames.values())]
    for name, part in (each for parts in frames for each in parts.items()):
        if part.told == "value":
            yield name
        yield from (inner for inner, bits in (part.bits or {}).items() if bits.role is None)


def _test(spec: ReplySpec) -> TestText | None:
    """What picks a reply, None if nothing or more than one value does."""
    return spec.when[0] if spec.when is not None and len(spec.when) == 1 else None


def _picked(spec: ReplySpec, values: set[str]) -> bool:
    """Whether a value picks a reply."""
    test = _test(spec)
    return test is not None and test.field.rpartition(".")[2] in values


class _Form(NamedTuple):
    """A reply that is a form of the response: its name, its mapping, its place and what picks it."""

    name: str
    spec: ReplySpec
    path: Path
    test: TestText


class _Command:
    """Rewrites one command."""

    def __init__(self, file: SchemaFile, name: str, beside: set[str], report: Reporter) -> None:
        """``beside`` are names of values of the frame."""
        self._file, self._name, self._beside, self._report = file, name, beside, report
        self._spec = file.commands[name]

    def rewritten(self) -> CommandSpec:
        """The command, with the forms among its response."""
        answer, path = self._response()
        fields = answer.fields or {}
        values = self._beside | set(fields)
        forms = [each for each in self._written() if _picked(each.spec, values)]
        own = {each.name for each in forms}
        left: Replies = {name: each for name, each in self._spec.replies.items() if name not in own}
        if not forms:
            return self._spec
        if self._spec.response == "none" or (self._spec.response is None and answer.fields is None):
            return self._spec.model_copy(update={"replies": left})
        if isinstance(self._spec.response, str):
            what = f"the response of {self._name} is a message, which cannot have the form {forms[0].name}"
            hint = "give the message these fields, with an if"
            place = ("commands", self._name, "response")
            self._report.error(_RULE, place, what, hint, needs=(place, forms[0].path))
            return self._spec.model_copy(update={"replies": left})
        target: Path = ("commands", self._name, "response", "fields")
        for name in fields:
            self._report.move((*target, name), (*path, name))
        for form in forms:
            fields = self._joined(fields, form, target)
        means = answer.means
        if means is None and self._common is None:
            means = self._means(forms)
            self._report.move((*target[:-1], "means"), (*forms[0].path, "if"))
        within = next((each.spec.within for each in forms if each.spec.within), answer.within)
        after = next((each.spec.after for each in forms if each.spec.after), answer.after)
        changed = {"fields": fields, "means": means, "within": within, "after": after}
        return self._spec.model_copy(
            update={"replies": left, "response": answer.model_copy(update=changed)},
        )

    @property
    def fields(self) -> Fields:
        """The fields of its response."""
        return self._response()[0].fields or {}

    @property
    def _common(self) -> MeansSpec | None:
        """What responses mean by default."""
        common = self._file.defaults.response
        return common.means if isinstance(common, AnswerSpec) else None

    def _response(self) -> tuple[AnswerSpec, Path]:
        """The response in its long form, and the place of its fields."""
        own: Path = ("commands", self._name, "response")
        stated = self._spec.response
        if isinstance(stated, AnswerSpec):
            return stated, (*own, "fields")
        if isinstance(stated, Mapping):
            return AnswerSpec(fields=stated), own
        common = self._file.defaults.response
        if isinstance(common, AnswerSpec):
            return AnswerSpec(fields=common.fields), ("defaults", "response", "fields")
        fields = common if isinstance(common, Mapping) and stated is None else None
        return AnswerSpec(fields=fields), ("defaults", "response")

    def _written(self) -> Iterator[_Form]:
        """The replies of the command with a condition, those of the file first."""
        own = self._spec.replies
        every: list[tuple[str, ReplySpec, Path]] = [
            (name, spec, ("replies", name)) for name, spec in self._file.replies.items() if name not in own
        ]
        every += [(name, spec, ("commands", self._name, "replies", name)) for name, spec in own.items()]
        for name, spec, path in every:
            test = _test(spec)
            if test is not None and spec.id is None and spec.frame is None:
                yield _Form(name, spec, path, test)

    def _joined(self, fields: Fields, form: _Form, target: Path) -> Fields:
        """The fields of a response so far, and those of another form of it."""
        owner = form.test.field.partition(".")[0]
        names = list(fields)
        before = names.index(owner) + 1 if owner in fields else 0
        given = list(form.spec.fields.items())
        while given and before < len(names) and given[0] == (names[before], fields[names[before]]):
            before, given = before + 1, given[1:]
        both = {name: fields[name] for name in names[:before]}
        given = [each for each in given if each not in both.items()]
        reverse = replace(form.test, negated=not form.test.negated)
        found = dict(list(fields.items())[:before])
        for name in names[before:]:
            found[name] = _with(fields[name], reverse) if name in self.fields else fields[name]
            if name in self.fields and fields[name].when is None:
                self._report.move((*target, name, "if"), (*form.path, "if"))
        for name, spec in given:
            if name in found:
                what = f"{name} is a field of the response of {self._name}, and another one of {form.name}"
                hint = "rename one of them; or let both forms begin with the same fields"
                place = (*form.path, "fields", name)
                self._report.error("name-clash", place, what, hint, of_key=True)
                continue
            found[name] = _with(spec, form.test)
            self._report.move((*target, name), (*form.path, "fields", name))
            self._report.move((*target, name, "if"), (*form.path, "if"))
        return found

    def _means(self, forms: list[_Form]) -> MeansSpec | None:
        """What the response means, by the value that picks its form."""
        first, *others = forms
        same = all(each.test.field == first.test.field and not each.test.negated for each in others)
        if not same or (others and first.test.negated) or any(each.spec.means.switch for each in forms):
            what = f"what the response of {self._name} means follows from more than one value"
            hint = "add means to the response"
            self._report.error(_RULE, (*first.path, "means"), what, hint, needs=(first.path,))
            return None
        default: Means = "done"
        cases: dict[str | int, Means] = {}
        for each in forms:
            means = each.spec.means.default or "refused"
            default = means if each.test.negated else default
            cases |= {_key(value): "done" if each.test.negated else means for value in each.test.wanted}
        return MeansSpec(switch=first.test.field.rpartition(".")[2], cases=cases, default=default)


def _with(spec: FieldSpec, test: TestText) -> FieldSpec:
    """A field with one more condition, before its own: the last test of a case tells it from others."""
    return spec.model_copy(update={"when": (test, *(spec.when or ()))})


def _key(value: Wanted) -> str | int:
    """A value as the case of a choice."""
    if value.name:
        return value.name
    return value.first if value.first == value.last else f"{value.first}..{value.last}"
