"""The file format, as it is written: one class for each mapping, one attribute for each key.

Checks what a mapping may hold; what the parts mean together is checked while the model is built from them.
The editors' JSON Schema is generated from these classes, so every description here is shown while typing.
"""

from __future__ import annotations

from typing import Annotated, Literal

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

from qlinkgen.schema.kinds import (
    AnyRange,
    ByteText,
    Count,
    Id,
    Label,
    Name,
    Order,
    Rational,
    ScalarValue,
    ShortForm,
    Text,
    Time,
    WholeRange,
)
from qlinkgen.schema.notation import shown

#: Marks the branches of a union in the place of a fault; no key of a file can begin so.
BRANCH = "\0"


class _Mapping(BaseModel):
    model_config = ConfigDict(extra="forbid", frozen=True, arbitrary_types_allowed=True)


class Fact(_Mapping):
    """Something that the source document states."""

    doc: Text = Field(default="", description="What it is, in one sentence")
    section: Text = Field(default="", description="Section of the source document that states it")
    confirmed: StrictBool = Field(default=True, description="false: the source is weak; users are warned")


class ProtocolSpec(_Mapping):
    """Who and what the protocol is."""

    name: Name = Field(description="Prefix of everything generated")
    title: Text = Field(default="", description="Name for people")
    revision: Text = Field(description="Revision of the source document")
    source: Text = Field(description="The document that was read")
    doc: Text = Field(default="", description="What the protocol is for")


class GroupSpec(_Mapping):
    """Integers sent in groups of less than eight bits, one group a byte."""

    bits: Annotated[StrictInt, Field(ge=1, le=7)] = Field(description="Bits of a group")
    first: Literal["least", "most"] = Field(description="Which group of a number is sent first")


class EnumValueSpec(_Mapping):
    """A named number."""

    value: StrictInt = Field(description="The number")
    doc: Text = Field(default="", description="What it is, in one sentence")


class EnumSpec(Fact):
    """Named numbers of one integer type."""

    type: str = Field(description="Integer type that carries it")
    values: dict[str, Annotated[EnumValueSpec, ShortForm("value", "integer")]] = Field(
        min_length=1, description="Name: number"
    )


class FlagSpec(_Mapping):
    """A named bit."""

    bit: Id = Field(description="Number of the bit, 0 is the least significant")
    doc: Text = Field(default="", description="What it is, in one sentence")


class FlagsSpec(Fact):
    """Named bits of one integer type."""

    type: str = Field(description="Integer type that carries them")
    values: dict[str, Annotated[FlagSpec, ShortForm("bit", "integer")]] = Field(
        min_length=1, description="Name: number"
    )
    reserved: Literal["keep", "zero"] = Field(
        default="keep", description="Bits without a name: kept as they are, or an error unless zero"
    )


class BitSpec(_Mapping):
    """A run of bits inside an integer."""

    at: WholeRange = Field(description="Bit, or first..last bit; 0 is the least significant")
    type: str | None = Field(
        default=None, description="bool, or the name of an enum or flags; an unsigned number if absent"
    )
    signed: StrictBool = Field(default=False, description="The number is a two's complement")
    scale: Rational | None = Field(default=None, description="Value of one step in the unit")
    offset: Rational | None = Field(default=None, description="Value of raw 0 in the unit")
    unit: Text = Field(default="", description="Unit of the value")
    range: AnyRange | None = Field(default=None, description="Legal values, in the unit")
    raw_range: AnyRange | None = Field(default=None, description="Legal values, as integers on the wire")
    default: ScalarValue | None = Field(default=None, description="Value where none is given, in the unit")
    doc: Text = Field(default="", description="What it is, in one sentence")


class FieldSpec(Fact):
    """A field of a message, or a named type that fields can have."""

    type: str = Field(description="u8-u64, i8-i64, bool, fixed32.32, bytes[..], text[..], u16[..] or a name")
    byteorder: Order | None = Field(default=None, description="Where it differs from the file's")
    groups: GroupSpec | None = Field(default=None, description="Sent in groups of less than eight bits")
    parts: list[WholeRange] | None = Field(
        default=None, description="Bit ranges in wire order, each begins a new byte"
    )
    scale: Rational | None = Field(default=None, description="Value of one step in the unit")
    offset: Rational | None = Field(default=None, description="Value of raw 0 in the unit")
    unit: Text | None = Field(default=None, description="Unit of the value")
    range: AnyRange | None = Field(default=None, description="Legal values, in the unit")
    raw_range: AnyRange | None = Field(default=None, description="Legal values, as integers on the wire")
    default: ScalarValue | None = Field(default=None, description="Value where none is given, in the unit")
    const: ScalarValue | None = Field(default=None, description="Always sent, and demanded when received")
    reserved: StrictBool = Field(default=False, description="Sent as zero (or const), ignored when received")
    counts: str | None = Field(
        default=None, description="Field of variable size whose length this one carries"
    )
    counts_in: Literal["items", "bytes"] = Field(default="items", description="What is counted")
    echo: StrictBool = Field(
        default=False, description="In a response: repeats the field of the same name of the request"
    )
    bits: dict[str, Annotated[BitSpec, ShortForm("at", "integer", "string")]] | None = Field(
        default=None, description="Fields inside the integer"
    )


