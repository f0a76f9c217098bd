"""Functions for numbers as text: decimal and hexadecimal digits."""

from __future__ import annotations

from collections.abc import Collection
from typing import Literal

from qlinkgen.backends.c.forms import Helper
from qlinkgen.backends.c.real_texts import PUT, READ
from qlinkgen.model.digits import Digits

#: A function that a header needs: it reads, writes, or tells the number of characters.
Verb = Literal["get", "put", "size"]

_READ_DECIMAL = """\
static inline bool {p}_read_decimal_(
    const uint8_t *from, size_t size, size_t point, uint64_t low, uint64_t high, uint64_t *value)
{{
    const bool negative = (size > 0U) && (low > 0U) && (from[0] == 0x2DU);
    const bool positive = (size > 0U) && (low > 0U) && (from[0] == 0x2BU);
    const uint64_t most = negative ? low : high;
    uint64_t found = 0U;
    size_t digits = 0U;
    size_t after = 0U;
    bool pointed = false;
    size_t index = 0U;
    if (negative || positive) {{
        index = 1U;
    }}
    for (; index < size; ++index) {{
        const uint8_t octet = from[index];
        const uint64_t digit = (uint64_t)octet - 0x30U;
        if ((octet == 0x2EU) && !pointed) {{
            pointed = true;
        }} else if (digit > 9U) {{
            return false;
        }} else {{
            digits = 1U;
            if (pointed && (after >= point)) {{
                if (digit > 0U) {{
                    return false;
                }}
            }} else {{
                if ((digit > most) || (found > ((most - digit) / 10U))) {{
                    return false;
                }}
                found = (found * 10U) + digit;
                after += pointed ? 1U : 0U;
            }}
        }}
    }}
    for (; after < point; ++after) {{
        if (found > (most / 10U)) {{
            return false;
        }}
        found *= 10U;
    }}
    if (negative) {{
        found = 0ULL - found;
    }}
    *value = found;
    return digits > 0U;
}}

static inline bool {p}_is_decimal_(
    const uint8_t *from, size_t size, size_t point, uint64_t low, uint64_t high)
{{
    uint64_t value = 0U;
    return {p}_read_decimal_(from, size, point, low, high, &value);
}}

static inline uint64_t {p}_get_decimal_(
    const uint8_t *from, size_t size, size_t point, uint64_t low, uint64_t high)
{{
    uint64_t value = 0U;
    (void){p}_read_decimal_(from, size, point, low, high, &value);
    return value;
}}"""

_PUT_DECIMAL = """\
static inline void {p}_put_decimal_(uint8_t *to, size_t size, size_t point, uint64_t value, uint64_t sign)
{{
    const bool negative = (value & sign) != 0U;
    uint64_t left = negative ? ((sign << 1) - value) : value;
    for (size_t index = size; index > 0U; --index) {{
        if ((point > 0U) && ((size - index) == point)) {{
            to[index - 1U] = 0x2EU;
        }} else {{
            to[index - 1U] = (uint8_t)(0x30U + (left % 10U));
            left /= 10U;
        }}
    }}
    if (negative) {{
        to[0] = 0x2DU;
    }}
}}"""

_PUT_SPACED = """\
static inline void {p}_put_spaced_(uint8_t *to, size_t size, size_t point, uint64_t value, uint64_t sign)
{{
    const size_t used = {p}_size_decimal_(1U, size, point, value, sign);
    for (size_t index = 0U; index < (size - used); ++index) {{
        to[index] = 0x20U;
    }}
    {p}_put_decimal_(&to[size - used], used, point, value, sign);
}}"""

_READ_SPACED = """\
static inline size_t {p}_spaces_(const uint8_t *from, size_t size)
{{
    size_t index = 0U;
    while ((index < size) && (from[index] == 0x20U)) {{
        ++index;
    }}
    return index;
}}

static inline bool {p}_is_spaced_(
    const uint8_t *from, size_t size, size_t point, uint64_t low, uint64_t high)
{{
    const size_t spaces = {p}_spaces_(from, size);
    return {p}_is_decimal_(&from[spaces], size - spaces, point, low, high);
}}

static inline uint64_t {p}_get_spaced_(
    const uint8_t *from, size_t size, size_t point, uint64_t low, uint64_t high)
{{
    const size_t spaces = {p}_spaces_(from, size);
    return {p}_get_decimal_(&from[spaces], size - spaces, point, low, high);
}}"""

_SIZE_DECIMAL = """\
static inline size_t {p}_size_decimal_(size_t least, size_t most, size_t point, uint64_t value, uint64_t sign)
{{
    const bool negative = (value & sign) != 0U;
    uint64_t left = negative ? ((sign << 1) - value) : value;
    size_t size = 1U;
    while (left > 9U) {{
        left /= 10U;
        ++size;
    }}
    size = (size > point) ? size : (point + 1U);
    if (point > 0U) {{
        ++size;
    }}
    if (negative) {{
        ++size;
    }}
    if (size > most) {{
        size = most; /* the value is out of range */
    }}
    return (size > least) ? size : least;
}}"""

