"""Words of other tools and documents, and what is written here instead: hints for errors.

Every word is compared in lower case, without underscores, hyphens and blanks.
"""

from __future__ import annotations

import re
from collections.abc import Collection

#: Keys: the key here, and how it is used. Only keys of the mapping in which the word was found are suggested.
_KEYS: dict[str, tuple[tuple[str, str], ...]] = {
    "endian": (("byteorder", "little or big"),),
    "endianness": (("byteorder", "little or big"),),
    "order": (("byteorder", "little or big"),),
    "min": (("range", "first..last"),),
    "max": (("range", "first..last"),),
    "minimum": (("range", "first..last"),),
    "maximum": (("range", "first..last"),),
    "limits": (("range", "first..last"),),
    "minvalue": (("range", "first..last"),),
    "maxvalue": (("range", "first..last"),),
    "factor": (("scale", "the value of one step, like 1/10"),),
    "multiplier": (("scale", "the value of one step, like 1/10"),),
    "resolution": (("scale", "the value of one step, like 1/10"),),
    "scaling": (("scale", "the value of one step, like 1/10"),),
    "lsb": (("scale", "the value of one step, like 1/10"),),
    "divisor": (("scale", "the value of one step, like 1/10"),),
    "units": (("unit", "mm"),),
    "description": (("doc", "text"),),
    "desc": (("doc", "text"),),
    "comment": (("doc", "text"),),
    "brief": (("doc", "text"),),
    "value": (("const", "the number"),),
    "constant": (("const", "the number"),),
    "fixed": (("const", "the number"),),
    "magic": (("const", "the number"),),
    "initial": (("default", "the value"),),
    "bitfield": (("bits", "{name: first..last}"),),
    "bitfields": (("bits", "{name: first..last}"),),
    "bitmask": (("bits", "{name: first..last}"),),
    "mask": (("bits", "{name: first..last}"),),
    "bit": (("at", "first..last"), ("bits", "{name: first..last}")),
    "position": (("at", "first..last"),),
    "padding": (("pad", "00"),),
    "fill": (("pad", "00"),),
    "encoding": (("as", "bcd"),),
    "format": (("as", "bcd"),),
    "enum": (("enums", "{name: {type: u8, values: {one: 1}}}"), ("type", "the name of one under enums")),
    "values": (("type", "the name of one under enums"),),
    "choices": (("values", "{one: 1}"), ("type", "the name of one under enums")),
    "members": (("values", "{one: 1}"),),
    "structs": (("types", "{name: {type: u8}}"),),
    "fields": (("request", "{name: u8}"),),
    "const": (("range", "the number, and default: the number"),),
    "switch": (("fields", "{kind: u8, value: {switch: kind, cases: {..}}}; a record holds a choice"),),
    "payload": (("request", "{name: u8}"),),
    "reply": (("response", "{name: u8}"),),
    "answer": (("response", "{name: u8}"),),
    "code": (("id", "a number"),),
    "opcode": (("id", "a number"),),
    "number": (("id", "a number"),),
    "cmd": (("id", "a number"),),
    "timeout": (("response_within", "5 ms"), ("within", "5 ms")),
    "wait": (("within", "5 ms, the time that the other side has"),),
    "each": (("send", "MESSAGE once for each frame; a program repeats commands"),),
    "loop": (("send", "MESSAGE once for each frame; a program repeats commands"),),
    "steps": (("send", "MESSAGE once for each frame; a program repeats commands"),),
    "baudrate": (("baud", "9600"),),
    "speed": (("baud", "9600"),),
    "addresses": (("nodes", "1..16"),),
    "crc": (("algorithm", "crc-16/modbus"),),
    "checksum": (("algorithm", "crc-16/modbus"),),
    "algo": (("algorithm", "crc-16/modbus"),),
    "poly": (("algorithm", "crc-16/modbus"),),
    "covers": (("over", "[part, part]"),),
    "direction": (("response", "{name: u8}"),),
}
_SIZE = (
    "write the number in the type, like bytes[4] or u16[0..8]; a field that counts another has counts: FIELD"
)
_SIZES = frozenset(
    ("size", "length", "len", "count", "repeat", "maxsize", "maxlength", "number", "arraysize")
)

#: Types: pattern and replacement, which may have groups of the pattern.
_TYPES: tuple[tuple[str, str], ...] = (
    (r"u?int(8|16|24|32|40|48|56|64|128)(t|be|le)?", r"\1"),
    (r"s(8|16|24|32|64)", r"i\1"),
    (r"(?:float|real|single)(?:32)?", "f32"),
    (r"(?:double|float64|real64|lreal)", "f64"),
    (r"(?:half|float16|real16)", "f16"),
    (r"(?:byte|octet|uchar|unsignedchar|usint)", "u8"),
    (r"(?:word|ushort|unsignedshort)", "u16"),
    (r"(?:dword|ulong|unsignedint|unsignedlong|udint)", "u32"),
    (r"(?:qword|ulint)", "u64"),
    (r"(?:sbyte|schar|sint)", "i8"),
    (r"short", "i16"),
    (r"(?:long|dint)", "i32"),
    (r"(?:longlong|lint)", "i64"),
    (r"(?:boolean|flag|bit)", "bool"),
    (r"(?:string|str|char|ascii|cstring|strz)", "text"),
    (r"(?:blob|binary|array|buffer|raw|data|octets|bytearray|opaque)", "bytes"),
)

_VALUES = {
    **dict.fromkeys(("le", "littleendian", "lsb", "lsbfirst", "intel"), "little"),
    **dict.fromkeys(("be", "bigendian", "msb", "msbfirst", "motorola", "network"), "big"),
    **dict.fromkeys(("masterslave", "bus", "rs485"), "master_slave"),
}


def _plain(word: str) -> str:
    return re.sub(r"[_\-\s]", "", word[:40].lower())


def key_hint(word: str, known: Collection[str], *, field: bool) -> str:
    """The hint for an unknown key, "" if there is none; ``field``: it was found in a field."""
    plain = _plain(word)
    for key, usage in _KEYS.get(plain, ()):
        if key in known:
            return f"write {key}: {usage}"
    return _SIZE if field and plain in _SIZES else ""


def type_hint(text: str) -> str:
    """The hint for an unknown type, which may have a number of items in brackets; "" if there is none."""
    base, bracket, count = text.partition("[")
    plain = _plain(base)
    if match := re.fullmatch(_TYPES[0][0], plain):
        kind = f"{'u' if plain[0] == 'u' else 'i'}{match[1]}"
        order = {"be": "big", "le": "little"}.get(match[2] or "")
        return f"write {kind}{bracket}{count}" + (f" with byteorder: {order}" if order else "")
    for pattern, known in _TYPES[1:]:
        if match := re.fullmatch(pattern, plain):
            return f"write {match.expand(known)}{bracket}{count}"
    return ""


def value_hint(word: str, allowed: Collection[str]) -> str:
    """The hint for a word that is none of the allowed ones, "" if there is none."""
    meant = _VALUES.get(_plain(word), "")
    return f"write {meant}" if meant in allowed else ""