ShortField = Annotated[FieldSpec, ShortForm("type", "string")]
Fields = dict[str, ShortField]


class PartSpec(Fact):
    """A part of a frame."""

    role: Literal["constant", "length", "message", "address", "payload", "checksum"] = Field(
        description="What the part is for"
    )
    type: str | None = Field(default=None, description="Integer type: u8, u16, u24, u32 or u64")
    byteorder: Order | None = Field(default=None, description="Where it differs from the file's")
    value: ByteText | None = Field(default=None, description="The constant bytes")
    counts: list[str] | None = Field(default=None, description="Parts whose bytes a length counts")
    size: WholeRange | None = Field(default=None, description="Fewest..most payload bytes")
    algorithm: str | None = Field(default=None, description="Name of the CRC catalogue, or sum8, sum16")
    over: list[str] | None = Field(default=None, description="Parts that the checksum covers")
    sent: list[WholeRange] | None = Field(
        default=None, description="Bits of the checksum that are sent, a byte each"
    )
    only: list[str] | None = Field(
        default=None, description="Messages that carry the checksum, if not all do"
    )
    words: Annotated[StrictInt, Field(ge=1, le=8)] = Field(
        1, description="Bytes that a sum adds as one number"
    )
    rejected: Id | None = Field(
        default=None, description="Check value by which an unknown command is refused"
    )


class StuffingSpec(_Mapping):
    """A byte inserted after each occurrence of others."""

    after: ByteText = Field(description="Byte or bytes after which one is inserted")
    insert: ByteText = Field(description="The inserted byte")
    exempt: list[str] = Field(default_factory=list, description="Parts that are not stuffed")
    checksum: Literal["before", "after"] = Field(
        "before",
        description="The checksum is computed before the stuffing, or after it over the stuffed bytes",
    )
    section: Text = Field(default="", description="Section of the source document that states it")


class HeaderSpec(_Mapping):
    """Where address and message id stand in the header byte."""

    address: WholeRange = Field(description="Bits of the address")
    message: WholeRange = Field(description="Bits of the message id")


class MarkedSpec(_Mapping):
    """Frames whose header and end byte carry a marker bit."""

    marker: Annotated[StrictInt, Field(ge=1, le=0x80)] = Field(description="Mask of the marker bit")
    header: HeaderSpec = Field(description="How the header byte is divided")
    end: Id = Field(description="Message id bits of the end byte")
    payload: WholeRange = Field(description="Fewest..most payload bytes")
    checksum: PartSpec | None = Field(default=None, description="Between payload and end")


class FrameSpec(Fact):
    """How a message is wrapped: exactly one of parts, marked and packet."""

    parts: dict[str, PartSpec] | None = Field(default=None, description="Parts in wire order")
    stuffing: StuffingSpec | None = Field(default=None, description="Keeps the preamble unique")
    marked: MarkedSpec | None = Field(default=None, description="Header and end are marked by a bit")
    packet: dict[str, PartSpec] | None = Field(
        default=None, description="No frame: message id, words, checksum"
    )


class BusSpec(_Mapping):
    """The line and who is on it."""

    kind: Literal["master_slave", "ring", "host"] = Field(description="Who talks to whom")
    section: Text = Field(default="", description="Section of the source document that states it")
    nodes: WholeRange | None = Field(default=None, description="First..last address")
    broadcast: Id | None = Field(default=None, description="Address of all nodes at once")
    baud: Count | None = Field(default=None, description="Usual speed of the line")
    bits_per_byte: Annotated[StrictInt, Field(ge=1, le=16)] = Field(
        default=10, description="Bits on the line for a byte: start, data, parity and stop bits"
    )
    response_within: Time | None = Field(
        default=None, description="Time that a slave may take to answer, where one is stated"
    )


class AttributeSpec(_Mapping):
    """Something that this protocol alone says of its commands."""

    doc: Text = Field(default="", description="What it is, in one sentence")
    values: list[Label] = Field(min_length=1, description="All values it can have")


class RepeatSpec(_Mapping):
    """Whether a request may be sent again."""

    safe: StrictBool = Field(default=True, description="Sending it again does no harm")
    counter: str | None = Field(default=None, description="Field that tells a repeat from a new request")