_READ_HEX = """\
static inline bool {p}_read_hex_(const uint8_t *from, size_t size, uint64_t high, uint64_t *value)
{{
    uint64_t found = 0U;
    for (size_t index = 0U; index < size; ++index) {{
        const uint8_t octet = from[index];
        uint64_t digit = 0U;
        if ((octet >= 0x30U) && (octet <= 0x39U)) {{
            digit = (uint64_t)octet - 0x30U;
        }} else if ((octet >= 0x41U) && (octet <= 0x46U)) {{
            digit = (uint64_t)octet - 0x37U;
        }} else if ((octet >= 0x61U) && (octet <= 0x66U)) {{
            digit = (uint64_t)octet - 0x57U;
        }} else {{
            return false;
        }}
        if ((digit > high) || (found > ((high - digit) >> 4))) {{
            return false;
        }}
        found = (found << 4) | digit;
    }}
    *value = found;
    return size > 0U;
}}

static inline bool {p}_is_hex_(const uint8_t *from, size_t size, uint64_t high)
{{
    uint64_t value = 0U;
    return {p}_read_hex_(from, size, high, &value);
}}

static inline uint64_t {p}_get_hex_(const uint8_t *from, size_t size, uint64_t high)
{{
    uint64_t value = 0U;
    (void){p}_read_hex_(from, size, high, &value);
    return value;
}}"""

_PUT_HEX = """\
static inline void {p}_put_hex_(uint8_t *to, size_t size, uint64_t value)
{{
    uint64_t left = value;
    for (size_t index = size; index > 0U; --index) {{
        const uint8_t digit = (uint8_t)(left & 0x0FU);
        to[index - 1U] = (uint8_t)(digit + ((digit < 10U) ? 0x30U : 0x37U));
        left >>= 4;
    }}
}}"""

_SIZE_HEX = """\
static inline size_t {p}_size_hex_(size_t least, size_t most, uint64_t value)
{{
    uint64_t left = value >> 4;
    size_t size = 1U;
    while (left > 0U) {{
        left >>= 4;
        ++size;
    }}
    if (size > most) {{
        size = most; /* the value is out of range */
    }}
    return (size > least) ? size : least;
}}"""

_CELLS = """\
static inline size_t {p}_text_size_(const uint8_t *text, size_t size, uint8_t end)
{{
    size_t index = 0U;
    while ((index < size) && (text[index] != end)) {{
        ++index;
    }}
    return index;
}}

static inline size_t {p}_texts_(const uint8_t *text, size_t size, uint8_t separator)
{{
    size_t number = 1U;
    for (size_t index = 0U; index < size; ++index) {{
        if (text[index] == separator) {{
            ++number;
        }}
    }}
    return number;
}}"""

#: In place of a base: a decimal number after spaces.
_SPACED = -10

#: In place of a base: a floating-point number.
REAL = 2

_TEXTS = {
    (0, "get"): _CELLS,
    (10, "get"): _READ_DECIMAL,
    (10, "put"): _PUT_DECIMAL,
    (10, "size"): _SIZE_DECIMAL,
    (_SPACED, "get"): _READ_SPACED,
    (_SPACED, "put"): _PUT_SPACED,
    (16, "get"): _READ_HEX,
    (16, "put"): _PUT_HEX,
    (16, "size"): _SIZE_HEX,
    (REAL, "get"): READ,
    (REAL, "put"): PUT,
}


def form_of(text: Digits) -> tuple[int, str]:
    """The key of the functions of a form, and what their names end with."""
    if text.spaced:
        return _SPACED, "spaced"
    return text.base, "decimal" if text.base == 10 else "hex"


def needed_with(key: int, verb: Verb) -> set[tuple[int, Verb]]:
    """A function and those that it calls."""
    found: set[tuple[int, Verb]] = {(key, verb)}
    if key == REAL:
        return {(key, "get")} if verb == "get" else {(key, "get"), (key, "put")}
    if key == _SPACED:
        found |= {(10, "put"), (10, "size")} if verb == "put" else {(10, "get")}
    return found


def text_helpers(prefix: str, needed: Collection[tuple[int, Verb]]) -> list[Helper]:
    """The functions for these bases and verbs."""
    names = {
        0: "Texts between separators",
        10: "A decimal number as text",
        _SPACED: "A decimal number after spaces",
        16: "A hexadecimal number as text",
        REAL: "A floating-point number as text",
    }
    return [
        Helper(names[key[0]], tuple(text.format(p=prefix).splitlines()))
        for key, text in _TEXTS.items()
        if key in needed
    ]
