"""The schema file format: algorithms of check values."""

from __future__ import annotations

from typing import Annotated

from pydantic import Discriminator, Field, StrictBool, StrictInt, Tag

from qlinkgen.schema.file_base import BRANCH, FileMapping
from qlinkgen.schema.kinds import Id


class CrcSpec(FileMapping):
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
