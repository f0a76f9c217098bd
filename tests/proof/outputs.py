"""A common interface to all outputs of the compiler, so that they share expectations."""

from __future__ import annotations

import importlib
import sys
import tempfile
import types
import typing
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from construct import ConstructError, Container, EnumInteger, EnumIntegerString

from qlinkgen.backends import construct
from qlinkgen.backends.base import Options
from qlinkgen.model import naming
from qlinkgen.model.frame import MarkedFrame, PacketFrame
from qlinkgen.model.message import Message, Value
from qlinkgen.model.protocol import Protocol
from qlinkgen.model.types import Blob, Scalar
from qlinkgen.model.values import default_of, native_from_raw, raw_from_native
from tests.proof import cases
from tests.support.cdriver import WARNINGS, Driver, raw_text

Fields = Mapping[str, Any]
NOTHING: Fields = types.MappingProxyType({})


class Refused(Exception):
    """An error of an encoder or decoder.

    Attributes:
        kind: the kind of error of a decoder, "" if it states none.
    """

    def __init__(self, kind: str, text: str) -> None:
        super().__init__(f"{kind}: {text}")
        self.kind = kind


@dataclass(frozen=True)
class Decoded:
    """The result of a decoder."""

    message: str
    address: int
    fields: Mapping[str, Any]


class Output(typing.Protocol):
    """One output of one protocol."""

    def encode(
        self, message: Message, fields: Fields, address: int, request: bytes, beside: Fields = NOTHING
    ) -> tuple[bytes, bytes]:
        """Payload and frame, with defaults for missing values. Raises only Refused."""
        ...

    def decode(self, message: Message, wire: bytes, request: bytes) -> Decoded:
        """Decode a whole frame in the direction of a message. Raises only Refused."""
        ...

    def decode_payload(self, message: Message, payload: bytes) -> Mapping[str, Any]:
        """Decode a payload. Raises only Refused."""
        ...


def plain_numbers(fields: Mapping[str, Any]) -> dict[str, Any]:
    """The fields of construct, with labels and flags as numbers, like other outputs."""
    return {name: _plain(value) for name, value in fields.items() if name != "_io"}


def _plain(value: Any) -> Any:
    if isinstance(value, list):
        return [_plain(each) for each in value]
    if not isinstance(value, EnumIntegerString | EnumInteger | Container):
        return value
    # Generated modules have their own class of flags, which is known by its number.
    return int(value) if hasattr(value, "__int__") else plain_numbers(value)


class ConstructOutput:
    """Construct structures, live or from their source."""

    def __init__(self, protocol: Protocol, live: construct.Live) -> None:
        self._protocol = protocol
        self._live = live
        self._address_name = protocol.address_name

    def encode(
        self, message: Message, fields: Fields, address: int, request: bytes, beside: Fields = NOTHING
    ) -> tuple[bytes, bytes]:
        frame = self._live.frames[self._direction(message.direction)]
        parts = {naming.record_key(name): value for name, value in beside.items()}
        whole: dict[str, Any] = {"message": message.name, "fields": fields, **parts}
        if self._address_name:
            whole[self._address_name] = address
        try:
            return self._live.payload(message.name, fields), frame.build(whole, request=request)
        except ConstructError as error:
            raise Refused("", str(error)) from None

    def decode(self, message: Message, wire: bytes, request: bytes) -> Decoded:
        try:
            found = self._live.parse(self._direction(message.direction), wire, request)
        except ConstructError as error:
            raise Refused(getattr(error, "kind", ""), str(error)) from None
        beside = {each.name: found[naming.record_key(each.name)] for each in self._protocol.beside(message)}
        fields = plain_numbers({**beside, **found["fields"]})
        return Decoded(found["message"], found.get(self._address_name, 0), fields)

    def decode_payload(self, message: Message, payload: bytes) -> Mapping[str, Any]:
        try:
            return plain_numbers(self._live.messages[message.name].parse(payload))
        except ConstructError as error:
            raise Refused("", str(error)) from None

    def _direction(self, direction: str) -> str:
        """The direction of a message; any frame for messages of both directions."""
        return direction if direction in self._live.frames else "request"


class PythonOutput:
    """The generated Python module."""

    def __init__(self, protocol: Protocol, module: Any) -> None:
        self._protocol = protocol
        self._module = module
        self._packets = isinstance(protocol.frame, PacketFrame)

    def encode(
        self, message: Message, fields: Fields, address: int, request: bytes, beside: Fields = NOTHING
    ) -> tuple[bytes, bytes]:
        place = {self._protocol.address_name: address} if self._protocol.address_name else {}
        context = self._context(message.direction, request)
        try:
            made = self._module.MESSAGES[message.name](**beside, **fields, **place)
            return made.to_bytes(), made.to_frame(*context)
        except self._module.EncodeError as error:
            raise Refused("", str(error)) from None

    def decode(self, message: Message, wire: bytes, request: bytes) -> Decoded:
        try:
            found = self._decoder(message.direction)(wire, *self._context(message.direction, request))
        except self._module.DecodeError as error:
            raise Refused(error.kind, str(error)) from None
        name = self._protocol.address_name
        beside = {each.name: getattr(found, each.name) for each in self._protocol.beside(message)}
        fields = {**beside, **self._values(found)}
        return Decoded(found.NAME, getattr(found, name) if name else 0, fields)

    def decode_payload(self, message: Message, payload: bytes) -> Mapping[str, Any]:
        try:
            return self._values(
                self._module.MESSAGES[message.name].from_bytes(payload, *self._place(message))
            )
        except self._module.DecodeError as error:
            raise Refused(error.kind, str(error)) from None

    def _decoder(self, direction: str) -> Callable[..., Any]:
        if direction == "message" and len(self._protocol.directions) > 1:
            direction = "request"
        return getattr(self._module, "decode" if direction == "message" else f"decode_{direction}")  # type: ignore[no-any-return]

    def _context(self, direction: str, request: bytes) -> tuple[Any, ...]:
        if not self._packets or direction != "response":
            return ()
        return (self._module.decode_request(request),)

    def _place(self, message: Message) -> tuple[int, ...]:
        return (message.default_address,) if self._protocol.address_name else ()

    def _values(self, found: Any) -> Mapping[str, Any]:
        return {value.name: getattr(found, value.name) for value in self._protocol.by_name[found.NAME].values}


