"""The schema file format: frames, their parts and codings."""

from __future__ import annotations

import re
from collections.abc import Mapping
from typing import Annotated, Final, Literal

from pydantic import (
    AfterValidator,
    BaseModel,
    BeforeValidator,
    Discriminator,
    Field,
    GetJsonSchemaHandler,
    StrictBool,
    StrictInt,
    Tag,
)
from pydantic.json_schema import JsonSchemaValue
from pydantic_core import CoreSchema

from qlinkgen.schema.file_algorithms import AnyAlgorithm
from qlinkgen.schema.file_base import BRANCH, Fact, FileMapping, Names
from qlinkgen.schema.file_fields import BitSpec
from qlinkgen.schema.kinds import (
    AnyCondition,
    AnyRange,
    ByteCount,
    ByteText,
    Characters,
    Consts,
    Id,
    Name,
    Order,
    Rational,
    ScalarValue,
    ShortForm,
    Text,
    Time,
    WholeRange,
)

PartRole = Literal[
    "constant",
    "length",
    "message",
    "address",
    "destination",
    "source",
    "direction",
    "counter",
    "payload",
    "checksum",
    "terminator",
    "idle",
    "break",
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


def _both(values: dict[str, int]) -> dict[str, int]:
    """Both directions, and perhaps more. Raises ValueError."""
    if missing := next((each for each in ("request", "response") if each not in values), ""):
        raise ValueError(f"the value of a {missing} is missing; write {{request: 0, response: 1}}")
    return values


Directions = Annotated[
    dict[Name, Id], AfterValidator(_both), Field(json_schema_extra={"required": ["request", "response"]})
]


class PartBitSpec(BitSpec):
    """Consecutive bits of a part of a frame: with a role, constant, or a value of every frame."""

    role: Literal["message", "address", "destination", "source", "direction", "counter"] | None = Field(
        default=None, description="What they hold, unless they are constant or a value"
    )
    per: Literal["request", "frame"] = Field(default="request", description="What a counter counts")
    echo: StrictBool = Field(default=False, description="Answers repeat the counter of their request")
    repeats: Literal["handled", "answered"] = Field(
        default="handled",
        description="What a slave does with a request that has the number of the one before: handle it, or "
        "answer it with its last answer",
    )
    const: Consts | None = Field(default=None, description="Legal values, the first of which is sent")
    values: Directions | None = Field(
        default=None, description="The value for each direction; others are of replies with `if`"
    )
    when: AnyCondition | None = Field(
        default=None,
        alias="if",
        description="Frames that have them: of a direction; the messages that a counter counts",
    )


class TrimSpec(FileMapping):
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
    values: Directions | None = Field(
        default=None, description="The value for each direction; others are of replies with `if`"
    )
    per: Literal["request", "frame"] = Field(default="request", description="What a counter counts")
    echo: StrictBool = Field(default=False, description="Answers repeat the counter of their request")
    repeats: Literal["handled", "answered"] = Field(
        default="handled",
        description="What a slave does with a request that has the number of the one before: handle it, or "
        "answer it with its last answer",
    )
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
    ignore_case: StrictBool = Field(
        default=False, description="A message id of several lengths is received in any case"
    )
    shared: StrictBool = Field(default=False, description="A terminator that may begin the next frame too")
    time: Time | None = Field(
        default=None, description="Silence on the line that ends a frame, or break that begins one"
    )
    at_least: Time | None = Field(default=None, description="Its minimum at high speed")
    alone: StrictBool = Field(
        default=False, description="Nothing but the silence, or the next break, ends a frame"
    )
    counts: Names | None = Field(default=None, description="Part, or parts, whose bytes a length counts")
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
        default=None,
        description="Value of a checksum over nothing, or of a length where a longer one follows",
    )
    over: list[str] | None = Field(
        default=None,
        description="Parts that the checksum covers; beside a payload alone, request.PART before it: parts "
        "of the frame of the request",
    )
    sent: list[WholeRange] | None = Field(
        default=None, description="Bit ranges of the checksum that are sent, one per byte"
    )
    as_: str | None = Field(
        default=None,
        alias="as",
        description="Form of an address or a checksum: hex[2] or decimal[3], two or three digits",
    )
    only: list[str] | None = Field(default=None, description="Messages with the checksum; default: all")
    words: Annotated[StrictInt, Field(ge=1, le=8)] = Field(1, description="Size of the words that a sum adds")
    rejected: Id | None = Field(default=None, description="Check value that rejects an unknown command")
    when: AnyCondition | None = Field(
        default=None,
        alias="if",
        description="Frames that have it: of a direction, or with values in the header",
    )

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


class PartTypeSpec(Fact):
    """A named type of parts, some of whose bits have roles; it takes the place of its name in a part."""

    type: str = Field(description="Integer type: u8, u16 ... u64")
    byteorder: Order | None = Field(default=None, description="Overrides the byte order of the file")
    bits: dict[str, Annotated[PartBitSpec, ShortForm("at", "integer", "string")]] = Field(
        min_length=1, description="Roles of the bits of the integer"
    )


class OrPartType:
    """Describes the types of parts, which a file no longer has when it is checked."""

    @staticmethod
    def __get_pydantic_json_schema__(core: CoreSchema, handler: GetJsonSchemaHandler) -> JsonSchemaValue:
        return {"anyOf": [handler(core), handler(PartTypeSpec.__pydantic_core_schema__)]}


class StuffingSpec(FileMapping):
    """Inserts a byte after each occurrence of a pattern; ``coding`` can say the same."""

    after: ByteText = Field(description="Pattern after which a byte is inserted")
    insert: ByteText = Field(description="The inserted byte")
    exempt: list[str] = Field(default_factory=list, description="Parts that are not stuffed")
    checksum: Literal["before", "after"] = Field(
        "before",
        description="The checksum is computed before the stuffing, or after it over the stuffed bytes",
    )
    section: Text = Field(default="", description="Section of the source document that states it")


class CodingSpec(FileMapping):
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
    checked: Literal["before", "after"] = Field(
        default="before",
        description="Lengths and check values cover the bytes before the coding, or the coded bytes after it",
    )
    over: list[str] | None = Field(
        default=None, description="Coded parts; default: all but the first constant, up to the terminator"
    )


def _coding_form(value: object) -> str:
    return f"{BRANCH}many" if isinstance(value, list) else f"{BRANCH}one"


Codings = Annotated[
    Annotated[CodingSpec, Tag(f"{BRANCH}one")] | Annotated[list[CodingSpec], Tag(f"{BRANCH}many")],
    Discriminator(_coding_form),
]


class HeaderSpec(FileMapping):
    """Bits of address and message id in the header byte."""

    address: WholeRange = Field(description="Bits of the address")
    message: WholeRange = Field(description="Bits of the message id")


class MarkedSpec(FileMapping):
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
        description="How bytes travel; a list applies in its order",
    )
    marked: MarkedSpec | None = Field(default=None, description="Header and end are marked by a bit")
    packet: Parts | None = Field(default=None, description="No frame: message id, words, checksum")


class KindSpec(Fact):
    """One of several kinds of frame."""

    parts: Parts = Field(min_length=1, description="Parts in wire order; the first is a constant")
    coding: Codings | None = Field(
        default=None, description="How bytes before the terminator travel; a list applies in its order"
    )
    when: AnyCondition | None = Field(
        default=None, alias="if", description="Direction of its frames: {direction: request}, or response"
    )
