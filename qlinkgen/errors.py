"""Errors of qlinkgen, so that one `except` clause can be as wide or as narrow as needed.

* `QlinkgenError`: everything raised on purpose by this package
    * `SchemaError`: a protocol description is wrong; carries every fault found, each with its place
    * `GenerationError`: a correct description cannot be turned into the output asked for
    * `CodecError`: values and bytes do not fit the description (also a `ValueError`)
        * `EncodeError`: these values cannot be sent
        * `DecodeError`: these bytes are not what the description allows

The generated modules import nothing from here and have an `EncodeError` and a `DecodeError` of their own.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Literal

__all__ = [
    "CodecError",
    "DecodeError",
    "EncodeError",
    "Fault",
    "GenerationError",
    "QlinkgenError",
    "SchemaError",
]


class QlinkgenError(Exception):
    """Base of every error that this package raises on purpose."""


@dataclass(frozen=True, slots=True, order=True)
class Fault:
    """One thing wrong in one place of a schema file; its text is a line that editors can jump to.

    Attributes:
        file: path of the file as the user gave it.
        line: line counted from 1.
        column: column counted from 1.
        rule: id of the rule that was broken, as listed in the documentation of the rules.
        message: what is wrong.
        hint: what would put it right, or empty.
        severity: a warning does not stop the file from being used.
    """

    file: str
    line: int
    column: int
    rule: str
    message: str
    hint: str = ""
    severity: Literal["error", "warning"] = "error"

    def __str__(self) -> str:
        """Return `file:line:col: error[RULE]: what; hint`."""
        hint = f"; {self.hint}" if self.hint else ""
        return f"{self.file}:{self.line}:{self.column}: {self.severity}[{self.rule}]: {self.message}{hint}"


class SchemaError(QlinkgenError):
    """A protocol description is wrong.

    A file is checked to its end, so there may be several faults; they are kept in the order of the text.

    Attributes:
        faults: every fault found, at least one.
    """

    def __init__(self, faults: Iterable[Fault]) -> None:
        """Collect the faults and sort them by place."""
        self.faults = tuple(sorted(faults))
        super().__init__("\n".join(map(str, self.faults)))

    def __reduce__(self) -> tuple[type[SchemaError], tuple[tuple[Fault, ...]]]:
        """Pickle by the faults: the inherited way would hand the text to `__init__`."""
        return type(self), (self.faults,)


class GenerationError(QlinkgenError):
    """A correct description cannot be turned into the output asked for."""


class CodecError(QlinkgenError, ValueError):
    """Values and bytes do not fit the description.

    Attributes:
        message: what was seen and which rule it breaks.
        kind: a word for programs, `crc`, `stuffing`, `length`, `range`, `unknown`, `truncated` or `frame`.
        field: path of the field, such as `motion.response.segments[3]`; empty when it is not about one.
        offset: index of the byte in `data` where the fault shows, when there is one.
        data: the bytes concerned, as far as known.
    """

    def __init__(
        self,
        message: str,
        *,
        kind: str = "range",
        field: str = "",
        offset: int | None = None,
        data: bytes = b"",
    ) -> None:
        """Keep the particulars as attributes; the text names the field and the offset."""
        self.message = message
        self.kind = kind
        self.field = field
        self.offset = offset
        self.data = data
        super().__init__(message)

    def __str__(self) -> str:
        """Return the message with the field before it and the offset behind it."""
        where = f"{self.field}: " if self.field else ""
        offset = f" (offset {self.offset})" if self.offset is not None else ""
        return f"{where}{self.message}{offset}"


class EncodeError(CodecError):
    """These values cannot be sent."""


class DecodeError(CodecError):
    """These bytes are not what the description allows."""
