"""Types of values in a schema file, each with its validator and its JSON Schema for editors."""

from __future__ import annotations

from decimal import Decimal
from fractions import Fraction
from typing import Annotated, Literal

from pydantic import (
    BaseModel,
    BeforeValidator,
    Field,
    GetCoreSchemaHandler,
    GetJsonSchemaHandler,
    PlainValidator,
    StrictInt,
    StrictStr,
    WithJsonSchema,
)
from pydantic.json_schema import JsonSchemaValue
from pydantic_core import CoreSchema, PydanticCustomError

from qlinkgen.model.texts import CONTROL
from qlinkgen.model.values import Json
from qlinkgen.schema import notation
from qlinkgen.schema.characters import CONTROL_CHARACTER, control_character
from qlinkgen.schema.notation import shown

NAME_PATTERN = r"^[a-z][a-z0-9_]*$"
#: Maximum payload size; receivers reserve a buffer of the largest payload.
MAX_PAYLOAD = 65535


def _text(value: object) -> object:
    found = str(value) if isinstance(value, int | Decimal) and not isinstance(value, bool) else value
    return _uncontrolled(found).strip() if isinstance(found, str) else found


def _uncontrolled(text: str) -> str:
    if found := CONTROL.search(text):
        raise PydanticCustomError(CONTROL_CHARACTER, "{seen}", {"seen": control_character(found[0])})
    return text


def _characters(value: object) -> object:
    if isinstance(value, str) and value and value.isascii() and value.isprintable():
        return value
    raise ValueError(f"{shown(value)} is not text of printable ASCII characters; use value for other bytes")


def _scalar(value: object) -> object:
    if isinstance(value, list) and all(isinstance(item, int | Decimal | str) for item in value):
        return value
    if value is None or isinstance(value, dict | list):
        raise ValueError(
            f"{shown(value)} is not a value; write a number, true, false, text or a list of these"
        )
    return value


def _values(value: object) -> object:
    if not isinstance(value, dict):
        raise ValueError(f"{shown(value)} is not a mapping; write NAME: VALUE, or {{}}")  # noqa: TRY004
    return value


def _number_or_word(value: object) -> object:
    if isinstance(value, bool) or not isinstance(value, int | str):
        raise ValueError(  # noqa: TRY004 - a wrong value of the file, not of a caller
            f"{shown(value)} is neither a whole number nor a word; quote a word"
        )
    return value if isinstance(value, str) else int(value)


def _label(value: object) -> object:
    if not isinstance(value, int | str):
        raise ValueError(  # noqa: TRY004 - a wrong value of the file, not of a caller
            f"{shown(value)} is not a label; write a word, a whole number, true or false"
        )
    if isinstance(value, bool):
        return value
    return _uncontrolled(value) if isinstance(value, str) else int(value)


class ShortForm:
    """Accepts a plain value as a short form of a mapping with one key; the JSON Schema has both forms."""

    def __init__(self, key: str, *kinds: str) -> None:
        """``kinds`` are the JSON types of the short form."""
        self.key = key
        self.kinds = kinds

    def __get_pydantic_core_schema__(self, source: object, handler: GetCoreSchemaHandler) -> CoreSchema:
        """Expand the short form before the mapping is validated."""
        from_short = BeforeValidator(self._expand)
        schema: CoreSchema = from_short.__get_pydantic_core_schema__(source, handler)
        return schema

    def __get_pydantic_json_schema__(
        self, core: CoreSchema, handler: GetJsonSchemaHandler
    ) -> JsonSchemaValue:
        """Allow either form."""
        return {
            "anyOf": [{"type": list(self.kinds) if len(self.kinds) > 1 else self.kinds[0]}, handler(core)]
        }

    def _expand(self, value: object) -> object:
        return value if isinstance(value, dict | BaseModel) else {self.key: value}


def _json(description: str, *kinds: str, **more: Json) -> WithJsonSchema:
    return WithJsonSchema(
        {"type": list(kinds) if len(kinds) > 1 else kinds[0], "description": description, **more}
    )


