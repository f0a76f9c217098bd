"""Style of headers: no long lines, uniform wrapping, no statements without effect."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from qlinkgen.backends.base import Options
from qlinkgen.backends.c.tidy import tidy
from tests.c.conftest import PROTOCOLS
from tests.c.test_compile import ROLES, header

WIDTH = 120


@pytest.mark.parametrize("name", PROTOCOLS)
def test_lines_fit_the_page(name: str, tmp_path: Path) -> None:
    for role in ROLES:
        lines = header(name, tmp_path, Options(role=role)).splitlines()
        assert not [line for line in lines if len(line) > WIDTH or line != line.rstrip() or "\t" in line]


@pytest.mark.parametrize("name", PROTOCOLS)
def test_signatures_are_wrapped_in_one_way(name: str, tmp_path: Path) -> None:
    """On one line if it fits, otherwise all parameters on the next line or on several."""
    text = header(name, tmp_path)
    signatures = re.findall(r"^static inline [^{]*?\n\{$", text, re.MULTILINE)
    assert len(signatures) > 10
    for signature in signatures:
        first, *more = signature.removesuffix("\n{").splitlines()
        whole = first + " ".join(line.strip() for line in more)
        parameters = "    " + " ".join(line.strip() for line in more)
        assert (len(more) > 1) == (len(parameters) > WIDTH)
        assert first.endswith("(") == bool(more) == (len(whole) > WIDTH)


@pytest.mark.parametrize(
    ("text", "folded"),
    [
        ("int x; /* " + "word " * 30 + "*/", "/* " + "word " * 22 + "word\n * " + "word " * 7 + "*/\nint x;"),
        ("    int x; /* " + "w" * 105 + " */", "    /* " + "w" * 105 + " */\n    int x;"),
        ("/* " + "word " * 24 + "\n * more. */", "/* " + "word " * 22 + "word\n * word more. */"),
        (
            "#define X { " + "10u, " * 23 + "1u }",
            "#define X { " + "10u, " * 20 + "10u, \\\n    10u, 10u, 1u }",
        ),
        ('#error "' + "word " * 24 + '"', '#error "' + "word " * 21 + '" \\\n    "word word word"'),
    ],
)
def test_long_lines_are_folded(text: str, folded: str) -> None:
    assert tidy(text).split() == folded.split()
    assert all(len(line) <= WIDTH for line in tidy(text).splitlines())