def _repeat(value: object) -> object:
    if isinstance(value, dict | BaseModel):
        return value
    if value in ("safe", "unsafe"):
        return {"safe": value == "safe"}
    raise ValueError(
        f"{shown(value)} does not say whether a repeat is safe; use safe, unsafe or {{counter: FIELD}}"
    )


class _RepeatForms:
    """Tell editors of the short form."""

    @staticmethod
    def __get_pydantic_json_schema__(core: CoreSchema, handler: GetJsonSchemaHandler) -> JsonSchemaValue:
        return {"anyOf": [{"enum": ["safe", "unsafe"]}, handler(core)]}


Repeat = Annotated[RepeatSpec, BeforeValidator(_repeat), _RepeatForms]
Addressing = Literal["node", "broadcast", "either", "answered_broadcast", "none"]
NoResponse = Literal["none"]


def _response_form(value: object) -> str:
    return f"{BRANCH}none" if isinstance(value, str) else f"{BRANCH}fields"


Response = Annotated[
    Annotated[Fields, Tag(f"{BRANCH}fields")] | Annotated[NoResponse, Tag(f"{BRANCH}none")],
    Discriminator(_response_form),
]


class DefaultsSpec(_Mapping):
    """What a command has that does not say otherwise."""

    section: Text | None = Field(default=None, description="Section of the source document")
    request: Fields | None = Field(default=None, description="What is asked: fields, {} for none")
    response: Response | None = Field(default=None, description="Fields, {} for an empty answer, or none")
    addressing: Addressing | None = Field(default=None, description="Who is addressed, and who answers")
    repeat: Repeat | None = Field(default=None, description="Whether a request may be sent again")
    in_flight: Count | None = Field(default=None, description="Requests under way at once")
    attributes: dict[str, Label] = Field(default_factory=dict, description="Values of declared attributes")


class CommandSpec(Fact):
    """A transaction: what is asked, what is answered, and how."""

    section: Text | None = Field(  # type: ignore[assignment]  # None: that of `defaults`
        default=None, description="Section of the source document that states it"
    )
    id: Id = Field(description="Number that tells it from the others")
    request: Fields | None = Field(default=None, description="What is asked: fields, {} for none")
    response: Response | None = Field(default=None, description="Fields, {} for an empty answer, or none")
    empty_request: Literal["defaults"] | None = Field(
        default=None, description="defaults: a request of no bytes is taken as one with all defaults"
    )
    addressing: Addressing | None = Field(default=None, description="Who is addressed, and who answers")
    response_within: Time | None = Field(default=None, description="Where it differs from the bus's")
    repeat: Repeat | None = Field(default=None, description="Whether a request may be sent again")
    in_flight: Count | None = Field(default=None, description="Requests under way at once")
    attributes: dict[str, Label] = Field(default_factory=dict, description="Values of declared attributes")


class MessageSpec(Fact):
    """A message that nobody answers."""

    id: Id = Field(description="Number that tells it from the others")
    fields: Fields = Field(description="What it carries, in wire order")
    direction: Literal["request", "response"] | None = Field(
        default=None, description="Who may send it; absent: anybody"
    )


class SchemaFile(_Mapping):
    """A protocol: identity, types, frame, bus, and commands or messages."""

    qlinkgen: Literal[1] = Field(description="Version of the file format")
    protocol: ProtocolSpec = Field(description="Who and what the protocol is")
    byteorder: Order = Field(default="big", description="Of every integer that does not say otherwise")
    groups: GroupSpec | None = Field(
        default=None, description="Default for every integer that is not of whole bytes"
    )
    enums: dict[str, EnumSpec] = Field(default_factory=dict, description="Named numbers")
    flags: dict[str, FlagsSpec] = Field(default_factory=dict, description="Named bits")
    types: Fields = Field(default_factory=dict, description="Named types of fields")
    frame: FrameSpec = Field(description="How a message is wrapped on the wire")
    bus: BusSpec = Field(description="The line, and who is on it")
    attributes: dict[str, AttributeSpec] = Field(
        default_factory=dict, description="What this protocol alone says of its commands"
    )
    defaults: DefaultsSpec = Field(
        default_factory=DefaultsSpec, description="What a command has that does not say otherwise"
    )
    commands: dict[str, CommandSpec] = Field(default_factory=dict, description="Transactions by name")
    messages: dict[str, MessageSpec] = Field(
        default_factory=dict, description="Messages that nobody answers, by name"
    )


def json_schema() -> JsonSchemaValue:
    """JSON Schema of the file format, for editors."""
    schema = SchemaFile.model_json_schema()
    return {"$schema": "https://json-schema.org/draft/2020-12/schema", **schema}
