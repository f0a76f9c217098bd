"""The schema file format: fields and types, one class for each mapping, one attribute for each key."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Annotated, Literal

from pydantic import (
    Discriminator,
    Field,
    GetJsonSchemaHandler,
    PrivateAttr,
    StrictBool,
    StrictInt,
    Tag,
)
from pydantic.json_schema import JsonSchemaValue
from pydantic_core import CoreSchema

from qlinkgen.schema.file_algorithms import AnyAlgorithm
from qlinkgen.schema.file_base import BRANCH, Fact, FileMapping, Lifetime, Names
from qlinkgen.schema.kinds import (
    AnyCondition,
    AnyRange,
    ByteText,
    Id,
    NumberOrWord,
    Order,
    Rational,
    ScalarValue,
    ShortForm,
    Text,
    WholeRange,
)
from qlinkgen.schema.notation import REPEATED, TestText, Wanted


class GroupSpec(FileMapping):
    """Integers sent in groups of less than eight bits, one group a byte."""

    bits: Annotated[StrictInt, Field(ge=1, le=7)] = Field(description="Bits of a group")
    first: Literal["least", "most"] = Field(description="The group of a number that is sent first")


class EnumValueSpec(Lifetime):
    """A named number, or a named word."""

    value: NumberOrWord = Field(description="The number; of an enum of texts, the word")
    doc: Text = Field(default="", description="Description, in one sentence")


class EnumSpec(Fact):
    """Named numbers of one integer type, or named words."""

    type: str = Field(description="Its integer type, or text for words")
    values: dict[str, Annotated[EnumValueSpec, ShortForm("value", "integer", "string")]] = Field(
        min_length=1, description="Name: number, or name: word"
    )
    ignore_case: StrictBool = Field(default=False, description="Words are received in any case")


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


@dataclass(frozen=True, slots=True)
class CaseOf:
    """What a field is a case of.

    Attributes:
        slot: name of the choice.
        name: name of the case.
        named: values with a case of their own, None if there is a case for all others.
    """

    slot: str
    name: str
    named: tuple[Wanted, ...] | None


class FieldSpec(Fact, Lifetime):
    """A field of a message, or a named type that fields can have."""

    type: str = Field(description="u8, i32, f64, bool, fixed32.32, bytes[..], text[..], u16[..] or a name")
    byteorder: Order | None = Field(default=None, description="Overrides the byte order of the file")
    groups: GroupSpec | None = Field(default=None, description="Sent in groups of fewer than eight bits")
    parts: list[WholeRange] | None = Field(
        default=None, description="Bit ranges in wire order; each begins a new byte"
    )
    pad: ByteText | None = Field(
        default=None,
        description="Byte that fills up text or bytes of a constant size, or 20 before a decimal number",
    )
    terminator: ByteText | None = Field(
        default=None, description="Byte that follows text or bytes of variable size; not part of the value"
    )
    as_: str | None = Field(
        default=None,
        alias="as",
        description="Form of the number: bcd, two digits a byte; decimal[6], decimal[1..6], hex[4], as text",
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
    const: ScalarValue | None = Field(
        default=None, description="Always sent, and required when received; of several, the first is sent"
    )
    algorithm: AnyAlgorithm | None = Field(
        default=None,
        description="A check value: name of a CRC in the catalogue or of a sum, or its parameters",
    )
    init: Id | None = Field(default=None, description="Start of the check value, if not the algorithm's")
    over: list[str] | None = Field(
        default=None,
        description="Earlier fields, one after the other, that a check value covers; in an answer that its "
        "turn tells, request.NAME before them: a part of the frame of its request",
    )
    equals: str | None = Field(
        default=None,
        description="Earlier field with the same value; ~FIELD, FIELD + N: derived from it; in an answer, "
        "request.NAME: a field of its request, or a part of its frame",
    )
    reserved: StrictBool = Field(default=False, description="Sent as zero (or const), ignored when received")
    counts: Annotated[Names, Field(min_length=1)] | None = Field(
        default=None,
        description="Field of variable size whose length this field holds, or several whose bytes it counts",
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
    last: AnyCondition | None = Field(
        default=None, description="An array of records ends with the first one that has these values"
    )
    _case: CaseOf | None = PrivateAttr(default=None)

    @property
    def case(self) -> CaseOf | None:
        """What it is a case of, None for other fields."""
        return self._case

    def repeated(self, name: str) -> str:
        """What a field called ``name`` repeats of the request, "" if nothing."""
        match = REPEATED.match(self.equals or "")
        return match["name"] if match else name if self.echo else ""

    @property
    def proves(self) -> tuple[str, ...]:
        """Parts of the frame of its request that it is a check value of, () for others."""
        matches = (REPEATED.match(each) for each in self.over or ()) if self.algorithm is not None else ()
        return tuple(match["name"] for match in matches if match)

    @property
    def itself(self) -> FieldSpec:
        """The field without what it has from its request."""
        keys = ["equals"] if REPEATED.match(self.equals or "") else []
        keys += ["algorithm", "init", "over"] if self.proves else []
        if not keys:
            return self
        found = self.model_copy(update=dict.fromkeys(keys))
        found.model_fields_set.difference_update(keys)
        return found

    def as_case(self, case: CaseOf, when: TestText) -> FieldSpec:
        """The field as a case of a choice, present where a condition holds."""
        found = self.model_copy(update={"when": (when,)})
        found._case = case  # noqa: SLF001 - of the same class
        return found


ShortField = Annotated[FieldSpec, ShortForm("type", "string")]


def _case_form(value: object) -> str:
    field = isinstance(value, str | FieldSpec) or (isinstance(value, dict) and "type" in value)
    return f"{BRANCH}type" if field else f"{BRANCH}fields"


class _CaseForms:
    """Lets editors take a mapping with a type for either form: a field may be called type."""

    @staticmethod
    def __get_pydantic_json_schema__(core: CoreSchema, handler: GetJsonSchemaHandler) -> JsonSchemaValue:
        return {"anyOf": handler(core)["oneOf"]}


#: What a choice is in one case: a type, or a record of these fields; {} for nothing.
CaseSpec = Annotated[
    Annotated[ShortField, Tag(f"{BRANCH}type")] | Annotated[dict[str, ShortField], Tag(f"{BRANCH}fields")],
    Discriminator(_case_form),
    _CaseForms,
]


class ChoiceSpec(Fact, Lifetime):
    """A field whose type an earlier field decides."""

    switch: str = Field(description="Earlier field, or bits of one, that decides")
    cases: dict[str, CaseSpec] = Field(
        min_length=1,
        description="Type by value: a number, a range first..last, or a name; fields for a record of them",
    )
    default: CaseSpec | None = Field(default=None, description="Its type for all other values")


def _field_form(value: object) -> str:
    choice = isinstance(value, ChoiceSpec) or (isinstance(value, dict) and "switch" in value)
    return f"{BRANCH}choice" if choice else f"{BRANCH}plain"


if TYPE_CHECKING:
    #: `without_choices` replaces each choice by its cases as soon as a file has been read.
    Fields = dict[str, FieldSpec]
else:
    Fields = dict[
        str,
        Annotated[
            Annotated[ShortField, Tag(f"{BRANCH}plain")] | Annotated[ChoiceSpec, Tag(f"{BRANCH}choice")],
            Discriminator(_field_form),
        ],
    ]


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
