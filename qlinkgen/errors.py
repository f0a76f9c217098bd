"""Exceptions of qlinkgen.

* `QlinkgenError`: base class
    * `SchemaError`: a schema is wrong; holds every fault found, with its location
    * `GenerationError`: a valid schema cannot be generated for the requested target
    * `UnsuitableSchema`: a schema lacks what the hand-written behaviour of its protocol needs
    * `CodecError`: a value or a frame violates the schema (also a `ValueError`)
        * `EncodeError`: a value cannot be sent
        * `DecodeError`: received bytes are not a valid message
    * `LinkError`: a transaction failed; the bus remains usable
        * `NoReply`: no reply arrived in time (also a `TimeoutError`)
        * `BadReply`: a reply was corrupt or did not match the request
            * `IllegalCommand`: the device rejected the command as unknown
        * `Refused`: the device refused the request with a reply of the schema
        * `CommandError`: the device rejected the command in its present state
        * `Collision`: the echo of a request was garbled by another sender
        * `LoadError`: loading a program failed
        * `NoRoom`: the transmit buffer of a ring node stayed full (also a `TimeoutError`)
        * `NothingCame`: a wait for a message or a condition timed out (also a `TimeoutError`)
    * `PortError`: the port failed (also an `OSError`)
        * `PortMissing`: the port does not exist
        * `PortBusy`: another program uses the port
        * `PortLost`: the port disappeared while in use
        * `CapabilityMissing`: the port does not support an operation
    * `HexFileError`: an Intel HEX file cannot be sent to a node (also a `ValueError`)
    * `ImportFileError`: nothing can be imported from a file of another format (also a `ValueError`)
    * `CaptureError`: a file is not a recording that can be read (also a `ValueError`)
    * `ExtraMissing`: an optional dependency is not installed (also an `ImportError`)

Generated modules do not import this module; they define their own `EncodeError` and `DecodeError`.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Literal, TypedDict, Unpack

__all__ = [
    "BadReply",
    "CapabilityMissing",
    "CaptureError",
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
    "ImportFileError",
    "LinkError",
    "LoadError",
    "NoReply",
    "NoRoom",
    "NothingCame",
    "PortBusy",
    "PortError",
    "PortLost",
    "PortMissing",
    "QlinkgenError",
    "Refused",
    "SchemaError",
    "UnsuitableSchema",
]


class QlinkgenError(Exception):
    """Base class of the exceptions of this package."""


@dataclass(frozen=True, slots=True, order=True)
class Fault:
    """An error or a warning at a location in a schema; its text has the format that editors jump to.

    Attributes:
        file: path of the file as given by the user.
        line: line, from 1.
        column: column, from 1.
        rule: id of the violated rule, as listed in docs/rules.md.
        message: the error.
        hint: the fix, or empty.
        severity: a schema with only warnings can be used.
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
    """A schema is wrong.

    A file is checked to its end, so there may be several faults; they are in the order of the text.

    Attributes:
        faults: every fault found, at least one.
    """

    def __init__(self, faults: Iterable[Fault]) -> None:
        """Sort the faults by location."""
        self.faults = tuple(sorted(faults))
        super().__init__("\n".join(map(str, self.faults)))

    def __reduce__(self) -> tuple[type[SchemaError], tuple[tuple[Fault, ...]]]:
        """Pickle by the faults; the default would pass the text to `__init__`."""
        return type(self), (self.faults,)


class GenerationError(QlinkgenError):
    """A valid schema cannot be generated for the requested target."""


class UnsuitableSchema(QlinkgenError):
    """A schema lacks what the hand-written behaviour of its protocol needs."""


class CodecError(QlinkgenError, ValueError):
    """A value or a frame violates the schema.

    Attributes:
        message: what was seen and the violated rule.
        kind: `crc`, `stuffing`, `length`, `range`, `unknown`, `truncated` or `frame`.
        field: path of the field, such as `motion.response.segments[3]`; empty for other errors.
        offset: index of the wrong byte in `data`, None if unknown.
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
        """Set the attributes; the text includes field and offset."""
        self.message = message
        self.kind = kind
        self.field = field
        self.offset = offset
        self.data = data
        super().__init__(message)

    def __str__(self) -> str:
        """Return `field: message (offset N)`."""
        where = f"{self.field}: " if self.field else ""
        offset = f" (offset {self.offset})" if self.offset is not None else ""
        return f"{where}{self.message}{offset}"


class EncodeError(CodecError):
    """A value cannot be sent."""


class DecodeError(CodecError):
    """Received bytes are not a valid message."""


class Particulars(TypedDict, total=False):
    """Optional arguments of LinkError."""

    node: int | None
    attempts: int
    elapsed: float
    received: bytes


class LinkError(QlinkgenError):
    """A transaction failed on the wire. The port and the bus remain usable.

    Attributes:
        message: the request, what was received, and what to check.
        node: address of the request, None if the protocol has no addresses.
        attempts: number of times that the request was sent.
        elapsed: seconds from the call to the failure.
        received: the last bytes received, for diagnosis.
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
    """No reply arrived in time."""


