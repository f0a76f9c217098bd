"""Functions for floating-point numbers as text, of whole numbers alone: neither libc nor floats are needed.

A number is a fixed-point one of 72 cells of 32 bits, 34 of which are after the point. That holds each number
exactly, and each text exactly enough to round it.
"""

from __future__ import annotations

READ = """\
/* Multiplies by ten and adds a digit; returns what is carried. */
static inline uint32_t {p}_real_times_(uint32_t *cells, size_t count, uint32_t digit)
{{
    uint32_t carried = digit;
    for (size_t index = 0U; index < count; ++index) {{
        const uint64_t product = ((uint64_t)cells[index] * 10U) + carried;
        cells[index] = (uint32_t)(product & 0xFFFFFFFFU);
        carried = (uint32_t)(product >> 32);
    }}
    return carried;
}}

/* Divides by ten; returns the rest. */
static inline uint32_t {p}_real_tenth_(uint32_t *cells, size_t count)
{{
    uint64_t rest = 0U;
    for (size_t index = count; index > 0U; --index) {{
        const uint64_t part = (rest << 32) | cells[index - 1U];
        cells[index - 1U] = (uint32_t)(part / 10U);
        rest = part % 10U;
    }}
    return (uint32_t)rest;
}}

static inline bool {p}_real_is_zero_(const uint32_t *cells, size_t count)
{{
    uint32_t found = 0U;
    for (size_t index = 0U; index < count; ++index) {{
        found |= cells[index];
    }}
    return found == 0U;
}}

/* The exponent after an E, at most 9999; false if there is none. */
static inline bool {p}_real_exponent_(const uint8_t *from, size_t size, int32_t *exponent)
{{
    const bool negative = (size > 0U) && (from[0] == 0x2DU);
    size_t index = ((size > 0U) && (negative || (from[0] == 0x2BU))) ? 1U : 0U;
    int32_t found = 0;
    if (index == size) {{
        return false;
    }}
    for (; index < size; ++index) {{
        if ((from[index] < 0x30U) || (from[index] > 0x39U)) {{
            return false;
        }}
        found = (found * 10) + ((int32_t)from[index] - 0x30);
        found = (found > 9999) ? 9999 : found;
    }}
    *exponent = negative ? -found : found;
    return true;
}}

/* The bits of the nearest number to a positive fixed-point one, ties to even; `more`: it is larger. */
static inline uint64_t {p}_real_nearest_(const uint32_t *cells, bool more, uint32_t width)
{{
    const size_t base = (width == 24U) ? 939U : 14U; /* place of the last bit of the smallest numbers */
    size_t top = 72U * 32U;
    size_t place;
    size_t shift;
    uint64_t found;
    uint32_t below;
    uint32_t half;
    while ((top > 0U) && (((cells[(top - 1U) / 32U] >> ((top - 1U) % 32U)) & 1U) == 0U)) {{
        --top;
    }}
    place = (top > (base + width)) ? (top - width) : base;
    shift = place % 32U;
    found = ((((uint64_t)cells[(place / 32U) + 1U]) << 32) | cells[place / 32U]) >> shift;
    if (shift > 0U) {{
        found |= ((uint64_t)cells[(place / 32U) + 2U]) << (64U - shift);
    }}
    half = (uint32_t)1U << ((place - 1U) % 32U);
    below = cells[(place - 1U) / 32U];
    if ((below & half) != 0U) {{
        const bool rest = more || ((below & (half - 1U)) != 0U);
        const bool up = rest || ((found & 1U) != 0U) || !{p}_real_is_zero_(cells, (place - 1U) / 32U);
        found += up ? 1U : 0U;
    }}
    return found + ((uint64_t)(place - base) << (width - 1U));
}}

static inline bool {p}_read_real_(const uint8_t *from, size_t size, uint32_t width, uint64_t *value)
{{
    const bool negative = (size > 0U) && (from[0] == 0x2DU);
    const uint64_t infinite = ((width == 24U) ? 0xFFULL : 0x7FFULL) << (width - 1U);
    const uint64_t sign = negative ? ((infinite << 1) & ~infinite) : 0U;
    uint32_t cells[72] = {{ 0U }};
    int32_t exponent = 0;
    bool digits = false;
    bool pointed = false;
    bool more = false;
    size_t index = ((size > 0U) && (negative || (from[0] == 0x2BU))) ? 1U : 0U;
    for (; index < size; ++index) {{
        const uint8_t octet = from[index];
        if ((octet >= 0x30U) && (octet <= 0x39U)) {{
            digits = true;
            exponent -= pointed ? 1 : 0;
            if ({p}_real_times_(&cells[34], 38U, (uint32_t)octet - 0x30U) != 0U) {{
                return false;
            }}
        }} else if ((octet == 0x2EU) && !pointed) {{
            pointed = true;
        }} else if (((octet == 0x45U) || (octet == 0x65U)) && digits) {{
            int32_t given = 0;
            ++index;
            if (!{p}_real_exponent_(&from[index], size - index, &given)) {{
                return false;
            }}
            exponent += given;
            index = size - 1U;
        }} else {{
            return false;
        }}
    }}
    *value = sign;
    if (!digits || {p}_real_is_zero_(cells, 72U) || (exponent < -400)) {{
        return digits;
    }}
    if (exponent > 310) {{
        return false;
    }}
    for (; exponent > 0; --exponent) {{
        (void){p}_real_times_(&cells[34], 38U, 0U);
    }}
    for (; exponent < 0; ++exponent) {{
        more = ({p}_real_tenth_(cells, 72U) != 0U) || more;
    }}
    *value = {p}_real_nearest_(cells, more, width);
    if (*value >= infinite) {{
        return false;
    }}
    *value |= sign;
    return true;
}}

static inline bool {p}_is_real_(const uint8_t *from, size_t size, uint32_t width)
{{
    uint64_t value = 0U;
    return {p}_read_real_(from, size, width, &value);
}}

static inline uint64_t {p}_get_real_(const uint8_t *from, size_t size, uint32_t width)
{{
    uint64_t value = 0U;
    (void){p}_read_real_(from, size, width, &value);
    return value;
}}"""

