"""What the mappings of a schema file have in common."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Annotated

from pydantic import BaseModel, BeforeValidator, ConfigDict, Field, GetJsonSchemaHandler, StrictBool
from pydantic.json_schema import JsonSchemaValue
from pydantic_core import CoreSchema

from qlinkgen.schema.kinds import Text, Version

#: Prefix of union branches in the location of a fault; keys of a file cannot begin with it.
BRANCH = "\0"


class FileMapping(BaseModel):
    """One mapping of a schema file: other keys than its own are errors."""

    # Only the validator of the whole file is used, so those of the mappings in it are not built.
    model_config = ConfigDict(extra="forbid", frozen=True, arbitrary_types_allowed=True, defer_build=True)


#: Types of most attributes.
_SINGLE = frozenset({type(None), bool, int, str})


def nested(node: BaseModel) -> Iterator[tuple[str, str, object]]:
    """The attributes of a mapping that hold mappings or lists: name, key in the file, value.

    Most attributes hold a single value or nothing, so a walk through a file passes over them here.
    """
    for name, value in node.__dict__.items():
        if type(value) not in _SINGLE and isinstance(value, BaseModel | dict | list):
            yield name, type(node).model_fields[name].alias or name, value


class Fact(FileMapping):
    """A fact stated by the source document."""

    doc: Text = Field(default="", description="Description, in one sentence")
    section: Text = Field(default="", description="Section of the source document that states it")
    confirmed: StrictBool = Field(default=True, description="false: the source is weak; users are warned")


class Lifetime(FileMapping):
    """The versions of the protocol that have something."""

    since: Version | None = Field(default=None, description="First version of the protocol that has it")
    until: Version | None = Field(default=None, description="Last version of the protocol that has it")
    deprecated: Version | None = Field(default=None, description="Version since which it is not to be used")


class _OneOrMore:
    """Adds the short form of a list to the JSON Schema."""

    @staticmethod
    def __get_pydantic_json_schema__(core: CoreSchema, handler: GetJsonSchemaHandler) -> JsonSchemaValue:
        return {"anyOf": [{"type": "string"}, handler(core)]}


#: One name, or a list of them.
Names = Annotated[
    list[str], BeforeValidator(lambda value: [value] if isinstance(value, str) else value), _OneOrMore
]
