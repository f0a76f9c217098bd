"""The schema file format: one class for each mapping, one attribute for each key.

These classes validate each mapping by itself; relations between them are checked while the model is built.
The JSON Schema for editors is generated from these classes, so editors show the descriptions.
"""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field, StrictInt
from pydantic.json_schema import JsonSchemaValue

from qlinkgen.schema.file_base import FileMapping, Names
from qlinkgen.schema.file_commands import CommandSpec, DefaultsSpec, MessageSpec, Replies
from qlinkgen.schema.file_fields import EnumSpec, FlagsSpec, GroupSpec, TypeSpec
from qlinkgen.schema.file_frames import FrameSpec, KindSpec, OrPartType
from qlinkgen.schema.kinds import Count, Id, Label, Name, NumberOrName, Order, Text, Time, WholeRange

#: A byte, as a number.
ByteNumber = Annotated[StrictInt, Field(ge=0, le=255)]


class ProtocolSpec(FileMapping):
    """Name and source of the protocol."""

    name: Name = Field(description="Prefix of generated names")
    title: Text = Field(default="", description="Display name")
    revision: Text = Field(description="Revision of the source document")
    source: Text = Field(description="Title of the source document")
    doc: Text = Field(default="", description="Purpose of the protocol")


class ResyncSpec(FileMapping):
    """How a host comes back in step with its device."""

    command: str = Field(
        description="Command without data or effect, whose answer shows that both are in step"
    )
    fill: ByteNumber = Field(
        default=0, description="Byte that ends a packet which the device has begun; the id of no command"
    )
    fills: dict[str, ByteNumber] = Field(
        default_factory=dict, description="Other bytes that end the packets of some commands"
    )


class SelectSpec(FileMapping):
    """What commands of a host act on, which others select."""

    attribute: str = Field(description="Attribute of commands, which also names the argument")
    values: list[Label] = Field(
        min_length=1, description="Its values for commands that act on the selected one"
    )
    commands: dict[str, Id] = Field(
        min_length=1, description="The commands that select, and the number of what each selects"
    )
    lost_by: Names = Field(
        default_factory=list, description="Commands after which it is unknown what is selected"
    )


class BusSpec(FileMapping):
    """The line and its nodes."""

    kind: Literal["master_slave", "link", "ring", "host"] = Field(description="Topology of the bus")
    sides: list[Name] | None = Field(
        default=None,
        min_length=2,
        max_length=2,
        description="The two ends of a link: the one that sends requests, and the other",
    )
    section: Text = Field(default="", description="Section of the source document that states it")
    nodes: WholeRange | None = Field(default=None, description="First..last address")
    broadcast: Id | None = Field(default=None, description="Address of all nodes at once")
    master: Id | None = Field(
        default=None, description="Number of the master in the destination and the source of frames"
    )
    baud: Count | None = Field(default=None, description="Usual speed of the line in bit/s")
    bits_per_byte: Annotated[StrictInt, Field(ge=1, le=16)] = Field(
        default=10, description="Bits on the line per byte: start, data, parity and stop bits"
    )
    response_within: Time | None = Field(default=None, description="Response time limit, if one is stated")
    resync: ResyncSpec | None = Field(
        default=None, description="How the host of one device comes back in step with it"
    )
    select: SelectSpec | None = Field(
        default=None, description="What commands of a host act on, which others select"
    )


class AttributeSpec(FileMapping):
    """A protocol-specific attribute of commands and messages."""

    doc: Text = Field(default="", description="Description, in one sentence")
    values: list[Label] | None = Field(default=None, min_length=1, description="Allowed values")
    type: str | None = Field(default=None, description="Integer type of a number that a checksum covers")


class SchemaFile(FileMapping):
    """A protocol: identity, types, frame, bus, and commands or messages."""

    qlinkgen: Literal[1] = Field(description="Version of the file format")
    protocol: ProtocolSpec = Field(description="Name and source of the protocol")
    include: str | None = Field(
        default=None,
        description="Schema beside or below this file, whose types, commands and messages it has too",
    )
    byteorder: Order = Field(default="big", description="Default byte order of integers")
    groups: GroupSpec | None = Field(
        default=None, description="Default groups of integers that are not sent in whole bytes"
    )
    enums: dict[str, EnumSpec] = Field(default_factory=dict, description="Named numbers")
    flags: dict[str, FlagsSpec] = Field(default_factory=dict, description="Named bits")
    types: dict[str, Annotated[TypeSpec, OrPartType]] = Field(
        default_factory=dict, description="Named types of fields and of parts, and records"
    )
    frame: FrameSpec = Field(
        default_factory=FrameSpec, description="The frame around each message, unless there are several kinds"
    )
    frames: dict[str, KindSpec] = Field(
        default_factory=dict,
        description="Kinds of frame by name, told apart by the constants they begin with",
    )
    bus: BusSpec = Field(description="The line and its nodes")
    attributes: dict[str, AttributeSpec] = Field(
        default_factory=dict, description="Protocol-specific attributes of commands"
    )
    defaults: DefaultsSpec = Field(default_factory=DefaultsSpec, description="Defaults for commands")
    replies: Replies = Field(
        default_factory=dict, description="Answers other than the response, of all answered commands"
    )
    to_unknown: dict[str, dict[str, NumberOrName]] = Field(
        default_factory=dict,
        description="Reply of a slave to a request with an unknown id, by its name; values of its fields",
    )
    commands: dict[str, CommandSpec] = Field(default_factory=dict, description="Transactions by name")
    messages: dict[str, MessageSpec] = Field(
        default_factory=dict, description="Messages without a response, by name"
    )


def json_schema() -> JsonSchemaValue:
    """JSON Schema of the file format, for editors."""
    schema = SchemaFile.model_json_schema()
    return {"$schema": "https://json-schema.org/draft/2020-12/schema", **schema}