class BadReply(LinkError):
    """A reply arrived in time but was corrupt or did not match the request."""


class IllegalCommand(BadReply):
    """The device rejected the command as unknown."""


class Refused(LinkError):
    """The device refused the request, as the schema describes it.

    Attributes:
        reason: the fields of its reply as text.
        reply: its decoded reply, of a class of the generated module.
        request: the request that it refused.
    """

    def __init__(
        self, message: str, *, reason: str = "", reply: object = None, request: object = None,
        **particulars: Unpack[Particulars],
    ) -> None:  # fmt: skip
        super().__init__(message, **particulars)
        self.reason = reason
        self.reply = reply
        self.request = request


class CommandError(LinkError):
    """The device rejected the command in its present state; it had no effect.

    With `attempts` 0 the last known status ruled the command out, and nothing was sent.

    Attributes:
        status: the status word with the rejection.
    """

    def __init__(self, message: str, *, status: int = 0, **particulars: Unpack[Particulars]) -> None:
        super().__init__(message, **particulars)
        self.status = status


class Collision(LinkError):
    """The echo of a request was garbled: another node was sending at the same time."""


class LoadError(LinkError):
    """Loading a program failed.

    Attributes:
        acknowledged: number of bytes of the program acknowledged by the node.
        total: size of the program in bytes.
    """

    def __init__(
        self, message: str, *, acknowledged: int = 0, total: int = 0, **particulars: Unpack[Particulars]
    ) -> None:
        super().__init__(message, **particulars)
        self.acknowledged = acknowledged
        self.total = total


class NoRoom(LinkError, TimeoutError):
    """The transmit buffer of a ring node stayed full: NETSTAT bit 0 is set, nothing was sent."""


class NothingCame(LinkError, TimeoutError):
    """A wait of a ring node timed out."""


class PortError(QlinkgenError, OSError):
    """The port failed.

    Attributes:
        port: name of the port, as given by the user.
    """

    def __init__(self, message: str, *, port: str = "") -> None:
        super().__init__(message)
        self.port = port


class PortMissing(PortError, FileNotFoundError):
    """The port does not exist."""


class PortBusy(PortError):
    """Another program uses the port, or the user lacks permission."""


class PortLost(PortError, ConnectionError):
    """The port disappeared while in use: unplugged, or closed by the other side."""


class CapabilityMissing(PortError):
    """The port does not support an operation."""


class HexFileError(QlinkgenError, ValueError):
    """An Intel HEX file cannot be sent to a node. Nothing has been sent.

    Attributes:
        message: what was seen, the rule, and the fix.
        file: path of the file as given by the user.
        line: line, from 1; 0 for the file as a whole.
    """

    def __init__(self, message: str, *, file: str = "", line: int = 0) -> None:
        super().__init__(message)
        self.message = message
        self.file = file
        self.line = line

    def __str__(self) -> str:
        """Return `file:line: message`."""
        return ":".join([*filter(None, (self.file, str(self.line or ""))), f" {self.message}"]).lstrip()


class ImportFileError(QlinkgenError, ValueError):
    """Nothing can be imported from a file of another format.

    Attributes:
        message: what was seen, the rule, and the fix.
        file: path of the file as given by the user.
        line: line, from 1; 0 for the file as a whole.
    """

    def __init__(self, message: str, *, file: str = "", line: int = 0) -> None:
        super().__init__(message)
        self.message = message
        self.file = file
        self.line = line

    def __str__(self) -> str:
        """Return `file:line: message`."""
        return ":".join([*filter(None, (self.file, str(self.line or ""))), f" {self.message}"]).lstrip()


class CaptureError(QlinkgenError, ValueError):
    """A file is not a recording that can be read."""


class ExtraMissing(QlinkgenError, ImportError):
    """A feature needs a package that an extra of this package installs."""
