"""The schema file format: commands and messages, responses and other answers."""

from __future__ import annotations

import re
from collections.abc import Mapping
from typing import Annotated, Literal, get_args

from pydantic import (
    BaseModel,
    BeforeValidator,
    ConfigDict,
    Discriminator,
    Field,
    GetJsonSchemaHandler,
    StrictBool,
    StrictInt,
    Tag,
)
from pydantic.json_schema import JsonSchemaValue
from pydantic_core import CoreSchema

from qlinkgen.schema.file_base import BRANCH, Fact, FileMapping, Lifetime
from qlinkgen.schema.file_fields import Fields
from qlinkgen.schema.kinds import (
    AnswerNumber,
    AnyCondition,
    ByteText,
    Count,
    Id,
    Label,
    Name,
    Separator,
    ShortForm,
    Text,
    TextId,
    Time,
    Values,
)
from qlinkgen.schema.notation import answer_id, shown


class RepeatSpec(FileMapping):
    """Whether a request may be repeated."""

    safe: StrictBool = Field(default=True, description="Repeating the request is harmless")
    counter: str | None = Field(
        default=None, description="Field that distinguishes a repeat from a new request"
    )


def _repeat(value: object) -> object:
    if isinstance(value, dict | BaseModel):
        return value
    if value in ("safe", "unsafe"):
        return {"safe": value == "safe"}
    raise ValueError(
        f"{shown(value)} does not state whether a repeat is safe; use safe, unsafe or {{counter: FIELD}}"
    )


class _RepeatForms:
    """Adds the short form to the JSON Schema."""

    @staticmethod
    def __get_pydantic_json_schema__(core: CoreSchema, handler: GetJsonSchemaHandler) -> JsonSchemaValue:
        return {"anyOf": [{"enum": ["safe", "unsafe"]}, handler(core)]}


Repeat = Annotated[RepeatSpec, BeforeValidator(_repeat), _RepeatForms]
Addressing = Literal["node", "broadcast", "either", "answered_broadcast", "none"]
#: "none", or the name of a message that is the response.
ResponseWord = str


Means = Literal["refused", "again", "pending", "done"]


class MeansSpec(FileMapping):
    """What an answer means, decided by one of its fields."""

    switch: str | None = Field(default=None, description="Field that decides")
    cases: dict[str | StrictInt, Means] = Field(
        default_factory=dict, description="Meaning by value: a number, a range first..last, or a name"
    )
    default: Means | None = Field(
        default=None, description="Meaning of all other values; default: refused, of a response done"
    )


class AnswerSpec(FileMapping):
    """The long form of a response: its number and its fields."""

    frame: Name | None = Field(default=None, description="Kind of its frame, if there are several")
    id: AnswerNumber | None = Field(default=None, description="Its number, if it is not that of the request")
    separator: Separator | None = Field(
        default=None, description="Character between its fields, if it is not that of the command; none: none"
    )
    fields: Fields | None = Field(default=None, description="Its fields, in wire order")
    means: Annotated[MeansSpec, ShortForm("default", "string")] | None = Field(
        default=None, description="What it means, if one of its fields may refuse the request"
    )
    within: Time | None = Field(
        default=None, description="Time from a pending answer to the last one; default: that of the response"
    )
    after: Time | None = Field(
        default=None, description="Pause before the request is sent again; default: none"
    )


def _is_long(value: Mapping[str, object]) -> bool:
    """Whether a response has the long form: its fields, or only its keys, and values that no field has."""
    fields = value.get("fields")
    if isinstance(fields, dict) and not fields.keys() & {"type", "switch"}:
        return True
    if not value or not value.keys() <= AnswerSpec.model_fields.keys():
        return False
    if "fields" in value:
        return isinstance(value["fields"], dict)
    return _is_means(value["means"]) if "means" in value else _is_answer_id(value.get("id"))


def _is_means(value: object) -> bool:
    if isinstance(value, dict):
        return value.keys() <= MeansSpec.model_fields.keys()
    return value in get_args(Means)


def _is_answer_id(value: object) -> bool:
    try:
        answer_id(value)
    except ValueError:
        return False
    return True


class _AnyForm:
    """Lets an editor accept a mapping that has two forms at once, such as an empty one."""

    @staticmethod
    def __get_pydantic_json_schema__(core: CoreSchema, handler: GetJsonSchemaHandler) -> JsonSchemaValue:
        found = handler(core)
        return {"anyOf": found["oneOf"]} if "oneOf" in found else found


def _response_form(value: object) -> str:
    if isinstance(value, str):
        return f"{BRANCH}word"
    long = isinstance(value, AnswerSpec) or (isinstance(value, dict) and _is_long(value))
    return f"{BRANCH}long" if long else f"{BRANCH}fields"


Response = Annotated[
    Annotated[Fields, Tag(f"{BRANCH}fields")]
    | Annotated[AnswerSpec, Tag(f"{BRANCH}long")]
    | Annotated[ResponseWord, Tag(f"{BRANCH}word")],
    Discriminator(_response_form),
    _AnyForm,
]


