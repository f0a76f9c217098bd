"""Every rule a schema file is held to: its id, what it says and why. docs/rules.md is made from this list."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal


@dataclass(frozen=True, slots=True)
class Rule:
    """A rule for schema files.

    Attributes:
        id: what stands in brackets in a message.
        summary: the rule, in one sentence.
        reason: why it is one, and how to satisfy it.
        severity: a warning does not keep a file from being used.
    """

    id: str
    summary: str
    reason: str
    severity: Literal["error", "warning"] = "error"


_ALL = (
    Rule(
        "yaml-syntax",
        "The file is YAML.",
        "Nothing can be read behind the first fault of notation, so it is reported alone.",
    ),
    Rule(
        "control-character",
        "Texts hold no control characters, line separators or marks that reorder text.",
        "They are commands to a terminal, end lines of generated code, or make a reader see something else "
        "than a compiler. Line breaks and tabs are allowed.",
    ),
    Rule(
        "file-unreadable",
        "The file can be read as UTF-8 text.",
        "The path must name a file with readable text.",
    ),
    Rule(
        "duplicate-key", "A key stands once in a mapping.", "YAML would silently keep one of the two values."
    ),
    Rule("unknown-key", "Only known keys are used.", "A misspelt key would silently have no effect."),
    Rule(
        "missing-key",
        "Required keys are there.",
        "Nothing can be made without them, and no default would be right for every protocol.",
    ),
    Rule(
        "wrong-type",
        "A value is of the kind that its key needs.",
        "A number, text, a list and a mapping mean different things.",
    ),
    Rule(
        "bad-value",
        "A value is written in its notation and is one of those allowed.",
        "The schema reference lists the notations.",
    ),
    Rule(
        "bad-name",
        "Names are at most 40 lower case letters, digits and underscores, and begin with a letter.",
        "They become names in Python and C.",
    ),
    Rule(
        "unknown-type",
        "A type is built in or defined under types, enums or flags.",
        "A name that nobody defined has no layout.",
    ),
    Rule(
        "type-clash",
        "A name stands for one type.",
        "enums, flags and types share one name space, with the built-in types.",
    ),
    Rule("recursive-type", "A named type does not contain itself.", "Its layout would never end."),
    Rule(
        "bad-width",
        "An integer has 8, 16, 24 ... 64 bits, or is sent in groups.",
        "Other widths have no place in whole bytes; use bits, or groups whose parts cover it once.",
    ),
    Rule(
        "not-applicable",
        "A key is used only with types that it means something for.",
        "A scale on text or a count on a number would have no effect.",
    ),
    Rule(
        "value-does-not-fit",
        "A constant, default, enum value or flag fits its integer.",
        "It could not be sent.",
    ),
    Rule(
        "range-does-not-fit",
        "A range lies inside what the integer can hold.",
        "Some of its values could not be sent.",
    ),
    Rule(
        "default-out-of-range",
        "A default lies in the range.",
        "A message with its defaults must be one that can be sent.",
    ),
    Rule(
        "bad-scale",
        "A scale is not zero, and every bound and default is a whole number of steps.",
        "The value could not be represented exactly.",
    ),
    Rule(
        "inexact-scale",
        "Values of more than 53 bits have a scale whose decimal form ends.",
        "They are carried as decimal numbers, and 1/3 has none that ends.",
    ),
    Rule(
        "duplicate-value",
        "A number of an enum and a bit of flags have one name.",
        "Decoding could not choose between two.",
    ),
    Rule("bits-overlap", "Bit fields do not overlap.", "Both would write the same bit."),
    Rule("bits-do-not-fit", "Bit fields lie inside their integer.", "There is no such bit."),
    Rule(
        "bad-count",
        "A count names a later field of variable size in the same message, and is wide enough for it.",
        "The codec fills and verifies it. It precedes a field that takes the rest of the payload.",
    ),
    Rule(
        "two-open-ends",
        "At most one field of a message takes the rest of the payload.",
        "Nobody could tell where one ends and the other begins; give one of them a count.",
    ),
    Rule("bad-array", "Arrays hold plain integers.", "Give scaled or named values a field of their own."),
    Rule(
        "payload-too-long",
        "A message's payload fits the frame.",
        "A longer one could not be sent, and receivers would not have room for it.",
    ),
    Rule(
        "payload-too-short",
        "A message's payload is as long as the frame demands.",
        "A shorter one could not be sent.",
    ),
    Rule(
        "bad-frame",
        "A frame is described in one of the three ways, and completely.",
        "See the schema reference: parts, marked or packet.",
    ),
    Rule(
        "unknown-part",
        "Parts named by length, checksum or stuffing are parts of the frame.",
        "What is not there cannot be counted, covered or exempt.",
    ),
    Rule("length-does-not-fit", "The length field can hold the longest frame.", "It would wrap around."),
    Rule(
        "unknown-algorithm",
        "A checksum is one of the CRC catalogue, or a sum.",
        "The catalogue's names and their aliases are understood.",
    ),
    Rule(
        "ambiguous-algorithm",
        "The name of a checksum means one algorithm.",
        "Documents use crc16-ccitt, crc-16 and crc-32 for algorithms that give different values.",
        "warning",
    ),
    Rule(
        "checksum-does-not-fit",
        "A checksum is as wide as its algorithm.",
        "Bits would be lost; say with sent which bits go onto the wire.",
    ),
    Rule(
        "part-order",
        "Parts are named once, and in wire order.",
        "A checksum over the same bytes in another order is another checksum.",
    ),
    Rule(
        "preamble-not-unique",
        "Stuffing keeps the preamble from appearing inside a frame.",
        "Otherwise it costs bytes and gains nothing: a receiver still has to look for false preambles.",
        "warning",
    ),
    Rule(
        "no-frame-end",
        "A receiver can tell where every frame ends.",
        "Without a length in the frame, the fields of a message must have fixed sizes or counts.",
    ),
    Rule(
        "marker-in-payload",
        "No payload byte of a marked frame can carry the marker bit.",
        "It would be taken for a header or an end.",
    ),
    Rule(
        "bad-packet",
        "A packet is one byte of message id, whole words, and a sum.",
        "It has no frame around it, so everything else must be known from the id.",
    ),
    Rule(
        "unknown-message",
        "Messages, commands and fields that are referred to exist.",
        "A name that nobody defined has no effect.",
    ),
    Rule(
        "overlapping-id",
        "No two messages of a direction have the same id.",
        "A receiver could not tell them apart.",
    ),
    Rule("id-does-not-fit", "A message id fits its place in the frame.", "It could not be sent."),
    Rule(
        "bad-addressing",
        "Addressing fits the frame and the bus.",
        "A broadcast needs a broadcast address that is no node's, a node an address in the frame.",
    ),
    Rule(
        "address-does-not-fit",
        "Node numbers and the broadcast address fit the frame's address.",
        "They could not be sent.",
    ),
    Rule(
        "bad-repeat",
        "A command says whether it may be repeated, and its repeat counter is a plain unsigned integer.",
        "A master repeats a request when no answer came; doing so must be known to be safe.",
    ),
    Rule(
        "bad-response",
        "A command says what is asked and what is answered, and addressing agrees with it.",
        "Write response: {} for an answer without data, response: none for no answer.",
    ),
    Rule(
        "bad-echo",
        "An echo stands in a response, and its request has a field of the same name and type.",
        "By it a master tells the answer to its request from another; nothing else can be repeated.",
    ),
    Rule(
        "unknown-attribute",
        "Attributes of commands are declared, with their values.",
        "A misspelt attribute would silently have no effect.",
    ),
    Rule(
        "name-clash",
        "Names stay different after they are turned into Python and C names.",
        "One of the two would be lost.",
    ),
    Rule(
        "empty-protocol",
        "A protocol has at least one command or message.",
        "There would be nothing to generate.",
    ),
    Rule(
        "unused-type",
        "Types, enums and flags are used.",
        "What nobody uses is often a misspelt name.",
        "warning",
    ),
    Rule(
        "unconfirmed",
        "What a weak source states is marked, and its use is announced.",
        "Confirm it at the device before trusting it.",
        "warning",
    ),
)

#: Rules by id.
RULES = {rule.id: rule for rule in _ALL}
