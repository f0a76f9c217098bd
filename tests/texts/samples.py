"""Texts that a schema may contain: ordinary ones with characters special in code, and some that imitate code.

If these are executed, they create a file named `canary` in the current folder, or do not compile.
"""

from __future__ import annotations

HARMLESS = "plain words"

ORDINARY = (
    'a 3" disc',
    '"',
    'he said """stop"""',
    '""',
    "user's guide",
    "'''",
    "C:\\Users\\manual.pdf",
    "ends with a backslash \\",
    "\\",
    "\\N{BULLET} \\u0041 \\x41 \\0 \\",
    "two lines,\nthe second one",
    "a\ttab",
    "a */ b",
    "/* c",
    "*/*/ **// /*/",
    "what??/",
    "what???/ ??= ??' really??!",
    "// line",
    "# hash # noqa # type: ignore",
    "%s %(name)d %",
    "{0} {name!r} {}",
    "{{ title }} {% raw %} {# c #}",
    "<b> & [bold]red[/bold] [/] :warning:",
    "größe in µm, 25 °C, 単位, \U0001f600",
    "no\u00a0break",
    "Decimal( Scale( Callable struct_error unpack_from( MeasureRequest",
    "def public(): pass",
    "null",
    "7.10",
    ". . .",
    "word" * 60,
)

_TOUCH = "__import__('pathlib').Path('canary').touch()"
HOSTILE = (
    f'mm" if not {_TOUCH} else "',
    f"mm' if not {_TOUCH} else '",
    f'""" + str({_TOUCH}) + """',
    f'"""\n{_TOUCH}\n"""',
    f"x\n{_TOUCH}\n# y",
    f'\\"""\n{_TOUCH}\n"""',
    f'", {_TOUCH}, "',
    f"{{{_TOUCH}}}",
    f"{{{{ {_TOUCH} }}}}",
    "{{ cycler.__init__.__globals__.os.mkdir('canary') }}",
    "*/ int canary; /*",
    "*/\n#error canary\n/*",
    "??/\n*/ int canary; /*",
    "\\\n#error canary",
    '"\n#error canary\n"',
)

TEXTS = (*ORDINARY, *HOSTILE)


def turned(step: int) -> list[tuple[str, ...]]:
    """Rotations of all texts, to be assigned to slots one after the other."""
    return [(*TEXTS[first:], *TEXTS[:first]) for first in range(0, len(TEXTS), step)]


#: Schemas and texts for their slots: each text alone in the richest schema, mixed in the others.
CASES = (
    *(("delimited", (text,)) for text in TEXTS),
    *((name, texts) for name in ("marked", "packet") for texts in turned(6)),
)


def harmless(texts: tuple[str, ...]) -> tuple[str, ...]:
    """As many texts without a meaning in any language; they differ, because equal units, say, are merged."""
    return tuple(f"{HARMLESS} {number}" for number in range(len(texts)))