PUT = """\
/* Writes so many significant digits, correctly rounded, and the exponent; returns their size. */
static inline size_t {p}_real_digits_(uint8_t *to, uint64_t value, uint32_t width, size_t count)
{{
    const uint64_t hidden = 1ULL << (width - 1U);
    const uint64_t biased = (value >> (width - 1U)) & ((width == 24U) ? 0xFFU : 0x7FFU);
    const uint64_t bits = (value & (hidden - 1U)) | ((biased > 0U) ? hidden : 0U);
    const size_t place = ((width == 24U) ? 939U : 14U) + ((biased > 0U) ? ((size_t)biased - 1U) : 0U);
    const uint64_t low = (bits & 0xFFFFFFFFU) << (place % 32U);
    const uint64_t high = (bits >> 32) << (place % 32U);
    uint32_t cells[72] = {{ 0U }};
    uint8_t digits[18] = {{ 0U }};
    size_t filled = 0U;
    size_t size = 0U;
    size_t index;
    int32_t exponent = -1;
    uint32_t power;
    bool rest = false;
    cells[place / 32U] = (uint32_t)(low & 0xFFFFFFFFU);
    cells[(place / 32U) + 1U] = (uint32_t)((low >> 32) | (high & 0xFFFFFFFFU));
    cells[(place / 32U) + 2U] = (uint32_t)(high >> 32);
    while (!{p}_real_is_zero_(&cells[34], 38U)) {{
        rest = rest || (digits[17] != 0U);
        for (index = 17U; index > 0U; --index) {{
            digits[index] = digits[index - 1U];
        }}
        digits[0] = (uint8_t){p}_real_tenth_(&cells[34], 38U);
        filled += (filled < 18U) ? 1U : 0U;
        ++exponent;
    }}
    while ((bits > 0U) && (filled <= count)) {{
        digits[filled] = (uint8_t){p}_real_times_(cells, 34U, 0U);
        if ((filled > 0U) || (digits[0] > 0U)) {{
            ++filled;
        }} else {{
            --exponent;
        }}
    }}
    if (bits == 0U) {{
        exponent = 0;
    }}
    for (index = count + 1U; index < 18U; ++index) {{
        rest = rest || (digits[index] != 0U);
    }}
    rest = rest || !{p}_real_is_zero_(cells, 34U) || ((digits[count - 1U] & 1U) != 0U);
    if ((digits[count] > 5U) || ((digits[count] == 5U) && rest)) {{
        index = count;
        while ((index > 0U) && (digits[index - 1U] == 9U)) {{
            --index;
            digits[index] = 0U;
        }}
        if (index > 0U) {{
            ++digits[index - 1U];
        }} else {{
            digits[0] = 1U;
            ++exponent;
        }}
    }}
    if (((value >> (width - 1U)) >> ((width == 24U) ? 8U : 11U)) != 0U) {{
        to[size] = 0x2DU;
        ++size;
    }}
    for (index = 0U; index < count; ++index) {{
        if (index == 1U) {{
            to[size] = 0x2EU;
            ++size;
        }}
        to[size] = (uint8_t)(0x30U + digits[index]);
        ++size;
    }}
    to[size] = 0x45U;
    to[size + 1U] = (exponent < 0) ? 0x2DU : 0x2BU;
    size += 2U;
    power = (uint32_t)((exponent < 0) ? -exponent : exponent);
    if (power > 99U) {{
        to[size] = (uint8_t)(0x30U + (power / 100U));
        ++size;
    }}
    to[size] = (uint8_t)(0x30U + ((power / 10U) % 10U));
    to[size + 1U] = (uint8_t)(0x30U + (power % 10U));
    return size + 2U;
}}

/* Writes the fewest digits that are read as the same number. */
static inline size_t {p}_real_shortest_(uint8_t *to, uint64_t value, uint32_t width)
{{
    const size_t most = (width == 24U) ? 9U : 17U;
    size_t size = 0U;
    uint64_t same = 0U;
    for (size_t count = 1U; count <= most; ++count) {{
        size = {p}_real_digits_(to, value, width, count);
        if ({p}_read_real_(to, size, width, &same) && (same == value)) {{
            break;
        }}
    }}
    return size;
}}

static inline size_t {p}_size_real_(uint64_t value, uint32_t width)
{{
    uint8_t text[24];
    return {p}_real_shortest_(text, value, width);
}}

static inline void {p}_put_real_(uint8_t *to, size_t size, uint64_t value, uint32_t width)
{{
    uint8_t text[24];
    (void){p}_real_shortest_(text, value, width);
    for (size_t index = 0U; index < size; ++index) {{
        to[index] = text[index];
    }}
}}"""
