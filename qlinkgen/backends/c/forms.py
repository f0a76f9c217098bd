"""Functions for numbers that are not bytes of an integer of C: wide ones, decimal digits, rows of bits."""

from __future__ import annotations

from collections.abc import Collection

from qlinkgen._dataclass import dataclass
from qlinkgen.model.integer import BitOrder


@dataclass(frozen=True, slots=True)
class Helper:
    """The functions of one layout."""

    comment: str
    lines: tuple[str, ...]


def wide_helpers(prefix: str, wides: Collection[tuple[str, str]]) -> list[Helper]:
    """The type of integers of more than 64 bits, and its functions: verb and byte order."""
    if not wides:
        return []
    kind = f"{prefix}_int128_t"
    struct = (
        "typedef struct " + kind.removesuffix("_t") + " {",
        "    uint64_t high;",
        "    uint64_t low;",
        f"}} {kind};",
    )
    found = [Helper("An integer of more than 64 bits: two's complement in two halves", struct)]
    for verb, order in sorted(wides):
        at = "size - 1U - index" if order == "be" else "index"
        loop = "for (size_t index = 0U; index < size; ++index) {"
        if verb == "put":
            lines = [
                f"static inline void {prefix}_put_wide_{order}_(uint8_t *to, size_t size, {kind} value)",
                "{",
                f"    {loop}",
                "        const uint64_t half = (index < 8U) ? value.low : value.high;",
                f"        to[{at}] = (uint8_t)((half >> (8U * (index % 8U))) & 0xFFU);",
                "    }",
                "}",
            ]
        elif verb == "get":
            lines = [
                f"static inline {kind} {prefix}_get_wide_{order}_(const uint8_t *from, size_t size)",
                "{",
                f"    {kind} value = {{0U, 0U}};",
                f"    {loop}",
                f"        const uint64_t byte = (uint64_t)from[{at}] << (8U * (index % 8U));",
                "        if (index < 8U) {",
                "            value.low |= byte;",
                "        } else {",
                "            value.high |= byte;",
                "        }",
                "    }",
                "    return value;",
                "}",
            ]
        else:
            lines = [
                f"static inline {kind} {prefix}_extend_wide_({kind} value, uint64_t sign)",
                "{",
                "    value.high = (value.high ^ sign) - sign;",
                "    return value;",
                "}",
            ]
        found.append(Helper("", tuple(lines)))
    return found


def decimal_helpers(prefix: str, decimals: Collection[tuple[str, int, str]]) -> list[Helper]:
    """Binary-coded decimal: verb, width of the C type, byte order."""
    found = []
    for verb, width, order in sorted(decimals):
        kind, name = f"uint{width}_t", f"{prefix}_{verb}_bcd{width}_{order}_"
        up, down = "size_t index = 0U; index < size; ++index", "size_t index = size; index > 0U; --index"
        if verb == "check":
            head = f"static inline bool {prefix}_is_bcd_(const uint8_t *from, size_t size)"
            body = [
                f"for ({up}) {{",
                "    if (((from[index] >> 4) > 9U) || ((from[index] & 0x0FU) > 9U)) {",
                "        return false;",
                "    }",
                "}",
                "return true;",
            ]
        elif verb == "put":
            head = f"static inline void {name}(uint8_t *to, size_t size, {kind} value)"
            at = "index - 1U" if order == "be" else "index"
            body = [
                f"for ({down if order == 'be' else up}) {{",
                f"    to[{at}] = (uint8_t)((((value / 10U) % 10U) << 4) | (value % 10U));",
                f"    value = ({kind})(value / 100U);",
                "}",
            ]
        else:
            head = f"static inline {kind} {name}(const uint8_t *from, size_t size)"
            at = "index" if order == "be" else "index - 1U"
            body = [
                f"{kind} value = 0U;",
                f"for ({up if order == 'be' else down}) {{",
                f"    const uint8_t tens = (uint8_t)(from[{at}] >> 4);",
                f"    const uint8_t ones = (uint8_t)(from[{at}] & 0x0FU);",
                f"    value = ({kind})((value * 100U) + (({kind})tens * 10U) + ones);",
                "}",
                "return value;",
            ]
        lines = [head, "{", *(f"    {line}" for line in body), "}"]
        found.append(Helper("Binary-coded decimal, two digits a byte", tuple(lines)))
    return found


def row_helpers(prefix: str, rows: Collection[tuple[str, int, BitOrder]]) -> list[Helper]:
    """Rows of bits: verb, width of the C type, order."""
    found = []
    for width, order in sorted({(width, order) for _, width, order in rows}):
        lines: list[str] = []
        place = "at % 8U" if order == "least" else "7U - (at % 8U)"
        index = "bit" if order == "least" else "bits - 1U - bit"
        parameters = "size_t at, size_t bits"
        kind, name = f"uint{width}_t", f"row_{order}_{width}_"
        if ("put", width, order) in rows:
            lines += [
                f"static inline void {prefix}_put_{name}(uint8_t *to, {parameters}, {kind} value)",
                "{",
                "    for (size_t bit = 0U; bit < bits; ++bit, ++at) {",
                f"        const unsigned int one = (unsigned int)(value >> ({index})) & 1U;",
                f"        to[at / 8U] = (uint8_t)(to[at / 8U] | (one << ({place})));",
                "    }",
                "}",
            ]
        if ("get", width, order) in rows:
            lines += [
                f"static inline {kind} {prefix}_get_{name}(const uint8_t *from, {parameters})",
                "{",
                f"    {kind} value = 0U;",
                "    for (size_t bit = 0U; bit < bits; ++bit, ++at) {",
                f"        const {kind} one = ({kind})(((unsigned int)from[at / 8U] >> ({place})) & 1U);",
                f"        value = ({kind})(value | ({kind})(one << ({index})));",
                "    }",
                "    return value;",
                "}",
            ]
        found.append(Helper(f"Numbers in a row of bits, {order} significant ones first", tuple(lines)))
    return found
