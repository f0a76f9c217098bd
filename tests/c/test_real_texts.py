"""Floating-point numbers as text in C: sent and read as by the model, to the last bit."""

from __future__ import annotations

import random
import struct
import subprocess
from collections.abc import Callable
from pathlib import Path

from qlinkgen.backends.c.real_texts import PUT, READ
from qlinkgen.model.scientific import Scientific
from tests.support.cdriver import WARNINGS

#: How many numbers are sent, and texts read, of each size.
NUMBERS, TEXTS = 1000, 600
_HEAD = """\
#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <string.h>
"""
_MAIN = r"""
/* Answers "p WIDTH BITS" with the text of a number, and "r WIDTH TEXT" with the bits of a text, or "none". */
int main(void)
{
    char what;
    unsigned width;
    char word[40];
    while (scanf(" %c %u %39s", &what, &width, word) == 3) {
        unsigned long long bits = 0U;
        uint64_t value = 0U;
        uint8_t text[24];
        if (what == 'p') {
            size_t size;
            (void)sscanf(word, "%llx", &bits);
            size = t_size_real_((uint64_t)bits, (uint32_t)width);
            t_put_real_(text, size, (uint64_t)bits, (uint32_t)width);
            printf("%.*s\n", (int)size, (const char *)text);
        } else if (t_is_real_((const uint8_t *)word, strlen(word), (uint32_t)width)) {
            value = t_get_real_((const uint8_t *)word, strlen(word), (uint32_t)width);
            printf("%llx\n", (unsigned long long)value);
        } else {
            printf("none\n");
        }
    }
    return 0;
}
"""


def _width(bits: int) -> int:
    """Bits of the significand, the hidden one included."""
    return 24 if bits == 32 else 53


def _number(rng: random.Random, bits: int) -> int:
    """The bits of a finite number: any, beside a power of two, or the nearest to a short decimal number."""
    exponents, after = 1 << bits - _width(bits), _width(bits) - 1
    which = rng.randrange(3)
    if which == 0:
        raw = rng.getrandbits(bits - 1)
    elif which == 1:
        raw = (rng.randrange(exponents) << after) + rng.randint(-2, 2)
    else:
        power = rng.randint(-330, 295) if bits == 64 else rng.randint(-50, 25)
        raw = Scientific(bits).number(b"%dE%d" % (rng.randrange(10 ** rng.randint(1, 14)), power)) or 0
    largest = (exponents - 1 << after) - 1
    return rng.getrandbits(1) << bits - 1 | min(max(raw, 0), largest)


def _text(rng: random.Random, bits: int) -> bytes:
    """Half way between two numbers or nearly so, a number with any count of digits, or any characters."""
    which = rng.randrange(3)
    if which == 0:
        middle, width = rng.getrandbits(_width(bits) - 1) << 1, _width(bits)
        end = rng.choice((b"", b".", b"E0", b".00001", b"e-3", b"E+12"))
        return b"%d%s" % ((1 << width) + middle + 1 - rng.choice((0, 0, 1)), end)
    if which == 1:
        packed = _number(rng, bits).to_bytes(bits // 8, "big")
        return b"%.*E" % (rng.randint(0, 16), struct.unpack(">f" if bits == 32 else ">d", packed)[0])
    return bytes(rng.choices(b"0123456789.+-eE", [6] * 10 + [3, 1, 1, 2, 2], k=rng.randint(1, 24)))


def test_c_agrees_with_the_model(tmp_path: Path, require_tool: Callable[..., str]) -> None:
    compiler = require_tool("gcc", package="gcc")
    (tmp_path / "main.c").write_text("\n".join((_HEAD, READ.format(p="t"), PUT.format(p="t"), _MAIN)))
    flags = ["-O2", "-std=c99", *WARNINGS]
    subprocess.run([compiler, *flags, "main.c", "-o", "main"], cwd=tmp_path, check=True, timeout=60)
    rng, asked, due = random.Random(15), list[str](), list[str]()
    for bits in (32, 64):
        form = Scientific(bits)
        for _ in range(NUMBERS):
            raw = _number(rng, bits)
            asked.append(f"p {_width(bits)} {raw:x}")
            due.append(form.text(raw).decode())
        for _ in range(TEXTS):
            text = _text(rng, bits)
            found = form.number(text)
            asked.append(f"r {_width(bits)} {text.decode()}")
            due.append("none" if found is None else f"{found:x}")
    said = subprocess.run(
        tmp_path / "main", input="\n".join(asked), text=True, capture_output=True, check=True, timeout=60
    )
    wrong = [each for each in zip(asked, said.stdout.splitlines(), due, strict=True) if each[1] != each[2]]
    assert not wrong
