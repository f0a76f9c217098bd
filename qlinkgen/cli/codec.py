"""The live codec of a protocol: the generated Python module, compiled in memory, and its values as JSON."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from types import ModuleType
from typing import Protocol as Shape

from qlinkgen.cli.boundary import Failure
from qlinkgen.cli.common import did_you_mean
from qlinkgen.link import codec as link
from qlinkgen.model.fields import Layout, Record, Records, Value, chosen
from qlinkgen.model.message import Message
from qlinkgen.model.naming import address_attribute, attribute
from qlinkgen.model.objects import attributes_of
from qlinkgen.model.protocol import Protocol
from qlinkgen.model.values import BadValue, Json, Native, to_json
from qlinkgen.protocols.registry import codec_of


class MessageObject(link.Message, Shape):
    """A message of a generated module of any kind of protocol."""

    @property
    def to_frame(self) -> Callable[..., bytes]:
        """Function that returns the whole frame; for the response of a packet it takes the request."""
        ...


def load_codec(protocol: Protocol, *, plain: bool = False, only: str = "") -> ModuleType:
    """The generated module of a protocol.

    ``only`` this command or message is needed, "" for all.

    ``plain``: the protocol is as its schema says, without another checksum; then the module in the package
    is taken if there is one of this very schema.
    """
    if plain and (kept := codec_of(protocol)) is not None:
        return kept
    from qlinkgen.backends.python import load  # noqa: PLC0415  # Jinja is slow to import
    from qlinkgen.plan import Options  # noqa: PLC0415  # not needed for the module in the package

    return load(protocol, Options(only=(only,) if only else ()), laid_out=False)


def build(
    codec: ModuleType,
    message: Message,
    given: Mapping[str, Json],
    address: Mapping[str, int],
    beside: Sequence[Value] = (),
) -> MessageObject:
    """Make a message object from values of JSON or a command line; ``beside`` are those of the frame."""
    values = {value.name: value for value in (*beside, *message.values)}
    for name in given:
        if name not in values:
            raise Failure(_no_field(message, name, list(values)))
    if missing := [name for name, value in values.items() if value.required and name not in given]:
        fix = " ".join(f"{name}=VALUE" for name in missing)
        raise Failure(f"{message.name}: {', '.join(missing)} has no default; add {fix}")
    try:
        attributes = attributes_of(getattr(codec, "RECORDS", {}), (*beside, *message.values), given)
    except BadValue as error:
        raise Failure(f"{message.name}: {error}") from None
    try:
        built: MessageObject = codec.MESSAGES[message.name](
            **{address_attribute(name): number for name, number in address.items()},
            **attributes,
        )
    except codec.EncodeError as error:
        raise Failure(str(error)) from None
    return built


def fields(message: Message, found: link.Message) -> dict[str, Json]:
    """Return the values of a message object, for JSON."""
    return {
        value.name: to_json(value, _plain(value, found))
        for value in chosen(message.values, lambda name: getattr(found, attribute(name)))
    }


def _plain(value: Value, owner: object) -> Native:
    """The value of an attribute; a mapping for each record."""
    found: Native | Sequence[object] = getattr(owner, attribute(value.name))
    kind = value.type
    if found is None:
        return None
    if isinstance(kind, Records) and isinstance(found, Sequence):
        return [_mapping(kind.layout, each) for each in found]
    return _mapping(kind.layout, found) if isinstance(kind, Record) else found  # type: ignore[return-value]


def _mapping(layout: Layout, record: object) -> Mapping[str, Native]:
    own = chosen(layout.values, lambda name: getattr(record, attribute(name)))
    return {each.name: _plain(each, record) for each in own}


def _no_field(message: Message, name: str, known: list[str]) -> str:
    filled = [field.name for field in message.fields if field.name not in known]
    if name in filled:
        return f"{message.name}: '{name}' is filled in by the encoder; omit it"
    listed = f"its fields are {', '.join(known)}" if known else "it has no fields"
    return f"{message.name} has no field '{name}'; {did_you_mean(name, known) or listed}"