class StepMessageSpec(FileMapping):
    """The long form of a message of a dialogue: its number and its fields."""

    frame: Name | None = Field(default=None, description="Kind of its frame, if there are several")
    id: AnswerNumber | None = Field(default=None, description="Its number, if it is not that of the request")
    separator: Separator | None = Field(
        default=None, description="Character between its fields, if it is not that of the command; none: none"
    )
    fields: Fields = Field(description="Its fields, in wire order")


def _step_form(value: object) -> str:
    if isinstance(value, str):
        return f"{BRANCH}word"
    long = isinstance(value, StepMessageSpec) or (
        isinstance(value, dict)
        and value.keys() <= StepMessageSpec.model_fields.keys()
        and (isinstance(value.get("fields"), dict) or _is_answer_id(value.get("id")))
    )
    return f"{BRANCH}long" if long else f"{BRANCH}fields"


StepMessage = Annotated[
    Annotated[Fields, Tag(f"{BRANCH}fields")]
    | Annotated[StepMessageSpec, Tag(f"{BRANCH}long")]
    | Annotated[str, Tag(f"{BRANCH}word")],
    Discriminator(_step_form),
    _AnyForm,
]


class StepSpec(Fact):
    """A frame of a dialogue: exactly one of send and receive."""

    name: Name | None = Field(default=None, description="Its name; default: step_ and its place in the list")
    send: StepMessage | None = Field(
        default=None, description="Sent by the master: request, the name of a message, or {id:, fields:}"
    )
    receive: StepMessage | None = Field(
        default=None, description="Sent by the slave: response, the name of a message, or {id:, fields:}"
    )
    within: Time | None = Field(
        default=None, description="Time limit; default: that of the response, and none for the master"
    )


def _count_form(value: object) -> object:
    """A number, or ``request.FIELD`` as the name of the field."""
    if isinstance(value, str) and (match := re.fullmatch(r"\s*request\.(\w+)\s*", value, re.ASCII)):
        return match[1]
    if isinstance(value, int) and not isinstance(value, bool) and value > 0:
        return value
    raise ValueError(f"{shown(value)} is not a number of answers; write 8 or request.FIELD")


def _each_form(value: object) -> object:
    """``request.LIST`` or ``request.LIST.FIELD``, without the first word."""
    if isinstance(value, str) and (match := re.fullmatch(r"\s*request\.(\w+(?:\.\w+)?)\s*", value, re.ASCII)):
        return match[1]
    raise ValueError(f"{shown(value)} is not a list of nodes; write request.LIST, or request.LIST.FIELD")


class ManySpec(FileMapping):
    """The end of several answers to one request: exactly one of its keys, but for what is said of two."""

    count: Annotated[int | str, BeforeValidator(_count_form)] | None = Field(
        default=None, description="Number of answers: 8, or request.FIELD"
    )
    until: str | dict[str, str | StrictInt] | None = Field(
        default=None,
        description="{FIELD: value} of the last answer, a reply after it, or a command that stops them",
    )
    within: Time | None = Field(
        default=None,
        description="Time in which answers come; with a command that stops them: from one answer to the next",
    )
    each: Annotated[str, BeforeValidator(_each_form)] | None = Field(
        default=None,
        description="Each node in a list of the request answers: request.LIST or request.LIST.FIELD",
    )
    by: Name | None = Field(
        default=None, description="With each: value of an answer that is its node; default: the address"
    )


class ReplySpec(Fact):
    """An answer other than the response."""

    frame: Name | None = Field(default=None, description="Kind of its frame, if there are several")
    id: AnswerNumber | None = Field(default=None, description="Its number: 0x15 or request.id + 0x80")
    separator: Separator | None = Field(
        default=None, description="Character between the fields, which are texts; none: there is none"
    )
    when: AnyCondition | None = Field(
        default=None,
        alias="if",
        description="What picks it: a value of the direction, of the frame, or of a field of the response",
    )
    fields: Fields = Field(description="Its fields, in wire order")
    means: Annotated[MeansSpec, ShortForm("default", "string")] = Field(
        default_factory=MeansSpec, description="refused, again, pending or done; or by a field"
    )
    within: Time | None = Field(
        default=None, description="Time from a pending reply to the answer; default: that of the response"
    )
    after: Time | None = Field(
        default=None, description="Pause before the request is sent again; default: none"
    )


Replies = dict[str, ReplySpec]


def _id_form(value: object) -> str:
    if isinstance(value, dict):
        return f"{BRANCH}parts"
    return f"{BRANCH}text" if isinstance(value, str) else f"{BRANCH}number"


MessageId = Annotated[
    Annotated[dict[str, TextId | Id], Tag(f"{BRANCH}parts")]
    | Annotated[TextId, Tag(f"{BRANCH}text")]
    | Annotated[Id, Tag(f"{BRANCH}number")],
    Discriminator(_id_form),
]


