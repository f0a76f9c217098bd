"""Characters that a terminal obeys are shown as escapes."""

from __future__ import annotations

import json

from qlinkgen.model.texts import escaped, one_line


def test_an_escape_is_that_of_python_and_json() -> None:
    for number in (0x1B, 0x7F, 0xFF, 0x100, 0x2028, 0xFEFF):
        text = escaped(chr(number))
        assert text == (f"\\x{number:02x}" if number <= 0xFF else json.dumps(chr(number)).strip('"'))
        assert eval(f'"{text}"') == chr(number)


def test_a_text_fits_on_a_line() -> None:
    assert one_line(" a \n\t b\x1b[1m ") == "a b\\x1b[1m"