Text = Annotated[str, BeforeValidator(_text), WithJsonSchema({"type": ["string", "number"]})]
Rational = Annotated[
    Fraction,
    PlainValidator(notation.rational),
    _json("A number, exactly: 10, 0.1, 1/10, 1/2^16", "string", "number"),
]
AnyRange = Annotated[
    notation.Range,
    PlainValidator(notation.range_of),
    _json("first..last, both included", "string", "number"),
]
WholeRange = Annotated[
    tuple[int, int],
    PlainValidator(notation.whole_range),
    _json("first..last of whole numbers, or one number", "string", "integer"),
]


def _separator(value: object) -> notation.Divider:
    """A separator between fields, or before each of them."""
    if value == "none":
        return notation.Divider()
    before = isinstance(value, dict) and value.keys() == {"before"}
    text = value["before"] if isinstance(value, dict) and before else value
    if isinstance(text, str) and len(text) == 1 and text.isascii():
        return notation.Divider(text.encode(), before)
    raise ValueError(f"{shown(value)} is not one character; write one like ',' or none")


ByteText = Annotated[
    bytes,
    PlainValidator(notation.byte_string),
    _json("Hex pairs (A5 A5) or one byte (0xA5)", "string", "integer"),
]
ByteCount = Annotated[
    int, PlainValidator(notation.byte_count), _json("A number of bytes: 16 bytes", "string")
]
Characters = Annotated[
    str, BeforeValidator(_characters), WithJsonSchema({"type": "string", "pattern": "^[ -~]+$"})
]
Separator = Annotated[
    notation.Divider,
    PlainValidator(_separator),
    _json(
        "One character between fields, like ','; {before: ','}: before each field; none", "string", "object"
    ),
]
AnyCondition = Annotated[
    tuple[notation.TestText, ...],
    PlainValidator(notation.condition),
    _json(
        "{FIELD: value, range, list of them, or `not` one}, or the name of a truth value", "object", "string"
    ),
]
Version = Annotated[
    notation.Version,
    PlainValidator(notation.version),
    _json("Numbers with dots between them: 2, 2.1, 1.0.3", "string", "number"),
]
Time = Annotated[
    notation.Duration, PlainValidator(notation.duration), _json("3 bytes, 260 us, 10 ms or 1 s", "string")
]
ScalarValue = Annotated[
    int | bool | Decimal | str | list[int | bool | Decimal | str],
    PlainValidator(_scalar),
    _json("A number, true or false, text, or a list of these", "number", "boolean", "string", "array"),
]
#: Values by name; each is checked against its field.
Values = Annotated[
    dict[str, object],
    PlainValidator(_values),
    WithJsonSchema({"type": "object", "description": "VALUE: number, text, list or object, as in JSON"}),
]
Consts = Annotated[
    list[Annotated[StrictInt, Field(ge=0)]],
    BeforeValidator(lambda value: value if isinstance(value, list) else [value]),
    Field(min_length=1),
    WithJsonSchema({"anyOf": [{"type": "integer"}, {"type": "array", "items": {"type": "integer"}}]}),
]
Label = Annotated[int | bool | str, PlainValidator(_label), _json("A label", "string", "integer", "boolean")]
#: A value that is an integer, or named by an enum.
NumberOrName = Annotated[
    int | bool | str, PlainValidator(_label), _json("A number, or a name of its enum", "string", "integer")
]
#: What is sent for a name of an enum.
NumberOrWord = Annotated[
    int | str,
    PlainValidator(_number_or_word),
    _json("A number, or a word of an enum of texts", "integer", "string"),
]
Name = Annotated[str, WithJsonSchema({"type": "string", "pattern": NAME_PATTERN})]
Count = Annotated[StrictInt, Field(ge=1)]
Id = Annotated[StrictInt, Field(ge=0)]
#: An id of a part with a type such as text[3] or text[0..8].
TextId = StrictStr
AnswerNumber = Annotated[
    notation.AnswerId,
    PlainValidator(notation.answer_id),
    _json("A number, or request.id + 0x80; PART: NUMBER for several parts", "string", "integer", "object"),
]
Order = Literal["big", "little"]