class DefaultsSpec(FileMapping):
    """Defaults for commands."""

    frame: Name | None = Field(
        default=None, description="Kind of the frames, unless request or response name another"
    )
    section: Text | None = Field(default=None, description="Section of the source document")
    request: Fields | None = Field(default=None, description="Fields of the request, {} for none")
    response: Response | None = Field(
        default=None,
        description="Fields, {} for an empty one, {id:, fields:}, the name of a message, or none",
    )
    separator: Separator | None = Field(
        default=None, description="Character between the fields, which are texts; none: there is none"
    )
    addressing: Addressing | None = Field(
        default=None, description="Nodes addressed, and which of them respond"
    )
    repeat: Repeat | None = Field(default=None, description="Whether a request may be repeated")
    in_flight: Count | None = Field(default=None, description="Maximum number of outstanding requests")
    side: Name | None = Field(
        default=None, alias="from", description="The side of a link that asks, or either; default: the first"
    )
    attributes: dict[str, Label] = Field(default_factory=dict, description="Values of declared attributes")


class ExampleSpec(FileMapping):
    """A frame of the source document, and what it says."""

    model_config = ConfigDict(extra="allow", frozen=True, arbitrary_types_allowed=True)

    wire: ByteText = Field(description="All bytes of the frame, as sent")
    after: ByteText = Field(
        default=b"", description="The request that it answers, if its meaning depends on that"
    )
    request: Values | None = Field(default=None, description="Values of the request, if it is one")
    response: Values | None = Field(default=None, description="Values of the response, if it is one")
    fields: Values | None = Field(default=None, description="Values of a message without a response")
    decode_only: StrictBool = Field(
        default=False, description="true: legal, but an encoder sends other bytes for these values"
    )

    @property
    def parts(self) -> Mapping[str, object]:
        """The values in its header, such as the address."""
        return self.model_extra or {}


class CommandSpec(Fact, Lifetime):
    """A transaction: request, response and their conditions."""

    restart: Id | None = Field(
        default=None, description="Number of the next request to the node, if frames have a counter"
    )

    frame: Name | None = Field(
        default=None, description="Kind of its frames, unless the response names another"
    )
    section: Text | None = Field(  # type: ignore[assignment]  # None: that of `defaults`
        default=None, description="Section of the source document that states it"
    )
    id: MessageId | None = Field(
        default=None, description="Its number in the frame; PART: NUMBER for each part, if there are several"
    )
    request: Fields | None = Field(default=None, description="Fields of the request, {} for none")
    response: Response | None = Field(
        default=None,
        description="Fields, {} for an empty one, {id:, fields:}, the name of a message, or none",
    )
    separator: Separator | None = Field(
        default=None, description="Character between the fields, which are texts; none: there is none"
    )
    replies: Replies = Field(
        default_factory=dict, description="Answers other than the response; they replace those of the file"
    )
    many: ManySpec | None = Field(default=None, description="Several answers come, until this end")
    steps: list[StepSpec] | None = Field(
        default=None, min_length=1, description="Frames after the request, in their order: a dialogue"
    )
    empty_request: Literal["defaults"] | None = Field(
        default=None, description="defaults: an empty payload is a request with every field at its default"
    )
    addressing: Addressing | None = Field(
        default=None, description="Nodes addressed, and which of them respond"
    )
    response_within: Time | None = Field(default=None, description="Overrides the time limit of the bus")
    repeat: Repeat | None = Field(default=None, description="Whether a request may be repeated")
    in_flight: Count | None = Field(default=None, description="Maximum number of outstanding requests")
    side: Name | None = Field(
        default=None, alias="from", description="The side of a link that asks, or either; default: the first"
    )
    attributes: dict[str, Label] = Field(default_factory=dict, description="Values of declared attributes")
    examples: list[ExampleSpec] = Field(default_factory=list, description="Frames of the source document")


class MessageSpec(Fact, Lifetime):
    """A message without a response."""

    frame: Name | None = Field(default=None, description="Kind of its frame, if there are several")
    id: MessageId | None = Field(
        default=None, description="Its number in the frame; PART: NUMBER for each part, if there are several"
    )
    separator: Separator | None = Field(
        default=None, description="Character between the fields, which are texts; none: there is none"
    )
    fields: Fields = Field(description="Its fields, in wire order")
    direction: Literal["request", "response"] | None = Field(
        default=None, description="Direction of the message; default: any node sends it"
    )
    side: Name | None = Field(default=None, alias="from", description="The side of a link that sends it")
    means: Annotated[MeansSpec, ShortForm("default", "string")] | None = Field(
        default=None, description="What it means as a response, if one of its fields may refuse the request"
    )
    within: Time | None = Field(
        default=None, description="Time from a pending answer to the last one; default: that of the response"
    )
    after: Time | None = Field(
        default=None, description="Pause before the request is sent again; default: none"
    )
    examples: list[ExampleSpec] = Field(default_factory=list, description="Frames of the source document")
    attributes: dict[str, Label] = Field(default_factory=dict, description="Values of declared attributes")
