"""The rules for schema files: id, summary and reason. docs/rules.md is generated from this list."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal


@dataclass(frozen=True, slots=True)
class Rule:
    """A rule for schema files.

    Attributes:
        id: the text in brackets in a message.
        summary: the rule, in one sentence.
        reason: the reason for it, and how to satisfy it.
        severity: a file with only warnings can be used.
    """

    id: str
    summary: str
    reason: str
    severity: Literal["error", "warning"] = "error"


_ALL = (
    Rule(
        "yaml-syntax",
        "The file is YAML.",
        "Parsing stops at the first syntax error, so it is the only one reported.",
    ),
    Rule(
        "control-character",
        "Texts do not contain control characters, line separators or marks that reorder text.",
        "They control terminals, end lines of generated code, or display text that differs from what a "
        "compiler reads. Line breaks and tabs are allowed.",
    ),
    Rule(
        "file-unreadable",
        "The file can be read as UTF-8 text.",
        "The path must name a readable text file.",
    ),
    Rule(
        "duplicate-key", "A key occurs once in a mapping.", "YAML would silently keep one of the two values."
    ),
    Rule("unknown-key", "Only known keys are used.", "A misspelt key would silently have no effect."),
    Rule(
        "missing-key",
        "Required keys are present.",
        "They have no default that would be right for every protocol.",
    ),
    Rule(
        "wrong-type",
        "A value has the type that its key needs.",
        "A number, text, a list and a mapping mean different things.",
    ),
    Rule(
        "bad-value",
        "A value has the notation of its key and is allowed there.",
        "The schema reference lists the notations.",
    ),
    Rule(
        "bad-name",
        "Names consist of at most 40 lower-case letters, digits and underscores, and begin with a letter.",
        "They become names in Python and C.",
    ),
    Rule(
        "unknown-type",
        "A type is built in or defined under types, enums or flags.",
        "An undefined type has no layout.",
    ),
    Rule(
        "type-clash",
        "A name denotes one type.",
        "enums, flags and types share one name space with the built-in types.",
    ),
    Rule("recursive-type", "A named type does not contain itself.", "Its layout would be infinite."),
    Rule(
        "bad-width",
        "An integer has 8, 16, 24 ... 128 bits, or up to 64 in groups.",
        "Other widths do not fill whole bytes; use bits, or groups whose parts cover each bit once.",
    ),
    Rule(
        "bad-separator",
        "A separator divides texts that do not contain it, in a frame whose end is known.",
        "A receiver finds the end of a field by the separator after it.",
    ),
    Rule(
        "bad-digits",
        "A number as text has room for its digits, the type of an address holds each number of them, "
        "and a receiver finds the end of a text.",
        "Decimal digits show steps of 1, 1/10, 1/100 and so on exactly, and no others. A text of varying "
        "size ends at a separator.",
    ),
    Rule(
        "not-applicable",
        "A key is used only with types that it applies to.",
        "A scale on text or a count on a number would have no effect.",
    ),
    Rule(
        "value-does-not-fit",
        "A constant, default, enum value or flag fits its integer.",
        "It could not be sent.",
    ),
    Rule(
        "range-does-not-fit",
        "A range is within the range of its integer.",
        "Some of its values could not be sent.",
    ),
    Rule(
        "default-out-of-range",
        "A default is in the range of its field.",
        "A message with default values must be sendable.",
    ),
    Rule(
        "bad-scale",
        "A scale is not zero, and every bound and default is a whole number of steps.",
        "The value could not be represented exactly.",
    ),
    Rule(
        "inexact-scale",
        "Values of more than 53 bits have a scale with a finite decimal expansion.",
        "They are represented as decimal numbers, and 1/3 has no finite decimal expansion.",
    ),
    Rule(
        "duplicate-value",
        "A number of an enum or a bit of flags has one name; a list of constants has a number once.",
        "With two names, decoding would be ambiguous. A repeated constant is a slip for another one.",
    ),
    Rule("bits-overlap", "Bit fields do not overlap.", "Both would write the same bit."),
    Rule("bits-do-not-fit", "Bit fields are inside their integer.", "The integer does not have such a bit."),
    Rule(
        "bad-count",
        "A count names a later field of variable size in the same message, and is wide enough for it.",
        "The codec fills and verifies it. It must precede a field that takes the rest of the payload. "
        "Bits in a row need a count of their items, as the size of the payload leaves their number open. "
        "A count of the bytes of several fields tells the size of one; the others have a constant size.",
    ),
    Rule(
        "two-open-ends",
        "At most one field of a message takes the rest of the payload.",
        "The boundary between two such fields is unknown; give one of them a count.",
    ),
    Rule(
        "bad-array",
        "An array has at least one item of one integer or floating-point type.",
        "Use separate fields for values that differ.",
    ),
    Rule(
        "bad-condition",
        "A field that may be absent depends on earlier values, or is at the end of the payload.",
        "Receivers decide field by field whether it is present: an earlier field, or the frame, has a value "
        "for it, or the payload ends before it. Each frame has such a value, which its caller gives; the "
        "frame has a length or a terminator, and is the only kind. Where that field is absent by its own if, "
        "this one is too. Fields after one that takes the rest are always present, or absent wherever it is "
        "present. A count has the condition of the field that it counts. Some number of each tested "
        "value meets the conditions on it.",
    ),
    Rule(
        "bad-link",
        "Only a link has sides, which are two; messages and requests come from them.",
        "Neither side of a link is its master: each sends messages. The first of its `sides` also sends the "
        "requests of commands, and the other one answers, unless `from` says otherwise. Where both ask, each "
        "has a receiver for requests and one for answers, and tells them by their numbers; what one takes, "
        "the other passes over, for which frames have an end and a check value of their own.",
    ),
    Rule(
        "bad-resync",
        "A host comes back in step by a command that reads, and selects by commands without data.",
        "The start of a packet is not marked. After a wrong answer the device may wait for the rest of a "
        "packet: `fill` ends it, one byte at a time, and does nothing to a device in step; the right answer "
        "to the command shows that both are in step. The host sends this command, and those that select, of "
        "itself, and their answers have a check value.",
    ),
    Rule(
        "part-type",
        "A named type with roles is that of parts of frames.",
        "A role says what the engine does with bits of a frame; a field of a message has none.",
    ),
    Rule(
        "part-direction",
        "A part whose `if` names the direction is in all frames of one direction, and in none of the other.",
        "Nothing else decides, and one receiver finds the frames of both: they begin alike and have "
        "the same roles; what a part counts, covers or equals is there wherever the part is.",
    ),
    Rule(
        "long-length",
        "A length that hands over to a longer one has a number for that, which no shorter frame has.",
        "The longer one counts the same, comes directly before the payload, and gives sizes that the first "
        "one cannot state. Both count bytes, and nothing repeats the first one.",
    ),
    Rule(
        "part-condition",
        "A part that only some frames have holds values, and the header tells whether it is there.",
        "Values before the payload decide, and a length gives the size of the payload. Such parts come last "
        "in the header or in the frame, and all there have one condition; no length counts them. A check "
        "value after the payload may cover those of the header. Last in the frame, constants and check "
        "values over other parts may be such parts, and depend on the length as well.",
    ),
    Rule(
        "bad-terminated",
        "A terminator is a byte that follows text or bytes of variable size, and does not occur in them.",
        "A receiver finds the end of the text by it, and needs room for the longest one.",
    ),
    Rule(
        "bad-switch",
        "The cases of a choice exclude each other, and there is one for every value of an earlier field.",
        "Encoders and receivers choose the case by that field, which is always present: a whole number, an "
        "enum or a bool. `default` is the case of all other values; {} is one without a value.",
    ),
    Rule(
        "bad-record",
        "A record has a value, at least one byte, and an end that its own bytes tell.",
        "Records of variable size are read one after the other. A field that takes the rest of the payload "
        "is in a single record, after which nothing follows, or in the last one of an array; there it has an "
        "if, or is a case of a choice. An array of them has a bound, as structs of C have room for all. "
        "Where last ends an array, a new record is a last one, and the bounds are [1..N].",
    ),
    Rule(
        "extent-depth",
        "Records are inside each other at most three levels deep.",
        "Firmware decodes them without recursion, level by level.",
    ),
    Rule(
        "payload-too-long",
        "A message's payload fits the frame.",
        "A longer one could not be sent, and receive buffers would be too small.",
    ),
    Rule(
        "payload-too-short",
        "A message's payload has at least the minimum size of the frame.",
        "A shorter one could not be sent.",
    ),
    Rule(
        "bad-frame",
        "A frame is described completely, in one of three ways.",
        "See the schema reference: parts, marked or packet.",
    ),
    Rule(
        "bad-kinds",
        "The first bytes of kinds of frame tell them apart; each message knows its kind.",
        "A receiver tries each kind of its direction where one may begin. A kind with if: {direction: "
        "request} has no answers, and may begin like one of the other direction; one with parts of one "
        "direction has no messages without a direction. Kinds have no idle line and no trim, do not "
        "end with the bytes that they begin with, and no coding of their first part. A value or a counter of "
        "several kinds is the same in all. A message without frame travels in the kinds that no message "
        "names, which then have the same parts except constants, lengths and check values; the shortest one "
        "that fits is sent.",
    ),
    Rule(
        "short-frame",
        "A frame of one or two bytes is an answer, or has a check value, or is a byte and its complement.",
        "Noise contains every byte. Who waits for an answer knows when one may come.",
    ),
    Rule(
        "unknown-part",
        "Length, checksum and stuffing name parts of the frame.",
        "The name does not refer to a part of this frame.",
    ),
    Rule("length-does-not-fit", "The length field can hold the longest frame.", "It would overflow."),
    Rule(
        "unknown-algorithm",
        "A checksum is a CRC of the catalogue, a sum, or a CRC by its parameters.",
        "Names of the catalogue and their aliases are accepted.",
    ),
    Rule(
        "crc-parameters",
        "The parameters of a CRC fit its width, and give the check value that the document states.",
        "A CRC with an even polynomial misses errors; a wrong parameter makes every frame invalid.",
    ),
    Rule(
        "ambiguous-algorithm",
        "The name of a checksum is unambiguous.",
        "Documents use crc16-ccitt, crc-16 and crc-32 for several different algorithms.",
        "warning",
    ),
    Rule(
        "checksum-does-not-fit",
        "A checksum has the width of its algorithm.",
        "Bits would be lost; use sent to select the bits on the wire.",
    ),
    Rule(
        "check-cycle",
        "Check values do not cover each other.",
        "Each would have to be computed before the other.",
    ),
    Rule(
        "check-seed",
        "A message has every attribute that a check value covers; messages with one id have the same.",
        "Otherwise the check value of the message could not be computed.",
    ),
    Rule(
        "check-blocks",
        "Check values of blocks follow the payload, whose size a length gives.",
        "They are sent inside it, after each block: a receiver needs the end of the last one.",
    ),
    Rule(
        "bad-trim",
        "Zeros that are not sent can be added again: a length gives the size of the rest.",
        "A receiver adds them up to the constant size of the message.",
    ),
    Rule(
        "part-order",
        "Parts are listed once, in wire order.",
        "A checksum depends on the order of the bytes.",
    ),
    Rule(
        "preamble-not-unique",
        "Stuffing prevents the preamble from occurring inside a frame.",
        "Otherwise it costs bytes without a benefit: receivers still have to handle false preambles.",
        "warning",
    ),
    Rule(
        "no-frame-end",
        "A receiver can determine the end of every frame.",
        "Without a length, a terminator or an idle line that alone ends a frame, the fields of a message "
        "must have fixed sizes or counts.",
    ),
    Rule(
        "terminator-in-frame",
        "The terminator of a frame cannot occur before it.",
        "A receiver would end the frame there. One of its bytes must be impossible before it: by a coding, "
        "or by the ranges and types of numbers and fields.",
    ),
    Rule(
        "bad-coding",
        "A coding is of one kind, can be decoded, and applies to adjacent parts.",
        "Bytes that are sent alike could not be told apart.",
    ),
    Rule(
        "marker-in-payload",
        "Payload bytes of a marked frame cannot have the marker bit.",
        "A receiver would take such a byte for a header or an end.",
    ),
    Rule(
        "bad-packet",
        "A packet consists of one byte of message id, whole words, and a sum.",
        "It has no frame, so everything else must follow from the id.",
    ),
    Rule(
        "unknown-message",
        "References name existing messages, commands and fields.",
        "A reference to an unknown name would have no effect.",
    ),
    Rule(
        "overlapping-id",
        "Messages of one direction have different ids.",
        "A receiver could not distinguish them.",
    ),
    Rule(
        "bad-derivation",
        "A check value or a derived number of a payload follows from fields right before it.",
        "Encoders fill it in and decoders compare it, so the places of the bytes that it follows from are "
        "known: fields of the same message or record, one after the other, of constant or counted size. "
        "It is an unsigned integer of whole bytes, and what is added to it is within its range.",
    ),
    Rule("id-does-not-fit", "A message id fits its part of the frame.", "It could not be sent."),
    Rule(
        "bad-addressing",
        "Addressing fits the frame and the bus.",
        "A broadcast needs an address that differs from all nodes, a node an address in the frame.",
    ),
    Rule(
        "bad-party",
        "The destination and the source of frames tell the node from the master.",
        "In a request the node is the destination, in a response the source; the other one is the master, "
        "whose number is `master` of the bus. A frame has both, or an address and the one that is the "
        "master. On a link without commands both are values of every frame.",
    ),
    Rule(
        "address-does-not-fit",
        "Node numbers and the broadcast address fit the frame's address.",
        "They could not be sent.",
    ),
    Rule(
        "bad-repeat",
        "A command states whether it may be repeated; a repeat counter is a plain unsigned integer.",
        "A master repeats a request after a missing response, which must be safe.",
    ),
    Rule(
        "bad-response",
        "A command states request and response, and addressing agrees with them.",
        "Write response: {} for a response without data, response: none for no response.",
    ),
    Rule(
        "bad-reply",
        "A reply belongs to an answered command and has an id; one of its fields may decide what it means.",
        "The master decides by it whether a call fails, repeats the request or waits on.",
    ),
    Rule(
        "bad-many",
        "Several answers to a request have one end: a number of them, a field, a reply, a time, a list or "
        "another command.",
        "Without an end a master would wait for a further answer after the last one.",
    ),
    Rule(
        "bad-steps",
        "The steps of a dialogue follow its request in order; each is one frame, and one of them answers.",
        "Both sides follow the same list, without loops or choices, and one request goes to one node. "
        "So it is with a response that only its turn tells.",
    ),
    Rule(
        "bad-fixed",
        "Beside the pieces of a message id, id states values of every frame that are always the same.",
        "An encoder refuses another value, and a receiver takes no frame with another one for the message.",
    ),
    Rule(
        "bad-text-id",
        "An id of several lengths begins the payload, and no id and payload are taken for a longer id.",
        "Receivers find a message by the longest id that a payload begins with, and the frame by its end.",
    ),
    Rule(
        "bad-echo",
        "A field of an answer repeats a field of its request, or a part of its frame, that it can hold.",
        "It identifies the request that a response belongs to.",
    ),
    Rule(
        "bad-proof",
        "A check value that covers parts of the frame of a request is the last field of a response that its "
        "turn tells, and covers the fields directly before it after them.",
        "Only a master that has sent the request knows these bytes, and has them in the order of the list.",
    ),
    Rule(
        "unknown-attribute",
        "Attributes of commands are declared, with their values.",
        "A misspelt attribute would silently have no effect.",
    ),
    Rule(
        "name-clash",
        "Names remain distinct after conversion to Python and C names.",
        "One of the two would be lost.",
    ),
    Rule(
        "empty-protocol",
        "A protocol has at least one command or message.",
        "Otherwise there is nothing to generate.",
    ),
    Rule(
        "bad-include",
        "An included file is a schema beside or below the including one, and includes no other.",
        "Its enums, flags, types, attributes, replies, commands and messages are taken over; what the file "
        "has under the same names replaces them, key by key.",
    ),
    Rule(
        "wrong-example",
        "The bytes of an example are a frame of its message, with the values given.",
        "An example is a frame of the source document, so it shows whether the description is right. Values "
        "that are left out have their defaults.",
    ),
    Rule(
        "unused-type",
        "Types, enums and flags are used.",
        "An unused name is often a typo.",
        "warning",
    ),
    Rule(
        "unconfirmed",
        "Facts from a weak source are marked, and their use is reported.",
        "Check them on the device before relying on them.",
        "warning",
    ),
)

#: Rules by id.
RULES = {rule.id: rule for rule in _ALL}