def construct_live(name: str) -> Output:
    """Live structures."""
    return ConstructOutput(cases.protocol(name), cases.reference(name))


def construct_source(name: str) -> Output:
    """The generated source, imported from a package."""
    outputs = construct.generate(cases.protocol(name), Options())
    with tempfile.TemporaryDirectory() as folder:
        package = Path(folder) / f"construct_of_{name}"
        package.mkdir()
        for path, text in outputs.items():
            (package / Path(path).name).write_text(text, "utf-8")
        module = _imported(package, name)
    return ConstructOutput(cases.protocol(name), construct.Live(vars(module)))


def _imported(package: Path, name: str) -> types.ModuleType:
    sys.path.insert(0, str(package.parent))
    importlib.invalidate_caches()
    try:
        return importlib.import_module(f"{package.name}.{name}")
    finally:
        sys.path.remove(str(package.parent))
        for each in [each for each in sys.modules if each.split(".")[0] == package.name]:
            del sys.modules[each]


def python_module(name: str) -> Output:
    """The generated Python module."""
    return PythonOutput(cases.protocol(name), cases.module(name))


class COutput:
    """A compiled C header, called through a driver program."""

    def __init__(self, protocol: Protocol, driver: Driver) -> None:
        self._protocol = protocol
        self._driver = driver
        self._packets = isinstance(protocol.frame, PacketFrame)

    def encode(
        self, message: Message, fields: Fields, address: int, request: bytes, beside: Fields = NOTHING
    ) -> tuple[bytes, bytes]:
        given = {**beside, **fields}
        every = (*self._protocol.beside(message), *message.values)
        values = (_text(value, given.get(value.name, default_of(value))) for value in every)
        place: object = address if self._protocol.address_name else "-"
        if self._packets and message.direction == "response":
            place = request.hex()
        payload, wire = self._ask("encode", message.name, place, *values)
        return _bytes(payload), _bytes(wire)

    def decode(self, message: Message, wire: bytes, request: bytes) -> Decoded:
        context = (request.hex(),) if self._packets and message.direction == "response" else ()
        address, *told = self._ask("decode", message.name, _hex(wire), *context)
        every = (*self._protocol.beside(message), *message.values)
        return Decoded(message.name, 0 if address == "-" else int(address), _natives(every, told))

    def decode_payload(self, message: Message, payload: bytes) -> Mapping[str, Any]:
        return _natives(message.values, self._ask("payload", message.name, _hex(payload)))

    def stream(self, direction: str, data: bytes) -> list[str]:
        """Events of the receiver, in the words of the program."""
        return self._ask("stream", direction, _hex(data))

    def _ask(self, *words: object) -> list[str]:
        status, *answer = self._driver.ask(*words).split()
        if status == "error":
            raise Refused(self._kind(answer[0]), " ".join(map(str, words)))
        assert status == "ok", (status, words)
        return answer

    def _kind(self, kind: str) -> str:
        """C checks marks and contents in two calls, and so distinguishes errors that are one elsewhere."""
        marked = isinstance(self._protocol.frame, MarkedFrame)
        return "frame" if marked and kind in ("length", "unknown") else kind


def _text(value: Value, native: Any) -> str:
    """A native value in the format of the program."""
    if isinstance(value.type, Scalar):
        return raw_text(value, raw_from_native(value, native))
    return raw_text(value, native.encode("ascii") if isinstance(native, str) else native)


def _natives(values: Sequence[Value], words: list[str]) -> Fields:
    return {value.name: _native(value, word) for value, word in zip(values, words, strict=True)}


def _native(value: Value, word: str) -> Any:
    kind = value.type
    if isinstance(kind, Scalar):
        return native_from_raw(kind, int(word))
    if isinstance(kind, Blob):
        return _bytes(word).decode("ascii") if kind.text else _bytes(word)
    return [int(item) for item in word.split(",")] if word != "-" else []


def _hex(data: bytes) -> str:
    return data.hex() or "-"


def _bytes(word: str) -> bytes:
    return b"" if word == "-" else bytes.fromhex(word)


#: Outputs that need only Python.
OUTPUTS: dict[str, Callable[[str], Output]] = {
    "construct": construct_live,
    "construct source": construct_source,
    "python": python_module,
}
#: Compiler and flags: optimised, with the warnings that need it; and with sanitizers, which end the program
#: at the first undefined behaviour.
COMPILED = {
    "gcc": ("gcc", ("-O2", "-std=c99", *WARNINGS)),
    "clang": (
        "clang",
        ("-O0", "-g1", "-std=c99", "-fsanitize=address,undefined", "-fno-sanitize-recover=all"),
    ),
}
