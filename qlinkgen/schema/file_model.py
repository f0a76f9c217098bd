"""The schema file format: one class for each mapping, one attribute for each key.

These classes validate each mapping by itself; relations between them are checked while the model is built.
The JSON Schema for editors is generated from these classes, so editors show the descriptions.
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from typing import Annotated, Final, Literal, get_args

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
    AnswerNumber,
    AnyCondition,
    AnyRange,
    ByteCount,
    ByteText,
    Characters,
    Consts,
    Count,
    Id,
    Label,
    Name,
    Order,
    Rational,
    ScalarValue,
    ShortForm,
    Text,
    TextId,
    Time,
    Values,
    Version,
    WholeRange,
)
from qlinkgen.schema.notation import answer_id, shown

#: Prefix of union branches in the location of a fault; keys of a file cannot begin with it.
BRANCH = "\0"


class _Mapping(BaseModel):
    model_config = ConfigDict(extra="forbid", frozen=True, arbitrary_types_allowed=True)


class Fact(_Mapping):
    """A fact stated by the source document."""

    doc: Text = Field(default="", description="Description, in one sentence")
    section: Text = Field(default="", description="Section of the source document that states it")
    confirmed: StrictBool = Field(default=True, description="false: the source is weak; users are warned")


class Lifetime(_Mapping):
    """The versions of the protocol that have something."""

    since: Version | None = Field(default=None, description="First version of the protocol that has it")
    until: Version | None = Field(default=None, description="Last version of the protocol that has it")
    deprecated: Version | None = Field(default=None, description="Version since which it is not to be used")


class ProtocolSpec(_Mapping):
    """Name and source of the protocol."""

    name: Name = Field(description="Prefix of generated names")
    title: Text = Field(default="", description="Display name")
    revision: Text = Field(description="Revision of the source document")
    source: Text = Field(description="Title of the source document")
    doc: Text = Field(default="", description="Purpose of the protocol")


class GroupSpec(_Mapping):
    """Integers sent in groups of less than eight bits, one group a byte."""

    bits: Annotated[StrictInt, Field(ge=1, le=7)] = Field(description="Bits of a group")
    first: Literal["least", "most"] = Field(description="The group of a number that is sent first")


class EnumValueSpec(Lifetime):
    """A named number."""

    value: StrictInt = Field(description="The number")
    doc: Text = Field(default="", description="Description, in one sentence")


class EnumSpec(Fact):
    """Named numbers of one integer type."""

    type: str = Field(description="Its integer type")
    values: dict[str, Annotated[EnumValueSpec, ShortForm("value", "integer")]] = Field(
        min_length=1, description="Name: number"
    )


class FlagSpec(Lifetime):
    """A named bit."""

    bit: Id = Field(description="Number of the bit, 0 is the least significant")
    doc: Text = Field(default="", description="Description, in one sentence")


class FlagsSpec(Fact):
    """Named bits of one integer type."""

    type: str = Field(description="Their integer type")
    values: dict[str, Annotated[FlagSpec, ShortForm("bit", "integer")]] = Field(
        min_length=1, description="Name: number"
    )
    reserved: Literal["keep", "zero"] = Field(
        default="keep", description="Unnamed bits: preserved, or an error unless zero"
    )


class BitSpec(Lifetime):
    """Consecutive bits of an integer."""

    at: WholeRange = Field(description="Bit, or first..last bit; 0 is the least significant")
    type: str | None = Field(
        default=None, description="bool, or the name of an enum or flags; an unsigned number if absent"
    )
    signed: StrictBool = Field(default=False, description="The number is in two's complement")
    scale: Rational | None = Field(default=None, description="Value of one step in the unit")
    offset: Rational | None = Field(default=None, description="Value of raw 0 in the unit")
    unit: Text = Field(default="", description="Unit of the value")
    range: AnyRange | None = Field(default=None, description="Legal values, in the unit")
    raw_range: AnyRange | None = Field(default=None, description="Legal values, as integers on the wire")
    default: ScalarValue | None = Field(default=None, description="Default value, in the unit")
    doc: Text = Field(default="", description="Description, in one sentence")


class FieldSpec(Fact, Lifetime):
    """A field of a message, or a named type that fields can have."""

    type: str = Field(description="u8, i32, f64, bool, fixed32.32, bytes[..], text[..], u16[..] or a name")
    byteorder: Order | None = Field(default=None, description="Overrides the byte order of the file")
    groups: GroupSpec | None = Field(default=None, description="Sent in groups of fewer than eight bits")
    parts: list[WholeRange] | None = Field(
        default=None, description="Bit ranges in wire order; each begins a new byte"
    )
    pad: ByteText | None = Field(
        default=None, description="Byte that fills up text or bytes of a constant size; not part of the value"
    )
    as_: Literal["bcd"] | None = Field(
        default=None, alias="as", description="Form of the number: bcd, two decimal digits a byte"
    )
    packed: Literal["least", "most"] | None = Field(
        default=None, description="An array of bits in a row: which bits of a byte its first item has"
    )
    scale: Rational | None = Field(default=None, description="Value of one step in the unit")
    offset: Rational | None = Field(default=None, description="Value of raw 0 in the unit")
    unit: Text | None = Field(default=None, description="Unit of the value")
    range: AnyRange | None = Field(default=None, description="Legal values, in the unit")
    raw_range: AnyRange | None = Field(default=None, description="Legal values, as integers on the wire")
    default: ScalarValue | None = Field(default=None, description="Default value, in the unit")
    const: ScalarValue | None = Field(default=None, description="Always sent, and required when received")
    reserved: StrictBool = Field(default=False, description="Sent as zero (or const), ignored when received")
    counts: str | None = Field(
        default=None, description="Field of variable size whose length this field holds"
    )
    counts_in: Literal["items", "bytes"] = Field(default="items", description="Unit of the count")
    echo: StrictBool = Field(
        default=False, description="In a response: repeats the field of the same name in the request"
    )
    bits: dict[str, Annotated[BitSpec, ShortForm("at", "integer", "string")]] | None = Field(
        default=None, min_length=1, description="Fields inside the integer"
    )
    when: AnyCondition | None = Field(
        default=None, alias="if", description="Present only where earlier fields have these values"
    )
    optional: StrictBool = Field(default=False, description="May be left out, with all fields after it")


class _OneOrMore:
    """Adds the short form of a list to the JSON Schema."""

    @staticmethod
    def __get_pydantic_json_schema__(core: CoreSchema, handler: GetJsonSchemaHandler) -> JsonSchemaValue:
        return {"anyOf": [{"type": "string"}, handler(core)]}


PartRole = Literal[
    "constant",
    "length",
    "message",
    "address",
    "direction",
    "counter",
    "payload",
    "checksum",
    "terminator",
    "idle",
]
#: What a part turns out to be: its role, an integer with bits of several roles, a derived one, or a value.
PartKind = PartRole | Literal["bits", "derived", "value"]
#: The role that a key tells.
_TELLING: Final[Mapping[str, PartKind]] = {
    "bits": "bits",
    "equals": "derived",
    "const": "constant",
    "counts": "length",
    "value": "constant",
    "text": "constant",
    "algorithm": "checksum",
}
#: Bytes as a short form; names are in lower case.
_HEX_PAIRS = re.compile(r"\s*(?:[0-9A-F]{2}\s*)+\Z", re.ASCII)

PartNames = Annotated[
    list[str], BeforeValidator(lambda value: [value] if isinstance(value, str) else value), _OneOrMore
]
Directions = Annotated[dict[Literal["request", "response"], Id], Field(min_length=2)]
ShortField = Annotated[FieldSpec, ShortForm("type", "string")]
Fields = dict[str, ShortField]


class RecordSpec(Fact):
    """A record: a type with fields of its own."""

    fields: Fields = Field(min_length=1, description="Its fields, in wire order")


def _type_form(value: object) -> str:
    record = isinstance(value, RecordSpec) or (isinstance(value, dict) and "fields" in value)
    return f"{BRANCH}record" if record else f"{BRANCH}field"


TypeSpec = Annotated[
    Annotated[RecordSpec, Tag(f"{BRANCH}record")] | Annotated[ShortField, Tag(f"{BRANCH}field")],
    Discriminator(_type_form),
]


class CrcSpec(_Mapping):
    """A CRC by its parameters, which have the meaning of the catalogue."""

    width: Annotated[StrictInt, Field(ge=8, le=64)] = Field(description="Bits of the CRC")
    poly: Id = Field(description="Polynomial without its highest term")
    init: Id = Field(default=0, description="Initial register")
    refin: StrictBool = Field(default=False, description="Bytes are processed low bit first")
    refout: StrictBool | None = Field(
        default=None, description="The final register is reflected; default: as refin"
    )
    xorout: Id = Field(default=0, description="XORed with the result")
    check: Id | None = Field(
        default=None, description="CRC of the characters 123456789, if the document states it"
    )


def _algorithm_form(value: object) -> str:
    return f"{BRANCH}crc" if isinstance(value, dict | CrcSpec) else f"{BRANCH}name"


AnyAlgorithm = Annotated[
    Annotated[CrcSpec, Tag(f"{BRANCH}crc")] | Annotated[str, Tag(f"{BRANCH}name")],
    Discriminator(_algorithm_form),
]


class PartBitSpec(BitSpec):
    """Consecutive bits of a part of a frame: with a role, constant, or a value of every frame."""

    role: Literal["message", "address", "direction", "counter"] | None = Field(
        default=None, description="What they hold, unless they are constant or a value"
    )
    per: Literal["request", "frame"] = Field(default="request", description="What a counter counts")
    echo: StrictBool = Field(default=False, description="Answers repeat the counter of their request")
    const: Consts | None = Field(default=None, description="Legal values, the first of which is sent")
    values: Directions | None = Field(default=None, description="The value for each direction")


class TrimSpec(_Mapping):
    """Bytes at the end of a payload that are not sent."""

    zeros: Literal[True] = Field(description="Zero bytes are not sent; a receiver adds them")
    keep: Annotated[StrictInt, Field(ge=0, le=0xFFFF)] = Field(
        default=0, description="Number of bytes that are sent even if they are zero"
    )


class _TrimForms:
    """Accepts what is trimmed alone."""

    @staticmethod
    def expanded(value: object) -> object:
        """The mapping of a short form."""
        return {value: True} if isinstance(value, str) else value

    @staticmethod
    def __get_pydantic_json_schema__(core: CoreSchema, handler: GetJsonSchemaHandler) -> JsonSchemaValue:
        return {"anyOf": [{"const": "zeros"}, handler(core)]}


class PartSpec(Fact):
    """A part of a frame."""

    role: PartRole | None = Field(
        default=None, description="Role of the part, if no other key tells it: counts, value, text, algorithm"
    )
    type: str | None = Field(default=None, description="Integer type: u8, u16 ... u64")
    byteorder: Order | None = Field(default=None, description="Overrides the byte order of the file")
    value: ByteText | None = Field(default=None, description="The bytes of a constant or a terminator")
    text: Characters | None = Field(default=None, description="These bytes as characters")
    const: Consts | None = Field(
        default=None, description="Legal values of a constant integer, the first of which is sent"
    )
    values: Directions | None = Field(default=None, description="The value for each direction")
    per: Literal["request", "frame"] = Field(default="request", description="What a counter counts")
    echo: StrictBool = Field(default=False, description="Answers repeat the counter of their request")
    equals: str | None = Field(
        default=None, description="Earlier part with the same value; ~PART, PART + N: derived from it"
    )
    bits: dict[str, Annotated[PartBitSpec, ShortForm("at", "integer", "string")]] | None = Field(
        default=None, min_length=1, description="Roles of the bits of the integer"
    )
    scale: Rational | None = Field(
        default=None, description="Of a value: that of one step in the unit; of a length: bytes of one step"
    )
    offset: Rational | None = Field(
        default=None, description="Of a value: that of raw 0 in the unit; of a length: bytes of raw 0"
    )
    unit: Text | None = Field(default=None, description="Unit of a value")
    range: AnyRange | None = Field(default=None, description="Legal values, in the unit")
    raw_range: AnyRange | None = Field(default=None, description="Legal values, as integers on the wire")
    default: ScalarValue | None = Field(default=None, description="Default of a value, in the unit")
    shared: StrictBool = Field(default=False, description="A terminator that may begin the next frame too")
    time: Time | None = Field(default=None, description="Silence on the line that ends a frame")
    at_least: Time | None = Field(default=None, description="Its minimum at high speed")
    counts: PartNames | None = Field(default=None, description="Part, or parts, whose bytes a length counts")
    size: WholeRange | None = Field(default=None, description="Minimum..maximum payload size")
    trim: Annotated[TrimSpec, BeforeValidator(_TrimForms.expanded), _TrimForms] | None = Field(
        default=None, description="Bytes at the end of a payload that are not sent: zeros"
    )
    algorithm: AnyAlgorithm | None = Field(
        default=None, description="Name of a CRC in the catalogue or of a sum, or the parameters of a CRC"
    )
    init: Id | None = Field(default=None, description="Start of the checksum, if it is not the algorithm's")
    every: ByteCount | None = Field(
        default=None, description="Size of the blocks of the covered part that have a checksum each: 16 bytes"
    )
    otherwise: Id | None = Field(
        default=None, description="Value of the checksum where the covered parts are empty"
    )
    over: list[str] | None = Field(default=None, description="Parts that the checksum covers")
    sent: list[WholeRange] | None = Field(
        default=None, description="Bit ranges of the checksum that are sent, one per byte"
    )
    only: list[str] | None = Field(default=None, description="Messages with the checksum; default: all")
    words: Annotated[StrictInt, Field(ge=1, le=8)] = Field(1, description="Size of the words that a sum adds")
    rejected: Id | None = Field(default=None, description="Check value that rejects an unknown command")

    @property
    def told(self) -> PartKind | None:
        """The role, stated or told by other keys; None if nothing tells it."""
        if self.role is not None:
            return self.role
        given = (role for key, role in _TELLING.items() if getattr(self, key) is not None)
        return next(given, None if self.type is None else "value")


class _PartForms:
    """Accepts bytes or a type as short forms of a part."""

    @staticmethod
    def expanded(value: object) -> object:
        """The mapping of a short form."""
        if isinstance(value, dict | BaseModel):
            return value
        constant = isinstance(value, int) or (isinstance(value, str) and _HEX_PAIRS.match(value))
        return {"value" if constant else "type": value}

    @staticmethod
    def __get_pydantic_json_schema__(core: CoreSchema, handler: GetJsonSchemaHandler) -> JsonSchemaValue:
        return {"anyOf": [{"type": ["string", "integer"]}, handler(core)]}


Parts = dict[str, Annotated[PartSpec, BeforeValidator(_PartForms.expanded), _PartForms]]


class StuffingSpec(_Mapping):
    """Inserts a byte after each occurrence of a pattern."""

    after: ByteText = Field(description="Pattern after which a byte is inserted")
    insert: ByteText = Field(description="The inserted byte")
    exempt: list[str] = Field(default_factory=list, description="Parts that are not stuffed")
    checksum: Literal["before", "after"] = Field(
        "before",
        description="The checksum is computed before the stuffing, or after it over the stuffed bytes",
    )
    section: Text = Field(default="", description="Section of the source document that states it")


class CodingSpec(_Mapping):
    """How a run of parts travels: exactly one of escape, replace, insert, cobs, digits, pair and add."""

    escape: ByteText | None = Field(default=None, description="Byte before each escaped byte")
    xor: ByteText | None = Field(default=None, description="XORed with each escaped byte")
    of: list[ByteText] | None = Field(default=None, description="Bytes that are escaped")
    replace: dict[str, ByteText] | None = Field(
        default=None, description="Byte: the two bytes that are sent in its place"
    )
    insert: ByteText | None = Field(default=None, description="Byte inserted after each occurrence of after")
    after: ByteText | None = Field(default=None, description="Pattern after which a byte is inserted")
    cobs: ByteText | None = Field(default=None, description="Byte that COBS removes: 00")
    digits: Literal["hex"] | None = Field(default=None, description="Each byte as two hexadecimal digits")
    pair: Literal["complement"] | None = Field(
        default=None, description="Each byte is followed by its complement"
    )
    add: ByteText | None = Field(default=None, description="Number added to each byte")
    over: list[str] | None = Field(
        default=None, description="Coded parts; default: all but the first constant and the terminator"
    )


def _coding_form(value: object) -> str:
    return f"{BRANCH}many" if isinstance(value, list) else f"{BRANCH}one"


Codings = Annotated[
    Annotated[CodingSpec, Tag(f"{BRANCH}one")] | Annotated[list[CodingSpec], Tag(f"{BRANCH}many")],
    Discriminator(_coding_form),
]


class HeaderSpec(_Mapping):
    """Bits of address and message id in the header byte."""

    address: WholeRange = Field(description="Bits of the address")
    message: WholeRange = Field(description="Bits of the message id")


class MarkedSpec(_Mapping):
    """Frames whose header and end byte have a marker bit."""

    marker: Annotated[StrictInt, Field(ge=1, le=0x80)] = Field(description="Mask of the marker bit")
    header: HeaderSpec = Field(description="Layout of the header byte")
    end: Id = Field(description="Message id bits of the end byte")
    payload: WholeRange = Field(description="Minimum..maximum payload size")
    checksum: PartSpec | None = Field(default=None, description="Between payload and end")


class FrameSpec(Fact):
    """The frame around a message: exactly one of parts, marked and packet."""

    parts: Parts | None = Field(default=None, description="Parts in wire order")
    stuffing: StuffingSpec | None = Field(default=None, description="Keeps the preamble unique")
    coding: Codings | None = Field(
        default=None,
        description="How bytes before a terminator travel; a list applies in its order",
    )
    marked: MarkedSpec | None = Field(default=None, description="Header and end are marked by a bit")
    packet: Parts | None = Field(default=None, description="No frame: message id, words, checksum")


class BusSpec(_Mapping):
    """The line and its nodes."""

    kind: Literal["master_slave", "ring", "host"] = Field(description="Topology of the bus")
    section: Text = Field(default="", description="Section of the source document that states it")
    nodes: WholeRange | None = Field(default=None, description="First..last address")
    broadcast: Id | None = Field(default=None, description="Address of all nodes at once")
    baud: Count | None = Field(default=None, description="Usual speed of the line in bit/s")
    bits_per_byte: Annotated[StrictInt, Field(ge=1, le=16)] = Field(
        default=10, description="Bits on the line per byte: start, data, parity and stop bits"
    )
    response_within: Time | None = Field(default=None, description="Response time limit, if one is stated")


class AttributeSpec(_Mapping):
    """A protocol-specific attribute of commands and messages."""

    doc: Text = Field(default="", description="Description, in one sentence")
    values: list[Label] | None = Field(default=None, min_length=1, description="Allowed values")
    type: str | None = Field(default=None, description="Integer type of a number that a checksum covers")


class RepeatSpec(_Mapping):
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


class MeansSpec(_Mapping):
    """What an answer means, decided by one of its fields."""

    switch: str | None = Field(default=None, description="Field that decides")
    cases: dict[str | StrictInt, Means] = Field(
        default_factory=dict, description="Meaning by value: a number, a range first..last, or a name"
    )
    default: Means | None = Field(
        default=None, description="Meaning of all other values; default: refused, of a response done"
    )


class AnswerSpec(_Mapping):
    """The long form of a response: its number and its fields."""

    id: AnswerNumber | None = Field(default=None, description="Its number, if it is not that of the request")
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
    """Whether a response has the long form: only its keys, and values that no field has."""
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


def _count_form(value: object) -> object:
    """A number, or ``request.FIELD`` as the name of the field."""
    if isinstance(value, str) and (match := re.fullmatch(r"\s*request\.(\w+)\s*", value, re.ASCII)):
        return match[1]
    if isinstance(value, int) and not isinstance(value, bool) and value > 0:
        return value
    raise ValueError(f"{shown(value)} is not a number of answers; write 8 or request.FIELD")


class ManySpec(_Mapping):
    """The end of several answers to one request: exactly one of its keys."""

    count: Annotated[int | str, BeforeValidator(_count_form)] | None = Field(
        default=None, description="Number of answers: 8, or request.FIELD"
    )
    until: str | dict[str, str | StrictInt] | None = Field(
        default=None, description="{FIELD: value} of the last answer, or the name of a reply after it"
    )
    within: Time | None = Field(default=None, description="Time in which answers come")


class ReplySpec(Fact):
    """An answer other than the response."""

    id: AnswerNumber | None = Field(default=None, description="Its number: 0x15 or request.id + 0x80")
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


class DefaultsSpec(_Mapping):
    """Defaults for commands."""

    section: Text | None = Field(default=None, description="Section of the source document")
    request: Fields | None = Field(default=None, description="Fields of the request, {} for none")
    response: Response | None = Field(
        default=None,
        description="Fields, {} for an empty one, {id:, fields:}, the name of a message, or none",
    )
    addressing: Addressing | None = Field(
        default=None, description="Nodes addressed, and which of them respond"
    )
    repeat: Repeat | None = Field(default=None, description="Whether a request may be repeated")
    in_flight: Count | None = Field(default=None, description="Maximum number of outstanding requests")
    attributes: dict[str, Label] = Field(default_factory=dict, description="Values of declared attributes")


class ExampleSpec(_Mapping):
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
    replies: Replies = Field(
        default_factory=dict, description="Answers other than the response; they replace those of the file"
    )
    many: ManySpec | None = Field(default=None, description="Several answers come, until this end")
    empty_request: Literal["defaults"] | None = Field(
        default=None, description="defaults: an empty payload is a request with every field at its default"
    )
    addressing: Addressing | None = Field(
        default=None, description="Nodes addressed, and which of them respond"
    )
    response_within: Time | None = Field(default=None, description="Overrides the time limit of the bus")
    repeat: Repeat | None = Field(default=None, description="Whether a request may be repeated")
    in_flight: Count | None = Field(default=None, description="Maximum number of outstanding requests")
    attributes: dict[str, Label] = Field(default_factory=dict, description="Values of declared attributes")
    examples: list[ExampleSpec] = Field(default_factory=list, description="Frames of the source document")


class MessageSpec(Fact, Lifetime):
    """A message without a response."""

    id: MessageId | None = Field(
        default=None, description="Its number in the frame; PART: NUMBER for each part, if there are several"
    )
    fields: Fields = Field(description="Its fields, in wire order")
    direction: Literal["request", "response"] | None = Field(
        default=None, description="Direction of the message; default: any node sends it"
    )
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


class SchemaFile(_Mapping):
    """A protocol: identity, types, frame, bus, and commands or messages."""

    qlinkgen: Literal[1] = Field(description="Version of the file format")
    protocol: ProtocolSpec = Field(description="Name and source of the protocol")
    include: str | None = Field(
        default=None,
        description="Schema beside or below this file, whose types, commands and messages it has too",
    )
    byteorder: Order = Field(default="big", description="Default byte order of integers")
    groups: GroupSpec | None = Field(
        default=None, description="Default groups of integers that are not sent in whole bytes"
    )
    enums: dict[str, EnumSpec] = Field(default_factory=dict, description="Named numbers")
    flags: dict[str, FlagsSpec] = Field(default_factory=dict, description="Named bits")
    types: dict[str, TypeSpec] = Field(default_factory=dict, description="Named types of fields, and records")
    frame: FrameSpec = Field(description="The frame around each message")
    bus: BusSpec = Field(description="The line and its nodes")
    attributes: dict[str, AttributeSpec] = Field(
        default_factory=dict, description="Protocol-specific attributes of commands"
    )
    defaults: DefaultsSpec = Field(default_factory=DefaultsSpec, description="Defaults for commands")
    replies: Replies = Field(
        default_factory=dict, description="Answers other than the response, of all answered commands"
    )
    commands: dict[str, CommandSpec] = Field(default_factory=dict, description="Transactions by name")
    messages: dict[str, MessageSpec] = Field(
        default_factory=dict, description="Messages without a response, by name"
    )


def json_schema() -> JsonSchemaValue:
    """JSON Schema of the file format, for editors."""
    schema = SchemaFile.model_json_schema()
    return {"$schema": "https://json-schema.org/draft/2020-12/schema", **schema}
