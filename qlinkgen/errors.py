"""Errors of qlinkgen, so that one `except` clause can be as wide or as narrow as needed.

* `QlinkgenError`: everything raised on purpose by this package
    * `SchemaError`: a protocol description is wrong; carries every fault found, each with its place
    * `GenerationError`: a correct description cannot be turned into the output asked for
    * `CodecError`: values and bytes do not fit the description (also a `ValueError`)
        * `EncodeError`: these values cannot be sent
        * `DecodeError`: these bytes are not what the description allows
    * `LinkError`: a transaction on the wire failed; the bus can be used again
        * `NoReply`: nothing usable came in time (also a `TimeoutError`)
        * `BadReply`: something came, but not the answer
            * `IllegalCommand`: the device does not know the command
        * `CommandError`: the device knows the command, but it is not valid at this moment
        * `Collision`: what was sent came back changed, so others were sending too
        * `LoadError`: a program was not loaded to its end
    * `PortError`: the port itself failed (also an `OSError`)
        * `PortMissing`: there is no such port
        * `PortBusy`: another program has it
        * `PortLost`: it went away while it was used
        * `CapabilityMissing`: it cannot do what was asked for
    * `HexFileError`: an Intel HEX file cannot be sent to a node (also a `ValueError`)
    * `ExtraMissing`: an optional part of the installation is needed (also an `ImportError`)

The generated modules import nothing from here and have an `EncodeError` and a `DecodeError` of their own.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Literal, TypedDict, Unpack

__all__ = [
    "BadReply",
    "CapabilityMissing",
    "CodecError",
    "Collision",
    "CommandError",
    "DecodeError",
    "EncodeError",
    "ExtraMissing",
    "Fault",
    "GenerationError",
    "HexFileError",
    "IllegalCommand",
    "LinkError",
    "LoadError",
    "NoReply",
    "PortBusy",
    "PortError",
    "PortLost",
    "PortMissing",
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


class Particulars(TypedDict, total=False):
    """What a LinkError may be given beside its text; see there."""

    node: int | None
    attempts: int
    elapsed: float
    received: bytes


class LinkError(QlinkgenError):
    """A transaction failed on the wire. The port is in order and the bus can be used again.

    Attributes:
        message: what was asked, what came, and what to look at.
        node: address that was asked, None where the protocol has none.
        attempts: how many times the request was sent.
        elapsed: seconds from the call to the failure.
        received: the last bytes that came, for a look at them.
    """

    def __init__(
        self,
        message: str,
        *,
        node: int | None = None,
        attempts: int = 0,
        elapsed: float = 0.0,
        received: bytes = b"",
    ) -> None:
        super().__init__(message)
        self.message = message
        self.node = node
        self.attempts = attempts
        self.elapsed = elapsed
        self.received = received


class NoReply(LinkError, TimeoutError):
    """Nothing usable came in time."""


class BadReply(LinkError):
    """Something came in time, but it was not the answer: damaged, or of another shape."""


class IllegalCommand(BadReply):
    """The device says that it does not know the command."""


class CommandError(LinkError):
    """The device knows the command, but it is not valid at this moment: its change was dropped.

    With `attempts` 0 the last status said so beforehand, and nothing was sent.

    Attributes:
        status: the status word that says so.
    """

    def __init__(self, message: str, *, status: int = 0, **particulars: Unpack[Particulars]) -> None:
        super().__init__(message, **particulars)
        self.status = status


class Collision(LinkError):
    """What was sent came back changed: another station was sending at the same time."""


class LoadError(LinkError):
    """A program was not loaded to its end.

    Attributes:
        acknowledged: bytes of the program's text that the node has acknowledged.
        total: bytes of the program's text.
    """

    def __init__(
        self, message: str, *, acknowledged: int = 0, total: int = 0, **particulars: Unpack[Particulars]
    ) -> None:
        super().__init__(message, **particulars)
        self.acknowledged = acknowledged
        self.total = total


class PortError(QlinkgenError, OSError):
    """The port itself failed.

    Attributes:
        port: name of the port, as the user gave it.
    """

    def __init__(self, message: str, *, port: str = "") -> None:
        super().__init__(message)
        self.port = port


class PortMissing(PortError, FileNotFoundError):
    """There is no such port."""


class PortBusy(PortError):
    """Another program has the port, or this user may not open it."""


class PortLost(PortError, ConnectionError):
    """The port went away while it was used: unplugged, or its other side closed."""


class CapabilityMissing(PortError):
    """The port cannot do what was asked for."""


class HexFileError(QlinkgenError, ValueError):
    """An Intel HEX file cannot be sent to a node. Nothing has been sent.

    Attributes:
        message: what was seen, the rule, and what to do.
        file: path of the file as the user gave it.
        line: line counted from 1, 0 where the file as a whole is meant.
    """

    def __init__(self, message: str, *, file: str = "", line: int = 0) -> None:
        super().__init__(message)
        self.message = message
        self.file = file
        self.line = line

    def __str__(self) -> str:
        """Return `file:line: message`."""
        return ":".join([*filter(None, (self.file, str(self.line or ""))), f" {self.message}"]).lstrip()


class ExtraMissing(QlinkgenError, ImportError):
    """Something needs a package that only an extra of this one installs."""
